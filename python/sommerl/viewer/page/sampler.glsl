// Directions drawn as a material reflects: sampling/half_vector.py, with the same names. uSampler, from sampler.js, holds CELLS cells
// of a unit square for each of ELEVATIONS elevations of the viewer; of a cell, from the lowest bits, its probability in units of
// 1 / WHOLE (16 bits), another cell (8), and how many of its own SLOTS that one takes (8).
uniform usampler2D uSampler;
const int ROWS = 20, COLUMNS = 8, ELEVATIONS = 12, SLOTS = 256, WHOLE = ROWS * COLUMNS * SLOTS;
const float TINY = 1e-9, LOWEST = 1e-4, SMALLEST = 1e-35;

uint wordAt(int elevation, int cell) {
    return texelFetch(uSampler, placeOf(cell + ROWS * COLUMNS * elevation), 0).r;
}

// The elevation below a viewer's, and in t the next one's share.
int elevationOf(float cosine, out float t) {
    float x = sqrt(cosine) * float(ELEVATIONS - 1);
    int below = min(int(x), ELEVATIONS - 2);
    t = clamp(x - float(below), 0.0, 1.0);
    return below;
}

// The density in a cell of the unit square.
float shareOf(int elevation, float t, int cell) {
    return mix(float(wordAt(elevation, cell) & 65535u), float(wordAt(elevation + 1, cell) & 65535u), t) / float(SLOTS);
}

float extentOf(float along, float upright2) {
    float r = sqrt(along * along + upright2), a = r + abs(along);
    return (along < 0.0 ? upright2 : a * a) / (2.0 * r * a);
}

// The direction to the light for three random numbers, and its density [1/sr]; 0 if none was drawn.
vec3 sampleBrdf(vec3 wo, vec3 u, out float pdf) {
    pdf = 0.0;
    if (!(wo.z > 0.0)) return vec3(0.0, 0.0, 1.0);
    float t;
    int elevation = elevationOf(wo.z, t);
    bool second = u.x < t;
    float again = second ? u.x / t : (u.x - t) / max(1.0 - t, 1e-7);
    int slot = clamp(int(again * float(WHOLE)), 0, WHOLE - 1), cell = slot / SLOTS;
    uint word = wordAt(second ? elevation + 1 : elevation, cell);
    if (uint(slot % SLOTS) < word >> 24u) cell = int((word >> 16u) & 255u);
    float side = 2.0 * u.z - 1.0, s = (float(cell / COLUMNS) + u.y) / float(ROWS);
    float c = (float(cell % COLUMNS) + abs(side)) * 2.0 / float(COLUMNS);
    float x = 1.0 - c, y = (1.0 - abs(x)) * (side < 0.0 ? -1.0 : 1.0), around = x * x + y * y;
    vec3 w = vec3(wo.x + TINY, wo.y, max(wo.z, LOWEST));
    float across = dot(w.xy, w.xy);
    if (!(across > 0.0)) { w.x = TINY; across = TINY * TINY; }
    float scale = inversesqrt(around * across), tilt = x * across * scale, extent = extentOf(tilt, w.z * w.z);
    float s2 = s * s, s6 = s2 * s2 * s2, sine2 = s6 * s2 * extent, sine = sqrt(sine2), cosine = sqrt(max(1.0 - sine2, 1e-12));
    float along = sine * tilt + cosine * w.z, planar = 2.0 * along * sine * scale;
    vec3 wi = vec3(planar * (x * w.x - y * w.y) - w.x, planar * (x * w.y + y * w.x) - w.y, 2.0 * along * cosine - w.z);
    float solidAngle = 64.0 * (s6 * s) * extent * along / (cosine * around);
    // Half vectors next to the normal have densities beyond single precision, and weigh nothing.
    if (!(wi.z > 0.0 && solidAngle > SMALLEST)) return vec3(0.0, 0.0, 1.0);
    pdf = shareOf(elevation, t, cell) / solidAngle;
    return wi;
}

// The density [1/sr] with which sampleBrdf draws wi.
float pdfBrdf(vec3 wi, vec3 wo) {
    if (!(wi.z > 0.0 && wo.z > 0.0)) return 0.0;
    vec3 w = vec3(wo.x + TINY, wo.y, max(wo.z, LOWEST)), h = vec3(wi.x + wo.x + TINY, wi.y + wo.y, wi.z + max(wo.z, LOWEST));
    float along = h.x * w.x + h.y * w.y, across = h.x * w.y - h.y * w.x, least = TINY * TINY; // these lengths can be 0
    float flat2 = max(dot(h.xy, h.xy), least);
    float extent = extentOf(along, w.z * w.z * flat2);
    float s = sqrt(sqrt(sqrt(min(flat2 / ((flat2 + h.z * h.z) * extent), 1.0))));
    float rim = 1.0 / max(abs(along) + abs(across), least), c = 1.0 - along * rim, t;
    int row = clamp(int(s * float(ROWS)), 0, ROWS - 1), column = clamp(int(c * float(COLUMNS) * 0.5), 0, COLUMNS - 1);
    int elevation = elevationOf(wo.z, t);
    return shareOf(elevation, t, column + COLUMNS * row) * (s * h.z) * (dot(w.xy, w.xy) * (rim * rim) / 32.0);
}
