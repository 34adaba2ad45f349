/** Environments in images of high dynamic range: Radiance .hdr and OpenEXR. Sizes are checked before memory is taken. */
import { expect, half, inflated, latin, viewOf } from "./bytes.js";

const [MOST_PIXELS, LONGEST_SIDE] = [2 ** 25, 8192];
const BRIGHTEST = 65504; // in the place of infinity, which halves become where they overflow
const COMPRESSIONS = ["none", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB"];
const LINES = { none: 1, ZIPS: 1, ZIP: 16 }; // in a block
const BYTES = [4, 2, 4]; // of OpenEXR's types: uint, half, float
const DEEPEST = 1032; // bytes that a deflated one can stand for

/** {width, height, pixels: Float32Array of RGB, from the top}. Throws an Error of one sentence. */
export async function readEnvironment(arrayBuffer) {
    const bytes = new Uint8Array(arrayBuffer);
    const start = latin(bytes.subarray(0, 11));
    let found = null;
    if (start.startsWith("v/1\x01")) found = await readExr(bytes);
    if (start.startsWith("#?RADIANCE") || start.startsWith("#?RGBE")) found = readHdr(bytes);
    expect(found, "expected an image of high dynamic range (.hdr or .exr), found another kind");
    const { pixels } = found;
    let black = true;
    for (let i = 0; i < pixels.length; i++) {
        pixels[i] = pixels[i] > 0 ? (pixels[i] < Infinity ? pixels[i] : BRIGHTEST) : 0;
        black &&= pixels[i] === 0;
    }
    expect(!black, "expected an image with light in it, found a black one");
    return found;
}

/** Lines, from the top, of three mantissas and a common exponent a pixel (Ward 1991), most often run-length encoded. */
function readHdr(bytes) {
    const head = latin(bytes.subarray(0, 2 ** 16));
    const size = /\n-Y (\d{1,9}) \+X (\d{1,9})\n/.exec(head);
    const known = size && /\nFORMAT=32-bit_rle_rgbe\s*\n/.test(head.slice(0, size.index + 1));
    expect(known, "expected lines with a format and a size like -Y 512 +X 1024, found others");
    const [height, width] = [Number(size[1]), Number(size[2])];
    let at = size.index + size[0].length;
    const encoded = width >= 8 && width < 2 ** 15 && bytes[at] === 2 && bytes[at + 1] === 2;
    // A run of 127 takes two bytes.
    checkSize(width, height, (encoded ? 64 : 1) * (bytes.length - at) >= 4 * width * height);
    const pixels = new Float32Array(3 * width * height);
    const line = new Uint8Array(4 * width);
    for (let y = 0; y < height; y++) {
        const [step, channel] = encoded ? [1, width] : [4, 1];
        at = encoded ? readLine(bytes, at, width, line) : at + 4 * width;
        if (!encoded) line.set(bytes.subarray(at - 4 * width, at));
        for (let x = 0; x < width; x++) {
            const exponent = line[x * step + 3 * channel];
            if (!exponent) continue;
            for (let c = 0; c < 3; c++) pixels[3 * (y * width + x) + c] = line[x * step + c * channel] * 2 ** (exponent - 136);
        }
    }
    return { width, height, pixels };
}

/** Decodes a line, channel after channel. Returns the position after it. */
function readLine(bytes, at, width, line) {
    const fine = bytes[at] === 2 && bytes[at + 1] === 2 && bytes[at + 2] * 256 + bytes[at + 3] === width;
    expect(fine, "expected lines of one width, found a damaged one");
    at += 4;
    for (let channel = 0; channel < 4; channel++) {
        for (let x = 0; x < width; ) {
            const run = bytes[at] > 128;
            const count = run ? bytes[at] - 128 : bytes[at];
            const end = at + (run ? 2 : 1 + count);
            expect(count > 0 && count <= width - x && end <= bytes.length, "expected runs that make up a line, found others");
            if (run) line.fill(bytes[at + 1], channel * width + x, channel * width + x + count);
            else line.set(bytes.subarray(at + 1, end), channel * width + x);
            [x, at] = [x + count, end];
        }
    }
    return at;
}

/** One part of scan lines, not compressed or deflated. */
async function readExr(bytes) {
    const view = viewOf(bytes);
    const whole = (at) => expect(at >= 0 && at <= bytes.length, "expected a whole file, found one that is cut off");
    expect(bytes.length >= 8 && view.getUint8(4) === 2 && (view.getUint32(4, true) & 0x1a00) === 0, "expected OpenEXR 2 with one part of scan lines, found another kind");
    const attributes = {};
    let at = 8;
    const word = () => {
        const end = bytes.subarray(0, at + 256).indexOf(0, at);
        expect(end >= 0, "expected a head of attributes, found one that is cut off");
        const found = latin(bytes.subarray(at, end));
        at = end + 1;
        return found;
    };
    for (let name = word(); name; name = word()) {
        word(); // its type
        whole(at + 4);
        const size = view.getInt32(at, true);
        expect(size >= 0, "expected a head of attributes, found a damaged one");
        whole(at + 4 + size);
        attributes[name] = bytes.subarray(at + 4, at + 4 + size);
        at += 4 + size;
    }
    const box = attributes.dataWindow;
    expect(box?.length === 16 && attributes.compression?.length === 1, "expected a data window and a compression, found none");
    const [x0, y0, x1, y1] = [0, 4, 8, 12].map((i) => viewOf(box).getInt32(i, true));
    const [width, height] = [x1 - x0 + 1, y1 - y0 + 1];
    const compression = COMPRESSIONS[attributes.compression[0]] ?? "unknown";
    const lines = LINES[compression];
    expect(lines, `expected an OpenEXR file without compression or with ZIP, found ${compression}: save it again`);
    const channels = channelsOf(attributes.channels ?? new Uint8Array());
    const stride = channels.reduce((sum, { size }) => sum + size, 0) * width;
    checkSize(width, height, (compression === "none" ? 1 : DEEPEST) * bytes.length >= stride * height);
    const blocks = Math.ceil(height / lines);
    whole(at + 8 * blocks);
    const pixels = new Float32Array(3 * width * height);
    for (let block = 0; block < blocks; block++) {
        const start = Number(view.getBigUint64(at + 8 * block, true));
        whole(start + 8);
        const [y, size] = [view.getInt32(start, true) - y0, view.getInt32(start + 4, true)];
        const count = Math.min(lines, height - y) * stride;
        expect(y >= 0 && y < height && size >= 0, "expected lines within the image, found others");
        whole(start + 8 + size);
        const given = bytes.subarray(start + 8, start + 8 + size);
        const data = size < count ? undone(await inflated(given, "deflate", count)) : given;
        expect(data.length === count, `expected ${count} bytes in a block, found ${data.length}`);
        unpack(viewOf(data), channels, width, pixels.subarray(3 * y * width, 3 * (y * width + (count / stride) * width)));
    }
    return { width, height, pixels };
}

/** In the order of the file: bytes a pixel, type, and which of R, G, B it is; Y is all three. */
function channelsOf(list) {
    const found = [];
    for (let at = 0; list[at]; at += 16) {
        const end = list.indexOf(0, at);
        expect(end > at && list.length >= end + 17 && found.length < 64, "expected a list of channels, found a damaged one");
        const name = latin(list.subarray(at, end));
        at = end + 1;
        const type = viewOf(list).getInt32(at, true);
        const sampling = [8, 12].map((offset) => viewOf(list).getInt32(at + offset, true));
        expect(type in BYTES && String(sampling) === "1,1", "expected channels of every pixel, found others");
        found.push({ size: BYTES[type], type, to: name === "Y" ? [0, 1, 2] : [0, 1, 2].filter((c) => "RGB"[c] === name) });
    }
    const seen = found.flatMap(({ to }) => to);
    expect(String(seen.sort()) === "0,1,2", "expected channels R, G, B, or Y alone, found others");
    return found;
}

function unpack(view, channels, width, pixels) {
    let at = 0;
    for (let first = 0; first < pixels.length; first += 3 * width) {
        for (const { size, type, to } of channels) {
            for (let x = 0; x < width; x++, at += size) {
                if (!to.length) continue;
                const value = type === 1 ? half(view.getUint16(at, true)) : type === 2 ? view.getFloat32(at, true) : view.getUint32(at, true);
                for (const c of to) pixels[first + 3 * x + c] = value;
            }
        }
    }
}

/** OpenEXR's bytes before compression: each is the difference to the one before, and halves of them are apart. */
function undone(bytes) {
    for (let i = 1; i < bytes.length; i++) bytes[i] = bytes[i - 1] + bytes[i] - 128;
    const middle = Math.ceil(bytes.length / 2);
    return bytes.map((_, i) => bytes[i % 2 ? middle + (i - 1) / 2 : i / 2]);
}

function checkSize(width, height, justified) {
    const fine = width >= 1 && height >= 1 && Math.max(width, height) <= LONGEST_SIDE && width * height <= MOST_PIXELS;
    const most = `1 to ${LONGEST_SIDE} pixels along each side and ${MOST_PIXELS} in all`;
    expect(fine, `expected ${most}, found ${width} × ${height}`);
    expect(justified, `expected data for ${width} × ${height} pixels, found a file that is cut off`);
}
