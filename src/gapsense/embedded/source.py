"""The header and the source of a component."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Iterator

from gapsense.embedded.code import Function, constant_table, number
from gapsense.embedded.design import Design
from gapsense.embedded.members import TITLES, Member, arguments, graphs, members, table_sizes, type_name
from gapsense.kernels.emit import LOCATE, WHOLE_NUMBER, WITHIN, Graph
from gapsense.version import __version__

WIDTH = 110
HELPERS = {
    "locate": ("The place in a rising table after which a value lies; both ends reach on.", LOCATE),
    "whole": ("A whole number; -1 for what is none, or too large.", WHOLE_NUMBER),
    "within": ("An index that an array has; 0 in place of others.", WITHIN),
}
FUNCTIONS = {  # what they take and change, and what is said of them
    "prepare": (("par", "constants"), ("constants",), "Call it once, and after every change of a parameter."),
    "initial": (("inputs", "par", "state", "outputs"), ("state", "outputs"), "The start, and the outputs there."),
    "step": (
        ("inputs", "constants", "state", "outputs"),
        ("state", "outputs"),
        "One step; the state is changed in place.",
    ),
}


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
    lines = [line for member in record for line in _declared(member)]
    return "\n".join([title, "typedef struct {", *lines, f"}} {type_name(design, name)};"])


def _declared(member: Member) -> list[str]:
    text = f"    {member.declaration}"
    note = f" /* {member.comment.replace('*/', '* /')} */" if member.comment else ""
    return [text + note] if len(text + note) <= WIDTH else [comment(member.comment, "    "), text]


def _prototypes(design: Design) -> Iterator[str]:
    if "par" in members(design):
        yield f"/* The start values of the parameters. */\n{_defaults_head(design)};"
    for graph in graphs(design):
        name = _name(graph)
        yield f"/* {FUNCTIONS[name][2]} */\n{_head(design, name)};"


def _name(graph: Graph) -> str:
    return {"constants": "prepare", "advance": "step"}.get(graph.name, graph.name)


def _head(design: Design, name: str) -> str:
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
        f'#include "{design.name}.h"\n\n#include <math.h>',
        *_tables(design),
        *_helpers(design),
        *([_defaults(design)] if "par" in members(design) else []),
        *(_function(design, graph) for graph in graphs(design)),
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
    lines = [line for graph in graphs(design) for line in _body(design, graph)]
    for name, (about, text) in HELPERS.items():
        if any(f"{name}(" in line for line in lines):
            yield f"/* {about} */\n{text.replace('{real}', design.real).strip()}"


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
    return Function(graph, design.real, table_sizes(design), design.is_baked).body()


def _function(design: Design, graph: Graph) -> str:
    body = _body(design, graph)
    unused = [n for n in _given(design, graph) if not any(f"{n}->" in line for line in body)]
    return "\n".join([_head(design, _name(graph)), "{", *(f"    (void){n};" for n in unused), *body, "}"])


def _given(design: Design, graph: Graph) -> list[str]:
    return [name for name in FUNCTIONS[_name(graph)][0] if name in members(design)]
