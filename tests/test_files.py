from pathlib import Path

import pytest

from sommerl.files import atomic_write, check_writable


def test_a_file_appears_whole_or_not_at_all(tmp_path):
    path = tmp_path / "out"
    path.write_bytes(b"before")

    def write_half():
        with atomic_write(path) as out:
            out.write(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_half()
    assert path.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [path]
    with atomic_write(path) as out:
        out.write(b"after")
    assert path.read_bytes() == b"after"
    assert path.stat().st_mode & 0o444 == 0o444


def test_the_longest_names_work_and_errors_speak_of_the_file_meant(tmp_path):
    with atomic_write(tmp_path / ("n" * 255)) as out:
        out.write(b"x")
    for write in (check_writable, lambda path: atomic_write(path).__enter__()):
        with pytest.raises(OSError, match="cannot be written") as caught:
            write(Path("/proc/x.smrl"))
        assert caught.value.filename == "/proc/x.smrl"


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "target")
    with atomic_write(tmp_path / "link") as out:
        out.write(b"x")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_bytes() == b"x"


def test_what_cannot_be_written_is_said_beforehand(tmp_path):
    check_writable(tmp_path / "new")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(OSError, match="found a directory"):
        check_writable(tmp_path)
    with pytest.raises(OSError, match="no folder"):
        check_writable(tmp_path / "none" / "out")
