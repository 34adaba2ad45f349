"""One self-contained page that shows materials: everything is in it, and nothing is fetched.

The scripts are deflated; `boot.js` unpacks them. The page's policy allows these two scripts, by their digests, and the
style, and no request of any kind.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
import zlib
from collections.abc import Mapping, Sequence
from functools import cache

from ..system.first_few import first_few
from ..system.visible import visible
from .bundle import module, packed, script
from .held import REFERENCE, Held

STYLES = ("base.css", "style.css", "panels.css")


def page(materials: Sequence[Held]) -> str:
    """The page, as HTML."""
    title = first_few([visible(one.label, 60) for one in materials if one.step == REFERENCE])
    return _filled(html.escape(title or "Materials"), as_json([one.packed() for one in materials]))


def template() -> str:
    """The page with @title@ and @materials@ in place of its title, in HTML, and of the list of `Held.packed`, in JSON
    without the character <."""
    return _filled("@title@", "@materials@")


def _filled(title: str, materials: str) -> str:
    values = {
        "policy": policy(),
        "title": title,
        "style": _style(),
        "materials": materials,
        "packed": _packed(),
        "boot": _boot(),
    }
    return filled(module("page.html"), values)


def filled(text: str, values: Mapping[str, str]) -> str:
    """A text with values in place of their names between two @."""
    return re.sub(r"@(\w+)@", lambda found: values[found[1]], text)


@cache
def policy(scripts: tuple[str, ...] = (), styles: tuple[str, ...] = ()) -> str:
    """The content-security policy: what is in the page, and nothing from elsewhere. scripts, styles: of a page that
    opens this one, whose policy holds for both."""
    allowed = " ".join(f"'{_digest(text)}'" for text in (_boot(), script(), *scripts))
    style = " ".join(f"'{_digest(text)}'" for text in (_style(), *styles))
    return (
        f"default-src 'none'; script-src {allowed}; style-src {style}; img-src data: blob:; "
        "worker-src blob:; base-uri 'none'; form-action 'none'"
    )


@cache
def _packed() -> str:
    """The scripts, deflated."""
    return base64.b64encode(zlib.compress(packed().encode(), 9, wbits=-15)).decode()


@cache
def _style() -> str:
    return within("style", "\n".join(module(name) for name in STYLES))


@cache
def _boot() -> str:
    return within("script", module("boot.js"))


def within(element: str, text: str) -> str:
    """A text that is to be in an element as it is. Raises ValueError if the element would end in it, or begin anew."""
    if re.search(rf"</{element}|<!--", text, re.IGNORECASE):
        raise ValueError(f"expected a text without </{element}> and <!--, found one")
    return text


def as_json(value: object) -> str:
    """JSON that no script element ends at."""
    return json.dumps(value).replace("<", "\\u003c")


def _digest(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
