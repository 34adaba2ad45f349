/**
 * f_r of decoded materials of every kind, on the processor: for plots, samplers, and the numbers under the pointer.
 *
 * docs/conventions.md and docs/format.md say what is calculated; brdf.glsl does the same for pictures.
 */
import { SMALLEST_COSINE, evaluateRgl } from "./rgl.js";

export const FINE = 180; // steps of each axis of a lattice of nodes
const [KNEE, BELOW, ABOVE] = [90, 360, 120]; // steps of √(θ_h / 90°) are 1/BELOW up to number KNEE, 1/ABOVE from there
const HORIZON = 0.0009;
export const ON_HORIZON = 1e-12; // cosines up to here are not above the horizon
export const HALF_PI = Math.PI / 2;

/** Rusinkiewicz's angles [rad] of two unit vectors: [θ_h, θ_d, φ_d], φ_d folded as a lattice has it. */
export function halfDiff(wi, wo, { reciprocal, mirrored = false }) {
    const [sx, sy, sz] = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
    const [vx, vy, vz] = [wi[0] - wo[0], wi[1] - wo[1], wi[2] - wo[2]];
    const s = Math.sqrt(sx * sx + sy * sy + sz * sz);
    let x = 0 - vz * s;
    let y = vy * sx - vx * sy + 0;
    if (mirrored) {
        y = Math.abs(y);
        x = reciprocal ? Math.abs(x) : x;
    } else if (reciprocal && (y < 0 || (y === 0 && x < 0))) {
        [x, y] = [0 - x, 0 - y];
    }
    const turn = Math.atan2(y, x);
    const thetaD = Math.atan2(Math.sqrt(vx * vx + vy * vy + vz * vz), s);
    return [Math.atan2(Math.sqrt(sx * sx + sy * sy), sz), thetaD, turn < 0 ? turn + 2 * Math.PI : turn];
}

/** The range of φ_d [rad] that a lattice's folds leave. */
export function range({ reciprocal, mirrored = false }) {
    return (2 * Math.PI) / (reciprocal ? 2 : 1) / (mirrored ? 2 : 1);
}

/**
 * Which cells or nodes of a decoded material count at a pair of directions: [{ at, weight }], `at` being a number. Weights
 * add up to 1. Of kinds that have neither, none.
 */
export function places(material, wi, wo) {
    const { kind, lattice, interpolation } = material;
    if (!lattice) return [];
    const angles = halfDiff(wi, wo, lattice);
    if (kind === "nodes") return nodesAbout(lattice, ...onFineGrid(angles, lattice));
    const position = inBins(angles, lattice);
    if (interpolation === "trilinear") return cellsAbout(position, lattice);
    return [{ at: cellAbove(nearest(position, lattice), lattice), weight: 1 }];
}

/** f_r [1/sr], linear RGB; 0 unless both directions are above the horizon. */
export function evaluate(material, wi, wo) {
    if (!(wi[2] > 0 && wo[2] > 0)) return [0, 0, 0];
    const { kind } = material;
    if (kind === "rgl") return evaluateRgl(material, wi, wo);
    if (kind === "grid") return evaluateGrid(material, wi, wo);
    const sum = [0, 0, 0];
    const values = kind === "table" ? material.values : material.lut;
    for (const { at, weight } of places(material, wi, wo)) {
        const gain = kind === "nodes" ? material.gains[material.gainIndex[at]] * weight : weight;
        const first = 3 * (kind === "table" ? at : material.index[at]);
        for (let c = 0; c < 3; c++) sum[c] += gain * values[first + c];
    }
    if (kind !== "nodes") return sum;
    const factor = material.scale / damped(wi[2], wo[2], material.smooth);
    return sum.map((y) => (material.signed ? y : Math.max(0, y)) ** 3 * factor);
}

/**
 * The palette's entries behind a pair of directions: of cells, that of the nearest one, and -1; of nodes, shape and gain of
 * the one with the largest weight; else [-1, -1].
 */
export function entriesAt(material, wi, wo) {
    const { kind, lattice, index, gainIndex } = material;
    if (kind === "cells") return [index[cellAbove(nearest(inBins(halfDiff(wi, wo, lattice), lattice), lattice), lattice)], -1];
    if (kind !== "nodes") return [-1, -1];
    const { at } = places(material, wi, wo).reduce((best, place) => (place.weight > best.weight ? place : best));
    return [index[at], gainIndex[at]];
}

/** Half/difference angles [rad], and of cells the numbers of the bins that they are in, else null. */
export function cellAt(material, wi, wo) {
    const lattice = material.lattice ?? { reciprocal: false, mirrored: material.kind === "grid" };
    const angles = halfDiff(wi, wo, lattice);
    const [thetaH, thetaD, phiD] = angles;
    const cells = material.kind === "cells" || material.kind === "table";
    return { thetaH, thetaD, phiD, bins: cells ? nearest(inBins(angles, lattice), lattice) : null };
}

function damped(cosI, cosO, smooth) {
    if (smooth) return Math.sqrt((cosI * cosI + HORIZON) * (cosO * cosO + HORIZON));
    return Math.max(cosI, SMALLEST_COSINE) * Math.max(cosO, SMALLEST_COSINE);
}

/** Places on the fine grid of a lattice of nodes. */
function onFineGrid([thetaH, thetaD, phiD], lattice) {
    const a = Math.sqrt(thetaH / HALF_PI);
    const x = a < KNEE / BELOW ? a * BELOW : KNEE + (a - KNEE / BELOW) * ABOVE;
    const z = (phiD * FINE) / range(lattice);
    return [x, (thetaD * FINE) / HALF_PI, !lattice.mirrored && z >= FINE ? z - FINE : z];
}

/** An axis of nodes, and for each step of the fine grid the number of the node below. */
function withSteps(axis) {
    const below = new Uint8Array(FINE);
    axis.forEach((place, i) => i + 1 < axis.length && below.fill(i, place));
    return { axis, below };
}

/** The numbers of the nodes on either side of a place: the first one's, and the share of the second. */
function between({ axis, below }, place) {
    const i = below[Math.min(Math.max(Math.floor(place), 0), FINE - 1)];
    return [i, Math.min(Math.max((place - axis[i]) / (axis[i + 1] - axis[i]), 0), 1)];
}

function nodesAbout(lattice, x, y, z) {
    const { firsts, thetaH, thetaD, phiD } = remembered(axesOf, lattice);
    const [row, t] = between(thetaH, x);
    const found = [];
    for (const [r, ofRow] of [[row, 1 - t], [row + 1, t]]) {
        const b = lattice.band[r];
        const width = lattice.phiD[b].length;
        const [d, u] = between(thetaD[b], y);
        const [p, v] = width === 1 ? [0, 0] : between(phiD[b], z); // a single one counts for all
        for (const [i, ofTheta] of [[d, 1 - u], [d + 1, u]]) {
            for (const [j, ofPhi] of [[p, 1 - v], [(p + 1) % width, v]]) {
                found.push({ at: firsts[r] + i * width + j, weight: ofRow * ofTheta * ofPhi });
            }
        }
    }
    return found;
}

/** The number of the first node of each row, and the axes. φ_d turns unless mirrored: the first node follows the last. */
function axesOf({ thetaH, band, thetaD, phiD, mirrored }) {
    const firsts = [0];
    for (const b of band) firsts.push(firsts.at(-1) + thetaD[b].length * phiD[b].length);
    const around = phiD.map((axis) => withSteps(mirrored ? axis : [...axis, FINE]));
    return { firsts, thetaH: withSteps(thetaH), thetaD: thetaD.map(withSteps), phiD: around };
}

const memory = new Map();

/** make(lattice), made once for each. */
function remembered(make, lattice) {
    if (!memory.has(make)) memory.set(make, new WeakMap());
    const known = memory.get(make);
    if (!known.has(lattice)) known.set(lattice, make(lattice));
    return known.get(lattice);
}

/** Numbers of bins of cells, as far as they go: bin i covers [i, i + 1). */
function inBins([thetaH, thetaD, phiD], lattice) {
    const u = Math.sqrt(thetaH / HALF_PI) * lattice.thetaH;
    return [u, (thetaD * lattice.thetaD) / HALF_PI, (phiD * lattice.phiD) / range(lattice)];
}

function bin(position, bins) {
    return Math.min(Math.max(Math.floor(position), 0), bins - 1);
}

function nearest([u, v, w], lattice) {
    return [bin(u, lattice.thetaH), bin(v, lattice.thetaD), bin(w, lattice.phiD)];
}

/** Of `bins` centres of bins, the two about a position, clamped at the ends: their numbers, and the share of the second. */
function clamped(position, bins) {
    const x = Math.min(Math.max(position - 0.5, 0), bins - 1);
    const lower = Math.min(Math.floor(x), Math.max(bins - 2, 0));
    return [[lower, 1 - x + lower], [Math.min(lower + 1, bins - 1), x - lower]];
}

/** The eight cells whose centres are about a place: φ_d wraps, θ_h and θ_d clamp. */
function cellsAbout([u, v, w], lattice) {
    const below = Math.floor(w - 0.5);
    const k = bin(below < 0 ? below + lattice.phiD : below, lattice.phiD);
    const c = w - 0.5 - below;
    const found = [];
    for (const [i, p] of clamped(u, lattice.thetaH)) {
        for (const [j, q] of clamped(v, lattice.thetaD)) {
            for (const [m, r] of [[k, 1 - c], [(k + 1) % lattice.phiD, c]]) {
                found.push({ at: cellAbove([i, j, m], lattice), weight: p * q * r });
            }
        }
    }
    return found;
}

/** The number of a cell; of one below the horizon, that of the last one above it in θ_d, or else in θ_h. */
export function cellAbove([i, j, k], lattice) {
    return cellsAbove(lattice)[k + lattice.phiD * (j + lattice.thetaD * i)];
}

/** `cellAbove` of every cell, by its number. */
export function cellsAbove(lattice) {
    return remembered(lookedUp, lattice);
}

function lookedUp(lattice) {
    const { thetaH, thetaD, phiD } = lattice;
    const h = Float64Array.from({ length: thetaH }, (_, i) => ((i + 0.5) / thetaH) ** 2 * HALF_PI);
    const d = Float64Array.from({ length: thetaD }, (_, j) => ((j + 0.5) / thetaD) * HALF_PI);
    const tilt = Float64Array.from({ length: phiD }, (_, k) => Math.abs(Math.cos(((k + 0.5) / phiD) * range(lattice))));
    const found = new Uint32Array(thetaH * thetaD * phiD);
    const last = new Uint32Array(phiD); // of those above, so far
    for (let i = 0, cell = 0; i < thetaH; i++) {
        for (let j = 0; j < thetaD; j++) {
            const along = Math.cos(h[i]) * Math.cos(d[j]);
            const across = Math.sin(h[i]) * Math.sin(d[j]);
            for (let k = 0; k < phiD; k++, cell++) {
                if (along - across * tilt[k] > ON_HORIZON) last[k] = cell;
                found[cell] = last[k];
            }
        }
    }
    return found;
}

/**
 * A grid over polar angles of light and viewer and the azimuth between them, whose values belong to the centres of its bins;
 * linear between them.
 */
function evaluateGrid({ thetas, phis, values }, wi, wo) {
    const elevation = (w) => clamped((Math.atan2(Math.hypot(w[0], w[1]), w[2]) * thetas) / HALF_PI, thetas);
    const turn = Math.atan2(Math.abs(wi[0] * wo[1] - wi[1] * wo[0]), wi[0] * wo[0] + wi[1] * wo[1]);
    const sum = [0, 0, 0];
    for (const [i, p] of elevation(wi)) {
        for (const [j, q] of elevation(wo)) {
            for (const [k, r] of clamped((turn * phis) / Math.PI, phis)) {
                const at = 3 * (k + phis * (j + thetas * i));
                for (let c = 0; c < 3; c++) sum[c] += p * q * r * values[at + c];
            }
        }
    }
    return sum;
}
