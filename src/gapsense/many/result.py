"""The result of a campaign as it is read: column by column or in batches, so that a million runs need no memory."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from gapsense._os.files import header, naming, prepare_file, refuse_export, rename
from gapsense.cosim.scenario.read import CAMPAIGN, other_kind
from gapsense.cosim.scenario.read import CAMPAIGN_FILE as FILE
from gapsense.cosim.show import pages
from gapsense.many.columns import ENDED, ERROR, Columns, Vector, from_facts
from gapsense.many.store import ERRORS, SIGNALS, WORDS, Store
from gapsense.problems import InputError, require_package, suggest

FORMAT, KEY = "gapsense campaign 3", "campaign"
ROOM, SOME = 2**28, 2**16  # bytes that are kept in memory, and runs that are looked at together
FORMER = "campaign.json"  # of campaigns that were kept as Parquet files


@dataclass(frozen=True, repr=False)
class Campaign:
    """Runs of a campaign, finished or not, and the folder that holds them."""

    folder: Path
    store: Store
    about: Mapping[str, Any]  # title, hashes, versions, number of runs, ...
    columns: Columns
    rows: int  # runs that are there, with those that failed
    computed: int = 0  # runs done now; the others were there
    interrupted: bool = False  # by Ctrl-C; the same call goes on
    engine: str = "fmu"  # that did the runs that were computed now: `fmu` or `vectors`

    @property
    def failed(self) -> int:
        """Runs that failed."""
        return self.store.count(ERRORS)

    @property
    def runs(self) -> int:
        """Runs that there will be."""
        return int(self.about["runs"])

    @property
    def factors(self) -> list[str]:
        """Parameters that are varied."""
        return list(self.columns.factors)

    @property
    def metrics(self) -> list[str]:
        """Metrics of the scenario."""
        return list(self.columns.metrics)

    @property
    def units(self) -> dict[str, str]:
        """Unit of each column that has one."""
        return self.columns.units

    def batches(self, *names: str) -> Iterator[dict[str, Vector]]:
        """Columns of all runs in their order, some thousand rows at a time; a number that is missing is NaN."""
        known = self.columns.names
        if unknown := [name for name in names if name not in known]:
            raise InputError(
                [f"{self.folder}: there is no column `{name}`. {suggest(name, known)}" for name in unknown]
            )
        texts = {name: self.texts(name) for name in (ERROR, ENDED) if name in names}
        for data in self.records():
            runs = self.columns.array("run", data)
            yield {
                name: np.array([texts[name].get(run) for run in runs.tolist()], dtype=object)
                if name in texts
                else self.columns.array(name, data)
                for name in names
            }

    def records(self) -> Iterator[Vector]:
        """Numbers of all runs, some at a time: from memory, unless they are too many for it."""
        if self.rows * self.columns.record.itemsize > ROOM:
            return self.read()
        return (self.records_in_memory[k : k + SOME] for k in range(0, self.rows, SOME))

    @cached_property
    def records_in_memory(self) -> Vector:
        """Numbers of all runs."""
        found, count, plain = np.empty(self.rows, self.columns.record), 0, f"V{self.columns.record.itemsize}"
        for data in self.read():
            found.view(plain)[count : count + data.size] = data.view(plain)  # whole rows, not field by field
            count += data.size
        return found

    def read(self) -> Iterator[Vector]:
        """The campaign read from its store again; an InputError if the store has other runs by now."""
        count = 0
        for contents in self.store.contents():
            count += len(contents)
            if count > self.rows:
                break
            yield np.frombuffer(b"".join(contents), self.columns.record)
        if count != self.rows:
            raise InputError([f"{self.folder}: it has changed since it was read. Read it again."])

    def arrays(self, *names: str) -> Iterator[list[Vector]]:
        """The same as lists."""
        return (list(batch.values()) for batch in self.batches(*names))

    def table(self, *names: str) -> dict[str, Vector]:
        """Columns of all runs, by default all of them."""
        parts = list(self.batches(*(names or self.columns.names)))
        return {n: np.concatenate([part[n] for part in parts] or [np.empty(0)]) for n in names or self.columns.names}

    def column(self, name: str) -> Vector:
        """One column of all runs, in their order."""
        return self.table(name)[name]

    def to_pandas(self) -> Any:
        """The runs as a DataFrame of pandas, by run; units are in its `attrs["units"]`."""
        table = self.table()
        return pages().frame(table, "run", table.pop("run"), self.units)

    def quantiles(self, levels: Sequence[float] = (0.05, 0.5, 0.95)) -> dict[str, tuple[float, ...]]:
        """Quantiles of each metric over the runs that have it, by default the median within the 5-95 % range."""
        return {name: quantiles(self.column(name), levels) for name in self.metrics}

    def errors(self, most: int) -> list[tuple[int, str]]:
        """The first runs that failed, and why."""
        return list(self.store.texts(ERRORS, most=most).items())

    def ended(self, most: int) -> list[tuple[int, str]]:
        """The first runs that a component has ended in an orderly way, and which."""
        return list(self.texts(ENDED).items())[:most]

    def texts(self, name: str) -> dict[int, str]:
        """Runs that have a text in a column, and the text."""
        if name == ERROR:
            return self.store.texts(ERRORS)
        return {run: words[name] for run, words in self.store.texts(WORDS).items() if name in words}

    def trajectory(self, run: int) -> Mapping[str, Vector]:
        """Time [s] and the kept signals of a run; an InputError if there are none."""
        if (content := self.store.content(SIGNALS, run)) is None:
            raise InputError([f"{self.folder}: no signals of run {run} were kept. Was it run, with `[trajectories]`?"])
        names = ["time", *self.columns.signals]
        return dict(zip(names, np.frombuffer(content, "<f8").reshape(len(names), -1)))

    def export(self, file: str | Path) -> Path:
        """Write a row per run to a CSV or a Parquet file, as its name ends; the latter needs pyarrow."""
        path = Path(file)
        check_export(path)
        write = write_parquet if path.suffix == PARQUET else write_csv
        with prepare_file(path, lambda _: None) as part:
            with naming(path):
                write(self, part)
            rename(part, path)
        return path

    def __repr__(self) -> str:
        missing = f" of {self.runs}" if self.rows < self.runs else ""
        failed = f", {self.failed} failed" if self.failed else ""
        return f"<Campaign: {self.rows}{missing} runs{failed}, {len(self.metrics)} metrics>"


CSV, PARQUET = ".csv", ".parquet"


def check_export(file: Path) -> None:
    """Raise an InputError for a file that nothing can be written to, or that needs what is not installed."""
    refuse_export(file, CSV, PARQUET)
    if file.suffix == PARQUET:
        require_package("pyarrow")


def write_csv(campaign: Campaign, path: Path) -> None:
    """A row per run; what is missing is empty."""
    names, units = campaign.columns.names, campaign.units
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([header(name, units.get(name, "")) for name in names])
        for batch in campaign.batches(*names):
            columns = [["" if value != value else value for value in column.tolist()] for column in batch.values()]
            writer.writerows(zip(*columns))


def write_parquet(campaign: Campaign, path: Path) -> None:
    """A row per run; the unit of a column is in its metadata, and what is missing is null."""
    import pyarrow as pa
    from pyarrow.parquet import ParquetWriter

    columns = campaign.columns
    kinds = {"run": "int64", "seed": "int64", ERROR: "string", ENDED: "string"}
    kinds |= {name: kind for name, (kind, _) in columns.factors.items()}
    units = {name: {"unit": unit} for name, unit in columns.units.items()}
    schema = pa.schema([pa.field(n, kinds.get(n, "double"), metadata=units.get(n)) for n in columns.names])
    with ParquetWriter(path, schema, compression="zstd") as writer:
        for batch in campaign.batches(*columns.names):
            arrays = [pa.array(batch[field.name], field.type, from_pandas=True) for field in schema]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))


def quantiles(values: Vector, levels: Sequence[float]) -> tuple[float, ...]:
    """Quantiles of what is a number; NaN where nothing is."""
    good = values[np.isfinite(values)]
    return tuple(np.quantile(good, levels).tolist()) if good.size else (float("nan"),) * len(levels)


def is_older(folder: Path) -> bool:
    """True for a campaign of an earlier version."""
    return (folder / FORMER).is_file() and not (folder / FILE).is_file()


def older(folder: Path) -> str:
    """Sentences on a campaign of an earlier version."""
    return (
        f"{folder}: a campaign of an earlier version, kept as Parquet files, which other programs read: "
        f'`pandas.read_parquet("{(folder / "runs").as_posix()}")`.'
    )


def read_campaign(folder: str | Path, hold: bool = False) -> Campaign:
    """Result of a campaign by the folder that it was written to, also while it is still at work.

    With `hold` all later columns are read as they are now, whatever a campaign that is at work adds meanwhile. An
    InputError tells that there is no campaign, or that what it tells is damaged.
    """
    folder = Path(folder)
    if not (folder / FILE).is_file():
        if is_older(folder):
            raise InputError([f"{older(folder)} Run the campaign again with another `--out`."])
        if wrong := other_kind(folder, CAMPAIGN):
            raise InputError([wrong])
        raise InputError([f"{folder}: there is no `{FILE}`. The folder of a campaign's result is expected."])
    store = Store(folder / FILE, KEY, is_reader=True)
    if hold:
        store.connection.execute("BEGIN")
    about = store.about
    if about is None or about.get("format") != FORMAT:
        raise InputError([f"{folder / FILE}: not a campaign of this version, or damaged. Choose another folder."])
    return Campaign(folder=folder, store=store, about=about, columns=from_facts(about["columns"]), rows=store.count())
