/** WebGL2 in a few verbs: compile, make a texture, make a target, draw, read. webgpu.js has the same ones. */
import { HEAD } from "./lists.js";

const FULL = "#version 300 es\nvoid main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }";
const PRECISIONS = ["float", "int", "sampler2D", "usampler2D"].map((type) => `precision highp ${type};\n`);
const FLOATS = { 2: "RG", 3: "RGB", 4: "RGBA" };

export class WebGl {
    /** Throws an Error where there is no WebGL2 with pictures of floats. */
    constructor(canvas) {
        const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, powerPreference: "high-performance" });
        if (!gl?.getExtension("EXT_color_buffer_float")) throw new Error("This page needs a browser with WebGL2 and float textures.");
        [this.gl, this.kind] = [gl, "WebGL2"];
        gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
        this.nothing = this.texture({ width: 1, height: 1 });
        this.lost = new Promise((lost) => canvas.addEventListener("webglcontextlost", lost)); // what happens then
    }

    /** The longest side that a texture may have, in pixels. */
    get longest() {
        return this.gl.getParameter(this.gl.MAX_TEXTURE_SIZE);
    }

    /** A program that calculates each pixel by a fragment shader in GLSL. Throws an Error with the compiler's words. */
    program(source) {
        const { gl } = this;
        const made = gl.createProgram();
        for (const [kind, text] of [[gl.VERTEX_SHADER, FULL], [gl.FRAGMENT_SHADER, ["#version 300 es\n", ...PRECISIONS, HEAD, source].join("")]]) {
            const shader = gl.createShader(kind);
            gl.shaderSource(shader, text);
            gl.compileShader(shader);
            gl.attachShader(made, shader);
            gl.deleteShader(shader);
        }
        gl.linkProgram(made);
        if (!gl.getProgramParameter(made, gl.LINK_STATUS)) {
            const logs = gl.getAttachedShaders(made).map((shader) => gl.getShaderInfoLog(shader));
            throw new Error(`shader: ${[...logs, gl.getProgramInfoLog(made)].join("\n")}`);
        }
        return { made, setters: this.settersOf(made) };
    }

    /** Of each uniform by its name, what sets it; of each texture, what binds it. */
    settersOf(made) {
        const { gl } = this;
        let units = 0;
        const bound = (at) => {
            const unit = units++;
            return (value) => {
                gl.activeTexture(gl.TEXTURE0 + unit);
                gl.bindTexture(gl.TEXTURE_2D, (value ?? this.nothing).texture);
                gl.uniform1i(at, unit);
            };
        };
        const kinds = {
            [gl.FLOAT]: (at) => (value) => gl.uniform1f(at, value),
            [gl.FLOAT_VEC2]: (at) => (value) => gl.uniform2fv(at, value),
            [gl.FLOAT_VEC3]: (at) => (value) => gl.uniform3fv(at, value),
            [gl.FLOAT_VEC4]: (at) => (value) => gl.uniform4fv(at, value),
            [gl.INT]: (at) => (value) => gl.uniform1i(at, value),
            [gl.INT_VEC2]: (at) => (value) => gl.uniform2iv(at, value),
            [gl.INT_VEC3]: (at) => (value) => gl.uniform3iv(at, value),
            [gl.INT_VEC4]: (at) => (value) => gl.uniform4iv(at, value),
            [gl.UNSIGNED_INT]: (at) => (value) => gl.uniform1ui(at, value),
            [gl.SAMPLER_2D]: bound,
            [gl.UNSIGNED_INT_SAMPLER_2D]: bound,
        };
        const count = gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS);
        const active = Array.from({ length: count }, (_, i) => gl.getActiveUniform(made, i));
        return active.map(({ name, type }) => [name.replace("[0]", ""), kinds[type](gl.getUniformLocation(made, name))]);
    }

    /**
     * A texture. data: a typed array of `channels` numbers a pixel, one of whole numbers or 2 to 4 of floats; null for none. Throws
     * an Error if it is too large for the device.
     */
    texture({ width, height, data = null, channels = 4 }) {
        const floats = [`${FLOATS[channels]}32F`, FLOATS[channels], "FLOAT"];
        const whole = { Uint16Array: ["R16UI", "RED_INTEGER", "UNSIGNED_SHORT"], Uint32Array: ["R32UI", "RED_INTEGER", "UNSIGNED_INT"] };
        return this.image(width, height, data, ...(whole[data?.constructor.name] ?? floats));
    }

    image(width, height, data, internal, format, type) {
        const { gl } = this;
        const most = this.longest;
        if (Math.max(width, height) > most) throw new Error(`too large for the graphics of this device: ${width} × ${height} pixels`);
        const texture = gl.createTexture();
        gl.bindTexture(gl.TEXTURE_2D, texture);
        gl.texImage2D(gl.TEXTURE_2D, 0, gl[internal], width, height, 0, gl[format], gl[type], data);
        for (const name of ["MIN", "MAG"]) gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_${name}_FILTER`], gl.NEAREST);
        return { texture, width, height };
    }

    /** A picture to draw into: of four floats a pixel, or of 8 bits. */
    target(width, height, floats = true) {
        const { gl } = this;
        const how = floats ? ["RGBA32F", "RGBA", "FLOAT"] : ["RGBA8", "RGBA", "UNSIGNED_BYTE"];
        const made = { ...this.image(width, height, null, ...how), floats, framebuffer: gl.createFramebuffer() };
        gl.bindFramebuffer(gl.FRAMEBUFFER, made.framebuffer);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, made.texture, 0);
        return made;
    }

    /** Gives back the memory of textures and targets. */
    free(...all) {
        for (const { texture, framebuffer = null } of all) {
            this.gl.deleteTexture(texture);
            this.gl.deleteFramebuffer(framebuffer);
        }
    }

    /**
     * Draws into a target, or into a part of the canvas: {left, width, height}. values: of the program's uniforms, and its textures,
     * by name; a texture that is missing is a single pixel. row, rows: which ones are drawn.
     */
    draw({ made, setters }, into, values, row = 0, rows = into.height) {
        const { gl } = this;
        gl.useProgram(made);
        for (const [name, set] of setters) set(values[name]);
        gl.bindFramebuffer(gl.FRAMEBUFFER, into.framebuffer ?? null);
        gl.viewport(into.left ?? 0, 0, into.width, into.height);
        gl.enable(gl.SCISSOR_TEST);
        gl.scissor(into.left ?? 0, row, into.width, rows);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
    }

    /** The pixels of a target, from its lowest row: a Float32Array, or a Uint8Array of 8-bit ones. */
    async pixels({ framebuffer, width, height, floats }) {
        const { gl } = this;
        const found = new (floats ? Float32Array : Uint8Array)(4 * width * height);
        gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
        gl.readPixels(0, 0, width, height, gl.RGBA, floats ? gl.FLOAT : gl.UNSIGNED_BYTE, found);
        return found;
    }

    /** Begins what was drawn; the device is busy until that is done. */
    begin() {
        const { gl } = this;
        this.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
        gl.flush();
    }

    get busy() {
        const { gl } = this;
        if (this.fence && gl.clientWaitSync(this.fence, 0, 0) === gl.TIMEOUT_EXPIRED) return true;
        gl.deleteSync(this.fence ?? null);
        this.fence = null;
        return false;
    }
}
