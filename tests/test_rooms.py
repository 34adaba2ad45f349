"""The rooms of the package, from the ground up: what is imported lies in the same room or in one below."""

import ast
from pathlib import Path

import pytest
from helpers import must_fail

import sommerl

PACKAGE = Path(sommerl.__file__).parent
ROOMS = (
    "system", "reflectance", "models", "factored", "sampling", "compression", "fitting", "formats", "render", "plots",
    "library", "viewer", "reproduction", "commands",
)  # fmt: skip


# A BRDF's `sample`, `pdf` and `albedo` import the sampler when they are first called.
UPWARDS = {("reflectance", "brdf"): ("sampling", "half_vector")}


def imported(module, source):
    """What a module imports from the package: paths below it, like ("system", "errors")."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.level:
            above = module[: len(module) - node.level]
            path = (*above, *(node.module.split(".") if node.module else ()))
            yield from ([path] if path else [(alias.name,) for alias in node.names])


def check_points_down(module, source):
    below = ROOMS[: ROOMS.index(module[0]) + 1]
    for path in imported(module, source):
        # The compiled core and the version are the package's own.
        known = path[0] in (*below, "_core", "__version__") or UPWARDS.get(module) == path
        assert known, f"{module} imports {path}"


MODULES = [path.relative_to(PACKAGE) for room in ROOMS for path in sorted((PACKAGE / room).rglob("*.py"))]


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.as_posix())
def test_imports_point_down(path):
    module = path.with_suffix("").parts
    source = (PACKAGE / path).read_text()
    check_points_down(module, source)
    if module[0] != ROOMS[-1]:
        up = f"from {'.' * len(module)}{ROOMS[-1]} import cli\n"
        must_fail(check_points_down, module, up)


def test_what_may_point_up_does():
    for module, path in UPWARDS.items():
        source = PACKAGE.joinpath(*module).with_suffix(".py").read_text()
        assert path in imported(module, source)


def test_every_module_is_in_a_room():
    assert {path.name for path in PACKAGE.glob("*.py")} == {"__init__.py", "__main__.py"}
    assert {path.name for path in PACKAGE.iterdir() if path.is_dir() and path.name != "__pycache__"} == set(ROOMS)


def check_names(paths):
    names = [path.name for path in paths]
    assert len(set(names)) == len(names)


def test_names_of_test_files_are_unique():
    """Else pytest imports one of two in the place of the other."""
    paths = list(Path(__file__).parent.rglob("test_*.py"))
    check_names(paths)
    must_fail(check_names, [*paths, paths[0]])
