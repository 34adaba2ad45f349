/** What the shaders give for given directions: tests hold it against Python. */
import { list } from "./lists.js";
import { defines, upload, uploadSampler } from "./material.js";
import { SHADERS } from "./shaders.js";

const WIDTH = 256; // pixels in a row
const WHAT = {
    brdf: "brdf(a, b)",
    entries: "vec3(vec2(entriesAt(a, b)), 0.0)",
    sample: "sampled(b, a)",
    pdf: "vec3(pdfBrdf(a, b), 0.0, 0.0)",
};

const MAIN = [
    "uniform sampler2D uLights, uViewers; out vec4 colour;",
    "void main() {",
    "    ivec2 at = ivec2(gl_FragCoord.xy);",
    "    vec3 a = texelFetch(uLights, at, 0).rgb, b = texelFetch(uViewers, at, 0).rgb;",
    "    colour = vec4(WHAT, 1.0);",
    "}",
].join("\n");

/**
 * f_r of pairs of directions, as the GPU calculates it. wi, wo: Float32Arrays of 3 n numbers. Gives a Float32Array of 3 n.
 *
 * what: "brdf"; "entries", of entriesAt; with a sampler's table also "sample": directions to the light for random numbers in
 * the place of wi, and "pdf".
 */
export async function evaluatedOnGpu(device, material, wi, wo, what = "brdf", table = null) {
    const sampling = table ? [SHADERS.sampler, "vec3 sampled(vec3 wo, vec3 u) { float pdf; return sampleBrdf(wo, u, pdf); }"] : [];
    const parts = [defines(material), SHADERS.brdf, ...sampling, MAIN.replace("WHAT", WHAT[what])];
    const used = device.program(parts.join("\n"));
    const height = Math.ceil(wi.length / 3 / WIDTH);
    const [uLights, uViewers] = [wi, wo].map((values) => list(device, values, 3, WIDTH));
    const { textures, uniforms } = upload(device, material);
    const all = { uLights, uViewers, ...textures, ...(table && uploadSampler(device, table)) };
    const into = device.target(WIDTH, height);
    device.draw(used, into, { ...all, ...uniforms });
    const found = await device.pixels(into);
    device.free(into, ...Object.values(all));
    return Float32Array.from(wi, (_, i) => found[4 * Math.floor(i / 3) + (i % 3)]);
}
