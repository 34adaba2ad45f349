/** The page: its state, and who is told when it changes. */
import { Background } from "./background.js";
import { SCENES, front, surfaceAt, towards } from "./camera.js";
import { controls } from "./controls.js";
import { opened } from "./device.js";
import { make } from "./dom.js";
import { listen } from "./hand.js";
import { Handles } from "./handles.js";
import { hooks } from "./hooks.js";
import { LARGEST_FILE } from "./limits.js";
import { Loop } from "./loop.js";
import { Panels } from "./panels.js";
import { Picture } from "./picture.js";
import { numbersOf, pointed } from "./pointer.js";
import { SHADERS } from "./shaders.js";
import { RANGES, VIEWS, command, elevations, read, traced, turned, written } from "./state.js";
import { Store } from "./store.js";
import { clamp } from "./vectors.js";

const WRITTEN_AFTER = 250; // ms without a change, the address

class App {
    constructor(list, state, background, device) {
        Object.assign(this, { state, background });
        this.dragsLight = false;
        this.envmap = ""; // the file of the environment, if it is not the built-in one
        this.place = [null, null]; // of the pointer
        this.open = (files) => this.openAll(files);
        this.canvas = element("picture");
        this.picture = new Picture(this.canvas, device);
        const arrived = () => this.arrived();
        const failed = (number, message) => this.failed(number, message);
        this.store = new Store(list, this.background, this.picture.renderer, { arrived, failed });
        this.controls = controls(element("controls"), this);
        this.panels = new Panels(element("panels"), { highlight: (entry) => this.highlight(entry) });
        this.listen();
        this.loop = new Loop(this.canvas, this.picture, this.store, this.state, {
            said: (words) => (element("says").textContent = words),
            compared: (figures) => this.compared(figures),
            exposed: () => this.write(),
            saved: (blob) => download(blob, "view.png"),
            failed: (message) => this.complain(message),
        });
        this.change({});
    }

    get materials() {
        return this.store.list;
    }

    get first() {
        return this.loop.first;
    }

    listen() {
        const turn = (dx, dy) => this.turn(dx, dy);
        const light = (dx, dy) => this.turnLight(dx, dy);
        const point = (x, y) => this.point(x, y);
        const calls = { turn, light, point, zoom: (factor) => this.zoom(factor), key: (name) => this.key(name) };
        listen(this.canvas, calls, () => this.dragsLight && !this.state.environment);
        this.handles = new Handles(element("stage"), this.canvas, this.state, (values) => this.change(values), light);
        new ResizeObserver(() => this.change({})).observe(this.canvas);
        matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.panels.redraw());
        addEventListener("hashchange", () => this.change(read(location.hash.slice(1), this.materials.length)));
        this.picture.device.lost.then(() => this.lost());
        for (const name of ["dragover", "drop"]) {
            document.addEventListener(name, (event) => {
                event.preventDefault();
                if (name === "drop") this.open([...event.dataTransfer.files]);
            });
        }
    }

    /** Takes new values into the state, and tells all who show it. */
    change(values) {
        const { state } = this;
        const before = { ...state };
        Object.assign(state, values);
        if (state.b < 0) state.view = "a";
        if (state.a !== before.a && !("scale" in values)) state.scale = 0;
        for (const which of ["a", "b"]) if (state[which] !== before[which]) this.store.retry(state[which]);
        this.loop.update(before);
        this.tell();
        clearTimeout(this.writing);
        this.writing = setTimeout(() => this.write(), WRITTEN_AFTER);
    }

    tell() {
        this.controls.update();
        this.handles.show([this.state.a, this.state.b].map((number) => this.materials[number]?.label), this.loop.entry !== null);
        this.explain();
        this.point(...this.place);
    }

    changeScene(scene) {
        this.change({ scene, ...front(SCENES[scene]), zoom: 1, scale: 0 });
    }

    changeLight(environment) {
        this.change({ environment, scale: 0 });
    }

    turn(dx, dy) {
        const { scene, azimuth, elevation } = this.state;
        this.change({ azimuth: turned(azimuth - dx), elevation: clamp(elevation + dy, ...elevations(scene)) });
    }

    turnLight(dx, dy) {
        const [azimuth, elevation] = this.state.light;
        this.change({ light: [turned(azimuth + dx), clamp(elevation - dy, ...RANGES.light)] });
    }

    zoom(factor) {
        this.change({ zoom: clamp(this.state.zoom * factor, ...RANGES.zoom) });
    }

    /** Does what a key stands for; returns whether it stands for anything. */
    key(name) {
        const { state } = this;
        const next = (VIEWS.findIndex(([one]) => one === state.view) + 1) % VIEWS.length;
        const brighter = (stops) => this.change({ stops: clamp(state.stops + stops, ...RANGES.stops) });
        const keys = {
            "+": () => this.zoom(1.1),
            "-": () => this.zoom(1 / 1.1),
            "[": () => brighter(-0.25),
            "]": () => brighter(0.25),
            v: () => state.b >= 0 && this.change({ view: VIEWS[next][0] }),
            l: () => this.changeLight(!state.environment),
            0: () => this.change({ ...front(SCENES[state.scene]), zoom: 1 }),
        };
        const found = keys[name === "=" ? "+" : name.toLowerCase()];
        found?.();
        return Boolean(found);
    }

    /** Something is there that a picture needs. */
    arrived() {
        this.loop.restart();
        this.tell();
    }

    /** Something could not be made: the materials that could are shown again. */
    failed(number, message) {
        this.complain(number === null ? message : `${this.materials[number].label}: ${message}`);
        if (number === this.state.b) this.change({ b: -1 });
        const last = this.loop.drawn?.[0];
        if (number === this.state.a && last !== undefined && last !== number) this.change({ a: last });
    }

    /** Says how far A and B are apart; null: not known yet. */
    compared(figures) {
        this.figures = figures;
        const said = element("figures");
        if (!figures) {
            said.textContent = "";
            return;
        }
        const level = (x) => (x === Infinity ? "equal" : Number.isNaN(x) ? "none in view" : `${x.toFixed(1)} dB`);
        const { psnr, flip } = figures;
        const sentence = `PSNR of this view: ${level(psnr.object)} on the object, ${level(psnr.frame)} in the frame`;
        said.textContent = sentence + (flip === null ? "" : `; mean FLIP ${flip.toFixed(4)}`);
    }

    /** The device is lost: goes on with WebGL2, unless that is what failed or something was dropped. */
    lost() {
        const { state, materials, envmap, picture } = this;
        const again = picture.device.kind === "WebGPU" && !envmap && materials.every(({ data }) => data);
        state.device = "webgl";
        this.write();
        if (again && location.hash.includes("device=webgl")) location.reload();
        else this.complain("The graphics device was lost: reload the page.");
    }

    /** Tells the panels what is shown, and the angle of the lamp in the middle of the object. */
    explain() {
        const { state, store } = this;
        const shown = [state.a, state.b].map((number) => store.materials.get(number) ?? null);
        if (state.b >= 0) store.inBackground(state.b, () => store.material(state.b));
        const waits = state.b >= 0 && !shown[1] && this.explained; // and panels go on showing what was before
        if (shown[0] && !waits && (!this.explained || shown.some((one, i) => one !== this.explained[i]))) {
            this.explained = shown;
            this.panels.setMaterials(shown);
        }
        const middle = surfaceAt(state, store.meshes.get(state.scene), 0, 0);
        const cosine = middle ? middle.wi[2] : towards(...state.light)[1];
        this.panels.setLight(Math.acos(clamp(cosine, 0.02, 1)));
    }

    highlight(entry) {
        this.loop.highlight(entry);
        this.tell();
    }

    /** Says what is under the pointer; x and y from 0 to 1, or null. */
    point(x, y) {
        const { canvas, state, store } = this;
        this.place = [x, y];
        const mesh = store.meshes.get(state.scene);
        const found = x === null ? null : pointed(state, mesh, x, y, canvas.clientWidth, canvas.clientHeight);
        const material = found && store.materials.get(found.which ? state.b : state.a);
        this.panels.setPointer(material ? found : null);
        const which = state.b >= 0 ? `${"AB"[found?.which ?? 0]}: ` : "";
        element("pointer").replaceChildren(...(material ? [which, ...numbersOf(material, found)] : []));
    }

    /** Takes files that were dropped or chosen. */
    async openAll(files) {
        const added = [];
        for (const file of files) {
            try {
                if (file.size > LARGEST_FILE) throw new Error(`expected at most ${LARGEST_FILE} bytes, found ${file.size}`);
                const bytes = await file.arrayBuffer();
                if (/\.(hdr|exr)$/i.test(file.name)) await this.light(bytes, file.name);
                else added.push(await this.store.add(file.name, bytes));
            } catch (error) {
                this.complain(`${file.name}: ${error.message}`);
            }
        }
        const [a, b] = added.length > 1 ? added.slice(-2) : [this.state.a, added[0]];
        if (added.length) this.change({ a, b, view: this.state.view === "a" ? "split" : this.state.view });
    }

    /** Takes an environment; null: the built-in one. */
    async light(file, name = "") {
        await this.store.setEnvironment(file, name);
        this.envmap = name;
        this.loop.restart();
        this.changeLight(true);
    }

    /** Says what went wrong, in the page. */
    complain(text) {
        const close = make("button", { type: "button", ariaLabel: "Close", onclick: () => message.remove() }, "×");
        const message = make("p", {}, text, close);
        element("messages").append(message);
    }

    save() {
        this.loop.save();
    }

    command() {
        const shown = traced(this.state).map((number) => this.materials[number]);
        const size = Math.min(this.canvas.clientWidth, this.canvas.clientHeight);
        const render = command(this.state, shown.map(({ name }) => name), size, this.envmap);
        return [...shown.map((one) => one.command).filter(Boolean), render].join(" && ");
    }

    write() {
        try {
            const scale = this.loop.exposing ? 0 : this.state.scale; // not yet what it will be
            history.replaceState(null, "", `#${written({ ...this.state, scale })}`);
        } catch {
            // a frame in a notebook has no address of its own
        }
    }

    link() {
        this.write();
        return location.href;
    }
}

function download(blob, name) {
    const link = make("a", { href: URL.createObjectURL(blob), download: name });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

function element(id) {
    return document.getElementById(id);
}

async function start() {
    const background = new Background(); // which starts meanwhile
    const list = JSON.parse(element("materials").textContent);
    const state = read(location.hash.slice(1), list.length);
    const device = await opened(element("picture"), SHADERS.display, state.device);
    const app = new App(list, state, background, device);
    window.sommerl = Object.assign(app, hooks(app));
}

start().catch((error) => {
    element("messages").append(make("p", {}, error.message));
    throw error;
});
