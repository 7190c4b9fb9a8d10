"""The documentation page of a component, from its port table and its `page.md`: documentation/index.html in the FMU."""

from __future__ import annotations

import re
from html import escape
from pathlib import Path
from typing import Any

from markdown_it import MarkdownIt

from gapsense.fmi.ports import Component, Port

ROLES = {
    "drive": "`drive` is a `DriveVoltage`",
    "plant": "`plant` is one of the actuators",
    "sensor": "`sensor` is a `Sensor`",
    "mhe": "`mhe` is an `Mhe`",
}
SAMPLED = """It samples every `sample_time`, {period:g} us if nothing else is set, from its start on. Its step, that is
`step` times the base step of the scenario, must be a whole multiple or a whole fraction of that. In a shorter step
nothing happens until the next sample is due, and the outputs hold; in a longer one the inputs hold for all its samples.
"""
CONTINUOUS = """It has no sample time: any step will do. Inputs hold during a step, so take one that is short against
what drives it; {step:g} us is a good one.{micro}
"""
MICRO = " Within a step it integrates in steps of at most `micro_step`."
TITLES = {"input": "Inputs", "output": "Outputs", "parameter": "Parameters"}
STYLE = Path(__file__).with_name("page.css")
RUN = """## How to run

The FMU runs in Python: it needs a Python 3.9 or later with its shared library on the machine
(`needsExecutionTool`), and no packages. On Linux it
asks the `python3` on the PATH where its library is; the environment variable
`GAPSENSE_LIBPYTHON` names another one; `PYTHONHOME` and `PYTHONPATH` do not count.
On Windows the folder of `python3.dll` must be on the PATH.
In Simulink, use the out-of-process setting of the FMU block if your release crashes on the second run.
A good communication step is {step:g} s. Inputs are held during a step, outputs are valid at its end.

Profile: FMI 2.0 co-simulation, variable communication step, several instances, get, set and serialise the whole state.
"""
TRY = "\nFiles to try the FMU with, a reference run and parameters, are in `extra/org.fmi-standard.fmi-ls-ref`.\n"


def html(component: Component, markdown: str, version: str, picture: str = "", run: str = RUN) -> str:
    """The page: what it does, a picture, tables of its ports, how to run it."""
    renderer = MarkdownIt("commonmark").enable("table")
    text, said = part_text(markdown)
    taken = {"Inputs": taking(component)}

    def render(text: str) -> str:
        return box_tables(str(renderer.render(text)))

    tables = "".join(
        f"<h2>{title}</h2>\n{render(said.get(title, ''))}{_table(component.of(causality))}"
        f"{render(taken.get(title, ''))}"
        for causality, title in TITLES.items()
    )
    body = list_chapters(
        f"{picture}{render(text)}\n{render(chapter(component))}\n{tables}\n"
        f"{render(run.format(step=component.step_size) + TRY)}"
    )
    style = STYLE.read_text(encoding="utf-8")
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{component.name}</title>'
        f'<meta name="viewport" content="width=device-width"><style>{style}</style></head>'
        f"<body>\n<h1>{component.name} <small>Gapsense {version}</small></h1>\n<p>{escape(component.description)}</p>\n"
        f"{body}</body></html>\n"
    )


def list_chapters(body: str) -> str:
    """Put a list of the chapters, which have anchors, before them."""
    titles = re.findall(r"<h2>(.*?)</h2>", body)
    names = [re.sub(r"\W+", "-", re.sub(r"<.*?>", "", title).lower()).strip("-") for title in titles]
    for title, name in zip(titles, names):
        body = body.replace(f"<h2>{title}</h2>", f'<h2 id="{name}">{title}</h2>', 1)
    links = " · ".join(f'<a href="#{name}">{title}</a>' for title, name in zip(titles, names))
    return f"<nav>{links}</nav>\n{body}"


def taking(component: Component) -> str:
    """What becomes of inputs that cannot be right."""
    if not component.of("input"):
        return ""
    if component.survives:
        return "No value ends a run: one that cannot be a reading counts as lost."
    has_range = any((port.min, port.max) != (None, None) for port in component.of("input"))
    refused = "A value that is not finite" + (", or not between min and max," if has_range else "")
    return f"{refused} is refused when it is used, with its name. An input that nothing drives keeps its start value."


def part_text(markdown: str) -> tuple[str, dict[str, str]]:
    """The text of a page, and what it says under the headings of the tables of ports, which stands there then."""
    first, *sections = re.split(r"^(?=## )", markdown, flags=re.MULTILINE)
    said = {}
    for title in TITLES.values():
        for section in [s for s in sections if s.partition("\n")[0] == f"## {title}"]:
            said[title] = section.partition("\n")[2]
            sections.remove(section)
    return first + "".join(sections), said


def box_tables(text: str) -> str:
    """Put tables that are too wide for the window into a box of their own that scrolls."""
    return text.replace("<table>", '<div class="wide"><table>').replace("</table>", "</table></div>")


def _table(ports: tuple[Port, ...]) -> str:
    if not ports:
        return "<p>None.</p>\n"
    details = ("follows at once",) if ports[0].causality == "output" else ("start", "min", "max")
    head = "".join(f"<th>{h}</th>" for h in ("name", "unit", *details, "meaning"))
    rows = "".join(f"<tr>{_cells(p)}</tr>\n" for p in ports)
    return box_tables(f"<table><tr>{head}</tr>\n{rows}</table>\n")


def _cells(port: Port) -> str:
    if port.causality == "output":
        details = f"<td>{', '.join(port.feedthrough) or 'nothing'}</td>"
    else:
        details = "".join(f'<td class="number">{_value(v)}</td>' for v in (port.start, port.min, port.max))
    named = re.sub(r"([._])", r"\1<wbr>", port.name)
    name, unit = f'<td class="name"><code>{named}</code></td>', f'<td class="number">{port.unit}</td>'
    return f'{name}{unit}{details}<td class="meaning">{escape(port.description)}</td>'


def _value(value: Any) -> str:
    return "" if value is None else f"{value:g}" if isinstance(value, float) else escape(str(value))


# How a component is wired into a scenario and when it samples: a chapter of its page, from its port table.


def chapter(component: Component) -> str:
    """The chapter, as Markdown."""
    period = next((port.start for port in component.ports if port.name == "sample_time"), None)
    micro = MICRO if any(port.name == "micro_step" for port in component.ports) else ""
    times = CONTINUOUS.format(step=1e6 * component.step_size, micro=micro)
    if period is not None:
        times = SAMPLED.format(period=1e6 * period)
    others = {port.source.partition(".")[0] for port in component.of("input") if port.source}
    roles = ", ".join(text for name, text in ROLES.items() if name in others)
    told = f"Here {roles}." if roles else "Nothing has to be wired."
    return f"## How to wire\n\n```toml\n{snippet(component)}```\n\n{told}{optional(component)}\n\n{times}"


def snippet(component: Component) -> str:
    """Tables for a scenario file."""
    name, inputs = example_name(component), component.of("input")
    wired = [f'"{name}.{port.name}" = "{port.source}"' for port in inputs if port.source]
    constant = [f'"{name}.{port.name}" = {float(port.start)!r}' for port in inputs if not port.source]
    parts = (f"[components.{name}]", f'fmu = "{component.name}"'), ("[connect]", *wired), ("[inputs]", *constant)
    return "\n".join("\n".join(part) + "\n" for part in parts if len(part) > 1)


def example_name(component: Component) -> str:
    """Name of the component in the example: that of its class in small letters."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", component.name).lower()


def optional(component: Component) -> str:
    """What may be left at its start value."""
    names = [f"`{port.name}`" for port in component.of("input") if port.is_optional]
    return f" With the value above {' and '.join(names)} counts for nothing; it may be wired." if names else ""
