/** What the page draws with: WebGPU where there is some, else WebGL2. */
import { WebGl } from "./gl.js";
import { WebGpu } from "./webgpu.js";

const PATIENCE = 400; // ms, after which an adapter is not waited for any longer

/**
 * A device that draws on a canvas. shader: one that WebGPU has to take. wanted: "webgl", "webgpu" for waiting as long as its
 * adapter takes, or "". Throws an Error where there is none.
 */
export async function opened(canvas, shader, wanted) {
    const found = wanted === "webgl" ? null : await withWebGpu(shader, wanted ? [] : [late()]).catch(() => null);
    return found?.attach(canvas) ? found : new WebGl(canvas);
}

function late() {
    return new Promise((done) => setTimeout(done, PATIENCE));
}

async function withWebGpu(shader, ends) {
    const adapter = await Promise.race([navigator.gpu?.requestAdapter({ powerPreference: "high-performance" }), ...ends]);
    return adapter ? WebGpu.open(adapter, shader) : null;
}
