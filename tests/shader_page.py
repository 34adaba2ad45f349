"""A page of materials whose shaders are asked for what they calculate."""

import base64
from contextlib import contextmanager

import numpy as np
from browser import READY, Noise, check_quiet, numbers, wait_until

from sommerl.viewer.held import held
from sommerl.viewer.page import page

INTERPOLATED = 1e-2  # the relative difference that a shader may have
# Directions go as text, as numbers come back: see `numbers`.
ASK = """
([number, wi, wo, what]) => {
    const read = (text) => [...new Float32Array(Uint8Array.from(atob(text), (one) => one.charCodeAt(0)).buffer)];
    return sommerl.evaluate(number, read(wi), read(wo), what);
}
"""


@contextmanager
def shaders(chromium, folder, materials, device="webgl"):
    """Gives what the shaders of a page with these materials find, by name, for pairs of directions (float32). device:
    what calculates it, as the page's address has it."""
    path, names = folder / "page.html", list(materials)
    path.write_text(page([held(made, name) for name, made in materials.items()]), "utf-8")
    context, noise = chromium.new_context(), Noise()
    shown = context.new_page()
    noise.listen(shown, path.as_uri())
    shown.goto(f"{path.as_uri()}#device={device}")
    wait_until(shown, READY)
    assert shown.evaluate("sommerl.picture.device.kind") == {"webgl": "WebGL2", "webgpu": "WebGPU"}[device]

    def ask(name, pairs, what="brdf"):
        wi, wo = (base64.b64encode(w.astype("<f4").tobytes()).decode() for w in pairs)
        return numbers(shown, ASK, [names.index(name), wi, wo, what]).reshape(-1, 3)

    yield ask
    context.close()
    check_quiet(noise)


def close(found, wanted, most):
    """Pairs whose colours differ by at most such a part of the brightest channel."""
    size = np.maximum(np.abs(wanted).max(axis=-1), 1e-9)
    return np.abs(found - wanted).max(axis=-1) <= most * size


def check_interpolated(found, made, pairs):
    assert close(found, made.eval(*pairs), INTERPOLATED).all()
