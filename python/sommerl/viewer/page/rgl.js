/**
 * RGL's .bsdf files (Dupuy & Jakob 2018), isotropic, RGB or spectral, and their evaluation: formats/rgl.py has the formulas
 * and the names. brdf.glsl calculates the same.
 */
import { expect, latin, viewOf } from "./bytes.js";

export const SMALLEST_COSINE = 0.01; // that stored products of f_r and a cosine are divided by
const NORMAL = 1e-14; // viewers with a smaller sin² θ are at the normal, and have no azimuth
const NORMAL_POINTS = 512; // lights for which the reflectance to the normal is tabulated
const AZIMUTHS = 64; // and over which it is averaged
const NORMAL_END = Math.SQRT2; // 1 / u_θ of the half vector between the normal and the horizon
const LARGEST_SIDE = 4096; // of any grid in a file
const LARGEST = 1e30;
const MAGIC = "tensor_file\0";
const BYTES = [0, 1, 1, 2, 2, 4, 4, 8, 8, 2, 4, 8]; // of the container's types, by number
const [U8, F32] = [1, 10];
const [MOST_FIELDS, LONGEST_NAME, MOST_AXES] = [64, 256, 8];

/** f_r [1/sr] for directions above the horizon. The file's incident direction is the viewer's. */
export function evaluateRgl(material, wi, wo) {
    if (wo[0] * wo[0] + wo[1] * wo[1] >= NORMAL) return raw(material, wo, wi);
    const [i, t] = cell(unit(0.5 * elevation(wi)) * NORMAL_END, NORMAL_POINTS);
    const cosine = Math.max(wi[2], SMALLEST_COSINE);
    const { atNormal } = material;
    return [0, 1, 2].map((c) => (atNormal[3 * i + c] + t * (atNormal[3 * i + 3 + c] - atNormal[3 * i + c])) / cosine);
}

/** f_r with `wi` as the file's incident direction. */
function raw(material, wi, wo) {
    const { shapes, jacobian, ndf, sigma, rgb } = material;
    const [mx, my, mz] = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
    const thetaI = elevation(wi);
    const uTheta = unit(Math.atan2(Math.sqrt(mx * mx + my * my), mz));
    const turns = Math.atan2(wi[0] * my - wi[1] * mx, wi[0] * mx + wi[1] * my) / (2 * Math.PI) + 0.5;
    const uPhi = turns - Math.floor(turns);
    const about = between(material.thetaI, thetaI);
    const corners = cornersOf(...unwarped(material, uTheta, uPhi, about), shapes.rgb);
    let factor = 1 / Math.max(wo[2], SMALLEST_COSINE);
    if (jacobian) {
        const density = blend(ndf, 0, cornersOf(uTheta, uPhi, shapes.ndf));
        factor *= density / (4 * Math.max(blend(sigma, 0, cornersOf(unit(thetaI), 0.5, shapes.sigma)), 1e-30));
    }
    const side = shapes.rgb[0] * shapes.rgb[1];
    return [0, 1, 2].map((c) => factor * about.reduce((sum, [k, w]) => sum + w * blend(rgb, (3 * k + c) * side, corners), 0));
}

/** The incident elevations on either side of one: [number, weight]. */
function between(angles, theta) {
    if (angles.length === 1) return [[0, 1]];
    let lower = 0;
    while (lower + 2 < angles.length && theta >= angles[lower + 1]) lower++;
    const t = Math.min(Math.max((theta - angles[lower]) / (angles[lower + 1] - angles[lower]), 0), 1);
    return [[lower, 1 - t], [lower + 1, t]];
}

/** The point of the unit square that the warp takes to (u, v). */
function unwarped({ shapes, density, rows, columns }, u, v, about) {
    const [height, width] = shapes.vndf;
    const [i, s] = cell(u, width);
    const [j, t] = cell(v, height);
    const mixed = (values, offset, size) => about.reduce((sum, [k, w]) => sum + w * values[k * size + offset], 0);
    const inRow = (values, column) => {
        const [a, b] = [j, j + 1].map((row) => mixed(values, row * width + column, height * width));
        return a + t * (b - a);
    };
    const x = inRow(rows, i) + segment(s, inRow(density, i), inRow(density, i + 1), width);
    const y = mixed(columns, j, height);
    const [end0, end1] = [j, j + 1].map((row) => mixed(rows, row * width + width - 1, height * width));
    return [x / Math.max(end0 + t * (end1 - end0), 1e-30), y + segment(t, end0, end1, height)];
}

function elevation(w) {
    return Math.atan2(Math.sqrt(w[0] * w[0] + w[1] * w[1]), w[2]);
}

/** An elevation [rad] as the square root of its share of π/2. */
function unit(theta) {
    return Math.sqrt((2 * theta) / Math.PI);
}

/** The integral of a density that runs from a to b between two neighbours of `points` points, up to the share t. */
function segment(t, a, b, points) {
    return (t * (a + 0.5 * t * (b - a))) / (points - 1);
}

/** Of `points` points spread over [0, 1], the one at or below x, and the share of the way to the next. */
function cell(x, points) {
    const place = Math.min(Math.max(x, 0), 1) * (points - 1);
    const below = Math.min(Math.floor(place), points - 2);
    return [below, place - below];
}

/** The four points around (x, y) in the unit square of a grid [h, w]: [number, weight]. */
function cornersOf(x, y, [height, width]) {
    const [i, s] = cell(x, width);
    const [j, t] = cell(y, height);
    const at = j * width + i;
    return [[at, (1 - s) * (1 - t)], [at + 1, s * (1 - t)], [at + width, (1 - s) * t], [at + width + 1, s * t]];
}

function blend(values, offset, corners) {
    return corners.reduce((sum, [at, weight]) => sum + weight * values[offset + at], 0);
}

/** The material in a file's bytes. Throws an Error. */
export function readRgl(bytes) {
    const file = new TensorFile(bytes);
    const colours = file.fields.has("rgb") ? "rgb" : "spectra";
    const wavelengths = colours === "rgb" ? null : file.floats("wavelengths", [null]);
    const [thetaI, phiI] = [file.floats("theta_i", [null]), file.floats("phi_i", [null])];
    const [n, azimuths] = [thetaI.length, phiI.length];
    if (azimuths > 2) throw new Error(`phi_i: expected an isotropic material with one angle, found ${azimuths} angles (anisotropic)`);
    const grids = { ndf: [], sigma: [], vndf: [azimuths, n], [colours]: [azimuths, n, wavelengths?.length ?? 3] };
    const found = Object.entries(grids).map(([name, axes]) => [name, file.floats(name, [...axes, null, null])]);
    const whole = Object.fromEntries(found);
    const first = (name) => whole[name].subarray(0, whole[name].length / azimuths);
    const repeats = (name) => first(name).every((x, i) => x === whole[name][i + whole[name].length / 2]);
    expect(azimuths === 1 || (repeats("vndf") && repeats(colours)), "phi_i: expected an isotropic material (one angle), found 2 angles");
    const rises = thetaI.every((angle, i) => (i ? angle > thetaI[i - 1] : angle >= 0)) && thetaI.at(-1) < 1.6;
    expect(rises, "theta_i: expected angles that increase from 0 to π/2, found others");
    for (const name of ["vndf", "ndf", "sigma"]) {
        const fine = whole[name].every((x) => x >= 0) && whole[name].some((x) => x > 0);
        expect(fine, `${name}: expected no negative values, and some above 0, found others`);
    }
    const { density, rows, columns } = cumulated(first("vndf"), n, file.shape("vndf"));
    const bounded = whole[colours].every((x) => Math.abs(x) <= LARGEST);
    expect(bounded, `${colours}: expected values from -1e30 to 1e30, found others`);
    const jacobian = file.field("jacobian");
    expect(jacobian.type === U8 && String(jacobian.shape) === "1", "jacobian: expected one byte, found another field");
    const shapes = Object.fromEntries(["vndf", "ndf", "sigma"].map((name) => [name, file.shape(name)]));
    shapes.rgb = file.shape(colours);
    const material = {
        kind: "rgl",
        interpolation: "trilinear",
        thetaI,
        shapes,
        density,
        rows,
        columns,
        rgb: wavelengths ? converted(first(colours), n, wavelengths) : first(colours),
        ndf: whole.ndf,
        sigma: whole.sigma,
        jacobian: bytes[jacobian.offset] !== 0,
    };
    return { ...material, atNormal: meanAtNormal(material) };
}

/**
 * A density on n grids of the unit square, made to integrate to 1 by bilinear interpolation; its integral along each row up
 * to each point, and over the rows up to each row.
 */
function cumulated(values, n, [height, width]) {
    const size = height * width;
    const [density, rows, columns] = [n * size, n * size, n * height].map((count) => new Float64Array(count));
    for (let k = 0; k < n; k++) {
        for (let j = 0; j < height; j++) {
            const at = k * size + j * width;
            for (let i = 1; i < width; i++) rows[at + i] = rows[at + i - 1] + (0.5 / (width - 1)) * (values[at + i] + values[at + i - 1]);
            const [end, before] = [rows[at + width - 1], j && rows[at - 1]];
            if (j) columns[k * height + j] = columns[k * height + j - 1] + (0.5 / (height - 1)) * (end + before);
        }
        const total = columns[k * height + height - 1];
        expect(total > 0, "vndf: expected a density for each theta_i, found zeros alone");
        for (let i = k * size; i < (k + 1) * size; i++) [density[i], rows[i]] = [values[i] / total, rows[i] / total];
        for (let j = k * height; j < (k + 1) * height; j++) columns[j] /= total;
    }
    return { density, rows, columns };
}

/** f_r cos θ_i for a viewer at the normal, the mean over azimuths, for NORMAL_POINTS lights. */
function meanAtNormal(material) {
    const found = new Float64Array(3 * NORMAL_POINTS);
    const viewer = [Math.sin(1e-9), 0, 1];
    for (let i = 0; i < NORMAL_POINTS; i++) {
        const theta = (i / (NORMAL_POINTS - 1) / NORMAL_END) ** 2 * Math.PI;
        for (let a = 0; a < AZIMUTHS; a++) {
            const phi = ((a + 0.5) / AZIMUTHS) * 2 * Math.PI;
            const light = [Math.sin(theta) * Math.cos(phi), Math.sin(theta) * Math.sin(phi), Math.cos(theta)];
            const weight = Math.max(light[2], SMALLEST_COSINE) / AZIMUTHS;
            raw(material, viewer, light).forEach((x, c) => (found[3 * i + c] += x * weight));
        }
    }
    return found;
}

/** Named arrays, laid out as formats/tensor.py says. All sizes are checked against the file's before an array is made. */
class TensorFile {
    constructor(bytes) {
        this.bytes = bytes;
        this.view = viewOf(bytes);
        this.fields = new Map();
        let at = 0;
        const take = (count) => {
            expect(at + count <= bytes.length, `header: expected ${count} more bytes, found ${bytes.length - at}: the file is cut off`);
            at += count;
            return at - count;
        };
        const whole = (start) => Number(this.view.getBigUint64(start, true));
        const text = (start, count) => latin(bytes.subarray(start, start + count));
        expect(text(take(12), 12) === MAGIC, "expected a tensor file, found another kind");
        const version = this.view.getUint16(take(2), true);
        expect(version === 1, `version: expected 1.0, found ${version & 255}.${version >> 8}`);
        const count = this.view.getUint32(take(4), true);
        expect(count >= 1 && count <= MOST_FIELDS, `number of fields: expected 1 to ${MOST_FIELDS}, found ${count}`);
        for (let i = 0; i < count; i++) {
            const length = this.view.getUint16(take(2), true);
            expect(length >= 1 && length <= LONGEST_NAME, `expected field names of 1 to ${LONGEST_NAME} bytes, found ${length}`);
            const name = text(take(length), length);
            expect(/^[ -~]*$/.test(name), "expected field names in ASCII, found others");
            const axes = this.view.getUint16(take(2), true);
            const type = bytes[take(1)];
            const offset = whole(take(8));
            expect(type >= 1 && type < BYTES.length, `${name}: expected a type of 1 to ${BYTES.length - 1}, found ${type}`);
            expect(axes <= MOST_AXES, `${name}: expected at most ${MOST_AXES} axes, found ${axes}`);
            const shape = Array.from({ length: axes }, () => whole(take(8)));
            expect(!this.fields.has(name), `${name}: expected one field of that name, found two`);
            this.fields.set(name, { type, shape, offset });
        }
        for (const [name, { type, shape, offset }] of this.fields) {
            const size = shape.reduce((product, n) => product * n, BYTES[type]);
            const within = offset >= at && offset + size <= bytes.length;
            expect(within, `${name}: expected data within ${bytes.length} bytes, found ${size} bytes from byte ${offset}`);
        }
    }

    field(name) {
        expect(this.fields.has(name), `expected a field ${name}, found ${[...this.fields.keys()].join(", ")}`);
        return this.fields.get(name);
    }

    /** Height and width. */
    shape(name) {
        return this.field(name).shape.slice(-2);
    }

    /** Single-precision numbers of a field; null in its expected shape is for any length of a side. */
    floats(name, expected) {
        const { type, shape, offset } = this.field(name);
        const least = expected.length === 1 ? 1 : 2;
        const fits = (n, i) => (expected[i] === null ? n >= least && n <= LARGEST_SIDE : n === expected[i]);
        const fine = type === F32 && shape.length === expected.length && shape.every(fits);
        const wanted = expected.map((n) => n ?? "n").join(" × ");
        expect(fine, `${name}: expected float32 of shape ${wanted}, found type ${type} of shape ${shape.join(" × ") || "1"}`);
        const count = shape.reduce((product, n) => product * n, 1);
        const start = this.bytes.byteOffset + offset;
        const numbers = new Float32Array(this.bytes.buffer.slice(start, start + 4 * count));
        expect(numbers.every(Number.isFinite), `${name}: expected finite numbers, found NaN or infinity`);
        return numbers;
    }
}

/** Linear sRGB of spectra, [n][wavelengths][…]. */
function converted(spectra, n, wavelengths) {
    const rises = wavelengths.every((x, i) => (i ? x > wavelengths[i - 1] : x > 200 && x < 1000)) && wavelengths.length > 1;
    expect(rises, "wavelengths: expected an increasing series in nanometres, found others");
    const weights = srgbWeights(wavelengths);
    const size = spectra.length / n / wavelengths.length;
    const found = new Float64Array(3 * n * size);
    for (let k = 0; k < n; k++) {
        for (let w = 0; w < wavelengths.length; w++) {
            const from = (k * wavelengths.length + w) * size;
            for (let c = 0; c < 3; c++) {
                for (let i = 0; i < size; i++) found[(3 * k + c) * size + i] += weights[c][w] * spectra[from + i];
            }
        }
    }
    return found;
}

/** What each wavelength contributes to r, g and b; see formats/spectra.py. */
function srgbWeights(wavelengths) {
    return RESPONSE.map((response) => {
        const weights = new Float64Array(wavelengths.length);
        for (let nm = 380; nm <= 780; nm++) {
            const at = Math.min(Math.floor((nm - 380) / 5), response.length - 2);
            const here = response[at] + ((nm - 380) / 5 - at) * (response[at + 1] - response[at]);
            let i = 0;
            while (i + 2 < wavelengths.length && wavelengths[i + 1] <= nm) i++;
            const t = Math.min(Math.max((nm - wavelengths[i]) / (wavelengths[i + 1] - wavelengths[i]), 0), 1);
            weights[i] += (1 - t) * here;
            weights[i + 1] += t * here;
        }
        const total = weights.reduce((sum, x) => sum + x, 0);
        return weights.map((x) => x / total);
    });
}

// 10⁵ × the contribution of each nanometre to r, g and b of a reflectance under D65, every 5 nm from 380: spectra.py's.
const RESPONSE = [
    [
        547, 934, 1845, 4163, 9346, 15846, 30933, 55199, 94984, 142061, 173342, 207952, 220501, 202941, 163326, 99315, 19925,
        -68032, -161727, -253441, -339095, -403751, -461285, -543017, -637732, -744096, -838525, -901615, -917676, -897477,
        -825229, -692072, -529122, -343192, -127176, 115164, 373874, 643552, 916380, 1201912, 1478612, 1672179, 1814157,
        1991713, 2105364, 2138839, 2099107, 1982051, 1811848, 1570770, 1319720, 1123952, 936580, 741198, 571191, 442249,
        334462, 249288, 182227, 129487, 92922, 61832, 40209, 28443, 20672, 15043, 10941, 7099, 4539, 3424, 2557, 1842, 1317,
        839, 537, 328, 196, 169, 141, 97, 67,
    ],
    [
        -466, -796, -1579, -3577, -8071, -13763, -27079, -48748, -84791, -128915, -160611, -198784, -220094, -217674, -200317,
        -162618, -111410, -45413, 37838, 127506, 221412, 305161, 389713, 501136, 633723, 791637, 959990, 1123828, 1263051,
        1391407, 1486077, 1503807, 1490800, 1470381, 1424369, 1332178, 1221222, 1094705, 954830, 818896, 674559, 508939,
        357201, 236470, 131585, 42613, -23636, -68453, -93931, -101849, -98778, -93226, -83720, -69983, -56017, -44605,
        -34421, -25991, -19197, -13753, -9946, -6665, -4350, -3084, -2244, -1633, -1188, -771, -493, -372, -278, -200, -143,
        -91, -58, -36, -21, -18, -15, -11, -7,
    ],
    [
        3257, 5577, 11071, 25136, 56735, 97007, 191711, 346847, 609361, 945080, 1212635, 1568529, 1847465, 1992396, 2086584,
        2057502, 1971804, 1777320, 1471305, 1186360, 917543, 659414, 464523, 331937, 229657, 145361, 66448, -4412, -58127,
        -95723, -124419, -143046, -155129, -163541, -166998, -163581, -156876, -147679, -136350, -125391, -113055, -96501,
        -80667, -69212, -58538, -48239, -39356, -31450, -24844, -19036, -14368, -11105, -8501, -6265, -4573, -3386, -2474,
        -1802, -1293, -904, -639, -420, -271, -191, -138, -101, -73, -48, -30, -23, -17, -12, -9, -6, -4, -2, -1, -1, -1, -1,
        0,
    ],
];
