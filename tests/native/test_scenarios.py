"""Every scenario of the repository, whole: native FMUs give the bits of the Python ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from gapsense.cosim import find_scenarios, load, run

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
CASES = [(path, variant) for path in find_scenarios(SCENARIOS) for variant in (None, *load(path).variants)]


@pytest.mark.slow
@pytest.mark.parametrize(("path", "variant"), CASES, ids=lambda value: getattr(value, "parent", value) and str(value))
def test_native_fmus_give_the_bits_of_the_python_ones(
    path: Path, variant: str | None, fmus: Path, natives: Path
) -> None:
    python, native = (run(path, variant=variant, fmus=folder) for folder in (fmus, natives))
    assert [*python.signals] == [*native.signals]
    for name in python.signals:
        assert python[name].tobytes() == native[name].tobytes(), name
