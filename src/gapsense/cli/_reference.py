"""The reference of the commands, made from the commands: `python -m gapsense.cli._reference docs` writes it again."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from gapsense._os.files import write_atomically
from gapsense.cli import app
from gapsense.report.reference import rewritten

PAGE = "commands.md"


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


def write(folder: Path) -> None:
    """Write the page again; what is written by hand stays."""
    text = rewritten((folder / PAGE).read_text(encoding="utf-8"), commands())
    write_atomically(folder / PAGE, lambda file: print(text, end="", file=file))


if __name__ == "__main__":
    write(Path(sys.argv[1]))
