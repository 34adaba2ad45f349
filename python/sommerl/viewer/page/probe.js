/** What the shaders give for given directions: tests hold it against Python. */
import { FULL, bind, draw, free, list, pixels, program, target } from "./gl.js";
import { defines, upload, uploadSampler } from "./material.js";
import { SHADERS } from "./shaders.js";

const WIDTH = 256; // pixels in a row
const WHAT = {
    brdf: "brdf(a, b)",
    entries: "vec3(entriesAt(a, b), 0.0)",
    sample: "sampled(b, a)",
    pdf: "vec3(pdfBrdf(a, b), 0.0, 0.0)",
};

const MAIN = [
    "uniform highp sampler2D uLights, uViewers; out vec4 colour;",
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
 * the place of wi, and "pdf". Throws an Error where there are no textures of floats to draw into.
 */
export function evaluatedOnGpu(gl, material, wi, wo, what = "brdf", table = null) {
    if (!gl.getExtension("EXT_color_buffer_float")) throw new Error("the graphics of this device cannot draw floats");
    const sampling = table ? [SHADERS.sampler, "vec3 sampled(vec3 wo, vec3 u) { float pdf; return sampleBrdf(wo, u, pdf); }"] : [];
    const parts = [defines(material), SHADERS.brdf, ...sampling, MAIN.replace("WHAT", WHAT[what])];
    const used = program(gl, FULL, parts.join("\n"));
    const height = Math.ceil(wi.length / 3 / WIDTH);
    const given = [wi, wo].map((values) => list(gl, values, 3, WIDTH));
    const bound = [upload(gl, material), table && uploadSampler(gl, table)];
    const into = target(gl, WIDTH, height);
    gl.useProgram(used);
    bind(gl, used, { uLights: given[0], uViewers: given[1] });
    bound.forEach((one, i) => one?.bind(used, 2 + 6 * i));
    draw(gl, into);
    const found = pixels(gl, into);
    for (const one of given) gl.deleteTexture(one);
    for (const one of bound) one?.free();
    free(gl, into);
    gl.deleteProgram(used);
    return Float32Array.from(wi, (_, i) => found[4 * Math.floor(i / 3) + (i % 3)]);
}
