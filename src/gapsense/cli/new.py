"""The command that writes a scenario to start from."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
from pathlib import Path
from tempfile import mkdtemp
from typing import Annotated

import typer

from gapsense._os.files import LONGEST_NAME, mask, refuse_unwritable, unfit
from gapsense.cli.common import Output, command
from gapsense.cli.console import say_written, show
from gapsense.problems import InputError, suggest
from gapsense.shipped import example, examples

MINIMAL = Path(__file__).with_suffix(".toml")


@command("new")
def new(
    folder: Annotated[Path, typer.Argument(help="Folder to make")],
    like: Annotated[
        str | None, typer.Option(help="Example to copy, see `gapsense list`", show_default="a minimal scenario")
    ] = None,
) -> None:
    """Write a scenario to start from: a drive, a valve, a sensor and an estimator, or a copy of an example."""
    source = None if like is None else example(like)
    if like is not None and source is None:
        raise InputError([f"--like: there is no example `{like}`. {suggest(like, examples())}"])
    why = unfit(folder.name, frozenset())  # the system at hand tells the others
    if why or not folder.name:
        raise InputError([f"the name `{folder.name[:LONGEST_NAME]}` {why or 'is empty'}. Choose another one."])
    if os.path.lexists(folder):
        raise InputError([f"`{folder}` exists already. Choose another name, or remove it."])
    refuse_unwritable(folders=[folder.parent])
    folder.parent.mkdir(parents=True, exist_ok=True)
    partial = Path(mkdtemp(dir=folder.parent, prefix=f".{folder.name}."))
    try:
        partial.chmod(0o777 & ~mask())
        (copy if source else write)(partial, source or folder)
        partial.rename(folder)
    finally:  # complete or absent
        shutil.rmtree(partial, ignore_errors=True)
    show(f"{folder / 'scenario.toml'} written. Go on with `gapsense run {shlex.quote(str(folder))}`.")


def write(to: Path, called: Path) -> None:
    """The minimal scenario, with a title."""
    text = MINIMAL.read_text(encoding="utf-8").replace('"TITLE"', json.dumps(called.name, ensure_ascii=False))
    (to / "scenario.toml").write_text(text, encoding="utf-8")


def copy(to: Path, source: Path) -> None:
    """Copy the files of an example, and those of other examples that it refers to."""
    shutil.copytree(source, to, dirs_exist_ok=True, ignore=shutil.ignore_patterns("results", "*.py", "__pycache__"))
    file = to / "scenario.toml"
    text = file.read_text(encoding="utf-8")
    (to / "parameters").mkdir(exist_ok=True)
    for name in dict.fromkeys(re.findall(r'"(\.\./.+?)"', text)):
        own = f"parameters/{Path(name).parts[1]}_{Path(name).name}"
        shutil.copy2(source / name, to / own)
        text = text.replace(f'"{name}"', f'"{own}"')
    file.write_text(text, encoding="utf-8")


# The command that writes the JSON schema of scenario files.


@command("schema")
def schema(
    to: Annotated[
        Path | None, Output.FILE, typer.Option("--out", help="File to write", show_default="print it")
    ] = None,
) -> None:
    """Show or write the JSON schema of scenario files, with which editors complete and check them.

    Name it in the first line of a scenario: `#:schema scenario.schema.json`.
    """
    from gapsense._os.files import write_atomically
    from gapsense.report.schema import schema as made

    text = json.dumps(made(), indent=2)
    if to is None:
        return show(text)
    write_atomically(to, lambda file: print(text, file=file))
    say_written(to)
