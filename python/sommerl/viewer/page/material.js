/** Decoded materials on the GPU: their textures, and what brdf.glsl has to be told of them. */
import { FINE, cellsAbove } from "./evaluate.js";
import { list } from "./lists.js";

const COLUMNS = FINE + 1; // of the texture of axes: there may be as many rows of nodes

/** What a shader has to be told of a decoded material before brdf.glsl. */
export function defines(material) {
    const { kind, lattice = {}, signed, smooth, interpolation, jacobian } = material;
    const found = { [kind.toUpperCase()]: true, RECIPROCAL: lattice.reciprocal, MIRRORED: lattice.mirrored, SIGNED: signed };
    Object.assign(found, { SMOOTH: smooth, TRILINEAR: interpolation === "trilinear", JACOBIAN: jacobian });
    return Object.keys(found).filter((name) => found[name]).map((name) => `#define ${name}\n`).join("");
}

/** A decoded material in {textures, uniforms}, by name. Throws an Error if the textures are too large for the device. */
export function upload(device, material) {
    const { images, uniforms } = KINDS[material.kind](material);
    const made = Object.entries(images).map(([name, given]) => [name, list(device, ...given)]);
    return { textures: Object.fromEntries(made), uniforms };
}

/** The textures of the table of a sampler (sampler.js), which sampler.glsl reads. */
export function uploadSampler(device, table) {
    return { uSampler: list(device, table, 1) };
}

/** Of each kind, by name: images, of which `list` makes textures, and uniforms. */
const KINDS = {
    cells: ({ lut, index, lattice }) => ({
        images: { uValues: [lut, 3], uIndex: [Uint16Array.from(cellsAbove(lattice), (cell) => index[cell]), 1] },
        uniforms: { uBins: binsOf(lattice) },
    }),
    table: ({ values, lattice }) => ({
        images: { uValues: [values, 3] },
        uniforms: { uBins: binsOf(lattice) },
    }),
    grid: ({ values, thetas, phis }) => ({
        images: { uValues: [values, 3] },
        uniforms: { uBins: [thetas, thetas, phis] },
    }),
    nodes: (material) => ({
        images: { uValues: [valuesOfNodes(material), 4], uAxes: [axes(material.lattice), 4, COLUMNS] },
        uniforms: { uScale: material.scale },
    }),
    rgl: (material) => {
        const { thetaI, shapes, columns, ndf, sigma, atNormal } = material;
        const parts = [...[thetaI, columns, ndf, sigma].map((values) => fours(values, 1)), fours(atNormal, 3)];
        const starts = parts.map((sum => (part) => (sum += part.length / 4))(0));
        const size = (name) => [shapes[name][1], shapes[name][0]];
        const sizes = { uWarpSize: size("vndf"), uValuesSize: size("rgb"), uNdfSize: size("ndf"), uSigmaSize: size("sigma") };
        return {
            images: { uValues: [interleaved(material), 3], uWarp: [pairs(material.density, material.rows), 2], uRest: [joined(parts), 4] },
            uniforms: { ...sizes, uStarts: starts.slice(0, 4), uAngles: thetaI.length },
        };
    },
};

function binsOf({ thetaH, thetaD, phiD }) {
    return [thetaH, thetaD, phiD];
}

/** y of each node, and the numbers of its shape and gain as shape + 1024 · gain. */
function valuesOfNodes({ gains, gainIndex, lut, index }) {
    const found = new Float32Array(4 * index.length);
    for (let i = 0; i < index.length; i++) {
        for (let c = 0; c < 3; c++) found[4 * i + c] = gains[gainIndex[i]] * lut[3 * index[i] + c];
        found[4 * i + 3] = index[i] + 1024 * gainIndex[i];
    }
    return found;
}

/**
 * The axes of a lattice of nodes, COLUMNS pixels in a row of four numbers. Row 0: for each step in θ_h the numbers of the rows on
 * either side, and their places. Row 1: for each row of nodes the number of its first node, its band, and its nodes in φ_d. Then
 * for each band, as row 0, θ_d and φ_d.
 */
function axes({ thetaH, band, thetaD, phiD, mirrored }) {
    const rows = [steps(thetaH), new Float32Array(4 * COLUMNS)];
    let first = 0;
    band.forEach((b, i) => {
        rows[1].set([first, b, phiD[b].length, 0], 4 * i);
        first += thetaD[b].length * phiD[b].length;
    });
    thetaD.forEach((axis, b) => rows.push(steps(axis), around(phiD[b], mirrored)));
    return joined(rows);
}

function steps(axis) {
    const found = new Float32Array(4 * COLUMNS);
    for (let below = 0; below + 1 < axis.length; below++) {
        for (let step = axis[below]; step < axis[below + 1]; step++) found.set([below, below + 1, axis[below], axis[below + 1]], 4 * step);
    }
    return found;
}

/** φ_d turns, so that the first node follows the last; a single one counts for all. */
function around(axis, mirrored) {
    if (mirrored && axis.length > 1) return steps(axis);
    const found = steps([...axis, FINE]);
    for (let step = axis.at(-1); step < FINE; step++) found[4 * step + 1] = 0;
    return found;
}

/** Planes of colours, [n][3][…], as triples. */
function interleaved({ rgb, shapes }) {
    const size = shapes.rgb[0] * shapes.rgb[1];
    const found = new Float32Array(rgb.length);
    for (let i = 0; i < rgb.length; i++) {
        const plane = Math.floor(i / size);
        found[3 * (Math.floor(plane / 3) * size + (i % size)) + (plane % 3)] = rgb[i];
    }
    return found;
}

function pairs(one, other) {
    const found = new Float32Array(2 * one.length);
    one.forEach((value, i) => found.set([value, other[i]], 2 * i));
    return found;
}

/** Values in pixels of four numbers. */
function fours(values, channels) {
    const found = new Float32Array((4 * values.length) / channels);
    values.forEach((value, i) => (found[4 * Math.floor(i / channels) + (i % channels)] = value));
    return found;
}

function joined(parts) {
    const found = new Float32Array(parts.reduce((sum, part) => sum + part.length, 0));
    let at = 0;
    for (const part of parts) {
        found.set(part, at);
        at += part.length;
    }
    return found;
}
