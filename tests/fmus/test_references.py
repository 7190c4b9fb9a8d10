"""What travels in an FMU to try it: manifest, experiment, parameters, by FMI-LS-REF; and the experiment holds."""

from __future__ import annotations

import csv
import hashlib
import re
import shutil
import sys
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import fmpy
import fmpy.ssp
import pytest
from drivers import ROOT, fresh
from lxml import etree
from parts import EASY, Part, some

from gapsense.fmi import references
from gapsense.fmi.components import load_component, own
from gapsense.fmi.package import build

LS = "{http://fmi-standard.org/fmi-ls-manifest}fmi-ls-"
SSV = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"
ROLES = (
    "document|requirement|specification|model|parameter|system|testcase|result|method|rationale|report|request|delivery|"
    "configuration|signature|meta-data|other|experiment(/(smoke-test|validation|uncertainty-analysis))?"
    "|serialized-state(/.*)?"
)
TYPES = {"Real": float, "Integer": int, "Boolean": lambda text: text == "true", "String": str}


class Archive:
    """The files of the manifest in an FMU."""

    def __init__(self, path: Path) -> None:
        with zipfile.ZipFile(path) as archive:
            self.members = {name: archive.read(name) for name in archive.namelist()}

    def read(self, name: str) -> bytes:
        return self.members[references.FOLDER + name]

    def xml(self, name: str) -> Element:
        return ElementTree.fromstring(self.read(name))

    def sheet(self, name: str) -> tuple[list[str], list[list[str]]]:
        header, *rows = csv.reader(self.read(name).decode().splitlines())
        return header, rows

    def parameters(self) -> dict[str, Any]:
        found = {}
        for one in self.xml(references.PARAMETERS).iter(f"{SSV}Parameter"):
            found[one.attrib["name"]] = TYPES[one[0].tag.removeprefix(SSV)](one[0].attrib["value"])
        return found


@pytest.fixture
def archive(part: Part) -> Archive:
    return Archive(part.path)


def test_manifest_is_as_the_layered_standard_wants_it(archive: Archive) -> None:
    root = archive.xml("fmi-ls-manifest.xml")
    assert root.tag == "fmiReferences"
    assert set(root.attrib) == {LS + "name", LS + "version", LS + "description"}
    assert root.get(LS + "name") == references.FOLDER.split("/")[1]
    assert re.fullmatch(r"\d+\.\d+\.\d+(-[\w.]+)?", root.attrib[LS + "version"])
    for related in root:
        assert related.tag == "Related" and set(related.attrib) >= {"source", "role", "description"}
        assert re.fullmatch(ROLES, related.attrib["role"]), related.attrib
        data = archive.read(related.attrib["source"])
        assert related.get("checksum") == hashlib.sha3_256(data).hexdigest()
    listed = {references.FOLDER + related.attrib["source"] for related in root} | {
        f"{references.FOLDER}fmi-ls-manifest.xml"
    }
    assert listed == {name for name in archive.members if name.startswith("extra/")}
    assert references.PAGE in archive.members


def test_experiment_refers_to_files_and_variables_that_exist(archive: Archive, part: Part) -> None:
    root = archive.xml(references.EXPERIMENTS)
    (experiment,) = root.findall("Experiment")
    assert root.get("name") and experiment.get("name")
    assert [child.tag for child in experiment] == ["TransientSimulation", "Parameters", "Stimuli", "References"]
    for child in experiment[1:]:
        assert archive.read(child.attrib["source"])
    assert archive.sheet(references.STIMULI)[0] == ["time", *part.names("input")]
    assert archive.sheet(references.RESULTS)[0] == ["time", *part.names("output")]
    assert list(archive.parameters()) == part.names("parameter")


def test_parameter_set_obeys_the_schema_of_ssp(archive: Archive) -> None:
    folder = Path(fmpy.ssp.__file__).parent / "schema"
    schema = etree.XMLSchema(file=str(folder / "SystemStructureParameterValues.xsd"))
    schema.assertValid(etree.fromstring(archive.read(references.PARAMETERS)))


def outcome(path: Path, archive: Archive) -> tuple[list[list[float]], list[list[float]]]:
    """What the experiment expects, and what the FMU gives."""
    simulation = archive.xml(references.EXPERIMENTS).find("Experiment/TransientSimulation")
    assert simulation is not None
    stimuli, results = (archive.sheet(name)[1] for name in (references.STIMULI, references.RESULTS))
    inputs = [[float(cell) for cell in row[1:]] for row in stimuli]
    step = float(simulation.attrib["stepSize"])
    assert [float(row[0]) for row in stimuli] == [k * step for k in range(len(stimuli))]
    assert [float(row[0]) for row in results] == [k * step for k in range(len(results))]
    assert float(simulation.attrib["stopTime"]) == len(stimuli) * step
    given = [inputs[0], *inputs]
    run = fresh("reference", str(path), step, len(inputs), given, archive.parameters())
    return [[float(cell) for cell in row[1:]] for row in results], run["outputs"]


@pytest.mark.parametrize("part", some(*EASY), indirect=True)
def test_experiment_gives_the_results_bit_for_bit(archive: Archive, part: Part) -> None:
    expected, found = outcome(part.path, archive)
    if sys.platform == "linux":
        assert [[x.hex() for x in row] for row in found] == [[x.hex() for x in row] for row in expected]
    else:  # another exp or log
        for row, other in zip(found, expected, strict=True):
            assert row == pytest.approx(other, rel=1e-9, abs=1e-12)


def test_experiment_holds_in_an_fmu_with_other_start_values(tmp_path: Path) -> None:
    path = build(own("semera"), tmp_path, {"prior.resistance": 50.0, "gate.update": False})
    expected, found = outcome(path, Archive(path))
    assert found == expected


def test_own_table_of_the_same_name_leaves_no_experiment(tmp_path: Path) -> None:
    table = tmp_path / "voltage.csv"
    table.write_text("time,voltage\n0,1\n1,2\n")
    archive = Archive(build(own("drive_voltage"), tmp_path, {"table.file": str(table)}))
    assert references.FOLDER + references.EXPERIMENTS not in archive.members
    assert references.PAGE not in archive.members
    roles = [related.get("role") for related in archive.xml("fmi-ls-manifest.xml")]
    assert roles == ["parameter", "result"]


@pytest.mark.parametrize("change", ["no reference", "reference of other ports"])
def test_component_without_a_fitting_reference_has_no_experiment(tmp_path: Path, change: str) -> None:
    folder = Path(shutil.copytree(ROOT / "fmus" / "semera", tmp_path / "semera"))
    reference = folder / references.REFERENCE
    if change == "no reference":
        reference.unlink()
    else:
        reference.write_text(reference.read_text().replace("quality", "qualities", 1))
    members = references.files(folder, {})
    assert references.FOLDER + references.EXPERIMENTS not in members
    assert references.FOLDER + "fmi-ls-manifest.xml" in members


def test_choice_is_an_item_of_an_enumeration_in_fmi_3() -> None:
    data = references.parameter_set(load_component(own("drive_voltage")), fmi=3)
    value = ElementTree.fromstring(data).find(f".//{SSV}Parameter[@name='waveform']/{SSV}Enumeration")
    assert value is not None and value.get("value") == "square"
