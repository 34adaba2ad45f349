/** The picture on the canvas: films of one material or two, and how they are shown. */
import { Flip, meanOf, psnr } from "./figures.js";
import { Renderer } from "./renderer.js";
import { SHADERS } from "./shaders.js";
import { TONES, VIEWS } from "./state.js";
import { SCENES } from "./camera.js";

const BEHIND = 0.13; // grey in sRGB, behind an object that is alone: its unlit side is black
const [PERCENTILE, EXPOSED_TO] = [0.9, 0.6]; // as `sommerl render` exposes: that share of the object's pixels is at most so bright

export class Picture {
    /** device: that draws on this canvas (device.js). */
    constructor(canvas, device) {
        Object.assign(this, { canvas, device });
        this.renderer = new Renderer(device);
        this.display = device.program(SHADERS.display);
        this.films = [];
        this.shown = [];
        this.used = null; // where an entry's pixels are marked
        this.flip = null;
        this.map = null;
    }

    /** Begins anew, with pictures for so many materials that are side by side or not. resolution: as a share of the canvas's. */
    begin(count, side, resolution) {
        const pixelsOf = (x) => Math.max(Math.round(x * resolution), 8);
        const [each, height] = [pixelsOf(side ? Math.floor(this.canvas.width / 2) : this.canvas.width), pixelsOf(this.canvas.height)];
        if (this.films.length !== count || this.films[0].width !== each || this.films[0].height !== height) {
            this.films.forEach((film) => this.renderer.free(film));
            this.device.free(...this.shown, ...(this.used ? [this.used] : []));
            this.films = Array.from({ length: count }, () => this.renderer.film(each, height));
            this.shown = this.films.map(() => this.device.target(each, height, false));
            this.used = null;
        }
        for (const film of this.films) [film.count, film.row] = [0, 0];
        this.map = null;
    }

    get count() {
        return this.films[0]?.count ?? 0;
    }

    /** One more path for each pixel of the next rows. prepared: the materials on the GPU, A and B. share: of the rows, that are next. */
    trace(prepared, state, bounces, share) {
        this.films.forEach((film, i) => this.renderer.trace(film, prepared[i], state, bounces, Math.max(Math.ceil(share * film.height), 1)));
        this.device.begin();
    }

    /** The scale of radiance at which A is shown as `sommerl render` would show it, or 0 where it is black. */
    async exposure() {
        const found = await this.device.pixels(this.films[0].mean);
        const levels = new Float32Array(found.length / 4);
        let count = 0;
        for (let i = 0; i < found.length; i += 4) if (found[i + 3] >= 0.5) levels[count++] = (found[i] + found[i + 1] + found[i + 2]) / 3;
        const level = levels.subarray(0, count).sort()[Math.floor(PERCENTILE * (count - 1))];
        return level > 0 ? EXPOSED_TO / level : 0;
    }

    /** Shows what there is on the canvas. */
    show(state) {
        const { width, height } = this.canvas;
        if (state.view === "side" && this.films.length > 1) {
            const half = Math.floor(width / 2);
            this.present("a", state, { left: 0, width: half, height });
            this.present("b", state, { left: width - half, width: half, height });
        } else {
            this.present(this.films.length > 1 ? state.view : "a", state, { left: 0, width, height });
        }
    }

    present(view, state, into) {
        if (view === "flip" && !this.map) return; // its figures are being taken: until then, there is what was before
        const [a, b] = [this.films[0], this.films.at(-1)];
        const pictures = { uA: a.mean, uB: b.mean, uMap: this.map, uUsed: this.used };
        const [uView, uTone] = [VIEWS, TONES].map((all, i) => all.findIndex(([name]) => name === (i ? state.tone : view)));
        const scale = (state.scale || 1) * 2 ** state.stops;
        const empty = !into.texture && !state.environment && !SCENES[state.scene].plane;
        const uMarks = this.used && !into.texture ? this.usedBy + 1 : 0;
        const how = { uView, uTone, uMarks, uSplit: state.split * a.width, uExposure: scale, uGain: state.gain, uBehind: empty ? BEHIND : 0 };
        const where = { uPlace: [into.left ?? 0, 0], uFiner: [a.width / into.width, a.height / into.height] };
        this.device.draw(this.display, into, { ...pictures, ...how, ...where });
    }

    /** PSNR, and where the view is FLIP its mean; of A and B as they are shown. */
    async figures(state) {
        ["a", "b"].forEach((view, i) => this.present(view, state, this.shown[i]));
        this.map = null;
        if (state.view !== "flip") this.flip?.rest();
        else {
            this.flip ??= new Flip(this.device);
            this.map = this.flip.of(...this.shown);
        }
        const read = [...this.shown, this.map].map((one) => one && this.device.pixels(one));
        const [a, b, map] = await Promise.all(read);
        return { psnr: psnr(a, b), flip: map && meanOf(map, a) };
    }

    /** Marks the pixels of A (which: 0) or B (1) that look up an entry; null: none. */
    mark(prepared, state, which, entries) {
        if (!entries && this.used) this.device.free(this.used);
        if (!entries) this.used = null;
        else {
            this.used ??= this.device.target(this.films[0].width, this.films[0].height, false);
            this.usedBy = which;
            this.renderer.mark(this.used, prepared, state, entries);
        }
    }
}
