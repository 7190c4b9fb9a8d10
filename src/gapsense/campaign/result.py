"""The result of a campaign as it is read: column by column or in batches, so that a million runs need no memory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from gapsense._os.checked import damage
from gapsense._os.files import naming
from gapsense.campaign.columns import SIGNALS, UNIT, Line
from gapsense.campaign.store import (
    AGAIN,
    MANIFEST,
    Manifest,
    Part,
    Signals,
    is_whole,
    read_journal,
    read_manifest,
    without_signals,
)
from gapsense.cosim.scenario.kinds import CAMPAIGN, other_kind
from gapsense.problems import InputError, suggest

Vector = npt.NDArray[Any]
ROWS = 2**16  # of a batch


@dataclass(frozen=True, repr=False)
class Campaign:
    """Runs of a campaign, finished or not, in the folder that holds them."""

    folder: Path
    manifest: Manifest
    recent: pa.Table  # what is not in a file of its own yet
    computed: int = 0  # runs done now; the others were there
    interrupted: bool = False  # by Ctrl-C; the same call goes on
    engine: str = "fmu"  # that did the runs that were computed now: `fmu` or `vectors`

    @property
    def rows(self) -> int:
        """Runs that are there, with those that failed."""
        return sum(part.rows for part in self.manifest.parts) + int(self.recent.num_rows)

    @property
    def failed(self) -> int:
        """Runs that failed."""
        recent = self.recent.num_rows - self.recent["error"].null_count
        return sum(part.failed for part in self.manifest.parts) + int(recent)

    @property
    def runs(self) -> int:
        """Runs that there will be."""
        return int(self.manifest.about["runs"])

    @property
    def factors(self) -> list[str]:
        """Parameters that are varied."""
        return list(self.manifest.columns.factors)

    @property
    def metrics(self) -> list[str]:
        """Metrics of the scenario."""
        return list(self.manifest.columns.metrics)

    @cached_property
    def units(self) -> dict[str, str]:
        """Unit of each column that has one."""
        metadata = {field.name: field.metadata or {} for field in self.manifest.columns.runs}
        return {name: own[UNIT].decode() for name, own in metadata.items() if UNIT in own}

    def batches(self, *names: str) -> Iterator[pa.RecordBatch]:
        """Columns of all runs, some rows at a time."""
        known = self.manifest.columns.runs.names
        if unknown := [name for name in names if name not in known]:
            raise InputError(
                [f"{self.folder}: there is no column `{name}`. {suggest(name, known)}" for name in unknown]
            )
        if files := self.files(self.manifest.parts):
            runs = ds.dataset([*map(str, files)], schema=self.manifest.columns.runs, format="parquet")
            with naming(self.folder):
                batches = runs.to_batches(columns=list(names), batch_size=ROWS, batch_readahead=2, fragment_readahead=1)
                yield from batches
        yield from self.recent.select(list(names)).to_batches()

    def files(self, parts: Sequence[Part | Signals]) -> list[Path]:
        """Files that are as they were written; an InputError if one is not."""
        files = {self.folder / part.file: part.sha256 for part in parts}
        if not all(file.is_file() for file in files) and read_manifest(self.folder) != self.manifest:
            raise InputError([f"{self.folder}: it has changed since it was read. Read it again."])
        if damaged := [file for file, expected in files.items() if not is_whole(file, expected)]:
            raise InputError([f"{file}: it is damaged or gone. {AGAIN}." for file in damaged])
        return [*files]

    def arrays(self, *names: str) -> Iterator[list[Vector]]:
        """The same as arrays of numpy; a number that is missing is NaN."""
        for batch in self.batches(*names):
            yield [column.to_numpy(zero_copy_only=False) for column in batch.columns]

    def column(self, name: str) -> Vector:
        """One column of all runs, in the order of the files: that of `run` when all are done."""
        parts = [array for (array,) in self.arrays(name)]
        return np.concatenate(parts) if parts else np.empty(0)

    def table(self, *names: str) -> pa.Table:
        """Columns of all runs as a table of Arrow, by default all of them, in the order of the runs."""
        chosen = names or tuple(self.manifest.columns.runs.names)
        schema = pa.schema([self.manifest.columns.runs.field(name) for name in dict.fromkeys(("run", *chosen))])
        return pa.Table.from_batches(list(self.batches(*schema.names)), schema).sort_by("run").select(list(chosen))

    def to_pandas(self) -> Any:
        """The runs as a DataFrame of pandas, by run; units are in its `attrs["units"]`."""
        frame = self.table().to_pandas().set_index("run")
        frame.attrs["units"] = self.units
        return frame

    def quantiles(self, levels: Sequence[float] = (0.05, 0.5, 0.95)) -> dict[str, tuple[float, ...]]:
        """Quantiles of each metric over the runs that have it, by default the median within the 5-95 % range."""
        return {name: quantiles(self.column(name), levels) for name in self.metrics}

    def errors(self, most: int) -> list[tuple[int, str]]:
        """The first runs that failed, and why."""
        return self.texts("error", most)

    def ended(self, most: int) -> list[tuple[int, str]]:
        """The first runs that a component has ended in an orderly way, and which."""
        return self.texts("ended", most)

    def texts(self, name: str, most: int) -> list[tuple[int, str]]:
        """The first runs that have a text in a column, and the text."""
        found: list[tuple[int, str]] = []
        for batch in self.batches("run", name):
            told = batch.filter(pc.is_valid(batch[name]))
            found += zip(told["run"].to_pylist(), told[name].to_pylist())
            if len(found) >= most:
                break
        return sorted(found)[:most]

    def trajectory(self, run: int) -> Mapping[str, Vector]:
        """Time [s] and the kept signals of a run; an InputError if there are none."""
        columns = self.manifest.columns
        fresh = [line for line in self.journal() if line["run"] == run and SIGNALS in line]
        table = columns.trajectory(fresh[0]) if fresh else columns.trajectories.empty_table()
        for file in () if fresh else reversed(self.files(self.manifest.trajectories)):  # the last one of a run counts
            table = pq.read_table(file, schema=columns.trajectories, filters=pc.field("run") == run)
            if table.num_rows:
                break
        if not table.num_rows:
            raise InputError([f"{self.folder}: no signals of run {run} were kept. Was it run, with `[trajectories]`?"])
        return {name: table[name].to_numpy() for name in table.column_names if name != "run"}

    def journal(self) -> list[Line]:
        """What is not in a file of its own yet; an InputError if it is damaged."""
        return whole_journal(self.folder / self.manifest.journal, self.runs)

    def __repr__(self) -> str:
        missing = f" of {self.runs}" if self.rows < self.runs else ""
        failed = f", {self.failed} failed" if self.failed else ""
        return f"<Campaign: {self.rows}{missing} runs{failed}, {len(self.metrics)} metrics>"


def quantiles(values: Vector, levels: Sequence[float]) -> tuple[float, ...]:
    """Quantiles of what is a number; NaN where nothing is."""
    good = values[np.isfinite(values)]
    return tuple(np.quantile(good, levels).tolist()) if good.size else (float("nan"),) * len(levels)


def whole_journal(file: Path, runs: int) -> list[Line]:
    """What a journal holds; an InputError if it is damaged."""
    found, damaged = read_journal(file, runs)
    if damaged:
        raise InputError([f"{damage(file, damaged)}. {AGAIN}."])
    return found


def read(folder: str | Path) -> Campaign:
    """Result of a campaign, also while it is still at work.

    Parameters
    ----------
    folder : str or Path
        The folder that it was written to.

    Returns
    -------
    Campaign

    Raises
    ------
    InputError
        If there is no campaign, or what it tells is damaged.
    """
    folder = Path(folder)
    manifest = read_manifest(folder)
    if manifest is None:
        if wrong := other_kind(folder, CAMPAIGN):
            raise InputError([wrong])
        raise InputError([f"{folder}: there is no `{MANIFEST}`. The folder of a campaign's result is expected."])
    recent = [without_signals(line) for line in whole_journal(folder / manifest.journal, int(manifest.about["runs"]))]
    return Campaign(folder, manifest, manifest.columns.table(recent))
