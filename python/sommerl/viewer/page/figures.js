/** How far apart two pictures are, as they are shown: PSNR and FLIP. */
import { SHADERS } from "./shaders.js";

const WHOLE = 128; // of 255: pixels that the material covers by half or more are its own

/** PSNR [dB] of two pictures of 8 bits, in fours with coverage, over the object's pixels and over all of them. */
export function psnr(a, b) {
    const sums = { object: [0, 0], frame: [0, 0] };
    for (let i = 0; i < a.length; i += 4) {
        const error = (a[i] - b[i]) ** 2 + (a[i + 1] - b[i + 1]) ** 2 + (a[i + 2] - b[i + 2]) ** 2;
        for (const part of a[i + 3] >= WHOLE ? ["object", "frame"] : ["frame"]) {
            sums[part][0] += error / 3;
            sums[part][1]++;
        }
    }
    const level = ([error, count]) => 10 * Math.log10((255 * 255 * count) / error);
    return { object: level(sums.object), frame: level(sums.frame) };
}

// What FLIP's eye sees of luminance and of two opponent colours, the last one through two filters: widths of Gaussians, and their heights.
const [WIDTHS, HEIGHTS] = [[0.0047, 0.0053, 0.04, 0.025], [34.1, 13.5]];
const [PIXELS_A_DEGREE, FEATURE] = [67.0206, 0.082]; // pixels in a degree, on a screen 0.7 m wide with 3840 pixels and 0.7 m away; width of a feature [degrees]
const OFFSETS = Array.from({ length: 21 }, (_, i) => i - 10);

/** Pictures of FLIP (Andersson et al. 2020) on the GPU. */
export class Flip {
    constructor(device) {
        this.device = device;
        [this.opponent, this.blur, this.flip] = ["opponent", "blur", "flip"].map((name) => device.program(SHADERS.colour + SHADERS[name]));
        this.targets = [];
        const bells = WIDTHS.map((b) => OFFSETS.map((x) => Math.exp(-((Math.PI * x) ** 2) / (b * PIXELS_A_DEGREE ** 2))));
        const sums = bells.map((bell) => bell.reduce((sum, x) => sum + x));
        const parts = HEIGHTS.map((height, i) => height * Math.sqrt(Math.PI / WIDTHS[2 + i]) * sums[2 + i] ** 2);
        this.shares = parts.map((part) => part / (parts[0] + parts[1]));
        const width = (0.5 * FEATURE * PIXELS_A_DEGREE) ** 2;
        const bell = OFFSETS.map((x) => (Math.abs(x) < 10 ? Math.exp((-0.5 * x * x) / width) : 0));
        const [smooth, step, bend] = [bell, bell.map((y, i) => OFFSETS[i] * y), bell.map((y, i) => (OFFSETS[i] ** 2 / width - 1) * y)].map(balanced);
        const zipped = (...lists) => OFFSETS.flatMap((_, i) => lists.map((list) => list[i]));
        const colours = zipped(...bells.map(balanced));
        this.weights = [colours, colours, zipped(smooth, step, bend, bend), zipped(smooth, step, smooth, bend)];
    }

    /** The map of two pictures of 8 bits, a target whose first channel is FLIP from 0 to 1. It is the same one at each call. */
    of(a, b) {
        const { device } = this;
        if (this.targets[0]?.width !== a.width || this.targets[0].height !== a.height) {
            this.rest();
            this.targets = Array.from({ length: 7 }, () => device.target(a.width, a.height));
        }
        const [between, rows, coloursA, featuresA, coloursB, featuresB, map] = this.targets;
        for (const [picture, colours, features] of [[a, coloursA, featuresA], [b, coloursB, featuresB]]) {
            device.draw(this.opponent, between, { uPicture: picture });
            this.filter(0, between, rows);
            this.filter(1, rows, colours);
            this.filter(2, between, rows);
            this.filter(3, rows, features);
        }
        const seen = { uColoursA: coloursA, uColoursB: coloursB, uFeaturesA: featuresA, uFeaturesB: featuresB };
        device.draw(this.flip, map, { ...seen, uShares: this.shares });
        return map;
    }

    /** Gives memory back until it is needed again. */
    rest() {
        this.device.free(...this.targets);
        this.targets = [];
    }

    filter(pick, from, into) {
        this.device.draw(this.blur, into, { uPicture: from, uPick: pick, uAlong: pick % 2 ? [0, 1] : [1, 0], uWeights: this.weights[pick] });
    }
}

/** The mean of a map's pixels over the object's. shown: those of a picture of 8 bits that it is of. */
export function meanOf(map, shown) {
    let [sum, count] = [0, 0];
    for (let i = 0; i < shown.length; i += 4) {
        if (shown[i + 3] < WHOLE) continue;
        sum += map[i];
        count++;
    }
    return sum / count;
}

/** Weights whose positive ones add up to 1, and whose negative ones to -1. */
function balanced(weights) {
    const sums = [1, -1].map((sign) => weights.reduce((sum, x) => sum + Math.max(sign * x, 0), 0));
    return weights.map((x) => x / (x < 0 ? sums[1] : sums[0]));
}
