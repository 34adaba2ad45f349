// f_r of a material in textures, as evaluate.js and docs/conventions.md have it. Before it: #define CELLS, NODES, TABLE, GRID or
// RGL, and RECIPROCAL, MIRRORED, SIGNED, SMOOTH, TRILINEAR, JACOBIAN as the material has them. material.js fills the uniforms.
const float PI = 3.14159265358979;
const float HALF_PI = 0.5 * PI;

uniform sampler2D uValues; // of entries, nodes, cells or points of a grid, a pixel each
uniform ivec3 uBins; // of the axes

// Where a pixel of a list of gl.js is.
ivec2 placeOf(int number) {
    return ivec2(number & ((1 << LIST_BITS) - 1), number >> LIST_BITS);
}

vec4 texelOf(sampler2D image, int number) {
    return texelFetch(image, placeOf(number), 0);
}

// atan(y, x) in single precision (Cephes), 0 for (0, 0). The built-in one may be off by 5e-4, and is not defined there.
float angle(float y, float x) {
    float a = abs(x), b = abs(y), low = min(a, b), high = max(a, b);
    bool beyond = low > 0.41421356 * high;
    float t = (beyond ? low - high : low) / max(beyond ? low + high : high, 1e-37), z = t * t;
    float turn = (((0.0805374449538 * z - 0.138776856032) * z + 0.199777106478) * z - 0.333329491539) * z * t + t;
    if (beyond) turn += 0.25 * PI;
    if (b > a) turn = HALF_PI - turn;
    if (x < 0.0) turn = PI - turn;
    return y < 0.0 ? -turn : turn;
}

float polar(vec3 w) {
    return angle(length(w.xy), w.z);
}

// Of `points` points at whole numbers, those about a place, clamped at the ends: the lower one's number, the upper one's
// share. A single point is on both sides.
float between(float place, int points, out int below) {
    place = clamp(place, 0.0, float(points - 1));
    below = min(int(place), max(points - 2, 0));
    return place - float(below);
}

#if defined(CELLS) || defined(TABLE) || defined(NODES)
// θ_h, θ_d, φ_d as shares of their ranges
vec3 halfDiff(vec3 wi, vec3 wo) {
    vec3 s = wi + wo, v = wi - wo;
    float x = -v.z * length(s), y = v.y * s.x - v.x * s.y;
    float turns = 0.5 / PI;
#ifdef RECIPROCAL
    turns *= 2.0;
#endif
#ifdef MIRRORED
    turns *= 2.0;
    y = abs(y);
#ifdef RECIPROCAL
    x = abs(x);
#endif
#elif defined(RECIPROCAL)
    if (y < 0.0 || (y == 0.0 && x < 0.0)) { x = -x; y = -y; }
#endif
    float phi = angle(y, x);
    if (phi < 0.0) phi += 2.0 * PI;
    return vec3(polar(s) / HALF_PI, angle(length(v), length(s)) / HALF_PI, phi * turns);
}
#endif

#ifdef NODES
uniform sampler2D uAxes; // see material.js
uniform float uScale;
const float FINE = 180.0;

vec3 onFineGrid(vec3 angles) {
    float a = sqrt(angles.x);
    vec3 place = vec3(a < 0.25 ? a * 360.0 : 90.0 + (a - 0.25) * 120.0, angles.yz * FINE);
#ifndef MIRRORED
    if (place.z >= FINE) place.z -= FINE;
#endif
    return place;
}

// The number of the node below a place of an axis, the number of the next one, and the share of that one.
vec3 onAxis(int axis, float place) {
    vec4 step = texelFetch(uAxes, ivec2(clamp(int(place), 0, int(FINE) - 1), axis), 0);
    return vec3(step.xy, clamp((place - step.z) / (step.w - step.z), 0.0, 1.0));
}

vec3 lookup(vec3 wi, vec3 wo) {
    vec3 place = onFineGrid(halfDiff(wi, wo)), rows = onAxis(0, place.x), sum = vec3(0.0);
    for (int r = 0; r < 2; r++) {
        vec4 row = texelFetch(uAxes, ivec2(int(rows[r]), 1), 0); // number of its first node, band, nodes in φ_d
        vec3 d = onAxis(2 + 2 * int(row.y), place.y), p = onAxis(3 + 2 * int(row.y), place.z);
        float ofRow = r == 0 ? 1.0 - rows.z : rows.z;
        for (int i = 0; i < 2; i++) {
            int first = int(row.x) + int(d[i]) * int(row.z);
            vec3 line = mix(texelOf(uValues, first + int(p.x)).rgb, texelOf(uValues, first + int(p.y)).rgb, p.z);
            sum += ofRow * (i == 0 ? 1.0 - d.z : d.z) * line;
        }
    }
#ifndef SIGNED
    sum = max(sum, vec3(0.0));
#endif
#ifdef SMOOTH
    float damped = sqrt((wi.z * wi.z + 0.0009) * (wo.z * wo.z + 0.0009));
#else
    float damped = max(wi.z, 0.01) * max(wo.z, 0.01);
#endif
    return sum * sum * sum * (uScale / damped);
}

// Shape and gain of the node with the largest weight.
ivec2 entriesAt(vec3 wi, vec3 wo) {
    vec3 place = onFineGrid(halfDiff(wi, wo)), rows = onAxis(0, place.x);
    float largest = -1.0, entries = 0.0;
    for (int r = 0; r < 2; r++) {
        vec4 row = texelFetch(uAxes, ivec2(int(rows[r]), 1), 0);
        vec3 d = onAxis(2 + 2 * int(row.y), place.y), p = onAxis(3 + 2 * int(row.y), place.z);
        if (p.x == p.y) p.z = 0.0; // a single one counts for all
        float weight = (r == 0 ? 1.0 - rows.z : rows.z) * max(d.z, 1.0 - d.z) * max(p.z, 1.0 - p.z);
        if (weight <= largest) continue;
        largest = weight;
        entries = texelOf(uValues, int(row.x) + int(d.z > 0.5 ? d.y : d.x) * int(row.z) + int(p.z > 0.5 ? p.y : p.x)).a;
    }
    return ivec2(int(entries) & 1023, int(entries) >> 10);
}
#endif

#if defined(CELLS) || defined(TABLE)
#ifdef CELLS
uniform usampler2D uIndex; // the entry of each cell

int entryOf(ivec3 bins) {
    return int(texelFetch(uIndex, placeOf(bins.z + uBins.z * (bins.y + uBins.y * bins.x)), 0).r);
}

vec3 valueOf(ivec3 bins) {
    return texelOf(uValues, entryOf(bins)).rgb;
}
#else
vec3 valueOf(ivec3 bins) {
    return texelOf(uValues, bins.z + uBins.z * (bins.y + uBins.y * bins.x)).rgb;
}
#endif

vec3 inBins(vec3 wi, vec3 wo) {
    vec3 angles = halfDiff(wi, wo);
    return vec3(sqrt(angles.x), angles.yz) * vec3(uBins);
}

ivec3 nearest(vec3 place) {
    return clamp(ivec3(place), ivec3(0), uBins - 1);
}

vec3 lookup(vec3 wi, vec3 wo) {
    vec3 place = inBins(wi, wo);
#ifdef TRILINEAR
    int i, j;
    vec3 share;
    share.x = between(place.x - 0.5, uBins.x, i);
    share.y = between(place.y - 0.5, uBins.y, j);
    float below = floor(place.z - 0.5); // φ_d turns
    share.z = place.z - 0.5 - below;
    ivec3 low = ivec3(i, j, (int(below) + uBins.z) % uBins.z);
    ivec3 high = ivec3(min(low.xy + 1, uBins.xy - 1), (low.z + 1) % uBins.z);
    vec3 sum = vec3(0.0);
    for (int k = 0; k < 8; k++) {
        ivec3 upper = ivec3(k & 1, (k >> 1) & 1, k >> 2);
        vec3 weight = mix(1.0 - share, share, vec3(upper));
        sum += weight.x * weight.y * weight.z * valueOf(low + upper * (high - low));
    }
    return sum;
#else
    return valueOf(nearest(place));
#endif
}
#endif

#ifdef CELLS
ivec2 entriesAt(vec3 wi, vec3 wo) {
    return ivec2(entryOf(nearest(inBins(wi, wo))), -1);
}
#elif !defined(NODES)
ivec2 entriesAt(vec3 wi, vec3 wo) {
    return ivec2(-1);
}
#endif

#ifdef GRID
vec3 lookup(vec3 wi, vec3 wo) {
    float phi = angle(abs(wi.x * wo.y - wi.y * wo.x), dot(wi.xy, wo.xy));
    vec3 place = vec3(polar(wi) / HALF_PI, polar(wo) / HALF_PI, phi / PI) * vec3(uBins) - 0.5, share, sum = vec3(0.0);
    ivec3 low;
    for (int i = 0; i < 3; i++) {
        int below;
        share[i] = between(place[i], uBins[i], below);
        low[i] = below;
    }
    for (int i = 0; i < 8; i++) {
        ivec3 upper = ivec3(i & 1, (i >> 1) & 1, i >> 2), at = min(low + upper, uBins - 1);
        vec3 weight = mix(1.0 - share, share, vec3(upper));
        sum += weight.x * weight.y * weight.z * texelOf(uValues, at.z + uBins.z * (at.y + uBins.y * at.x)).rgb;
    }
    return sum;
}
#endif

#ifdef RGL
uniform sampler2D uWarp; // density of visible normals, and its integral along each row: [θ_i][row][column]
uniform sampler2D uRest; // θ_i, then from uStarts: integrals over rows, D, σ, and f_r cos θ_i of a viewer at the normal
uniform ivec4 uStarts;
uniform ivec2 uWarpSize, uValuesSize, uNdfSize, uSigmaSize; // width and height of each
uniform int uAngles;
const int NORMAL_POINTS = 512;

vec4 rest(int number) {
    return texelOf(uRest, number);
}

float onUnit(float x, int points, out int below) {
    return between(clamp(x, 0.0, 1.0) * float(points - 1), points, below);
}

float unit(float theta) {
    return sqrt(theta / HALF_PI);
}

float segment(float t, float a, float b, int points) {
    return t * (a + 0.5 * t * (b - a)) / float(points - 1);
}

vec4 bilinear(sampler2D image, int start, vec2 x, ivec2 shape) {
    int i, j;
    float s = onUnit(x.x, shape.x, i), t = onUnit(x.y, shape.y, j);
    int at = start + j * shape.x + i;
    vec4 low = mix(texelOf(image, at), texelOf(image, at + 1), s);
    return mix(low, mix(texelOf(image, at + shape.x), texelOf(image, at + shape.x + 1), s), t);
}

vec2 warp(ivec2 angles, float t, int at) {
    int size = uWarpSize.x * uWarpSize.y;
    return mix(texelOf(uWarp, angles.x * size + at).xy, texelOf(uWarp, angles.y * size + at).xy, t);
}

// The point of the unit square that the warp takes to x.
vec2 unwarped(vec2 x, ivec2 angles, float share) {
    int i, j, width = uWarpSize.x, height = uWarpSize.y;
    float s = onUnit(x.x, width, i), t = onUnit(x.y, height, j);
    int at = j * width;
    vec2 left = mix(warp(angles, share, at + i), warp(angles, share, at + width + i), t);
    vec2 right = mix(warp(angles, share, at + i + 1), warp(angles, share, at + width + i + 1), t);
    float end0 = warp(angles, share, at + width - 1).y, end1 = warp(angles, share, at + 2 * width - 1).y;
    int row = uStarts.x + j;
    float before = mix(rest(row + angles.x * height).x, rest(row + angles.y * height).x, share);
    float along = left.y + segment(s, left.x, right.x, width);
    return vec2(along / max(mix(end0, end1, t), 1e-30), before + segment(t, end0, end1, height));
}

vec3 lookup(vec3 light, vec3 viewer) {
    if (dot(viewer.xy, viewer.xy) < 1e-14) { // which has no azimuth
        int i;
        float t = onUnit(unit(0.5 * polar(light)) * sqrt(2.0), NORMAL_POINTS, i);
        return mix(rest(uStarts.w + i).rgb, rest(uStarts.w + i + 1).rgb, t) / max(light.z, 0.01);
    }
    vec3 m = light + viewer; // the file's incident direction is the viewer's
    float thetaI = polar(viewer);
    vec2 x = vec2(unit(polar(m)), angle(viewer.x * m.y - viewer.y * m.x, dot(viewer.xy, m.xy)) / (2.0 * PI) + 0.5);
    x.y -= floor(x.y);
    int low = 0, high = max(uAngles - 1, 0);
    while (low + 1 < high) {
        int middle = (low + high) / 2;
        if (thetaI >= rest(middle).x) low = middle; else high = middle;
    }
    float first = rest(low).x, t = high == low ? 0.0 : clamp((thetaI - first) / (rest(high).x - first), 0.0, 1.0);
    vec2 at = unwarped(x, ivec2(low, high), t);
    int size = uValuesSize.x * uValuesSize.y;
    vec3 f = mix(bilinear(uValues, low * size, at, uValuesSize), bilinear(uValues, high * size, at, uValuesSize), t).rgb;
#ifdef JACOBIAN
    float sigma = bilinear(uRest, uStarts.z, vec2(unit(thetaI), 0.5), uSigmaSize).x;
    f *= bilinear(uRest, uStarts.y, x, uNdfSize).x / (4.0 * max(sigma, 1e-30));
#endif
    return f / max(light.z, 0.01);
}
#endif

vec3 brdf(vec3 wi, vec3 wo) {
    if (wi.z > 0.0 && wo.z > 0.0) return lookup(wi, wo);
    return vec3(0.0);
}
