/** What a picture depends on, and its text in the address of the page. */
import { SCENES, front } from "./camera.js";

export const VIEWS = [
    ["a", "A", "material A"],
    ["b", "B", "material B"],
    ["split", "Split", "A to the left of a line that can be dragged, B to its right"],
    ["side", "Side by side", "A and B, each in a picture of its own"],
    ["difference", "Difference", "B minus A: red where B is brighter, blue where it is darker"],
    ["flip", "FLIP", "how visible the difference is when one flips between both (Andersson et al. 2020)"],
];
export const TONES = [["linear", "Linear"], ["aces", "ACES-like"], ["agx", "AgX-like"]];

// The lowest and highest values, in the address, for keys, and for sliders.
export const RANGES = { zoom: [0.5, 8], stops: [-8, 8], gain: [1, 32], split: [0, 1], azimuth: [-180, 180], light: [-90, 90] };
const ABOVE_GROUND = 1; // degrees, the camera's least elevation in scenes with ground
const HIGHEST = 89;

/** The lowest and highest elevation [degrees] of the camera in a scene. */
export function elevations(scene) {
    return [SCENES[scene].plane ? ABOVE_GROUND : -HIGHEST, HIGHEST];
}

/** An azimuth [degrees] from -180 to 180. */
export function turned(degrees) {
    return ((((degrees + 180) % 360) + 360) % 360) - 180;
}

/** The numbers of the materials that are traced. */
export function traced({ a, b, view }) {
    return b < 0 || view === "a" ? [a] : [a, b];
}

/**
 * a, b: numbers of materials, -1 for none. azimuth, elevation, light: degrees. scale: of the radiance; stops: beside it. device: "webgl"
 * or "webgpu", what draws, or "" for the best.
 */
export const START = {
    a: 0, b: -1, view: "a", split: 0.5, gain: 8, scene: "sphere", azimuth: 0, elevation: 0, zoom: 1, light: [-35, 40], environment: false, scale: 0,
    stops: 0, tone: "linear", device: "",
};

function short(x) {
    return String(Math.round(x * 100) / 100);
}

/** What follows the # of the address. */
export function written(state) {
    const fields = {
        a: state.a, b: state.b, view: state.view, split: short(state.split), gain: state.gain, scene: state.scene,
        from: [state.azimuth, state.elevation, state.zoom].map(short).join(), light: state.environment ? "environment" : state.light.map(short).join(),
        lamp: state.light.map(short).join(), scale: state.scale.toPrecision(4), stops: short(state.stops), tone: state.tone,
        device: state.device,
    };
    if (!state.environment) delete fields.lamp;
    if (!state.scale) delete fields.scale; // automatic
    if (!state.device) delete fields.device;
    return new URLSearchParams(fields).toString().replaceAll("%2C", ",");
}

/** The state that such a text stands for; what is missing or out of range is as at the start. count: of materials. */
export function read(text, count) {
    const fields = new URLSearchParams(text);
    const state = { ...START, light: [...START.light] };
    const number = (value, low, high, otherwise) => {
        const found = value === null || value === undefined || value === "" ? NaN : Number(value);
        return found >= low && found <= high ? found : otherwise;
    };
    const one = (name, allowed) => (allowed.includes(fields.get(name)) ? fields.get(name) : state[name]);
    state.a = Math.floor(number(fields.get("a"), 0, Math.max(count - 1, 0), 0));
    state.b = Math.floor(number(fields.get("b"), -1, count - 1, count > 1 ? 1 : -1));
    const within = (name, value, otherwise = state[name]) => number(value, ...RANGES[name], otherwise);
    state.view = one("view", VIEWS.map(([name]) => name));
    if (!fields.has("view")) state.view = "split"; // if there are two
    if (state.b < 0) state.view = "a";
    for (const name of ["split", "gain", "stops"]) state[name] = within(name, fields.get(name));
    state.gain = 2 ** Math.round(Math.log2(state.gain));
    state.scene = one("scene", Object.keys(SCENES));
    const from = (fields.get("from") ?? "").split(",");
    const usual = front(SCENES[state.scene]);
    state.azimuth = within("azimuth", from[0], usual.azimuth);
    state.elevation = number(from[1], ...elevations(state.scene), usual.elevation);
    state.zoom = within("zoom", from[2]);
    state.environment = fields.get("light") === "environment";
    const light = (fields.get("lamp") ?? fields.get("light") ?? "").split(",");
    state.light = [within("azimuth", light[0], START.light[0]), within("light", light[1], START.light[1])];
    state.scale = number(fields.get("scale"), 1e-9, 1e9, 0);
    state.tone = one("tone", TONES.map(([name]) => name));
    state.device = one("device", ["webgl", "webgpu"]);
    return state;
}

/**
 * The command that renders what the page shows. names: of the files that are in the picture, A's first. envmap: of the file of the
 * environment, "" for the built-in one.
 */
export function command(state, names, size, envmap = "") {
    const dashed = (text) => (text.startsWith("-") ? `./${text}` : text); // or it would be an option
    const quoted = (text) => (/^[\w./:-]+$/.test(text) ? dashed(text) : `'${dashed(text).replaceAll("'", "'\\''")}'`);
    const shown = state.view === "b" ? names.at(-1) : names[0];
    const both = names.length > 1 && state.view !== "b";
    const words = ["sommerl render", quoted(both ? names[1] : shown), ...(both ? ["--against", quoted(names[0])] : []), "--scene", state.scene];
    words.push(`--from=${[state.azimuth, state.elevation, state.zoom].map(short).join()}`);
    if (!state.environment) words.push(`--light=${state.light.map(short).join()}`);
    else if (envmap) words.push("--envmap", quoted(envmap));
    return [...words, "--size", size, "-o view.png"].join(" ");
}
