"""Write components as C into a folder: all files, or none."""

from __future__ import annotations

import csv
import inspect
import math
import re
import tempfile
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from gapsense.embedded.board import loop_files, template
from gapsense.embedded.code import Function, constant_table
from gapsense.embedded.design import Design, sizing
from gapsense.embedded.members import TITLES, Member, arguments, graphs, members, table_sizes, type_name
from gapsense.kernels.emit import Graph
from gapsense.kernels.emit.c import AS_WRITTEN, INCLUDES, LOCATE, WHOLE_NUMBER, WITHIN, number, same
from gapsense.kernels.layout import fields
from gapsense.problems import InputError
from gapsense.version import __version__

DIGITS = {"float": 9, "double": 17}
WIDTH = 110
HELPERS = {
    "locate": ("The place in a rising table after which a value lies; both ends reach on.", LOCATE),
    "whole": ("A whole number; -1 if it is not one, or too large.", WHOLE_NUMBER),
    "within": ("An index inside an array; 0 in place of others.", WITHIN),
}
SAME = "Elementary functions, with the same bits on every machine; errors below 1 unit in the last place."
FUNCTIONS = {  # arguments, what they change, and their comment
    "prepare": (("par", "constants"), ("constants",), "Call it once, and after every change of a parameter."),
    "initial": (("inputs", "par", "state", "outputs"), ("state", "outputs"), "The start, and the outputs there."),
    "step": (
        ("inputs", "constants", "state", "outputs"),
        ("state", "outputs"),
        "One step; the state is changed in place.",
    ),
}
STACK = 4096  # bytes of RAM that are kept free for the stack
LOOP = 6144  # bytes of RAM of the program of a board in the loop and its libraries, at most
LINK, ANY_RAM = "cortex_m/link.ld", "LENGTH = 4M\n}"
CORTEX_M = Path(__file__).with_name("cortex_m")
MARK = re.compile(r"(Made|Exported)\s+by\s+Gapsense")  # in every file but those of a board, which users change


def export(designs: Sequence[Design], folder: Path, in_loop: bool = False, ram: int = 0) -> list[Path]:
    """Write the files of some components, what a Cortex-M needs to start, and a README; the files written.

    A part may have so many bytes of `ram`; the linker script has them.
    """
    texts = {**make_texts(designs), **(loop_files(designs) if in_loop else {})}
    if ram:
        check_memory(designs, ram, in_loop)
        texts[LINK] = texts[LINK].replace(ANY_RAM, f"LENGTH = {ram}\n}}")
    texts["README.md"] += template("in_loop.md") * in_loop
    keep_foreign({folder / name: text for name, text in texts.items()})
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".export-") as temporary:
        parts = {name: Path(temporary, str(k)) for k, name in enumerate(texts)}
        for name, part in parts.items():
            part.write_text(texts[name], encoding="utf-8", newline="\n")
        for name in texts:
            (folder / name).parent.mkdir(exist_ok=True)
        return [part.replace(folder / name) for name, part in parts.items()]


def keep_foreign(texts: Mapping[Path, str]) -> None:
    """Refuse to overwrite files that no export has made, or that were made to be changed and have been changed."""
    there = {path: path.read_text(encoding="utf-8", errors="replace") for path in texts if path.is_file()}
    if foreign := [path for path, found in there.items() if not MARK.search(found) and found != texts[path]]:
        raise InputError(
            [f"`{path}` exists and is not an exported file. Move it, or choose another folder." for path in foreign]
        )


def make_texts(designs: Sequence[Design]) -> Mapping[str, str]:
    """Make the text of every file, by its path in the folder."""
    files: dict[str, str] = {}
    for design in designs:
        made = {".h": header(design), ".c": source(design), "_main.c": example(design)}
        files |= {f"{design.name}{ending}": text for ending, text in made.items()}
    start = {f"cortex_m/{p.name}": p.read_text(encoding="utf-8") for p in sorted(CORTEX_M.iterdir()) if p.is_file()}
    return {**files, **start, "README.md": readme(designs)}


# The README beside exported components: what is there, how it is built and called, what to mind.


def readme(designs: Sequence[Design]) -> str:
    """README of the exported C."""
    rows = ["| component | what it is | call its step | RAM, bytes |", "| --- | --- | --- | --- |"]
    for d in designs:
        period = sample_time(d)
        when = f"every {1e6 * period:g} us (`sample_time`)" if period else "with any `dt`"
        rows.append(f"| `{d.name}` | {d.component.description} | {when} | {memory(d):,} |")
    survivors = ", ".join(f"`{design.name}`" for design in designs if design.component.survives)
    first = designs[0]
    return template("README.md").format(
        version=__version__,
        real=first.real,
        table="\n".join(rows),
        first=first.name,
        kept="".join(f"\n{line}" for design in designs for line in _describe_memory(design)),
        use="\n".join(_use(first)),
        survives=f"\nLost readings (NaN) are accepted by {survivors}." if survivors else "",
    )


def memory(design: Design) -> int:
    """Bytes of the records that a component keeps, where whole numbers and pointers have four."""
    kept = [member for name, record in members(design).items() if name != "par" for member in record]
    return sum(max(1, member.size) * (8 if member.type == "double" else 4) for member in kept)


def _list_sizes(design: Design) -> Iterator[tuple[str, int, int]]:
    """List the parameters that say how much array memory there is, with values, and bytes of each unit of them."""
    layout, width = fields(design.kernel.module.State), 8 if design.real == "double" else 4
    for parameter in sizing(design.kernel):
        used = [name for name in design.kept["state"] if name in layout and layout[name].used == parameter]
        name = next(port.name for port in design.component.ports if port.field == parameter)
        yield name, int(design.values[parameter]), int(width * sum(map(design.per, used)))


def _describe_memory(design: Design) -> Iterator[str]:
    for name, count, width in _list_sizes(design):
        yield (
            f"Of `{design.name}` {count * width:,} bytes are for `{name}` = {count:,}, a constant of the code, "
            f"{width} bytes each. For less, export with a smaller `--set {name}=...`; the page of the component says "
            "what that costs."
        )


def check_memory(designs: Sequence[Design], ram: int, in_loop: bool = False) -> None:
    """Refuse a part with so many bytes of RAM if the components do not fit, and say what to change."""
    sizes, others = {design.name: memory(design) for design in designs}, STACK + LOOP * in_loop
    over = sum(sizes.values()) + others - ram
    known = [each for design in designs for each in _list_sizes(design)]
    ways = [f"`--set {name}={n - math.ceil(over / width)}`" for name, n, width in known if n * width > over]
    if over > 0:
        taken = " + ".join(f"`{name}` {size:,}" for name, size in sizes.items())
        what = f"bytes of stack{' and loop' * in_loop}"
        raise InputError(
            [
                f"--ram: {taken} + {others:,} {what} are {over:,} more than the {ram:,} that there are. Take "
                f"{' or '.join([*ways, 'fewer `--outputs`', '`--bake`'])}."
            ]
        )


def _use(design: Design) -> Iterator[str]:
    found, name = members(design), design.name
    kept = " and ".join(f"`{name}_{record}`" for record in ("constants", "state") if record in found)
    yield f"Include `{name}.h`, which lists every name with its unit and range.{f' You keep {kept}.' * bool(kept)}\n"
    if "par" in found:
        yield f"- `{name}_defaults()` gives the parameters; change what you like."
        yield f"- `{name}_prepare` computes from them what a step needs: once, and again after each change."
    yield f"- `{name}_initial` takes the first sample{' and starts the state' * ('state' in found)}."
    yield f"- `{name}_step` does one step with every further sample."


# The example: a main that plays the component's reference record and prints what the component gives.


def example(design: Design) -> str:
    """Text of `<name>_main.c`."""
    found, name = members(design), design.name
    times, rows = record(design)
    period = sample_time(design) or times[1]
    steps = max(1, round(times[1] / period))
    title = f"{design.component.name} at work: it gets a short record and prints its outputs. {origin(design)}"
    return template("main.c").format(
        head=comment(title),
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
    if not (names := signals(design)):
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


# The header and the source of a component.


def comment(text: str, indent: str = "") -> str:
    """A comment of as many lines as it takes."""
    lines = textwrap.wrap(text.replace("*/", "* /"), WIDTH - len(indent) - 6)
    return f"{indent}/* " + f"\n{indent}   ".join(lines) + " */"


def origin(design: Design) -> str:
    """Where the files come from."""
    made = f"Made by Gapsense {__version__} from {design.kernel.module.__name__}"
    return f"{made}; do not edit it, export it again."


def header(design: Design) -> str:
    """Text of `<name>.h`."""
    guard, found = f"GAPSENSE_{design.name.upper()}_H", members(design)
    parts = [
        comment(f"{design.component.description}. {origin(design)}"),
        f"#ifndef {guard}\n#define {guard}",
        '#ifdef __cplusplus\nextern "C" {\n#endif',
        *_rules(design),
        *(struct(design, name, record) for name, record in found.items()),
        *_prototypes(design),
        "#ifdef __cplusplus\n}\n#endif",
        "#endif",
    ]
    return "\n\n".join(parts) + "\n"


def _rules(design: Design) -> Iterator[str]:
    """What must hold between parameters, or their values where they are constants of the code."""
    component = design.component
    rules = [f"`{a}` must be less than `{b}`" for a, b in component.rising]
    rules += [f"{limit.text()} must be less than {limit.below:g}: {limit.reason}" for limit in component.limits]
    if rules and not design.is_baked:
        yield comment(f"Nothing is checked here. Of the parameters, {'; '.join(rules)}.")
    if design.is_baked:
        given = ", ".join(f"{n} = {v:g}" for n, v in design.values.items() if not isinstance(v, list))
        yield comment(f"The parameters are constants of the code: {given}.")


def struct(design: Design, name: str, record: list[Member]) -> str:
    """Definition of the type of a record."""
    title = comment(f"{TITLES[name].format(name=design.name)}.")
    lines = [line for member in record for line in _declare_member(member)]
    return "\n".join([title, "typedef struct {", *lines, f"}} {type_name(design, name)};"])


def _declare_member(member: Member) -> list[str]:
    size = f"[{member.size}]" if member.size else ""
    text = f"    {member.type}{' ' * (not member.type.endswith('*'))}{member.name}{size};"
    note = f" /* {member.comment.replace('*/', '* /')} */" if member.comment else ""
    return [text + note] if len(text + note) <= WIDTH else [comment(member.comment, "    "), text]


def _prototypes(design: Design) -> Iterator[str]:
    if "par" in members(design):
        yield f"/* The start values of the parameters. */\n{_defaults_head(design)};"
    for name in graphs(design):
        yield f"/* {FUNCTIONS[name][2]} */\n{_declare_function(design, name)};"


def _declare_function(design: Design, name: str) -> str:
    records, written, _ = FUNCTIONS[name]
    return f"void {design.name}_{name}({arguments(design, records, written, members(design))})"


def _defaults_head(design: Design) -> str:
    return f"{type_name(design, 'par')} {design.name}_defaults(void)"


def source(design: Design) -> str:
    """Text of `<name>.c`."""
    about = inspect.getdoc(design.kernel.module) or ""
    published = ", ".join(
        f"{p.name} [{p.unit}]" for p in design.component.of("output") if p.field in design.kept["outputs"]
    )
    reading = "Comments in the functions quote the Python that the lines below them are made from."
    parts = [
        comment(f"{design.component.description}. {origin(design)}"),
        *(comment(" ".join(paragraph.split())) for paragraph in about.split("\n\n")),
        comment(f"Outputs: {published}. {reading}"),
        f'#include "{design.name}.h"\n\n{INCLUDES}\n{AS_WRITTEN.strip()}',
        *_tables(design),
        *_helpers(design),
        *([_defaults(design)] if "par" in members(design) else []),
        *(_function(design, name, graph) for name, graph in graphs(design).items()),
    ]
    return "\n\n".join(parts) + "\n"


def _tables(design: Design) -> Iterator[str]:
    sizes = table_sizes(design)
    for name in sizes:
        yield "\n".join(constant_table(name, design.values[name], design.real))
    if sizes and design.is_baked:
        lengths = {size: len(design.values[name]) for name, size in sizes.items()}
        yield f"enum {{ {', '.join(f'{size} = {length}' for size, length in lengths.items())} }};"


def _helpers(design: Design) -> Iterator[str]:
    """Functions of indices that are used."""
    lines = [line for graph in graphs(design).values() for line in _body(design, graph)]
    for name, (about, text) in HELPERS.items():
        if any(f"{name}(" in line for line in lines):
            yield f"/* {about} */\n{text.replace('{real}', design.real).strip()}"
    if own := same(design.real, lines):
        yield f"{comment(SAME)}\n{own.strip()}"


def _defaults(design: Design) -> str:
    values: dict[str, str] = {}
    for name, size in table_sizes(design).items():
        values |= {name: name, size: str(len(design.values[name]))}
    lines = []
    for member in members(design)["par"]:
        value = values.get(member.name) or number(design.values[member.name], design.real)
        lines.append(f"    par.{member.name} = {value};")
    head = [_defaults_head(design), "{", f"    {type_name(design, 'par')} par;"]
    return "\n".join([*head, *lines, "    return par;", "}"])


def _body(design: Design, graph: Graph) -> list[str]:
    return Function(
        graph=graph, real=design.real, sizes=table_sizes(design), memories=design.memories(), is_baked=design.is_baked
    ).body()


def _function(design: Design, name: str, graph: Graph) -> str:
    body = _body(design, graph)
    given = (n for n in FUNCTIONS[name][0] if n in members(design))
    unused = [n for n in given if not any(f"{n}->" in line for line in body)]
    return "\n".join([_declare_function(design, name), "{", *(f"    (void){n};" for n in unused), *body, "}"])
