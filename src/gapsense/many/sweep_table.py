"""What a sweep found: its table as a CSV file, and a JSON file beside it that says of what it is and what failed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gapsense._os.checked import SEAL, is_sealed, sealed
from gapsense._os.files import Columns, prepared, read_json, rename, sha256, write_columns, write_json
from gapsense.cosim.run.ahead import FMU
from gapsense.cosim.show import frame, sweep_html
from gapsense.many.columns import kind
from gapsense.many.plan import Plan
from gapsense.problems import InputError
from gapsense.tables import Value

FORMAT = "gapsense sweep 1"
NEEDED = {SEAL, "sha256", "title", "scenario", "runs", "versions", "factors", "metrics", "failed"}
AGAIN = "Sweep again"


@dataclass(frozen=True, repr=False)
class Sweep:
    """Metrics over the runs of a sweep."""

    indices: tuple[int, ...]  # of the runs that succeeded
    metrics: Mapping[str, npt.NDArray[np.float64]]  # one value for each of `indices`; NaN where there were no samples
    errors: Mapping[int, str]  # what went wrong in the runs that failed
    computed: int  # runs done now; the others were known already
    interrupted: bool  # by Ctrl-C; start it again to go on
    file: Path | None  # the store of the runs, if a folder was given
    units: Mapping[str, str] = field(default_factory=dict)  # of the metrics and of the grid
    grid: Mapping[str, tuple[Value, ...]] = field(default_factory=dict)  # `[sweep]`: a value for each of `indices`
    ended: Mapping[int, str] = field(default_factory=dict)  # runs that components ended in an orderly way
    kept: tuple[Path, ...] = ()  # signals recorded at each of `indices`, for `read_result`, if they were kept
    engine: str = FMU  # that did the runs that were computed now: `fmu` or `vectors`

    def quantiles(self, levels: Sequence[float] = (0.05, 0.5, 0.95)) -> dict[str, tuple[float, ...]]:
        """Quantiles of each metric over the runs, by default the median within the 5-95 % range."""
        return {name: tuple(np.quantile(values, levels).tolist()) for name, values in self.metrics.items()}

    def to_pandas(self) -> Any:
        """Values of the grid and metrics as a DataFrame of pandas, by run; units are in its `attrs["units"]`."""
        return frame({**self.grid, **self.metrics}, "run", self.indices, self.units)

    def __repr__(self) -> str:
        failed = f", {len(self.errors)} failed" if self.errors else ""
        state = ", interrupted" if self.interrupted else ""
        return f"<Sweep: {len(self.indices)} runs{failed}{state}, {len(self.metrics)} metrics>"

    def _repr_html_(self) -> str:
        return sweep_html(repr(self), self.quantiles() if self.indices else {}, self.units)


def save(result: Sweep, about: Mapping[str, Any], plan: Plan, path: Path) -> None:
    """Write both files; `plan` is what the sweep goes through."""
    table, failed = columns(result), {run: values(plan, run) for run in result.errors}
    with prepared(path, lambda file: write_columns(file, table, result.units)) as part:
        content = sealed({**about, **sidecar(result, failed), "sha256": sha256(part)})
        with prepared(path.with_suffix(".json"), lambda file: write_json(file, content)) as beside:
            rename(part, path)
            rename(beside, path.with_suffix(".json"))


def values(plan: Plan, run: int) -> dict[str, Value]:
    """Values of a run, by parameter."""
    return {str(port): value for port, value in plan.values(run).items()}


def columns(result: Sweep) -> Columns:
    """One row per run: its number, the parameters of the grid, the metrics."""
    grid = {name: np.array(column, dtype=object) for name, column in result.grid.items()}
    return {"run": np.array(result.indices, dtype=np.float64), **grid, **result.metrics}


def sidecar(result: Sweep, failed: Mapping[int, Mapping[str, Value]]) -> dict[str, Any]:
    """What is told of the columns of the table, and of the runs that are not in it, as JSON takes it."""
    units = result.units
    given = {name: [*column, *(own[name] for own in failed.values())] for name, column in result.grid.items()}
    return {
        "format": FORMAT,
        "factors": {name: [kind(column), units.get(name, "")] for name, column in given.items()},
        "metrics": {name: units.get(name, "") for name in result.metrics},
        "failed": [{"run": index, "values": failed[index], "error": error} for index, error in result.errors.items()],
    }


def is_table(path: Path) -> bool:
    """True for the CSV of a sweep, by what is beside it; also for one of an older version, by its name."""
    data = beside(path)
    return path.suffix == ".csv" and (data.get("format") == FORMAT if data else path.stem.endswith("_sweep"))


def read_sidecar(path: Path) -> dict[str, Any]:
    """What is told beside the table `path`; an InputError if the two do not fit."""
    data = beside(path)
    if not {*data} >= NEEDED:
        raise InputError([f"{path}: `{path.stem}.json` beside it is missing, or incomplete. {AGAIN}."])
    if not is_sealed(data):
        raise InputError([f"{path}: `{path.stem}.json` beside it is damaged, or was edited. {AGAIN}."])
    if sha256(path) != data.get("sha256"):
        raise InputError([f"{path}: it is not the table that belongs to `{path.stem}.json`. {AGAIN}."])
    return data


def beside(path: Path) -> dict[str, Any]:
    """Content of the JSON file beside a table; nothing if there is none that can be read."""
    try:
        data = read_json(path.with_suffix(".json"))
    except (OSError, ValueError):
        return {}
    return data if isinstance(data, dict) else {}
