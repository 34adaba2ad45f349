"""The report as one HTML file, complete in itself."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any

from ..system.visible import visible
from .markdown import HEADINGS, of_difference, of_interval, of_number, reasons
from .report import VERDICTS, Report

MANY = 3  # tables of an item: the others are folded
TYPES = {"png": "image/png", "webp": "image/webp"}


def page(report: Report) -> str:
    """The whole report."""
    content = report.content
    style = resources.files("sommerl.reproduction").joinpath("page.css").read_text("utf-8")
    links = "".join(f'<a href="#{item["name"]}">{_short(item["title"])}</a>' for item in content["items"])
    items = "\n".join(_item(item, report.pictures) for item in content["items"])
    return PAGE.format(
        title=_html(content["title"]),
        style=style,
        lead=_lead(content),
        verdicts=_verdicts(content["verdicts"]),
        links=links,
        items=items,
        foot=_foot(content),
    )


def _lead(content: Mapping[str, Any]) -> str:
    figure = f" Fig. 1 shows the mesh {content['figure']}." if content["figure"] else ""
    quick = (
        " This is a quick run: its numbers mean nothing but that all parts work."
        if content["extent"] == "quick"
        else ""
    )
    return _html(
        f"Every figure, table, size and claim of Kurt & Cinsdikici 2008, made again from {content['data']}. What is "
        f"said "
        f"of MERL's materials here is of these, and not of MERL's measurements unless the data are them.{figure}{quick}"
    )


def _verdicts(counts: Mapping[str, int]) -> str:
    there = [verdict for verdict in VERDICTS if counts[verdict]]
    bar = "".join(f'<span class="{_class(v)}" style="flex:{counts[v]}"></span>' for v in there)
    words = "".join(f'<span class="{_class(v)}"><b>{counts[v]}</b> {v}</span>' for v in there)
    return f'<div class="bar" aria-hidden="true">{bar}</div><div class="counts">{words}</div>' if there else ""


def _foot(content: Mapping[str, Any]) -> str:
    versions = ", ".join(f"{name} {version}" for name, version in content["versions"].items())
    return _html(
        f"{content['date']} · {versions} · {content['machine']} · {content['seconds']} s of work in all, a "
        f"{content['extent']} run"
    )


def _item(item: Mapping[str, Any], pictures: Mapping[str, bytes]) -> str:
    parts = [
        f'<h2 id="{item["name"]}">{_html(item["title"])}</h2>',
        f'<p class="about quiet">{_html(item["about"])}</p><p><code>{_html(item["command"])}</code></p>',
    ]
    if item["sentences"]:
        parts.append("<ul>" + "".join(f"<li>{_html(each)}</li>" for each in item["sentences"]) + "</ul>")
    if item["numbers"]:
        parts.append(_numbers(item["numbers"]))
    parts.append(_pictures(item["pictures"], pictures))
    for number, table in enumerate(item["tables"]):
        body = _table(table["columns"], table["rows"])
        title = _html(table["title"])
        folded = len(item["tables"]) > MANY and number
        parts.append(f"<details><summary>{title}</summary>{body}</details>" if folded else f"<h3>{title}</h3>{body}")
    return "\n".join(parts)


def _numbers(numbers: Sequence[Mapping[str, Any]]) -> str:
    letters = reasons(numbers)
    rows: list[str] = []
    commands = list(dict.fromkeys(number["command"] for number in numbers))
    alone = f'<p class="note">Alone: <code>{_html(commands[0])}</code></p>' if len(commands) == 1 else ""
    for number in numbers:
        unit, mark = number["unit"], letters.get(number["reason"])
        command = "" if alone else f"<br><code>{_html(number['command'])}</code>"
        name = _html(number["key"].replace("/", ", ")) + command
        worse = ' class="worse"' if number["verdict_eq2"] == "worse" else ""
        cells = [
            (_html(of_number(number["paper"], unit)), ""),
            (f"<span{worse}>{_html(of_number(number['eq2'], unit))}</span>", ""),
            (_html(of_number(number["default"], unit) + of_interval(number)), ""),
            (_html(of_difference(number)), ""),
            (number["verdict"] + (f" <sup>{mark}</sup>" if mark else ""), _class(number["verdict"])),
        ]
        shown = "".join(
            f'<td data-head="{head}" class="{kind}">{text}</td>'
            for head, (text, kind) in zip(HEADINGS[1:], cells, strict=True)
        )
        rows.append(f"<tr><td>{name}</td>{shown}</tr>")
    notes = "".join(f'<p class="note"><sup>{letter}</sup> {_html(reason)}.</p>' for reason, letter in letters.items())
    return _scrolled(HEADINGS, rows, "numbers") + notes + alone


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    shown = ["<tr>" + "".join(f"<td>{_html(cell)}</td>" for cell in row) + "</tr>" for row in rows]
    return _scrolled(columns, shown, "")


def _scrolled(columns: Sequence[str], rows: Sequence[str], kind: str) -> str:
    head = "".join(f'<th scope="col">{_html(column)}</th>' for column in columns)
    body = "".join(rows)
    table = f'<table class="{kind}"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'
    return f'<div class="scroll">{table}</div>'


def _pictures(shown: Sequence[Mapping[str, Any]], pictures: Mapping[str, bytes]) -> str:
    figures: list[str] = []
    for each in shown:
        files = [file for file in (each["file"], each["difference"]) if file]
        images = "".join(_image(pictures[file], file, each["caption"]) for file in files)
        kind = ' class="wide"' if each["wide"] else ""
        figures.append(f"<figure{kind}>{images}<figcaption>{_html(each['caption'])}</figcaption></figure>")
    return f'<div class="pictures">{"".join(figures)}</div>' if figures else ""


def _image(data: bytes, file: str, caption: str) -> str:
    kind = file.rpartition(".")[2]
    if kind == "svg":
        return data.decode()
    return (
        f'<img src="data:{TYPES[kind]};base64,{base64.b64encode(data).decode()}" alt="{_html(caption)}" loading="lazy">'
    )


def _class(verdict: str) -> str:
    return verdict.replace(" ", "-")


def _short(title: str) -> str:
    return _html(title.partition(":")[0])


def _html(text: str) -> str:
    return html.escape(visible(text, 2000))


PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="generator" content="Sommerl">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<h1>{title}</h1>
<p class="quiet">{lead}</p>
{verdicts}
<nav aria-label="Items">{links}</nav>
<main>
{items}
</main>
<footer class="note">{foot}</footer>
</body>
</html>
"""
