/** The loop that draws: what the state asks for, as soon as all is there, and ever less noisy. */
import { Pace } from "./pace.js";
import { traced } from "./state.js";

const MOST_PATHS = { plain: 16, lamp: 256, environment: 4096 };
const SETTLED = 16; // paths, of which the exposure is taken for good
const MOST_PIXELS = 3.2e6; // of the canvas: more would be slow, and take much memory
const DEPENDS = ["scene", "azimuth", "elevation", "zoom", "light", "environment"]; // the state's names that paths depend on

export class Loop {
    /** calls: {said(words), compared(figures | null), exposed(), saved(blob), failed(message)}. */
    constructor(canvas, picture, store, state, calls) {
        Object.assign(this, { canvas, picture, store, state, calls });
        this.pace = new Pace();
        this.exposing = state.scale === 0; // whether the exposure follows the picture
        this.entry = null; // whose pixels are marked
        this.restart();
        this.next();
    }

    next() {
        requestAnimationFrame(async (now) => {
            try {
                await this.step(now);
                this.next();
            } catch (error) {
                this.calls.failed(`drawing has stopped: ${error.message}`);
            }
        });
    }

    /** Draws again what the state now asks for; from the first path on, if paths depend on what has changed. */
    update(before) {
        const { state } = this;
        const depends = (one) => [traced(one), one.view === "side", ...DEPENDS.map((name) => one[name])].join();
        if (depends(state) !== depends(before)) this.restart();
        if (!state.scale) this.exposing = true;
        this.exposedFor = 0;
        this.stale = true;
    }

    /** Begins the picture anew. */
    restart() {
        this.anew = true;
        this.stale = true;
        this.pace.moved = performance.now();
    }

    async step(now) {
        const { state, picture, pace } = this;
        if (picture.device.busy) return;
        pace.end(now);
        if (this.fit()) this.restart(); // which has emptied the canvas: what is coarse is there soon
        const numbers = traced(state);
        const moving = pace.isMoving(now);
        const bounces = moving && !state.environment && !picture.renderer.isPlain(state, 1) ? 0 : 1;
        if (!this.store.has(numbers, state, bounces)) return;
        const resolution = moving ? pace.resolution : 1;
        const other = resolution !== this.resolution || bounces !== this.bounces;
        if (other || this.anew) this.begin(numbers, bounces, resolution);
        const kind = picture.renderer.isPlain(state, bounces) ? "plain" : state.environment ? "environment" : "lamp";
        if (picture.count < MOST_PATHS[kind]) {
            picture.trace(numbers.map((number) => this.store.prepared.get(number)), state, bounces, moving ? 1 : pace.share);
            pace.begin(now);
            this.stale = true;
        }
        if (this.stale && picture.count) await this.show(MOST_PATHS[kind], moving); // until then, there is what was before
    }

    begin(numbers, bounces, resolution) {
        this.picture.begin(numbers.length, this.state.view === "side", resolution);
        Object.assign(this, { bounces, resolution, drawn: numbers, anew: false, compared: 0, exposedFor: 0, marked: false });
        this.calls.compared(null);
    }

    async show(most, moving) {
        const { state, picture } = this;
        this.stale = false; // what changes from here on is shown the next time
        await this.expose();
        if (!this.marked) this.mark();
        if (!moving || state.view === "flip") await this.compare(most);
        picture.show(state);
        const paths = picture.count >= most ? `${most} paths a pixel` : `${picture.count} of ${most} paths a pixel`;
        this.calls.said(most > MOST_PATHS.plain ? paths : "");
        this.first ??= performance.now(); // ms from opening to a picture
        if (this.saving && this.resolution === 1) this.keep();
    }

    /** Follows the picture with the exposure, each time it has twice as many paths, until it has enough. */
    async expose() {
        const { count } = this.picture;
        if (!this.exposing || count < Math.min(2 * this.exposedFor, SETTLED)) return;
        this.exposedFor = count;
        const scale = await this.picture.exposure();
        if (this.anew) return; // it is that of another picture
        this.state.scale = scale || 1;
        if (count < SETTLED || this.resolution < 1) return;
        this.exposing = false;
        this.calls.exposed();
    }

    /** Takes figures each time there are twice as many paths, and when the picture is shown otherwise. */
    async compare(most) {
        const { picture, state } = this;
        if (picture.films.length < 2) return;
        const how = [state.view === "flip", state.scale, state.stops, state.tone].join();
        const due = picture.count >= 2 * this.compared || (picture.count === most && this.compared < most);
        if (!due && how === this.comparedFor) return;
        [this.compared, this.comparedFor] = [picture.count, how];
        const figures = await picture.figures(state);
        if (!this.anew) this.calls.compared(figures);
    }

    /** entry: {material, entry, shape, gain} as panels have it, or null. */
    highlight(entry) {
        Object.assign(this, { entry, marked: false, stale: true });
    }

    mark() {
        const { entry, state, picture } = this;
        const which = entry?.material === 1 ? 1 : 0;
        const prepared = entry && this.store.prepared.get(which ? state.b : state.a);
        picture.mark(prepared, state, which, prepared ? [entry.entry ?? entry.shape ?? -1, entry.gain ?? -1] : null);
        this.marked = true;
    }

    /** Fits the canvas to its place; returns whether it has changed. */
    fit() {
        const { canvas } = this;
        const places = [canvas.clientWidth, canvas.clientHeight].map((x) => x * devicePixelRatio);
        const share = Math.min(1, Math.sqrt(MOST_PIXELS / (places[0] * places[1])), this.picture.device.longest / Math.max(...places));
        const [width, height] = places.map((x) => Math.max(Math.round(x * share), 16));
        if (canvas.width === width && canvas.height === height) return false;
        [canvas.width, canvas.height] = [width, height];
        return true;
    }

    /** Saves the picture, as soon as it is shown whole and sharp. */
    save() {
        Object.assign(this, { saving: true, stale: true });
    }

    keep() {
        this.saving = false;
        this.canvas.toBlob((blob) => this.calls.saved(blob));
    }
}
