/** Objects of triangles, made by the formulas of Sommerl's render/meshes.py, so that no mesh has to be in the page. */
import { clamp, cross, minus } from "./vectors.js";

/** A pine cone on a turned foot, with a ball on top: the scene `statue`. */
export function finial() {
    const foot = [[0, 0], [0.27, 0], [0.27, 0], [0.27, 0.06], [0.27, 0.06], [0.235, 0.075], [0.25, 0.11], [0.2, 0.125]];
    const stem = [[0.115, 0.15], [0.085, 0.21], [0.085, 0.21], [0.15, 0.235], [0.15, 0.26], [0.1, 0.275], [0.1, 0.29]];
    const body = [[0.27, 0.31], [0.3, 0.5], [0.2, 0.71], [0.08, 0.79], [0.05, 0.81], [0.05, 0.81]];
    const ball = Array.from({ length: 16 }, (_, i) => ((i + 3) * Math.PI) / 18).map((a) => [0.1 * Math.sin(a), 0.9 - 0.1 * Math.cos(a)]);
    const clip = (x) => clamp(x, 0, 1);
    const scales = (y, phi) => {
        const v = clip((y - 0.3) / 0.47);
        const ridges = [[8, 1], [13, -1]].map(([n, sign]) => Math.cos((n * phi) / 2 + sign * 15 * v) ** 2 + 0.01);
        return 0.035 * clip(8 * v) * clip(5 * (1 - v)) * (ridges[0] * ridges[1]) ** 0.3;
    };
    return lathe([...foot, ...stem, ...body, ...ball], 160, 110, scales);
}

/** A surface of revolution about the y axis: {positions, normals, faces}, standing on y = 0 and 1 along its longest side. */
export function lathe(outline, rows, columns, relief = () => 0) {
    const curve = resampled(rounded(outline), rows + 1);
    const positions = [0, curve[0][1], 0];
    for (let i = 1; i < rows; i++) {
        const [x, y] = [curve[i + 1][0] - curve[i - 1][0], curve[i + 1][1] - curve[i - 1][1]];
        const length = Math.hypot(x, y);
        for (let k = 0; k < columns; k++) {
            const phi = (k / columns) * 2 * Math.PI;
            const out = relief(curve[i][1], phi);
            const [r, h] = [curve[i][0] + (out * y) / length, curve[i][1] - (out * x) / length];
            positions.push(r * Math.cos(phi), h, -r * Math.sin(phi));
        }
    }
    positions.push(0, curve[rows][1], 0);
    const faces = [];
    const number = (i, k) => 1 + i * columns + (k % columns);
    const top = 1 + (rows - 1) * columns;
    for (let k = 0; k < columns; k++) {
        faces.push(0, number(0, k + 1), number(0, k), number(rows - 2, k), number(rows - 2, k + 1), top);
        for (let i = 0; i + 2 < rows; i++) {
            faces.push(number(i, k), number(i, k + 1), number(i + 1, k + 1), number(i, k), number(i + 1, k + 1), number(i + 1, k));
        }
    }
    return standing({ positions, faces });
}

/** A ball with a groove on a foot: the scene `ball`. */
export function ball() {
    const foot = [[0, 0], [0.3, 0], [0.3, 0], [0.3, 0.035], [0.3, 0.035], [0.2, 0.06], [0.12, 0.1], [0.12, 0.14]];
    const circle = (r, degrees) => degrees.map((a) => (a * Math.PI) / 180).map((a) => [r * Math.sin(a), 0.58 - r * Math.cos(a)]);
    const above = [78, 78, ...Array.from({ length: 10 }, (_, i) => 90 + 10 * i)];
    return lathe([...foot, ...circle(0.42, [20, 30, 40, 50, 60, 68, 68]), ...circle(0.36, [69, 73, 77]), ...circle(0.42, above)], 140, 110);
}

/** A square, 1 wide, that lies in the plane y = 0: the scene `sample`. */
export function square() {
    return withNormals({ positions: [-0.5, 0, -0.5, -0.5, 0, 0.5, 0.5, 0, 0.5, 0.5, 0, -0.5], faces: [0, 1, 2, 0, 2, 3] });
}

/** Smooths a polygon by cutting its corners repeatedly (Chaikin 1974); its ends stay. */
function rounded(points) {
    for (let times = 0; times < 5; times++) {
        const cut = points.slice(1).flatMap((b, i) => [0.75, 0.25].map((t) => [0, 1].map((c) => t * points[i][c] + (1 - t) * b[c])));
        points = [points[0], ...cut.slice(1, -1), points.at(-1)];
    }
    return points;
}

/** Points at equal distances along a polygon. */
function resampled(points, count) {
    const lengths = [0];
    for (let i = 1; i < points.length; i++) {
        lengths.push(lengths[i - 1] + Math.hypot(points[i][0] - points[i - 1][0], points[i][1] - points[i - 1][1]));
    }
    let below = 0;
    return Array.from({ length: count }, (_, i) => {
        const at = (lengths.at(-1) * i) / (count - 1);
        while (below + 2 < points.length && lengths[below + 1] <= at) below++;
        const t = (at - lengths[below]) / (lengths[below + 1] - lengths[below]);
        return [0, 1].map((c) => points[below][c] + t * (points[below + 1][c] - points[below][c]));
    });
}

function standing({ positions, faces }) {
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    positions.forEach((x, i) => {
        low[i % 3] = Math.min(low[i % 3], x);
        high[i % 3] = Math.max(high[i % 3], x);
    });
    const foot = [(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2];
    const size = Math.max(...high.map((x, i) => x - low[i]));
    return withNormals({ positions: positions.map((x, i) => (x - foot[i % 3]) / size), faces });
}

/** Normals of vertices: those of their faces, weighted by area. */
function withNormals({ positions, faces }) {
    const normals = new Float64Array(positions.length);
    for (let i = 0; i < faces.length; i += 3) {
        const [a, b, c] = [0, 1, 2].map((k) => positions.slice(3 * faces[i + k], 3 * faces[i + k] + 3));
        const face = cross(minus(b, a), minus(c, a));
        for (let k = 0; k < 3; k++) face.forEach((x, j) => (normals[3 * faces[i + k] + j] += x));
    }
    for (let i = 0; i < normals.length; i += 3) {
        const length = Math.hypot(normals[i], normals[i + 1], normals[i + 2]) || 1;
        for (let j = 0; j < 3; j++) normals[i + j] /= length;
    }
    return { positions, normals, faces };
}
