"""What an FMU says about itself, reduced to what wiring and running it need."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from gapsense.files import sha256
from gapsense.tables import Value

NUMERIC = ("Real", "Integer", "Enumeration")


@dataclass(frozen=True)
class Variable:
    """One scalar variable: its type and causality as FMI names them, limits and start as numbers where they are."""

    name: str
    reference: int
    type: str
    causality: str
    unit: str | None
    min: float | None
    max: float | None
    nominal: float
    start: Value | None

    @property
    def is_parameter(self) -> bool:
        """True if a scenario may set it."""
        return self.causality == "parameter"


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
        FMI 2.0 co-simulation FMU with a binary for this platform.

    Returns
    -------
    Description

    Raises
    ------
    ValueError
        Saying in one sentence why the FMU cannot be used.
    """
    import fmpy  # here, so that what reads no FMU starts fast

    try:
        model = fmpy.read_model_description(str(path))
        with zipfile.ZipFile(path) as archive:
            members = archive.namelist()
    except Exception as error:  # fmpy raises many kinds; each means the file is not a usable FMU
        raise ValueError(f"not a readable FMU: {' '.join(str(error).split())}") from error
    refuse_unusable(model, members, fmpy.platform)
    return Description(
        path=path,
        sha256=sha256(path),
        name=model.modelName,
        guid=model.guid,
        identifier=model.coSimulation.modelIdentifier,
        version=model.version or "",
        variables={v.name: variable(v) for v in model.modelVariables},
        feedthrough=feedthrough(model),
        is_single=bool(model.coSimulation.canBeInstantiatedOnlyOncePerProcess),
        can_save=bool(model.coSimulation.canGetAndSetFMUstate and model.coSimulation.canSerializeFMUstate),
    )


def refuse_unusable(model: Any, members: list[str], platform: str) -> None:
    """Raise ValueError unless the FMU is FMI 2.0 co-simulation with a binary for this platform."""
    if model.fmiVersion != "2.0" or model.coSimulation is None:
        raise ValueError(f"FMI {model.fmiVersion} without co-simulation found, FMI 2.0 co-simulation expected")
    if not any(member.startswith(f"binaries/{platform}/") for member in members):
        raise ValueError(f"it has no binary for this platform ({platform})")


def variable(v: Any) -> Variable:
    """A variable of fmpy's model description with its texts turned into numbers."""
    kind = v.type
    texts = [of_type(v, name) for name in ("min", "max", "nominal")]
    low, high, nominal = (None if text is None else float(text) for text in texts)
    return Variable(
        name=v.name,
        reference=v.valueReference,
        type=kind,
        causality=v.causality or "local",
        unit=of_type(v, "unit"),
        min=low,
        max=high,
        nominal=abs(nominal or 1.0),
        start=start_value(kind, v.start),
    )


def of_type(v: Any, attribute: str) -> str | None:
    """Attribute of the variable, or else of its declared type."""
    own: str | None = getattr(v, attribute)
    declared: str | None = getattr(v.declaredType, attribute, None)
    return declared if own is None else own


def start_value(kind: str, text: str | None) -> Value | None:
    """Start value in its own type, or None for none."""
    if text is None or kind == "String":
        return text
    if kind == "Boolean":
        return text in ("true", "1")
    return float(text) if kind == "Real" else int(text)


def feedthrough(model: Any) -> dict[str, frozenset[str]]:
    """Inputs that each output depends on; FMI says that missing `dependencies` mean all inputs."""
    inputs = frozenset(v.name for v in model.modelVariables if v.causality == "input")
    out = {v.name: inputs for v in model.modelVariables if v.causality == "output"}
    for unknown in model.outputs:
        if unknown.dependencies is not None:
            out[unknown.variable.name] = inputs & {v.name for v in unknown.dependencies}
    return out
