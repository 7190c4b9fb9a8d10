"""The folder of a campaign's result: a journal that every finished run goes to at once, folded into Parquet files.

`campaign.json` names the files that count and is renamed into its place last, so that it tells a state that is whole
at whatever moment a writer is killed; what it does not name is left over from one, and removed by the next.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any, NamedTuple, TextIO

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from gapsense.campaign.columns import SIGNALS, Columns, Line, from_facts, parsed
from gapsense.files import naming, read_json, write_atomically, write_json
from gapsense.problems import InputError

FORMAT = "gapsense campaign 1"
MANIFEST, STUDY, RUNS, TRAJECTORIES = "campaign.json", "study.toml", "runs", "trajectories"
FOLD_RUNS, FOLD_BYTES = 5000, 32 * 2**20  # of a journal that is folded
FILE_RUNS = 250_000  # of a file when all is done
COMPRESSION = "zstd"


class Part(NamedTuple):
    """A file of runs in order: how many, how many of them failed, the first and the last."""

    file: str
    rows: int
    failed: int
    first: int
    last: int


@dataclass(frozen=True)
class Manifest:
    """What a result is of, and the files that count."""

    about: Mapping[str, Any]  # title, hashes, versions, number of runs, ...
    columns: Columns
    parts: tuple[Part, ...] = ()
    trajectories: tuple[str, ...] = ()
    number: int = 0  # of the next files, and of the journal before them

    @property
    def journal(self) -> str:
        """File that takes what is finished."""
        return f"journal-{self.number:06d}.jsonl"


def read_manifest(folder: Path) -> Manifest | None:
    """What is in a folder; None if that is no campaign, an InputError if it is one that cannot be read."""
    try:
        data = read_json(folder / MANIFEST)
        if data.pop("format") != FORMAT:
            raise KeyError
        parts, columns = tuple(Part(*part) for part in data.pop("parts")), from_facts(data.pop("columns"))
        return Manifest(columns=columns, parts=parts, trajectories=tuple(data.pop("trajectories")), **data)
    except FileNotFoundError:
        return None
    except (ValueError, KeyError, TypeError):
        raise InputError([f"{folder / MANIFEST}: no campaign of this version. Choose another folder."]) from None


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Make it the state of the folder."""
    own = {**vars(manifest), "columns": manifest.columns.facts()}
    write_atomically(folder / MANIFEST, lambda file: write_json(file, {"format": FORMAT, **own}))


def lines(file: Path) -> Iterator[Line]:
    """What a journal holds; nothing if there is none."""
    with suppress(FileNotFoundError), file.open(encoding="utf-8") as opened:
        yield from parsed(opened)


class Store:
    """The one writer of a folder."""

    def __init__(self, folder: Path, manifest: Manifest) -> None:
        self.folder, self.manifest = folder, manifest
        self.journal: IO[bytes] | None = None
        self.count = 0  # runs in the journal
        for name in (RUNS, TRAJECTORIES):
            (folder / name).mkdir(parents=True, exist_ok=True)
        self.commit(manifest)
        self.fold()

    def commit(self, manifest: Manifest) -> None:
        """Make this the state of the folder, and remove what does not count in it."""
        write_manifest(self.folder, manifest)
        self.manifest = manifest
        named = {manifest.journal, *(part.file for part in manifest.parts), *manifest.trajectories}
        for pattern in ("journal-*.jsonl", f"{RUNS}/*.parquet", f"{TRAJECTORIES}/*.parquet"):
            for file in self.folder.glob(pattern):
                if file.relative_to(self.folder).as_posix() not in named:
                    file.unlink()

    def append(self, came: Sequence[Line]) -> None:
        """Take what is finished: it survives a kill from here on."""
        file = self.folder / self.manifest.journal
        with naming(file):
            self.journal = self.journal or file.open("ab")
            self.journal.write("".join(json.dumps(line) + "\n" for line in came).encode())
            self.journal.flush()
        self.count += len(came)
        if self.count >= FOLD_RUNS or self.journal.tell() >= FOLD_BYTES:
            self.fold()

    def fold(self) -> None:
        """Make files of the journal, and begin another one."""
        self.close()
        journal, manifest = self.folder / self.manifest.journal, self.manifest
        if kept := [without_signals(line) for line in lines(journal)]:
            parts = (*manifest.parts, self.write(manifest.number, manifest.columns.table(kept).sort_by("run")))
            signals = (*manifest.trajectories, self.write_signals(journal)) if manifest.columns.signals else ()
            self.commit(replace(manifest, parts=parts, trajectories=signals, number=manifest.number + 1))
        journal.unlink(missing_ok=True)  # one that has but a torn line
        self.count = 0

    def write(self, number: int, table: pa.Table) -> Part:
        """Write a file of runs, which does not count yet."""
        name, runs = f"{RUNS}/{number:06d}.parquet", table["run"]
        put(self.folder / name, lambda file: pq.write_table(table, file, compression=COMPRESSION))
        return Part(name, table.num_rows, table.num_rows - table["error"].null_count, runs[0].as_py(), runs[-1].as_py())

    def write_signals(self, journal: Path) -> str:
        """Write the trajectories of a journal to a file, which does not count yet: a group of rows for each run."""
        name, columns = f"{TRAJECTORIES}/{self.manifest.number:06d}.parquet", self.manifest.columns

        def write(file: IO[bytes]) -> None:
            with pq.ParquetWriter(file, columns.trajectories, compression=COMPRESSION) as writer:
                for line in lines(journal):
                    if SIGNALS in line:
                        writer.write_table(columns.trajectory(line))

        put(self.folder / name, write)
        return name

    def known(self, total: int) -> npt.NDArray[np.bool_]:
        """Which of the first `total` runs are there."""
        there = np.zeros(total, dtype=bool)
        for part in self.manifest.parts:
            runs = pq.read_table(self.folder / part.file, columns=["run"])["run"].to_numpy()
            there[runs[runs < total]] = True
        return there

    def forget_failed(self) -> None:
        """Take the runs that failed out, so that they are tried again."""
        for part in [part for part in self.manifest.parts if part.failed]:
            table, number = pq.read_table(self.folder / part.file), self.manifest.number
            good = table.filter(pc.is_null(table["error"]))
            new = (self.write(number, good),) if good.num_rows else ()
            parts = (*(other for other in self.manifest.parts if other != part), *new)
            self.commit(replace(self.manifest, parts=parts, number=number + 1))

    def compact(self) -> None:
        """Put the runs in order, in few files."""
        old, number = sorted(self.manifest.parts, key=lambda part: part.first), self.manifest.number
        if is_compact(old):
            return
        made: list[Part] = []
        for begin in range(0, max(part.last for part in old) + 1, FILE_RUNS):
            end = begin + FILE_RUNS
            files = [str(self.folder / part.file) for part in old if part.first < end and part.last >= begin]
            if files:
                inside = (ds.field("run") >= begin) & (ds.field("run") < end)
                table = ds.dataset(files, format="parquet").to_table(filter=inside).sort_by("run")
                made += [self.write(number + len(made), table)] if table.num_rows else []
        self.commit(replace(self.manifest, parts=tuple(made), number=number + len(made)))

    def close(self) -> None:
        """Let go of the journal."""
        if self.journal:
            self.journal.close()
        self.journal = None


def is_compact(parts: Sequence[Part]) -> bool:
    """True if files are in order one after the other, and few."""
    in_order = all(one.last < next_one.first for one, next_one in zip(parts, parts[1:]))
    return len(parts) <= 1 or (in_order and sum(part.rows for part in parts) > (len(parts) - 1) * FILE_RUNS // 2)


def without_signals(line: Line) -> Line:
    """What a line says of the run itself."""
    return {key: value for key, value in line.items() if key != SIGNALS}


def put(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Write a file of bytes, complete or not at all."""

    def write_bytes(file: TextIO) -> None:
        write(file.buffer)

    write_atomically(path, write_bytes)
