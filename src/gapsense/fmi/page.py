"""The documentation page of a component, from its port table and its `page.md`: documentation/index.html in the FMU."""

from __future__ import annotations

from html import escape

from markdown_it import MarkdownIt

from gapsense.fmi import wiring
from gapsense.fmi.ports import Component, Port

STYLE = """body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#1b1f24}
table{border-collapse:collapse;width:100%;margin:.5rem 0 1.5rem}
td,th{border-bottom:1px solid #d0d7de;padding:.3rem .6rem;text-align:left;vertical-align:top}th{background:#f6f8fa}
code,pre{background:#f6f8fa;padding:.1rem .3rem;border-radius:4px}pre{padding:.8rem;overflow:auto}
h1 small{font-weight:normal;color:#57606a;font-size:.6em}"""

RUN = """## How to run

The FMU runs in Python: it needs a Python 3.9 or later with its shared library on the machine
(`needsExecutionTool`), and no packages. On Linux it
asks the `python3` on the PATH where its library is; the environment variable
`GAPSENSE_LIBPYTHON` names another one. On Windows the folder of `python3.dll` must be on the PATH.
In Simulink, use the out-of-process setting of the FMU block if your release crashes on the second run.
A good communication step is {step:g} s. Inputs are held during a step, outputs are valid at its end.

Profile: FMI 2.0 co-simulation, variable communication step, several instances, get, set and serialise the whole state.
"""


def html(component: Component, markdown: str, version: str) -> str:
    """The page: what it does, tables of its ports, how to run it."""
    render = MarkdownIt("commonmark").enable("table").render
    tables = "".join(_table(c, component.of(c)) for c in ("input", "output", "parameter"))
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{component.name}</title>'
        f"<style>{STYLE}</style></head>"
        f"<body>\n<h1>{component.name} <small>Gapsense {version}</small></h1>\n<p>{escape(component.description)}</p>\n"
        f"{render(markdown)}\n{render(wiring.chapter(component))}\n{tables}\n{render(RUN.format(step=component.step_size))}</body></html>\n"
    )


def _table(causality: str, ports: tuple[Port, ...]) -> str:
    title = f"<h2>{causality.capitalize()}s</h2>"
    if not ports:
        return f"{title}<p>None.</p>"
    details = ("follows at once",) if causality == "output" else ("start", "min", "max")
    head = "".join(f"<th>{h}</th>" for h in ("name", "unit", *details, "meaning"))
    rows = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in _cells(p)) + "</tr>\n" for p in ports)
    return f"{title}\n<table><tr>{head}</tr>\n{rows}</table>\n"


def _cells(port: Port) -> list[str]:
    name, meaning = f"<code>{port.name}</code>", escape(port.description)
    if port.causality == "output":
        return [name, port.unit, ", ".join(port.feedthrough) or "nothing", meaning]
    start = f"{port.start:g}" if isinstance(port.start, float) else escape(str(port.start))
    return [name, port.unit, start, _bound(port.min), _bound(port.max), meaning]


def _bound(value: float | None) -> str:
    return "" if value is None else f"{value:g}"
