// One path for each pixel, added to the mean of those before. Before it: brdf.glsl, and sampler.glsl unless PLAIN; #define MESH for
// objects of triangles (else a sphere), PLANE for the grey ground, ENVIRONMENT (else one lamp, infinitely far), and PLAIN for light that
// comes straight from the lamp. ENTRIES draws which entries pixels use instead.
uniform vec2 uSize; // of the picture, in pixels
uniform vec2 uJitter; // of the point in each pixel that is looked through, from its centre
uniform vec3 uRight, uUp, uBack; // of the camera; back is towards the viewer
uniform vec3 uEye;
uniform float uTangent; // of half the field of view
uniform vec3 uLight; // towards the lamp, which gives the irradiance π
uniform sampler2D uBefore;
uniform float uCount; // of paths before
uniform uint uSeed;
uniform int uBounces;
out vec4 result; // radiance; and of the paths, the share that meets the material

const float NEVER = 1e30;
const float GROUND = 0.06; // its albedo
const float NEAR = 2e-4; // that rays start above surfaces

struct Hit {
    float far;
    vec3 normal; // that light is reflected about
    vec3 face; // normal of the triangle
    int what; // 0: nothing, 1: the material, 2: the ground
};

uint state;

float random() {
    state = state * 747796405u + 2891336453u; // PCG (O'Neill 2014)
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return float(((word >> 22u) ^ word) >> 8u) / 16777216.0;
}

#ifdef MESH
uniform sampler2D uBoxes; // of each: lowest corner, number of the box to go to when it is missed; highest corner, and for leaves 16 · first triangle + how many
uniform sampler2D uTriangles; // of each: a corner, two edges, three normals
uniform int uBoxCount;

void meetTriangle(int number, vec3 origin, vec3 direction, inout Hit hit) {
    vec3 corner = texelOf(uTriangles, 6 * number).xyz, a = texelOf(uTriangles, 6 * number + 1).xyz, b = texelOf(uTriangles, 6 * number + 2).xyz;
    vec3 p = cross(direction, b);
    float volume = dot(a, p); // Möller and Trumbore 1997
    if (volume == 0.0) return;
    vec3 s = (origin - corner) / volume;
    float u = dot(s, p);
    vec3 q = cross(s, a);
    float v = dot(direction, q), far = dot(b, q);
    if (u < 0.0 || v < 0.0 || u + v > 1.0 || far <= 0.0 || far >= hit.far) return;
    vec3 n0 = texelOf(uTriangles, 6 * number + 3).xyz, n1 = texelOf(uTriangles, 6 * number + 4).xyz, n2 = texelOf(uTriangles, 6 * number + 5).xyz;
    hit = Hit(far, normalize(n0 + u * (n1 - n0) + v * (n2 - n0)), cross(a, b), 1);
}

// any: whether it does not matter which surface is met first.
void meetMesh(vec3 origin, vec3 direction, bool any, inout Hit hit) {
    vec3 inverse = 1.0 / mix(vec3(1e-12), direction, step(vec3(1e-12), abs(direction)));
    for (int i = 0; i < uBoxCount;) {
        vec4 low = texelOf(uBoxes, 2 * i), high = texelOf(uBoxes, 2 * i + 1);
        vec3 a = (low.xyz - origin) * inverse, b = (high.xyz - origin) * inverse;
        vec3 first = min(a, b), last = max(a, b);
        float enter = max(max(first.x, first.y), max(first.z, 0.0)), leave = min(min(last.x, last.y), min(last.z, hit.far));
        bool inside = enter <= leave;
        int leaf = int(high.w);
        if (inside) for (int k = 0; k < (leaf & 15); k++) meetTriangle((leaf >> 4) + k, origin, direction, hit);
        if (any && hit.what > 0) return;
        i = inside && leaf == 0 ? i + 1 : int(low.w);
    }
}
#endif

Hit meet(vec3 origin, vec3 direction, bool any) {
    Hit hit = Hit(NEVER, vec3(0.0), vec3(0.0), 0);
#ifdef MESH
    meetMesh(origin, direction, any, hit);
#else
    float along = dot(origin, direction);
    vec3 nearest = origin - along * direction;
    float square = 1.0 - dot(nearest, nearest);
    float far = -along - sqrt(max(square, 0.0));
    if (square > 0.0 && far > 0.0) {
        vec3 normal = normalize(origin + far * direction);
        hit = Hit(far, normal, normal, 1);
    }
#endif
#ifdef PLANE
    float down = -origin.y / direction.y;
    if (down > 0.0 && down < min(hit.far, 60.0)) hit = Hit(down, vec3(0.0, 1.0, 0.0), vec3(0.0, 1.0, 0.0), 2);
#endif
    return hit;
}

bool lit(vec3 origin, vec3 direction) {
#if defined(MESH) || defined(PLANE)
    return meet(origin, direction, true).what == 0;
#else
    return true; // a sphere alone sees nothing of itself
#endif
}

mat3 frameOf(vec3 normal) {
    vec3 tangent = normalize(cross(abs(normal.y) < 0.999 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0), normal));
    return mat3(tangent, cross(normal, tangent), normal);
}

vec3 reflected(int what, vec3 wi, vec3 wo) {
    if (what == 1) return brdf(wi, wo);
    return vec3(wi.z > 0.0 && wo.z > 0.0 ? GROUND / PI : 0.0);
}

#ifdef ENVIRONMENT
uniform sampler2D uEnvironment; // latitude and longitude; the middle column is towards +z, columns to the right of it towards -x
uniform sampler2D uAliases; // of each of its cells: the share that is its own, another cell, and its probability times the number of cells

vec3 radianceFrom(vec3 direction) {
    vec2 place = vec2(angle(-direction.x, direction.z) / (2.0 * PI) + 0.5, acos(clamp(direction.y, -1.0, 1.0)) / PI);
    // Interpolated by hand: the hardware does not wrap around one axis alone, nor filter floats everywhere.
    vec2 size = vec2(textureSize(uEnvironment, 0)), x = place * size - 0.5;
    ivec2 low = ivec2(floor(x)), whole = ivec2(size);
    vec2 t = x - vec2(low);
    vec3 sum = vec3(0.0);
    for (int j = 0; j < 2; j++) for (int i = 0; i < 2; i++) {
        ivec2 texel = ivec2((low.x + i + whole.x) % whole.x, clamp(low.y + j, 0, whole.y - 1));
        sum += (i == 0 ? 1.0 - t.x : t.x) * (j == 0 ? 1.0 - t.y : t.y) * texelFetch(uEnvironment, texel, 0).rgb;
    }
    return sum;
}

// A direction towards the environment, and its density.
vec3 towardsLight(out float pdf) {
    ivec2 size = textureSize(uAliases, 0);
    int cell = min(int(random() * float(size.x * size.y)), size.x * size.y - 1);
    vec4 slot = texelFetch(uAliases, ivec2(cell % size.x, cell / size.x), 0);
    if (random() >= slot.x) cell = int(slot.y);
    vec2 place = (vec2(ivec2(cell % size.x, cell / size.x)) + vec2(random(), random())) / vec2(size);
    float theta = place.y * PI, phi = (place.x - 0.5) * 2.0 * PI;
    float probability = texelFetch(uAliases, ivec2(cell % size.x, cell / size.x), 0).z;
    pdf = probability / (2.0 * PI * PI * max(sin(theta), 1e-6));
    return vec3(-sin(phi) * sin(theta), cos(theta), cos(phi) * sin(theta));
}

float densityOfLight(vec3 direction) {
    ivec2 size = textureSize(uAliases, 0);
    vec2 place = vec2(angle(-direction.x, direction.z) / (2.0 * PI) + 0.5, acos(clamp(direction.y, -1.0, 1.0)) / PI);
    ivec2 cell = clamp(ivec2(place * vec2(size)), ivec2(0), size - 1);
    float sine = sqrt(max(1.0 - direction.y * direction.y, 1e-12));
    return texelFetch(uAliases, cell, 0).z / (2.0 * PI * PI * sine);
}
#endif

#ifndef PLAIN
vec3 drawn(int what, vec3 wo, out float pdf) {
    vec3 u = vec3(random(), random(), random());
    if (what == 1) return sampleBrdf(wo, u, pdf);
    float r = sqrt(u.x), phi = 2.0 * PI * u.y;
    vec3 wi = vec3(r * cos(phi), r * sin(phi), sqrt(max(1.0 - u.x, 0.0)));
    pdf = wi.z / PI;
    return wi;
}

float densityOf(int what, vec3 wi, vec3 wo) {
    return what == 1 ? pdfBrdf(wi, wo) : max(wi.z, 0.0) / PI;
}
#endif

// The radiance that comes back along a ray; hit: what it meets, if anything.
vec3 radiance(vec3 origin, vec3 direction, Hit hit) {
#ifdef ENVIRONMENT
    if (hit.what == 0) return radianceFrom(direction);
#else
    if (hit.what == 0) return vec3(0.0);
#endif
    vec3 total = vec3(0.0), weight = vec3(1.0);
    for (int depth = 0;; depth++) {
        mat3 frame = frameOf(hit.normal);
        vec3 wo = -direction * frame, above = origin + hit.far * direction + NEAR * normalize(hit.face);
        if (wo.z <= 0.0) break;
#ifdef ENVIRONMENT
        float pdf;
        vec3 light = towardsLight(pdf), wi = light * frame;
        if (wi.z > 0.0) {
            vec3 f = reflected(hit.what, wi, wo) * wi.z;
            if (dot(abs(f), vec3(1.0)) > 0.0 && lit(above, light)) total += weight * f * radianceFrom(light) / (pdf + densityOf(hit.what, wi, wo));
        }
#else
        vec3 wi = uLight * frame;
        if (wi.z > 0.0) {
            vec3 f = reflected(hit.what, wi, wo) * (wi.z * PI);
            if (dot(abs(f), vec3(1.0)) > 0.0 && lit(above, uLight)) total += weight * f;
        }
        if (depth >= uBounces) break;
#endif
#ifdef PLAIN
        break;
#else
        float density;
        wi = drawn(hit.what, wo, density);
        if (!(density > 0.0) || wi.z <= 0.0) break;
        vec3 f = reflected(hit.what, wi, wo) * wi.z;
        direction = frame * wi;
        int what = hit.what;
        origin = above;
#if defined(MESH) || defined(PLANE)
        hit = meet(origin, direction, false);
#else
        hit.what = 0;
#endif
#ifdef ENVIRONMENT
        if (hit.what == 0) {
            // Both ways to find this light, weighted by the balance heuristic (Veach 1997).
            total += weight * f * radianceFrom(direction) / (density + densityOfLight(direction));
            break;
        }
        if (depth >= uBounces) break;
#else
        if (hit.what == 0) break;
#endif
        weight *= f / density;
#endif
    }
    return total;
}

#ifdef ENTRIES
uniform ivec2 uEntries; // numbers that are looked for, or -1 for any
#endif

void main() {
    state = (uint(gl_FragCoord.x) * 1973u + uint(gl_FragCoord.y) * 9277u) ^ (uSeed * 26699u);
    state = (state ^ 61u) ^ (state >> 16u);
    state = (state * 9u) ^ (state >> 4u);
    vec2 place = (2.0 * (gl_FragCoord.xy + uJitter) - uSize) / min(uSize.x, uSize.y) * uTangent;
    vec3 direction = mat3(uRight, uUp, uBack) * normalize(vec3(place, -1.0));
    Hit hit = meet(uEye, direction, false);
#ifdef ENTRIES
    mat3 frame = frameOf(hit.normal);
    ivec2 found = entriesAt(uLight * frame, -direction * frame);
    bool used = hit.what == 1 && dot(uLight, hit.normal) > 0.0 && (uEntries.x < 0 || uEntries.x == found.x) && (uEntries.y < 0 || uEntries.y == found.y);
    result = vec4(used ? 1.0 : 0.0);
#else
    vec3 found = radiance(uEye, direction, hit);
    if (!(dot(found, vec3(1.0)) < 1e30 && dot(found, vec3(1.0)) > -1e30)) found = vec3(0.0);
    vec4 path = vec4(found, hit.what == 1 ? 1.0 : 0.0);
    result = mix(texelFetch(uBefore, ivec2(gl_FragCoord.xy), 0), path, 1.0 / (uCount + 1.0));
#endif
}
