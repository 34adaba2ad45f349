// One direction of the filters of FLIP: sums of 21 neighbours in a row or a column, with four weights for each.
uniform sampler2D uPicture;
uniform ivec2 uAlong;
uniform int uPick; // 0, 1: colours along rows, columns; 2, 3: luminance along rows, columns
uniform vec4 uWeights[21];
out vec4 sum;

void main() {
    ivec2 last = textureSize(uPicture, 0) - 1;
    sum = vec4(0.0);
    for (int i = 0; i < 21; i++) {
        vec4 here = texelFetch(uPicture, clamp(ivec2(gl_FragCoord.xy) + (i - 10) * uAlong, ivec2(0), last), 0);
        vec4 picked = uPick == 0 ? here.xyzz : uPick == 1 ? here : uPick == 2 ? vec4((here.x + 16.0) / 116.0) : here.yxzx;
        sum += uWeights[i] * picked;
    }
}
