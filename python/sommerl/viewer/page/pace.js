/** How much is traced at once: a slow device gets coarser pictures while they move, and fewer rows at once while they don't. */
import { clamp } from "./vectors.js";

const REST = 150; // ms without a change, after which a picture does not move
// ms that tracing may take, beyond which less is traced at once, or more.
const LIMITS = { moving: { slow: 40, fast: 18 }, still: { slow: 150, fast: 60 } };
const [COARSEST, SMALLEST_SHARE] = [0.25, 1 / 64];

export class Pace {
    constructor() {
        this.resolution = 0.5; // of pictures that move
        this.share = 0.25; // of the rows of others
        this.moved = -Infinity; // when it last did
        this.begun = NaN; // when tracing last began, if that is not over
    }

    isMoving(now) {
        return now - this.moved < REST;
    }

    begin(now) {
        this.begun = now;
    }

    /** Tracing is over. */
    end(now) {
        const took = now - this.begun;
        this.begun = NaN;
        if (!(took > 0)) return;
        const moving = this.isMoving(now);
        const { slow, fast } = LIMITS[moving ? "moving" : "still"];
        const change = took > slow ? 0.7 : took < fast ? 1.3 : 1;
        if (moving) this.resolution = clamp(this.resolution * change, COARSEST, 1);
        else this.share = clamp(this.share * change, SMALLEST_SHARE, 1);
    }
}
