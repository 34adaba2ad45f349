/**
 * Material files (.smrl), formats 1 and 2, for browsers and Node: docs/format.md has every byte.
 *
 * decode(arrayBuffer) gives kind ("cells" or "nodes"), name, sha256, notes, interpolation, scale, lattice, lut and index;
 * of nodes also signed, smooth, gains and gainIndex. lattice has reciprocal, of nodes also mirrored. lut and gains are
 * Float64Arrays, lut in triples. Indices are one for each cell, 0 below the horizon, or one for each node. It throws an
 * Error that says what was expected.
 */
import { readNodes } from "./nodes.js";

const ON_HORIZON = 1e-12;
const MOST_CELLS = 2 ** 22;
const LONGEST_FILE = 2 * MOST_CELLS + 24 * 2 ** 16 + 2 ** 20;
const DEEPEST_NOTES = 32;
const KINDS = ["som-man", "factored", "source"]; // of what a material was made from
const PLAIN =
    "at most 64 names of at most 100 characters, each with a number, true, false, null or a text of at most 1000 characters";
const LARGEST = (2 - 2 ** -23) * 2 ** 127; // of single precision

export async function decode(arrayBuffer) {
    const bytes = new Uint8Array(arrayBuffer);
    const reader = new Reader(bytes);
    expect(bytes.length <= LONGEST_FILE, `at most ${LONGEST_FILE} bytes, found ${bytes.length}`);
    expect(bytes.length >= 10, `at least 10 bytes, found ${bytes.length}`);
    expect(String.fromCharCode(...reader.take(4)) === "SMRL", "a material file (.smrl), found another kind");
    const version = reader.number(2);
    const hint = version > 2 ? "a newer Sommerl may read it" : "make it from its source again";
    expect(version === 1 || version === 2, `version 1 or 2, found version ${version}; ${hint}`);
    const whole = reader.number(4) === crc32(bytes.subarray(10));
    expect(whole, "the checksum in the file, found another: the file is damaged or cut off");
    const kind = reader.number(1);
    expect(kind === 1 || (kind === 0 && version === 1), `kind ${version > 1 ? "1" : "0 or 1"}, found ${kind}`);
    const name = reader.text(reader.number(1));
    expect(name !== null, "a name in UTF-8, found other bytes");
    const digest = reader.number(1);
    expect(digest === 0 || digest === 32, `a digest of 0 or 32 bytes, found ${digest}`);
    const sha256 = Array.from(reader.take(digest), (byte) => byte.toString(16).padStart(2, "0")).join("");
    const notes = readNotes(reader.text(reader.number(2)));
    return { name, sha256, notes, ...(kind ? nodes(reader, version) : await cells(reader)) };
}

function nodes(reader, version) {
    const scale = new DataView(reader.take(4).slice().buffer).getFloat32(0, true);
    expect(scale > 0 && scale < Infinity, "a positive scale that is finite, found another");
    const flags = version > 1 ? reader.number(1) : 1;
    expect(flags < 16, `flags from 0 to 15, found ${flags}`);
    const [reciprocal, mirrored, signed, smooth] = [1, 2, 4, 8].map((bit) => (flags & bit) > 0);
    const { lattice, gainCodes, shapeCodes, gainIndex, index } = readNodes(reader.rest(), mirrored, version);
    const gains = Float64Array.from(gainCodes, (code) => Math.sign(code) * gain(Math.abs(code)));
    const lut = Float64Array.from(shapeCodes.flatMap(shape));
    const known = { kind: "nodes", interpolation: "trilinear", scale, signed, smooth };
    return { ...known, lattice: { ...lattice, reciprocal }, gains, lut, gainIndex, index };
}

function gain(code) {
    return 0.5 * (2 ** (code >> 7) * (1 + (code & 127) / 128) - 1);
}

function shape([first, second]) {
    const green = 1 + ((second / 64) * 2) / 3;
    return [(3 - green + first / 64) / 2, green, (3 - green - first / 64) / 2];
}

async function cells(reader) {
    const head = new Reader(reader.take(12));
    const [thetaH, thetaD, phiD, reciprocal, trilinear, clusters] = [2, 2, 2, 1, 1, 4].map((n) => head.number(n));
    const size = thetaH * thetaD * phiD;
    expect(size > 0 && size <= MOST_CELLS, `a lattice of 1 to ${MOST_CELLS} cells, found ${size}`);
    expect(clusters > 0 && clusters <= 65536, `a LUT of 1 to 65536 entries, found ${clusters}`);
    expect(reciprocal < 2 && trilinear < 2, `flags of 0 or 1, found ${reciprocal} and ${trilinear}`);
    const lattice = { thetaH, thetaD, phiD, reciprocal: reciprocal === 1 };
    const above = aboveHorizon(lattice);
    const width = clusters <= 256 ? 1 : 2;
    const payload = await inflated(reader.rest(), 24 * clusters + width * above.length);
    const view = new DataView(payload.buffer);
    const lut = Float64Array.from({ length: 3 * clusters }, (_, i) => view.getFloat64(8 * i, true));
    expect(lut.every((x) => x >= 0 && x <= LARGEST), "LUT entries from 0 to the largest of single precision, found others");
    const index = width === 1 ? new Uint8Array(size) : new Uint16Array(size);
    let largest = 0;
    above.forEach((cell, i) => {
        const at = 24 * clusters + width * i;
        index[cell] = width === 1 ? payload[at] : view.getUint16(at, true);
        largest = Math.max(largest, index[cell]);
    });
    expect(largest < clusters, `indices below ${clusters}, found ${largest}`);
    const interpolation = trilinear ? "trilinear" : "nearest";
    return { kind: "cells", interpolation, scale: 1, lattice, lut, index };
}

/** The numbers of the cells above the horizon. */
function aboveHorizon({ thetaH, thetaD, phiD, reciprocal }) {
    const centres = (bins, angle) => Float64Array.from({ length: bins }, (_, i) => angle((i + 0.5) / bins));
    const h = centres(thetaH, (x) => x * x * (Math.PI / 2));
    const d = centres(thetaD, (x) => x * (Math.PI / 2));
    const tilt = centres(phiD, (x) => Math.abs(Math.cos(x * Math.PI * (reciprocal ? 1 : 2))));
    const numbers = new Uint32Array(thetaH * thetaD * phiD);
    let found = 0;
    for (let i = 0, cell = 0; i < thetaH; i++) {
        for (let j = 0; j < thetaD; j++) {
            const along = Math.cos(h[i]) * Math.cos(d[j]);
            const across = Math.sin(h[i]) * Math.sin(d[j]);
            for (let k = 0; k < phiD; k++, cell++) {
                if (along - across * tilt[k] > ON_HORIZON) numbers[found++] = cell;
            }
        }
    }
    return numbers.subarray(0, found);
}

/** Exactly `expected` bytes, and never many more than that in memory. */
async function inflated(compressed, expected) {
    const payload = new Uint8Array(expected);
    const found = await inflate(compressed, payload).catch(() => null);
    // The stream ends with the file if it has no end without the last byte; not all decompressors mind what follows.
    const ends = found === expected && (await inflate(compressed.subarray(0, -1), null).catch(() => null)) === null;
    expect(ends, `a stream of ${expected} bytes, deflated, that ends with the file, found another`);
    return payload;
}

async function inflate(compressed, payload) {
    const stream = new Blob([compressed]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
    const chunks = stream.getReader();
    for (let at = 0; ; ) {
        const { done, value } = await chunks.read();
        if (done) return at;
        if (payload && at + value.length > payload.length) {
            await chunks.cancel();
            return Infinity;
        }
        payload?.set(value, at);
        at += value.length;
    }
}

class Reader {
    constructor(bytes) {
        [this.bytes, this.at] = [bytes, 0];
    }

    take(count) {
        expect(this.at + count <= this.bytes.length, `${count} more bytes, found ${this.bytes.length - this.at}`);
        this.at += count;
        return this.bytes.subarray(this.at - count, this.at);
    }

    number(count) {
        return this.take(count).reduceRight((sum, byte) => 256 * sum + byte, 0);
    }

    /** null if it is none. */
    text(count) {
        const bytes = this.take(count);
        try {
            return new TextDecoder("utf-8", { fatal: true, ignoreBOM: true }).decode(bytes);
        } catch {
            return null;
        }
    }

    rest() {
        return this.bytes.subarray(this.at);
    }
}

function expect(fine, what, before = "expected ") {
    if (!fine) throw new Error(before + what);
}

/** Options and metrics. */
function readNotes(text) {
    const isObject = (value) => value !== null && typeof value === "object" && !Array.isArray(value);
    const fine = (value, deepest) => {
        if (value === null || typeof value !== "object") return typeof value !== "number" || Number.isFinite(value);
        return deepest > 0 && Object.values(value).every((inner) => fine(inner, deepest - 1));
    };
    let notes = null;
    try {
        notes = text === null ? null : JSON.parse(text || "{}");
    } catch {
        // which is told below
    }
    const { options = {}, metrics = {} } = notes ?? {};
    const found = isObject(notes) && fine(notes, DEEPEST_NOTES) && isObject(options) && isObject(metrics);
    expect(found, `notes of JSON objects, ${DEEPEST_NOTES} deep at most, with finite numbers, found others`);
    const { source_facts: facts = {}, ...own } = options;
    expect(isObject(facts), "source_facts: expected a JSON object, found another", "");
    plain("options", own);
    plain("metrics", metrics);
    plain("source_facts", facts);
    const { made_from: chain } = notes;
    const some = Array.isArray(chain) && chain.length >= 1 && chain.length <= 8;
    expect(chain === undefined || (some && chain.every(isLink)), "made_from: expected a list of 1 to 8 sources, found something else", "");
    return { options, metrics };
}

/** One of what a material was made from; the first one's SHA-256 is in the head. */
function isLink(link, at) {
    if (link === null || typeof link !== "object" || Array.isArray(link)) return false;
    const known = Object.keys(link).sort().join() === (at ? "kind,name,sha256" : "kind,name");
    if (!known || !Object.values(link).every((value) => typeof value === "string")) return false;
    const { kind, name, sha256 = "" } = link;
    return KINDS.includes(kind) && [...name].length <= 255 && /^([0-9a-f]{64})?$/.test(sha256);
}

/** Numbers, true, false, null and short texts, under short names. */
function plain(group, values) {
    const entries = Object.entries(values);
    const isNumber = (item) => typeof item === "number" && Math.abs(item) <= 1e300;
    const isPlain = (item) => item === null || typeof item === "boolean" || isNumber(item) || isText(item, 1000);
    const fine = entries.length <= 64 && entries.every(([name, item]) => isText(name, 100) && isPlain(item));
    expect(fine, `${group}: expected ${PLAIN}, found others`, "");
}

/** Whether it is a text of at most so many code points, without halves of pairs. */
function isText(value, most) {
    return typeof value === "string" && [...value].length <= most && !/\p{Surrogate}/u.test(value);
}

const CRCS = Uint32Array.from({ length: 256 }, (_, byte) => {
    for (let i = 0; i < 8; i++) byte = byte & 1 ? (byte >>> 1) ^ 0xedb88320 : byte >>> 1;
    return byte;
});

function crc32(bytes) {
    return ~bytes.reduce((crc, byte) => (crc >>> 8) ^ CRCS[(crc ^ byte) & 255], ~0) >>> 0;
}
