/**
 * The stream of nodes in a material file: docs/format.md, "Kind 1", whose letters these are. All numbers of the range
 * decoder are whole ones below 2^53, so that doubles hold them.
 */
const FINE = 180;
// Entries within reach, added up over all nodes: what the time grows with.
const [MOST_REACHED, REACHED_BY_ANY, REACHED_A_BYTE] = [2 ** 26, 2 ** 22, 2 ** 11];

/**
 * {lattice: {thetaH, band, thetaD, phiD, mirrored}, gainCodes, shapeCodes, gainIndex, index}. Throws an Error.
 * mirrored: of the lattice. version: of the stream, 1 or 2.
 */
export function readNodes(bytes, mirrored, version) {
    const coder = new Decoder(bytes);
    const lattice = readLattice(coder, mirrored);
    const [gainCodes, shapeCodes] = readPalette(coder, version);
    const { band, thetaD, phiD } = lattice;
    const places = [gainCodes.map((c) => c / 128), ...[0, 1].map((axis) => shapeCodes.map((c) => c[axis] / 64))];
    const gains = new Entries(places[0], places[0].map(() => 0));
    const shapes = new Entries(places[1], places[2]);
    const model = new Model(lattice, places);
    const { predictors } = model;
    const most = Math.min(MOST_REACHED, REACHED_BY_ANY + REACHED_A_BYTE * bytes.length);
    const size = band.reduce((sum, b) => sum + thetaD[b].length * phiD[b].length, 0);
    const [gainIndex, index] = [new Uint16Array(size), new Uint16Array(size)];
    for (let row = 0, i = 0; row < band.length; row++) {
        model.begin(row);
        const [width, height] = [phiD[band[row]].length, thetaD[band[row]].length];
        for (let at = 0; at < width * height; at++, i++) {
            model.expect(Math.floor(at / width), at % width);
            gains.weigh(predictors[0].predicted, predictors[0].s, 0, 0);
            gainIndex[i] = coder.pick(gains.weights, gains.total, gains.start, gains.end);
            shapes.weigh(predictors[1].predicted, predictors[1].s, predictors[2].predicted, predictors[2].s);
            index[i] = coder.pick(shapes.weights, shapes.total, shapes.start, shapes.end);
            if (gains.reached + shapes.reached > most) {
                throw new Error(`entries within reach: expected at most ${most}, found more`);
            }
            gains.learn(gainIndex[i]);
            shapes.learn(index[i]);
            for (let c = 0; c < 3; c++) model.learn(at, c, places[c][c ? index[i] : gainIndex[i]]);
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

    /** total: of all weights. Those before `first`, and from `end` on, are 1: they are not looked at. */
    pick(weights, total, first = 0, end = weights.length) {
        const share = Math.floor(this.range / total);
        const at = Math.floor(this.code / share);
        if (at >= total) throw new Error("stream: expected symbols of the range coder, found a code beyond all of them");
        let symbol = Math.min(at, first);
        let below = symbol;
        let weight = 1;
        if (symbol === first) {
            while (symbol < end && below + weights[symbol] <= at) below += weights[symbol++];
            if (symbol < end) weight = weights[symbol];
            else [symbol, below] = [end + at - below, at];
        }
        this.code -= share * below;
        this.range = share * weight;
        while (this.range < 2 ** 24) {
            this.range *= 256;
            this.code = 256 * this.code + this.next();
        }
        return symbol;
    }

    bit(context, i) {
        const one = context[i];
        const bit = this.pick([4096 - one, one], 4096);
        context[i] = bit ? one + ((4096 - one) >> 4) : one - (one >> 4);
        return bit;
    }

    number(context) {
        let [n, x] = [0, 1];
        while (n < 20 && this.bit(context, n)) n++;
        for (let i = n - 1; i >= 0; i--) {
            x = 2 * x + (i === n - 1 && i < 4 ? this.bit(context, 20 + i) : this.pick([2048, 2048], 4096));
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

function readLattice(coder, mirrored) {
    const [counts, h, d, p] = [context(), context(), context(), context()];
    const bands = bounded("bands", 1 + coder.number(counts), 1, 16);
    const closed = (steps) => [...readPlaces(coder, coder.number(counts), steps), FINE];
    const thetaH = closed(h);
    const band = [];
    for (let b = 0; b < bands; b++) {
        const left = thetaH.length - band.length;
        const rows = bounded("rows of a band", b + 1 < bands ? 1 + coder.number(counts) : left, 1, left);
        for (let i = 0; i < rows; i++) band.push(b);
    }
    const [thetaD, phiD] = [[], []];
    for (let b = 0; b < bands; b++) {
        thetaD.push(closed(d));
        const count = coder.number(counts);
        const ends = mirrored && count > 0;
        phiD.push([...readPlaces(coder, ends ? count - 1 : count, p), ...(ends ? [FINE] : [])]);
    }
    bounded("nodes", band.reduce((sum, b) => sum + thetaD[b].length * phiD[b].length, 0), 1, 2 ** 17);
    return { thetaH, band, thetaD, phiD, mirrored };
}

function readPlaces(coder, inner, steps) {
    const places = [0];
    for (let i = inner; i > 0; i--) {
        places.push(bounded("axis", places.at(-1) + 1 + coder.number(steps), 1, FINE - 1));
    }
    return places;
}

function readPalette(coder, version) {
    const [counts, s, u, v] = [context(), context(), context(), context()];
    const gains = bounded("gains", 1 + coder.number(counts), 1, 1024);
    const shapes = bounded("shapes", 1 + coder.number(counts), 1, 1024);
    const [gainCodes, shapeCodes] = [[], []];
    const [first, lowest] = version === 1 ? [() => coder.number(s), 0] : [() => coder.signed(s), -4095];
    for (let i = 0; i < gains; i++) {
        const code = i > 0 ? gainCodes[i - 1] + 1 + coder.number(s) : first();
        gainCodes.push(bounded("gain", code, lowest, 4095));
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
        const { thetaD, phiD, mirrored } = this.lattice;
        const width = phiD[from].length;
        const rows = thetaD[to].map((y) => between(thetaD[from], thetaD[from].length, y));
        const columns = phiD[to].map((x) => (mirrored ? between(phiD[from], width, x) : around(phiD[from], x)));
        const blended = (a) => {
            const found = new Float64Array(rows.length * columns.length);
            let at = 0;
            for (const [d0, d1, v] of rows) {
                for (const [p0, p1, u] of columns) {
                    const low = a[d0 * width + p0] * (1 - u) + a[d0 * width + p1] * u;
                    const high = a[d1 * width + p0] * (1 - u) + a[d1 * width + p1] * u;
                    found[at++] = low * (1 - v) + high * v;
                }
            }
            return found;
        };
        return plane.map((grids) => grids.map(blended));
    }

    /** Has each coordinate's predictor predict. */
    expect(d, p) {
        const { phiD, width, predictors, row, present, above } = this;
        const m = FINE - phiD[p];
        const mirror = p > 0 && m <= phiD[p - 1] ? between(phiD, p, m) : null;
        const at = d * width + p;
        const west = before(p, width, this.lattice.mirrored) - p;
        const east = after(p, width, this.lattice.mirrored) - p;
        for (let c = 0; c < 3; c++) {
            const predictor = predictors[c];
            const up = this.neighbours(c, d, p, west, east, mirror, predictor.x);
            let total = 0.7 * predictor.level;
            let count = 0.7;
            if (p > 0) {
                total += present[1][c][at - 1];
                count += 1;
            }
            if (d > 0) {
                total += present[1][c][at - width];
                count += 1;
            }
            if (row > 0) {
                total += above[1][c][at];
                count += 1;
            }
            predictor.predict(up, total / count);
        }
    }

    /** Fills in the values; returns the one that all are compared with. west, east: how far the nodes beside it are. */
    neighbours(c, d, p, west, east, mirror, values) {
        const { width, row } = this;
        const [line, at] = [d * width, d * width + p];
        const now = this.present[0][c];
        const under = row > 0;
        const above = under ? this.above[0][c] : now;
        let up = p > 0 ? now[at - 1] : d > 0 ? now[at - width] : 0;
        if (p > 0 && d > 0) up = 0.5 * (now[at - 1] + now[at - width]);
        if (under) up = above[at];
        let news = 0;
        if (mirror) {
            const [q0, q1, u] = mirror;
            const known = under ? above[line + q0] * (1 - u) + above[line + q1] * u : up;
            news = now[line + q0] * (1 - u) + now[line + q1] * u - known;
        }
        values[0] = p > 0 ? now[at - 1] : under ? above[at + west] : up;
        values[1] = d > 0 ? now[at - width] : up;
        values[2] = d > 0 ? now[at + west - width] : up;
        values[3] = d > 0 ? now[at + east - width] : up;
        values[4] = under ? above[at + west] : up;
        values[5] = under && d > 0 ? above[at - width] : up;
        values[6] = under ? above[at + east] : up;
        values[7] = under && d + 1 < this.height ? above[at + width] : up;
        values[8] = row > 1 ? this.higher[0][c][at] : up;
        values[9] = up + news;
        return up;
    }

    learn(at, c, value) {
        this.present[0][c][at] = value;
        this.present[1][c][at] = this.predictors[c].learn(value);
    }
}

class Predictor {
    constructor(values) {
        const mean = sum(values) / values.length;
        const variance = sum(values.map((value) => (value - mean) * (value - mean))) / values.length + 1e-4;
        this.w = Float64Array.of(0.5, 0.5, 0, 0, -0.5, -0.5, 0, 0, 0, 0);
        this.matrix = Float64Array.from({ length: 100 }, (_, k) => (k % 11 === 0 ? 25 / variance : 0));
        this.level = 0.15 * Math.sqrt(variance);
        [this.x, this.g] = [new Float64Array(10), new Float64Array(10)];
    }

    /** x holds the neighbours' values, from which `up` is taken. */
    predict(up, error) {
        const { w, x } = this;
        this.predicted = up;
        for (let i = 0; i < 10; i++) {
            x[i] -= up;
            this.predicted += w[i] * x[i];
        }
        this.s = 1 / (error + 0.02 * this.level + 1e-4);
    }

    learn(value) {
        const { matrix, w, x, g } = this;
        const error = value - this.predicted;
        let power = 1;
        for (let i = 0; i < 10; i++) {
            let sum = 0;
            for (let j = 0, at = 10 * i; j < 10; j++) sum += matrix[at + j] * x[j]; // which is symmetric
            g[i] = sum;
            power += sum * x[i];
        }
        const r = 1 / power;
        for (let i = 0; i < 10; i++) {
            const gain = g[i];
            w[i] += gain * r * error;
            for (let j = i; j < 10; j++) {
                const found = (matrix[10 * i + j] - gain * g[j] * r) * 1.0005;
                matrix[10 * i + j] = found;
                matrix[10 * j + i] = found;
            }
        }
        this.level = 0.98 * this.level + 0.02 * Math.abs(error);
        return Math.abs(error);
    }
}

/** Entries of a palette, and how likely each is. */
class Entries {
    constructor(first, second) {
        [this.first, this.second] = [Float64Array.from(first), Float64Array.from(second)];
        this.narrow = 0.5;
        this.before = new Uint16Array(4098); // entries whose step is below
        for (const place of first) this.before[step(place) + 1]++;
        for (let i = 1; i < this.before.length; i++) this.before[i] += this.before[i - 1];
        const size = first.length;
        [this.counts, this.roots] = [new Float64Array(size).fill(1), new Float64Array(size).fill(1)];
        [this.near, this.far] = [new Float64Array(size), new Float64Array(size)];
        this.weights = new Uint32Array(size);
        [this.start, this.end] = [0, 0]; // of the entries within reach, which have weights; all others weigh 1
        this.reached = 0; // how many they were, added up over all nodes so far
    }

    weigh(p0, s0, p1, s1) {
        const { near, far, weights } = this;
        this.p0 = p0;
        this.s0 = s0;
        this.p1 = p1;
        this.s1 = s1;
        const reach = 16 / s0;
        const start = this.before[step(p0 - reach)];
        const end = this.before[step(p0 + reach) + 1];
        this.start = start;
        this.end = end;
        this.reached += end - start;
        this.measure(start, end);
        this.f = this.narrow / sum4(near, start, end);
        this.g = (1 - this.narrow) / sum4(far, start, end);
        const f = this.f * 65536;
        const g = this.g * 65536;
        let total = weights.length;
        for (let i = start; i < end; i++) {
            const more = (near[i] * f + far[i] * g) | 0;
            weights[i] = 1 + more;
            total += more;
        }
        this.total = total;
    }

    /** The kernels of entries around what is expected. */
    measure(start, end) {
        const { first, second, roots, near, far, p0, s0, p1, s1 } = this;
        for (let i = start; i < end; i++) {
            let x = (first[i] - p0) * s0;
            let y = (second[i] - p1) * s1;
            x *= x;
            y *= y;
            let a = (1 + x * 2.25) * (1 + y * 2.25);
            let b = (1 + x * 0.25) * (1 + y * 0.25);
            a *= a;
            b *= b;
            const c = roots[i] / (a * b);
            near[i] = c * b;
            far[i] = c * a;
        }
    }

    learn(i) {
        this.measure(i, i + 1);
        const near = this.near[i] * this.f;
        const far = this.far[i] * this.g;
        this.narrow = 0.96 * (near / (near + far)) + 0.02;
        this.roots[i] = Math.sqrt(++this.counts[i]);
    }
}

/** The nodes next to node p in φ_d, which turns, or turns back at its ends. */
function before(p, width, mirrored) {
    if (p > 0) return p - 1;
    return mirrored ? Math.min(1, width - 1) : width - 1;
}

function after(p, width, mirrored) {
    if (p < width - 1) return p + 1;
    return mirrored ? Math.max(width - 2, 0) : 0;
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
    let a = 0;
    let b = 0;
    let c = 0;
    let d = 0;
    let i = first;
    for (; i + 4 <= end; i += 4) {
        a += values[i];
        b += values[i + 1];
        c += values[i + 2];
        d += values[i + 3];
    }
    if (i < end) a += values[i];
    if (i + 1 < end) b += values[i + 1];
    if (i + 2 < end) c += values[i + 2];
    return a + b + (c + d) + 1e-300;
}
