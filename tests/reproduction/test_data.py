"""Where the materials come from, and what they are called."""

import numpy as np
import pytest
from helpers import complaint, must_fail, run

from sommerl import BrdfTable, builtin
from sommerl.compression.material import SomManBrdf
from sommerl.formats import merl
from sommerl.reproduction.data import NAMES, STAND_INS, Data
from sommerl.reproduction.methods import METHODS, Source
from sommerl.reproduction.printed import printed
from sommerl.system.errors import FormatError


def check_small(sizes, most):
    assert sum(sizes) <= most


def test_the_stand_ins_are_small_and_all_there():
    sizes = [(STAND_INS / f"{name}.smrl").stat().st_size for name in NAMES]
    check_small(sizes, 100_000)
    must_fail(check_small, sizes, 50_000)
    assert "MIT License" in (STAND_INS / "LICENSE").read_text()
    for name in NAMES:
        found = Data().brdf(name)
        assert isinstance(found, SomManBrdf)
        assert found.name == name
        assert Data().table(name).lattice.size == printed("fig2")["cells of the table"].value


def test_data_of_ones_own(capsys, tmp_path):
    for name in ("purple-paint", "x"):
        merl.write(BrdfTable.sampled(builtin("red-fabric")), tmp_path / f"{name}.binary")
    own = Data(tmp_path)
    assert own.table("purple-paint").name == "purple-paint"
    assert own.names() == ("purple-paint", "x")
    assert own.caption == f"the files in {tmp_path.name}"
    assert Data(tmp_path, "NP stand-ins").caption == "NP stand-ins"
    assert Data(tmp_path / "x.binary").caption == "NBRDF stand-ins of x.binary"
    assert "themselves compressed" in Data().caption
    assert Data().names() == NAMES
    assert str(complaint(Data().place, "teflon")).startswith("teflon: expected one of the stand-ins")
    for data, message in (
        (tmp_path / "none", f"error: {tmp_path / 'none'}: expected a folder or an archive of materials, found none\n"),
        (tmp_path, f"error: {tmp_path}: there is no file blue-metallic-paint in it that ends in one of .smrl, "),
    ):
        status, _, err = run(capsys, "paper", "fig5", "--data", data, "-o", tmp_path)
        assert status == 1
        assert err.startswith(message)
        assert err.count("\n") == 1


def check_nearer(one, other, source):
    """One form of a material is nearer to it than the other, in soft light."""
    soft = [source.judge.metrics(stored.brdf)["psnr_soft_db"] for stored in (one, other)]
    assert soft[0] > soft[1]


@pytest.fixture(scope="module")
def source():
    return Source("purple-paint", Data())


def test_forms_with_entries_of_their_own(source):
    """Plain k-means and the SOM's weights are as near as the paper's form, and no originals."""
    made = {name: METHODS[name].make(source) for name in ("paper", "som", "k-means-256", "neighbours")}
    originals = np.unique(source.table.values.reshape(-1, 3).astype("f4"), axis=0)

    def check_originals(stored):
        lut = stored.brdf.lut.astype("f4")
        assert len(np.unique(np.concatenate([originals, lut]), axis=0)) == len(originals)

    check_originals(made["paper"])
    for name in ("som", "k-means-256"):
        must_fail(check_originals, made[name])
        check_nearer(made[name], made["neighbours"], source)
        must_fail(check_nearer, made["neighbours"], made[name], source)


def test_what_a_material_has_no_form_of(tmp_path, source):
    assert METHODS["network"].make(source) is None
    (tmp_path / "networks.npz").write_bytes(b"PK\x03\x04 damaged")
    with pytest.raises(FormatError, match=r"networks\.npz"):
        METHODS["network"].make(Source("purple-paint", Data(tmp_path)))
    assert METHODS["table-trilinear"].make(source).size == 34_992_012
