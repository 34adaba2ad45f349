/** The entries of a compressed material, and how many cells or nodes use each. */
import { cellsAbove, entriesAt } from "./evaluate.js";
import { Chart, Drawing, Painter, css, discs, frame, grouped, late, number, reflectance, tenTo, ticks, toned } from "./draw.js";
import { make } from "./dom.js";
import { clamp } from "./vectors.js";

const AT_ONCE = 2 ** 15; // cells that are counted without a look at the clock
const [LEFT, RIGHT, FOOT, BARS] = [38, 4, 34, 62];
const PAD = 4; // about swatches, for what marks them
const [SWATCHES, SMALLEST, LARGEST] = [132, 2.5, 30]; // height of all swatches, and sides of one, in CSS pixels
const STRIP = 24; // height of the strip of gains

/** A generator that gives how many cells above the horizon have each entry: {entry}; or how many nodes: {gain, shape}. */
export function* counting({ kind, lattice, index, gainIndex, lut, gains }) {
    const shape = new Uint32Array(lut.length / 3);
    if (kind === "nodes") {
        const gain = new Uint32Array(gains.length);
        for (const n of gainIndex) gain[n]++;
        for (const n of index) shape[n]++;
        return { gain, shape };
    }
    const above = cellsAbove(lattice);
    for (let at = 0; at < index.length; at++) {
        if (above[at] === at) shape[index[at]]++;
        if (at % AT_ONCE === 0 && late()) yield;
    }
    return { entry: shape };
}

/** Where a gain is on an axis that is logarithmic but near 0, as the codes of gains are. */
export function gainPlace(gain) {
    return Math.sign(gain) * Math.log2(1 + 2 * Math.abs(gain));
}

/** (r − b, g − (r + b) / 2) of a shape. */
export function chroma([r, g, b]) {
    return [r - b, g - (r + b) / 2];
}

/** Entries that can be pointed at, and chosen by keyboard. What it draws is given by a subclass. */
class Chooser extends Painter {
    constructor(palette, key, count, name) {
        const highlight = (n) => this.hub.highlight(n === null ? null : { [key]: n });
        super(palette.hub, (x, y, pressed) => {
            const n = x === undefined ? null : this.at(x, y);
            if (pressed) this.pinned = n === this.pinned ? null : n;
            highlight(n ?? this.pinned);
        });
        Object.assign(this, { palette, material: this.hub.material, key, count, columns: 1, pinned: null });
        const hint = `${name}. Arrow keys choose one, Escape none.`;
        this.root = make("div", { className: "chooser", tabIndex: 0, role: "application", "aria-label": hint }, this.plot.canvas);
        this.plot.canvas.setAttribute("aria-label", `${name}: there are ${count}.`);
        this.root.addEventListener("keydown", (event) => {
            const steps = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -this.columns, ArrowDown: this.columns, Home: -count, End: count };
            const step = steps[event.key];
            if (event.key === "Escape") this.pinned = null;
            else if (!step) return;
            else this.pinned = clamp((this.pinned ?? (step > 0 ? -1 : 1)) + step, 0, count - 1);
            event.preventDefault();
            highlight(this.pinned);
        });
    }

    get counts() {
        return this.palette.counts?.[this.key];
    }

    /** Three numbers of the LUT. */
    rgb(n) {
        return this.material.lut.subarray(3 * n, 3 * n + 3);
    }

    mark() {
        const { pair, lit, theme } = this.hub;
        const [first, gain] = pair ? entriesAt(this.material, pair.wi, pair.wo) : [-1, -1];
        const used = this.key === "gain" ? gain : first;
        this.plot.mark((context, map) => {
            if (used >= 0) this.ring(context, map, used, ["#000", "#fff"], theme.ink);
            if (this.key in (lit ?? {})) this.ring(context, map, lit[this.key], [theme.surface, theme.accents[0]], theme.accents[0]);
        });
    }

    /** How many of all use entry n. */
    share(n, what) {
        if (!this.counts) return "";
        const total = this.counts.reduce((sum, one) => sum + one, 0);
        return `\n${grouped(this.counts[n])} of ${grouped(total)} ${what} (${number((100 * this.counts[n]) / total)} %)`;
    }
}

/** Swatches, and bars below on a logarithmic axis. */
class Swatches extends Chooser {
    height(width) {
        return Math.ceil(this.layout(width).low + BARS + FOOT);
    }

    *painted(context, width) {
        const { counts, count, hub: { theme, white } } = this;
        const { low, ends, swatch, bar, xs, name } = this.layout(width);
        const most = Math.max(10, ...(counts ?? []));
        const chart = new Chart([LEFT, low, width - RIGHT, low + BARS], ends, [0, Math.log10(1 + most)]);
        const digits = Math.floor(Math.log10(most));
        const every = Math.ceil(digits / 3);
        const ys = [[0, "0"]];
        for (let i = every; i <= digits; i += every) ys.push([Math.log10(1 + 10 ** i), i < 4 ? String(10 ** i) : tenTo(i)]);
        chart.axes(context, theme, xs, ys, [name, ""]);
        const map = { low, chart, swatches: [], bars: [] };
        for (let n = 0; n < count; n++) {
            const [x0, x1] = bar(n, chart);
            const top = chart.y(Math.log10(1 + (counts?.[n] ?? 0)));
            map.swatches.push(swatch(n, chart));
            map.bars.push([x0, x1]);
            context.fillStyle = css(toned(this.colour(n), white));
            context.fillRect(...map.swatches[n]);
            context.fillStyle = theme.quiet;
            context.fillRect(x0, top, Math.max(x1 - x0 - (x1 - x0 > 3 ? 1 : 0), 0.5), low + BARS - top);
            if (late()) yield;
        }
        return map;
    }

    at(x, y) {
        const { low, chart, swatches, bars } = this.plot.map;
        const within = ([left, top, wide, high]) => x >= left && x < left + wide && y >= top && y < top + high;
        if (y < low) return found(swatches.findIndex(within));
        if (x < chart.box[0] || x > chart.box[2]) return null;
        return found(nearest(bars.map(([x0, x1]) => Math.abs(x - (x0 + x1) / 2))));
    }

    ring(context, { low, swatches, bars }, n, colours, ofBar) {
        const [x0, x1] = bars[n];
        frame(context, swatches[n], colours);
        context.fillStyle = ofBar;
        context.fillRect(x0, low, Math.max(x1 - x0, 1.5), BARS);
    }
}

const found = (n) => (n >= 0 ? n : null);
const nearest = (away) => away.indexOf(away.reduce((least, one) => Math.min(least, one), Infinity));

/** Row by row in the LUT's order. */
class Entries extends Swatches {
    layout(width) {
        const { count } = this;
        const inner = width - 2 * PAD;
        const side = clamp(Math.sqrt((inner * SWATCHES) / count), SMALLEST, LARGEST);
        const columns = Math.min(count, Math.floor(inner / side));
        const wide = inner / columns;
        const more = side > 7 ? -1 : 0.4; // a gap, or no seam
        this.columns = columns;
        return {
            low: Math.ceil(count / columns) * side + PAD + 12,
            ends: [0, count],
            swatch: (n) => [PAD + (n % columns) * wide, PAD + Math.floor(n / columns) * side, wide + more, side + more],
            bar: (n, chart) => [chart.x(n), chart.x(n + 1)],
            xs: ticks(0, count - 1, 5, 1).map(([n, text]) => [n + 0.5, text]),
            name: "cells of each entry",
        };
    }

    colour(n) {
        return this.rgb(n);
    }

    words(n) {
        return `entry ${n}: f_r = ${reflectance(this.rgb(n))}${this.share(n, "cells")}`;
    }
}

/** A strip of greys, each gain as wide as what is nearest to it. */
class Gains extends Swatches {
    layout() {
        const places = Array.from(this.material.gains, gainPlace);
        const ends = [places[0] - 0.15, places.at(-1) + 0.15];
        const edges = [ends[0], ...places.slice(1).map((place, n) => (place + places[n]) / 2), ends[1]];
        const powers = Array.from({ length: 17 }, (_, i) => 2 ** (i - 3));
        const marked = [...powers.map((t) => -t).reverse(), 0, ...powers].map((t) => [gainPlace(t), number(t, true)]);
        return {
            low: STRIP + 8,
            ends,
            swatch: (n, chart) => [chart.x(edges[n]), PAD, (edges[n + 1] - edges[n]) * chart.wide + 0.3, STRIP - PAD],
            bar: (n, chart) => [chart.x(places[n]) - 1.5, chart.x(places[n]) + 1.5],
            xs: marked.filter(([at]) => at >= ends[0] && at <= ends[1]),
            name: "nodes of each gain",
        };
    }

    colour(n) {
        return Array(3).fill(this.material.scale * Math.max(this.material.gains[n], 0) ** 3);
    }

    words(n) {
        return `gain ${n}: ${number(this.material.gains[n])}, a grey of ${number(this.colour(n)[0])}\u00a01/sr${this.share(n, "nodes")}`;
    }
}

/** The plane of the shapes' chroma; the more nodes use a shape, the larger is its disc. */
class Shapes extends Chooser {
    height(width) {
        return Math.round(Math.min(0.62 * width, 210)) + FOOT;
    }

    *painted(context, width, tall) {
        const { counts, count, hub: { theme } } = this;
        const chromas = Array.from({ length: count }, (_, n) => chroma(this.rgb(n)));
        const ends = [0, 1].map((c) => {
            const values = [0, ...chromas.map((one) => one[c])];
            const [low, high] = [Math.min(...values), Math.max(...values)];
            const room = Math.max(0.15 * (high - low), 0.05);
            return [low - room, high + room];
        });
        const chart = new Chart([LEFT, 28, width - RIGHT - 6, tall - FOOT], ...ends);
        chart.axes(context, theme, ...ends.map((of) => ticks(...of)), ["r − b", "g − (r + b) / 2"]);
        const largest = clamp(60 / Math.sqrt(count), 5, 10);
        const most = Math.max(1, ...(counts ?? []));
        const size = (n) => 2.5 + (largest - 2.5) * Math.sqrt((counts?.[n] ?? 0) / most);
        const places = chromas.map(([u, v], n) => [chart.x(u), chart.y(v), size(n)]);
        for (let n = 0; n < count; n++) {
            discs(context, [places[n]], places[n][2], this.colour(n), theme.ink, 0.8);
            if (late()) yield;
        }
        return { places };
    }

    colour(n) {
        const cubes = Array.from(this.rgb(n), (x) => Math.max(x, 0) ** 3);
        return css(toned(cubes, 1.6 * Math.max(...cubes)));
    }

    at(x, y) {
        const away = this.plot.map.places.map(([a, b, radius]) => Math.hypot(x - a, y - b) - radius);
        const n = nearest(away);
        return away[n] < 8 ? n : null;
    }

    ring(context, { places }, n, colours) {
        colours.forEach((colour, i) => discs(context, [places[n]], places[n][2] + 2, this.colour(n), colour, [5, 2.5][i]));
    }

    words(n) {
        return `shape ${n}: r, g, b = ${Array.from(this.rgb(n), (x) => number(x)).join(", ")}${this.share(n, "nodes")}`;
    }
}

export class Palette extends Drawing {
    constructor(hub) {
        super(hub);
        [this.choosers, this.body] = [[], make("div")];
        this.said.setAttribute("aria-live", "polite");
    }

    /** Another material. */
    reset() {
        const { kind, lut, gains } = this.hub.material;
        [this.counts, this.choosers] = [null, []];
        if (kind === "cells") this.choosers = [new Entries(this, "entry", lut.length / 3, "Entries of the palette")];
        if (kind === "nodes") {
            this.choosers = [new Gains(this, "gain", gains.length, "Gains"), new Shapes(this, "shape", lut.length / 3, "Shapes")];
        }
        this.body.replaceChildren(...this.choosers.map(({ root }) => root));
        this.hub.work.start("uses", () => this.count(this.hub.material));
    }

    *count(material) {
        if (this.choosers.length) this.counts = yield* counting(material);
        yield* this.draw();
    }

    *draw() {
        if (this.hub.white) for (const chooser of this.choosers) yield* chooser.draw();
        this.mark();
    }

    mark() {
        const { lit, material } = this.hub;
        for (const chooser of this.choosers) chooser.mark();
        const chosen = this.choosers.find(({ key }) => key in (lit ?? {}));
        this.say(chosen ? chosen.words(lit[chosen.key]) : this.summary(material));
    }

    summary({ kind, lut, gains, index }) {
        if (kind === "cells") return `${grouped(lut.length / 3)} entries`;
        if (kind === "nodes") return `${grouped(gains.length)} gains, ${grouped(lut.length / 3)} shapes, ${grouped(index.length)} nodes`;
        return "";
    }

    caption() {
        const { kind, lut } = this.hub.material;
        if (kind === "cells") {
            return `A self-organising map (SOM) sorted the colours of all cells into ${grouped(lut.length / 3)} groups, and for each group a mass attraction network (MAN) kept one original colour, which all its cells now share; here they are from dark to bright.`;
        }
        if (kind === "nodes") {
            return "Two self-organising maps (SOM) found the gains and the shapes, and mass attraction networks (MAN) replaced these by originals: the value of a node is a gain, its brightness, times a shape, its colour.";
        }
        return "This material is not compressed: it has no palette, and every value is stored by itself.";
    }
}
