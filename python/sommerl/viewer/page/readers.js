/**
 * Material files of every kind that the page shows, by their bytes. Every reader checks sizes before it takes memory, and
 * throws an Error of one sentence for what it cannot read.
 */
import { expect, half, inflated, latin, viewOf } from "./bytes.js";
import { cellsAbove } from "./evaluate.js";
import { LARGEST_FILE } from "./limits.js";
import { readRgl } from "./rgl.js";
import { decode } from "./smrl.js";

const KNOWN = "a material file (.smrl, MERL's .binary, RGL's .bsdf or .mbsdf)";
const MERL_SCALE = [1 / 1500, 1.15 / 1500, 1.66 / 1500];
const MERL_BINS = [180, 360]; // in φ_d, of 90 × 90; data of 360 bins is not reciprocal
const LUMINANCE = [0.2126, 0.7152, 0.0722];
const LARGEST = (2 - 2 ** -23) * 2 ** 127; // of single precision
const MOST_CELLS = 2 ** 22;
const LONGEST_HEAD = 2 ** 16;
const NO_REFLECTION = "expected a line MBSDF_DATA_REFLECTION=, found none";

const READERS = {
    smrl: (bytes) => decode(bytes.slice().buffer),
    bsdf: readRgl,
    mbsdf: readGrid,
    merl: readMerl,
    table: readTable,
};
const STARTS = { smrl: "SMRL", bsdf: "tensor_file\0", mbsdf: "NVIDIA ARC MBSDF", table: "SMTB" };
const EXTENSIONS = { smrl: "smrl", bsdf: "bsdf", mbsdf: "mbsdf", binary: "merl" };

/**
 * A decoded material. format: a key of READERS; null for a file that somebody chose, whose content tells, or else its name.
 * deflated: whether the bytes are compressed.
 */
export async function read(arrayBuffer, { format = null, name = "", deflated = false }) {
    let bytes = new Uint8Array(arrayBuffer);
    if (deflated) bytes = await inflated(bytes, "deflate-raw", LARGEST_FILE);
    expect(bytes.length <= LARGEST_FILE, `expected at most ${LARGEST_FILE} bytes, found ${bytes.length}`);
    const known = format ?? formatOf(bytes, name);
    expect(known in READERS, `expected ${KNOWN}, found another kind`);
    const material = await READERS[known](bytes);
    return { ...material, name: visible(material.name || name), bytes: bytes.length };
}

function formatOf(bytes, name) {
    const start = latin(bytes.subarray(0, 16));
    const found = Object.keys(STARTS).find((format) => start.startsWith(STARTS[format]));
    if (found) return found;
    if (bytes.length >= 12 && MERL_BINS.includes(merlBins(bytes))) return "merl";
    return EXTENSIONS[name.split(".").pop().toLowerCase()];
}

/** One line of printable characters: names in files may hold others. */
export function visible(text) {
    return text.replace(/\s/gu, " ").replace(/\p{C}/gu, "\ufffd");
}

/** What went wrong, as one sentence. */
export function sentence(error) {
    const known = error?.constructor === Error;
    return visible(known ? error.message : "expected a whole file, found one that is damaged or too large").slice(0, 500);
}

/** Three int32 dimensions, then the planes R, G, B in float64. */
function readMerl(bytes) {
    expect(bytes.length >= 12, `expected a MERL header of 12 bytes, found ${bytes.length}`);
    const phiD = merlBins(bytes);
    expect(MERL_BINS.includes(phiD), "expected MERL dimensions 90×90×180 or 90×90×360, found others");
    const lattice = { thetaH: 90, thetaD: 90, phiD, reciprocal: phiD === 180 };
    const cells = 90 * 90 * phiD;
    expect(bytes.length === 12 + 24 * cells, `expected ${12 + 24 * cells} bytes for these dimensions, found ${bytes.length}`);
    const start = bytes.byteOffset + 12;
    const planes = new Float64Array(bytes.buffer.slice(start, start + 24 * cells));
    return table(lattice, "trilinear", (cell, c) => planes[c * cells + cell] * MERL_SCALE[c]);
}

/** Bins in φ_d, of 90 × 90; 0 if there are others. */
function merlBins(bytes) {
    const [thetaH, thetaD, phiD] = [0, 4, 8].map((at) => viewOf(bytes).getInt32(at, true));
    return thetaH === 90 && thetaD === 90 ? phiD : 0;
}

/**
 * A table that held.py writes: "SMTB", bins in θ_h, θ_d, φ_d (2 bytes each), 1 if reciprocal, 1 if trilinear; then a code for
 * each of three planes of cells, the low bytes of all before the high ones. Codes are ∛f_r in half precision, each in φ_d less
 * the one before.
 */
function readTable(bytes) {
    expect(bytes.length >= 12, `expected a head of 12 bytes, found ${bytes.length}`);
    const [thetaH, thetaD, phiD] = [4, 6, 8].map((at) => viewOf(bytes).getUint16(at, true));
    const cells = thetaH * thetaD * phiD;
    expect(cells > 0 && cells <= MOST_CELLS, `expected 1 to ${MOST_CELLS} cells, found ${cells}`);
    expect(bytes.length === 12 + 6 * cells, `expected ${12 + 6 * cells} bytes for ${cells} cells, found ${bytes.length}`);
    expect(bytes[10] < 2 && bytes[11] < 2, "expected flags of 0 or 1, found others");
    const codes = new Uint16Array(3 * cells);
    for (let i = 0; i < codes.length; i++) {
        codes[i] = bytes[12 + i] + 256 * bytes[12 + codes.length + i] + (i % phiD ? codes[i - 1] : 0);
    }
    const lattice = { thetaH, thetaD, phiD, reciprocal: bytes[10] === 1 };
    return table(lattice, bytes[11] ? "trilinear" : "nearest", (cell, c) => half(codes[c * cells + cell]) ** 3);
}

/** value(cell, channel): f_r as it was read. What a table cannot hold is changed as reflectance/table.py does. */
function table(lattice, interpolation, value) {
    const above = cellsAbove(lattice);
    const values = new Float32Array(3 * above.length);
    let positive = false;
    for (let cell = 0; cell < above.length; cell++) {
        if (above[cell] !== cell) {
            // The last one above the horizon comes before, so that it is there already.
            values.copyWithin(3 * cell, 3 * above[cell], 3 * above[cell] + 3);
            continue;
        }
        let lowest = 0;
        for (let c = 0; c < 3; c++) {
            const f = value(cell, c);
            const fine = Math.abs(f) <= LARGEST ? f : 0;
            values[3 * cell + c] = fine;
            lowest = Math.min(lowest, fine);
            positive ||= fine > 0;
        }
        if (lowest < 0) values.set(withoutNegatives(values.subarray(3 * cell, 3 * cell + 3)), 3 * cell);
    }
    expect(positive, "expected a positive, finite reflectance above the horizon, found none");
    return { kind: "table", lattice, values, interpolation };
}

/** The nearest colour of the same luminance that has no negative channel: see reflectance/gamut.py. */
function withoutNegatives(colour) {
    const luminance = LUMINANCE.reduce((sum, weight, c) => sum + weight * colour[c], 0);
    if (!(luminance > 0)) return [0, 0, 0];
    const foot = (kept) => {
        const weights = LUMINANCE.map((weight, c) => (kept[c] ? weight : 0));
        const norm = weights.reduce((sum, weight) => sum + weight * weight, 0) || 1;
        const surplus = weights.reduce((sum, weight, c) => sum + weight * colour[c], 0) - luminance;
        return weights.map((weight, c) => colour[c] - (weight * surplus) / norm);
    };
    let kept = Array.from(colour, (x) => x > 0);
    kept = foot(kept).map((x, c) => kept[c] && x > 0);
    return foot(kept).map((x, c) => (kept[c] ? Math.max(x, 0) : 0));
}

/**
 * NVIDIA's .mbsdf: lines of text, the last one MBSDF_DATA_REFLECTION= or MBSDF_DATA=; then type (0 grey, 1 RGB), n, m in 4 bytes
 * each, and float32 [θ_in][θ_out][φ] at the centres of n, n and m equal bins. Data for transmission, before or after, is left out.
 */
function readGrid(bytes) {
    expect(latin(bytes.subarray(0, LONGEST_HEAD)).startsWith(STARTS.mbsdf), "expected a measured BSDF (.mbsdf), found another kind");
    let section = sectionFrom(bytes, 0);
    if (section.transmitted) section = sectionFrom(bytes, section.start + section.length);
    expect(!section.transmitted, NO_REFLECTION);
    const { type, thetas, phis, size, length } = section;
    const start = bytes.byteOffset + section.start;
    const given = new Float32Array(bytes.buffer.slice(start, start + length));
    expect(given.every(Number.isFinite), "expected finite numbers, found NaN or infinity");
    const values = type ? given : new Float32Array(3 * size).map((_, i) => given[Math.floor(i / 3)]);
    return { kind: "grid", thetas, phis, values, interpolation: "trilinear" };
}

/** The section that begins at a place, in text or right after the data of the one before: its size, and where its data is. */
function sectionFrom(bytes, from) {
    const found = /\nMBSDF_DATA(_REFLECTION|_TRANSMISSION)?=\n/.exec(latin(bytes.subarray(from, from + LONGEST_HEAD)));
    expect(found, NO_REFLECTION);
    const at = from + found.index + found[0].length;
    expect(bytes.length >= at + 12, "expected a size of the data, found a file that is cut off");
    const [type, thetas, phis] = [0, 4, 8].map((offset) => viewOf(bytes).getUint32(at + offset, true));
    expect(type < 2, `expected data of type 0 or 1, found type ${type}`);
    const size = thetas * thetas * phis;
    expect(size >= 1 && size <= MOST_CELLS, `expected 1 to ${MOST_CELLS} directions, found ${size}`);
    const length = 4 * size * (type ? 3 : 1);
    const left = bytes.length - at - 12;
    expect(left >= length, `expected ${length} bytes of data, found ${left}`);
    return { transmitted: found[1] === "_TRANSMISSION", type, thetas, phis, size, start: at + 12, length };
}
