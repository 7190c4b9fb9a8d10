"""What an FMU carries to be tried: its reference run as an experiment, and a manifest of the files.

By the layered standard FMI-LS-REF 1.0.0-beta.1, in `extra/org.fmi-standard.fmi-ls-ref`, and the experiments of the
Modelica Association (MA-HS-Experiments, a draft), both for FMI 2.0 and 3.0.
"""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, SubElement

from gapsense.fmi.components import load_component
from gapsense.fmi.describe import text
from gapsense.fmi.picture import FILE
from gapsense.fmi.ports import Component, Port
from gapsense.units import base_exponents

FOLDER = "extra/org.fmi-standard.fmi-ls-ref/"
PAGE = "documentation/fmi-ls-ref.txt"
REFERENCE, PARAMETERS, STIMULI, RESULTS, EXPERIMENTS, TYPICAL = (
    *("reference.csv", "parameters.ssv", "stimuli.csv", "results.csv", "reference.exp"),
    FILE,
)
TYPES = {".csv": "text/csv", ".ssv": "application/x-ssp-parameter-set", ".exp": "application/x-ma-hs-experiments"}
MANIFEST = {
    "xmlns:fmi-ls": "http://fmi-standard.org/fmi-ls-manifest",
    "fmi-ls:fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
    "fmi-ls:fmi-ls-version": "1.0.0-beta.1",
    "fmi-ls:fmi-ls-description": "Layered Standard providing information on related files included in an FMU.",
}
SSP = "http://ssp-standard.org/SSP1/SystemStructure"
SAID = """Files in {folder} to try this FMU with, listed in fmi-ls-manifest.xml (FMI-LS-REF).

{parameters}: all parameters, as Gapsense ships them; start values of an FMU may be others.
{stimuli} and {results}: a run with these parameters in steps of {step} s, described by {experiments}. The inputs of a
row are set at its time, at the first one also in the initialization mode, and hold until the next row; the results of
a row are those at its time. Expected are the same bits, on every platform.
"""


class ReferenceRun(NamedTuple):
    """The run in a component's reference.csv, cell by cell: inputs of a row hold during the step that ends there."""

    times: list[str]
    inputs: list[list[str]]
    outputs: list[list[str]]


class Related(NamedTuple):
    """One file that the manifest lists."""

    name: str
    data: bytes
    role: str
    description: str


def files(folder: Path, given: Mapping[str, Any], fmi: int = 2) -> dict[str, bytes]:
    """Members of the FMU of the component in `folder`, which was built with the start values `given`.

    There is no experiment if its result is not known. That is so without a reference run of this port table, and where
    a user's table has the name, and so the place, of a table of the run.
    """
    component = load_component(folder)
    tables = {Path(given[port.name]).name for port in component.ports if port.columns and port.name in given}
    run = None if tables & {*component.resources} else reference(component, folder / REFERENCE)
    found = [*related_files(component, run, fmi), *typical(folder / TYPICAL)]
    members = {FOLDER + item.name: item.data for item in found}
    members[FOLDER + "fmi-ls-manifest.xml"] = manifest(found)
    if run:
        names = {"parameters": PARAMETERS, "stimuli": STIMULI, "results": RESULTS, "experiments": EXPERIMENTS}
        members[PAGE] = SAID.format(folder=FOLDER, step=run.times[1], **names).encode()
    return members


def reference(component: Component, path: Path) -> ReferenceRun | None:
    """The reference run, if there is one of this port table; `tests/fmus/make_references.py` makes it."""
    if not path.is_file():
        return None
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    inputs, outputs = ([port.name for port in component.of(causality)] for causality in ("input", "output"))
    if header != ["time", *inputs, *outputs]:
        return None
    cut = 1 + len(inputs)
    return ReferenceRun([row[0] for row in rows], [row[1:cut] for row in rows], [row[cut:] for row in rows])


def related_files(component: Component, run: ReferenceRun | None, fmi: int) -> list[Related]:
    """The parameters, and the experiment if there is a run."""
    found = [Related(PARAMETERS, parameter_set(component, fmi), "parameter", "All parameters as Gapsense ships them")]
    if run is None:
        return found
    inputs, outputs = ([port.name for port in component.of(causality)] for causality in ("input", "output"))
    told = f"Short run of {component.name} with random inputs"
    return [
        *found,
        Related(EXPERIMENTS, experiments(component, run, told), "experiment/smoke-test", told),
        Related(STIMULI, sheet(inputs, run.times[:-1], run.inputs[1:]), "other", "Inputs of that run"),
        Related(RESULTS, sheet(outputs, run.times, run.outputs), "result", "Results of that run"),
    ]


def typical(path: Path) -> list[Related]:
    """The run that the page shows, whose first line says what it is."""
    if not path.is_file():
        return []
    title, _, rest = path.read_text(encoding="utf-8").partition("\n")
    return [Related(TYPICAL, rest.encode(), "result", title.lstrip("# ").replace("`", ""))]


def sheet(names: list[str], times: list[str], rows: list[list[str]]) -> bytes:
    """A CSV file of signals over time."""
    lines = [["time", *names], *([time, *row] for time, row in zip(times, rows))]
    return "".join(",".join(line) + "\n" for line in lines).encode()


def manifest(found: list[Related]) -> bytes:
    """The list of files, with their checksums."""
    root = Element("fmiReferences", MANIFEST)
    for item in found:
        about = {
            "type": TYPES[Path(item.name).suffix],
            "source": item.name,
            "role": item.role,
            "description": item.description,
        }
        SubElement(root, "Related", about, checksum=hashlib.sha3_256(item.data).hexdigest(), checksumType="SHA3-256")
    return text(root)


def experiments(component: Component, run: ReferenceRun, told: str) -> bytes:
    """The one experiment."""
    root = Element("Experiments", name=component.name, description=f"To see whether {component.name} works in a tool")
    one = SubElement(root, "Experiment", name="reference", description=told)
    SubElement(one, "TransientSimulation", startTime=run.times[0], stopTime=run.times[-1], stepSize=run.times[1])
    SubElement(one, "Parameters", source=PARAMETERS)
    if component.of("input"):
        SubElement(one, "Stimuli", source=STIMULI)
    SubElement(one, "References", source=RESULTS)
    return text(root)


def parameter_set(component: Component, fmi: int) -> bytes:
    """Start values of all parameters, in the format of SSP 1.0."""
    spaces = {"xmlns:ssv": f"{SSP}ParameterValues", "xmlns:ssc": f"{SSP}Common"}
    root = Element("ssv:ParameterSet", spaces, version="1.0", name=component.name)
    parameters, ports = SubElement(root, "ssv:Parameters"), component.of("parameter")
    for port in ports:
        kind = "Enumeration" if fmi == 3 and port.choices else port.kind
        one = SubElement(parameters, "ssv:Parameter", name=port.name)
        value = SubElement(one, f"ssv:{kind}", value=as_xml(port, port.start))
        if kind == "Real":
            value.set("unit", port.unit)
    units = SubElement(root, "ssv:Units")
    for name in sorted({port.unit for port in ports if port.kind == "Real"}):
        powers = {base: str(power) for base, power in base_exponents(name).items()}
        SubElement(SubElement(units, "ssc:Unit", name=name), "ssc:BaseUnit", powers)
    return text(root)


def as_xml(port: Port, value: Any) -> str:
    """A value as XML has it."""
    return str(value).lower() if port.kind == "Boolean" else repr(float(value)) if port.kind == "Real" else str(value)
