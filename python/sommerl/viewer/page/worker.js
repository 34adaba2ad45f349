/** The page's worker: decodes files, fits samplers, reads environments and sorts meshes, so that the page never waits. */
import { boxed } from "./boxes.js";
import { aliases, builtIn } from "./environment.js";
import { readEnvironment } from "./images.js";
import { ball, finial, square } from "./mesh.js";
import { read, sentence } from "./readers.js";
import { fitted } from "./sampler.js";

const MESHES = { statue: finial, ball, sample: square };

const WORK = {
    async decode(message) {
        const start = performance.now();
        const material = await read(message.file, message);
        return { material, milliseconds: performance.now() - start };
    },
    sampler: ({ material }) => ({ table: fitted(material) }),
    mesh: ({ scene }) => ({ mesh: boxed(MESHES[scene]()) }),
    /** file: null for the built-in one. */
    async environment({ file }) {
        const environment = file ? await readEnvironment(file) : builtIn();
        return { environment, aliases: aliases(environment) };
    },
};

globalThis.onmessage = async ({ data }) => {
    const { id } = data;
    try {
        const answer = await WORK[data.do](data);
        globalThis.postMessage({ id, ...answer }, [...buffersOf(answer)]);
    } catch (error) {
        globalThis.postMessage({ id, error: sentence(error) });
    }
};

/** The memory behind all arrays in an answer: it moves to the page instead of being copied. */
function buffersOf(value, found = new Set()) {
    if (ArrayBuffer.isView(value)) found.add(value.buffer);
    else if (value && typeof value === "object") Object.values(value).forEach((inner) => buffersOf(inner, found));
    return found;
}
