/** Pictures of a material in a scene: the mean of ever more paths. */
import { list } from "./lists.js";
import { defines, upload, uploadSampler } from "./material.js";
import { SHADERS } from "./shaders.js";
import { SCENES, camera, towards } from "./camera.js";

/** Draws pictures with one device (device.js). */
export class Renderer {
    constructor(device) {
        this.device = device;
        this.programs = new Map();
        this.meshes = new Map(); // by scene
        this.environment = null; // made when it is first needed
    }

    /** A decoded material on the GPU: what `trace` takes. */
    prepare(material) {
        return { ...upload(this.device, material), defines: defines(material), sampler: null };
    }

    /** table: of the sampler, as the worker makes it. */
    setSampler(prepared, table) {
        prepared.sampler = uploadSampler(this.device, table);
    }

    /** mesh: {boxes, triangles}. */
    setMesh(scene, mesh) {
        const [uBoxes, uTriangles] = [mesh.boxes, mesh.triangles].map((numbers) => list(this.device, numbers));
        this.meshes.set(scene, { uBoxes, uTriangles, uBoxCount: mesh.boxes.length / 8 });
    }

    /** As the worker gives it. */
    setEnvironment({ environment: { width, height, pixels }, aliases }) {
        const { device } = this;
        const uEnvironment = device.texture({ width, height, data: pixels, channels: 3 });
        device.free(...Object.values(this.environment ?? {}));
        this.environment = { uEnvironment, uAliases: device.texture(aliases) };
    }

    /** Frees what `prepare` and `setSampler` have made. */
    release(prepared) {
        this.device.free(...Object.values({ ...prepared.textures, ...prepared.sampler }));
    }

    /** A picture that paths are added to. */
    film(width, height) {
        const [now, before] = [this.device.target(width, height), this.device.target(width, height)];
        return { now, before, width, height, count: 0, row: 0, mean: now };
    }

    free(film) {
        this.device.free(film.now, film.before);
    }

    /** Whether there is what a view needs: a mesh, and a sampler. */
    ready(prepared, view, bounces) {
        const { mesh } = SCENES[view.scene];
        const lit = !view.environment || this.environment !== null;
        return lit && (!mesh || this.meshes.has(view.scene)) && (this.isPlain(view, bounces) || prepared.sampler !== null);
    }

    isPlain(view, bounces) {
        return !view.environment && (bounces === 0 || SCENES[view.scene].alone);
    }

    /**
     * Adds one path to each pixel of a film, or to its next `rows` rows of pixels alone, so that a slow device stays in hand;
     * film.mean is what is complete. First paths go through the middle of pixels.
     */
    trace(film, prepared, view, bounces, rows = film.height) {
        const made = this.programFor(prepared, view, this.isPlain(view, bounces) ? ["PLAIN"] : []);
        if (!film.row) [film.now, film.before] = [film.before, film.now];
        const uJitter = film.count ? [halton(film.count, 2) - 0.5, halton(film.count, 3) - 0.5] : [0, 0];
        const path = { uJitter, uCount: film.count, uSeed: film.count + 1, uBounces: bounces, uBefore: film.before };
        const values = { ...this.seen(film, prepared, view), ...path, ...this.environment, ...prepared.sampler };
        this.device.draw(made, film.now, values, film.row, rows);
        film.row += rows;
        if (film.row >= film.height) [film.row, film.count] = [0, film.count + 1];
        film.mean = film.row && film.count ? film.before : film.now;
    }

    /** Draws 1 into the pixels of a target that look up an entry with the lamp's direction. entries: [shape or entry, gain], -1 for any. */
    mark(into, prepared, view, entries) {
        const made = this.programFor(prepared, { ...view, environment: false }, ["PLAIN", "ENTRIES"]);
        this.device.draw(made, into, { ...this.seen(into, prepared, view), uJitter: [0, 0], uEntries: entries });
    }

    /** What shaders have to be told of a view of a material. */
    seen({ width, height }, prepared, view) {
        const { eye: uEye, right: uRight, up: uUp, back: uBack } = camera(view);
        const common = { uSize: [width, height], uEye, uRight, uUp, uBack, uTangent: SCENES[view.scene].tangent, uLight: towards(...view.light) };
        return { ...common, ...this.meshes.get(view.scene), ...prepared.textures, ...prepared.uniforms };
    }

    programFor(prepared, view, more) {
        const { mesh, plane } = SCENES[view.scene];
        const names = [...more, ...(mesh ? ["MESH"] : []), ...(plane ? ["PLANE"] : []), ...(view.environment ? ["ENVIRONMENT"] : [])];
        const head = prepared.defines + names.map((name) => `#define ${name}\n`).join("");
        if (!this.programs.has(head)) {
            const sampler = more.includes("PLAIN") ? "" : SHADERS.sampler;
            this.programs.set(head, this.device.program(head + SHADERS.brdf + sampler + SHADERS.trace));
        }
        return this.programs.get(head);
    }
}

/** The radical inverse of a number (Halton 1960). */
function halton(number, base) {
    let [found, share] = [0, 1 / base];
    for (let n = number; n > 0; n = Math.floor(n / base), share /= base) found += share * (n % base);
    return found;
}
