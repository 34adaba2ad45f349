/** What is beside the picture: controls. */
import { chooser, labelled, make, refill, slider, switches } from "./dom.js";
import { SCENES } from "./camera.js";
import { RANGES, TONES, VIEWS, turned } from "./state.js";

const KEYS = [
    ["← → ↑ ↓", "turn the camera; with Shift, the light"],
    ["+ −", "nearer, farther"],
    ["[ ]", "darker, brighter"],
    ["V", "next way to compare"],
    ["L", "lamp or environment"],
    ["0", "the camera as at first"],
];
const degrees = (x) => `${Math.round(x)}°`;

/**
 * Builds them into an element. app: the page's, which is asked and told by its methods. Returns {update()}, which shows the state again.
 */
export function controls(root, app) {
    const { state } = app;
    const parts = [materials(app), compare(app), light(app), share(app)];
    root.append(...parts.map(({ element }) => element));
    return { update: () => parts.forEach(({ update }) => update(state)) };
}

function within(name) {
    return { min: RANGES[name][0], max: RANGES[name][1] };
}

function section(title, ...children) {
    return make("section", {}, make("h2", {}, title), ...children);
}

function materials(app) {
    const options = (none) => [...(none ? [["-1", "none"]] : []), ...app.materials.map(({ label }, i) => [String(i), label])];
    const choose = (name) => chooser(options(name === "b"), String(app.state[name]), (value) => app.change({ [name]: +value }));
    const [a, b] = [choose("a"), choose("b")];
    const versions = () => {
        const shown = app.materials[Math.max(app.state.b, app.state.a)];
        const { group } = app.materials[app.state.b] ?? shown;
        return app.materials.filter((one) => group && one.group === group);
    };
    const moved = (one) => {
        const view = app.state.view === "a" ? "split" : app.state.view;
        return { b: app.materials.indexOf(one), view };
    };
    const steps = slider({ min: 0, max: 1, step: 1, value: 0 }, (i) => versions()[i]?.step ?? "", (i) => app.change(moved(versions()[i])));
    const row = labelled("Version of B", steps.input, steps.said);
    const files = make("input", { type: "file", multiple: true, hidden: true, onchange: () => taken() });
    const taken = () => {
        app.open([...files.files]);
        files.value = ""; // so that the same file can be opened again
    };
    const opener = make("button", { type: "button", onclick: () => files.click() }, "Open files…");
    const hint = make("p", { className: "hint" }, "or drop .smrl, MERL .binary, RGL .bsdf, .mbsdf; .hdr or .exr as environment");
    const about = make("p", { className: "hint", id: "about" });
    const element = section("Materials", labelled("A", a), labelled("B", b), row, about, make("div", { className: "buttons" }, opener, files), hint);
    return {
        element,
        update(state) {
            refill(a, options(false), String(state.a));
            refill(b, options(true), String(state.b));
            const all = versions();
            row.hidden = all.length < 2;
            steps.input.max = all.length - 1;
            steps.show(Math.max(all.indexOf(app.materials[state.b]), 0));
            const shown = [state.a, state.b].filter((i) => i >= 0);
            const line = (i) => make("span", {}, make("bdi", {}, app.materials[i].label), app.store.described(i));
            about.replaceChildren(...shown.map(line));
        },
    };
}

function compare(app) {
    const { state } = app;
    const view = switches("Picture", VIEWS, state.view, (value) => app.change({ view: value }));
    const gain = slider({ min: 0, max: 5, step: 1, value: Math.log2(state.gain) }, (x) => `× ${2 ** x}`, (x) => app.change({ gain: 2 ** x }));
    const row = labelled("Difference", gain.input, gain.said);
    const figures = make("p", { id: "figures", className: "figures" });
    const element = section("Compare", view, row, figures);
    return {
        element,
        update(now) {
            for (const input of view.querySelectorAll("input")) {
                input.checked = input.value === now.view;
                input.disabled = input.value !== "a" && now.b < 0;
            }
            row.hidden = now.view !== "difference";
            gain.show(Math.log2(now.gain));
            figures.hidden = now.b < 0 || now.view === "a";
        },
    };
}

function light(app) {
    const { state } = app;
    const scene = chooser(Object.entries(SCENES).map(([name, { label }]) => [name, label]), state.scene, (value) => app.changeScene(value));
    const kind = switches("Light", [["lamp", "Lamp"], ["environment", "Environment"]], "lamp", (value) => app.changeLight(value === "environment"));
    const drag = switches("Dragging turns", [["camera", "Camera"], ["light", "Lamp"]], "camera", (value) => (app.dragsLight = value === "light"));
    const azimuth = slider({ ...within("azimuth"), step: 1, value: 0 }, degrees, (x) => app.change({ light: [x, app.state.light[1]] }));
    const elevation = slider({ ...within("light"), step: 1, value: 0 }, degrees, (x) => app.change({ light: [app.state.light[0], x] }));
    const lamp = [labelled("Azimuth", azimuth.input, azimuth.said), labelled("Elevation", elevation.input, elevation.said)];
    const say = (x) => `${x > 0 ? "+" : ""}${x.toFixed(1)} stops`;
    const stops = slider({ ...within("stops"), step: 0.1, value: state.stops }, say, (x) => app.change({ stops: x }));
    const auto = make("button", { type: "button", title: "the brightest tenth of A just below white", onclick: () => app.change({ scale: 0, stops: 0 }) }, "Auto exposure");
    const tone = chooser(TONES, state.tone, (value) => app.change({ tone: value }));
    const dragging = make("div", { className: "row" }, make("span", {}, "Dragging turns"), drag);
    const builtIn = make("button", { type: "button", onclick: () => app.light(null) }, "Built-in environment");
    const rows = [labelled("Scene", scene), make("div", { className: "row" }, make("span", {}, "Light"), kind), dragging, ...lamp];
    const element = section("Scene and light", ...rows, labelled("Exposure", stops.input, stops.said), labelled("Tone curve", tone), make("div", { className: "buttons" }, auto, builtIn));
    return {
        element,
        update(now) {
            scene.value = now.scene;
            tone.value = now.tone;
            for (const input of kind.querySelectorAll("input")) input.checked = (input.value === "environment") === now.environment;
            for (const row of lamp) row.hidden = now.environment;
            builtIn.hidden = !now.environment || !app.envmap;
            dragging.hidden = now.environment;
            azimuth.show(turned(now.light[0]));
            elevation.show(now.light[1]);
            stops.show(now.stops);
        },
    };
}

function share(app) {
    const button = (text, onclick, title) => make("button", { type: "button", onclick, title }, text);
    const text = make("textarea", { id: "command", readOnly: true, hidden: true, rows: 3, ariaLabel: "The command" });
    const show = async (what) => {
        text.value = what;
        text.hidden = false;
        text.select();
        await navigator.clipboard?.writeText(what).catch(() => null); // where it isn't allowed, the text is there, selected
    };
    const buttons = [
        button("Save PNG", () => app.save(), "the picture as it is shown"),
        button("Copy command", () => show(app.command()), "what renders this view in Mitsuba, without tone curve and stops"),
        // A frame in a notebook has no address.
        ...(location.protocol === "about:" ? [] : [button("Copy link", () => show(app.link()), "the address of this view")]),
    ];
    const keys = make("dl", { className: "keys" }, ...KEYS.flatMap(([key, what]) => [make("dt", {}, key), make("dd", {}, what)]));
    const help = make("details", {}, make("summary", {}, "Keys, on the picture"), keys);
    return { element: section("Share", make("div", { className: "buttons" }, ...buttons), text, help), update: () => null };
}
