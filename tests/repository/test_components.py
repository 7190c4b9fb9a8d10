"""Every component says all that its users need."""

from __future__ import annotations

import csv
import re

import pytest
from sources import ROOT

from gapsense.fmi.components import find_components, kernel_of, load_component
from gapsense.fmi.package import check_records
from gapsense.fmi.ports import Component
from gapsense.units import UNITS

FOLDERS = find_components(ROOT / "fmus")


@pytest.fixture(params=FOLDERS, ids=lambda folder: folder.name)
def folder(request):
    return request.param


@pytest.fixture
def component(folder) -> Component:
    return load_component(folder)


def test_every_folder_in_fmus_is_a_component():
    assert sorted(p.name for p in (ROOT / "fmus").iterdir() if p.is_dir() and p.name != "__pycache__") == [
        f.name for f in FOLDERS
    ]


def test_folder_has_port_table_page_and_reference(folder):
    for name in ("component.py", "page.md", "reference.csv"):
        assert (folder / name).is_file() and (folder / name).stat().st_size, name


def test_folder_is_called_like_its_fmu(folder, component):
    assert folder.name.replace("_", "") == component.name.lower()


def test_ports_have_unit_description_and_nominal(component):
    for port in component.ports:
        assert port.unit in UNITS, port
        assert len(port.description) > 5 and not port.description.endswith("."), port
        assert port.nominal > 0.0, port


def test_names_are_flat_for_signals_and_dotted_for_parameters(component):
    names = [port.name for port in component.ports]
    assert len(set(names)) == len(names)
    for port in component.ports:
        pattern = r"[a-z][a-z0-9_]*" if port.causality != "parameter" else r"[a-z][a-z0-9_]*(\.[a-z][a-z0-9_]*)?"
        assert re.fullmatch(pattern, port.name), port.name


def test_start_values_lie_within_their_limits(component):
    for port in component.ports:
        if port.kind in ("Real", "Integer") and port.start is not None:
            assert (port.min is None or port.start >= port.min) and (port.max is None or port.start <= port.max), port
    starts = {port.name: port.start for port in component.ports}
    assert all(starts[low] < starts[high] for low, high in component.rising)


def test_feedthrough_names_inputs(component):
    inputs = {port.name for port in component.of("input")}
    for port in component.ports:
        assert set(port.feedthrough) <= inputs, port.name
        assert not port.feedthrough or port.causality == "output", port.name


def test_ports_stand_as_inputs_outputs_parameters(component):
    order = [port.causality for port in component.ports]
    assert order == sorted(order, key=["input", "output", "parameter"].index)


def test_kernel_fits_the_port_table(component):
    check_records(component, kernel_of(component))


def test_files_that_travel_exist(folder, component):
    for name in (*component.resources, *(p.start for p in component.ports if p.columns)):
        assert (folder / name).is_file(), name


def test_tables_of_one_name_are_one_table(folder, component):
    for name in component.resources:
        others = [path.read_bytes() for path in (ROOT / "fmus").glob(f"*/{name}")]
        assert set(others) == {(folder / name).read_bytes()}, name


def test_reference_has_a_column_for_every_signal(folder, component):
    with (folder / "reference.csv").open(newline="", encoding="utf-8") as file:
        header, *rows = list(csv.reader(file))
    signals = [port.name for causality in ("input", "output") for port in component.of(causality)]
    assert header == ["time", *signals]
    assert len(rows) > 10


def test_page_cites_sources_of_the_bibliography(folder):
    known = set(re.findall(r"^\| (\[\w+\])", (ROOT / "docs" / "bibliography.md").read_text("utf-8"), re.MULTILINE))
    cited = set(re.findall(r"\[[A-Z]{2,}\]", (folder / "page.md").read_text("utf-8")))
    assert cited <= known


def test_units_are_used_or_needed():
    used = {port.unit for folder in FOLDERS for port in load_component(folder).ports}
    assert used <= set(UNITS)
