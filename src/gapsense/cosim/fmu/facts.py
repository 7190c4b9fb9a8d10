"""What any FMU file says about itself, for readers: also one that cannot run here, with the reason."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NamedTuple

from gapsense.cosim.fmu.archive import UnusableError, printable
from gapsense.cosim.fmu.descriptions import NOT_MOVED, Variable, describe, open_model, variable
from gapsense.problems import InputError, suggest
from gapsense.tables import Value

LONGEST = 24  # characters of a start value
GROUPS = {  # causalities, and what a reader calls them
    "input": "Inputs",
    "output": "Outputs",
    "parameter": "Parameters",
    "structuralParameter": "Structural parameters",
}


class Line(NamedTuple):
    """One variable, as texts."""

    name: str
    unit: str
    start: str
    range: str
    description: str


class Facts(NamedTuple):
    """An FMU for its reader; `problem` says why it cannot run here, if it cannot."""

    name: str
    description: str
    origin: str  # version of FMI, kinds, who made it
    groups: Mapping[str, list[Line]]  # variables by their causality; those that are empty are missing
    others: int  # variables of other causalities
    problem: str


def find_file(name: str, fmus: Path) -> Path:
    """The FMU file of that path, or the component of that name, in any case, in a folder of FMUs."""
    path = Path(name)
    if path.is_file():
        return path
    if path.suffix == ".fmu":
        beside = (file.name for file in path.parent.glob("*.fmu"))
        raise InputError([f"{path}: there is no such file. {suggest(path.name, beside)}"])
    known = {plain(file.stem): file for file in fmus.glob("*.fmu")}
    if plain(name) not in known:
        near = get_close_matches(plain(name), known, n=1)
        hint = suggest(known[near[0]].stem if near else name, (file.stem for file in known.values()))
        built = "" if known else " Build the components with `gapsense build`, or name an FMU file."
        raise InputError([f"there is no component `{name}` in {fmus}. {hint}{built}"])
    return known[plain(name)]


def plain(name: str) -> str:
    """A name without what need not be typed."""
    return name.replace("_", "").lower()


def read_facts(path: Path) -> Facts:
    """Facts about an FMU file; an InputError if it is no FMU at all."""
    try:
        model, known, rules, _ = open_model(path)
    except UnusableError as error:
        raise InputError([f"{path}: {error}"]) from error
    try:
        describe(path)
        problem = ""
    except UnusableError as error:
        problem = f"It cannot run here: {error}"
    choices = {port.name: port.choices for port in rules.ports if port.choices} if rules else {}
    groups = {
        title: [
            line(v, known.get(v.name), choices.get(v.name, ())) for v in model.modelVariables if v.causality == kind
        ]
        for kind, title in GROUPS.items()
    }
    return Facts(
        name=printable(model.modelName or path.stem),
        description=put_on_one_line(model.description),
        origin=origin(model),
        groups={title: lines for title, lines in groups.items() if lines},
        others=sum(v.causality not in (*GROUPS, "independent") for v in model.modelVariables),
        problem=problem,
    )


def origin(model: Any) -> str:
    """Version of FMI, kinds, version and tool."""
    kinds = {"coSimulation": "co-simulation", "modelExchange": "model exchange"}
    kinds |= {"scheduledExecution": "scheduled execution"}
    made = [word for attribute, word in kinds.items() if getattr(model, attribute, None) is not None]
    version = f"version {printable(model.version)}" if model.version else ""
    tool = f"made by {printable(model.generationTool)}" if model.generationTool else ""
    return ", ".join(filter(None, (f"FMI {printable(model.fmiVersion)}", *made, version, tool)))


def line(v: Any, moved: Variable | None, choices: tuple[str, ...]) -> Line:
    """A variable as texts; `moved` is what a run knows of it, of a kind that is moved."""
    size = "x".join(map(str, v.shape or ()))
    found = moved or (variable(v) if v.type not in NOT_MOVED and not v.dimensions else None)
    return Line(
        name=printable(v.name),
        unit=printable((found or v).unit or ""),
        start=start_of(found) if found else shorten(v.start),
        range=range_of(found, choices) if found else f"{v.type}{f', array of {size}' if size else ''}",
        description=put_on_one_line(v.description),
    )


def start_of(of: Variable) -> str:
    """Start value as one writes it in a scenario."""
    if (value := of.start) is None:
        return ""
    item = next((name for name, k in of.items.items() if k == value), None)
    return format_value(value if item is None else item)


def range_of(of: Variable, choices: tuple[str, ...]) -> str:
    """What a variable may be: names, limits, or its type where that is not Real."""
    if choices or of.items:
        return ", ".join(map(printable, choices or of.items))
    if of.min is not None and of.max is not None:
        return f"{format_value(of.min)} to {format_value(of.max)}"
    if of.min is not None:
        return f"from {format_value(of.min)}"
    if of.max is not None:
        return f"to {format_value(of.max)}"
    return "" if of.type == "Real" else of.type


def format_value(value: Value) -> str:
    """Write a value as short text."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return shorten(f'"{value}"')
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def shorten(value: object) -> str:
    """Cut a text to its beginning, and make it printable."""
    text = printable(str(value)) if value is not None else ""
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def put_on_one_line(text: str | None) -> str:
    """Put a description on one line."""
    return printable(" ".join((text or "").split()))
