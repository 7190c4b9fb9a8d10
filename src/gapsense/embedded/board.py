"""The program for a board in the loop of a co-simulation: components, asked over a line for each step."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from zlib import crc32

from gapsense.embedded.design import Design, sizing
from gapsense.embedded.members import members, table_sizes, type_name
from gapsense.version import __version__

LOOP = Path(__file__).with_name("loop")
CODES = {"float": "f", "double": "d"}  # of struct
LEAST = 256  # bytes of data in a message


def template(name: str) -> str:
    """A file with names in braces for what each export puts there."""
    return Path(__file__).with_name("templates").joinpath(f"{name}.txt").read_text(encoding="utf-8")


def loop_files(designs: Sequence[Design]) -> Mapping[str, str]:
    """Text of every file that a board in the loop needs beside the components."""
    number = struct.calcsize(CODES[designs[0].real])
    moved = [record for d in designs for record in (d.kept["inputs"], d.kept["outputs"], _numbers(d)[0])]
    data = max(LEAST, *(8 + number * len(record) for record in moved))
    made = {
        "components.h": template("components.h").format(version=__version__, data=data, number=number),
        "components.c": template("components.c").format(
            version=__version__,
            includes="".join(f'#include "{d.name}.h"\n' for d in designs),
            parts="\n".join(part(d) for d in designs),
            rows="".join(row(d) for d in designs),
            count=len(designs),
        ),
    }
    texts = {p.name: p.read_text(encoding="utf-8") for p in sorted(LOOP.iterdir()) if p.is_file()}
    texts["Makefile"] = texts["Makefile"].replace("COMPONENTS", " ".join(f"{d.name}.c" for d in designs))
    return {**texts, **made}


def _numbers(design: Design) -> tuple[list[str], list[str]]:
    """Parameters that a message sets, and those that are part of the code: sizes of memories and tables, or all."""
    if not design.is_baked:
        set_ = [member.name for member in members(design).get("par", ()) if member.type == design.real]
        return set_, [*sizing(design.kernel), *table_sizes(design)]
    numbers = [name for name, value in design.values.items() if not isinstance(value, list)]
    return [], [*numbers, *(name for name, value in design.values.items() if isinstance(value, list))]


def checksum_constants(design: Design) -> int:
    """Compute the CRC-32 of the numbers that are part of the code, in its type."""
    found = [design.values[name] for name in _numbers(design)[1]]
    values = [x for value in found for x in (value if isinstance(value, list) else [value])]
    return crc32(struct.pack(f"<{len(values)}{CODES[design.real]}", *values))


def about(design: Design) -> str:
    """What the board says of a component: its name, then the names of what is moved, set and part of the code."""
    lists = (design.kept["inputs"], design.kept["outputs"], *_numbers(design))
    return "\n".join([design.component.name, *(" ".join(names) for names in lists)])


def part(design: Design) -> str:
    """The records of a component, and the functions that the loop calls."""
    found, name = members(design), design.name
    records = "".join(f"static {type_name(design, record)} {name}_at_{record};\n" for record in found)
    return f"\n{records}" + "".join(_functions(design))


def _functions(design: Design) -> Iterator[str]:
    found, name = members(design), design.name

    def calls(function: str, *records: str) -> str:
        return f"{name}_{function}({', '.join(f'&{name}_at_{record}' for record in records if record in found)});"

    lines = ["(void)parameters;"]
    if "par" in found:
        size = f"{len(_numbers(design)[0])} * GAPSENSE_NUMBER"
        lines = [f"{name}_at_par = {name}_defaults();", f"memcpy(&{name}_at_par, parameters, {size});"]
    if "constants" in found:
        lines.append(calls("prepare", "par", "constants"))
    bodies = {
        f"{name}_set_now(const uint8_t *parameters)": lines,
        f"{name}_start_now(void)": [calls("initial", "inputs", "par", "state", "outputs")],
        f"{name}_step_now(void)": [calls("step", "inputs", "constants", "state", "outputs")],
    }
    for head, body in bodies.items():
        text = "\n".join(f"    {line}" for line in body)
        yield f"\nstatic void {head}\n{{\n{text}\n}}\n"


def row(design: Design) -> str:
    """A component in the list of the board."""
    found, name = members(design), design.name
    text = '\\n"\n        "'.join(about(design).split("\n"))
    size = {
        record: f"sizeof {name}_at_{record}" if record in found else "0" for record in ("inputs", "outputs", "state")
    }
    at = {record: f"&{name}_at_{record}" if record in found else "0" for record in size}
    memory = " + ".join(f"sizeof {name}_at_{record}" for record in found)
    return (
        f'    {{\n        "{text}",\n'
        f"        {size['inputs']}, {size['outputs']}, {len(_numbers(design)[0])} * GAPSENSE_NUMBER,\n"
        f"        0x{checksum_constants(design):08x}u, {size['state']}, {memory},\n"
        f"        {at['inputs']}, {at['outputs']}, {at['state']}, {name}_set_now, {name}_start_now, {name}_step_now,\n"
        "    },\n"
    )
