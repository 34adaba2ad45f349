"""A few random kills; `benchmarks/kills.py` says of what, and makes many."""

import subprocess
import sys
from pathlib import Path

import pytest
from helpers import must_fail

SCRIPT = Path(__file__).parent.parent / "benchmarks" / "kills.py"


def check_nothing_is_lost(*options):
    done = subprocess.run([sys.executable, SCRIPT, *options], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs /proc")
def test_random_kills():
    check_nothing_is_lost("--kills", "4", "--commands", "convert-source,convert-snippet")
    must_fail(check_nothing_is_lost, "--kills", "2", "--seed", "107", "--commands", "convert-snippet", "--broken")
