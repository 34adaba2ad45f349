// A picture in sRGB as luminance and two opponent colours (YCxCz), which FLIP looks at. Before it: colour.glsl.
uniform sampler2D uPicture;
out vec4 colour;

void main() {
    vec3 x = texelFetch(uPicture, ivec2(gl_FragCoord.xy), 0).rgb;
    x = mix(x / 12.92, pow((x + 0.055) / 1.055, vec3(2.4)), step(vec3(0.04045), x));
    vec3 xyz = TO_XYZ * x;
    colour = vec4(116.0 * xyz.y - 16.0, 500.0 * (xyz.x - xyz.y), 200.0 * (xyz.y - xyz.z), 1.0);
}
