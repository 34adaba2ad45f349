/** Boxes around the triangles of a mesh, within each other, so that a ray meets few of them. */
import { cross, dot, minus, normalised } from "./vectors.js";

const [BINS, LARGEST_LEAF] = [12, 4];

/**
 * {boxes, triangles}: two and six fours of numbers each, as trace.glsl reads them. Boxes are in the order in which a ray goes through
 * them; a ray that misses one goes on with the box whose number it holds.
 */
export function boxed({ positions, normals, faces }) {
    const count = faces.length / 3;
    const [low, high, middle] = [0, 1, 2].map(() => new Float32Array(3 * count));
    for (let t = 0; t < count; t++) {
        for (let c = 0; c < 3; c++) {
            const corners = [0, 1, 2].map((k) => positions[3 * faces[3 * t + k] + c]);
            low[3 * t + c] = Math.min(...corners);
            high[3 * t + c] = Math.max(...corners);
            middle[3 * t + c] = (low[3 * t + c] + high[3 * t + c]) / 2;
        }
    }
    const order = Uint32Array.from({ length: count }, (_, i) => i);
    const boxes = [];
    const build = (first, last) => {
        const at = boxes.length;
        const box = around(order, first, last, low, high);
        boxes.push(...box.low, 0, ...box.high, 0);
        const middleOf = last - first <= LARGEST_LEAF ? 0 : split(order, first, last, low, high, middle);
        if (middleOf > first && middleOf < last) {
            build(first, middleOf);
            build(middleOf, last);
        } else {
            boxes[at + 7] = 16 * first + (last - first);
        }
        boxes[at + 3] = boxes.length / 8;
    };
    build(0, count);
    const triangles = new Float32Array(24 * count);
    const vertex = (list, t, k) => [0, 1, 2].map((c) => list[3 * faces[3 * t + k] + c]);
    order.forEach((t, i) => {
        const [a, b, c] = [0, 1, 2].map((k) => vertex(positions, t, k));
        const rows = [a, minus(b, a), minus(c, a), ...[0, 1, 2].map((k) => vertex(normals, t, k))];
        rows.forEach((row, r) => triangles.set(row, 24 * i + 4 * r));
    });
    return { boxes: Float32Array.from(boxes), triangles };
}

function around(order, first, last, low, high) {
    const found = empty();
    for (let i = first; i < last; i++) grow(found, low, high, 3 * order[i]);
    return found;
}

function empty() {
    return { low: [Infinity, Infinity, Infinity], high: [-Infinity, -Infinity, -Infinity] };
}

function grow(box, low, high, at) {
    for (let c = 0; c < 3; c++) {
        if (low[at + c] < box.low[c]) box.low[c] = low[at + c];
        if (high[at + c] > box.high[c]) box.high[c] = high[at + c];
    }
}

/** Sorts triangles to both sides of the plane that costs least by the surface area heuristic (Wald 2007); returns where they part. */
function split(order, first, last, low, high, middle) {
    const centres = around(order, first, last, middle, middle);
    const axis = [0, 1, 2].reduce((a, b) => (centres.high[b] - centres.low[b] > centres.high[a] - centres.low[a] ? b : a));
    const extent = centres.high[axis] - centres.low[axis];
    if (!(extent > 0)) return (first + last) >> 1;
    const bins = Array.from({ length: BINS }, () => ({ box: empty(), members: [] }));
    for (let i = first; i < last; i++) {
        const place = ((middle[3 * order[i] + axis] - centres.low[axis]) / extent) * BINS;
        const { box, members } = bins[Math.min(Math.floor(place), BINS - 1)];
        grow(box, low, high, 3 * order[i]);
        members.push(order[i]);
    }
    // What the first k bins cost, for each k.
    const costs = (sorted) => {
        const box = empty();
        let count = 0;
        return sorted.map((one) => {
            grow(box, one.box.low, one.box.high, 0);
            count += one.members.length;
            const [x, y, z] = [0, 1, 2].map((c) => box.high[c] - box.low[c]);
            return count && count * (x * y + y * z + z * x);
        });
    };
    const [before, after] = [costs(bins), costs([...bins].reverse()).reverse()];
    let best = 1;
    for (let k = 2; k < BINS; k++) if (before[k - 1] + after[k] < before[best - 1] + after[best]) best = k;
    order.set(bins.flatMap(({ members }) => members), first);
    return first + bins.slice(0, best).reduce((sum, { members }) => sum + members.length, 0);
}

/** What a ray meets first: {far, normal}, or null. */
export function met({ boxes, triangles }, origin, direction) {
    let found = null;
    const inverse = direction.map((x) => 1 / (Math.abs(x) < 1e-12 ? 1e-12 : x));
    for (let i = 0; i < boxes.length / 8; ) {
        let [enter, leave] = [0, found?.far ?? Infinity];
        for (let c = 0; c < 3; c++) {
            const [a, b] = [boxes[8 * i + c], boxes[8 * i + 4 + c]].map((x) => (x - origin[c]) * inverse[c]);
            enter = Math.max(enter, Math.min(a, b));
            leave = Math.min(leave, Math.max(a, b));
        }
        const leaf = boxes[8 * i + 7];
        if (enter <= leave) for (let k = 0; k < leaf % 16; k++) found = nearer(triangles, Math.floor(leaf / 16) + k, origin, direction, found);
        i = enter <= leave && leaf === 0 ? i + 1 : boxes[8 * i + 3];
    }
    return found;
}

function nearer(triangles, number, origin, direction, found) {
    const [corner, a, b, ...normals] = [0, 1, 2, 3, 4, 5].map((r) => [...triangles.subarray(24 * number + 4 * r, 24 * number + 4 * r + 3)]);
    const p = cross(direction, b);
    const volume = dot(a, p);
    const s = minus(origin, corner).map((x) => x / volume);
    const q = cross(s, a);
    const [u, v, far] = [dot(s, p), dot(direction, q), dot(b, q)];
    if (!(u >= 0 && v >= 0 && u + v <= 1 && far > 0 && far < (found?.far ?? Infinity))) return found;
    const normal = normalised([0, 1, 2].map((c) => (1 - u - v) * normals[0][c] + u * normals[1][c] + v * normals[2][c]));
    return { far, normal };
}
