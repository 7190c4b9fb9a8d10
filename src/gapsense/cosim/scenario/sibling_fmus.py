"""Parameters of the FMUs that lie beside those of a scenario: what a parameter set may have for other components."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

from gapsense._os.files import state
from gapsense.cosim.fmu.archive import UnusableError, read_description
from gapsense.cosim.fmu.model_xml import mended


def parameters_beside(fmus: Iterable[Path]) -> frozenset[str]:
    """Names of the parameters of all FMUs in the folders of some; one that cannot be read has none."""
    files = {file for folder in {fmu.parent for fmu in fmus} for file in folder.glob("*.fmu")}
    return frozenset().union(*(_parameters(file.resolve(), *state(file)) for file in files))


@lru_cache(maxsize=256)
def _parameters(file: Path, *_: int) -> frozenset[str]:
    """Those of a file in some state."""
    try:
        root, _text = mended(read_description(file)[0])
    except (UnusableError, SyntaxError):  # of the XML; whoever uses the FMU is told
        return frozenset()
    return frozenset(v.get("name", "") for v in root.iter() if v.get("causality") == "parameter")
