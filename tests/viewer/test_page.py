"""The page as a file: what is in it, what its policy allows, how long it is, and that names are text."""

import base64
import hashlib
import json
import re
import zlib
from html.parser import HTMLParser

import numpy as np
import pytest
from helpers import compact_material, must_fail, random_directions, run_node
from in_node import program
from kinds import KINDS

from sommerl import MERL, BrdfTable
from sommerl.reflectance.nodes import NodeLattice
from sommerl.viewer import bundle
from sommerl.viewer.held import MAGIC, ONE_SIDED, TABLE, held
from sommerl.viewer.page import page, policy

MARKUP = '</script><img src=x onerror="window.hurt=1">&amp;<b>\'"@materials@'
READ = """
import { evaluate } from "./evaluate.js";
import { read } from "./readers.js";
async function answer({ file, pairs, ...how }) {
    const material = await read(file, how);
    return { kind: material.kind, values: pairs.map(([wi, wo]) => evaluate(material, wi, wo)) };
}
"""


def html_of(*brdfs):
    return page([held(brdf, brdf.name) for brdf in brdfs])


class Elements(HTMLParser):
    """The elements of a page: (tag, attributes, text)."""

    def __init__(self, html):
        super().__init__()
        self.found = []
        self.open = []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.open = []
        self.found.append((tag, dict(attrs), self.open))

    def handle_endtag(self, tag):
        self.open = []

    def handle_data(self, data):
        self.open.append(data)

    def of(self, tag, **attributes):
        return [
            "".join(text) for name, given, text in self.found if name == tag and attributes.items() <= given.items()
        ]


def unpacked(elements):
    """The page's script and its worker's, as boot.js puts them together."""
    (packed,) = elements.of("script", id="packed")
    found = json.loads(zlib.decompress(base64.b64decode(packed), wbits=-15))
    return {one: found["head"] + "".join(found["parts"][name] for name in found[one]) for one in ("script", "worker")}


def digest(text):
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def check_policy(html):
    """Nothing is allowed but what is in the page, by its digest."""
    elements = Elements(html)
    (said,) = [a["content"] for _, a, _ in elements.found if a.get("http-equiv") == "Content-Security-Policy"]
    rules = dict(rule.strip().split(" ", 1) for rule in said.split(";"))
    scripts = {digest(text) for text in (*elements.of("script"), unpacked(elements)["script"])}
    runs = [a for name, a, _ in elements.found if name == "script" and a.get("type", "module") in ("module", "")]
    assert len(runs) == 1  # the others hold data
    allowed = set(rules["script-src"].split())
    assert len(allowed) == 2
    assert allowed <= scripts
    assert set(rules["style-src"].split()) == {digest(text) for text in elements.of("style")}
    others = {"default-src": "'none'", "img-src": "data: blob:", "worker-src": "blob:"}
    others |= {"base-uri": "'none'", "form-action": "'none'"}
    assert {name: value for name, value in rules.items() if name not in ("script-src", "style-src")} == others


def check_plain(html):
    """No handlers, styles or addresses in attributes: the policy would not allow the first two."""
    for name, attributes, _ in Elements(html).found:
        assert not [key for key in attributes if key.startswith("on") or key == "style"], name
        assert all((attributes.get(key) or "data:").startswith("data:") for key in ("src", "href")), name
        assert name not in ("base", "object", "embed", "iframe")


def test_the_policy_allows_what_is_in_the_page_and_nothing_else():
    html = html_of(KINDS["nodes"])
    check_policy(html)
    assert policy() in html.replace("&#x27;", "'")
    must_fail(check_policy, html.replace("DecompressionStream", "decompressionStream"))
    must_fail(check_policy, html.replace("</style>", " </style>"))
    must_fail(check_policy, html.replace("script-src ", "script-src 'unsafe-inline' "))
    must_fail(check_policy, html.replace("worker-src blob:", "worker-src blob:; connect-src *"))


def test_nothing_is_in_attributes_that_runs_or_loads():
    html = html_of(KINDS["nodes"])
    check_plain(html)
    must_fail(check_plain, html.replace("<main", "<main onclick='x()'"))
    must_fail(check_plain, html.replace("<main", "<main style='top: 0'"))
    must_fail(check_plain, html.replace("<main", "<img src='https://example.org/x.png'><main"))


def check_no_danger(text):
    assert not re.findall(r"\beval\(|\binnerHTML\b|\bouterHTML\b|insertAdjacentHTML|document\.write|new Function", text)


def test_no_script_makes_markup_or_scripts_of_text():
    for text in (*unpacked(Elements(html_of(KINDS["nodes"]))).values(), bundle.module("boot.js")):
        check_no_danger(text)
        must_fail(check_no_danger, text + "element.innerHTML = name;")


def test_it_carries_sommerls_mark():
    assert html_of(KINDS["nodes"])[: 2**12].startswith("<!doctype html>")
    assert '<meta name="generator" content="Sommerl">' in html_of(KINDS["nodes"])[: 2**12]


def described(html):
    (text,) = Elements(html).of("script", id="materials")
    return json.loads(text)


def test_names_with_markup_stay_text(browse):
    marked = compact_material(KINDS["nodes"].lattice, name="x")
    html = page([held(marked, MARKUP, name=MARKUP, command=MARKUP)])
    check_plain(html)
    check_policy(html)
    (one,) = described(html)
    assert [one[key] for key in ("name", "label", "group", "command")] == [MARKUP] * 4
    shown = browse(html)
    assert shown.title().startswith(MARKUP[:50])
    assert shown.evaluate("[window.hurt, document.querySelectorAll('img').length]") == [None, 0]
    assert MARKUP in shown.evaluate(
        "document.body.innerText + [...document.querySelectorAll('option')].map((o) => o.text)"
    )


def realistic(number):
    """As many bytes as a compact file of at most 2,700 has, and none that deflate."""
    rows, axis, around = tuple(range(0, 181, 20)), tuple(range(0, 181, 12)), tuple(range(0, 180, 18))
    lattice = NodeLattice(rows, (0,) * len(rows), (axis,), (around,))
    return compact_material(lattice, 70 + number % 7, 45, name=f"material-{number:03}")


def check_size(materials, most):
    assert len(page(materials).encode()) <= most


def test_it_is_small_enough_to_be_mailed():
    one = held(realistic(0), "one")
    assert 2500 <= one.size <= 2700
    check_size([one], 300_000)
    hundred = [
        held(realistic(number), f"material-{number:03}", name=f"material-{number:03}.smrl") for number in range(100)
    ]
    check_size(hundred, 500_000)
    must_fail(check_size, hundred * 2, 500_000)
    must_fail(check_size, [one], 90_000)


def check_read(found, brdf, pairs, kind, tolerance):
    assert found["kind"] == kind
    expected = brdf.eval(*pairs)
    error = np.abs(np.array(found["values"]) - expected)
    assert (error <= tolerance * np.abs(expected).max(axis=-1, keepdims=True) + 1e-6).all()


# The kinds of materials in the page, and how near to the source they are at random pairs.
FORMATS = {
    "table-nearest": ("table", 3e-3),
    "table-trilinear": ("table", 3e-3),
    "table-handed": ("table", 3e-3),
    "cells-nearest": ("cells", 1e-6),
    "cells-trilinear": ("cells", 1e-6),
    "nodes": ("nodes", 1e-5),
    "rgl": ("rgl", 2e-3),
    "sgd": ("table", 3e-3),
    "factored": ("table", 3e-3),
}


def test_the_page_reads_what_is_written_of_every_kind(tmp_path):
    pairs = random_directions(200, 1), random_directions(200, 2)
    said = {"pairs": np.stack(pairs, axis=1).tolist()}
    messages, sources = [], []
    for name in FORMATS:
        one = held(KINDS[name], name).packed()
        how = {key: one[key] for key in ("format", "deflated", "name")}
        messages.append((said | how, base64.b64decode(one["data"])))
        lattice = {"sgd": MERL, "factored": ONE_SIDED}.get(name)
        assert one["note"].startswith("It is sampled at 90 × 90 × 180 directions") == (lattice is not None)
        sources.append(BrdfTable.sampled(KINDS[name], lattice) if lattice else KINDS[name])
    found = program(tmp_path, READ)(messages)
    for name, each, source in zip(FORMATS, found, sources, strict=True):
        check_read(each, source, pairs, *FORMATS[name])
    must_fail(check_read, found[0], KINDS["rgl"], pairs, *FORMATS["rgl"])
    must_fail(check_read, found[0], KINDS["table-trilinear"], pairs, *FORMATS["table-trilinear"])


@pytest.mark.parametrize(("name", "lattice"), [("sgd", MERL), ("factored", ONE_SIDED)])
def test_what_is_one_sided_is_sampled_all_around(name, lattice):
    _, *bins, reciprocal, trilinear = TABLE.unpack(held(KINDS[name], "x").data[: TABLE.size])
    assert (tuple(bins), reciprocal, trilinear) == (lattice.shape, lattice.reciprocal, 1)


def test_versions_of_a_material_are_said():
    one = held(KINDS["nodes"], "nickel, 2,700 B", name="nickel-2700.smrl", group="nickel", step="2,700 B", command="c")
    (said,) = described(page([one]))
    assert said.keys() == {
        "name", "label", "group", "step", "command", "note", "format", "deflated", "bytes", "data",
    }  # fmt: skip
    assert (said["group"], said["step"], said["bytes"], said["format"]) == ("nickel", "2,700 B", one.size, "smrl")
    table = held(KINDS["table-nearest"], "x", size=12)
    assert (table.size, table.group, table.step, table.data[:4]) == (12, "x", "reference", MAGIC)


MODULES = {
    "one.js": '/** says "a" */\nconst name = "one";\nexport function say() {\n    return `${name}  // kept`;\n}\n',
    "two.js": 'import { say } from "./one.js";\nconst name = "two";\nexport const [kept] = [1];\n',
    "main.js": (
        'import { say } from "./one.js";\nimport { name, both } from "./three.js";\n'
        "const kept = `a\n    // b`;\nconsole.log(JSON.stringify([say(), name, both(), kept]));\n"
    ),
    "three.js": (
        'import { say } from "./one.js";\nexport const name = "three";\n'
        "export function both() { return say() + name; }\n"
    ),
}


def run(script):
    return json.loads(run_node("-e", script))


def test_names_of_two_modules_do_not_meet():
    script = bundle.bundled("main.js", MODULES.__getitem__)
    assert run(script) == ["one  // kept", "three", "one  // keptthree", "a\n    // b"]
    assert bundle.order("main.js", MODULES.__getitem__) == ["one.js", "three.js", "main.js"]
    assert "says" not in script


@pytest.mark.parametrize(
    "text",
    [
        'import x from "./one.js";\n', 'import { say as x } from "./one.js";\n', 'import "./one.js";\n',
        "export default 1;\n", "const x = 1;\nexport { x };\n", 'import {\n    say,\n} from "./one.js";\n',
        "export const [a] = [1];\n", "export let a = 1;\n",
    ],
)  # fmt: skip
def test_other_forms_of_modules_are_refused(text):
    with pytest.raises(ValueError, match=r"main\.js: expected imports and exports by name"):
        bundle.bundled("main.js", (MODULES | {"main.js": text}).__getitem__)


def test_circles_of_modules_are_refused():
    circle = {"a.js": 'import { b } from "./b.js";\n', "b.js": 'import { a } from "./a.js";\n'}
    with pytest.raises(ValueError, match=r"in no circle, found a\.js → b\.js"):
        bundle.bundled("a.js", circle.__getitem__)


def test_a_page_with_every_format_opens(browse):
    shown = [held(KINDS[name], name) for name in ("nodes", "cells-nearest", "table-handed", "rgl")]
    opened = browse(page(shown))
    assert opened.evaluate("document.getElementById('messages').textContent.trim()") == ""
