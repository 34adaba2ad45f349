/** Vectors of three numbers. */

/** One degree [rad]. */
export const DEGREE = Math.PI / 180;

export function minus(a, b) {
    return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

export function cross(a, b) {
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

export function dot(a, b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

export function normalised(a) {
    const length = Math.hypot(...a);
    return a.map((x) => x / length);
}

/** sum of a multiple of each axis. */
export function combined(factors, axes) {
    return [0, 1, 2].map((c) => factors.reduce((sum, x, k) => sum + x * axes[k][c], 0));
}

export function clamp(x, low, high) {
    return Math.min(Math.max(x, low), high);
}
