/** What pictures are made of: materials, decoded and on the GPU, their samplers, and meshes. All is made when it is first needed. */
import { SCENES } from "./camera.js";
import { grouped, sizeOf } from "./draw.js";

const MOST_PREPARED = 12; // materials: a table takes some 40 MB

export class Store {
    /** list: of the materials in the page. calls: {arrived(), failed(number, message)}. */
    constructor(list, background, renderer, calls) {
        Object.assign(this, { list, background, renderer, calls });
        this.materials = new Map(); // decoded, by number
        this.prepared = new Map(); // the same on the GPU
        this.meshes = new Map(); // by scene
        this.made = new Map(); // promises, by what is made
        this.failed = new Set(); // of these, what could not be made
    }

    /** Whether there is all that a picture of these materials needs; the rest is asked for, and what a still picture will need. */
    has(numbers, view, bounces) {
        for (const number of numbers) this.inBackground(number, () => this.material(number));
        if (!numbers.every((number) => this.prepared.has(number))) return false;
        this.trim(numbers);
        if (view.environment) this.inBackground(null, () => this.environment());
        if (SCENES[view.scene].mesh) this.inBackground(null, () => this.mesh(view.scene));
        if (!this.renderer.isPlain(view, 1)) for (const number of numbers) this.inBackground(number, () => this.sampler(number));
        return numbers.every((number) => this.renderer.ready(this.prepared.get(number), view, bounces));
    }

    /** Makes something for the first time; number: of the material that it is for, or null. */
    inBackground(number, make) {
        const before = this.made.size;
        const promise = make();
        if (this.made.size === before) return; // it has been asked for
        promise.then(
            () => this.calls.arrived(),
            (error) => this.calls.failed(number, error.message),
        );
    }

    /** Forgets the materials that were not shown for longest; those in the page can be decoded again. */
    trim(numbers) {
        for (const number of numbers) {
            const prepared = this.prepared.get(number);
            this.prepared.delete(number);
            this.prepared.set(number, prepared); // the last one is the newest
        }
        const old = [...this.prepared.keys()].filter((number) => this.list[number].data && !numbers.includes(number));
        for (const number of old.slice(0, Math.max(this.prepared.size - MOST_PREPARED, 0))) {
            this.renderer.release(this.prepared.get(number));
            this.prepared.delete(number);
            this.materials.delete(number);
            for (const what of ["material", "sampler"]) this.made.delete(`${what} ${number}`);
        }
    }

    once(what, make) {
        if (!this.made.has(what)) {
            const promise = make();
            promise.catch(() => this.failed.add(what));
            this.made.set(what, promise);
        }
        return this.made.get(what);
    }

    /** Lets what could not be made of a material be tried once more, when it is chosen again. */
    retry(number) {
        for (const what of [`material ${number}`, `sampler ${number}`]) {
            if (this.failed.delete(what)) this.made.delete(what);
        }
    }

    /** The decoded material. Throws an Error. */
    material(number) {
        return this.once(`material ${number}`, async () => {
            const { name, format, data, deflated } = this.list[number];
            const file = Uint8Array.from(atob(data), (c) => c.charCodeAt(0)).buffer;
            return this.take(number, await this.background.ask({ do: "decode", format, file, name, deflated }, [file]));
        });
    }

    /** Puts a material on the GPU. answer: the worker's. */
    take(number, { material, milliseconds }, prepared = this.renderer.prepare(material)) {
        const { label, bytes } = this.list[number];
        this.prepared.set(number, prepared);
        this.materials.set(number, { ...material, label, bytes, milliseconds });
        return this.materials.get(number);
    }

    /** Takes a file into the list; returns its number. Throws an Error. */
    async add(name, file) {
        const bytes = file.byteLength;
        const answer = await this.background.ask({ do: "decode", format: null, file, name, deflated: false }, [file]);
        const prepared = this.renderer.prepare(answer.material); // or it is too large for the device
        const [number, same] = [this.list.length, this.list.filter((one) => one.name === name).length];
        this.list.push({ name, label: same ? `${name} (${same + 1})` : name, group: "", step: "", command: "", note: "", bytes });
        this.made.set(`material ${number}`, Promise.resolve(this.take(number, answer, prepared)));
        return number;
    }

    /** The built-in environment, if there is none yet. */
    environment() {
        return this.once("environment", () => this.setEnvironment(null, ""));
    }

    /** file: null for the built-in one. */
    async setEnvironment(file, name) {
        this.renderer.setEnvironment(await this.background.ask({ do: "environment", file, name }, file ? [file] : []));
        this.made.set("environment", Promise.resolve());
    }

    sampler(number) {
        return this.once(`sampler ${number}`, async () => {
            const { table } = await this.background.ask({ do: "sampler", material: await this.material(number) });
            this.renderer.setSampler(this.prepared.get(number), table);
        });
    }

    mesh(scene) {
        return this.once(`mesh ${scene}`, async () => {
            const { mesh } = await this.background.ask({ do: "mesh", scene });
            this.meshes.set(scene, mesh);
            this.renderer.setMesh(scene, mesh);
        });
    }

    /** What is said of a material, after its label. */
    described(number) {
        const { bytes, note } = this.list[number];
        const material = this.materials.get(number);
        const size = bytes === null ? "" : sizeOf(bytes);
        const facts = [size, material ? FACTS[material.kind](material) : ""].filter(Boolean).join("; ");
        return `${facts && `: ${facts}`}.${note && ` ${note}`}`;
    }
}

const FACTS = {
    cells: ({ lut, index, interpolation }) => `${lut.length / 3} entries, ${grouped(index.length)} cells, ${interpolation}`,
    nodes: ({ gains, lut, index }) => `${gains.length} gains, ${lut.length / 3} shapes, ${grouped(index.length)} nodes`,
    table: ({ lattice, interpolation }) => `${lattice.thetaH} × ${lattice.thetaD} × ${lattice.phiD} cells, ${interpolation}`,
    grid: ({ thetas, phis }) => `${thetas} × ${thetas} × ${phis} values`,
    rgl: ({ thetaI }) => `${thetaI.length} elevations, as measured`,
};
