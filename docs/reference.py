"""Pages and JSON schemas that are made from the program: `python docs/reference.py docs` writes them again.

The keys of scenario and study files from the tables of keys, the commands from the commands.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from gapsense._os.files import write_atomically
from gapsense.cli import app
from gapsense.cosim.result.metrics import KINDS
from gapsense.cosim.scenario.keys import FILE
from gapsense.cosim.scenario.records import ACTIONS
from gapsense.many.keys import STUDY
from gapsense.parameters import PARAMETER_SET, VALUES
from gapsense.report.schema import schema, study_schema
from gapsense.tables import Key, Section

BEGIN, END = "<!-- keys: made by docs/reference.py -->\n", "<!-- end of keys -->\n"
PAGE, SCHEMA = "scenario-file.md", "scenario.schema.json"
STUDY_PAGE, STUDY_SCHEMA = "campaigns.md", "study.schema.json"
COMMANDS_PAGE = "commands.md"
USES = {
    "required": "needed: signal, parameter or number",
    "optional": "may be given",
    "none": "none",
    "axis": "needed: the signal over which the curve is drawn",
}


def rewritten(page: str, made: str) -> str:
    """The page with its tables of keys made anew; what is written by hand stays."""
    head, _, rest = page.partition(BEGIN)
    return f"{head}{BEGIN}\n{made}\n{END}{rest.partition(END)[2]}"


def study_keys() -> str:
    """The keys of a study file; its examples are written by hand."""
    chapters = [f"### {heading(section)}\n\n{section.what}\n\n{table(section)}" for section in with_keys(STUDY)]
    return "\n".join(chapters)


def heading(section: Section) -> str:
    """How a kind of table is called."""
    return f"`{section.header}`" if section.header else "At the top"


def keys() -> str:
    """A chapter for each kind of table, one for the actions of events, and one for the kinds of metrics."""
    return "\n".join([*(chapter(section) for section in with_keys(FILE)), actions(), metrics(), parameter_set()])


def with_keys(section: Section) -> Iterator[Section]:
    """A kind of table and those of the tables in it, as far as they have keys of their own."""
    if own(section):
        yield section
    for key in (*section.keys, *filter(None, [section.free])):
        if key.section:
            yield from with_keys(key.section)


def own(section: Section) -> list[Key]:
    """Keys that are no tables, or need not be any."""
    keys = (*section.keys, *filter(None, [section.free]))
    return [key for key in keys if key.section is None or key.is_dotted]


def chapter(section: Section) -> str:
    """What a kind of table is for, its keys, an example."""
    return f"## {heading(section)}\n\n{section.what}\n\n{table(section)}\n{block(section)}"


def table(*sections: Section) -> str:
    """Keys of kinds of tables."""
    rows = [row(key) for section in sections for key in own(section)]
    return "\n".join(["| key | value | without it | what |", "| --- | --- | --- | --- |", *rows, ""])


def block(*sections: Section) -> str:
    """Examples of all their keys, as a file has them."""
    parts = [
        [section.before, section.at or section.header, *(line(key) for key in own(section) if not key.is_other)]
        for section in sections
    ]
    text = "\n\n".join("\n".join(filter(None, part)) for part in parts)
    return f"```toml\n{text}\n```\n"


def parameter_set() -> str:
    """The chapter of the other kind of file."""
    both = (PARAMETER_SET, VALUES)
    return f"## Parameter sets\n\n{VALUES.what}\n\n{table(*both)}\n<!-- file: my_valve/valve.toml -->\n{block(*both)}"


def row(key: Key) -> str:
    """Row of a key in its table."""
    value = " or ".join(f"`{choice}`" for choice in key.choices) or key.kind.name
    if len(key.choices) > 4:
        value = "one of those below"
    if key.unit:
        value = f"{value} [{key.unit}]"
    return f"| `{key.name}` | {value} | {without(key)} | {key.what} |"


def without(key: Key) -> str:
    """What holds where a key is left out."""
    if key.required:
        return "must be there"
    if key.name.startswith("<") or key.default is None:
        return key.otherwise or "-"
    return f"`{json.dumps(key.default)}`"


def line(key: Key) -> str:
    """Example of a key, as a file has it."""
    return key.example if key.name.startswith("<") else f"{key.name} = {key.example}"


def actions() -> str:
    """Actions of events."""
    rows = [
        f"| `{name}` | the target {act.what} | {act.value or 'none'} | {act.over or 'no'} | "
        f"{'inputs, parameters' if act.on_parameter else 'inputs'} | {'Real' if act.only_real else 'but text'} |"
        for name, act in ACTIONS.items()
    ]
    head = ["| action | what | `value` | `over` | of | types |", "| --- | --- | --- | --- | --- | --- |"]
    return "\n".join(["## Actions of events\n", *head, *rows, ""])


def metrics() -> str:
    """Kinds of metrics."""
    rows = [f"| `{name}` | {kind.what} | {USES[kind.reference]} |" for name, kind in KINDS.items()]
    return "\n".join(["## Kinds of metrics\n", "| kind | what | reference |", "| --- | --- | --- |", *rows, ""])


def commands() -> str:
    """A chapter for each command, and for each command of a group."""
    return "\n".join(of_command(words, each) for words, each in sorted(named(typer.main.get_command(app))))


def named(group: Any, words: str = "gapsense") -> Iterator[tuple[str, Any]]:
    """Commands of a group by what is typed."""
    for name, each in group.commands.items():
        yield from named(each, f"{words} {name}") if hasattr(each, "commands") else [(f"{words} {name}", each)]


def of_command(words: str, each: Any) -> str:
    """What a command does, its arguments and options."""
    rows = "".join(
        f"| {typed(p)} | {(p.help or '-').replace('|', chr(92) + '|')} | {left_out(p)} |\n" for p in each.params
    )
    head = "| argument | what | without it |\n| --- | --- | --- |\n"
    return f"## `{words}`\n\n{(each.help or '').replace('|', chr(92) + '|')}\n" + (f"\n{head}{rows}" if rows else "")


def typed(parameter: Any) -> str:
    """An argument or an option, with a word for its value."""
    if parameter.param_type_name == "argument":
        return f"`{parameter.name.upper()}`{', several' if parameter.nargs != 1 else ''}"
    value = "" if parameter.is_flag else f" {parameter.metavar or parameter.name.upper()}"
    return ", ".join(f"`{option}{value}`" for option in (*parameter.opts, *parameter.secondary_opts))


def left_out(parameter: Any) -> str:
    """What holds where an argument or option is not given."""
    if parameter.required:
        return "must be there"
    if isinstance(parameter.show_default, str):
        return str(parameter.show_default)
    default = parameter.default
    return "-" if default is None or callable(default) or default in (False, [], ()) else f"`{default}`"


def made(folder: Path) -> dict[str, str]:
    """Text of each file, by its name; what is written by hand stays."""
    parts = {PAGE: keys(), STUDY_PAGE: study_keys(), COMMANDS_PAGE: commands()}
    pages = {name: rewritten((folder / name).read_text(encoding="utf-8"), part) for name, part in parts.items()}
    schemas = {SCHEMA: schema(), STUDY_SCHEMA: study_schema()}
    return {**pages, **{name: f"{json.dumps(one, indent=2)}\n" for name, one in schemas.items()}}


def write(folder: Path) -> None:
    """Write them again."""
    for name, text in made(folder).items():
        write_atomically(folder / name, lambda file, text=text: print(text, end="", file=file))


if __name__ == "__main__":
    write(Path(sys.argv[1]))
