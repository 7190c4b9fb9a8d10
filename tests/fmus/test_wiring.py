"""What the page of a component says about its wiring can be pasted into a scenario."""

from __future__ import annotations

import sys
import zipfile
from collections.abc import Iterable
from functools import reduce
from pathlib import Path

import pytest
from parts import FOLDERS, Part

from gapsense.cosim import check
from gapsense.cosim.scenario.read import Document
from gapsense.fmi.components import load_component
from gapsense.fmi.page import ROLES, chapter, example_name, snippet
from gapsense.fmi.ports import Component
from gapsense.tables import merge_tables

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

COMPONENTS = [load_component(folder) for folder in FOLDERS]
PLAYS = {
    "drive": [c for c in COMPONENTS if c.name == "DriveVoltage"],
    "plant": [c for c in COMPONENTS if c.kernel.startswith("gapsense.actuators.")],
    "sensor": [c for c in COMPONENTS if c.name == "Sensor"],
    "mhe": [c for c in COMPONENTS if c.name == "Mhe"],
}
HEAD = {"title": "pasted", "experiment": {"stop": 1e-3, "base_step": 1e-4}}  # a multiple of every sample time


def pasted(component: Component, name: str) -> dict:
    """The tables of the page, with another name for the component."""
    return tomllib.loads(snippet(component).replace(example_name(component), name))


def roles_of(component: Component) -> Iterable[str]:
    return dict.fromkeys(port.source.partition(".")[0] for port in component.of("input") if port.source)


def test_whatever_plays_a_role_has_the_output_of_that_unit():
    assert set(PLAYS) == set(ROLES) and len(PLAYS["plant"]) > 3
    for component in COMPONENTS:
        for port in component.of("input"):
            role, _, name = port.source.partition(".")
            for other in PLAYS[role] if role else ():
                assert (name, port.unit) in {(p.name, p.unit) for p in other.of("output")}, (component.name, port)


def test_component_wired_as_its_page_says_is_a_scenario_without_problems(part: Part, fmus: Path):
    tables, open_roles = [HEAD, pasted(part.component, "it")], list(roles_of(part.component))
    for role in open_roles:  # grows while what plays a role needs others
        tables.append(pasted(PLAYS[role][-1], role))
        open_roles += [more for more in roles_of(PLAYS[role][-1]) if more not in open_roles]
    assert check(Document(Path("pasted"), reduce(merge_tables, tables)), fmus=fmus) == []


def test_page_tells_the_wiring_and_the_sample_time(part: Part):
    with zipfile.ZipFile(part.path) as archive:
        page = archive.read("documentation/index.html").decode()
    assert ">How to wire</h2>" in page and f'fmu = "{part.component.name}"' in page.replace("&quot;", '"')
    is_sampled = any(port.name == "sample_time" for port in part.component.ports)
    assert ("samples every <code>sample_time</code>" in page) == is_sampled == ("any step" not in page)


def test_name_of_the_example_is_one_of_toml():
    assert [example_name(c) for c in COMPONENTS if c.name in ("BoundedUkf", "Mhe")] == ["bounded_ukf", "mhe"]
    with pytest.raises(StopIteration):
        next(c.name for c in COMPONENTS if "`" in snippet(c) or "``" in chapter(c).replace("```", ""))
