/** The built-in environment, by the formula of Sommerl's render/environment.py; and how a shader draws directions towards any. */
import { DEGREE, clamp } from "./vectors.js";

// Elevation and azimuth [degrees; 0 behind the camera, growing to its left], angular size σ [degrees], radiance.
const LIGHTS = [
    [35, -75, 18, [2.6, 2.4, 2.1]],
    [55, 40, 7, [14, 13, 12]],
    [20, 75, 2.5, [60, 66, 75]],
    [48, -25, 0.9, [520, 480, 420]],
    [-15, 115, 5, [7, 4.5, 2.6]],
];
const [GROUND, HORIZON, ZENITH] = [[0.02, 0.017, 0.014], [0.07, 0.072, 0.078], [0.028, 0.042, 0.08]];
const [COLUMNS, ROWS] = [256, 128]; // of cells that directions are drawn from
const UNIFORM = 0.02; // share of directions that do not follow the light

/** {width, height, pixels}: radiance, three numbers a pixel, from the zenith down. */
export function builtIn(height = 512) {
    const width = 2 * height;
    const pixels = new Float32Array(3 * width * height);
    for (let i = 0; i < height; i++) {
        const elevation = Math.PI / 2 - ((i + 0.5) / height) * Math.PI;
        const up = Math.sin(elevation);
        const blend = clamp(0.5 + up / 0.1, 0, 1); // a soft horizon
        const t = Math.max(up, 0);
        const sky = HORIZON.map((x, c) => blend * (x + (ZENITH[c] - x) * t) + (1 - blend) * GROUND[c]);
        for (let k = 0; k < width; k++) pixels.set(sky, 3 * (i * width + k));
        for (const [at, around, size, radiance] of LIGHTS) {
            const [a, sine, cosine] = [around * DEGREE, up * Math.sin(at * DEGREE), Math.cos(elevation) * Math.cos(at * DEGREE)];
            for (let k = 0; k < width; k++) {
                const angle = Math.acos(Math.min(sine + cosine * Math.cos(((k + 0.5) / height) * Math.PI - Math.PI - a), 1));
                const share = (angle / (size * DEGREE)) ** 2;
                if (share > 60) continue; // nothing in single precision
                const bright = Math.exp(-0.5 * share);
                for (let c = 0; c < 3; c++) pixels[3 * (i * width + k) + c] += bright * radiance[c];
            }
        }
    }
    return { width, height, pixels };
}

/**
 * Walker's alias table over COLUMNS × ROWS cells of an environment: for each the share that is its own, another cell, its probability
 * times the number of cells, and 0.
 */
export function aliases({ width, height, pixels }) {
    const weights = new Float64Array(COLUMNS * ROWS);
    for (let i = 0; i < height; i++) {
        const sine = Math.sin(((i + 0.5) / height) * Math.PI);
        const row = Math.floor((i * ROWS) / height) * COLUMNS;
        for (let k = 0; k < width; k++) {
            const at = 3 * (i * width + k);
            weights[row + Math.floor((k * COLUMNS) / width)] += sine * (pixels[at] + pixels[at + 1] + pixels[at + 2]);
        }
    }
    const count = weights.length;
    const whole = weights.reduce((sum, x) => sum + x, 0);
    const even = whole > 0 ? UNIFORM : 1; // all, where there is no light
    const shares = weights.map((x) => ((1 - even) * x * count) / (whole || 1) + even);
    const found = new Float32Array(4 * count);
    const left = Float64Array.from(shares);
    const [small, large] = [[], []];
    left.forEach((x, i) => (x < 1 ? small : large).push(i));
    while (small.length && large.length) {
        const [i, k] = [small.pop(), large.at(-1)];
        found.set([left[i], k], 4 * i);
        left[k] -= 1 - left[i];
        if (left[k] < 1) small.push(large.pop());
    }
    for (const i of [...small, ...large]) found.set([1, i], 4 * i);
    shares.forEach((x, i) => (found[4 * i + 2] = x));
    return { width: COLUMNS, height: ROWS, data: found };
}
