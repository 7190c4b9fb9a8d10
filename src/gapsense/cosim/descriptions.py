"""What an FMU says about itself, reduced to what wiring and running it need."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any

from gapsense.cosim.archive import DESCRIPTION, UnusableError, read_description, refuse_identifier, shown
from gapsense.cosim.model_xml import mended
from gapsense.cosim.rules import read_rules
from gapsense.cosim.variables import Variable, variable
from gapsense.files import sha256
from gapsense.fmi.ports import Component

__all__ = ["Description", "Descriptions", "Variable", "describe", "find_fmu"]
LONGEST = 500  # characters of what a reader says about a file
NOT_MOVED = ("Binary", "Clock")  # types that a run leaves alone
USED = ("input", "output", "parameter")  # causalities that a run moves


@dataclass(frozen=True)
class Description:
    """Model description of one FMU."""

    path: Path
    sha256: str
    name: str
    guid: str
    identifier: str
    version: str
    variables: Mapping[str, Variable]
    feedthrough: Mapping[str, frozenset[str]]  # inputs each output depends on directly; all where the FMU is silent
    is_single: bool = False  # a process can hold only one instance
    can_save: bool = False  # get, set and serialise its state
    fmi: int = 2  # version
    rules: Component | None = None  # that it states for its parameters
    step_size: float | None = None  # of its default experiment [s]

    def of(self, causality: str) -> list[Variable]:
        """Inputs, outputs or parameters, in the order of the file."""
        return [v for v in self.variables.values() if v.causality == causality]

    @cached_property
    def direct_inputs(self) -> frozenset[str]:
        """Inputs that some output depends on directly."""
        return frozenset().union(*self.feedthrough.values())


Descriptions = Mapping[str, Description]  # by component


def find_fmu(name: str, scenario: Path, fmus: Path) -> Path:
    """Where the FMU called `name` should be: a path relative to the scenario, or a file in the FMU folder."""
    return scenario.parent / name if name.endswith(".fmu") else fmus / f"{name}.fmu"


def describe(path: Path) -> Description:
    """Model description of an FMU file.

    Parameters
    ----------
    path : Path
        Co-simulation FMU of FMI 2.0 or 3.0 with a binary for this platform.

    Returns
    -------
    Description

    Raises
    ------
    UnusableError
        Saying why the FMU cannot be used, and what to do.
    """
    model, variables, rules, members = opened(path)
    refuse_unusable(model, members)
    refuse_shared(variables.values())
    return Description(
        path=path,
        sha256=sha256(path),
        name=model.modelName,
        guid=model.guid,
        identifier=model.coSimulation.modelIdentifier,
        version=model.version or "",
        variables=variables,
        feedthrough=feedthrough(model),
        is_single=bool(model.coSimulation.canBeInstantiatedOnlyOncePerProcess),
        can_save=bool(model.coSimulation.canGetAndSetFMUstate and model.coSimulation.canSerializeFMUstate),
        fmi=int(model.fmiVersion[0]),
        rules=rules,
        step_size=step_size(model),
    )


def opened(path: Path) -> tuple[Any, dict[str, Variable], Component | None, list[str]]:
    """What fmpy makes of the model description of any FMU file, its variables that a run can move, its rules, and the
    names of the archive's members.
    """
    data, members = read_description(path)
    try:
        root, text = mended(data)
        model = read_model(text)
        variables = {v.name: variable(v) for v in model.modelVariables if is_scalar(v)}
        return model, variables, read_rules(root, variables), members
    except UnusableError:
        raise
    except Exception as error:  # fmpy raises many kinds; each means the file is not a usable FMU
        why = shortened(" ".join(str(error).split()))
        raise UnusableError(f"not a readable FMU: {why}. Export it again.") from error


def step_size(model: Any) -> float | None:
    """Step of the default experiment [s], if there is one that can be used."""
    try:
        found = float(model.defaultExperiment.stepSize)
    except (AttributeError, TypeError, ValueError):
        return None
    return found if 0.0 < found < math.inf else None


def read_model(text: bytes) -> Any:
    """What fmpy makes of a model description; it sees nothing else of the archive."""
    import fmpy  # here, so that what reads no FMU starts fast

    alone = BytesIO()
    with zipfile.ZipFile(alone, "w") as archive:
        archive.writestr(DESCRIPTION, text)
    return fmpy.read_model_description(alone)


def refuse_unusable(model: Any, members: list[str]) -> None:
    """Raise unless the FMU is for co-simulation, without arrays as inputs, and has a library for this platform.

    Binary variables and clocks are left alone: without event mode nobody needs to move them.
    """
    import fmpy

    if model.coSimulation is None:
        found = f"FMI {model.fmiVersion} without co-simulation found, co-simulation expected"
        raise UnusableError(f"{found}. Export it as that.")
    refuse_identifier(model.coSimulation.modelIdentifier)
    for v in model.modelVariables:
        if v.causality in USED and v.dimensions and v.type not in NOT_MOVED and not is_spare(v):
            found = f"its variable `{shown(v.name)}` is an array; inputs that are scalars are supported"
            raise UnusableError(f"{found}. Export it without.")
    folder = f"binaries/{fmpy.platform if model.fmiVersion == '2.0' else fmpy.platform_tuple}/"
    library = f"{model.coSimulation.modelIdentifier}{fmpy.sharedLibraryExtension}"
    if folder + library not in members:
        platforms = sorted({name.split("/")[1] for name in members if name.startswith("binaries/") and name[9:]})
        has = f"it has {', '.join(map(shown, platforms))}" if platforms else "it has none at all"
        raise UnusableError(f"it has no library `{folder}{library}` for this platform; {has}. Ask for one that does.")


def refuse_shared(variables: Iterable[Variable]) -> None:
    """Raise if two variables that can be set are one to the FMU, or two have one name."""
    first: dict[tuple[str, int], str] = {}
    for v in variables:
        if v.causality in ("input", "parameter"):
            kind = "Integer" if v.type == "Enumeration" else v.type
            other = first.setdefault((v.size or kind, v.reference), v.name)
            if other != v.name:
                found = f"its variables `{shown(other)}` and `{shown(v.name)}` have one value reference, {v.reference}"
                raise UnusableError(f"{found}. Export it again.")


def is_scalar(v: Any) -> bool:
    """True for a variable that a run can move; a second name of one that can be set does not count."""
    is_second = v.alias is not None and v.causality in ("input", "parameter")
    return not v.dimensions and v.type not in NOT_MOVED and not is_second


def is_spare(v: Any) -> bool:
    """True for an array that a run can do without: an output, or a parameter, which then keeps its start value."""
    return bool(v.dimensions) and v.causality in ("output", "parameter")


def shortened(text: str) -> str:
    """The beginning of a long text."""
    return text.rstrip(".") if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def feedthrough(model: Any) -> dict[str, frozenset[str]]:
    """Inputs that each output depends on; FMI says that missing `dependencies` mean all inputs."""
    inputs = frozenset(v.name for v in model.modelVariables if v.causality == "input")
    out = {v.name: inputs for v in model.modelVariables if v.causality == "output" and is_scalar(v)}
    for unknown in model.outputs:
        if unknown.dependencies is not None and unknown.variable.name in out:
            out[unknown.variable.name] = inputs & {v.name for v in unknown.dependencies}
    return out
