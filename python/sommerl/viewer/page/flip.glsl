// FLIP of two pictures (Andersson et al. 2020), from what blur.glsl has made of them. Before it: colour.glsl.
uniform sampler2D uColoursA, uColoursB; // luminance, and the opponent colours, the last one through two filters
uniform sampler2D uFeaturesA, uFeaturesB; // first derivatives of luminance along x and y, second ones along x and y
uniform vec2 uShares; // of the last colour's filters
out vec4 map;

vec3 hunt(vec4 opponent) {
    float y = (opponent.x + 16.0) / 116.0;
    vec3 xyz = vec3(y + opponent.y / 500.0, y, y - dot(opponent.zw, uShares) / 200.0);
    const mat3 toRgb = mat3(3.0799327, -0.9212350, 0.0528909, -1.5371500, 1.8759908, -0.2040259, -0.5427821, 0.0452442, 1.1511351);
    xyz = TO_XYZ * clamp(toRgb * xyz, vec3(0.0), vec3(1.0));
    vec3 f = mix(xyz / 0.1284186 + 4.0 / 29.0, pow(max(xyz, vec3(1e-9)), vec3(1.0 / 3.0)), step(vec3(0.0088565), xyz));
    float lightness = 116.0 * f.y - 16.0;
    return vec3(lightness, 0.01 * lightness * vec2(500.0 * (f.x - f.y), 200.0 * (f.y - f.z)));
}

float apart(vec3 a, vec3 b) {
    return abs(a.x - b.x) + length(a.yz - b.yz);
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    // The largest difference that counts is that between green and blue.
    const vec3 green = vec3(87.7347, -0.877347 * 86.1827, 0.877347 * 83.1793), blue = vec3(32.2970, 0.322970 * 79.1875, -0.322970 * 107.8602);
    float most = pow(apart(green, blue), 0.7), knee = 0.4 * most;
    float d = pow(apart(hunt(texelFetch(uColoursA, at, 0)), hunt(texelFetch(uColoursB, at, 0))), 0.7);
    d = d < knee ? 0.95 * d / knee : 0.95 + 0.05 * (d - knee) / (most - knee);
    vec4 a = texelFetch(uFeaturesA, at, 0), b = texelFetch(uFeaturesB, at, 0);
    float feature = sqrt(max(abs(length(a.xy) - length(b.xy)), abs(length(a.zw) - length(b.zw))) / sqrt(2.0));
    map = vec4(pow(clamp(d, 0.0, 1.0), 1.0 - clamp(feature, 0.0, 1.0)));
}
