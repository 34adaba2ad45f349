"""SIGINT and SIGTERM, at any time: one sentence, exit status 130, and nothing half-written."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from helpers import PATIENCE, launch, must_fail

from sommerl import builtin
from sommerl.system.interrupt import hold_interrupts

INTERRUPTED = "error: interrupted; nothing was left half-written\n"
PROGRAM = """
import sys, time
from pathlib import Path
from sommerl.commands import info as command
from sommerl.__main__ import main
def wait():  # in short calls: a signal that comes within print is noticed after the next call (Python 3.14)
    for _ in range(600): time.sleep(0.1)
    raise RuntimeError("no signal was noticed")
def info(options):
    {body}
    return {{}}
command.info = info
sys.argv = ["sommerl", "info", "x"]
status = main()
{after}
sys.exit(status)
"""


def start(body, after="", **options):
    """The command line, with a command of the test's own; it prints a line when it is at work."""
    return launch([sys.executable, "-c", PROGRAM.format(body=body, after=after)], **options)


def ended(process, *signals, pause=0.0):
    """Exit status and standard error of a process that is told to end when it is at work."""
    process.stdout.readline()
    for number in signals:
        process.send_signal(number)
        time.sleep(pause)
    _, err = process.communicate(timeout=PATIENCE)
    return process.returncode, err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_command(number):
    assert ended(start("print(flush=True); wait()"), number) == (130, INTERRUPTED)


def test_two_signals_at_once_are_one():
    """As `timeout` and terminals send them: what is done on the way out, like a checkpoint, is done."""
    body = "try: print(flush=True); wait()\n    finally: time.sleep(0.1); print('done', file=sys.stderr)"
    process = start(body)
    assert ended(process, signal.SIGTERM, signal.SIGINT, signal.SIGTERM) == (130, f"done\n{INTERRUPTED}")


STUBBORN = """
    import os
    from sommerl.system.files import atomic_write
    from sommerl.system.interrupt import hold_interrupts
    with atomic_write(Path("out")) as out:
        out.write(b"half"); out.flush()
        with hold_interrupts():
            print(flush=True)
            wait()
"""


def test_a_second_signal_ends_at_once_what_does_not_listen(tmp_path):
    status, err = ended(start(STUBBORN, cwd=tmp_path), signal.SIGINT, signal.SIGTERM, pause=0.5)
    assert (status, err) == (130, "")
    assert list(tmp_path.iterdir()) == []


def test_a_signal_that_python_swallows_comes_again():
    """As in a finaliser, where no exception goes anywhere."""
    body = """
    class Loud:
        def __del__(self):
            print(flush=True)
            wait()
    Loud()
    wait()
"""
    assert ended(start(body), signal.SIGINT) == (130, INTERRUPTED)


def test_signals_at_the_end_change_nothing():
    after = "print(flush=True); time.sleep(1)"
    for number in (signal.SIGINT, signal.SIGTERM):
        assert ended(start("pass", after=after), number) == (0, "")


def test_an_ignored_signal_stays_so():
    process = start("print(flush=True); time.sleep(1)", action=signal.SIG_IGN)
    assert ended(process, signal.SIGINT) == (0, "")


def test_importing_the_library_leaves_signals_alone():
    code = "import signal; before = [*map(signal.getsignal, signal.valid_signals())]; import sommerl.commands.cli; "
    code += "assert before == [*map(signal.getsignal, signal.valid_signals())]"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_while_modules_are_loaded(tmp_path):
    """Some of them make an error of their own of an interruption."""
    (tmp_path / "argparse.py").write_text(
        "import time\nprint(flush=True)\ntry:\n    for _ in range(50): time.sleep(0.01)\n"
        "except KeyboardInterrupt as error:\n    raise ImportError('half loaded') from error\n"
    )
    process = launch(
        [sys.executable, "-m", "sommerl", "info", "nickel"], env=os.environ | {"PYTHONPATH": str(tmp_path)}
    )
    assert ended(process, signal.SIGTERM) == (130, INTERRUPTED)


def check_no_thread_is_left(query):
    """SciPy's search on several threads, interrupted: none of them is at work when the call has ended."""
    done = subprocess.run([sys.executable, "-c", QUERY.format(query=query)], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "1\n"), done


QUERY = """
import os, signal, sys, threading, time
import numpy as np
from sommerl.formats import regression
points = np.random.default_rng(0).random((20000, 4))
tree, wanted = regression.tree(points), np.random.default_rng(1).random((60000, 4))
signal.signal(signal.SIGINT, signal.default_int_handler)
threading.Timer(0.05, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
try:
    while True:
        {query}
except KeyboardInterrupt:
    print(threading.active_count(), flush=True)
    os._exit(0)
"""


def test_threads_of_others_are_waited_for():
    check_no_thread_is_left("regression.planes(tree, points, points[:, :3], wanted)")
    must_fail(check_no_thread_is_left, "tree.query(wanted, 16, workers=2)")


def test_an_interruption_waits_for_the_end_of_the_block():
    """And is not lost, if the block makes another error of it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    reached = []

    @hold_interrupts()
    def interrupted(error):
        with hold_interrupts():  # one within another changes nothing
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)
        reached.append(error)
        if error:
            raise RuntimeError

    for error in (False, True):
        with pytest.raises(KeyboardInterrupt):
            interrupted(error)
    assert reached == [False, True]
    with pytest.raises(RuntimeError), hold_interrupts():
        raise RuntimeError
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def write_samples(path):
    angles = np.array([(i, 0, o, phi) for i in range(0, 81, 10) for o in range(0, 81, 10) for phi in range(0, 181, 20)])
    polar, azimuth = np.radians(angles[:, ::2]).T, np.radians(angles[:, 1::2]).T
    wi, wo = (
        np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
        for t, p in zip(polar, azimuth, strict=True)
    )
    rows = np.column_stack([angles, builtin("red-fabric").eval(wi, wo)])
    head = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b"
    np.savetxt(path, rows, delimiter=",", header=head, comments="")


def caught(process):
    """Waits until a process handles SIGTERM itself, or has ended."""
    while process.poll() is None:
        try:
            lines = Path(f"/proc/{process.pid}/status").read_text().splitlines()
        except OSError:
            return
        masks = [int(line.split()[1], 16) for line in lines if line.startswith("SigCgt")]
        if masks and masks[0] >> (signal.SIGTERM - 1) & 1:
            return
        time.sleep(0.001)


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs /proc")
def test_converting_samples_ends_cleanly_at_any_time(tmp_path):
    write_samples(tmp_path / "x.csv")
    for step in range(8):
        process = launch([sys.executable, "-m", "sommerl", "convert", "x.csv", "x.binary"], cwd=tmp_path)
        caught(process)
        time.sleep(0.25 * step)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE)
        assert (process.returncode, err) in ((130, INTERRUPTED), (0, ""))
        assert {path.name for path in tmp_path.iterdir()} <= {"x.csv", "x.binary", "x.coverage.png"}
        (tmp_path / "x.binary").unlink(missing_ok=True)
