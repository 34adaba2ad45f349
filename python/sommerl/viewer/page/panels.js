/** Drawings that explain a material: its lobe, a slice, its palette, and its albedo. */
import { Work, luminance, rich, sizeOf, themeOf } from "./draw.js";
import { make, switches } from "./dom.js";
import { Albedo } from "./albedo.js";
import { Lobe } from "./lobe.js";
import { Palette } from "./palette.js";
import { Slice } from "./slice.js";
import { clamp } from "./vectors.js";

const LINE = 18; // height of a line of what is said, in CSS pixels

export class Panels {
    /**
     * root: an empty element. callbacks.highlight(what): what is null, or {material, entry, gain, shape}: 0 or 1 for the
     * material that was set, and the number of an entry, or null.
     */
    constructor(root, callbacks = {}) {
        Object.assign(this, { root, callbacks, materials: [], at: 0, split: true, thetaI: Math.PI / 4, work: new Work() });
        Object.assign(this, { pointer: null, pointed: null, lit: null, use: null, white: null, chosen: false, frame: null });
        [this.pending, this.theme] = [new Set(), themeOf(root)];
        this.drawings = [Lobe, Slice, Palette, Albedo].map((Kind) => new Kind(this));
        [this.lobe, this.slice, this.palette, this.albedo] = this.drawings;
        [this.legend, this.channels] = [make("div", { className: "legend" }), make("div")];
        this.grid = make(
            "div",
            { className: "panels-grid" },
            this.lobe.panel("Lobe", this.lobe.controls),
            this.slice.panel("Slice", this.slice.controls),
            this.palette.panel("Palette", [], this.palette.body),
            this.albedo.panel("Albedo"),
        );
        root.classList.add("panels");
        root.append(make("div", { className: "panels-head" }, this.legend, this.channels), this.grid);
        new ResizeObserver(() => {
            if (root.clientWidth === this.width) return; // heights are our own doing
            this.width = root.clientWidth;
            this.later("all");
        }).observe(root);
    }

    /** [a, b]: decoded materials, with a label and a number of bytes; b may be null. */
    setMaterials([a, b]) {
        this.highlight(null);
        this.work.drop(); // what it draws has other materials' curves
        this.materials = b ? [a, b] : [a];
        // At first, the one that has a palette: it is what there is to understand.
        const first = Math.max(this.materials.findIndex(({ kind }) => kind === "cells" || kind === "nodes"), 0);
        [this.at, this.pointed] = [this.wished ? Math.min(this.at, this.materials.length - 1) : first, null];
        if (!this.chosen) this.split = !b;
        this.later("materials");
    }

    /** {wi, wo}, or null. Where the light is below the horizon, nothing is looked up. */
    setPointer(pointer) {
        this.pointer = pointer && Math.min(pointer.wi[2], pointer.wo[2]) > 0 ? pointer : null;
        this.later("marks");
    }

    /** The light's angle of incidence [rad]. */
    setLight(thetaI) {
        this.thetaI = clamp(thetaI, 0, 1.56);
        this.later("lobe");
    }

    /** Theme or size have changed. */
    redraw() {
        this.later("all");
    }

    // What follows is for the drawings.

    get material() {
        return this.materials[this.at];
    }

    /** The directions that are pointed at: on the slice, or else on the object. */
    get pair() {
        return this.pointed ?? this.pointer;
    }

    /** What is drawn of a material's f_r or albedo: [what to pick of RGB, the line's colour]. */
    lines(m) {
        if (!this.split) return [[luminance, this.theme.accents[m]]];
        return [2, 1, 0].map((c) => [(f) => f[c], this.theme.channels[c]]);
    }

    point(pair) {
        this.pointed = pair;
        this.later("marks");
    }

    /** {entry}, {gain} or {shape}: what uses it is lit, `use(number of a cell or node)`; or null. */
    highlight(lit) {
        if (JSON.stringify(lit) === JSON.stringify(this.lit)) return;
        this.lit = lit;
        const { entry = null, gain = null, shape = null } = lit ?? {};
        const { index, gainIndex } = this.material;
        const [numbers, wanted] = gain === null ? [index, entry ?? shape] : [gainIndex, gain];
        this.use = lit && ((at) => numbers[at] === wanted);
        this.callbacks.highlight?.(lit && { material: this.at, entry, gain, shape });
        this.later("marks");
    }

    /** What a number is of, if there are two materials. */
    tag(m) {
        return this.materials.length > 1 ? `${"AB"[m]}: ` : "";
    }

    /** Does it in the next frame, once. */
    later(what) {
        this.pending.add(what);
        this.frame ??= requestAnimationFrame(() => this.now());
    }

    now() {
        this.frame = null;
        const { pending, work } = this;
        if (!this.materials.length || !this.root.clientWidth) return; // hidden: when it is shown, its size changes
        this.pending = new Set();
        if (pending.has("materials")) return this.begin();
        if (pending.has("all")) return this.all();
        if (pending.has("lobe")) work.start("lobe", () => this.lobe.draw(), true);
        if (pending.has("marks")) for (const one of [this.slice, this.palette, this.albedo]) one.mark();
    }

    begin() {
        const lines = [["rgb", "RGB"], ["luminance", "luminance"]];
        const split = (value) => {
            [this.split, this.chosen] = [value === "rgb", true];
            this.all();
        };
        this.channels.replaceChildren(switches("Curves", lines, this.split ? "rgb" : "luminance", split));
        this.name();
        this.all();
        for (const one of [this.slice, this.palette, this.albedo]) one.reset();
    }

    /** What the curves are; of two materials, a choice of the one whose slice and palette are shown. */
    name() {
        const names = this.materials.map(({ name, label = name, bytes }, m) => {
            const line = make("i", { className: `line line-${m}` });
            return make("span", {}, line, this.tag(m), make("bdi", {}, label), bytes ? `, ${sizeOf(bytes)}` : "");
        });
        const show = (at) => {
            this.highlight(null);
            [this.at, this.wished] = [Number(at), true];
            this.palette.reset();
            this.slice.request();
            this.all();
        };
        const options = names.map((text, m) => [String(m), text]);
        this.legend.replaceChildren(...(names.length > 1 ? [switches("Slice and palette of", options, String(this.at), show)] : names));
    }

    all() {
        this.theme = themeOf(this.root);
        this.grid.classList.toggle("bare", !this.material.lut);
        const curves = 1 + this.materials.length;
        this.drawings.forEach((one, i) => {
            one.said.style.minHeight = `${LINE * [curves, 3, this.material.lut ? 2 : 0, curves][i]}px`; // so that nothing moves under the pointer
            one.explains.replaceChildren(...rich(one.caption()));
        });
        const { drawings } = this;
        this.work.start("all", function* () {
            for (const one of drawings) yield* one.draw();
        });
    }
}
