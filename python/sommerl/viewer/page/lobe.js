/** f_r in the plane of incidence, as curves about the point that the light falls on. */
import { evaluate } from "./evaluate.js";
import { switches } from "./dom.js";
import { Curves, discs, inDegrees, label, late, luminance, nice, number, polyline, reflectance } from "./draw.js";
import { DEGREE, clamp } from "./vectors.js";

const DEEPEST = 1e-6; // the lower end of the logarithmic scale is at least this share of the peak
const SIDES = 40; // curve points on either side of the mirror direction, denser near to it
const [EDGE, TOP, FOOT] = [37, 20, 34];
const SCALES = { linear: "linear", root: "cube root", log: "log" };
const ALL = Array.from({ length: 91 }, (_, i) => (2 * i - 90) * DEGREE);

/** A generator that gives [θ_o, f_r] from −90° to 90°, for light from the left at θ_i [rad]. */
export function* lobe(material, thetaI) {
    const angles = Array.from({ length: 180 }, (_, i) => (i - 89.5) * DEGREE);
    for (let i = -SIDES; i <= SIDES; i++) angles.push(thetaI + Math.sign(i) * (i / SIDES) ** 2 * 0.5);
    const found = [];
    for (const thetaO of angles.filter((angle) => Math.abs(angle) < 90 * DEGREE).sort((a, b) => a - b)) {
        found.push([thetaO, inPlane(material, thetaI, thetaO)]);
        if (late()) yield;
    }
    return found;
}

function inPlane(material, thetaI, thetaO) {
    return evaluate(material, ...[-thetaI, thetaO].map((angle) => [Math.sin(angle), 0, Math.cos(angle)]));
}

/** {at(f): share of the radius, rings: values that may be marked, from the largest} */
export function scaleOf(name, values) {
    const positive = values.filter((x) => x > 0).sort((a, b) => a - b);
    const peak = positive.at(-1) ?? 1;
    if (name === "linear") {
        const step = nice(peak / 4);
        const rings = Array.from({ length: Math.floor(peak / step) }, (_, i) => (i + 1) * step).reverse();
        return { at: (f) => Math.max(f, 0) / peak, rings };
    }
    const decades = Array.from({ length: 12 }, (_, i) => 10 ** (Math.floor(Math.log10(peak)) - i));
    const rings = decades.flatMap((x) => [5 * x, 2 * x, x]).filter((x) => x <= peak);
    if (name === "root") return { at: (f) => Math.cbrt(Math.max(f, 0) / peak), rings };
    const low = Math.max(positive[Math.floor(positive.length / 10)] ?? 1, peak * DEEPEST);
    const floor = low / Math.max(Math.cbrt(peak / low), 10);
    return { at: (f) => (f > floor ? Math.log(f / floor) / Math.log(peak / floor) : 0), rings: decades };
}

export class Lobe extends Curves {
    constructor(hub) {
        super(hub);
        this.scale = "root";
        const choose = (scale) => {
            this.scale = scale;
            hub.later("lobe");
        };
        this.controls = [switches("Scale of the radius", Object.entries(SCALES), this.scale, choose)];
    }

    *draw() {
        const { materials, thetaI } = this.hub;
        const curves = [];
        for (const material of materials) curves.push(yield* lobe(material, thetaI));
        Object.assign(this, { curves, thetaI });
        yield* super.draw();
    }

    height(width) {
        return Math.round(Math.min((width - 2 * EDGE) / 2, 220) + TOP + FOOT);
    }

    *painted(context, width, tall) {
        const { hub: { theme }, thetaI } = this;
        const [x0, y0, radius] = [width / 2, tall - FOOT, tall - FOOT - TOP];
        const polar = (angle, r) => [x0 + Math.sin(angle) * r, y0 - Math.cos(angle) * r];
        const { at, rings } = scaleOf(this.scale, this.values());
        const ring = (r) => polyline(context, ALL.map((angle) => polar(angle, r)), theme.line, 1);
        context.fillStyle = theme.quiet;
        ring(radius);
        for (let angle = -90; angle <= 90; angle += 30) {
            const [sine, cosine] = [Math.sin(angle * DEGREE), Math.cos(angle * DEGREE)];
            const [x, y] = polar(angle * DEGREE, radius + 6);
            polyline(context, [[x0, y0], polar(angle * DEGREE, radius)], theme.line, 1);
            label(context, inDegrees(angle * DEGREE, 0), x, y + 3 * (1 - cosine), (1 - sine) / 2);
            if (late()) yield;
        }
        let last = x0 + radius + 14;
        for (const value of rings) {
            const x = x0 + radius * at(value);
            const text = number(value, true);
            const half = context.measureText(text).width / 2;
            if (x + half > last - 6 || x - half < x0 + 2) continue;
            ring(radius * at(value));
            label(context, text, x, y0 + 14, 0.5);
            last = x - half;
            if (late()) yield;
        }
        label(context, "f_r [1/sr]", x0 + radius, y0 + 29, 1);
        label(context, "θ_o", ...polar(0.26, radius + 7));
        if (late()) yield;
        // The mirror direction, and the light's, with a head where it arrives.
        polyline(context, [[x0, y0], polar(thetaI, radius)], theme.ink, 1, [1.5, 3]);
        const tip = polar(-thetaI, 2);
        polyline(context, [polar(-thetaI, radius), tip], theme.ink, 1.2);
        polyline(context, [polar(-thetaI - 0.35, 11), tip, polar(-thetaI + 0.35, 11)], theme.ink, 1.2);
        discs(context, [polar(-thetaI, radius)], 3.5, theme.surface, theme.ink, 1.2);
        context.fillStyle = theme.ink;
        label(context, `light, θ_i = ${inDegrees(thetaI, 0)}`, x0 - radius - 20, y0 + 29);
        if (late()) yield;
        const place = (angle, f) => polar(angle, radius * at(f));
        this.lines(context, place);
        return { x0, y0, place, end: (angle) => polar(angle, radius) };
    }

    angleAt(x, y) {
        const { x0, y0 } = this.plot.map;
        return clamp(Math.atan2(x - x0, Math.max(y0 - y, 0)), -1.57, 1.57);
    }

    mark() {
        const { hub, plot, hovered, curves, thetaI } = this;
        if (!curves.length) return;
        const { materials, theme } = hub;
        const found = hovered === null ? [] : materials.map((material) => inPlane(material, thetaI, hovered));
        plot.mark((context, { x0, y0, place, end }) => {
            if (hovered !== null) polyline(context, [[x0, y0], end(hovered)], theme.quiet, 1);
            this.discs(context, place, hovered, found);
        });
        const brighter = (a, b) => (luminance(b[1]) > 1.001 * luminance(a[1]) ? b : a);
        const [thetaO, peak] = curves[0].reduce(brighter);
        const most = `${hub.tag(0)}largest at θ_o = ${inDegrees(thetaO, 0)}\nf_r = ${reflectance(peak)}`;
        const here = found.map((f, m) => `${hub.tag(m)}f_r = ${reflectance(f)}`);
        this.say(hovered === null ? most : [`θ_o = ${inDegrees(hovered)}`, ...here].join("\n"));
        const [from, to] = [thetaI, thetaO].map((angle) => inDegrees(angle, 0));
        const said = `Light arrives at ${from}; f_r is largest at ${to}, where it is ${number(luminance(peak))} per steradian.`;
        plot.canvas.setAttribute("aria-label", said);
    }

    caption() {
        return "Light arrives along the arrow: the farther a curve is from the centre, the more the surface reflects at that angle θ_o of the same plane.";
    }
}
