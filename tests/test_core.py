"""The Rust core, given anything: errors that `except Exception` catches, and no fault of its own."""

import itertools
import json
import random
import resource
import subprocess
import sys

import numpy as np
import pytest
from compact import FOLDS, material, whole
from helpers import must_fail

from sommerl import _core

RNG = np.random.default_rng(0)
F32 = RNG.random((40, 3)).astype(np.float32)
UP = np.abs(RNG.standard_normal((70, 3)))
MADE = material((2, 2, 3, 3, "walk"), 1)
FOLDED = material((2, 2, 3, 3, "walk"), 1, folds=FOLDS["mirrored"], signed=True)
RECIPROCAL, MIRRORED = (
    [*made.lattice.axes(), made.palette.gains, made.lut, *made.index, 1.0] for made in (MADE, FOLDED)
)
FIELDS = [[0, 30, 180], [0, 1, 1], [[0, 180], [0, 180]], [[0, 90], [0]], [-1, 2], [[0, 1], [0, 1]], False, False]
NODES = 8
BITS = [np.zeros(NODES, np.uint16), np.ones(NODES, np.uint16)]
PRIOR = [[0.1] * 10] * 3, [0.1] * 3
KNOWING = _core.NodePalette(*FIELDS, prior=PRIOR)
EQUATIONS = [
    np.arange(NODES + 1, dtype=np.int32),
    np.arange(NODES, dtype=np.int32),
    np.ones(NODES),
    np.ones((NODES, 3)),
]
SWEEP = [np.array([0.0, 1.0]), np.ones((2, 3)), _core.NormalEquations(*EQUATIONS), 0.1]
SAMPLES = [np.sort(RNG.random((50, 3)) * 180, axis=0), RNG.random(50), RNG.random((50, 3))]

LEARNER = [F32, np.arange(40, dtype=np.uint32), F32[:20].copy(), "kohonen", 5, "boxes", "portable", False]
PRESENT = [0, 40, 0.5, np.array([1, 0.5], np.float32)]


def presented(*arguments):
    learner = _core.Learner(*LEARNER)
    learner.present(0, 40, 0.1, np.ones(1, np.float32))
    return learner.present(*arguments), learner.settled(), learner.weights(), learner.stored_cells()


def swept(*arguments):
    return _core.NodePalette(*FIELDS).sweep(*(np.copy(each) for each in BITS), *arguments)


def equations(*arguments):
    made = _core.NormalEquations(*arguments)
    return made.right, made.squares, made.diagonal()


def equations_of(*arguments):
    made = _core.NormalEquations.of(*arguments)
    return made.right, made.squares, made.diagonal()


def in_cells(*arguments):
    return _core.CellLookup(*arguments[:5]).eval(*arguments[5:])


def on_nodes(*arguments):
    return _core.NodeLookup(*arguments[:12]).eval(*arguments[12:])


# What is called, and arguments that fit.
CALLS = {
    "learner": (_core.Learner, LEARNER),
    "present": (presented, PRESENT),
    "quantiser": (_core.Quantiser, [F32, "boxes", "portable", 2]),
    "query": (lambda *triples: _core.Quantiser(F32, "boxes", None, 2).query(*triples), [F32]),
    "query-all": (lambda *triples: _core.Quantiser(F32, "all", None, 2).query(*triples), [F32]),
    "lookup": (in_cells, [(2, 2, 2), True, False, RNG.random(24), None, UP, UP, "portable", 2]),
    "lookup-trilinear": (in_cells, [(2, 2, 2), False, True, RNG.random(24), None, UP, UP, "portable", 2]),
    "lookup-index": (in_cells, [(2, 2, 2), True, True, RNG.random(6), np.ones(8, np.uint8), UP, UP, None, 2]),
    "lookup-index-16": (in_cells, [(2, 2, 2), True, False, RNG.random(6), np.ones(8, np.uint16), UP, UP, None, 2]),
    "lookup-nodes": (on_nodes, [*RECIPROCAL, True, False, False, UP, UP, "portable", 2]),
    "lookup-mirrored": (on_nodes, [*MIRRORED, False, True, True, UP, UP, None, 2]),
    "nodes": (_core.NodePalette, FIELDS),
    "encode": (lambda *bits: _core.NodePalette(*FIELDS).encode(*bits), [*BITS, None]),
    "measure": (lambda *bits: _core.NodePalette(*FIELDS).measure(*bits), BITS),
    "decode": (_core.NodePalette.decode, [whole(MADE), True, False, 2, "portable"]),
    "decode-mirrored": (_core.NodePalette.decode, [whole(FOLDED), False, True, 2, None]),
    "decode-1": (_core.NodePalette.decode, [whole(MADE, 1), True, False, 1, None]),
    "prior": (lambda *prior: _core.NodePalette(*FIELDS, prior=prior), list(PRIOR)),
    "learnt": (lambda *bits: _core.NodePalette(*FIELDS).learnt(*bits), BITS),
    "decode-part": (KNOWING.decode_part, [KNOWING.encode(*BITS), "portable"]),
    "sweep": (swept, SWEEP),
    "line-errors": (_core.line_errors, [5, RNG.random((35, 3)), RNG.random(35), "portable", 2]),
    "equations": (equations, EQUATIONS),
    "equations-of": (equations_of, [*FIELDS[:4], *SAMPLES, False, False, 2]),
    "held": (lambda *given: _core.NormalEquations(*EQUATIONS).held(*given).right, [np.ones((NODES, 3)), 0.1]),
    "with-right": (lambda right: _core.NormalEquations(*EQUATIONS).with_right(right).right, [np.ones((NODES, 3))]),
    "solved": (_core.NormalEquations(*EQUATIONS).solved, [np.zeros((NODES, 3)), 1e-3, 5]),
    "product": (_core.NormalEquations(*EQUATIONS).product, [np.ones((NODES, 3))]),
    "entries": (_core.NormalEquations(*EQUATIONS).between_entries, [BITS[1], np.ones((NODES, 2)), 2]),
}
HUGE = (0, 1, 2, 3, 255, 256, 65536, 2**31, 2**32 - 1, 2**32, 2**63 - 1, 2**63, 2**64 - 1, -1)


def other(value, rng):
    """Something in the place of an argument, near to it or not."""
    if rng.random() < 0.2:
        return rng.choice(
            [None, 0, -1, "", "boxes", b"", [], {}, np.nan, 1.5, 2**64, np.zeros(0), np.zeros((0, 3)), ()]
        )
    if isinstance(value, np.ndarray):
        return array(value, rng)
    if isinstance(value, bytes):
        cut = rng.randrange(len(value) + 1)
        return value[:cut] + rng.randbytes(rng.randrange(9)) + value[cut + rng.randrange(3) :]
    if isinstance(value, list | tuple):
        return nested(value, rng)
    if isinstance(value, float):
        return rng.choice([np.nan, np.inf, -np.inf, 0.0, -0.0, -1.0, 1e300, 1e-300, 2.0, value])
    return rng.choice(HUGE)


def array(value, rng):
    changed = value.copy()
    odd = [np.nan, np.inf, -np.inf, 0.0, -1.0, 1e38, 1e300, 1e-300] if value.dtype.kind == "f" else HUGE[:9]
    for _ in range(rng.randrange(4)):
        if changed.size:
            with np.errstate(all="ignore"):
                number = np.array(rng.choice(odd)).astype(value.dtype)
            changed.reshape(-1)[rng.randrange(changed.size)] = number
    with np.errstate(all="ignore"):
        cast = changed.astype(rng.choice(["f4", "f8", ">f8", "u1", "u2", "i4", "O"]))
    shapes = [changed, changed[:-1], changed[::2], changed[::-1], changed[..., None], changed.reshape(-1), changed.T]
    return [*shapes, cast, np.repeat(changed, 2, 0)][rng.randrange(9)]


def nested(value, rng):
    changed = list(value)
    for _ in range(rng.randrange(1, 3)):
        at = rng.randrange(len(changed) + 1)
        how = rng.randrange(3)
        if how == 0:
            changed.insert(at, rng.choice([*changed, 0, 180, 255, 4095, 2**31, [], [0, 180]]))
        elif at < len(changed):
            inner = changed[at]
            changed[at : at + 1] = (
                [] if how == 1 else [nested(inner, rng) if isinstance(inner, list) else rng.choice(HUGE)]
            )
    return tuple(changed) if isinstance(value, tuple) else changed


def check_no_fault(call, arguments):
    fault = None
    try:
        call(*arguments)
    except (ValueError, TypeError, OverflowError):
        pass
    except BaseException as error:
        fault = error
    assert fault is None, (fault, arguments)


@pytest.mark.parametrize("name", CALLS)
def test_anything_at_all(name):
    call, fine = CALLS[name]
    call(*fine)
    rng = random.Random(name)
    for _ in range(5000):
        arguments = list(fine)
        for at in rng.sample(range(len(fine)), rng.randrange(1, min(3, len(fine)) + 1)):
            arguments[at] = other(fine[at], rng)
        check_no_fault(call, arguments)


def test_that_check_notices_faults():
    class PanicException(BaseException):
        """As PyO3 raises it."""

    def panics(*_):
        raise PanicException

    must_fail(check_no_fault, panics, [])


def refused(call, *arguments):
    with pytest.raises(ValueError, match=r"^[^\n]*expected [^\n]*$") as caught:
        call(*arguments)
    return str(caught.value)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, -0.1, 1.5])
def test_the_learner_takes_shares_alone(bad):
    wrong = F32.copy()
    wrong[7, 1] = bad
    assert "triples" in refused(_core.Learner, wrong, *LEARNER[1:])
    assert "weights" in refused(_core.Learner, F32, LEARNER[1], wrong, *LEARNER[3:])
    assert "alpha" in refused(presented, 0, 40, bad, np.ones(1, np.float32))
    assert "falloff" in refused(presented, 0, 40, 0.5, np.array([1, bad], np.float32))
    if not np.isfinite(bad):
        assert "lut" in refused(_core.Quantiser, wrong)
        assert "triples" in refused(_core.Quantiser(F32).query, wrong)


def test_numbers_of_cells_that_overflow():
    for bins in ((2**32, 2**32, 1), (2**63, 2, 1), (2**21, 2**22, 2**21), (2**64 - 1, 1, 1)):
        for values, index in ((np.zeros(0), None), (np.zeros(3), np.zeros(0, np.uint8)), (np.zeros(3), None)):
            refused(_core.CellLookup, bins, True, False, values, index)


def test_no_entry_no_number():
    for index, trilinear in itertools.product(
        (np.full(8, 3, np.uint8), np.full(8, 2**16 - 1, np.uint16)), (False, True)
    ):
        assert np.isnan(in_cells((2, 2, 2), True, trilinear, np.ones(9), index, UP, UP)).all()
        assert not np.isnan(in_cells((2, 2, 2), True, trilinear, np.ones(3 * 2**16), index, UP, UP)).any()


WITHOUT_THREADS = """
import hashlib, json, resource, sys
import numpy as np
from sommerl import _core
lut = np.random.default_rng(0).random((300, 3)).astype(np.float32)
triples = np.random.default_rng(1).random((20000, 3)).astype(np.float32)
up = np.abs(np.random.default_rng(2).standard_normal((20000, 3)))
prepared = _core.CellLookup((2, 2, 2), True, True, np.arange(24.0))
def found(threads):
    values = prepared.eval(up, up, threads=threads)
    made = _core.Quantiser(lut, threads=threads).query(triples), values
    return [hashlib.sha256(each).hexdigest() for each in made]
before = found(1)  # of threads that ended, the system keeps the stacks for others
pages = int(open("/proc/self/statm").read().split()[0])
if sys.argv[1] == "few":  # not even the stack of another thread
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + 2**20,) * 2)
same = found(64) == before
import threading
try:
    threading.Thread(target=int).start()
    more = True
except (RuntimeError, MemoryError):
    more = False
print(json.dumps([same, more]))
"""


@pytest.mark.skipif(not hasattr(resource, "RLIMIT_AS") or sys.platform != "linux", reason="limits of Linux")
def test_where_the_system_gives_no_more_threads():
    for memory in ("few", "enough"):
        done = subprocess.run(
            [sys.executable, "-c", WITHOUT_THREADS, memory], capture_output=True, text=True, check=True
        )
        assert json.loads(done.stdout) == [True, memory == "enough"]
