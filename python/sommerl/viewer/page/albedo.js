/** The share of light that is reflected, against the angle of view. */
import { evaluate } from "./evaluate.js";
import { Chart, Curves, inDegrees, late, luminance, nice, number, polyline, ticks } from "./draw.js";
import { DEGREE, clamp, dot } from "./vectors.js";

const [ANGLES, LARGEST] = [20, 88.5 * DEGREE]; // points of a curve, and the last one's angle
const [RINGS, SPOKES] = [32, 20]; // of half vectors
const [LEFT, TOP, RIGHT, FOOT] = [38, 28, 12, 34];
const XS = [0, 15, 30, 45, 60, 75, 90].map((t) => [t * DEGREE, `${t}°`]);

/**
 * A generator that gives the albedo, RGB, for a viewer at θ_o [rad]: f_r cos θ_i, integrated over half vectors. Their rings
 * are as far apart as a lattice's, closer near to the normal, where highlights are.
 */
export function* albedo(material, thetaO) {
    const wo = [Math.sin(thetaO), 0, Math.cos(thetaO)];
    const sum = [0, 0, 0];
    for (let i = 0; i < RINGS; i++) {
        const root = (i + 0.5) / RINGS;
        const thetaH = (root * root * Math.PI) / 2;
        const area = ((Math.sin(thetaH) * Math.PI * root) / RINGS) * ((2 * Math.PI) / SPOKES);
        for (let j = 0; j < SPOKES; j++) {
            const phiH = ((j + (i % 2 ? 1 : 0.5)) / SPOKES) * 2 * Math.PI;
            const h = [Math.sin(thetaH) * Math.cos(phiH), Math.sin(thetaH) * Math.sin(phiH), Math.cos(thetaH)];
            const along = dot(h, wo);
            const wi = h.map((x, c) => 2 * along * x - wo[c]);
            if (!(along > 0 && wi[2] > 0)) continue;
            const f = evaluate(material, wi, wo);
            for (let c = 0; c < 3; c++) sum[c] += f[c] * wi[2] * 4 * along * area;
        }
        if (late()) yield;
    }
    return sum;
}

/** The albedo between the points of a curve, by straight lines. */
function between(curve, angle) {
    const next = curve.findIndex(([at]) => at >= angle);
    const i = next < 0 ? curve.length - 1 : Math.max(1, next);
    const [[a, f], [b, g]] = [curve[i - 1], curve[i]];
    const share = Math.min(1, (angle - a) / (b - a));
    return f.map((x, c) => x + share * (g[c] - x));
}

export class Albedo extends Curves {
    reset() {
        this.curves = this.hub.materials.map(() => []);
        this.hub.work.start("albedo", () => this.fill(this.curves));
    }

    *fill(curves) {
        const { materials } = this.hub;
        for (let n = 0; n < ANGLES; n++) {
            const angle = (LARGEST * n) / (ANGLES - 1);
            for (let m = 0; m < materials.length; m++) curves[m].push([angle, yield* albedo(materials[m], angle)]);
        }
        yield* this.draw();
    }

    height(width) {
        return Math.round(Math.min(0.5 * (width - LEFT - RIGHT), 190)) + TOP + FOOT;
    }

    *painted(context, width, tall) {
        const { theme } = this.hub;
        const peak = Math.max(1e-4, ...this.values());
        const step = nice(peak / 4);
        const most = Math.ceil(peak / step - 1e-9) * step;
        const chart = new Chart([LEFT, TOP, width - RIGHT, tall - FOOT], [0, 90 * DEGREE], [0, most]);
        chart.axes(context, theme, XS, ticks(0, most, 4), ["θ_o", "albedo"]);
        if (late()) yield;
        const place = (angle, value) => [chart.x(angle), chart.y(Math.max(value, 0))];
        if (most > 1) polyline(context, [place(0, 1), place(90 * DEGREE, 1)], theme.quiet, 1, [5, 3]);
        this.lines(context, place);
        return { chart, place, most };
    }

    angleAt(x) {
        const { chart } = this.plot.map;
        return chart.at(x, chart.box[3])?.[0] ?? null;
    }

    mark() {
        const { hub, plot, curves } = this;
        if (!curves.length || curves.some((curve) => curve.length < ANGLES)) return this.say("…");
        const angle = this.hovered ?? (hub.pair ? Math.acos(clamp(hub.pair.wo[2], 0, 1)) : null);
        const found = curves.map((curve) => between(curve, angle ?? 0));
        plot.mark((context, { place, most }) => {
            if (angle === null) return;
            polyline(context, [place(angle, 0), place(angle, most)], hub.theme.quiet, 1);
            this.discs(context, place, angle, found);
        });
        const here = found.map((f, m) => `${hub.tag(m)}albedo ${f.map((x) => number(x)).join(", ")}`);
        this.say([`θ_o = ${inDegrees(angle ?? 0)}`, ...here].join("\n"));
        const [normal, grazing] = [0, 75].map((t) => number(luminance(between(curves[0], t * DEGREE))));
        return plot.canvas.setAttribute("aria-label", `The albedo is ${normal} seen from above, and ${grazing} at 75°.`);
    }

    caption() {
        return "In even light from all sides, the share of it that the surface reflects towards a viewer at the angle θ_o; a real surface stays below 1.";
    }
}
