/** Where a scene is looked at from, and what is seen there: the scenes of `sommerl render` that hold one material. */
import { met } from "./boxes.js";
import { DEGREE, combined, cross, dot, minus, normalised } from "./vectors.js";

const STANDING = { eye: [0, 0.95, 3.4], target: [0, 0.49, 0], tangent: Math.tan(9.75 * DEGREE), mesh: true, plane: true };

/** Eye, target, the tangent of half the field of view; whether it is a mesh, on the grey ground, and alone: nothing reflects anything else. */
export const SCENES = {
    sphere: { label: "Sphere", eye: [0, 0, 5], target: [0, 0, 0], tangent: Math.tan(Math.asin(1 / 5)) / 0.9, alone: true },
    ball: { label: "Material ball", ...STANDING },
    statue: { label: "Carved figure", ...STANDING },
    sample: { label: "Flat sample", eye: [0, 2.2, 2.2], target: [0, 0, 0], tangent: Math.tan(12 * DEGREE), mesh: true, alone: true },
};

/** The azimuth and elevation [degrees] that a scene is seen from at first. */
export function front({ eye, target }) {
    const [x, y, z] = minus(eye, target);
    return { azimuth: Math.atan2(x, z) / DEGREE, elevation: Math.atan2(y, Math.hypot(x, z)) / DEGREE };
}

/** The unit vector towards an azimuth and an elevation [degrees]: azimuth 0 is +z, 90 is +x; y is up. */
export function towards(azimuth, elevation) {
    const [a, e] = [azimuth * DEGREE, elevation * DEGREE];
    return [Math.sin(a) * Math.cos(e), Math.sin(e), Math.cos(a) * Math.cos(e)];
}

/** {eye, right, up, back}: where a scene is looked at from. view: {scene, azimuth, elevation, zoom}. */
export function camera({ scene, azimuth, elevation, zoom }) {
    const { eye, target } = SCENES[scene];
    const back = towards(azimuth, elevation);
    const far = Math.hypot(...minus(eye, target)) / zoom;
    const right = normalised(cross([0, 1, 0], back));
    return { eye: target.map((x, c) => x + far * back[c]), right, up: cross(back, right), back };
}

/** The direction of the ray through a place of the picture: x and y from -1 to 1 on the square in its middle. */
export function rayThrough(view, x, y) {
    const { right, up, back } = camera(view);
    const t = SCENES[view.scene].tangent;
    return normalised(combined([x * t, y * t, -1], [right, up, back]));
}

/** Directions to the lamp and to the viewer in the frame of the surface at a place of the picture, or null where no material is. */
export function surfaceAt(view, mesh, x, y) {
    const direction = rayThrough(view, x, y);
    const { eye } = camera(view);
    const hit = SCENES[view.scene].mesh ? mesh && met(mesh, eye, direction) : onSphere(eye, direction);
    if (!hit) return null;
    const { plane } = SCENES[view.scene];
    const ground = plane && direction[1] < 0 ? -eye[1] / direction[1] : Infinity;
    if (ground < hit.far) return null;
    const axis = Math.abs(hit.normal[1]) < 0.999 ? [0, 1, 0] : [1, 0, 0];
    const tangent = normalised(cross(axis, hit.normal));
    const frame = [tangent, cross(hit.normal, tangent), hit.normal];
    const local = (v) => frame.map((row) => dot(row, v));
    return { wi: local(towards(view.light[0], view.light[1])), wo: local(direction.map((c) => -c)) };
}

function onSphere(origin, direction) {
    const along = dot(origin, direction);
    const square = 1 - (dot(origin, origin) - along * along);
    if (!(square > 0)) return null;
    const far = -along - Math.sqrt(square);
    return { far, normal: normalised(origin.map((x, c) => x + far * direction[c])) };
}
