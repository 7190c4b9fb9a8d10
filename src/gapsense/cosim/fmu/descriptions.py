"""What an FMU says about itself, reduced to what wiring and running it need."""

from __future__ import annotations

import hashlib
import math
import os
import pickle
import platform
import re
import sys
import tempfile
import zipfile
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from importlib.util import find_spec
from io import BytesIO
from itertools import product
from pathlib import Path
from time import time
from typing import Any
from xml.etree.ElementTree import Element, fromstring, tostring

from gapsense._os.files import fingerprint, sha256, state
from gapsense._os.locks import FACTS, cache_folder
from gapsense.cosim.fmu.archive import DESCRIPTION, UnusableError, read_description, refuse_identifier, sanitise
from gapsense.fmi import ports
from gapsense.fmi.ports import Component, Limit, Port
from gapsense.fmi.values import KINDS, ValuesError, fields
from gapsense.tables import Value

NUMERIC = ("Real", "Integer", "Enumeration")
TYPES: Mapping[str, str] = {  # types of FMI 3.0 by those of FMI 2.0
    "Float64": "Real",
    "Float32": "Real",
    **{f"{sign}Int{bits}": "Integer" for sign in ("", "U") for bits in (8, 16, 32, 64)},
}
RANGES: Mapping[str, tuple[int, int]] = {
    **{f"Int{n}": (-(2 ** (n - 1)), 2 ** (n - 1) - 1) for n in (8, 16, 32, 64)},
    **{f"UInt{n}": (0, 2**n - 1) for n in (8, 16, 32, 64)},
}
HAVE_STARTS = ("output", "local")  # causalities besides inputs and parameters
NOT_MOVED = ("Binary", "Clock")  # types that a run leaves alone
MOST_ELEMENTS = 100  # of an array; larger ones are left alone too
STRUCTURAL = "structuralParameter"  # causality of the numbers that sizes of arrays are
OF_TYPES = {kind: RANGES["Int32"] for kind in ("Integer", "Enumeration")}  # where the type names no size
PLACES = (  # of FMI 2.0 and of FMI 3.0
    "VendorAnnotations/Tool[@name='Gapsense']/Rules",
    "Annotations/Annotation[@type='gapsense.rules']/Rules",
)
SHORT, SYSTEM, ENDING = {"win32": ("win", "windows", ".dll"), "darwin": ("darwin", "darwin", ".dylib")}.get(
    sys.platform, ("linux", "linux", ".so")
)
BITS = 64 if sys.maxsize > 2**32 else 32
ARM = "aarch64" if platform.machine().lower() in ("aarch64", "arm64") else ""
FOLDERS = {2: f"{SHORT}{BITS}", 3: f"{ARM or ('x86_64' if BITS == 64 else 'x86')}-{SYSTEM}"}  # by the version of FMI
HIGHEST_POWER = 9
PARAMETERS = ("parameter", "calculatedParameter")
NOT_REAL = ("Integer", "Boolean", "String", "Enumeration")
__all__ = ["Description", "Descriptions", "Variable", "describe", "find_fmu"]
LONGEST = 500  # characters of what a reader says about a file
NO_SIZES: Mapping[str, int] = {}
OLD = 90 * 86400.0  # seconds after which what was kept and not used is removed
SEAL = 32  # bytes of the hash before what was kept


# Variables of an FMU: one set of types for FMI 2.0 and 3.0, numbers in place of texts, arrays by their elements.


@dataclass(frozen=True)
class Variable:
    """A scalar variable, or an element of an array: its type and causality as FMI names them, limits and start."""

    name: str
    reference: int
    type: str  # Real, Integer, Boolean, String or Enumeration
    causality: str
    unit: str | None
    min: float | None
    max: float | None
    nominal: float
    start: Value | None
    size: str = ""  # its type in FMI 3.0, such as Int16; empty for FMI 2.0
    has_start: bool = False  # an output or a local variable with a start value that may be set
    items: Mapping[str, int] = field(default_factory=dict)  # of an Enumeration
    variability: str = ""
    array: str = ""  # that it is an element of
    place: int = 0  # in that, row by row
    is_structural: bool = False  # a parameter that decides sizes of arrays

    @property
    def is_parameter(self) -> bool:
        """True if a scenario may set it."""
        return self.causality == "parameter"

    @property
    def is_tunable(self) -> bool:
        """True for a parameter that may be set during a run."""
        return self.is_parameter and self.variability == "tunable"

    @property
    def is_settable(self) -> bool:
        """True if a value may be given before the initialisation: parameters, inputs, and what has a start value."""
        return self.causality in ("parameter", "input") or self.has_start

    @property
    def range(self) -> tuple[int, int] | None:
        """Smallest and largest number of an integer type, or None for another."""
        return RANGES.get(self.size) or OF_TYPES.get(self.type)

    def number(self, value: Value) -> Value:
        """The value as FMI takes it: an item of an enumeration becomes its number."""
        return self.items.get(value, value) if isinstance(value, str) else value


def scalars(v: Any, sizes: Mapping[str, int]) -> list[Variable]:
    """A variable of fmpy's model description, or the elements of an array: `y[1]`, `A[2,1]`, row by row.

    `sizes` are values of structural parameters that are not their start values.  What a run does not move has none.
    """
    if v.type in NOT_MOVED or (v.dimensions and v.type == "String"):
        return []
    if not v.dimensions:
        return [variable(v)]
    shape = [sizes.get(d.variable.name, n) if d.variable else n for d, n in zip(v.dimensions, v.shape)]
    count = math.prod(shape)
    if count > MOST_ELEMENTS and v.causality != "input":
        return []
    if count > MOST_ELEMENTS:
        size = "x".join(map(str, shape))
        found = f"its input `{sanitise(v.name)}` is an array of {size}, at most {MOST_ELEMENTS} elements are supported"
        raise UnusableError(f"{found}. Make it smaller.")
    texts = (v.start or "").split()
    if len(texts) not in (0, 1, count) and count == math.prod(v.shape):
        found = f"its array `{sanitise(v.name)}` has {len(texts)} start values, {count} or one expected"
        raise UnusableError(f"{found}. Export it again.")
    starts = texts * count if len(texts) == 1 else texts if len(texts) == count else [None] * count
    like, places = variable(v, None), product(*(range(1, n + 1) for n in shape))
    return [
        replace(
            like, name=f"{v.name}[{','.join(map(str, at))}]", start=start_value(like.type, text), array=v.name, place=k
        )
        for k, (at, text) in enumerate(zip(places, starts))
    ]


def variable(v: Any, start: str | None = "") -> Variable:
    """A variable of fmpy's model description with its texts turned into numbers; another start if one is given."""
    kind, start = TYPES.get(v.type, v.type), v.start if start == "" else start
    low, high, nominal = (number(v, name) for name in ("min", "max", "nominal"))
    return Variable(
        name=v.name,
        reference=v.valueReference,
        type=kind,
        causality="parameter" if v.causality == STRUCTURAL else v.causality or "local",
        unit=of_type(v, "unit"),
        min=low,
        max=high,
        nominal=abs(nominal or 1.0),
        start=start_value(kind, start),
        size=v.type if v.type in TYPES else "",
        has_start=v.causality in HAVE_STARTS and v.initial in ("exact", "approx") and v.variability != "constant",
        variability="fixed" if v.causality == STRUCTURAL else v.variability or "",
        is_structural=v.causality == STRUCTURAL,
        items={item.name: int(item.value) for item in v.declaredType.items} if v.declaredType else {},
    )


def of_type(v: Any, attribute: str) -> str | None:
    """Attribute of the variable, or else of its declared type."""
    own: str | None = getattr(v, attribute)
    declared: str | None = getattr(v.declaredType, attribute, None)
    return declared if own is None else own


def number(v: Any, attribute: str) -> float | None:
    """Numeric attribute of the variable or of its declared type."""
    text = of_type(v, attribute)
    value = None if text is None else float(text)
    if value is not None and math.isnan(value):
        raise UnusableError(f"`{attribute}` of its variable `{sanitise(v.name)}` is not a number. Export it again.")
    return value


def start_value(kind: str, text: str | None) -> Value | None:
    """Start value in its own type, or None for none."""
    if text is None or kind == "String":
        return text
    if kind == "Boolean":
        return text in ("true", "1")
    return float(text) if kind == "Real" else int(text)


# Rules for parameters that an FMU states in its annotations: choices, tables, parameters that belong together.
#
# FMI has no words for them, so that otherwise only the run would tell. They are written by `fmi/describe.py`.


def read_rules(root: Element, variables: Mapping[str, Variable]) -> Component | None:
    """Rules of a model description, as a port table of the parameters that they can be applied to; None for none."""
    rules = next((found for place in PLACES if (found := root.find(place)) is not None), None)
    if rules is None:
        return None
    try:
        texts = {tag: {e.attrib["variable"]: items(e) for e in rules.findall(tag)} for tag in ("Choices", "Table")}
        ports = tuple(
            Port(
                name=v.name,
                causality="parameter",
                unit=v.unit or "1",
                description="",
                start=v.start,
                min=v.min,
                max=v.max,
                kind=v.type,
                choices=texts["Choices"].get(v.name, ()),
                columns=texts["Table"].get(v.name, ()),
            )
            for v in variables.values()
            if v.is_parameter and v.start is not None and v.type in KINDS
        )
        known = {port.name for port in ports if port.kind == "Real"}
        rising = tuple((e.attrib["lower"], e.attrib["upper"]) for e in rules.findall("Rising"))
        limits = tuple(limit(element) for element in rules.findall("Limit"))
        named = {*sum(rising, ()), *(name for own in limits for name, _ in own.powers)}
        if not named <= known:
            raise ValueError(f"no Real parameter `{min(named - known)}`")
    except (KeyError, ValueError) as error:
        raise UnusableError(f"its annotations for Gapsense are wrong: {error}. Build or export it again.") from error
    return Component("", "", "", ports, rising=rising, limits=limits)


def items(element: Element) -> tuple[str, ...]:
    """Texts of the items in an element."""
    return tuple(item.text or "" for item in element.findall("Item"))


def limit(element: Element) -> Limit:
    """Limit of a product."""
    powers = tuple((e.attrib["variable"], int(e.attrib["power"])) for e in element.findall("Factor"))
    if any(not 0 < abs(power) <= HIGHEST_POWER for _, power in powers):
        raise ValueError(f"powers from 1 to {HIGHEST_POWER} expected")
    return Limit(powers, float(element.attrib["below"]), element.attrib["reason"])


def broken_rules(rules: Component, values: Mapping[str, Value]) -> list[str]:
    """What is wrong with values of parameters that fit their types and ranges; tables within the FMU are not read."""
    ports = tuple(port for port in rules.ports if is_known(port, values))
    try:
        fields(rules._replace(ports=ports), {p.name: values[p.name] for p in ports if p.name in values}, Path())
    except ValuesError as error:
        return error.problems
    except ArithmeticError:  # a limit by a parameter that is 0
        return []
    return []


def is_known(port: Port, values: Mapping[str, Value]) -> bool:
    """True for a parameter that can be judged without the FMU: no free text, no table that it brings along or lacks."""
    if port.columns:
        file = Path(str(values.get(port.name, "")))
        return file.is_absolute() and file.is_file()
    return port.kind != "String" or bool(port.choices)


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
    can_return: bool = False  # get and set its state, so that it can repeat a step
    can_interpolate: bool = False  # takes slopes of its Real inputs
    can_vary: bool = False  # takes steps of any length
    fmi: int = 2  # version
    rules: Component | None = None  # that it states for its parameters
    step_size: float | None = None  # of its default experiment [s]

    def of(self, causality: str) -> list[Variable]:
        """Inputs, outputs or parameters, in the order of the file."""
        return [v for v in self.variables.values() if v.causality == causality]

    @property
    def starts(self) -> dict[str, Value]:
        """Start values of the parameters that have one."""
        return {v.name: v.start for v in self.of("parameter") if v.start is not None}

    @property
    def is_random(self) -> bool:
        """True if it has an Integer `seed`: with other steps it draws other random numbers."""
        seed = self.variables.get("seed")
        return seed is not None and seed.type == "Integer"

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
    """Model description of a co-simulation FMU of FMI 2.0 or 3.0 with a binary for this platform.

    The `sizes` are values of structural parameters, on which the sizes of arrays depend, other than their start values.
    An UnusableError says why the FMU cannot be used, and what to do.
    """
    with suppress(OSError):  # of a file that is not there it is told below
        digest = sha256(path)
        kept = place_of(digest, sizes)
        if known := recall_description(kept, path):
            return known
        made = read_anew(path, sizes, digest)
        keep(kept, made)
        return made
    return read_anew(path, sizes, "")


def read_anew(path: Path, sizes: Mapping[str, int], digest: str) -> Description:
    """Model description of an FMU file with this hash, from the file itself."""
    model, variables, rules, members = open_model(path, sizes)
    refuse_unusable(model, members)
    refuse_shared(variables.values())
    return Description(
        path=path,
        sha256=digest,
        name=model.modelName,
        guid=model.guid,
        identifier=model.coSimulation.modelIdentifier,
        version=model.version or "",
        variables=variables,
        feedthrough=feedthrough(model, variables),
        is_single=bool(model.coSimulation.canBeInstantiatedOnlyOncePerProcess),
        can_return=bool(model.coSimulation.canGetAndSetFMUstate),
        can_save=bool(model.coSimulation.canGetAndSetFMUstate and model.coSimulation.canSerializeFMUstate),
        can_interpolate=bool(getattr(model.coSimulation, "canInterpolateInputs", False)),
        can_vary=bool(model.coSimulation.canHandleVariableCommunicationStepSize),
        fmi=int(model.fmiVersion[0]),
        rules=rules,
        step_size=step_size(model),
    )


def open_model(
    path: Path, sizes: Mapping[str, int] = NO_SIZES
) -> tuple[Any, dict[str, Variable], Component | None, list[str]]:
    """What fmpy makes of the model description of any FMU file, its variables that a run can move, its rules, and the
    names of the archive's members.
    """
    data, members = read_description(path)
    try:
        root, text = mend_description(data)
        model = read_model(text)
        elements = {e.get("name"): e for e in root.iterfind("ModelVariables/*") if e.tag.startswith("UInt")}
        for v in (v for v in model.modelVariables if v.name in elements):  # whose limits fmpy leaves out
            v.min, v.max = elements[v.name].get("min"), elements[v.name].get("max")
        moved = [v for v in model.modelVariables if not (v.alias is not None and v.causality in ("input", "parameter"))]
        variables = {scalar.name: scalar for v in moved for scalar in scalars(v, sizes)}
        return model, variables, read_rules(root, variables), members
    except UnusableError:
        raise
    except Exception as error:  # fmpy raises many kinds; each means the file is not a usable FMU
        why = " ".join(str(error).split()).rstrip(".")
        why = why if len(why) <= LONGEST else f"{why[:LONGEST]}..."
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


def path_in(fmi: int, identifier: str) -> str:
    """Path of a library in an FMU."""
    return f"binaries/{FOLDERS[fmi]}/{identifier}{ENDING}"


def refuse_unusable(model: Any, members: list[str]) -> None:
    """Raise unless the FMU is for co-simulation and has a library for this platform.

    Binary variables, clocks and arrays of texts are left alone: without event mode nobody needs to move them.
    """
    if model.coSimulation is None:
        found = f"FMI {model.fmiVersion} without co-simulation found, co-simulation expected"
        raise UnusableError(f"{found}. Export it as that.")
    refuse_identifier(model.coSimulation.modelIdentifier)
    library = path_in(2 if model.fmiVersion == "2.0" else 3, model.coSimulation.modelIdentifier)
    if library not in members:
        platforms = sorted({name.split("/")[1] for name in members if name.startswith("binaries/") and name[9:]})
        has = f"it has {', '.join(map(sanitise, platforms))}" if platforms else "it has none"
        raise UnusableError(f"it has no library `{library}` for this platform; {has}. Ask for an FMU that has it.")


def refuse_shared(variables: Iterable[Variable]) -> None:
    """Raise if two variables that can be set are one to the FMU, or two have one name."""
    first: dict[tuple[str, int], str] = {}
    for v in variables:
        if v.causality in ("input", "parameter"):
            kind = "Integer" if v.type == "Enumeration" else v.type
            other = first.setdefault((v.size or kind, v.reference), v.array or v.name)
            if other != (v.array or v.name):
                a, b = sanitise(other), sanitise(v.name)
                found = f"its variables `{a}` and `{b}` share the value reference {v.reference}"
                raise UnusableError(f"{found}. Export it again.")


def feedthrough(model: Any, variables: Mapping[str, Variable]) -> dict[str, frozenset[str]]:
    """Inputs that each output depends on; FMI says that missing `dependencies` mean all inputs."""
    said = {u.variable.name: u.dependencies for u in model.outputs if u.dependencies is not None}
    inputs = [v for v in variables.values() if v.causality == "input"]

    def direct(output: Variable) -> frozenset[str]:
        """Inputs that an output depends on, by the name of their array where they are in one."""
        known = said.get(output.array or output.name)
        names = None if known is None else {v.name for v in known}
        return frozenset(v.name for v in inputs if names is None or (v.array or v.name) in names)

    return {v.name: direct(v) for v in variables.values() if v.causality == "output"}


# Model descriptions as XML: small mistakes of exporters are mended, references to nothing are refused.


def mend_description(data: bytes) -> tuple[Element, bytes]:
    """Parse a model description, and add the variability that some exporters leave out where FMI asks for it.

    Without one a variable of FMI 2.0 is continuous, which a parameter and a variable that is not Real cannot be.
    """
    root = fromstring(data)
    version = root.get("fmiVersion", "without a version")
    if version != "2.0" and not version.startswith("3.0"):
        raise UnusableError(f"FMI {sanitise(version)} found, FMI 2.0 or 3.0 co-simulation expected. Export it as that.")
    found = []
    for variable in root.iterfind("ModelVariables/ScalarVariable"):
        is_parameter = variable.get("causality") in PARAMETERS
        if "variability" not in variable.attrib and (is_parameter or any(child.tag in NOT_REAL for child in variable)):
            variable.set("variability", "fixed" if is_parameter else "discrete")
            found.append(variable)
    refuse_dangling(root)
    return root, tostring(root, "utf-8", xml_declaration=True) if found else data


def refuse_dangling(root: Element) -> None:
    """Raise if the model structure refers to variables that there are not."""
    is_old = root.get("fmiVersion") == "2.0"
    variables = root.find("ModelVariables")
    elements = list(variables) if variables is not None else []
    known = {str(k) for k in range(1, len(elements) + 1)} if is_old else {v.get("valueReference") for v in elements}
    for element in root.iterfind("ModelStructure//*"):
        own = element.get("index" if is_old else "valueReference", ""), element.get("dependencies", "")
        for reference in " ".join(own).split():
            if (reference.lstrip("0") or "0") not in known:
                found = f"its model structure refers to variable {sanitise(reference)} in `{element.tag}`"
                raise UnusableError(f"{found}, which it does not have. Export it again.")


# What FMU files say of themselves, kept between processes by the hash of their content: fmpy takes longer to read it,
# and to be loaded, than many a run takes.


def place_of(digest: str, sizes: Mapping[str, int]) -> Path:
    """File for what an FMU of some content says to this version of fmpy and of this code, on this platform."""
    readers = [state(file) for file in (Path(__file__), Path(ports.__file__), reader())]
    key = [digest, sorted(sizes.items()), readers, sys.platform, platform.machine()]
    return cache_folder() / f"{FACTS}{fingerprint(key)}"


@cache
def reader() -> Path:
    """The file of fmpy that is loaded first."""
    found = find_spec("fmpy")
    return Path(found.origin) if found and found.origin else Path(__file__)


def reader_version() -> str:
    """Version of fmpy, which need not be loaded for that."""
    if found := re.search(r"^__version__ = ['\"](.+)['\"]$", reader().read_text("utf-8"), re.MULTILINE):
        return found[1]
    import fmpy

    return str(fmpy.__version__)


def recall_description(file: Path, path: Path) -> Description | None:
    """Recall the description that was kept of an FMU at a path; None if none is whole and by this user."""
    with suppress(OSError):
        about, content = file.stat(), file.read_bytes()
        is_own = os.name != "posix" or (about.st_uid == os.geteuid() and not about.st_mode & 0o022)
        if is_own and hashlib.sha256(content[SEAL:]).digest() == content[:SEAL]:
            if about.st_mtime < time() - OLD / 3:
                os.utime(file)
            found: Description = pickle.loads(content[SEAL:])
            return replace(found, path=path)
    return None


def keep(file: Path, made: Description) -> None:
    """Keep a description for other processes, if there is room for it; those that nobody has used for long go."""
    content = pickle.dumps(replace(made, path=Path()))
    with suppress(OSError):
        file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        handle, part = tempfile.mkstemp(dir=file.parent, prefix=FACTS)  # for its owner alone
        with os.fdopen(handle, "wb") as opened:
            opened.write(hashlib.sha256(content).digest() + content)
        Path(part).replace(file)
        for other in file.parent.glob(f"{FACTS}*"):
            if other.stat().st_mtime < time() - OLD:
                other.unlink()
