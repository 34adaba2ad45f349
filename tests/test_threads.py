"""The limit on threads, and that all native code obeys it: counted by the threads that are at work at the same time."""

import json
import os
import subprocess
import sys
from contextlib import contextmanager

import pytest
from helpers import must_fail, run

from sommerl.system import jit, threads
from sommerl.system.errors import OptionError

# Runs some work, and meanwhile looks how many threads run or wait for a processor at the same time, other than the one
# that looks: the mean of all looks that find any. Where a thread hands work over to another, both are found for a
# moment, and for a longer one on a busy machine. (The libraries' pools are apart, and wait for each other: one worker
# each of Dr.Jit and of OpenBLAS may work in turn. OpenBLAS is told not to spin when its work is done.)
WATCHED = """
import json, os, sys, threading
def runnable():
    found = 0
    for task in os.listdir("/proc/self/task"):
        try:
            with open(f"/proc/self/task/{task}/stat") as file:
                state = file.read().rsplit(")", 1)[1].split()[0]
        except OSError:
            continue
        found += state == "R" and task != str(threading.get_native_id())
    return found
seen, done = [], threading.Event()
def watch():
    while not done.wait(0.003):
        seen.append(runnable())
watcher = threading.Thread(target=watch, daemon=True)
import sommerl
{prepare}
watcher.start()
{work}
done.set()
watcher.join()
seen = [found for found in seen if found]
print(json.dumps([sum(seen) / len(seen), [os.environ.get(pool) for pool in sommerl.threads.POOLS]]))
"""
WORK = {
    "lookup": (
        "import numpy as np; from sommerl import _core\n"
        "up = np.abs(np.random.default_rng(0).standard_normal((4000000, 3)))",
        "_core.CellLookup((2, 2, 2), True, True, np.ones(24)).eval(up, up, threads=3)",
    ),
    "train": (
        "from sommerl import *; table = builtin_table('nickel')",
        "train(table, TrainOptions(clusters=500, epochs=1, radius=2))",
    ),
    "decode": (
        "from sommerl import _core; import numpy as np\n"
        "made = _core.NodePalette([*range(31), 180], [0] * 32, [[*range(63), 180]], [[*range(64)]], [1, 9], [[0, 0]])\n"
        "data = made.encode(*np.random.default_rng(0).integers(0, [[2], [1]], (2, 2**17)).astype(np.uint16))",
        "[_core.NodePalette.decode(data, True, False) for _ in range(5)]",
    ),
    "render": (
        "from sommerl import builtin; from sommerl.render import environment, images, passes, scenes\n"
        "import pathlib, sys\n"
        "exr = pathlib.Path(sys.argv[1]) / 'sky.exr'\n"
        "images.write_image(exr, environment.default_environment(64))",
        "scene = scenes.sphere(builtin('nickel'), environment.load_environment(exr), size=64)\n"
        "image = passes.render(scene, spp=256); images.write_image(exr, image.pixels)",
    ),
    "fit": (
        "from sommerl import builtin; from sommerl.fitting.fit import fit, FitOptions",
        "fit(builtin('nickel'), 'ggx', FitOptions(samples=50000, starts=1))",
    ),
    "factor": (
        "from sommerl import builtin; from sommerl.factored.fit import factor, FactorOptions",
        "factor(builtin('red-fabric'), FactorOptions(1, 1))",
    ),
}


def work(name, limit, folder):
    """How many threads were at work at the same time, and the pools' limits."""
    prepare, code = WORK[name]
    environment = {key: value for key, value in os.environ.items() if key not in (threads.VARIABLE, *threads.POOLS)}
    if limit:
        environment[threads.VARIABLE] = str(limit)
    environment["OPENBLAS_THREAD_TIMEOUT"] = "4"  # 2⁴ cycles, then sleep
    program = WATCHED.replace("{prepare}", prepare).replace("{work}", code)
    done = subprocess.run(
        [sys.executable, "-c", program, str(folder)], capture_output=True, text=True, env=environment, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def check_limited(found, limit):
    count, pools = found
    assert 1 <= count <= 1.25 * limit
    assert pools == [str(limit)] * len(threads.POOLS)


@pytest.mark.parametrize("name", WORK)
@pytest.mark.parametrize("limit", [1, 2])
def test_no_more_threads_are_at_work_than_the_limit(name, limit, tmp_path):
    check_limited(work(name, limit, tmp_path), limit)


def test_that_check_notices_more_threads(tmp_path):
    found = work("lookup", None, tmp_path)
    assert found[1] == [None] * len(threads.POOLS)
    must_fail(check_limited, [found[0], ["1"] * len(threads.POOLS)], 1)


def check_never_more(limited):
    """Dr.Jit, where the limit is above, at and below the number of threads that it has; and that it then has those that
    it needs."""
    dr = jit.drjit()
    before = dr.thread_count()
    for limit in (before + 3, before, 1):
        os.environ[threads.VARIABLE] = str(limit)
        with limited():
            assert dr.thread_count() == min(limit, before)
        assert dr.thread_count() == min(before, max(limit, jit.LEAST_THREADS))


def test_dr_jit_is_limited_and_never_given_more(monkeypatch):
    monkeypatch.setenv(threads.VARIABLE, "")
    before = jit.drjit().thread_count()

    @contextmanager
    def all_of_them():
        jit.drjit().set_thread_count(threads.limit())
        yield

    try:
        check_never_more(jit.limited)
        must_fail(check_never_more, all_of_them)
    finally:
        jit.drjit().set_thread_count(before)


WRONG = ("0", "257", "-1", "1.5", "abc", " 2", "1e1", "²", "9" * 30, "+1")


@pytest.mark.parametrize("value", WRONG)
def test_a_limit_that_is_none(value, monkeypatch, capsys):
    monkeypatch.setenv(threads.VARIABLE, value)
    with pytest.raises(OptionError, match=f"^{threads.VARIABLE}: expected 1 to {threads.MOST}, found "):
        threads.limit()
    status, out, err = run(capsys, "info", "nickel")
    assert (status, out, err) == (2, "", f"error: {threads.VARIABLE}: expected 1 to {threads.MOST}, found {value}\n")
    monkeypatch.setenv(threads.VARIABLE, "")
    assert threads.limit() is None
    status, out, err = run(capsys, "info", "nickel", f"--threads={value}")
    assert (status, out, err) == (2, "", f"error: --threads: expected 1 to {threads.MOST}, found {value}\n")


def test_the_option_goes_before_the_variable(monkeypatch, capsys):
    monkeypatch.setenv(threads.VARIABLE, "2")
    assert threads.limit() == 2
    assert run(capsys, "info", "nickel", "--threads", "1")[0] == 0
    assert threads.limit() == 1


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("/usr/bin/python /x/bin/sommerl info x --threads 3", "3"),
        ("python -m sommerl info --threads=4 x", "4"),
        ("sommerl.exe info --threads 1 --threads 2", "2"),
        ("python -m sommerl info x", ""),
        ("python -m sommerl info x --threads", ""),
        ("python -m pytest --threads 3", ""),
        ("python script.py --threads 3", ""),
        ("", ""),
    ],
)
def test_the_option_is_seen_before_numpy_is_imported(line, found):
    assert threads._typed(line.split()) == found


def test_a_command_limits_the_pools_of_numpy(tmp_path):
    """The folder is one whose modules come first: there, NumPy says what it is started with, and is none."""
    (tmp_path / "numpy.py").write_text(f"import os\nraise SystemExit(os.environ.get({threads.POOLS[0]!r}, 'none'))\n")
    environment = {key: value for key, value in os.environ.items() if key not in (threads.VARIABLE, *threads.POOLS)}
    environment["PYTHONPATH"] = str(tmp_path)
    for options, wanted in (([], "none"), (["--threads", "3"], "3"), (["--threads=0"], "none")):
        command = [sys.executable, "-m", "sommerl", "info", "nickel", *options]
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        assert done.stderr.strip() == wanted
