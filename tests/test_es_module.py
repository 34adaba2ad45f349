"""javascript/sommerl.js gives what Python gives, and its example runs."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from compact import FOLDS, material
from helpers import must_fail, random_directions, run_node

import sommerl
from sommerl import Lattice, SomManBrdf
from sommerl.compression.smrl import file

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "javascript"
GOLDEN = ROOT / "tests" / "golden"
COUNT = 10_000
A, B = random_directions(COUNT, 1), random_directions(COUNT, 2)
A[:100] *= [1, 1, -1]
B[100:200] = [0, 0, 1]
U = np.random.default_rng(4).random((COUNT, 3))
MAIN = """
import fs from "node:fs";
import { load } from "./sommerl.js";
const brdf = await load(fs.readFileSync(process.argv[2]));
const { a, b, u } = JSON.parse(fs.readFileSync(process.argv[3]));
const found = a.map((wi, i) => {
    const { wi: drawn, pdf, weight } = brdf.sample(wi, u[i]);
    return [...brdf.eval(wi, b[i]), brdf.pdf(wi, b[i]), ...drawn, pdf, ...weight];
});
console.log(JSON.stringify({ info: brdf.info, found }));
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The files of the package, as `npm pack` takes them."""
    made = tmp_path_factory.mktemp("package")
    for name in ("sommerl.js", "example.js", "package.json"):
        shutil.copy(SOURCE / name, made)
    run_node(SOURCE / "copy.js", made)
    (made / "main.js").write_text(MAIN)
    (made / "pairs.json").write_text(json.dumps({"a": A.tolist(), "b": B.tolist(), "u": U.tolist()}))
    return made


def asked(folder, path):
    answer = json.loads(run_node(folder / "main.js", path, folder / "pairs.json"))
    return answer["info"], np.array(answer["found"])


def cells(interpolation):
    rng = np.random.default_rng(3)
    index = rng.integers(0, 60, (9, 7, 11)).astype(np.uint8)
    lattice = Lattice(9, 7, 11, reciprocal=interpolation == "nearest")
    return SomManBrdf(rng.random((60, 3)) ** 4, index, lattice, name=interpolation, interpolation=interpolation)


KINDS = {
    "nearest": lambda: cells("nearest"),
    "trilinear": lambda: cells("trilinear"),
    **{name: lambda folds=folds: material("smooth", 3, folds=folds) for name, folds in FOLDS.items()},
}


def check_like_python(brdf, info, found):
    """A pair at the edge of a cell, of the material or of the sampler, may fall into the next one."""
    value, pdf, (wi, density, weight) = brdf.eval(A, B), brdf.pdf(A, B), brdf.sample(A, U)
    assert (info["name"], info["sha256"]) == (brdf.name, brdf.source.sha256)
    assert [info[name] for name in ("reciprocal", "mirrored", "signed")] == [
        brdf.reciprocal,
        brdf.mirrored,
        brdf.signed,
    ]
    size = np.abs(value).max(axis=1, keepdims=True)
    assert (np.abs(found[:, :3] - value) <= 1e-9 * size).all(axis=1).mean() > 0.999
    assert (np.abs(found[:, 3] - pdf) <= 1e-9 * pdf).mean() > 0.99
    same = np.abs(found[:, 4:7] - wi).max(axis=1) <= 1e-9
    same &= np.abs(found[:, 7] - density) <= 1e-9 * density
    assert same.mean() > 0.99
    close = np.abs(found[:, 8:] - weight) <= 1e-6 * np.abs(weight).max(axis=1, keepdims=True)
    assert close.all(axis=1)[same].mean() > 0.999


@pytest.mark.parametrize("kind", KINDS)
def test_like_python(folder, tmp_path, kind):
    brdf = KINDS[kind]()
    file.save(brdf, tmp_path / "x.smrl")
    info, found = asked(folder, tmp_path / "x.smrl")
    check_like_python(brdf, info, found)
    must_fail(check_like_python, brdf, info, found * 1.001)
    must_fail(check_like_python, brdf, info | {"name": "another"}, found)


def test_the_example(folder):
    """Which the page shows, too."""
    printed = run_node(folder / "example.js", GOLDEN / "nodes-2-both.smrl").decode()
    brdf = sommerl.load(GOLDEN / "nodes-2-both.smrl")
    (numbers,) = re.findall(r"f_r = (\S+) (\S+) (\S+) 1/sr", printed)
    assert np.allclose(np.float64(numbers), brdf.eval([0, 0, 1], [0.6, 0, 0.8]), rtol=1e-9)
    albedo = float(re.findall(r"albedo = (\S+)", printed)[0])
    assert abs(albedo / brdf.albedo(np.arccos(0.8)).mean() - 1) < 0.1
    shown = re.findall(r"```js\n(.*?)```", (SOURCE / "README.md").read_text(), re.DOTALL)
    assert shown == [(SOURCE / "example.js").read_text()]


RULES = """
import { load } from "./sommerl.js";
import fs from "node:fs";
const brdf = await load(fs.readFileSync(process.argv[2]));
const up = [0, 0, 1];
const said = await load(new ArrayBuffer(3)).catch((error) => error.message);
let random = "";
try { brdf.sample(up, [0, 0, 2]); } catch (error) { random = error.message; }
const values = [brdf.eval([NaN, 0, 1], up), brdf.pdf(up, [0, 0, Infinity]), brdf.eval(up, [0, 0, -1])];
console.log([...values, brdf.sample([0, 0, -1], up).pdf, said, random].join());
"""


def test_what_is_no_direction_or_no_file(folder):
    (folder / "rules.js").write_text(RULES)
    printed = run_node(folder / "rules.js", GOLDEN / "nodes.smrl").decode().strip()
    told = "expected at least 10 bytes, found 3,sample: random numbers have to be from 0 to 1, and some are not"
    assert printed == f"NaN,NaN,NaN,NaN,0,0,0,0,{told}"
