/** Our importance sampler: its table for a material, as sampling/half_vector.py fits it. sampler.glsl draws from it. */
import { evaluate } from "./evaluate.js";

const [ROWS, COLUMNS, ELEVATIONS] = [20, 8, 12];
const CELLS = ROWS * COLUMNS;
const SLOTS = 256;
const WHOLE = CELLS * SLOTS; // what stands for the probability 1
const TINY = 1e-9;
const LOWEST = 1e-4; // cos θ_o of the lowest elevation
const DIFFUSE = 0.01; // share of directions that follow the cosine
const FINER = 3; // points along each side of a cell
const POINTS = FINER * FINER;
const NEIGHBOUR = 0.07; // a cell gets at least this share of the brightest light in and next to it

/** The table: for each of ELEVATIONS a word for each of CELLS. */
export function fitted(material) {
    const table = new Uint32Array(ELEVATIONS * CELLS);
    probabilities(material).forEach((p, e) => table.set(aliasTable(p), e * CELLS));
    return table;
}

function probabilities(material) {
    const between = 2 * ELEVATIONS - 1; // a table is also used for elevations between its own and the next
    const all = Array.from({ length: between }, (_, e) => lightOf(material, Math.max((e / (between - 1)) ** 2, LOWEST)));
    return Array.from({ length: ELEVATIONS }, (_, e) => {
        const near = all.slice(Math.max(2 * e - 2, 0), 2 * e + 3);
        const bounded = all[2 * e].rms.map((rms, cell) => Math.max(rms, NEIGHBOUR * brightestNear(near, cell)));
        const total = sum(bounded);
        const even = all[2 * e].cosine;
        const whole = sum(even);
        // Where a viewer gets no light at all, the cosine alone.
        return bounded.map((b, cell) => (1 - DIFFUSE) * (total > 0 ? b / total : even[cell] / whole) + DIFFUSE * (even[cell] / whole));
    });
}

function brightestNear(elevations, cell) {
    const [row, column] = [Math.floor(cell / COLUMNS), cell % COLUMNS];
    let found = -Infinity;
    for (const { brightest } of elevations) {
        for (let r = Math.max(row - 1, 0); r <= Math.min(row + 1, ROWS - 1); r++) {
            for (let c = Math.max(column - 1, 0); c <= Math.min(column + 1, COLUMNS - 1); c++) found = Math.max(found, brightest[r * COLUMNS + c]);
        }
    }
    return found;
}

/** Of each cell, for a viewer at cos θ_o: root mean square and maximum of the light, relative, and the mean of cos θ_i dω_i. */
function lightOf(material, z) {
    const wo = [Math.sqrt(1 - z * z), 0, z];
    const [squares, most, cosine] = [0, -Infinity, 0].map((value) => new Float64Array(CELLS).fill(value));
    const mostOf = [most, most.slice(), most.slice()];
    const albedo = [0, 0, 0];
    for (let row = 0; row < ROWS * FINER; row++) {
        for (let column = 0; column < COLUMNS * FINER; column++) {
            const cell = Math.floor(row / FINER) * COLUMNS + Math.floor(column / FINER);
            const [wi, solidAngle] = mirrored((row + 0.5) / (FINER * ROWS), (2 * (column + 0.5)) / (FINER * COLUMNS), wo);
            const weight = Math.max(wi[2], 0) * solidAngle;
            cosine[cell] += weight / POINTS;
            evaluate(material, wi, wo).forEach((f, c) => {
                const light = f * weight;
                squares[cell] += (light * light) / (3 * POINTS);
                albedo[c] += light / POINTS;
                mostOf[c][cell] = Math.max(mostOf[c][cell], light);
            });
        }
    }
    const rms = squares.map(Math.sqrt);
    const total = positive(sum(rms));
    const brightest = most.map((_, cell) => Math.max(...albedo.map((a, c) => mostOf[c][cell] / positive(a))));
    return { rms: rms.map((x) => x / total), brightest, cosine };
}

/** The direction to the light for a point of the unit square, and the solid angle per area of the square. */
function mirrored(s, c, wo) {
    const x = 1 - c;
    const y = 1 - Math.abs(x);
    const round = x * x + y * y;
    const [wx, wy, wz] = [wo[0] + TINY, wo[1], Math.max(wo[2], LOWEST)];
    const across = wx * wx + wy * wy;
    const scale = 1 / Math.sqrt(round * across);
    const tilt = x * across * scale;
    const extent = extentOf(tilt, wz * wz);
    const sin2 = s ** 8 * extent;
    const [sin, cos] = [Math.sqrt(sin2), Math.sqrt(1 - sin2)];
    const dot = sin * tilt + cos * wz;
    const planar = 2 * dot * sin * scale;
    const wi = [planar * (x * wx - y * wy) - wx, planar * (x * wy + y * wx) - wy, 2 * dot * cos - wz];
    return [wi, (64 * s ** 7 * extent * dot) / (cos * round)];
}

/** sin² θ_max of half vectors in a plane through the normal. */
function extentOf(along, upright2) {
    const r = Math.sqrt(along * along + upright2);
    const a = r + Math.abs(along);
    return (along < 0 ? upright2 : a * a) / (2 * r * a);
}

function sum(values) {
    return values.reduce((total, x) => total + x, 0);
}

function positive(value) {
    return value > 0 ? value : 1;
}

/**
 * Vose's construction in whole slots. A word, from the lowest bits: probability in units of 1 / WHOLE (16 bits), another cell
 * (8), and how many of this cell's SLOTS that one gets (8).
 */
function aliasTable(p) {
    const exact = p.map((x) => x * (WHOLE - CELLS));
    const units = exact.map((x) => 1 + Math.floor(x));
    const order = Array.from(exact.keys()).sort((a, b) => Math.floor(exact[a]) - exact[a] - (Math.floor(exact[b]) - exact[b]));
    for (const cell of order.slice(0, WHOLE - sum(units))) units[cell]++;
    const [other, taken, left] = [new Uint32Array(CELLS), new Uint32Array(CELLS), units.slice()];
    const [small, large] = [[], []];
    units.forEach((count, cell) => (count < SLOTS ? small : large).push(cell));
    while (small.length) {
        const poor = small.pop();
        const rich = large.at(-1);
        [other[poor], taken[poor]] = [rich, SLOTS - left[poor]];
        left[rich] -= taken[poor];
        if (left[rich] < SLOTS) small.push(large.pop());
    }
    return Uint32Array.from(units, (count, cell) => count + other[cell] * 2 ** 16 + taken[cell] * 2 ** 24);
}
