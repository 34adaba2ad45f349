"""Parts of a file at an address, read by fsspec: HTTP by range requests, object stores by theirs."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from threading import Lock
from typing import Any

from ..system.errors import FormatError, MissingDependencyError
from ..system.optional import optional

ADDRESS = re.compile(r"[a-z][a-z0-9+.-]+://", re.IGNORECASE)
EXTRA = "library"


def is_address(path: str) -> bool:
    """Whether it is an address, and not a path of this machine."""
    return ADDRESS.match(path) is not None


def parts(address: str) -> tuple[Callable[[int, int], bytes], None]:
    """What reads parts of the file at an address; its length, which is not asked for, is None.

    Of a server that knows no ranges and sends the whole file instead, that is kept and not asked for again; a warning
    says so. Raises MissingDependencyError without fsspec, or a package that it needs for this kind of address.
    """
    fsspec = optional("fsspec", "fsspec", address, EXTRA)
    try:
        system, path = fsspec.url_to_fs(address)
    except ImportError as error:
        raise MissingDependencyError(f"{address}: a package of fsspec's is needed for it ({error})") from error
    except Exception as error:  # of any class: each kind of address has a package of its own
        raise FormatError(f"{address}: expected an address that fsspec knows, found another ({error})") from error
    return _Parts(address, system, path).read, None


class _Parts:
    def __init__(self, address: str, system: Any, path: str) -> None:
        self._address, self._system, self._path = address, system, path
        self._whole: bytes | None = None
        self._turn = Lock()

    def read(self, start: int, count: int) -> bytes:
        if self._whole is None and count:
            found = self._asked(start, start + count)
            if start == 0 and len(found) < count:
                self._whole = found  # the file ends here
            if len(found) <= count:
                return found
            with self._turn:
                self._whole = self._whole or found
            warnings.warn(f"{self._address}: the server sends no parts of a file: all was read", stacklevel=2)
        return (self._whole or b"")[start : start + count]

    def _asked(self, start: int, end: int) -> bytes:
        try:
            return bytes(self._system.cat_file(self._path, start=start, end=end))
        except FileNotFoundError as error:
            raise FormatError("there is no such file") from error
        except Exception as error:  # of any class: each kind of address has a package of its own
            raise FormatError(f"cannot be read ({str(error) or type(error).__name__})") from error
