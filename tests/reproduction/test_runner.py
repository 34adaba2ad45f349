"""Cells are made once, kept whole, and made again only where they are stale."""

import json
from dataclasses import replace

import made_cells
import pytest
from helpers import must_fail

from sommerl.reproduction.cells import FULL, QUICK, Cell, Setting, Store, plain
from sommerl.reproduction.data import NAMES, Data
from sommerl.reproduction.runner import run
from sommerl.system.errors import MaterialError

SETTING = Setting(Data(), QUICK)


def made(cells, folder, setting=SETTING):
    return run(cells, setting, Store(folder / "cells"))


def check_made(folder, **times):
    assert {name: made_cells.times_made(folder, name) for name in times} == times


def test_a_run_goes_on_where_it_was_stopped(tmp_path):
    cells = [made_cells.cell(tmp_path, "a"), made_cells.cell(tmp_path, "b/c", 2.0, alone=True)]
    first = made(cells[:1], tmp_path)
    outcomes = made(cells, tmp_path)
    check_made(tmp_path, **{"a": 1, "b/c": 1})
    must_fail(lambda: check_made(tmp_path, a=2))
    assert outcomes["a"] == first["a"]
    assert dict(outcomes["b/c"].values) == {"value": 2.0, "nothing": None}
    assert outcomes["b/c"].pictures["grey"].startswith(b"RIFF")
    assert made(cells, tmp_path) == outcomes  # from files, as it was


def test_what_is_stale_or_not_whole_is_made_again(tmp_path):
    cell = made_cells.cell(tmp_path, "a")
    made([cell], tmp_path)
    for times, stale in enumerate((made_cells.cell(tmp_path, "a", 3.0), cell), start=2):  # other arguments, and back
        made([stale], tmp_path)
        check_made(tmp_path, a=times)
    made([cell], tmp_path, replace(SETTING, extent=FULL))
    check_made(tmp_path, a=4)
    (tmp_path / "cells" / "a.grey.webp").unlink()
    made([cell], tmp_path, replace(SETTING, extent=FULL))
    check_made(tmp_path, a=5)
    (tmp_path / "cells" / "a.json").write_text('{"sommerl_cell": ')
    made([cell], tmp_path, replace(SETTING, extent=FULL))
    check_made(tmp_path, a=6)


def test_a_cell_depends_on_the_bytes_of_its_materials(tmp_path):
    cell = Cell("a", made_cells.counted, {}, (NAMES[0],))
    path = tmp_path / f"{NAMES[0]}.smrl"
    keys = set()
    for content in (b"one", b"other"):
        folder = tmp_path / content.decode()
        folder.mkdir()
        (folder / path.name).write_bytes(content)
        keys.add(cell.key(Setting(Data(folder), QUICK)))
    assert len({*keys, cell.key(SETTING)}) == 3
    assert cell.key(SETTING) == cell.key(Setting(Data(called="another name"), QUICK))


def test_what_is_done_is_kept_when_a_cell_fails(tmp_path):
    cells = [made_cells.cell(tmp_path, "a", cost=2.0), Cell("b", made_cells.refused, alone=True)]
    with pytest.raises(MaterialError, match="refused: expected another material"):
        made(cells, tmp_path)
    assert json.loads((tmp_path / "cells" / "a.json").read_text())["values"]["value"] == 1.0
    assert not (tmp_path / "cells" / "b.json").exists()


def test_progress_is_told_in_the_cells_cost(tmp_path):
    told = []

    class Bar:
        def __enter__(self):
            return lambda done, total: told.append((done, total))

        def __exit__(self, *_):
            return None

    cells = [made_cells.cell(tmp_path, name, cost=cost, alone=True) for name, cost in (("a", 1.0), ("b", 3.0))]
    run(cells, SETTING, Store(tmp_path / "cells"), lambda _: Bar())
    assert told[0] in ((10, 40), (30, 40))
    assert told[1:] == [(40, 40)]


def test_values_are_those_of_json():
    assert plain({"a": [1, float("nan"), 1 / 3], 2: (float("inf"), "x", None, True)}) == {
        "a": [1, None, 0.333333],
        "2": [None, "x", None, True],
    }
