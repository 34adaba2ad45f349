/**
 * Materials that Sommerl has compressed (.smrl), for browsers and Node: read, evaluated and sampled as in Python.
 *
 * Directions are unit vectors in the surface frame, arrays of three numbers, z along the normal; wi points to the light, wo to
 * the viewer. Vectors with components that are NaN or infinite give NaN; others give 0 unless both are above the horizon.
 */
import { evaluate } from "./evaluate.js";
import { fitted } from "./sampler.js";
import { decode } from "./smrl.js";

const [ROWS, COLUMNS, ELEVATIONS] = [20, 8, 12];
const CELLS = ROWS * COLUMNS;
const SLOTS = 256;
const WHOLE = CELLS * SLOTS;
const TINY = 1e-9;
const LOWEST = 1e-4;
const SMALLEST = 1e-35;
const LARGEST = (2 - 2 ** -23) * 2 ** 127; // of single precision
const UP = [0, 0, 1];

/** The material in the bytes of a file (an ArrayBuffer, or a view of one). Throws an Error of one sentence for others. */
export async function load(bytes) {
    const view = ArrayBuffer.isView(bytes) ? new Uint8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength) : new Uint8Array(bytes);
    return new Brdf(await decode(view.slice().buffer));
}

/** A material. `load` makes it. */
export class Brdf {
    #material;
    #table = null; // of the sampler, fitted when it is first needed

    constructor(material) {
        this.#material = material;
    }

    /** name, sha256 of the source, notes ({options, metrics}), kind ("cells" or "nodes"), reciprocal, mirrored, signed. */
    get info() {
        const { name, sha256, notes, kind, lattice, signed = false } = this.#material;
        return { name, sha256, notes, kind, reciprocal: lattice.reciprocal, mirrored: lattice.mirrored ?? false, signed };
    }

    /** f_r [1/sr], linear RGB, without the cosine. */
    eval(wi, wo) {
        if (![...wi, ...wo].every(Number.isFinite)) return [NaN, NaN, NaN];
        return evaluate(this.#material, wi, wo).map(finite);
    }

    /**
     * Draws a direction to the light with three random numbers from 0 to 1: { wi, pdf, weight }. pdf: its density [1/sr], 0 if
     * none was drawn. weight: f_r cos θ_i / pdf, whose mean is the albedo. Throws an Error for other random numbers.
     */
    sample(wo, u) {
        const none = { wi: UP, pdf: 0, weight: [0, 0, 0] };
        if (![...wo, ...u].every(Number.isFinite)) return { wi: [NaN, NaN, NaN], pdf: NaN, weight: [NaN, NaN, NaN] };
        if (!u.every((x) => x >= 0 && x <= 1)) throw new Error("sample: random numbers have to be from 0 to 1, and some are not");
        if (!(wo[2] > 0)) return none;
        const { wi, density } = draw(this.#fitted(), wo, u);
        const pdf = finite(density);
        return pdf > 0 ? { wi, pdf, weight: this.eval(wi, wo).map((f) => finite((f * wi[2]) / pdf)) } : none;
    }

    /** The density [1/sr] with which `sample` draws wi. */
    pdf(wi, wo) {
        if (![...wi, ...wo].every(Number.isFinite)) return NaN;
        return wi[2] > 0 && wo[2] > 0 ? Math.max(0, finite(density(this.#fitted(), wi, wo))) : 0;
    }

    #fitted() {
        this.#table ??= fitted(this.#material);
        return this.#table;
    }
}

/** 0 for what is no number; what overflows, at the largest of single precision. */
function finite(x) {
    return Number.isNaN(x) ? 0 : Math.min(Math.max(x, -LARGEST), LARGEST);
}

/** The number of the bin of width 1 that holds x. */
function bin(x, count) {
    return x > 0 ? Math.min(Math.floor(x), count - 1) : 0;
}

/** The number of the first cell of the elevation below, and the share of the next one: sampling/half_vector.py explains all. */
function elevation(cosO) {
    const x = Math.sqrt(Math.max(cosO, 0)) * (ELEVATIONS - 1);
    const node = bin(x, ELEVATIONS - 1);
    return [CELLS * node, x - node];
}

function share(table, first, t, cell) {
    const [here, next] = [table[first + cell] & 0xffff, table[first + CELLS + cell] & 0xffff];
    return (here + t * (next - here)) / SLOTS;
}

function extentOf(along, upright2) {
    const r = Math.sqrt(along * along + upright2);
    const a = r + Math.abs(along);
    return (along < 0 ? upright2 : a * a) / (2 * r * a);
}

function draw(table, wo, u) {
    const [first, t] = elevation(wo[2]);
    const second = u[0] < t;
    const slot = bin(((second ? u[0] : u[0] - t) / (second ? t : 1 - t)) * WHOLE, WHOLE);
    const own = Math.floor(slot / SLOTS);
    const word = table[own + (second ? first + CELLS : first)];
    const cell = slot % SLOTS < word >>> 24 ? (word >>> 16) & 255 : own;
    const side = 2 * u[2] - 1;
    const s = (Math.floor(cell / COLUMNS) + u[1]) / ROWS;
    const [wi, solidAngle] = mirrored(s, ((cell % COLUMNS) + Math.abs(side)) * (2 / COLUMNS), side, wo);
    const drawn = wi[2] > 0 && solidAngle > SMALLEST;
    return { wi, density: drawn ? share(table, first, t, cell) / solidAngle : 0 };
}

/** The direction to the light for a point (s, c) of the unit square, and the solid angle per area of the square. */
function mirrored(s, c, side, wo) {
    const x = 1 - c;
    const y = (1 - Math.abs(x)) * (side < 0 ? -1 : 1);
    const round = x * x + y * y;
    const [wx, wy, wz] = [wo[0] + TINY, wo[1], Math.max(wo[2], LOWEST)];
    const across = wx * wx + wy * wy;
    const scale = 1 / Math.sqrt(round * across);
    const tilt = x * across * scale;
    const extent = extentOf(tilt, wz * wz);
    const [sin, cos] = [Math.sqrt(s ** 8 * extent), Math.sqrt(1 - s ** 8 * extent)];
    const dot = sin * tilt + cos * wz;
    const planar = 2 * dot * sin * scale;
    const wi = [planar * (x * wx - y * wy) - wx, planar * (x * wy + y * wx) - wy, 2 * dot * cos - wz];
    return [wi, (64 * s ** 7 * extent * dot) / (cos * round)];
}

function density(table, wi, wo) {
    const [x, y, z] = [wo[0] + TINY, wo[1], Math.max(wo[2], LOWEST)];
    const [hx, hy, hz] = [wi[0] + wo[0] + TINY, wi[1] + wo[1], wi[2] + z];
    const [along, across] = [hx * x + hy * y, hx * y - hy * x];
    const flat = Math.max(hx * hx + hy * hy, TINY * TINY);
    const extent = extentOf(along, z * z * flat);
    const s = Math.sqrt(Math.sqrt(Math.sqrt(Math.min(flat / ((flat + hz * hz) * extent), 1))));
    const rim = 1 / Math.max(Math.abs(along) + Math.abs(across), TINY * TINY);
    const [row, column] = [bin(s * ROWS, ROWS), bin((1 - along * rim) * (COLUMNS / 2), COLUMNS)];
    const [first, t] = elevation(wo[2]);
    return (share(table, first, t, column + COLUMNS * row) * (s * hz) * ((x * x + y * y) * (rim * rim))) / 32;
}
