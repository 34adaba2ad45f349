"""OpenPBR as MaterialX draws it: the shader that MaterialX generates for a material, asked for single pairs."""

import base64

import MaterialX as mx
import MaterialX.PyMaterialXGenGlsl as glsl
import MaterialX.PyMaterialXGenShader as shaders
import numpy as np
from browser import numbers
from webgl import LINKED

DRAW = (
    f"""
([vertex, pixel, values, wi, wo]) => {{
    {LINKED}"""
    + """
    const read = (text) => new Float32Array(Uint8Array.from(atob(text), (one) => one.charCodeAt(0)).buffer);
    const [lights, viewers] = [read(wi), read(wo)];
    const count = lights.length / 3;
    const gl = document.createElement("canvas").getContext("webgl2");
    gl.getExtension("EXT_color_buffer_float");
    const program = linked(gl, vertex, pixel);
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, count, 1);
    gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    const at = (name) => gl.getUniformLocation(program, name);
    gl.uniform1i(at("u_numActiveLightSources"), 1);
    gl.uniform1i(at("u_lightData[0].type"), 1);
    gl.uniform3f(at("u_lightData[0].color"), 1, 1, 1);
    gl.uniform1f(at("u_lightData[0].intensity"), 1);
    for (const [name, value] of Object.entries(values)) {
        if (Array.isArray(value)) gl.uniform3f(at(name), ...value);
        else if (typeof value === "boolean") gl.uniform1i(at(name), value);
        else gl.uniform1f(at(name), value);
    }
    for (let i = 0; i < count; i++) {
        const [l, v] = [lights.subarray(3 * i, 3 * i + 3), viewers.subarray(3 * i, 3 * i + 3)];
        gl.uniform3f(at("u_lightData[0].direction"), -l[0], -l[1], -l[2]);
        gl.uniform3f(at("u_viewPosition"), v[0], v[1], v[2]);
        gl.viewport(i, 0, 1, 1);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
    const out = new Float32Array(4 * count);
    gl.readPixels(0, 0, count, 1, gl.RGBA, gl.FLOAT, out);
    return [...out];
}
"""
)
# In the place of MaterialX's own, whose attributes and matrices a single triangle does not need.
VERTEX = """#version 300 es
out vec3 normalWorld;
out vec3 tangentWorld;
out vec3 positionWorld;
void main() {
    normalWorld = vec3(0.0, 0.0, 1.0);
    tangentWorld = vec3(1.0, 0.0, 0.0);
    positionWorld = vec3(0.0);
    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
"""


def read(text):
    """A document with MaterialX's own definitions, and what a file says."""
    document = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), document)
    mx.readFromXmlString(document, text.decode())
    return document


def shader(text):
    """The fragment shader that MaterialX generates for the material in a file, and the values of its uniforms."""
    document = read(text)
    light = document.addNode("directional_light", "light", "lightshader")
    generator = glsl.EsslShaderGenerator.create()
    context = shaders.GenContext(generator)
    context.registerSourceCodeSearchPath(mx.getDefaultDataSearchPath())
    options = context.getOptions()
    options.hwMaxActiveLightSources = 1
    options.hwSpecularEnvironmentMethod = shaders.HwSpecularEnvironmentMethod.SPECULAR_ENVIRONMENT_NONE
    options.hwSrgbEncodeOutput = False
    shaders.HwShaderGenerator.bindLightShader(light.getNodeDef(), 1, context)
    made = generator.generate("material", document.getMaterialNodes()[0], context)
    values = {}
    for uniform in made.getStage("pixel").getUniformBlock("PublicUniforms"):
        value = uniform.getValue().getData() if uniform.getValue() else None
        if isinstance(value, bool | float):
            values[uniform.getVariable()] = value
        elif value is not None and not isinstance(value, int | str):
            values[uniform.getVariable()] = list(value.asTuple())
    # Without an environment, MaterialX 1.39.5 leaves this one out, and uses it.
    declared = "uniform bool u_refractionTwoSided;\nuniform vec3 u_viewPosition;"
    return made.getSourceCode("pixel").replace("uniform vec3 u_viewPosition;", declared), values


def drawn(chromium, text, wi, wo):
    """f_r cos θ_i of the material in a .mtlx file, for pairs (n, 3)."""
    pixel, values = shader(text)
    page = chromium.new_page()
    pairs = [base64.b64encode(np.ascontiguousarray(w, "<f4").tobytes()).decode() for w in (wi, wo)]
    found = numbers(page, DRAW, [VERTEX, pixel, values, *pairs]).reshape(-1, 4)[:, :3]
    page.close()
    return found
