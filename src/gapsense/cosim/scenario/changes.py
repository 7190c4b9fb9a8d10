"""Values laid over a scenario from outside: `--set component.variable=value`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from gapsense.cosim.scenario.document import Source, read_document
from gapsense.parameters import located_values
from gapsense.problems import ScenarioError, suggest
from gapsense.tables import Kind, Table, Value, parsed_value

OVER = "--set"  # on the command line, and as the place of a value in messages


def changed(source: Source, settings: Sequence[str]) -> Source:
    """A scenario with values laid over it that are written as on the command line.

    Parameters
    ----------
    source : str, Path or Document
        The scenario.
    settings : sequence of str
        As `valve.damping=0.4`. What TOML does not take as a value is a text; files are relative to the working folder.

    Returns
    -------
    str, Path or Document
        The scenario itself where there is nothing to lay over it.
    """
    if not settings:
        return source
    problems: list[str] = []
    changes: dict[str, Any] = {}
    for setting in settings:
        name, equals, text = (part.strip() for part in setting.partition("="))
        if not all((equals, *name.partition("."))):
            problems.append(f"{OVER}, {setting}: `component.parameter=value` expected. Correct it.")
        elif name in changes:
            problems.append(f"{OVER}, {name}: given twice. Keep one.")
        changes[name] = parsed_value(text)
    document = read_document(source, problems)
    if problems or document is None:
        raise ScenarioError(problems)
    return replace(document, changes={**document.changes, **changes})


class Changes:
    """Values laid over a scenario: first come those of inputs and seeds that it states, the others are parameters."""

    def __init__(self, given: Mapping[str, Any], problems: list[str]) -> None:
        self.left = dict(given)
        self.table = Table(given, OVER, "", problems)

    def instead(self, names: Iterable[str], kind: Kind) -> dict[str, Any]:
        """Values of that kind instead of what the scenario states under these names."""
        return self.popped([name for name in names if name in self.left]).flat(kind)

    def parameters(self, component: str) -> dict[str, Value]:
        """Values for the parameters of a component."""
        head = f"{component}."
        mine = self.popped([name for name in self.left if name.startswith(head)])
        return {name.removeprefix(head): value for name, value in located_values(mine, Path()).items()}

    def popped(self, names: Iterable[str]) -> Table:
        """Values that nobody else gets."""
        return self.table.child({name: self.left.pop(name) for name in names}, "")

    def finish(self, components: Iterable[str]) -> None:
        """Note what names no component."""
        for name in self.left:
            component = name.partition(".")[0]
            self.table.note(name, f"there is no component `{component}`. {suggest(component, components)}")
