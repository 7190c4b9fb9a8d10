"""The components in all hosts that this machine has.  What comes out is kept for the table of hosts in the docs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from drivers import ROOT
from parts import FOLDERS, Part
from trials import HOSTS, largest_difference
from unpacked_native import bits

from gapsense.fmi.components import load_component

TOLERANCE = 1e-15  # of the nominal value: libcosim hands signals on in its own way
LENGTHS = {"PowerStage": 1e-13}  # `edge` is the length of a step, in libcosim a difference of times
EXACT = ("c", "c3", "wine", "qemu")  # in which native FMUs give the bits of their reference run
RESULTS = ROOT / "build" / "hosts"


@pytest.mark.slow
@pytest.mark.parametrize(("host", "kind"), [(name, kind) for name, host in HOSTS.items() for kind in host.kinds])
def test_components_in_host(host: str, kind: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    tried = HOSTS[host]
    if missing := tried.missing():
        pytest.skip(f"no {missing} on this machine")
    fmus: Path = request.getfixturevalue("fmus" if kind == "python" else "everywhere")
    differences, inexact = {}, []
    for folder in FOLDERS:
        component = load_component(folder)
        where = fmus / {"qemu": "aarch64-linux", "c3": "fmi3"}.get(host, "")
        part = Part(folder, component, where / f"{component.name}.fmu")
        work = tmp_path / component.name
        work.mkdir()
        found, wanted = tried.run(part, part.path, work)
        differences[component.name] = largest_difference(part, found, wanted)
        inexact += [component.name] * (bits(found) != bits(wanted))
    about = {"host": tried.name, "platform": tried.platform, "kind": kind, "version": tried.version()}
    RESULTS.mkdir(parents=True, exist_ok=True)
    (RESULTS / f"{host}-{kind}.json").write_text(json.dumps({**about, "differences": differences}), encoding="utf-8")
    assert {name: d for name, d in differences.items() if d > LENGTHS.get(name, TOLERANCE)} == {}
    assert inexact == [] or host not in EXACT or kind == "python"
