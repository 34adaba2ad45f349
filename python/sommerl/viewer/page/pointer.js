/** What is under the pointer. */
import { surfaceAt } from "./camera.js";
import { inDegrees, reflectance, rich } from "./draw.js";
import { cellAt, evaluate } from "./evaluate.js";

/**
 * Which material is at a place of the canvas (x, y from 0 to 1), 0 for A and 1 for B, and its directions there: {which, wi, wo}, or
 * null where there is none. width, height: of the canvas.
 */
export function pointed(state, mesh, x, y, width, height) {
    const halves = state.view === "side" ? 2 : 1;
    const right = state.view === "side" ? x >= 0.5 : state.view === "split" ? x >= state.split : state.view === "b";
    const short = Math.min(width / halves, height) / 2;
    const across = ((((x * halves) % 1) - 0.5) * width) / halves;
    const found = surfaceAt(state, mesh, across / short, ((0.5 - y) * height) / short);
    return found && { which: right ? 1 : 0, ...found };
}

/** Angles and f_r there, as elements say them. */
export function numbersOf(material, { wi, wo }) {
    const { thetaH, thetaD } = cellAt(material, wi, wo);
    const elevation = (w) => Math.atan2(Math.hypot(w[0], w[1]), w[2]);
    const angles = { θ_i: elevation(wi), θ_o: elevation(wo), θ_h: thetaH, θ_d: thetaD };
    const said = Object.entries(angles).map(([name, angle]) => `${name} ${inDegrees(angle)}`).join(", ");
    return rich(`${said}; ${wi[2] > 0 ? `f_r ${reflectance(evaluate(material, wi, wo))}` : "the lamp is below the horizon"}`);
}
