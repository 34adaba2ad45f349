"""The paper's Fig. 1: its material on its statue, and on ours. Goals, not measured bests."""

import json

import pytest
from helpers import run, run_json


@pytest.mark.parametrize("own", [True, False])
def test_psnr_is_at_least_the_papers(capsys, stand_in, buddha, tmp_path, own):
    """Of the Buddha, the normals are computed, which is said."""
    table, material = stand_in("blue-metallic-paint"), tmp_path / "blue.smrl"
    run_json(capsys, "compress", table, "-o", material)
    scene = ["--scene", "statue", *([] if own else ["--mesh", buddha])]
    status, out, err = run(capsys, "render", *scene, material, "--against", table, "-o", tmp_path / "x.png", "--json")
    found = json.loads(out)
    sentences = [] if own else [f"{buddha}: it has no vertex normals: they are computed from its faces"]
    assert (status, found["warnings"]) == (0, sentences)
    assert err.splitlines() == [f"warning: {sentence}" for sentence in sentences]
    assert found["psnr_object_db"] >= 52.5
    assert found["psnr_frame_db"] > found["psnr_object_db"]
    assert found["reference"] == "blue-metallic-paint.binary (nearest)"
    assert found["candidate"] == "blue.smrl: blue-metallic-paint (nearest)"
