"""What the other tests see of a page: that it is quiet, or that it is not."""

import pytest
from browser import WITHIN, Noise, check_quiet
from helpers import must_fail

QUIET = "<!doctype html><title>x</title><img src='data:,' alt=''><p id='p'>x</p>"
FETCH = "fetch('http://127.0.0.1:9/x').catch(() => {})"
LOUD = {
    "said": "<script>console.error('x')</script>",
    "thrown": "<script>throw new Error('x')</script>",
    "later": "<script>Promise.reject(new Error('x'))</script>",
    "asked": "<img src='http://127.0.0.1:9/x.png' alt=''>",
    "fetched": f"<script>{FETCH}</script>",
    "in a worker": f"<script>new Worker(URL.createObjectURL(new Blob([`{FETCH}`])))</script>",
    "forbidden": "<meta http-equiv='Content-Security-Policy' content=\"default-src 'none'\"><img src='x.png' alt=''>",
}


def noise_of(chromium, path, html):
    path.write_text(html)
    context, noise = chromium.new_context(), Noise()
    page = context.new_page()
    noise.listen(page, path.as_uri())
    page.goto(path.as_uri())
    page.wait_for_timeout(300)
    context.close()
    return noise


def test_a_quiet_page_is_quiet(chromium, tmp_path, browse):
    check_quiet(noise_of(chromium, tmp_path / "x.html", QUIET))
    assert browse(QUIET, ready="true").inner_text("#p") == "x"
    assert not "http://x".startswith(WITHIN)


@pytest.mark.parametrize("how", LOUD)
def test_a_loud_one_is_not(chromium, tmp_path, how):
    must_fail(check_quiet, noise_of(chromium, tmp_path / "x.html", QUIET + LOUD[how]))
