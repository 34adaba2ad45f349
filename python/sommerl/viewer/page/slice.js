/** f_r over θ_h and θ_d at one φ_d, as an image, with the cells or nodes that are looked up. */
import { FINE, HALF_PI, ON_HORIZON, cellAbove, cellAt, entriesAt, evaluate, places, range } from "./evaluate.js";
import { Chart, Drawing, discs, frame, inDegrees, label, late, number, polyline, reflectance, rich, toned } from "./draw.js";
import { make, slider } from "./dom.js";
import { DEGREE } from "./vectors.js";

const SIDE = 120; // pixels of what has no cells
const MOST = 180; // pixels of what has
const XS = [0, 1, 5, 15, 30, 50, 90].map((t) => [Math.sqrt(t / 90), `${t}°`]);
const YS = [0, 15, 30, 45, 60, 75, 90].map((t) => [t / 90, `${t}°`]);
const [LEFT, TOP, RIGHT, FOOT] = [32, 28, 10, 34];
const WHITE = 0.93; // the quantile of what is shown that becomes white: a few values near grazing angles may be huge
const KEPT = 24; // images

/** The pair of unit vectors with these half/difference angles [rad] and φ_h = 0. */
export function directions(thetaH, thetaD, phiD) {
    const [sinH, cosH, sinD, cosD] = [Math.sin(thetaH), Math.cos(thetaH), Math.sin(thetaD), Math.cos(thetaD)];
    const [along, across] = [sinD * Math.cos(phiD), sinD * Math.sin(phiD)];
    return [1, -1].map((s) => [cosD * sinH + s * along * cosH, s * across, cosD * cosH - s * along * sinH]);
}

/** Columns and rows of a slice: cells, as far as there are any. */
export function sliceSize({ kind, lattice }) {
    return kind === "cells" || kind === "table" ? [lattice.thetaH, lattice.thetaD].map((n) => Math.min(n, MOST)) : [SIDE, SIDE];
}

/** The range of φ_d [rad] that `cellAt` gives. Measurements as they are may be neither reciprocal nor mirrored. */
export function rangeOf({ kind, lattice }) {
    return range(lattice ?? { reciprocal: false, mirrored: kind === "grid" });
}

/** φ_d [rad] as `cellAt` has it. */
export function folded(material, phiD) {
    return cellAt(material, ...directions(0.5, 0.5, phiD)).phiD;
}

/**
 * A generator that gives f_r at the centres of pixels, a Float32Array of row by row from θ_d = 0, linear in √θ_h; NaN below
 * the horizon.
 */
export function* sliced(material, phiD, columns, rows) {
    const f = new Float32Array(3 * columns * rows).fill(NaN);
    for (let j = 0; j < rows; j++) {
        for (let i = 0; i < columns; i++) {
            const [wi, wo] = directions(((i + 0.5) / columns) ** 2 * HALF_PI, ((j + 0.5) / rows) * HALF_PI, phiD);
            if (Math.min(wi[2], wo[2]) > ON_HORIZON) f.set(evaluate(material, wi, wo), 3 * (i + columns * j));
            if (late()) yield;
        }
    }
    return f;
}

/** The nodes at the φ_d nearest to one, as {at, a: √(θ_h / 90°), b: θ_d / 90°}. */
export function nodesOf(lattice, phiD) {
    const z = (phiD * FINE) / range(lattice);
    const gap = (place) => (lattice.mirrored ? Math.abs(place - z) : Math.min(Math.abs(place - z), FINE - Math.abs(place - z)));
    const found = [];
    let first = 0;
    lattice.thetaH.forEach((x, row) => {
        const [theta, phi] = [lattice.thetaD[lattice.band[row]], lattice.phiD[lattice.band[row]]];
        const p = phi.reduce((best, place, i) => (gap(place) < gap(phi[best]) ? i : best), 0);
        const a = x < 90 ? x / 360 : 0.25 + (x - 90) / 120;
        theta.forEach((y, i) => found.push({ at: first + i * phi.length + p, a, b: y / FINE }));
        first += theta.length * phi.length;
    });
    return found;
}

/** The numbers of cells at one φ_d by column and row, −1 below the horizon. */
export function cellsOf(lattice, phiD) {
    const { thetaH, thetaD } = lattice;
    const k = Math.min(Math.floor((phiD / range(lattice)) * lattice.phiD), lattice.phiD - 1);
    return Int32Array.from({ length: thetaH * thetaD }, (_, n) => {
        const [i, j] = [n % thetaH, Math.floor(n / thetaH)];
        const at = k + lattice.phiD * (j + thetaD * i);
        return cellAbove([i, j, k], lattice) === at ? at : -1;
    });
}

function whiteOf(f) {
    const brightest = Float32Array.from({ length: f.length / 3 }, (_, n) => Math.max(...f.subarray(3 * n, 3 * n + 3)));
    const positive = brightest.filter((x) => x > 0).sort();
    return positive[Math.floor(WHITE * (positive.length - 1))] || 1;
}

/** A generator that gives a canvas, whose colours [r, g, b] paint(pixel) gives, or null; row 0 is the lowest. */
function* image(columns, rows, paint) {
    const canvas = make("canvas", { width: columns, height: rows });
    const data = new ImageData(columns, rows);
    for (let j = 0; j < rows; j++) {
        for (let i = 0; i < columns; i++) {
            const colour = paint(i + columns * j);
            if (colour) data.data.set([...colour, 255], 4 * (i + columns * (rows - 1 - j)));
        }
        if (late()) yield;
    }
    canvas.getContext("2d").putImageData(data, 0, 0);
    return canvas;
}

export class Slice extends Drawing {
    constructor(hub) {
        super(hub, (x, y) => hub.point(x === undefined ? null : this.pairAt(x, y)));
        [this.images, this.phiD] = [new Map(), HALF_PI];
        const given = { min: 0, max: 180, step: 1, value: 90 };
        this.slider = slider(given, (t) => `${Math.round(t)}°`, (t) => this.turn(t * DEGREE));
        this.following = make("input", { type: "checkbox", onchange: () => this.mark() });
        this.controls = [
            make("label", {}, make("span", {}, ...rich("φ_d")), this.slider.input, this.slider.said),
            make("label", { title: "Shows the slice that the pointer on the object is in" }, this.following, "follow pointer"),
        ];
    }

    /** Other materials. */
    reset() {
        const most = Math.max(...this.hub.materials.map(rangeOf));
        this.slider.input.max = Math.round(most / DEGREE);
        [this.phiD, this.hub.white, this.shown] = [Math.min(this.phiD, most), null, null];
        this.images.clear();
        this.request(false);
    }

    turn(phiD) {
        this.phiD = phiD;
        this.request();
    }

    request(after = true) {
        this.slider.show(this.phiD / DEGREE);
        this.hub.work.start("slice", () => this.fill(), after);
    }

    *fill() {
        const { hub, phiD } = this;
        const { material, materials } = hub;
        if (!hub.white) {
            hub.white = whiteOf(yield* sliced(materials[0], Math.min(HALF_PI, rangeOf(materials[0])), ...sliceSize(materials[0])));
            yield* hub.palette.draw();
        }
        this.shown = { phiD, material, image: yield* this.imageOf(material, phiD) };
        yield* this.draw();
    }

    *imageOf(material, phiD) {
        const key = `${this.hub.materials.indexOf(material)} ${phiD.toFixed(3)}`;
        if (!this.images.has(key)) {
            const size = sliceSize(material);
            const f = yield* sliced(material, phiD, ...size);
            const colour = (n) => (Number.isNaN(f[3 * n]) ? null : toned(f.subarray(3 * n, 3 * n + 3), this.hub.white));
            if (this.images.size >= KEPT) this.images.delete(this.images.keys().next().value);
            this.images.set(key, yield* image(...size, colour));
        }
        return this.images.get(key);
    }

    height(width) {
        return Math.round(Math.min(0.72 * (width - LEFT - RIGHT), 260)) + TOP + FOOT;
    }

    *painted(context, width, tall) {
        const { hub: { theme, white }, shown } = this;
        const chart = new Chart([LEFT, TOP, width - RIGHT, tall - FOOT], [0, 1], [0, 1]);
        chart.axes(context, theme, XS, YS, ["θ_h", "θ_d"]);
        if (late()) yield;
        if (!shown) return { chart };
        context.fillStyle = theme.quiet;
        label(context, `white: ${number(white)} 1/sr`, width - RIGHT, TOP - 14, 1);
        const { kind, lattice, interpolation } = shown.material;
        const [left, top, right, bottom] = chart.box;
        context.imageSmoothingEnabled = interpolation !== "nearest";
        context.drawImage(shown.image, left, top, right - left, bottom - top);
        if (Math.min(...directions(1.2, 1.2, shown.phiD).map(([, , z]) => z)) < 0) {
            label(context, "below the horizon", width - RIGHT - 8, TOP + 18, 1);
        }
        const phiD = folded(shown.material, shown.phiD); // the slider goes as far as the other material does
        const nodes = kind === "nodes" ? nodesOf(lattice, phiD) : [];
        for (const node of nodes) node.place = [chart.x(node.a), chart.y(node.b)];
        if (late()) yield;
        discs(context, nodes.map(({ place }) => place), 1.5, "#fff", "rgb(0 0 0 / .55)", 0.8);
        return { chart, shown, nodes, cells: kind === "cells" ? cellsOf(lattice, phiD) : [] };
    }

    /** The directions at a place of the canvas; null outside of the slice or below the horizon. */
    pairAt(x, y) {
        const { chart, shown } = this.plot.map;
        const [a, b] = chart.at(x, y) ?? [];
        if (!shown || a === undefined) return null;
        const [wi, wo] = directions(a * a * HALF_PI, b * HALF_PI, shown.phiD);
        return Math.min(wi[2], wo[2]) > ON_HORIZON ? { wi, wo } : null;
    }

    mark() {
        const { pair, pointer, material, use, white } = this.hub;
        const found = pair && cellAt(material, pair.wi, pair.wo);
        if (found && pair === pointer && this.following.checked && Math.abs(found.phiD - this.phiD) > 0.005) this.turn(found.phiD);
        this.plot.mark((context, map) => {
            if (map.shown?.material !== material) return;
            if (use) this.highlight(context, map, use);
            if (!found) return;
            if (map.nodes.length) this.circle(context, map, places(material, pair.wi, pair.wo));
            if (found.bins) this.outline(context, map, found.bins, material.lattice);
            this.crosshair(context, map, Math.sqrt(found.thetaH / HALF_PI), found.thetaD / HALF_PI, !found.bins);
        });
        this.say(found ? this.words(found, pair, material) : "Point at the slice or at the object\nto see what is looked up.");
        const said = `f_r over θh and θd at φd = ${inDegrees(this.phiD, 0)}; white is ${number(white ?? 1)} per steradian.`;
        this.plot.canvas.setAttribute("aria-label", said);
    }

    /** The cells or nodes that use an entry; the others are dimmed. */
    highlight(context, { chart, shown, nodes, cells }, use) {
        const { theme } = this.hub;
        const [left, top, right, bottom] = chart.box;
        context.globalAlpha = 0.65;
        context.fillStyle = theme.surface;
        context.fillRect(left, top, right - left, bottom - top);
        context.globalAlpha = 1;
        const { thetaH, thetaD } = shown.material.lattice;
        const [wide, high] = [chart.wide / thetaH, chart.high / thetaD];
        context.fillStyle = theme.accents[0];
        cells.forEach((at, n) => {
            if (at < 0 || !use(at)) return;
            context.fillRect(left + (n % thetaH) * wide, bottom - (Math.floor(n / thetaH) + 1) * high, wide + 0.3, high + 0.3);
        });
        discs(context, nodes.filter(({ at }) => use(at)).map(({ place }) => place), 3, theme.accents[0], theme.surface);
    }

    /** The nodes about a pair of directions: the larger their weight, the larger the circle. */
    circle(context, { nodes }, found) {
        for (const { at, place } of nodes) {
            const weight = found.reduce((sum, one) => sum + (one.at === at ? one.weight : 0), 0);
            if (weight > 0) discs(context, [place], 2 + 4 * Math.sqrt(weight), this.hub.theme.accents[0], "#fff", 1.5);
        }
    }

    outline(context, { chart }, [i, j], { thetaH, thetaD }) {
        const [x, y] = [chart.x(i / thetaH), chart.y((j + 1) / thetaD)];
        frame(context, [x, y, chart.wide / thetaH, chart.high / thetaD], ["#000", "#fff"]);
    }

    /** Marks of a place on both axes, and at the place itself unless something else marks it. */
    crosshair(context, { chart }, a, b, itself) {
        const [left, top, right, bottom] = chart.box;
        const [x, y] = [chart.x(a), chart.y(b)];
        for (const [x0, y0, u, v] of [[x, bottom, 0, 5], [x, top, 0, -5], [left, y, -5, 0], [right, y, 5, 0]]) {
            polyline(context, [[x0, y0], [x0 + u, y0 + v]], this.hub.theme.ink, 2);
        }
        if (itself) discs(context, [[x, y]], 2.5, "#fff", "#000", 1);
    }

    words({ thetaH, thetaD, phiD, bins }, { wi, wo }, material) {
        const lines = [`θ_h = ${inDegrees(thetaH)}, θ_d = ${inDegrees(thetaD)}, φ_d = ${inDegrees(phiD)}`];
        lines.push(`f_r = ${reflectance(evaluate(material, wi, wo))}`);
        const [first, gain] = entriesAt(material, wi, wo);
        if (bins) lines.push(`cell (${bins.join(", ")})${first >= 0 ? `, entry ${first}` : ""}`);
        else if (first >= 0) lines.push(`heaviest node: gain ${gain}, shape ${first}`);
        return lines.join("\n");
    }

    caption() {
        const more = {
            cells: ": each pixel is a cell, which stores only the number of its palette entry.",
            nodes: ": values are stored at the dots alone, and blended between them.",
            table: ": each pixel is a cell of the measured table, which stores a colour of its own.",
        };
        const where = "The whole material in one picture, with the highlight at the left and grazing angles at the top";
        return where + (more[this.hub.material.kind] ?? ", before any compression.");
    }
}
