/**
 * The stream of nodes in a material file: docs/format.md, "Kind 1", whose letters these are. All numbers of the range
 * decoder are whole ones below 2^53, so that doubles hold them.
 */
const FINE = 180;

/** {lattice: {thetaH, band, thetaD, phiD}, gainCodes, shapeCodes, gainIndex, index}. Throws an Error. */
export function readNodes(bytes) {
    const coder = new Decoder(bytes);
    const lattice = readLattice(coder);
    const [gainCodes, shapeCodes] = readPalette(coder);
    const { band, thetaD, phiD } = lattice;
    const places = [gainCodes.map((c) => c / 128), ...[0, 1].map((axis) => shapeCodes.map((c) => c[axis] / 64))];
    const gains = new Entries(places[0], places[0].map(() => 0));
    const shapes = new Entries(places[1], places[2]);
    const model = new Model(lattice, places);
    const size = band.reduce((sum, b) => sum + thetaD[b].length * phiD[b].length, 0);
    const [gainIndex, index] = [new Uint16Array(size), new Uint16Array(size)];
    for (let row = 0, i = 0; row < band.length; row++) {
        model.begin(row);
        const [width, height] = [phiD[band[row]].length, thetaD[band[row]].length];
        for (let at = 0; at < width * height; at++, i++) {
            const [gain, first, second] = model.expect(Math.floor(at / width), at % width);
            gainIndex[i] = coder.pick(gains.weigh(...gain, 0, 0));
            index[i] = coder.pick(shapes.weigh(...first, ...second));
            gains.learn(gainIndex[i]);
            shapes.learn(index[i]);
            model.learn(at, [gainIndex[i], index[i], index[i]].map((entry, c) => places[c][entry]));
        }
    }
    coder.checkEnd();
    return { lattice, gainCodes, shapeCodes, gainIndex, index };
}

class Decoder {
    constructor(bytes) {
        [this.bytes, this.read, this.range, this.code] = [bytes, 0, 2 ** 32 - 1, 0];
        for (let i = 0; i < 4; i++) this.code = 256 * this.code + this.next();
    }

    next() {
        return this.bytes[this.read++] ?? 0;
    }

    pick(weights) {
        let total = 0;
        for (const weight of weights) total += weight;
        const share = Math.floor(this.range / total);
        const at = Math.floor(this.code / share);
        bounded("code", at, 0, total - 1);
        let [symbol, below] = [0, 0];
        while (below + weights[symbol] <= at) below += weights[symbol++];
        this.code -= share * below;
        this.range = share * weights[symbol];
        while (this.range < 2 ** 24) {
            this.range *= 256;
            this.code = 256 * this.code + this.next();
        }
        return symbol;
    }

    bit(context, i) {
        const one = context[i];
        const bit = this.pick([4096 - one, one]);
        context[i] = bit ? one + ((4096 - one) >> 4) : one - (one >> 4);
        return bit;
    }

    number(context) {
        let [n, x] = [0, 1];
        while (n < 20 && this.bit(context, n)) n++;
        for (let i = n - 1; i >= 0; i--) {
            x = 2 * x + (i === n - 1 && i < 4 ? this.bit(context, 20 + i) : this.pick([2048, 2048]));
        }
        return x - 1;
    }

    signed(context) {
        const x = this.number(context);
        return x % 2 ? -(x + 1) / 2 : x / 2;
    }

    checkEnd() {
        let window = 0;
        for (let i = this.read - 4; i < this.read; i++) window = 256 * window + (this.bytes[i] ?? 0);
        const low = (window - this.code + 2 ** 32) % 2 ** 32;
        const last = low + this.range - 1;
        let k = 32;
        while (last - (last % 2 ** k) < low) k--;
        const roundest = (last - (last % 2 ** k)) % 2 ** 32;
        if (roundest !== window || this.bytes.length > this.read || this.bytes.at(-1) === 0) {
            throw new Error("expected a stream of nodes that ends with the file, found another");
        }
    }
}

function bounded(what, value, least, most) {
    if (!(value >= least && value <= most)) throw new Error(`${what}: expected ${least} to ${most}, found ${value}`);
    return value;
}

const context = () => new Array(24).fill(2048);

function readLattice(coder) {
    const [counts, h, d, p] = [context(), context(), context(), context()];
    const bands = bounded("bands", 1 + coder.number(counts), 1, 16);
    const thetaH = readAxis(coder, counts, h, [FINE]);
    const band = [];
    for (let b = 0; b < bands; b++) {
        const left = thetaH.length - band.length;
        const rows = bounded("rows of a band", b + 1 < bands ? 1 + coder.number(counts) : left, 1, left);
        for (let i = 0; i < rows; i++) band.push(b);
    }
    const [thetaD, phiD] = [[], []];
    for (let b = 0; b < bands; b++) {
        thetaD.push(readAxis(coder, counts, d, [FINE]));
        phiD.push(readAxis(coder, counts, p, []));
    }
    bounded("nodes", band.reduce((sum, b) => sum + thetaD[b].length * phiD[b].length, 0), 1, 2 ** 17);
    return { thetaH, band, thetaD, phiD };
}

function readAxis(coder, counts, steps, end) {
    const places = [0];
    for (let i = coder.number(counts); i > 0; i--) {
        places.push(bounded("axis", places.at(-1) + 1 + coder.number(steps), 1, FINE - 1));
    }
    return [...places, ...end];
}

function readPalette(coder) {
    const [counts, s, u, v] = [context(), context(), context(), context()];
    const gains = bounded("gains", 1 + coder.number(counts), 1, 1024);
    const shapes = bounded("shapes", 1 + coder.number(counts), 1, 1024);
    const [gainCodes, shapeCodes] = [[], []];
    for (let i = 0; i < gains; i++) {
        gainCodes.push(bounded("gain", (gainCodes.at(-1) ?? -1) + 1 + coder.number(s), 0, 4095));
    }
    for (let i = 0, [first, second] = [-1024, 0]; i < shapes; i++) {
        first = bounded("shape", first + coder.number(u), -1024, 1024);
        second = bounded("shape", second + coder.signed(v), -1024, 1024);
        shapeCodes.push([first, second]);
    }
    return [gainCodes, shapeCodes];
}

/** Expects the three coordinates of nodes, one node after the other. */
class Model {
    constructor(lattice, places) {
        this.lattice = lattice;
        this.predictors = places.map((values) => new Predictor(values));
        this.present = this.above = this.higher = null;
    }

    /** A plane is [values, errors], of each [c][node of a row]. */
    begin(row) {
        const { band, thetaD, phiD } = this.lattice;
        [this.row, this.phiD] = [row, phiD[band[row]]];
        [this.width, this.height] = [this.phiD.length, thetaD[band[row]].length];
        [this.higher, this.above] = [this.above, this.present];
        if (row > 0 && band[row - 1] !== band[row]) {
            this.above = this.moved(this.above, band[row - 1], band[row]);
            if (row > 1) this.higher = this.moved(this.higher, band[row - 1], band[row]);
        }
        const size = this.width * this.height;
        this.present = [0, 1].map(() => [0, 1, 2].map(() => new Float64Array(size)));
    }

    moved(plane, from, to) {
        const { thetaD, phiD } = this.lattice;
        const width = phiD[from].length;
        const ways = thetaD[to].flatMap((y) =>
            phiD[to].map((x) => [...between(thetaD[from], thetaD[from].length, y), ...around(phiD[from], x)]),
        );
        const blend = (a) => ([d0, d1, v, p0, p1, u]) => {
            const low = a[d0 * width + p0] * (1 - u) + a[d0 * width + p1] * u;
            const high = a[d1 * width + p0] * (1 - u) + a[d1 * width + p1] * u;
            return low * (1 - v) + high * v;
        };
        return plane.map((grids) => grids.map((a) => Float64Array.from(ways, blend(a))));
    }

    /** For each coordinate [predicted, s]. */
    expect(d, p) {
        const { phiD, width } = this;
        const m = FINE - phiD[p];
        const mirror = p > 0 && m <= phiD[p - 1] ? between(phiD, p, m) : null;
        const at = d * width + p;
        return this.predictors.map((predictor, c) => {
            const errors = [];
            if (p > 0) errors.push(this.present[1][c][at - 1]);
            if (d > 0) errors.push(this.present[1][c][at - width]);
            if (this.row > 0) errors.push(this.above[1][c][at]);
            return predictor.predict(...this.neighbours(c, d, p, mirror), errors);
        });
    }

    neighbours(c, d, p, mirror) {
        const { width } = this;
        const [now, above, higher] = [this.present, this.above, this.higher].map((plane) => plane?.[0][c]);
        const [line, at, under] = [d * width, d * width + p, this.row > 0];
        const [west, east] = [line + ((p + width - 1) % width), line + ((p + 1) % width)];
        let up = p > 0 ? now[at - 1] : d > 0 ? now[at - width] : 0;
        if (p > 0 && d > 0) up = 0.5 * (now[at - 1] + now[at - width]);
        if (under) up = above[at];
        let news = 0;
        if (mirror) {
            const [q0, q1, u] = mirror;
            const before = under ? above[line + q0] * (1 - u) + above[line + q1] * u : up;
            news = now[line + q0] * (1 - u) + now[line + q1] * u - before;
        }
        const values = [
            p > 0 ? now[at - 1] : under ? above[west] : up,
            d > 0 ? now[at - width] : up,
            d > 0 ? now[west - width] : up,
            d > 0 ? now[east - width] : up,
            under ? above[west] : up,
            under && d > 0 ? above[at - width] : up,
            under ? above[east] : up,
            under && d + 1 < this.height ? above[at + width] : up,
            this.row > 1 ? higher[at] : up,
            up + news,
        ];
        return [up, values];
    }

    learn(at, values) {
        values.forEach((value, c) => {
            this.present[0][c][at] = value;
            this.present[1][c][at] = this.predictors[c].learn(value);
        });
    }
}

class Predictor {
    constructor(values) {
        const mean = sum(values) / values.length;
        const variance = sum(values.map((value) => (value - mean) * (value - mean))) / values.length + 1e-4;
        this.w = [0.5, 0.5, 0, 0, -0.5, -0.5, 0, 0, 0, 0];
        this.matrix = this.w.map((_, i) => Float64Array.from(this.w, (_, j) => (i === j ? 25 / variance : 0)));
        this.level = 0.15 * Math.sqrt(variance);
    }

    predict(up, values, errors) {
        this.x = values.map((value) => value - up);
        this.predicted = this.x.reduce((found, x, i) => found + this.w[i] * x, up);
        const total = errors.reduce((found, error) => found + error, 0.7 * this.level);
        const count = errors.reduce((found) => found + 1, 0.7);
        return [this.predicted, 1 / (total / count + 0.02 * this.level + 1e-4)];
    }

    learn(value) {
        const { matrix, w, x } = this;
        const error = value - this.predicted;
        const g = new Float64Array(10);
        for (let i = 0; i < 10; i++) for (let j = 0; j < 10; j++) g[j] += matrix[i][j] * x[i];
        let power = 1;
        for (let i = 0; i < 10; i++) power += g[i] * x[i];
        const r = 1 / power;
        for (let i = 0; i < 10; i++) {
            w[i] += g[i] * r * error;
            for (let j = 0; j < 10; j++) matrix[i][j] = (matrix[i][j] - g[i] * g[j] * r) * 1.0005;
        }
        this.level = 0.98 * this.level + 0.02 * Math.abs(error);
        return Math.abs(error);
    }
}

/** Entries of a palette, and how likely each is. */
class Entries {
    constructor(first, second) {
        [this.first, this.second, this.narrow] = [first, second, 0.5];
        this.before = new Uint16Array(4098); // entries whose step is below
        for (const place of first) this.before[step(place) + 1]++;
        for (let i = 1; i < this.before.length; i++) this.before[i] += this.before[i - 1];
        [this.counts, this.roots] = [first.map(() => 1), first.map(() => 1)];
        this.weights = new Uint32Array(first.length);
        [this.near, this.far] = [new Float64Array(first.length), new Float64Array(first.length)];
    }

    weigh(p0, s0, p1, s1) {
        this.expected = [p0, s0, p1, s1];
        const reach = 16 / s0;
        const [first, end] = [this.before[step(p0 - reach)], this.before[step(p0 + reach) + 1]];
        const { near, far, weights } = this;
        for (let i = first; i < end; i++) [near[i], far[i]] = this.kernels(i);
        this.f = this.narrow / sum4(near, first, end);
        this.g = (1 - this.narrow) / sum4(far, first, end);
        const [f, g] = [this.f * 65536, this.g * 65536];
        weights.fill(1);
        for (let i = first; i < end; i++) weights[i] = 1 + ((near[i] * f + far[i] * g) >>> 0);
        return weights;
    }

    kernels(i) {
        const [p0, s0, p1, s1] = this.expected;
        let [x, y] = [(this.first[i] - p0) * s0, (this.second[i] - p1) * s1];
        [x, y] = [x * x, y * y];
        let a = (1 + x * 2.25) * (1 + y * 2.25);
        let b = (1 + x * 0.25) * (1 + y * 0.25);
        [a, b] = [a * a, b * b];
        const c = this.roots[i] / (a * b);
        return [c * b, c * a];
    }

    learn(i) {
        let [near, far] = this.kernels(i);
        [near, far] = [near * this.f, far * this.g];
        this.narrow = 0.96 * (near / (near + far)) + 0.02;
        this.roots[i] = Math.sqrt(++this.counts[i]);
    }
}

/** Of the first `length` nodes of an axis, those on either side of a place, and the way to the second. */
function between(axis, length, place) {
    let i = 0;
    while (i + 1 < length && axis[i + 1] <= place) i++;
    return i + 1 === length ? [i, i, 0] : [i, i + 1, (place - axis[i]) / (axis[i + 1] - axis[i])];
}

function around(axis, place) {
    const last = axis.length - 1;
    if (place < axis[last]) return between(axis, axis.length, place);
    return [last, 0, (place - axis[last]) / (FINE - axis[last])];
}

function step(place) {
    const at = place * 64 + 2048;
    return at > 0 ? Math.floor(Math.min(at, 4096)) : 0;
}

function sum(values) {
    return values.reduce((found, value) => found + value, 0);
}

function sum4(values, first, end) {
    const lanes = [0, 0, 0, 0];
    for (let i = first; i < end; i++) lanes[(i - first) & 3] += values[i];
    return lanes[0] + lanes[1] + (lanes[2] + lanes[3]) + 1e-300;
}
