"""A native FMU does what the Python FMU does: the same numbers with all options, the same sentences when it refuses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from drivers import STEPS, fresh
from parts import FOLDERS, Part, tuned
from refusals import refusals

OFTEN = ("semera", "solenoid_valve")
SOME = [pytest.param(f, id=f.name, marks=() if f.name in OFTEN else pytest.mark.slow) for f in FOLDERS]


def settings(part: Part) -> list[dict[str, Any]]:
    """The defaults, and every option and choice other than the default by itself."""
    parameters = part.component.of("parameter")
    choices = [{port.name: choice} for port in parameters for choice in port.choices[1:]]
    return [{}, *choices, *({port.name: not port.start} for port in parameters if port.kind == "Boolean")]


@pytest.mark.parametrize("part", SOME, indirect=True)
def test_numbers_with_every_option_and_tuned_on_the_way(part: Part, fmus: Path) -> None:
    sets, changed = settings(part), tuned(part.component)
    python, native = (fresh("variants", path, sets, changed) for path in (fmus / part.path.name, part.path))
    assert native == python
    assert len(native[0]["outputs"]) == STEPS + 1


@pytest.mark.parametrize("part", SOME, indirect=True)
def test_sentences_of_all_refusals(part: Part, fmus: Path, tmp_path: Path) -> None:
    cases = [{"name": name, **case} for name, (case, _) in refusals(part.component).items()]
    python = fresh("refusals", fmus / part.path.name, tmp_path / "python", cases)
    native = fresh("refusals", part.path, tmp_path / "native", cases)
    for name, answer in python["answers"].items():
        assert native["answers"][name] == answer, name
    assert native["afterwards"] == python["afterwards"]


@pytest.mark.parametrize("part", SOME, indirect=True)
def test_states_saved_and_set_go_on_with_the_same_bits(part: Part, fmus: Path) -> None:
    python, native = (fresh("save", path, tuned(part.component)) for path in (fmus / part.path.name, part.path))
    for way in ("straight", "once", "twice", "early", "in_another"):
        assert native[way] == python["straight"], way
    assert native["bytes_again"] == native["bytes"]
