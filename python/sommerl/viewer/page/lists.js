/** Lists of numbers in textures, which texelOf of brdf.glsl reads by number. */

const LIST_BITS = 11; // of the 2048 pixels in a row of a list: every device has as many

/** What comes before all shaders. */
export const HEAD = `const uint LIST_BITS = ${LIST_BITS}u;\n`;

/** A texture of numbers, `channels` in a pixel: of 16 or 32 bits if these are whole, else of floats. */
export function list(device, numbers, channels = 4, width = 2 ** LIST_BITS) {
    const height = Math.max(Math.ceil(numbers.length / channels / width), 1);
    const whole = numbers instanceof Uint16Array || numbers instanceof Uint32Array;
    const data = new (whole ? numbers.constructor : Float32Array)(channels * width * height);
    data.set(numbers);
    return device.texture({ width, height, data, channels });
}
