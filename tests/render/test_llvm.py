import pytest

from sommerl.render import llvm
from sommerl.system import jit
from sommerl.system.errors import MissingDependencyError


def test_the_one_in_use_is_new_enough():
    assert llvm.mitsuba().variant() in ("cuda_ad_rgb", "llvm_ad_rgb")
    path = jit.find_llvm()
    assert path is not None
    assert jit.llvm_version(path) >= 17


@pytest.mark.parametrize(
    ("versions", "chosen"), [((14, 16, 19), 2), ((0, 21, 17), 1), ((16, 15, 14), None), ((), None)]
)
def test_old_ones_are_passed_over(monkeypatch, versions, chosen):
    paths = {f"libLLVM-{i}.so": version for i, version in enumerate(versions)}
    monkeypatch.setattr(jit, "_candidates", lambda: iter(paths))
    monkeypatch.setattr(jit, "llvm_version", paths.get)
    assert jit.find_llvm() == (None if chosen is None else f"libLLVM-{chosen}.so")


def test_what_is_no_library_has_no_version(tmp_path):
    path = tmp_path / "libLLVM.so"
    assert jit.llvm_version(str(path)) == 0
    path.write_text("not a library")
    assert jit.llvm_version(str(path)) == 0
    assert jit.llvm_version("libc.so.6") == 0


def test_one_chosen_by_the_user_comes_first(monkeypatch):
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/opt/mine.so")
    assert next(jit._candidates()) == "/opt/mine.so"


def test_without_mitsuba_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setattr(llvm.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'sommerl\[render\]'"):
        llvm._module.__wrapped__()
