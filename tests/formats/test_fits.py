import json

import numpy as np
import pytest
from helpers import check_sentence, complaint, must_fail, random_directions
from hypothesis import given, settings
from hypothesis import strategies as st

from sommerl import load
from sommerl.formats import fits
from sommerl.models.multi_lobe import FAMILIES, Lobe, MultiLobe
from sommerl.models.standard import Surface
from sommerl.models.standards import STANDARDS
from sommerl.system.errors import FormatError

A, B = random_directions(200, 1), random_directions(200, 2)
LOBES = [
    Lobe(FAMILIES["lambertian"], (0.3, 0.2, 0.1), {}),
    Lobe(FAMILIES["cook-torrance"], (0.5, 0.5, 0.4), {"m": 0.1234567890123, "f0": 0.04}),
]
ROWS = [
    {"model": "cook-torrance", "parameters": [lobe.as_json() for lobe in LOBES]},
    {"model": "lambertian", "parameters": [LOBES[0].as_json()]},
]


@pytest.fixture
def path(tmp_path):
    fits.write(tmp_path / "x.json", "paint", ROWS)
    return tmp_path / "x.json"


def check_same(found, expected):
    assert np.array_equal(found.eval(A, B), expected.eval(A, B))


def test_a_fit_is_read_as_the_material_that_it_is(path):
    first, second = load(path), load(f"{path}:lambertian")
    assert (first.name, second.name) == ("paint (cook-torrance fit)", "paint (lambertian fit)")
    check_same(first, MultiLobe("", LOBES))
    check_same(second, MultiLobe("", LOBES[:1]))
    must_fail(check_same, first, second)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sommerl_fits": 2}, 'expected fits as `sommerl fit` writes them, with "sommerl_fits": 1, found 2'),
        ({"sommerl_fits": True}, 'expected fits as `sommerl fit` writes them, with "sommerl_fits": 1, found True'),
        ({"material": 1}, "material: expected a name of at most 200 characters, found something else"),
        ({"material": "x" * 201}, "material: expected a name of at most 200 characters, found something else"),
        ({"fits": []}, "fits: expected one or more, found none"),
        ({"fits": 1}, "fits: expected a list of at most 100, found something else"),
        ({"fits": [1]}, "fits: expected a JSON object, found int"),
        ({"fits": [{}]}, "model: expected a name of at most 200 characters, found something else"),
        ({"fits": [{"model": "x"}]}, "parameters: expected a list of at most 100, found something else"),
        ({"fits": [{"model": "x", "parameters": []}]}, "paint (x fit): expected one lobe or more, found none"),
        (
            {"fits": [{"model": "x", "parameters": [{"family": "ward"}]}]},
            "albedo: expected a list of at most 100, found",
        ),
        (
            {"fits": [{"model": "x", "parameters": [{"family": ["ward"]}]}]},
            "parameters: expected a family of lambertian",
        ),
    ],
)
def test_other_content(path, change, message):
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(FormatError) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}: {message}")


@pytest.mark.parametrize(
    ("lobe", "message"),
    [
        ({"family": "ward", "albedo": [0, 0, 0]}, "ward: expected parameters ['alpha'], found []"),
        ({"family": "ward", "albedo": [0, 0, 0], "alpha": 7}, "ward: alpha: expected 0.004 to 1, found 7"),
        ({"family": "ward", "albedo": [0, 0, 0], "alpha": float("nan")}, "ward: alpha: expected 0.004 to 1, found nan"),
        ({"family": "ward", "albedo": [0, 0, 0], "alpha": "x"}, "ward: expected numbers, found something else"),
        ({"family": "ward", "albedo": [10**400, 0, 0], "alpha": 1}, "ward: expected numbers, found something else"),
        ({"family": "ward", "albedo": [0, 0, 0], "alpha": 10**400}, "ward: expected numbers, found something else"),
        ({"family": "ward", "albedo": [0, 0, 0], "x" * 201: 1}, "ward: expected a name of at most 200 characters"),
        ({"family": "ward", "albedo": [1e31, 0, 0], "alpha": 1}, "ward: albedo: expected three numbers of at least 0"),
        ({"family": "ward", "albedo": [0, 0], "alpha": 1}, "ward: albedo: expected three numbers of at least 0"),
        ({"family": "ward", "albedo": [0, -1, 0], "alpha": 1}, "ward: albedo: expected three numbers of at least 0"),
    ],
)
def test_other_lobes(path, lobe, message):
    path.write_text(json.dumps({"sommerl_fits": 1, "material": "x", "fits": [{"model": "m", "parameters": [lobe]}]}))
    with pytest.raises(FormatError, match="^" + str(path)) as caught:
        load(path)
    assert message in str(caught.value)


def test_another_json_file(tmp_path):
    path = tmp_path / "snippet.json"
    path.write_text('{"type": "sommerl"}')
    assert complaint(load, path) == (
        f'{path}: expected fits as `sommerl fit` writes them, with "sommerl_fits": 1, found another JSON file'
    )


def test_names_are_made_visible(path):
    changed = json.loads(path.read_text()) | {"material": "\x1b[31mred"}
    changed["fits"][1]["model"] = "\x1bx"
    path.write_text(json.dumps(changed))
    assert load(path).name == "�[31mred (cook-torrance fit)"
    assert "\x1b" not in complaint(load, f"{path}:\x1bnone")


def test_members(path):
    with pytest.raises(FormatError) as caught:
        load(f"{path}:ggx")
    assert str(caught.value) == f"{path}: expected one of cook-torrance, lambertian, found ggx"


def test_every_truncation_gets_a_sentence(tmp_path, path):
    data = path.read_bytes().strip()
    short = tmp_path / "short.json"
    for length in range(len(data)):
        short.write_bytes(data[:length])
        message = complaint(load, short)
        assert message is not None
        check_sentence(message, str(short))


@settings(max_examples=200, deadline=None)
@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
        lambda inner: (
            st.lists(inner, max_size=4)
            | st.dictionaries(st.sampled_from(["fits", "model", "parameters", "family", "albedo", "alpha"]), inner)
        ),
        max_leaves=12,
    )
)
def test_anything_else_gets_a_sentence(tmp_path_factory, value):
    path = tmp_path_factory.getbasetemp() / "any.json"
    top = value if isinstance(value, dict) else {"fits": value}
    path.write_text(json.dumps({"sommerl_fits": 1} | top))
    check_sentence(complaint(load, path), str(path))


def test_too_deep_and_too_large(tmp_path):
    path = tmp_path / "x.json"
    path.write_text('{"sommerl_fits": ' + "[" * 100_000)
    check_sentence(complaint(load, path), str(path))
    assert complaint(load, path) is not None
    with path.open("wb") as out:
        out.write(b'{"sommerl_fits": 1')
        out.truncate(fits.LARGEST_FILE + 1)
    assert complaint(load, path) == f"{path}: expected at most 16777216 bytes, found 16777217"


SURFACE = {
    "model": "gltf",
    "baseColorFactor": [0.5, 0.25, 0.125],
    "metallicFactor": 0.25,
    "roughnessFactor": 0.3,
    "specularFactor": 1.0,
    "specularColorFactor": [1.0, 2.0, 1.0],
    "clearcoatFactor": 0.5,
    "clearcoatRoughnessFactor": 0.1,
    "sheenColorFactor": [0.0, 0.0, 0.1],
    "sheenRoughnessFactor": 0.5,
}


def test_a_standards_surface_is_read_as_the_material_that_it_is(tmp_path):
    fits.write(tmp_path / "x.json", "paint", [{"model": "gltf", "parameters": SURFACE}])
    found = load(tmp_path / "x.json")
    values = {key: value for key, value in SURFACE.items() if key != "model"}
    check_same(found, Surface("", STANDARDS["gltf"], values))
    assert found.info().surface == SURFACE
    must_fail(check_same, found, Surface("", STANDARDS["gltf"], values | {"metallicFactor": 0.3}))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"model": "x"}, "parameters: expected a model of openpbr, principled, gltf, found another or none"),
        ({"model": ["gltf"]}, "parameters: expected a model of openpbr"),
        ({"metallicFactor": 2}, "gltf: metallicFactor: expected a number from 0 to 1, found 2"),
        ({"metallicFactor": float("nan")}, "gltf: metallicFactor: expected a number from 0 to 1, found nan"),
        ({"metallicFactor": [1, 1, 1]}, "gltf: metallicFactor: expected a number, found something else"),
        ({"baseColorFactor": 1}, "gltf: baseColorFactor: expected three numbers, found something else"),
        ({"baseColorFactor": [1, 1]}, "gltf: baseColorFactor: expected three numbers from 0 to 1, found (1.0, 1.0)"),
        ({"baseColorFactor": [1, 1, "x"]}, "gltf: expected numbers, found something else"),
        ({"baseColorFactor": {}}, "gltf: expected numbers, found something else"),
        ({"x": 1}, "gltf: expected inputs ["),
    ],
)
def test_other_inputs(tmp_path, change, message):
    fits.write(tmp_path / "x.json", "paint", [{"model": "gltf", "parameters": SURFACE}])
    found = json.loads((tmp_path / "x.json").read_text())
    found["fits"][0]["parameters"] |= change
    (tmp_path / "x.json").write_text(json.dumps(found))
    with pytest.raises(FormatError) as caught:
        load(tmp_path / "x.json")
    assert message in str(caught.value)
