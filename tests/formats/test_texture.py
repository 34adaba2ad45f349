"""Textures, and arrays for buffers: what is written, read by others."""

import base64
import json
import re
import struct
import subprocess

import numpy as np
import pytest
from browser import numbers
from compact import FOLDS, material
from helpers import must_fail, random_directions, run, tool
from webgl import LINKED

from sommerl import TrainOptions, load, save, train
from sommerl.formats import buffers, texture
from sommerl.formats.shader import source
from sommerl.formats.shader.language import LANGUAGES
from sommerl.render.compress import compress
from sommerl.system.errors import FormatError

WI, WO = random_directions(400, 3), random_directions(400, 4)


@pytest.fixture(scope="module")
def materials():
    return {name: material(folds=folds) for name, folds in FOLDS.items()}


def read_ktx2(data):
    """What a KTX 2 file says, by its specification: the pixel format, the size, and the texels (depth, height, width,
    4)."""
    assert data[:12] == bytes([0xAB, 0x4B, 0x54, 0x58, 0x20, 0x32, 0x30, 0xBB, 0x0D, 0x0A, 0x1A, 0x0A])
    kind, type_size, width, height, depth, layers, faces, levels, scheme = struct.unpack_from("<9I", data, 12)
    dfd, dfd_size, kvd, kvd_size, sgd, sgd_size = struct.unpack_from("<4I2Q", data, 48)
    offset, length, plain = struct.unpack_from("<3Q", data, 80)
    assert (type_size, layers, faces, levels, scheme, sgd, sgd_size) == (2, 0, 1, 1, 0, 0, 0)
    assert (dfd, dfd + dfd_size) == (104, kvd)
    assert struct.unpack_from("<I", data, dfd)[0] == dfd_size
    assert offset % 8 == 0
    assert offset >= kvd + kvd_size
    assert length == plain == len(data) - offset
    _, version, block, model, primaries, transfer, flags = struct.unpack_from("<IHHBBBB", data, dfd + 4)
    assert (version, block, model, primaries, transfer, flags) == (2, dfd_size - 4, 1, 1, 1, 0)
    assert data[dfd + 20] == 8  # bytes of a texel
    for k, channel in enumerate((0, 1, 2, 15)):
        bit, size, what = struct.unpack_from("<HBB", data, dfd + 28 + 16 * k)
        assert (bit, size, what) == (16 * k, 15, 0xC0 | channel)
    return kind, np.frombuffer(data, "<f2", offset=offset).reshape(depth, height, width, 4)


def check_holds(data, made):
    kind, texels = read_ktx2(data)
    assert kind == 97  # VK_FORMAT_R16G16B16A16_SFLOAT
    assert (texels[..., 3] == 1).all()
    assert np.array_equal(texels[..., :3], made.values)


@pytest.mark.parametrize("name", FOLDS)
def test_a_texture_is_a_ktx2_file(materials, name, tmp_path):
    made = texture.write(materials[name], tmp_path / "x.ktx2")
    data = (tmp_path / "x.ktx2").read_bytes()
    check_holds(data, made)
    must_fail(check_holds, data[:-2] + b"\0\0", made)
    must_fail(check_holds, data[:12] + bytes([98]) + data[13:], made)
    said = json.loads((tmp_path / "x.ktx2.json").read_text())
    assert said["size"] == list(made.values.shape[2::-1])
    assert said["address"][2] == ("clamp" if made.mirrored else "repeat")


SAMPLE = (
    f"""
([glsl, name, repeat, size, texels, wi, wo]) => {{
    {LINKED}"""
    + """
    const bytes = (text) => Uint8Array.from(atob(text), (one) => one.charCodeAt(0)).buffer;
    const gl = document.createElement("canvas").getContext("webgl2");
    gl.getExtension("EXT_color_buffer_float");
    const count = bytes(wi).byteLength / 16;
    const vertex = `#version 300 es
        void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }`;
    const pixel = `#version 300 es
        precision highp float; precision highp sampler2D; precision highp sampler3D;
        uniform sampler3D values; uniform sampler2D lights; uniform sampler2D viewers; out vec4 found;
        ${glsl}
        void main() {
            ivec2 at = ivec2(gl_FragCoord.xy);
            found = vec4(${name}(values, texelFetch(lights, at, 0).xyz, texelFetch(viewers, at, 0).xyz), 1.0);
        }`;
    const program = linked(gl, vertex, pixel);
    const put = (unit, target, upload) => {
        gl.activeTexture(gl.TEXTURE0 + unit);
        gl.bindTexture(target, gl.createTexture());
        upload();
        for (const axis of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T, gl.TEXTURE_WRAP_R])
            gl.texParameteri(target, axis, gl.CLAMP_TO_EDGE);
    };
    put(0, gl.TEXTURE_3D, () => {
        const half = new Uint16Array(bytes(texels));
        gl.texImage3D(gl.TEXTURE_3D, 0, gl.RGBA16F, ...size, 0, gl.RGBA, gl.HALF_FLOAT, half);
        gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
        gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    });
    if (repeat) gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_WRAP_R, gl.REPEAT);
    for (const [unit, text] of [[1, wi], [2, wo]]) put(unit, gl.TEXTURE_2D, () => {
        const data = new Float32Array(bytes(text));
        gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, count, 1, 0, gl.RGBA, gl.FLOAT, data);
        gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
        gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    });
    ["values", "lights", "viewers"].forEach((each, k) => gl.uniform1i(gl.getUniformLocation(program, each), k));
    put(3, gl.TEXTURE_2D, () => gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, count, 1));
    gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
    const target = gl.getParameter(gl.TEXTURE_BINDING_2D);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target, 0);
    gl.viewport(0, 0, count, 1);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    const out = new Float32Array(4 * count);
    gl.readPixels(0, 0, count, 1, gl.RGBA, gl.FLOAT, out);
    return [...out];
}
"""
)


def sampled(chromium, folder, glsl):
    """What graphics hardware (here: SwiftShader) finds in a texture."""
    said = json.loads((folder / "x.ktx2.json").read_text())
    _, texels = read_ktx2((folder / "x.ktx2").read_bytes())
    padded = (np.pad(w, ((0, 0), (0, 1))).astype("<f4") for w in (WI, WO))
    data = [base64.b64encode(each.tobytes()).decode() for each in (texels, *padded)]
    page = chromium.new_page()
    repeat = said["address"][2] == "repeat"
    found = numbers(page, SAMPLE, [glsl, said["function"], repeat, said["size"], *data]).reshape(-1, 4)[:, :3]
    page.close()
    return found


def check_sampled(found, wanted):
    """To a hundredth of the brightest channel, nearly everywhere: hardware has 8 bits for the place between texels."""
    size = np.maximum(np.abs(wanted).max(axis=-1), 1e-2 * np.abs(wanted).max())
    assert (np.abs(found - wanted).max(axis=-1) <= 0.03 * size).mean() > 0.97
    assert np.median(np.abs(found - wanted).max(axis=-1) / size) < 0.005


@pytest.mark.parametrize("name", FOLDS)
def test_the_function_finds_what_the_texture_gives(chromium, materials, name, tmp_path):
    made = texture.write(materials[name], tmp_path / "x.ktx2")
    glsl = (tmp_path / "x.ktx2.glsl").read_text()
    wanted = made.eval(WI, WO)
    check_sampled(sampled(chromium, tmp_path, glsl), wanted)
    broken = glsl.replace("+ 0.5) / vec3", ") / vec3")
    assert broken != glsl
    must_fail(check_sampled, sampled(chromium, tmp_path, broken), wanted)
    assert glsl.count("\n") <= 40


@pytest.mark.parametrize("name", FOLDS)
def test_the_function_compiles(materials, name, tmp_path):
    texture.write(materials[name], tmp_path / "x.ktx2")
    glsl = (tmp_path / "x.ktx2.glsl").read_text()
    body = "out vec4 o; uniform highp sampler3D t; uniform vec3 a; uniform vec3 b;\n"
    body += f"{glsl}void main() {{ o = vec4(material_x_eval(t, a, b), 1.0); }}\n"
    for number, head in enumerate(("#version 300 es\nprecision mediump float;\n", "#version 450\n")):
        (tmp_path / f"{number}.frag").write_text(head + body)
        subprocess.run([tool("glslangValidator"), tmp_path / f"{number}.frag"], check=True, capture_output=True)


def test_a_smooth_material_is_nearly_what_its_texture_gives():
    """Of real ones, the command says how far they are."""
    brdf = load("nickel")
    small, _ = compress(brdf, target_size=600, effort=1)
    found, wanted = texture.of(small).eval(WI, WO), small.eval(WI, WO)
    assert np.median(np.abs(found - wanted).max(axis=-1) / wanted.max(axis=-1)) < 0.03


def check_arrays(data, said, material):
    """That the bytes are the numbers in the source code."""
    text = source.source(material, LANGUAGES[".glsl"], "material_x")
    assert said["arrays"]
    for array in said["arrays"]:
        prefix, capitals = array["reader"].rsplit("_", 1)
        listed = re.search(rf"{prefix}_{capitals.lower()}\[\d+\] = \w+\[\d+\]\(\n(.*?)\n\);", text, re.DOTALL)[1]
        texts = [each.strip() for each in listed.split(",")]
        of_words = array["type"] == "uint32"
        wanted = [int(each.rstrip("u"), 16) if of_words else float(each.rstrip("f")) for each in texts]
        found = np.frombuffer(data, {"uint32": "<u4", "float32": "<f4"}[array["type"]], array["count"], array["offset"])
        assert np.array_equal(found, np.array(wanted, found.dtype))


@pytest.mark.parametrize("name", FOLDS)
def test_buffers_are_the_arrays_of_the_source_code(materials, name, tmp_path):
    buffers.write(materials[name], tmp_path / "x.bin")
    data, said = (tmp_path / "x.bin").read_bytes(), json.loads((tmp_path / "x.bin.json").read_text())
    check_arrays(data, said, materials[name])
    must_fail(check_arrays, bytes([data[0] ^ 1]) + data[1:], said, materials[name])


def test_what_a_texture_cannot_hold(small_table):
    with pytest.raises(FormatError, match="expected a compact material for a texture"):
        texture.of(train(small_table, TrainOptions(clusters=4, epochs=1))[0])


def test_convert_says_how_near_a_texture_is(capsys, materials, tmp_path):
    save(next(iter(materials.values())), tmp_path / "a.smrl")
    status, out, err = run(capsys, "convert", tmp_path / "a.smrl", tmp_path / "x.ktx2")
    assert (status, err) == (0, "")
    assert "PSNR" in out
    # Again, over what it wrote itself; but not over what it did not write.
    assert run(capsys, "convert", tmp_path / "a.smrl", tmp_path / "x.ktx2")[0] == 0
    (tmp_path / "x.ktx2.json").write_text("{}")
    status, _, err = run(capsys, "convert", tmp_path / "a.smrl", tmp_path / "x.ktx2")
    assert status == 2
    assert "x.ktx2.json" in err
