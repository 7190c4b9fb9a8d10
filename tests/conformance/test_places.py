"""Where hosts unpack FMUs: folders with any name, and long ones; the tables in the resources are found there."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from stimuli import rows
from subjects import Instance, Subject

PLACES = {
    "blanks": "two  blanks ",
    "letters": "für Ångström 磁铁",
    "percent": "100% %20 %s %n",
    "signs": "a+b#c&d;e=f'g\"h[i]{j}~",
    "long": "/".join(["x" * 100] * 12),
}


def test_components_run_wherever_they_are(subject: Subject, tmp_path: Path) -> None:
    if not subject.component.resources:
        pytest.skip("it has no file that could be missed")
    stimulus, found = rows(subject.component, 20), []
    folders = [subject.folder, *(tmp_path / place for place in PLACES.values())]
    for folder in folders:
        if folder is not subject.folder:
            shutil.copytree(subject.folder / "resources", folder / "resources")
        answer = subject.instantiate(resources=(folder / "resources").as_uri())
        assert answer.value is not None, answer.log
        one = Instance(subject, answer.value, "one")
        for ref, port in enumerate(subject.component.ports):
            if "table" in port.choices:
                one.all(("SetString", [ref], ["table"]))
        found.append(one.bring("running").run(stimulus))
        one.do("free")
    assert found[1:] == found[:-1]
