"""Takes the pictures of the viewer that the README shows, in the system's Chromium without a screen.

uv run python benchmarks/viewer_pictures.py REFERENCE COMPRESSED -o docs/images
"""

from __future__ import annotations

import argparse
import shutil
import time
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

import sommerl
from sommerl.viewer.held import held
from sommerl.viewer.page import page

OPTIONS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
# Name, window, theme, scale of pixels, address, paths to wait for, and the element that is shown (None: the page).
PICTURES = [
    ("viewer_compare", (1180, 800), "dark", 1, "a=0&b=1&view=split&light=-50,50", 16, None),
    ("viewer_figure", (900, 760), "light", 1, "a=1&b=-1&scene=statue&light=environment&tone=agx", 64, "#stage"),
    ("viewer_phone", (390, 844), "light", 1.5, "a=1&b=-1&scene=sphere&light=-30,40", 16, "#panels"),
]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("materials", nargs=2)
    parser.add_argument("-o", dest="output", type=Path, required=True)
    options = parser.parse_args()
    materials = [held(sommerl.load(file), Path(file).name, name=file) for file in options.materials]
    html = options.output / "viewer.html"
    html.write_text(page(materials), "utf-8")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=OPTIONS)
        for name, (width, height), theme, scale, fragment, paths, element in PICTURES:
            shown = browser.new_page(
                viewport={"width": width, "height": height}, color_scheme=theme, device_scale_factor=scale
            )
            shown.goto(f"{html.resolve().as_uri()}#{fragment}")
            _wait(shown, f"window.sommerl?.loop?.resolution === 1 && sommerl.picture.count >= {paths}")
            shown.wait_for_timeout(8000)  # the panels are drawn bit by bit
            path = options.output / f"{name}.png"
            if element:
                shown.locator(element).screenshot(path=path)
            else:
                shown.screenshot(path=path, full_page=True)
            print(path)
            shown.close()
        browser.close()
    html.unlink()


def _wait(shown: Page, ready: str) -> None:
    while not shown.evaluate(ready):
        time.sleep(0.2)


if __name__ == "__main__":
    main()
