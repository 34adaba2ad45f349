/** What lies on the picture: the lamp, the line between A and B, and what both are called. */
import { make } from "./dom.js";
import { ARROWS, draggable } from "./hand.js";
import { DEGREE, clamp, combined, dot } from "./vectors.js";
import { camera, towards } from "./camera.js";

const AWAY = 0.96; // of the lamp from the middle, as a share of half the picture
const RIM = 1.05; // farther out, the lamp is behind the object

export class Handles {
    /** change(values), turnLight(dx, dy): of the app. */
    constructor(stage, canvas, state, change, turnLight) {
        Object.assign(this, { canvas, state });
        const button = (id, ariaLabel) => make("button", { type: "button", id, ariaLabel });
        this.lamp = button("lamp", "The lamp: drag it, or use the arrow keys");
        this.line = button("line", "The line between A and B");
        for (const [name, value] of [["role", "slider"], ["aria-valuemin", 0], ["aria-valuemax", 100]]) this.line.setAttribute(name, value);
        this.tags = [0, 1].map(() => make("span", { className: "tag" }));
        stage.append(this.lamp, this.line, ...this.tags);
        const split = (x) => change({ split: clamp(x, 0, 1) });
        draggable(this.lamp, canvas, (x, y) => change({ light: this.lampAt(x, y) }), turnLight);
        draggable(this.line, canvas, split, (step) => split(this.state.split + step / 100));
    }

    get radius() {
        return (Math.min(this.canvas.clientWidth, this.canvas.clientHeight) / 2) * AWAY;
    }

    /** The lamp's azimuth and elevation [degrees] where it is dragged to: on the sphere around the object, its nearer half. */
    lampAt(x, y) {
        const { canvas, radius } = this;
        const place = [((x - 0.5) * canvas.clientWidth) / radius, ((0.5 - y) * canvas.clientHeight) / radius];
        const length = Math.hypot(...place);
        const [u, v] = place.map((c) => c / Math.max(length, 1));
        const w = length > RIM ? -Math.min(length - RIM, 1) : Math.sqrt(Math.max(1 - u * u - v * v, 0));
        const { right, up, back } = camera(this.state);
        const light = combined([u, v, w], [right, up, back]);
        return [Math.atan2(light[0], light[2]) / DEGREE, Math.atan2(light[1], Math.hypot(light[0], light[2])) / DEGREE];
    }

    /** Puts all where it belongs. labels: of A and of B. marked: whether pixels are marked, for the lamp's direction. */
    show(labels, marked) {
        const { state, canvas, lamp, line, tags, radius } = this;
        const { right, up, back } = camera(state);
        const light = towards(...state.light);
        lamp.hidden = (state.environment && !marked) || state.view === "side";
        const [azimuth, elevation] = state.light.map(Math.round);
        lamp.ariaLabel = `The lamp, at azimuth ${azimuth}° and elevation ${elevation}°: drag it, or use the arrow keys`;
        lamp.style.left = `${canvas.clientWidth / 2 + radius * dot(light, right)}px`;
        lamp.style.top = `${canvas.clientHeight / 2 - radius * dot(light, up)}px`;
        lamp.classList.toggle("behind", dot(light, back) < 0);
        line.hidden = state.view !== "split";
        line.style.left = `${100 * state.split}%`;
        line.setAttribute("aria-valuenow", Math.round(100 * state.split));
        tags.forEach((tag, i) => {
            tag.hidden = state.view !== "split" && state.view !== "side";
            tag.textContent = `${"AB"[i]}: ${labels[i] ?? ""}`;
        });
    }
}
