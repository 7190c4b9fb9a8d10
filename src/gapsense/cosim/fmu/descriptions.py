"""What an FMU says about itself, reduced to what wiring and running it need."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, fromstring, tostring

from gapsense._os.files import sha256
from gapsense.cosim.fmu.archive import DESCRIPTION, UnusableError, read_description, refuse_identifier, shown
from gapsense.cosim.fmu.rules import read_rules
from gapsense.cosim.fmu.variables import Variable, scalars
from gapsense.fmi.ports import Component

PARAMETERS = ("parameter", "calculatedParameter")
NOT_REAL = ("Integer", "Boolean", "String", "Enumeration")
__all__ = ["Description", "Descriptions", "Variable", "describe", "find_fmu"]
LONGEST = 500  # characters of what a reader says about a file
NO_SIZES: Mapping[str, int] = {}


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
    def arrays(self) -> Mapping[str, list[Variable]]:
        """Elements of each array, which move in one call."""
        found: dict[str, list[Variable]] = {}
        for v in self.variables.values():
            if v.array:
                found.setdefault(v.array, []).append(v)
        return found

    def whole(self, variables: Iterable[Variable]) -> list[Variable]:
        """Variables, with all elements of an array for any of them."""
        return [*{e.name: e for v in variables for e in (self.arrays[v.array] if v.array else [v])}.values()]

    @cached_property
    def direct_inputs(self) -> frozenset[str]:
        """Inputs that some output depends on directly."""
        return frozenset().union(*self.feedthrough.values())


Descriptions = Mapping[str, Description]  # by component


def find_fmu(name: str, scenario: Path, fmus: Path) -> Path:
    """Where the FMU called `name` should be: a path relative to the scenario, or a file in the FMU folder."""
    return scenario.parent / name if name.endswith(".fmu") else fmus / f"{name}.fmu"


def describe(path: Path, sizes: Mapping[str, int] = NO_SIZES) -> Description:
    """Model description of an FMU file.

    Parameters
    ----------
    path : Path
        Co-simulation FMU of FMI 2.0 or 3.0 with a binary for this platform.
    sizes : mapping of str to int, optional
        Values of structural parameters, on which the sizes of arrays depend, other than their start values.

    Returns
    -------
    Description

    Raises
    ------
    UnusableError
        Saying why the FMU cannot be used, and what to do.
    """
    model, variables, rules, members = opened(path, sizes)
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
        feedthrough=feedthrough(model, variables),
        is_single=bool(model.coSimulation.canBeInstantiatedOnlyOncePerProcess),
        can_save=bool(model.coSimulation.canGetAndSetFMUstate and model.coSimulation.canSerializeFMUstate),
        fmi=int(model.fmiVersion[0]),
        rules=rules,
        step_size=step_size(model),
    )


def opened(
    path: Path, sizes: Mapping[str, int] = NO_SIZES
) -> tuple[Any, dict[str, Variable], Component | None, list[str]]:
    """What fmpy makes of the model description of any FMU file, its variables that a run can move, its rules, and the
    names of the archive's members.
    """
    data, members = read_description(path)
    try:
        root, text = mended(data)
        model = read_model(text)
        add_limits(model, root)
        moved = [v for v in model.modelVariables if not is_second(v)]
        variables = {scalar.name: scalar for v in moved for scalar in scalars(v, sizes)}
        return model, variables, read_rules(root, variables), members
    except UnusableError:
        raise
    except Exception as error:  # fmpy raises many kinds; each means the file is not a usable FMU
        why = shortened(" ".join(str(error).split()))
        raise UnusableError(f"not a readable FMU: {why}. Export it again.") from error


def add_limits(model: Any, root: Element) -> None:
    """Add the limits of unsigned numbers, which fmpy leaves out."""
    elements = {e.get("name"): e for e in root.iterfind("ModelVariables/*") if e.tag.startswith("UInt")}
    for v in model.modelVariables:
        if v.name in elements:
            v.min, v.max = elements[v.name].get("min"), elements[v.name].get("max")


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
    """Raise unless the FMU is for co-simulation and has a library for this platform.

    Binary variables, clocks and arrays of texts are left alone: without event mode nobody needs to move them.
    """
    import fmpy

    if model.coSimulation is None:
        found = f"FMI {model.fmiVersion} without co-simulation found, co-simulation expected"
        raise UnusableError(f"{found}. Export it as that.")
    refuse_identifier(model.coSimulation.modelIdentifier)
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
            other = first.setdefault((v.size or kind, v.reference), v.array or v.name)
            if other != (v.array or v.name):
                found = f"its variables `{shown(other)}` and `{shown(v.name)}` have one value reference, {v.reference}"
                raise UnusableError(f"{found}. Export it again.")


def is_second(v: Any) -> bool:
    """True for a second name of a variable that can be set."""
    return v.alias is not None and v.causality in ("input", "parameter")


def shortened(text: str) -> str:
    """The beginning of a long text."""
    return text.rstrip(".") if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def feedthrough(model: Any, variables: Mapping[str, Variable]) -> dict[str, frozenset[str]]:
    """Inputs that each output depends on; FMI says that missing `dependencies` mean all inputs."""
    said = {u.variable.name: u.dependencies for u in model.outputs if u.dependencies is not None}
    inputs = [v for v in variables.values() if v.causality == "input"]

    def direct(output: Variable) -> frozenset[str]:
        known = said.get(output.array or output.name)
        names = None if known is None else {v.name for v in known}
        return frozenset(v.name for v in inputs if names is None or (v.array or v.name) in names)

    return {v.name: direct(v) for v in variables.values() if v.causality == "output"}


# Model descriptions as XML: small mistakes of exporters are mended, references to nothing are refused.


def mended(data: bytes) -> tuple[Element, bytes]:
    """A model description, and its text with the variability that some exporters leave out where FMI asks for it.

    Without one a variable of FMI 2.0 is continuous, which a parameter and a variable that is not Real cannot be.
    """
    root = fromstring(data)
    refuse_version(root.get("fmiVersion", "without a version"))
    found = [variable for variable in root.iterfind("ModelVariables/ScalarVariable") if lacks_variability(variable)]
    for variable in found:
        variable.set("variability", "fixed" if variable.get("causality") in PARAMETERS else "discrete")
    refuse_dangling(root)
    return root, tostring(root, "utf-8", xml_declaration=True) if found else data


def refuse_version(version: str) -> None:
    """Raise unless an FMU is of FMI 2.0 or 3.0."""
    if version != "2.0" and not version.startswith("3.0"):
        raise UnusableError(f"FMI {shown(version)} found, FMI 2.0 or 3.0 co-simulation expected. Export it as that.")


def lacks_variability(variable: Element) -> bool:
    """True for a variable of FMI 2.0 whose default variability its causality or its type rules out."""
    is_other = any(child.tag in NOT_REAL for child in variable)
    return "variability" not in variable.attrib and (is_other or variable.get("causality") in PARAMETERS)


def refuse_dangling(root: Element) -> None:
    """Raise if the model structure refers to variables that there are not."""
    is_old = root.get("fmiVersion") == "2.0"
    variables = root.find("ModelVariables")
    elements = list(variables) if variables is not None else []
    known = {str(k) for k in range(1, len(elements) + 1)} if is_old else {v.get("valueReference") for v in elements}
    for place, reference in references(root, "index" if is_old else "valueReference"):
        if (reference.lstrip("0") or "0") not in known:
            found = f"its model structure refers to variable {shown(reference)} in `{place}`, which it does not have"
            raise UnusableError(f"{found}. Export it again.")


def references(root: Element, key: str) -> Iterator[tuple[str, str]]:
    """Every reference of the model structure with the element that it stands in."""
    for element in root.iterfind("ModelStructure//*"):
        for attribute in (key, "dependencies"):
            for reference in element.get(attribute, "").split():
                yield element.tag, reference
