/** Pictures of a material in a scene: the mean of ever more paths. */
import { FULL, bind, draw, free, list, program, set, target, texture } from "./gl.js";
import { defines, upload, uploadSampler } from "./material.js";
import { SHADERS } from "./shaders.js";
import { SCENES, camera, towards } from "./camera.js";

const MOST_UNITS = 3; // of textures, that a material takes

/** Draws pictures with one WebGL2 context. */
export class Renderer {
    constructor(gl) {
        this.gl = gl;
        this.programs = new Map();
        this.meshes = new Map(); // by scene
        this.environment = null; // made when it is first needed
    }

    /** A decoded material on the GPU: what `trace` takes. */
    prepare(material) {
        return { ...upload(this.gl, material), defines: defines(material), sampler: null };
    }

    /** table: of the sampler, as the worker makes it. */
    setSampler(prepared, table) {
        prepared.sampler = uploadSampler(this.gl, table);
    }

    /** mesh: {boxes, triangles}. */
    setMesh(scene, mesh) {
        const { gl } = this;
        this.meshes.set(scene, { boxes: list(gl, mesh.boxes), triangles: list(gl, mesh.triangles), count: mesh.boxes.length / 8 });
    }

    /** As the worker gives it. */
    setEnvironment({ environment: { width, height, pixels }, aliases }) {
        const { gl } = this;
        const picture = texture(gl, { width, height, data: pixels, internal: gl.RGB32F, format: gl.RGB });
        for (const old of Object.values(this.environment ?? {})) gl.deleteTexture(old);
        this.environment = { picture, aliases: texture(gl, aliases) };
    }

    /** Frees what `prepare` and `setSampler` have made. */
    release(prepared) {
        prepared.free();
        prepared.sampler?.free();
    }

    /** A picture that paths are added to. */
    film(width, height) {
        const [now, before] = [target(this.gl, width, height), target(this.gl, width, height)];
        return { now, before, width, height, count: 0, row: 0, mean: now };
    }

    free(film) {
        free(this.gl, film.now);
        free(this.gl, film.before);
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
        const { gl } = this;
        const made = this.programFor(prepared, view, this.isPlain(view, bounces) ? ["PLAIN"] : []);
        gl.useProgram(made);
        if (!film.row) [film.now, film.before] = [film.before, film.now];
        this.setView(made, film, view);
        const jitter = film.count ? [halton(film.count, 2) - 0.5, halton(film.count, 3) - 0.5] : [0, 0];
        set(gl, made, { uJitter: jitter, uCount: film.count, uSeed: film.count + 1, uBounces: bounces });
        let unit = bound(gl, made, { uBefore: film.before.texture }, 0);
        if (view.environment) {
            unit = bound(gl, made, { uEnvironment: this.environment.picture, uAliases: this.environment.aliases }, unit);
        }
        unit = this.bindMesh(made, view, unit);
        prepared.bind(made, unit);
        prepared.sampler?.bind(made, unit + MOST_UNITS);
        gl.enable(gl.SCISSOR_TEST);
        gl.scissor(0, film.row, film.width, rows);
        draw(gl, film.now);
        gl.disable(gl.SCISSOR_TEST);
        film.row += rows;
        if (film.row >= film.height) [film.row, film.count] = [0, film.count + 1];
        film.mean = film.row && film.count ? film.before : film.now;
    }

    /** Draws 1 into the pixels of a target that look up an entry with the lamp's direction. entries: [shape or entry, gain], -1 for any. */
    mark(into, prepared, view, entries) {
        const { gl } = this;
        const made = this.programFor(prepared, { ...view, environment: false }, ["PLAIN", "ENTRIES"]);
        gl.useProgram(made);
        this.setView(made, into, view);
        set(gl, made, { uJitter: [0, 0], uEntries: entries });
        prepared.bind(made, this.bindMesh(made, view, 0));
        draw(gl, into);
    }

    setView(made, { width, height }, view) {
        const { eye, right, up, back } = camera(view);
        const common = { uSize: [width, height], uCamera: [...right, ...up, ...back], uEye: eye };
        set(this.gl, made, { ...common, uTangent: SCENES[view.scene].tangent, uLight: towards(...view.light) });
    }

    bindMesh(made, view, unit) {
        const mesh = this.meshes.get(view.scene);
        if (!mesh) return unit;
        set(this.gl, made, { uBoxCount: mesh.count });
        return bound(this.gl, made, { uBoxes: mesh.boxes, uTriangles: mesh.triangles }, unit);
    }

    programFor(prepared, view, more) {
        const { mesh, plane } = SCENES[view.scene];
        const names = [...more, ...(mesh ? ["MESH"] : []), ...(plane ? ["PLANE"] : []), ...(view.environment ? ["ENVIRONMENT"] : [])];
        const head = prepared.defines + names.map((name) => `#define ${name}\n`).join("");
        if (!this.programs.has(head)) {
            const sampler = more.includes("PLAIN") ? "" : SHADERS.sampler;
            this.programs.set(head, program(this.gl, FULL, head + SHADERS.brdf + sampler + SHADERS.trace));
        }
        return this.programs.get(head);
    }
}

function bound(gl, made, textures, unit) {
    bind(gl, made, textures, unit);
    return unit + Object.keys(textures).length;
}

/** The radical inverse of a number (Halton 1960). */
function halton(number, base) {
    let [found, share] = [0, 1 / base];
    for (let n = number; n > 0; n = Math.floor(n / base), share /= base) found += share * (n % base);
    return found;
}
