/** WebGPU, in the verbs of gl.js. */
import { HEAD } from "./lists.js";
import { translated } from "./wgsl.js";

const SHOWN = "rgba8unorm"; // on the canvas
const FLOATS = { 2: "rg32float", 4: "rgba32float" };

export class WebGpu {
    constructor(device) {
        [this.device, this.kind, this.waiting] = [device, "WebGPU", 0];
        this.nothing = this.texture({ width: 1, height: 1 });
        const wrong = new Promise((lost) => (device.onuncapturederror = lost));
        this.lost = Promise.race([device.lost, wrong]);
    }

    /** An adapter's device that has compiled a shader, or null where it cannot. */
    static async open(adapter, shader) {
        const { maxTextureDimension2D } = adapter.limits;
        const device = await adapter.requestDevice({ requiredLimits: { maxTextureDimension2D } });
        device.pushErrorScope("validation");
        const made = new WebGpu(device);
        made.pipelineOf(made.program(shader), SHOWN);
        return (await device.popErrorScope()) ? null : made;
    }

    /** Takes a canvas to draw on; returns whether it can be. */
    attach(canvas) {
        this.context = canvas.getContext("webgpu");
        this.context?.configure({ device: this.device, format: SHOWN, alphaMode: "opaque" });
        return Boolean(this.context);
    }

    get longest() {
        return this.device.limits.maxTextureDimension2D;
    }

    program(source) {
        const { device } = this;
        const { code, places, size, textures } = translated(HEAD + source);
        const visibility = GPUShaderStage.FRAGMENT;
        const read = textures.map(({ sampleType }, i) => ({ binding: i + 1, visibility, texture: { sampleType } }));
        const group = device.createBindGroupLayout({ entries: [{ binding: 0, visibility, buffer: {} }, ...read] });
        const buffer = device.createBuffer({ size, usage: GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST });
        const names = textures.map(({ name }) => name);
        return { module: device.createShaderModule({ code }), places, numbers: new ArrayBuffer(size), names, group, buffer, pipelines: {} };
    }

    /** What draws pictures of a format. */
    pipelineOf({ module, group, pipelines }, format) {
        const { device } = this;
        const layout = device.createPipelineLayout({ bindGroupLayouts: [group] });
        return (pipelines[format] ??= device.createRenderPipeline({ layout, vertex: { module }, fragment: { module, targets: [{ format }] } }));
    }

    texture({ width, height, data = null, channels = 4 }) {
        const whole = { Uint16Array: "r16uint", Uint32Array: "r32uint" }[data?.constructor.name];
        if (channels === 3) [data, channels] = [fours(data), 4]; // there is no format of three floats
        const made = this.image(width, height, whole ?? FLOATS[channels], GPUTextureUsage.COPY_DST);
        if (data) this.device.queue.writeTexture(made, data, { bytesPerRow: data.byteLength / height }, [width, height]);
        return made;
    }

    image(width, height, format, usage) {
        const fits = Math.max(width, height) <= this.longest;
        if (!fits) throw new Error(`too large for the graphics of this device: ${width} × ${height} pixels`);
        const texture = this.device.createTexture({ size: [width, height], format, usage: usage | GPUTextureUsage.TEXTURE_BINDING });
        return { texture, width, height };
    }

    target(width, height, floats = true) {
        const format = floats ? FLOATS[4] : SHOWN;
        return { ...this.image(width, height, format, GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC), floats };
    }

    free(...all) {
        for (const { texture } of all) texture.destroy();
    }

    draw(program, into, values, row = 0, rows = into.height) {
        const { device } = this;
        const { texture = this.context.getCurrentTexture(), left = 0, width, height } = into;
        // Rows are counted from the lowest one, but on the canvas from the highest one.
        fill(program, { ...values, uUpwards: into.texture ? [0, 1] : [height, -1] });
        device.queue.writeBuffer(program.buffer, 0, program.numbers);
        const views = program.names.map((name, i) => ({ binding: i + 1, resource: (values[name] ?? this.nothing).texture.createView() }));
        const entries = [{ binding: 0, resource: { buffer: program.buffer } }, ...views];
        const encoder = device.createCommandEncoder();
        const pass = encoder.beginRenderPass({ colorAttachments: [{ view: texture.createView(), loadOp: "load", storeOp: "store" }] });
        pass.setPipeline(this.pipelineOf(program, texture.format));
        pass.setBindGroup(0, device.createBindGroup({ layout: program.group, entries }));
        pass.setViewport(left, 0, width, height, 0, 1);
        pass.setScissorRect(left, row, width, Math.min(rows, height - row));
        pass.draw(3);
        pass.end();
        device.queue.submit([encoder.finish()]);
    }

    async pixels({ texture, width, height, floats }) {
        const { device } = this;
        const row = 4 * width * (floats ? 4 : 1);
        const bytesPerRow = 256 * Math.ceil(row / 256);
        const buffer = device.createBuffer({ size: bytesPerRow * height, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST });
        const encoder = device.createCommandEncoder();
        encoder.copyTextureToBuffer({ texture }, { buffer, bytesPerRow }, [width, height]);
        device.queue.submit([encoder.finish()]);
        await buffer.mapAsync(GPUMapMode.READ).catch(() => new Promise(() => {})); // nothing comes of a device that is lost
        const all = new Uint8Array(buffer.getMappedRange());
        const found = new Uint8Array(row * height);
        for (let y = 0; y < height; y++) found.set(all.subarray(y * bytesPerRow, y * bytesPerRow + row), y * row);
        buffer.destroy();
        return floats ? new Float32Array(found.buffer) : found;
    }

    begin() {
        const done = () => this.waiting--;
        this.waiting++;
        this.device.queue.onSubmittedWorkDone().then(done, done);
    }

    get busy() {
        return this.waiting > 0;
    }
}

function fill({ places, numbers }, values) {
    for (const { name, at, Numbers } of places) {
        const given = [values[name] ?? []].flat();
        new Numbers(numbers, at, given.length).set(given);
    }
}

function fours(threes) {
    const found = new Float32Array((threes.length / 3) * 4);
    for (let i = 0; i < threes.length; i++) found[4 * Math.floor(i / 3) + (i % 3)] = threes[i];
    return found;
}
