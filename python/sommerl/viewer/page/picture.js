/** The picture on the canvas: films of one material or two, and how they are shown. */
import { Flip, psnr } from "./figures.js";
import { FULL, bind, draw, free, pixels, program, set, target, texture } from "./gl.js";
import { Renderer } from "./renderer.js";
import { SHADERS } from "./shaders.js";
import { TONES, VIEWS } from "./state.js";
import { SCENES } from "./camera.js";

const BEHIND = 0.13; // grey in sRGB, behind an object that is alone: its unlit side is black
const [PERCENTILE, EXPOSED_TO] = [0.9, 0.6]; // as `sommerl render` exposes: that share of the object's pixels is at most so bright

export class Picture {
    /** Throws an Error where there is no WebGL2 with pictures of floats. */
    constructor(canvas) {
        this.canvas = canvas;
        this.gl = canvas.getContext("webgl2", { alpha: false, antialias: false, powerPreference: "high-performance" });
        if (!this.gl?.getExtension("EXT_color_buffer_float")) throw new Error("This page needs a browser with WebGL2 and float textures.");
        this.renderer = new Renderer(this.gl);
        this.display = program(this.gl, FULL, SHADERS.display);
        this.nothing = texture(this.gl, { width: 1, height: 1 });
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
            [...this.shown, ...(this.used ? [this.used] : [])].forEach((old) => free(this.gl, old));
            this.films = Array.from({ length: count }, () => this.renderer.film(each, height));
            this.shown = this.films.map(() => target(this.gl, each, height, false));
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
        const { gl } = this;
        this.films.forEach((film, i) => this.renderer.trace(film, prepared[i], state, bounces, Math.max(Math.ceil(share * film.height), 1)));
        this.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
        gl.flush();
    }

    /** Whether the device is still at work on what it was told to trace. */
    get busy() {
        const { gl } = this;
        if (this.fence && gl.clientWaitSync(this.fence, 0, 0) === gl.TIMEOUT_EXPIRED) return true;
        gl.deleteSync(this.fence ?? null);
        this.fence = null;
        return false;
    }

    /** The scale of radiance at which A is shown as `sommerl render` would show it, or 0 where it is black. */
    exposure() {
        const found = pixels(this.gl, this.films[0].mean);
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
        const { gl, display } = this;
        const [a, b] = [this.films[0], this.films.at(-1)];
        gl.useProgram(display);
        const map = this.map?.texture ?? this.nothing;
        bind(gl, display, { uA: a.mean.texture, uB: b.mean.texture, uMap: map, uUsed: this.used?.texture ?? this.nothing });
        const [uView, uTone] = [VIEWS, TONES].map((all, i) => all.findIndex(([name]) => name === (i ? state.tone : view)));
        const scale = (state.scale || 1) * 2 ** state.stops;
        const empty = !into.framebuffer && !state.environment && !SCENES[state.scene].plane;
        const marks = this.used && !into.framebuffer ? this.usedBy + 1 : 0;
        const more = { uPlace: [into.left ?? 0, 0], uMarks: marks, uBehind: empty ? BEHIND : 0 };
        set(gl, display, { uView, uTone, uSplit: state.split * a.width, uExposure: scale, uGain: state.gain, ...more });
        set(gl, display, { uFiner: [a.width / into.width, a.height / into.height] });
        draw(gl, into);
    }

    /** PSNR, and where the view is FLIP its mean; of A and B as they are shown. */
    figures(state) {
        const bytes = ["a", "b"].map((view, i) => {
            this.present(view, state, this.shown[i]);
            return pixels(this.gl, this.shown[i], false);
        });
        const found = { psnr: psnr(...bytes), flip: null };
        if (state.view !== "flip") {
            this.flip?.rest();
            this.map = null;
        } else {
            this.flip ??= new Flip(this.gl);
            this.map = this.flip.of(...this.shown);
            found.flip = this.flip.mean(this.map, bytes[0]);
        }
        return found;
    }

    /** Marks the pixels of A (which: 0) or B (1) that look up an entry; null: none. */
    mark(prepared, state, which, entries) {
        if (!entries && this.used) free(this.gl, this.used);
        if (!entries) this.used = null;
        else {
            this.used ??= target(this.gl, this.films[0].width, this.films[0].height, false);
            this.usedBy = which;
            this.renderer.mark(this.used, prepared, state, entries);
        }
    }

    /** The longest side that a picture may have, in pixels. */
    get longest() {
        return this.gl.getParameter(this.gl.MAX_TEXTURE_SIZE);
    }
}
