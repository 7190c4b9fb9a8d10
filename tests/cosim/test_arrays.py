"""What FMUs of FMI 3.0 may have besides scalars; and the rules that ours state, in the annotations of FMI 3.0."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from gapsense.cosim.descriptions import feedthrough, is_scalar, is_spare, read_model
from gapsense.cosim.rules import broken_rules, read_rules
from gapsense.cosim.variables import variable
from gapsense.fmi.components import kernel_of, load_component, own
from gapsense.fmi.fmi3.arrays import shapes
from gapsense.fmi.fmi3.description import model_description
from gapsense.fmi.fmi3.variables import variables
from gapsense.fmi.tables import heads, read_table


def described(name: str) -> bytes:
    """Model description of a component for FMI 3.0."""
    folder = own(name)
    component = load_component(folder)
    tables = {p.name: read_table(Path(folder, p.start), tuple(heads(p.columns))) for p in component.ports if p.columns}
    return model_description(component, variables(component, tables, shapes(kernel_of(component))), "{}", "1")


def test_arrays_that_a_run_can_do_without_are_passed_over() -> None:
    model = read_model(described("ekf"))
    spare = [v.name for v in model.modelVariables if is_spare(v)]
    assert spare == ["gap.file.gap", "gap.file.reluctance", "covariance"]
    assert not any(is_scalar(v) for v in model.modelVariables if v.name in spare)
    assert "covariance" not in feedthrough(model)
    assert feedthrough(model)["position"] == {"current", "mode"}


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("ekf", {"stop.lower": 1.0}, "less than `stop.upper`"),
        ("mhe", {"window.longest": 1.0}, "expected less than 2000"),
        ("drive_voltage", {"pwm.low": 31.0}, "less than `pwm.high`"),
        ("drive_voltage", {"waveform": "square"}, ""),
    ],
)
def test_rules_are_read_from_the_annotations_of_fmi_3(name: str, values: dict[str, float], words: str) -> None:
    text = described(name)
    known = {v.name: variable(v) for v in read_model(text).modelVariables if is_scalar(v)}
    rules = read_rules(ElementTree.fromstring(text), known)
    assert rules is not None
    starts = {v.name: v.start for v in known.values() if v.is_parameter}
    found = broken_rules(rules, {**starts, **values})
    assert words in " ".join(found) and bool(found) == bool(words)
