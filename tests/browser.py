"""The system's Chromium, without a screen: pages are opened in it, and have to be quiet."""

from __future__ import annotations

import base64
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers import tool
from numpy.typing import NDArray
from playwright.sync_api import Browser, Error, Page, Playwright, sync_playwright

# Pictures are drawn by the processor, the same on every machine: by WebGL2, or, with more options, by WebGPU.
OPTIONS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking")
WEBGPU = (
    "--enable-unsafe-webgpu",
    "--use-webgpu-adapter=swiftshader",
    "--enable-features=Vulkan",
    "--use-vulkan=swiftshader",
)
WITHIN = ("data:", "blob:", "about:")  # what is not fetched from anywhere
DESKTOP, PHONE = {"width": 1280, "height": 800}, {"width": 390, "height": 844}
READY = "window.sommerl?.first > 0"  # a picture is there
PATIENCE = 60_000  # ms


@dataclass
class Noise:
    """What a page did that it should not: errors on its console, uncaught ones, requests for anything but itself."""

    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def listen(self, page: Page, allowed: str) -> None:
        """allowed: the address of the page itself."""

        def asked(request: Any) -> None:
            if request.url.partition("#")[0] != allowed and not request.url.startswith(WITHIN):
                self.requests.append(request.url)

        page.on("console", lambda said: self.errors.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("crash", lambda _: self.errors.append("the page has crashed"))
        page.context.on("request", asked)


def check_quiet(noise: Noise) -> None:
    assert noise.errors == []
    assert noise.requests == []


@pytest.fixture(scope="session")
def playwright() -> Iterator[Playwright]:
    """What starts browsers: there can be one in a process."""
    with sync_playwright() as started:
        yield started


def _launched(playwright: Playwright, options: tuple[str, ...]) -> Iterator[Browser]:
    browser = playwright.chromium.launch(executable_path=tool("chromium"), args=list(options))
    yield browser
    browser.close()


@pytest.fixture(scope="session")
def chromium(playwright: Playwright) -> Iterator[Browser]:
    """One browser for all tests of a process. Where there is none, they are skipped, but not in .ci/run."""
    yield from _launched(playwright, OPTIONS)


@pytest.fixture(scope="session")
def chromium_with_webgpu(playwright: Playwright) -> Iterator[Browser]:
    """Another one, whose pages have WebGPU beside WebGL2."""
    for browser in _launched(playwright, (*OPTIONS, *WEBGPU)):
        page = browser.new_page()
        page.goto(Path(__file__).as_uri())
        # The first adapter takes as long as a process takes to start, and pages do not wait for long.
        assert page.evaluate("navigator.gpu.requestAdapter().then((adapter) => adapter !== null)")
        page.close()
        yield browser


Browse = Callable[..., Page]


@pytest.fixture
def browse(chromium: Browser, tmp_path: Path) -> Iterator[Browse]:
    """Opens a page: browse(its HTML, its file or its address, ready=…, first=…, **options of Playwright's contexts).

    ready: an expression of JavaScript that becomes true. first: a script that runs before those of the page. Each page
    has a profile of its own. A test fails at its end if one of them was not quiet.
    """
    yield from _browsing(chromium, tmp_path)


@pytest.fixture(scope="module")
def browse_for_all(chromium: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browse]:
    """The same for pages that a module's tests ask and do not change: to open one takes seconds. They are to be quiet
    until the module's end."""
    yield from _browsing(chromium, tmp_path_factory.mktemp("pages"))


def _browsing(chromium: Browser, folder: Path) -> Iterator[Browse]:
    contexts: list[Any] = []
    noises: list[Noise] = []

    def browse(
        shown: str | Path, *, ready: str = READY, first: str = "", viewport: Any = DESKTOP, **options: Any
    ) -> Page:
        context = chromium.new_context(viewport=viewport, **options)
        contexts.append(context)
        context.add_init_script(first)
        page = context.new_page()
        page.set_default_timeout(PATIENCE)
        address = _address(shown, folder, len(contexts))
        noise = Noise()
        noises.append(noise)
        noise.listen(page, address.partition("#")[0])
        page.goto(address)
        wait_until(page, ready)
        return page

    yield browse
    for context in contexts:
        context.close()
    for noise in noises:
        check_quiet(noise)


_AS_TEXT = """
async (given) => {
    const bytes = new Uint8Array(Float64Array.from(await (EXPRESSION)(given)).buffer);
    const parts = [];
    for (let i = 0; i < bytes.length; i += 2 ** 15) parts.push(String.fromCharCode(...bytes.subarray(i, i + 2 ** 15)));
    return btoa(parts.join(""));
}
"""


def numbers(page: Page, function: str, given: Any = None) -> NDArray[np.float64]:
    """The numbers that a function of JavaScript returns or promises. They come as text: one by one, as Playwright hands
    over arrays, many take seconds."""
    return np.frombuffer(base64.b64decode(page.evaluate(_AS_TEXT.replace("EXPRESSION", function), given)))


_GO = """
(fragment) => new Promise((done) => {
    addEventListener("hashchange", done, { once: true });
    location.hash = fragment;
}).then(() => null)
"""


def go(page: Page, fragment: str) -> None:
    """Changes the fragment of the page's address, and waits until the page has read it."""
    page.evaluate(_GO, fragment)


def wait_until(page: Page, ready: str) -> None:
    """Waits for an expression of JavaScript to be true. (Playwright's own way needs `eval` where it has to wait.)"""
    end = time.monotonic() + PATIENCE / 1000
    while not _holds(page, ready):
        assert time.monotonic() < end, f"{ready}: not so after {PATIENCE / 1000:.0f} s"
        page.wait_for_timeout(20)


def _holds(page: Page, ready: str) -> bool:
    try:
        return bool(page.evaluate(ready))
    except Error as error:
        if "context was destroyed" in str(error):  # the page is being opened, or opens itself anew
            return False
        raise


def _address(shown: str | Path, folder: Path, number: int) -> str:
    if isinstance(shown, str) and shown.startswith(("http://", "file://")):
        return shown
    if isinstance(shown, str):
        path = folder / f"page-{number}.html"
        path.write_text(shown, "utf-8")
        shown = path
    return shown.resolve().as_uri()
