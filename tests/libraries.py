"""Folders of small materials, and what builds libraries of them quickly."""

import hashlib
import os
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from helpers import SMALL, launch

import sommerl
from sommerl import TrainOptions
from sommerl.library.build import Hooks, build
from sommerl.library.engines import Engine
from sommerl.library.work import Method

QUICK = "--clusters", "2", "--epochs", "1"
METHOD = Method(TrainOptions(clusters=2, epochs=1))
HERE = Engine(lambda: ThreadPoolExecutor(1), 1)  # without processes, whose start takes longer than a material


def source(path, seed=0):
    """A material of cells, in a file of 600 bytes that is read in a moment."""
    path.parent.mkdir(parents=True, exist_ok=True)
    values = np.random.default_rng(seed).random((*SMALL.shape, 3))
    table = sommerl.BrdfTable(values, SMALL, name=path.stem)
    sommerl.save(sommerl.train(table, TrainOptions(clusters=4, epochs=1))[0], path)
    return path


def sources(folder, count):
    """A folder with so many materials, half of them in a folder within it."""
    for number in range(count):
        source(folder / ("below" if number % 2 else ".") / f"m{number}.smrl", number)
    return folder


def built(folder, output, method=METHOD, engine=HERE, **others):
    """The report of a build, what it warned of, and which failures it told."""
    warned, failed = [], []
    report = build(folder, output, method, engine, Hooks(warned.append, failed.append), **others)
    return report, warned, failed


def contents(library):
    """All files of a library, by their paths in it."""
    return {
        path.relative_to(library).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in library.rglob("*")
        if path.is_file()
    }


def names(records):
    return [record.name for record in records]


def started(*arguments, program=("-m", "sommerl")):
    """A process of the command line, with a group of its own."""
    return launch([sys.executable, *program, *map(str, arguments)], start_new_session=True)


def alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True
