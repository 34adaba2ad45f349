"""Optional packages: those that are not there, and those that are broken."""

import pytest
from helpers import must_fail

from sommerl.system.errors import MissingDependencyError
from sommerl.system.optional import optional


def check_said(module, wanted):
    with pytest.raises(MissingDependencyError) as caught:
        optional(module, "Some Package", "fitting", "fit")
    assert str(caught.value).startswith(f"fitting: Some Package is needed and {wanted}")


def test_a_package_that_is_broken_is_not_called_missing(tmp_path, monkeypatch):
    (tmp_path / "broken_package.py").write_text("raise ImportError('libx.so: cannot be opened')")
    monkeypatch.syspath_prepend(tmp_path)
    check_said("no_such_package", "not installed: pip install 'sommerl[fit]'")
    check_said("broken_package", "cannot be imported (libx.so: cannot be opened); install it again: pip")
    must_fail(check_said, "broken_package", "not installed")
