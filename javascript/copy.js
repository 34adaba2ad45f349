/** Copies the modules that sommerl.js imports, which are the page's and the decoder's, to a folder: beside it by default. */
import { copyFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const to = process.argv[2] ?? here;
const modules = {
    "compression/smrl/javascript": ["smrl.js", "nodes.js"],
    "viewer/page": ["evaluate.js", "sampler.js", "rgl.js", "bytes.js"],
};
for (const [folder, names] of Object.entries(modules)) {
    for (const name of names) copyFileSync(join(here, "../python/sommerl", folder, name), join(to, name));
}
