"""Every shipped scenario and variant becomes a package, and comes back with the same bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gapsense.cosim import run
from gapsense.cosim.scenario.read import Document, load, read_document
from gapsense.shipped import SCENARIOS
from gapsense.ssp.bring import bring
from gapsense.ssp.export import export

FILES = sorted(SCENARIOS.glob("*/scenario.toml"))
STEPS = 200
LEFT_OUT = ("metrics", "baseline", "variants", "sweep")  # of a run so short


def short(file: Path, variant: str | None) -> Document:
    data = dict(read_document(file, []).with_variant(variant, []).data)
    given = data["experiment"]
    stop = given.get("start", 0.0) + STEPS * given["base_step"]
    stop = given["stop"] if data.get("events") else stop  # each has its time in the run
    rest = {key: value for key, value in data.items() if key not in LEFT_OUT}
    return Document(file, {**rest, "experiment": {**given, "stop": stop}})


@pytest.mark.slow
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.parent.name)
def test_every_variant_comes_back_with_the_same_bits(file, quickest, tmp_path):
    variants = [None, *read_document(file, []).data.get("variants", {})]
    for k, variant in enumerate(variants):
        if any(component.board for component in load(file, variant).components.values()):
            continue  # packages know no boards: tests/mcu/test_loop.py
        document = short(file, variant)
        export(document, tmp_path / f"{k}.ssp", None, quickest)
        bring(tmp_path / f"{k}.ssp", tmp_path / str(k))
        result, again = run(document, None, quickest), run(tmp_path / str(k))
        assert result.signals.keys() == again.signals.keys()
        assert [name for name in result.signals if not np.array_equal(result[name], again[name], equal_nan=True)] == []
        assert result.run.order == again.run.order and result.run.seeds == again.run.seeds
