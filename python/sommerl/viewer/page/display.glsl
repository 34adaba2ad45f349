// From radiance to the screen: one picture, or two in one of several ways.
uniform sampler2D uA, uB;
uniform sampler2D uMap; // FLIP of each pixel
uniform sampler2D uUsed; // pixels that use the entry under the pointer
uniform int uView; // 0: A, 1: B, 2: A to the left of uSplit and B to the right, 3: both side by side, 4: difference, 5: FLIP
uniform float uSplit, uExposure, uGain;
uniform int uTone;
uniform int uMarks; // 1: uUsed is of A; 2: of B; 0: it does not count
uniform float uBehind; // grey where nothing is, in scenes without ground or environment
uniform vec2 uPlace; // of the lower left corner on the canvas
uniform vec2 uFiner; // pixels of the pictures for one of the canvas
out vec4 colour;

vec3 srgb(vec3 linear) {
    vec3 x = clamp(linear, vec3(0.0), vec3(1.0));
    return mix(12.92 * x, 1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055, step(vec3(0.0031308), x));
}

// A fit of the Academy's reference curves (Narkowicz 2016).
vec3 aces(vec3 x) {
    return x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14);
}

// After AgX (Sobotka 2022), with the polynomial and the matrices of Wrensch's fit (2023).
vec3 agx(vec3 x) {
    const mat3 inset = mat3(0.842479, 0.0423282, 0.0423756, 0.0784336, 0.878468, 0.0784336, 0.0792237, 0.0791661, 0.879142);
    const mat3 outset = mat3(1.19687, -0.0528968, -0.0529716, -0.0980208, 1.15190, -0.0980434, -0.0990297, -0.0989611, 1.15107);
    x = clamp((log2(max(inset * x, vec3(1e-10))) + 12.47393) / 16.5, vec3(0.0), vec3(1.0));
    vec3 x2 = x * x, x4 = x2 * x2;
    x = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
    return pow(max(outset * x, vec3(0.0)), vec3(2.2));
}

vec3 shown(vec4 radiance) {
    vec3 x = max(radiance.rgb * uExposure, vec3(0.0));
    if (uTone == 1) x = aces(x);
    if (uTone == 2) x = agx(x);
    return srgb(x);
}

// Grey where both are equal, red to yellow where B is brighter, blue to cyan where it is darker: as `sommerl render --against`.
vec3 difference(vec3 a, vec3 b) {
    float change = dot(b - a, vec3(1.0 / 3.0)), size = min(uGain * abs(change), 1.0);
    vec3 grey = vec3(128.0), half_ = change > 0.0 ? vec3(205.0, 45.0, 35.0) : vec3(40.0, 75.0, 200.0);
    vec3 whole = change > 0.0 ? vec3(255.0, 225.0, 120.0) : vec3(130.0, 235.0, 255.0);
    return (size < 0.5 ? mix(grey, half_, 2.0 * size) : mix(half_, whole, 2.0 * size - 1.0)) / 255.0;
}

// A fit of sixth degree to matplotlib's colour map magma.
vec3 magma(float t) {
    return vec3(-0.0021, -0.0007, -0.0095)
        + t * (vec3(0.2505, 0.6945, 2.4953)
        + t * (vec3(8.3459, -3.5960, 0.3291)
        + t * (vec3(-27.6670, 14.2539, -13.6466)
        + t * (vec3(52.1707, -27.9446, 12.8811)
        + t * (vec3(-50.7586, 29.0539, 4.2699)
        + t * (vec3(18.6643, -11.4900, -5.5708)))))));
}

void main() {
    ivec2 at = ivec2((gl_FragCoord.xy - uPlace) * uFiner);
    vec3 a = shown(texelFetch(uA, at, 0)), b = shown(texelFetch(uB, at, 0)), found = a;
    if (uView == 1) found = b;
    if (uView == 2 && float(at.x) >= uSplit) found = b;
    if (uView == 4) found = difference(a, b);
    if (uView == 5) found = magma(texelFetch(uMap, at, 0).r);
    if (uView < 4) found = mix(vec3(uBehind), found, clamp(max(texelFetch(uA, at, 0).a, step(uBehind, 0.0)), 0.0, 1.0));
    int whose = uView == 0 || (uView == 2 && float(at.x) < uSplit) ? 1 : uView < 3 ? 2 : 0;
    if (uMarks == whose && whose > 0 && texelFetch(uUsed, at, 0).r > 0.5) found = mix(found, vec3(1.0, 0.45, 0.1), 0.65);
    colour = vec4(found, texelFetch(uA, at, 0).a); // the material's share of the pixel, for figures
}
