"""The folder of a campaign's result: a journal that every finished run goes to at once, folded into Parquet files.

`campaign.json` names the files that count, with their hashes, and is renamed into its place last, so that it tells a
state that is whole at whatever moment a writer is killed; what it does not name is left over from one, and removed by
the next.  It has a hash of its own and a copy.  What is damaged is told; a writer computes its runs again.
"""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import IO, Any, NamedTuple, TextIO

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from gapsense._os.checked import SEAL, append_lines, damage, is_sealed, read_lines, sealed
from gapsense._os.files import naming, read_json, sha256, state, write_atomically
from gapsense.campaign.columns import SIGNALS, Columns, Line, from_facts
from gapsense.problems import InputError

LOG = logging.getLogger(__name__)
FORMAT = "gapsense campaign 2"
MANIFEST, COPY, STUDY, RUNS, TRAJECTORIES = "campaign.json", "campaign-copy.json", "study.toml", "runs", "trajectories"
DAMAGED = "_damaged-"  # before the name of a file that is put aside: readers of Parquet pass over such names
AGAIN = "Run the campaign again: it computes what is damaged, and keeps the rest"
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
    sha256: str


class Signals(NamedTuple):
    """A file of trajectories."""

    file: str
    sha256: str


@dataclass(frozen=True)
class Manifest:
    """What a result is of, and the files that count."""

    about: Mapping[str, Any]  # title, hashes, versions, number of runs, ...
    columns: Columns
    parts: tuple[Part, ...] = ()
    trajectories: tuple[Signals, ...] = ()
    number: int = 0  # of the next files, and of the journal before them

    @property
    def journal(self) -> str:
        """File that takes what is finished."""
        return f"journal-{self.number:06d}.jsonl"


def read_manifest(folder: Path) -> Manifest | None:
    """What is in a folder; None if that is no campaign, an InputError if it is one that cannot be read."""
    file, copy = folder / MANIFEST, folder / COPY
    if not file.is_file() and not copy.is_file():
        return None
    if found := read_checked(file):
        return found
    if found := read_checked(copy):
        LOG.warning("%s: it is damaged or gone; %s is taken instead. %s.", file, copy.name, AGAIN)
        return found
    raise InputError([f"{file}: no campaign of this version, or it is damaged. Choose another folder."])


def read_checked(file: Path) -> Manifest | None:
    """A manifest, or None if there is none that is whole."""
    try:
        data = read_json(file)
        if data["format"] != FORMAT or not is_sealed(data):
            return None
        columns, parts = from_facts(data.pop("columns")), tuple(Part(*part) for part in data.pop("parts"))
        signals = tuple(Signals(*part) for part in data.pop("trajectories"))
    except (OSError, ValueError, KeyError, TypeError):
        return None
    del data["format"], data[SEAL]
    return Manifest(columns=columns, parts=parts, trajectories=signals, **data)


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Make it the state of the folder; it is on the disk before what only the old one names may go."""
    data = {"format": FORMAT, **vars(manifest), "columns": manifest.columns.facts()}
    text = json.dumps(sealed(data), indent=2) + "\n"
    for name in (MANIFEST, COPY):
        put(folder / name, lambda file: file.write(text.encode()))


def is_whole(file: Path, expected: str) -> bool:
    """Whether a file is there as it was written."""
    try:
        return hash_of(file, state(file)) == expected
    except OSError:
        return False


@cache
def hash_of(file: Path, _: tuple[int, int, int]) -> str:
    """Hash of a file, taken once in each of its states."""
    return sha256(file)


def read_journal(file: Path, runs: int) -> tuple[list[Line], list[int]]:
    """The first line of each run below `runs` in a journal, and lines that are damaged; nothing if there is none."""
    found: dict[int, Line] = {}
    entries, damaged = read_lines(file)
    for entry in entries:
        if isinstance(run := entry.get("run"), int) and 0 <= run < runs:
            found.setdefault(run, entry)
    return [*found.values()], damaged


class Store:
    """The one writer of a folder."""

    def __init__(self, folder: Path, manifest: Manifest) -> None:
        self.folder, self.manifest = folder, manifest
        self.count = 0  # runs in the journal
        folder.mkdir(parents=True, exist_ok=True)
        self.commit(manifest)  # first, so that a folder with anything of a campaign in it is known as one
        for name in (RUNS, TRAJECTORIES):
            with naming(folder / name):
                (folder / name).mkdir(exist_ok=True)
        self.fold()
        self.mend()

    def commit(self, manifest: Manifest) -> None:
        """Make this the state of the folder, and remove what does not count in it."""
        write_manifest(self.folder, manifest)
        self.manifest = manifest
        named = {manifest.journal, *(p.file for p in manifest.parts), *(p.file for p in manifest.trajectories)}
        for pattern in ("journal-*.jsonl", f"{RUNS}/*.parquet", f"{TRAJECTORIES}/*.parquet"):
            for file in self.folder.glob(pattern):
                if not file.name.startswith(DAMAGED) and file.relative_to(self.folder).as_posix() not in named:
                    file.unlink()

    def mend(self) -> None:
        """Put aside what is damaged, and forget its runs, so that they are computed again."""
        manifest = self.manifest
        parts = tuple(part for part in manifest.parts if self.is_good(part, f"runs {part.first} to {part.last}"))
        signals = tuple(part for part in manifest.trajectories if self.is_good(part, "signals of some runs"))
        if len(parts) < len(manifest.parts) or len(signals) < len(manifest.trajectories):
            self.commit(replace(manifest, parts=parts, trajectories=signals))
        if len(signals) < len(manifest.trajectories):
            there = pa.chunked_array([run for part in signals for run in self.runs_of(part).chunks], pa.int64())
            self.keep_only(lambda table: pc.or_(pc.is_in(table["run"], there), pc.is_valid(table["error"])), parts)

    def is_good(self, part: Part | Signals, what: str) -> bool:
        """Whether a file is whole; one that is not is told and put aside."""
        file = self.folder / part.file
        if is_good := is_whole(file, part.sha256):
            return is_good
        LOG.warning("%s: it is damaged or gone. It held %s; they are computed again.", file, what)
        if file.is_file():
            with naming(file):
                file.replace(file.with_name(DAMAGED + file.name))
        return False

    def runs_of(self, part: Part | Signals) -> pa.ChunkedArray:
        """Numbers of the runs in a file."""
        with naming(self.folder / part.file):
            return pq.read_table(self.folder / part.file, columns=["run"])["run"]

    def append(self, came: Sequence[Line]) -> None:
        """Take what is finished: it survives a kill, and the loss of power, from here on."""
        size = append_lines(self.folder / self.manifest.journal, came)
        self.count += len(came)
        if self.count >= FOLD_RUNS or size >= FOLD_BYTES:
            self.fold()

    def fold(self) -> None:
        """Make files of the journal, and begin another one."""
        journal, manifest = self.folder / self.manifest.journal, self.manifest
        lines, damaged = read_journal(journal, int(manifest.about["runs"]))
        if damaged:
            LOG.warning("%s. What they held is computed again.", damage(journal, damaged))
        if lines:
            kept = manifest.columns.table(map(without_signals, lines)).sort_by("run")
            parts = (*manifest.parts, self.write(manifest.number, kept))
            signals = (*manifest.trajectories, self.write_signals(lines)) if manifest.columns.signals else ()
            self.commit(replace(manifest, parts=parts, trajectories=signals, number=manifest.number + 1))
        journal.unlink(missing_ok=True)  # one that has but damaged lines
        self.count = 0

    def write(self, number: int, table: pa.Table) -> Part:
        """Write a file of runs, which does not count yet."""
        name, runs = f"{RUNS}/{number:06d}.parquet", table["run"]
        put(self.folder / name, lambda file: pq.write_table(table, file, compression=COMPRESSION))
        failed = table.num_rows - table["error"].null_count
        return Part(
            file=name,
            rows=table.num_rows,
            failed=failed,
            first=runs[0].as_py(),
            last=runs[-1].as_py(),
            sha256=sha256(self.folder / name),
        )

    def write_signals(self, lines: Collection[Line]) -> Signals:
        """Write trajectories to a file, which does not count yet: a group of rows for each run."""
        name, columns = f"{TRAJECTORIES}/{self.manifest.number:06d}.parquet", self.manifest.columns

        def write(file: IO[bytes]) -> None:
            with pq.ParquetWriter(file, columns.trajectories, compression=COMPRESSION) as writer:
                for line in lines:
                    if SIGNALS in line:
                        writer.write_table(columns.trajectory(line))

        put(self.folder / name, write)
        return Signals(name, sha256(self.folder / name))

    def known(self, total: int) -> npt.NDArray[np.bool_]:
        """Which of the first `total` runs are there."""
        there = np.zeros(total, dtype=bool)
        for part in self.manifest.parts:
            runs = self.runs_of(part).to_numpy()
            there[runs[runs < total]] = True
        return there

    def forget_failed(self) -> None:
        """Take the runs that failed out, so that they are tried again."""
        self.keep_only(lambda table: pc.is_null(table["error"]), [part for part in self.manifest.parts if part.failed])

    def keep_only(self, wanted: Callable[[pa.Table], Any], parts: Sequence[Part]) -> None:
        """Leave out all other rows of some files."""
        for part in parts:
            table, number = pq.read_table(self.folder / part.file), self.manifest.number
            good = table.filter(wanted(table))
            new = (self.write(number, good),) if good.num_rows else ()
            rest = (*(other for other in self.manifest.parts if other != part), *new)
            self.commit(replace(self.manifest, parts=rest, number=number + 1))

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
        file.flush()
        os.fsync(file.fileno())

    write_atomically(path, write_bytes)
