"""The example: a main that plays the component's reference record and prints what the component gives."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence

from gapsense.embedded.code import number
from gapsense.embedded.design import Design
from gapsense.embedded.members import Member, members, type_name
from gapsense.embedded.source import comment, origin

MAIN = """{head}

#include <stdio.h>

#include "{name}.h"

enum {{ ROWS = {rows}, STEPS = {steps} }}; /* each row is held for so many steps of {period} s */
{record}
int main(void)
{{
{declarations}

{prepare}    printf("{titles}\\n");
    for (int row = 0; row < ROWS; row++) {{
{inputs}        if (row == 0) {{
{start}            {name}_initial({initial});
        }}
        for (int k = 1; row > 0 && k <= STEPS; k++) {{
{clock}            {name}_step({step});
        }}
{prints}    }}
    return 0;
}}
"""
DIGITS = {"float": 9, "double": 17}


def example(design: Design) -> str:
    """Text of `<name>_main.c`."""
    found, name = members(design), design.name
    times, rows = record(design)
    period = sample_time(design) or times[1]
    steps = max(1, round(times[1] / period))
    return MAIN.format(
        head=comment(
            f"{design.component.name} at work: it gets a short record and prints its outputs. {origin(design)}"
        ),
        name=name,
        rows=len(rows),
        steps=steps,
        period=f"{period:g}",
        record=_table(design, rows),
        declarations=_declarations(design),
        prepare=f"    {name}_prepare(&par, &constants);\n" if "constants" in found else "",
        titles=",".join(member.name for member in found["outputs"]),
        inputs="".join(f"        inputs.{n} = RECORD[row][{k}];\n" for k, n in enumerate(signals(design))),
        start=_clock(design, 12, 0.0, "0"),
        clock=_clock(design, 12, period, "(row - 1) * STEPS + k"),
        initial=", ".join(f"&{n}" for n in ("inputs", "par", "state", "outputs") if n in found),
        step=", ".join(f"&{n}" for n in ("inputs", "constants", "state", "outputs") if n in found),
        prints="".join(_prints(design, found["outputs"])),
    )


def sample_time(design: Design) -> float:
    """The sampling period, or 0 for a component that is not sampled."""
    return float(design.values.get("sample_time", 0.0))


def record(design: Design) -> tuple[list[float], list[list[float]]]:
    """Times of the reference run, and the inputs at them."""
    with (design.folder / "reference.csv").open(newline="", encoding="utf-8") as file:
        lines = [*csv.DictReader(file)]
    names = signals(design)
    return [float(line["time"]) for line in lines], [[float(line[name]) for name in names] for line in lines]


def signals(design: Design) -> list[str]:
    """The inputs that come from outside."""
    known = {port.field for port in design.component.of("input")}
    return [name for name in design.kept["inputs"] if name in known]


def _table(design: Design, rows: Sequence[Sequence[float]]) -> str:
    names = signals(design)
    if not names:
        return ""
    units = {port.field: port.unit for port in design.component.of("input")}
    titles = ", ".join(f"{name} [{units[name]}]" for name in names)
    lines = (f"    {{{', '.join(number(value, design.real) for value in row)}}}," for row in rows)
    return "\n".join([f"static const {design.real} RECORD[ROWS][{len(names)}] = {{ /* {titles} */", *lines, "};", ""])


def _declarations(design: Design) -> str:
    lines = []
    for name in members(design):
        start = f" = {design.name}_defaults()" if name == "par" else ""
        keep = "static " if name in ("constants", "state") else ""
        lines.append(f"    {keep}{type_name(design, name)} {name}{start};")
    return "\n".join(lines)


def _clock(design: Design, indent: int, period: float, steps: str) -> str:
    values = {"time": f"{number(period, design.real)} * ({design.real})({steps})", "dt": number(period, design.real)}
    lines = (f"{' ' * indent}inputs.{name} = {values[name]};\n" for name in design.kept["inputs"] if name in values)
    return "".join(lines)


def _prints(design: Design, outputs: Sequence[Member]) -> Iterator[str]:
    cast = "(double)" if design.real == "float" else ""
    for member in outputs:
        end = "\\n" if member is outputs[-1] else ","
        yield f'        printf("%.{DIGITS[design.real]}g{end}", {cast}outputs.{member.name});\n'
