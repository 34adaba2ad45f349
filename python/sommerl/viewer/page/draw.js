/** What the panels share: canvases, colours, numbers as text, and work that is done bit by bit. */
import { make } from "./dom.js";
import { DEGREE } from "./vectors.js";

/** Text in which a letter after "_" is a subscript. */
export function rich(text) {
    return text.split(/_(\w)/).map((part, i) => (i % 2 ? make("sub", {}, part) : part));
}

/** Three significant digits. trim: without zeros at the end. */
export function number(x, trim = false) {
    const size = Math.abs(x);
    if (!(size > 0)) return "0";
    const sign = x < 0 ? "−" : "";
    if (size < 0.000995 || size >= 99950) {
        const power = Math.floor(Math.log10(size) + 0.002);
        const [factor, raised] = [number(size / 10 ** power, trim), tenTo(power)];
        return sign + (trim && factor === "1" ? raised : `${factor}\u00a0·\u00a0${raised}`);
    }
    const text = size < 999.5 ? size.toPrecision(3) : String(Math.round(size));
    return sign + (trim ? String(Number(text)) : text);
}

export function tenTo(power) {
    return "10" + String(power).replace(/./g, (c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c]));
}

export function inDegrees(radians, digits = 1) {
    return `${(radians / DEGREE).toFixed(digits)}°`.replace(/^-/, "−");
}

/** A whole number. (The first toLocaleString of a page takes 20 ms.) */
export function grouped(n) {
    return String(n).replace(/\B(?=(\d{3})+$)/g, ",");
}

/** The size of a file. */
export function sizeOf(bytes) {
    if (bytes < 1e4) return `${grouped(bytes)} B`;
    return bytes < 999500 ? `${number(bytes / 1e3)} kB` : `${number(bytes / 1e6)} MB`;
}

/** f_r with its unit. */
export function reflectance(f) {
    return `${Array.from(f, (x) => number(x)).join(", ")}\u00a01/sr`;
}

export function luminance(f) {
    return 0.2126 * f[0] + 0.7152 * f[1] + 0.0722 * f[2];
}

/** sRGB in 8 bits: the brightest channel becomes its cube root, `white` being 1, and the others keep their ratio to it. */
export function toned(f, white) {
    const brightest = Math.max(f[0], f[1], f[2]);
    if (!(brightest > 0)) return [0, 0, 0];
    const factor = Math.min(Math.cbrt(brightest / white), 1) / brightest;
    return [0, 1, 2].map((c) => {
        const x = Math.max(f[c], 0) * factor;
        return Math.round(255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055));
    });
}

export function css([r, g, b]) {
    return `rgb(${r} ${g} ${b})`;
}

/** 1, 2 or 5 times a power of ten: the first that is at least x. */
export function nice(x) {
    const power = 10 ** Math.floor(Math.log10(x));
    return power * ([1, 2, 5].find((n) => n * power >= x * 0.9999) ?? 10);
}

/** About `count` round values from one to another, as [value, text]. least: the smallest step. */
export function ticks(low, high, count = 5, least = 0) {
    const step = Math.max(nice((high - low) / count), least);
    const found = [];
    for (let n = Math.ceil(low / step); n * step <= high + 1e-9 * step; n++) found.push([n * step, number(n * step, true)]);
    return found;
}

/** Colours and font, from the custom properties of the page. */
export function themeOf(root) {
    const style = getComputedStyle(root);
    const named = (...names) => names.map((name) => style.getPropertyValue(`--${name}`).trim());
    const [ink, quiet, line, surface] = named("ink", "quiet", "line", "surface");
    const [accents, channels] = [named("accent", "accent-b"), named("red", "green", "blue")];
    return { font: style.fontFamily, ink, quiet, line, surface, accents, channels };
}

/** A canvas as wide as what it is in: what seldom changes is kept as an image, marks are drawn over it. */
export class Plot {
    /** hover(x, y, pressed): where a pointer is, or hover() when it goes; not before something is painted. */
    constructor(hover) {
        [this.canvas, this.turn] = [make("canvas", { role: "img" }), 0];
        const tell = (event) => this.map && hover(event.offsetX, event.offsetY, event.type === "pointerdown");
        for (const name of ["pointermove", "pointerdown"]) this.canvas.addEventListener(name, tell);
        this.canvas.addEventListener("pointerleave", (event) => event.pointerType === "mouse" && this.map && hover());
    }

    /**
     * A generator. draw(context, width, height): one that draws, in CSS pixels, and gives what `map` becomes: where things
     * are. height: from the width. Nothing happens if there is no room yet, or if another painting is begun meanwhile.
     */
    *paint(theme, height, draw) {
        const width = this.canvas.parentNode?.clientWidth;
        if (!width) return;
        const turn = ++this.turn;
        const [ratio, tall] = [window.devicePixelRatio || 1, height(width)];
        const kept = make("canvas", { width: Math.round(width * ratio), height: Math.round(tall * ratio) });
        const map = yield* draw(context(kept, ratio, theme), width, tall);
        if (turn !== this.turn) return;
        Object.assign(this, { ratio, theme, kept, map });
        Object.assign(this.canvas, { width: kept.width, height: kept.height });
        this.canvas.style.height = `${tall}px`;
        this.mark(() => {});
    }

    mark(draw) {
        if (!this.map) return;
        const { width, height } = this.canvas;
        const over = context(this.canvas, this.ratio, this.theme);
        over.clearRect(0, 0, width, height);
        over.drawImage(this.kept, 0, 0, width / this.ratio, height / this.ratio);
        draw(over, this.map);
    }
}

function context(canvas, ratio, theme) {
    const found = canvas.getContext("2d");
    found.setTransform(ratio, 0, 0, ratio, 0, 0);
    found.font = `11px ${theme.font}`;
    found.lineJoin = "round";
    return found;
}

/** Places in a box [left, top, right, bottom] of CSS pixels, whose sides are axes from one value to another. */
export class Chart {
    constructor(box, [x0, x1], [y0, y1]) {
        Object.assign(this, { box, x0, y0, wide: (box[2] - box[0]) / (x1 - x0), high: (box[3] - box[1]) / (y1 - y0) });
    }

    x(value) {
        return this.box[0] + (value - this.x0) * this.wide;
    }

    y(value) {
        return this.box[3] - (value - this.y0) * this.high;
    }

    /** The values at a place; null outside of the box. */
    at(x, y) {
        const [left, top, right, bottom] = this.box;
        if (!(x >= left && x < right && y > top && y <= bottom)) return null;
        return [this.x0 + (x - left) / this.wide, this.y0 + (bottom - y) / this.high];
    }

    /**
     * Grid lines and their texts, but for those whose text would touch the one before. xs, ys: [value, text]. names: of the
     * axes, below and above.
     */
    axes(context, theme, xs, ys, names) {
        const [left, top, right, bottom] = this.box;
        context.fillStyle = theme.quiet;
        let end = -Infinity;
        for (const [value, text] of xs) {
            const [x, half] = [this.x(value), context.measureText(text).width / 2];
            if (x - half < end + 5) continue;
            polyline(context, [[x, top], [x, bottom + 3]], theme.line, 1);
            label(context, text, x, bottom + 14, 0.5);
            end = x + half;
        }
        end = Infinity;
        for (const [value, text] of ys) {
            const y = this.y(value);
            if (y > end - 12) continue;
            polyline(context, [[left - 3, y], [right, y]], theme.line, 1);
            label(context, text, left - 6, y + 4, 1);
            end = y;
        }
        context.fillStyle = theme.ink;
        label(context, names[0], (left + right) / 2, bottom + 28, 0.5);
        label(context, names[1], 0, top - 14);
    }
}

/** Text whose letters after "_" are subscripts. align: 0 for left, ½ for centre, 1 for right. */
export function label(context, text, x, y, align = 0) {
    const { font } = context;
    const parts = text.split(/_(\w)/).map((part, i) => {
        context.font = i % 2 ? font.replace("11px", "8px") : font;
        return [part, context.font, context.measureText(part).width, i % 2 ? 3 : 0];
    });
    let at = x - align * parts.reduce((sum, [, , width]) => sum + width, 0);
    for (const [part, its, width, down] of parts) {
        context.font = its;
        context.fillText(part, at, y + down);
        at += width;
    }
    context.font = font;
}

export function polyline(context, points, colour, width = 1.6, dashes = []) {
    context.beginPath();
    for (const point of points) context.lineTo(...point);
    context.setLineDash(dashes);
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.stroke();
    context.setLineDash([]);
}

/** Discs about [x, y] points, which are seen on any colour. */
export function discs(context, points, radius, fill, outline, width = 1) {
    context.beginPath();
    for (const [x, y] of points) {
        context.moveTo(x + radius, y);
        context.arc(x, y, radius, 0, 2 * Math.PI);
    }
    context.fillStyle = fill;
    context.fill();
    context.strokeStyle = outline;
    context.lineWidth = width;
    context.stroke();
}

/** A double line about a rectangle. */
export function frame(context, [x, y, width, height], colours) {
    colours.forEach((colour, i) => {
        context.strokeStyle = colour;
        context.lineWidth = [4, 2][i];
        context.strokeRect(x - 1.5, y - 1.5, width + 3, height + 3);
    });
}

/** What fills a plot. Subclasses have height(width), *painted(context, width, height), and mark(). */
export class Painter {
    constructor(hub, hover) {
        [this.hub, this.plot] = [hub, new Plot(hover)];
    }

    *draw() {
        yield* this.plot.paint(this.hub.theme, (width) => this.height(width), (...given) => this.painted(...given));
        this.mark();
    }
}

/** One of the panels: what it draws, a sentence of numbers, and an explanation. */
export class Drawing extends Painter {
    constructor(hub, hover) {
        super(hub, hover);
        [this.said, this.explains] = ["said", "explains"].map((className) => make("p", { className }));
    }

    panel(title, controls = [], body = this.plot.canvas) {
        const head = make("div", { className: "panel-head" }, make("h3", {}, title), ...controls);
        return make("section", { className: "panel" }, head, make("div", {}, body), this.said, this.explains);
    }

    say(text) {
        if (this.text === text) return;
        this.text = text;
        this.said.replaceChildren(...rich(text));
    }
}

/** Curves of each material against an angle: [angle, RGB]. Subclasses have angleAt(x, y), and `map` has place(angle, value). */
export class Curves extends Drawing {
    constructor(hub) {
        super(hub, (x, y) => {
            this.hovered = x === undefined ? null : this.angleAt(x, y);
            this.mark();
        });
        [this.curves, this.hovered] = [[], null];
    }

    values() {
        return this.curves.flatMap((curve, m) => this.hub.lines(m).flatMap(([pick]) => curve.map(([, f]) => pick(f))));
    }

    lines(context, place) {
        this.curves.forEach((curve, m) => {
            for (const [pick, colour] of this.hub.lines(m)) {
                polyline(context, curve.map(([angle, f]) => place(angle, pick(f))), colour, 1.6, m ? [5, 3] : []);
            }
        });
    }

    discs(context, place, angle, found) {
        found.forEach((f, m) => {
            for (const [pick, colour] of this.hub.lines(m)) discs(context, [place(angle, pick(f))], 3, colour, this.hub.theme.surface);
        });
    }
}

const [BUDGET, PAUSE] = [6, 14]; // milliseconds of a turn, and from one to the next; not one a frame, since frames may be slow
let until = 0;

/** Whether the turn is over: a job that is told so should yield. */
export function late() {
    return performance.now() > until;
}

/** Runs generators, a little at a time. */
export class Work {
    constructor() {
        [this.jobs, this.waiting] = [new Map(), new Map()];
    }

    /** Does make()'s job. One of the same name that is under way is dropped, or, if `after`, ended first. */
    start(name, make, after = false) {
        this.waiting.delete(name);
        if (after && this.jobs.has(name)) this.waiting.set(name, make);
        else this.jobs.set(name, make());
        this.wake();
    }

    /** Nothing goes on: what the jobs were about is gone. */
    drop() {
        for (const jobs of [this.jobs, this.waiting]) jobs.clear();
    }

    wake() {
        this.timer ??= setTimeout(() => this.run(), PAUSE);
    }

    run() {
        this.timer = null;
        if (!this.jobs.size) return;
        this.wake();
        until = performance.now() + BUDGET;
        for (const [name, job] of [...this.jobs]) {
            if (late()) return;
            this.jobs.delete(name);
            let done = false;
            while (!done && !late()) ({ done } = job.next());
            if (this.jobs.has(name)) continue;
            if (!done) this.jobs.set(name, job);
            else if (this.waiting.has(name)) this.start(name, this.waiting.get(name));
        }
    }
}
