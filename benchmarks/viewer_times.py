"""How long does the viewer take from opening to its first picture, and its worker to decode a file?

    uv run python benchmarks/viewer_times.py FILE... [--rounds 7]

For each file a page of its own, opened so many times in a new context of the system's Chromium, without a screen, with
WebGL2 and with WebGPU, both drawn by the processor (SwiftShader). Prints milliseconds, median (least-most): the clock
of the page starts when it is asked for.
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import tempfile
import time
from pathlib import Path

from playwright.sync_api import sync_playwright
from viewer_pictures import OPTIONS

import sommerl
from sommerl.viewer.held import held
from sommerl.viewer.page import page

VULKAN = ["--use-webgpu-adapter=swiftshader", "--enable-features=Vulkan", "--use-vulkan=swiftshader"]
BROWSERS = {"webgl": OPTIONS, "webgpu": [*OPTIONS, "--enable-unsafe-webgpu", *VULKAN]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+")
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    print("| file | bytes | device | first picture [ms] | decoded in [ms] |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        for file in options.files:
            html = Path(folder) / "page.html"
            html.write_text(page([held(sommerl.load(file), Path(file).name, name=file)]), "utf-8")
            for device, arguments in BROWSERS.items():
                browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=arguments)
                found = []
                for _ in range(options.rounds):
                    context = browser.new_context(viewport={"width": 1280, "height": 800})
                    shown = context.new_page()
                    shown.goto(f"{html.as_uri()}#device={device}")
                    while not shown.evaluate("window.sommerl?.first > 0"):
                        time.sleep(0.2)  # seldom, not to be in the page's way
                    found.append(shown.evaluate("[sommerl.first, sommerl.store.materials.get(0).milliseconds]"))
                    context.close()
                browser.close()
                figures = " | ".join(_text(values) for values in zip(*found, strict=True))
                print(f"| {Path(file).name} | {Path(file).stat().st_size:,} | {device} | {figures} |", flush=True)


def _text(values: tuple[float, ...]) -> str:
    return f"{statistics.median(values):.0f} ({min(values):.0f}-{max(values):.0f})"


if __name__ == "__main__":
    main()
