/** WebGL2 in five verbs: compile, make a texture, make a target, set uniforms, draw. */

/** The vertex shader of one triangle that covers the picture. */
export const FULL = "void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }";

const LIST_BITS = 11; // of the 2048 pixels in a row of a list: every device has as many
const setters = new WeakMap();

const HEAD = [
    "#version 300 es",
    `#define LIST_BITS ${LIST_BITS}`,
    ...["float", "int", "sampler2D"].map((type) => `precision highp ${type};`),
    "",
].join("\n");

/** A program. Throws an Error with the compiler's words. */
export function program(gl, vertex, fragment) {
    const made = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
        const shader = gl.createShader(kind);
        gl.shaderSource(shader, HEAD + source);
        gl.compileShader(shader);
        gl.attachShader(made, shader);
        gl.deleteShader(shader);
    }
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) {
        const logs = gl.getAttachedShaders(made).map((shader) => gl.getShaderInfoLog(shader));
        throw new Error(`shader: ${[...logs, gl.getProgramInfoLog(made)].join("\n")}`);
    }
    setters.set(made, settersOf(gl, made));
    return made;
}

function settersOf(gl, made) {
    const kinds = {
        [gl.FLOAT]: (at) => (value) => gl.uniform1f(at, value),
        [gl.FLOAT_VEC2]: (at) => (value) => gl.uniform2fv(at, value),
        [gl.FLOAT_VEC3]: (at) => (value) => gl.uniform3fv(at, value),
        [gl.FLOAT_VEC4]: (at) => (value) => gl.uniform4fv(at, value),
        [gl.FLOAT_MAT3]: (at) => (value) => gl.uniformMatrix3fv(at, false, value),
        [gl.INT]: (at) => (value) => gl.uniform1i(at, value),
        [gl.INT_VEC2]: (at) => (value) => gl.uniform2iv(at, value),
        [gl.INT_VEC3]: (at) => (value) => gl.uniform3iv(at, value),
        [gl.INT_VEC4]: (at) => (value) => gl.uniform4iv(at, value),
        [gl.UNSIGNED_INT]: (at) => (value) => gl.uniform1ui(at, value),
        [gl.SAMPLER_2D]: (at) => (value) => gl.uniform1i(at, value),
        [gl.UNSIGNED_INT_SAMPLER_2D]: (at) => (value) => gl.uniform1i(at, value),
    };
    const count = gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS);
    const active = Array.from({ length: count }, (_, i) => gl.getActiveUniform(made, i)).filter(({ type }) => kinds[type]);
    return new Map(active.map(({ name, type }) => [name.replace("[0]", ""), kinds[type](gl.getUniformLocation(made, name))]));
}

/** Sets the uniforms that a program has, of those given by name; the program has to be in use. */
export function set(gl, made, values) {
    const known = setters.get(made);
    for (const [name, value] of Object.entries(values)) known.get(name)?.(value);
}

/** Puts textures on texture units from `first` on, and sets the samplers of these names. */
export function bind(gl, made, textures, first = 0) {
    Object.entries(textures).forEach(([name, one], i) => {
        gl.activeTexture(gl.TEXTURE0 + first + i);
        gl.bindTexture(gl.TEXTURE_2D, one);
        set(gl, made, { [name]: first + i });
    });
}

/**
 * A texture. Values in `data`, or none; see WebGL2 for `internal`, `format` and `type`. Throws an Error if it is too large for
 * the device.
 */
export function texture(gl, { width, height, data = null, internal = gl.RGBA32F, format = gl.RGBA, type = gl.FLOAT, filter = gl.NEAREST }) {
    const fits = Math.max(width, height) <= gl.getParameter(gl.MAX_TEXTURE_SIZE);
    if (!fits) throw new Error(`too large for the graphics of this device: ${width} × ${height} pixels`);
    const made = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, made);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.texImage2D(gl.TEXTURE_2D, 0, internal, width, height, 0, format, type, data);
    for (const name of ["MIN", "MAG"]) gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_${name}_FILTER`], filter);
    for (const name of ["S", "T"]) gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_WRAP_${name}`], gl.CLAMP_TO_EDGE);
    return made;
}

/** A texture of numbers, `channels` in a pixel. In rows of 2^LIST_BITS pixels, texelOf of brdf.glsl finds a pixel by its number. */
export function list(gl, numbers, channels = 4, width = 2 ** LIST_BITS) {
    const [internal, format, type, Kind] = typeOf(numbers, channels);
    const height = Math.max(Math.ceil(numbers.length / channels / width), 1);
    const data = new Kind(channels * width * height);
    data.set(numbers);
    return texture(gl, { width, height, data, internal: gl[internal], format: gl[format], type: gl[type] });
}

function typeOf(numbers, channels) {
    if (numbers instanceof Uint16Array) return ["R16UI", "RED_INTEGER", "UNSIGNED_SHORT", Uint16Array];
    if (numbers instanceof Uint32Array) return ["R32UI", "RED_INTEGER", "UNSIGNED_INT", Uint32Array];
    const format = { 2: "RG", 3: "RGB", 4: "RGBA" }[channels];
    return [`${format}32F`, format, "FLOAT", Float32Array];
}

/** A picture to draw into: of four floats a pixel, or of 8 bits. */
export function target(gl, width, height, floats = true) {
    const how = floats ? {} : { internal: gl.RGBA8, type: gl.UNSIGNED_BYTE };
    const made = { width, height, texture: texture(gl, { width, height, ...how }), framebuffer: gl.createFramebuffer() };
    gl.bindFramebuffer(gl.FRAMEBUFFER, made.framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, made.texture, 0);
    return made;
}

export function free(gl, made) {
    gl.deleteTexture(made.texture);
    gl.deleteFramebuffer(made.framebuffer);
}

/** Draws into a target, or into a part of the canvas: {left, width, height} without a framebuffer. */
export function draw(gl, into) {
    gl.bindFramebuffer(gl.FRAMEBUFFER, into.framebuffer ?? null);
    gl.viewport(into.left ?? 0, 0, into.width, into.height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
}

/** The pixels of a target, from its lowest row: a Float32Array, or a Uint8Array of 8-bit ones. */
export function pixels(gl, from, floats = true) {
    const found = new (floats ? Float32Array : Uint8Array)(4 * from.width * from.height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, from.framebuffer);
    gl.readPixels(0, 0, from.width, from.height, gl.RGBA, floats ? gl.FLOAT : gl.UNSIGNED_BYTE, found);
    return found;
}
