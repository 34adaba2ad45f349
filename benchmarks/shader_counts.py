"""How many instructions does a material take in a shader: compact, as a texture, and formulas beside it?

    uv run python benchmarks/shader_counts.py MATERIAL.smrl

The material is written as GLSL, as `convert` does, with arrays in buffers, and as a texture. Its peers are two lobes
(Lambert and GGX) and Disney's principled model (diffuse, sheen, GGX with a metallic and a dielectric part, clear coat),
written out here with their parameters in uniforms. Each is translated by glslangValidator to SPIR-V; spirv-opt
(spirv-tools) inlines functions, unrolls loops and removes what is not used. Counted are the instructions of `main` that
compute: not labels, variables, names, or the loads and stores of those.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import tempfile
from collections import Counter
from pathlib import Path

from sommerl import load
from sommerl.compression.material import SomManBrdf
from sommerl.formats import texture
from sommerl.formats.shader import source
from sommerl.formats.shader.language import LANGUAGES

FREE = {
    "Label",
    "Variable",
    "Branch",
    "FunctionEnd",
    "Function",
    "Return",
    "LoopMerge",
    "SelectionMerge",
    "Undef",
    "Phi",
}
COMMON = """
const float PI = 3.14159265;
float fifth(float x) { return x * x * x * x * x; }
float facets(vec3 h, vec3 wi, vec3 wo, float alpha) {
    float a2 = alpha * alpha;
    float t = h.z * h.z * (a2 - 1.0) + 1.0;
    float i = wo.z * sqrt(a2 + (1.0 - a2) * wi.z * wi.z);
    float o = wi.z * sqrt(a2 + (1.0 - a2) * wo.z * wo.z);
    return a2 / (PI * t * t) * 0.5 / (i + o);
}
"""
GGX = """
uniform vec3 base; uniform vec3 gloss; uniform float alpha; uniform float f0;
vec3 found(vec3 wi, vec3 wo) {
    if (!(wi.z > 0.0 && wo.z > 0.0)) return vec3(0.0);
    vec3 h = normalize(wi + wo);
    return base / PI + gloss * (facets(h, wi, wo, alpha) * (f0 + (1.0 - f0) * fifth(1.0 - dot(wi, h))));
}
"""
DISNEY = """
uniform vec3 base; uniform float metallic; uniform float roughness; uniform float specular; uniform float tint;
uniform float sheen; uniform float sheen_tint; uniform float coat; uniform float coat_gloss;
float masked(float c) { return 2.0 * c / (c + sqrt(c * c + 0.0625 * (1.0 - c * c))); }
vec3 found(vec3 wi, vec3 wo) {
    if (!(wi.z > 0.0 && wo.z > 0.0)) return vec3(0.0);
    vec3 h = normalize(wi + wo);
    float d = dot(wi, h);
    float fd = fifth(1.0 - d), fi = fifth(1.0 - wi.z), fo = fifth(1.0 - wo.z);
    vec3 hue = base / max(dot(base, vec3(0.2126, 0.7152, 0.0722)), 1e-6);
    float back = 2.0 * roughness * d * d;
    float matte = (1.0 - 0.5 * fi) * (1.0 - 0.5 * fo) + back * (fi + fo + fi * fo * (back - 1.0));
    vec3 f0 = mix(0.08 * specular * mix(vec3(1.0), hue, tint), base, metallic);
    vec3 gloss = (f0 + (1.0 - f0) * fd) * facets(h, wi, wo, max(roughness * roughness, 0.001));
    float a = mix(0.1, 0.001, coat_gloss);
    float narrow = (a * a - 1.0) / (PI * log(a * a) * (1.0 + (a * a - 1.0) * h.z * h.z));
    float clear = 0.25 * coat * (0.04 + 0.96 * fd) * narrow * masked(wi.z) * masked(wo.z);
    return (1.0 - metallic) * (base * matte / PI + sheen * fd * mix(vec3(1.0), hue, sheen_tint)) + gloss + clear;
}
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("material", type=Path)
    material = load(parser.parse_args().material)
    assert isinstance(material, SomManBrdf)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        texture.write(material, folder / "t.ktx2")
        sampled = f"uniform highp sampler3D t;\n{(folder / 't.ktx2.glsl').read_text()}"
        bodies = {
            "Lambert and GGX": COMMON + GGX,
            "Disney's principled": COMMON + DISNEY,
            "texture": f"{sampled}vec3 found(vec3 wi, vec3 wo) {{ return material_t_eval(t, wi, wo); }}\n",
            "compact": compact(material),
        }
        counts = {each: counted(folder, body) for each, body in bodies.items()}
    least = counts["Lambert and GGX"].total()
    print(f"{'':22}instructions   of GGX's   reads of textures and buffers")
    for each, found in counts.items():
        reads = found["ImageSampleExplicitLod"] + found["Load"]
        print(f"{each:22}{found.total():12}{found.total() / least:11.2f}{reads:16}")


def compact(material: SomManBrdf) -> str:
    """The source code, whose arrays lie in buffers."""
    text = source.source(material, LANGUAGES[".glsl"], "m", source.Settings(sampler=False))
    readers = [array.reader.replace("@NAME@", "m") for array in source.arrays_of(material)]
    head = ""
    for number, reader in enumerate(readers):
        kind = "uint" if reader.endswith(("WORD", "LATTICE", "SAMPLER")) else "float"
        head += f"layout(std430, binding = {number}) readonly buffer B{number} {{ {kind} b{number}[]; }};\n"
        head += f"#define {reader}(i) b{number}[i]\n"
    return f"{head}{text}vec3 found(vec3 wi, vec3 wo) {{ return m_eval(wi, wo); }}\n"


def counted(folder: Path, body: str) -> Counter[str]:
    """The instructions of `main`, by their names."""
    places = (f"layout(location = {k}) {each};\n" for k, each in enumerate(("in vec3 a", "in vec3 b")))
    head = f"#version 450\n{''.join(places)}layout(location = 0) out vec4 o;\n"
    shader, binary, best = folder / "x.frag", folder / "x.spv", folder / "best.spv"
    shader.write_text(f"{head}{body}void main() {{ o = vec4(found(a, b), 1.0); }}\n")
    run("glslangValidator", "-G", "--auto-map-locations", "--auto-map-bindings", shader, "-o", binary)
    run("spirv-opt", "--inline-entry-points-exhaustive", "-O", binary, "-o", best)
    # Loops are unrolled where they say so.
    (folder / "x.spvasm").write_text(re.sub(r"(OpLoopMerge .*) None", r"\1 Unroll", run("spirv-dis", best)))
    run("spirv-as", "--target-env", "spv1.0", "--preserve-numeric-ids", folder / "x.spvasm", "-o", binary)
    run("spirv-opt", "--loop-unroll", "-O", binary, "-o", best)
    listed = run("spirv-dis", "--no-header", best)
    whole = listed[listed.index("OpFunction ") :]
    names = (line.split("= ")[-1].split()[0].removeprefix("Op") for line in whole.splitlines() if "Op" in line)
    return Counter(name for name in names if name not in FREE)


def run(*words: str | Path) -> str:
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{words[0]}: {done.stdout}{done.stderr}")
    return done.stdout


if __name__ == "__main__":
    main()
