"""Runs that were done, in a SQLite file: each is on the disk before it counts, and whatever is kept has a checksum.

One file may hold runs under several keys.  A write-ahead log takes what is new, so that others read meanwhile; it is
gone when the writer has closed the file.  What is damaged is told: a reader refuses it, the writer keeps the rest.
"""

from __future__ import annotations

import errno
import json
import logging
import os
import shutil
import sqlite3
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from struct import Struct
from time import sleep
from typing import IO, Any
from zlib import crc32

import numpy as np
import numpy.typing as npt

from gapsense._os.files import PART, SHOWN, naming
from gapsense._os.locks import lock
from gapsense.problems import InputError

LOG = logging.getLogger(__name__)
SUFFIX, LOCK = ".sqlite", ".lock"
DAMAGED = "_damaged-"  # before the name of a file that is put aside
AGAIN = "Run it again: what is damaged is computed again, and the rest is kept"
PAUSE = 0.1  # seconds between two looks whether a file is free
PATIENCE = 60.0  # seconds that a reader waits for a writer where there is no write-ahead log
GROUP = 2**12  # rows that are in memory at once
PAGE = 4096  # bytes
LOG_HEAD, FRAME_HEAD = 32, 24  # bytes of the write-ahead log: at its begin, and before each page
BITS = 48  # of the number of a run, behind that of its key
REMOTE = {"nfs", "nfs4", "cifs", "smb3", "smbfs", "afs", "9p", "ceph", "lustre", "fuse.sshfs"}
MOUNTS = Path("/proc/self/mounts")
OF_DAMAGE = ("malformed", "unsupported", "no such table", "no such column", "not a database", "Could not decode")
UNREADABLE = (sqlite3.DatabaseError, UnicodeDecodeError)  # the latter for names, and for messages with these
ABOUT, COPY, RUNS, ERRORS, WORDS, SIGNALS = TABLES = ("about", "about_copy", "runs", "errors", "words", "signals")
MORE = (ERRORS, WORDS, SIGNALS)  # what a run may have besides
HEAD = Struct("<qB")  # of a content: its place, and one bit for each table in which the run has more
RESIDUE = 0x2144DF1C  # the CRC-32 of all that ends with its own


class Store:
    """Runs under one key, and what is said about them. A file of None keeps them in memory.

    There is one writer, see `alone`.
    """

    def __init__(self, file: Path | None, key: str, is_reader: bool = False) -> None:
        self.file, self.key, self.is_reader = file, key, is_reader
        with told(file):
            self.connection = reading(file) if is_reader and file else writing(file)
        weakref.finalize(self, self.connection.close)  # which only the collector of garbage would do else
        self.is_changed = False
        self.number = next((k for k, (own, _) in self.entries().items() if own == key), 0)

    def close(self) -> None:
        """Leave one file, which can be read where nothing can be written."""
        if self.file and self.is_changed:
            with suppress(sqlite3.OperationalError):  # someone is reading: the log stays until the next writer ends
                self.connection.execute("PRAGMA busy_timeout = 0")
                self.connection.execute("PRAGMA journal_mode = DELETE")
        self.connection.close()

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def entries(self) -> dict[int, tuple[str, Any]]:
        """Key and facts of each number; there are two copies."""
        found: dict[int, tuple[str, Any]] = {}
        for name in (ABOUT, COPY):
            rows = [row for rows in self.selected(f"SELECT id, content FROM {name}", ()) for row in rows]
            if damaged_of(rows):
                LOG.warning("%s: its description of the runs is damaged; the copy is used. %s.", self.file, AGAIN)
            for place, content in rows:
                if not damaged_of([(place, content)]):
                    found.setdefault(place, json.loads(payload(content)))
        return found

    @property
    def about(self) -> dict[str, Any] | None:
        """What is said about the runs, None if nothing is."""
        facts: dict[str, Any] | None = self.entries().get(self.number, ("", None))[1]
        return facts

    def describe(self, about: Mapping[str, Any]) -> None:
        """Say this about the runs."""
        text = json.dumps([self.key, about])
        if json.loads(text) == [*self.entries().get(self.number, ())]:
            return
        with self.changing() as change:
            if not self.number:
                (last,) = change(f"SELECT max(id) FROM {RUNS}").fetchone()
                self.number = 1 + max([*self.entries(), (last or 0) >> BITS])
            content = sealed(self.number, text.encode())
            for name in (ABOUT, COPY):
                change(f"INSERT OR REPLACE INTO {name} VALUES (?, ?)", (self.number, content))

    def add(self, runs: Mapping[int, bytes], more: Mapping[str, Mapping[int, bytes]] | None = None) -> None:
        """Take runs that are done, and what they have in other tables; what is there already stays.

        They survive a kill, and a loss of power, from here on.
        """
        more = more or {}
        bits = {run: sum(1 << k for k, name in enumerate(MORE) if run in more.get(name, ())) for run in runs}
        with self.changing():
            for name, contents in {**more, RUNS: runs}.items():
                rows = [
                    (self.place(run), sealed(self.place(run), content, bits[run] if name == RUNS else 0))
                    for run, content in contents.items()
                ]
                self.connection.executemany(f"INSERT OR IGNORE INTO {name} VALUES (?, ?)", rows)

    @contextmanager
    def changing(self) -> Iterator[Callable[..., sqlite3.Cursor]]:
        """One change of the file, whole or not at all."""
        with told(self.file):
            if self.file and not self.is_changed:
                self.connection.execute(f"PRAGMA journal_mode = {mode_of(self.file)}")
            self.is_changed = True
            self.connection.execute("BEGIN IMMEDIATE")
            try:
                yield self.connection.execute
                self.connection.execute("COMMIT")
            except BaseException:
                with suppress(sqlite3.Error):
                    self.connection.execute("ROLLBACK")
                raise

    def place(self, run: int) -> int:
        """Where a run is in each table."""
        return (self.number << BITS) + run

    def runs(self, table: str = RUNS, below: int = 2**BITS) -> npt.NDArray[np.int64]:
        """Numbers of the runs in a table, in order."""
        low, query = self.place(0), f"SELECT id FROM {table} WHERE id >= ? AND id < ? ORDER BY id"
        found = [np.array(rows)[:, 0] - low for rows in self.selected(query, (low, low + below))]
        return np.concatenate([np.empty(0, dtype=np.int64), *found])

    def count(self, table: str = RUNS) -> int:
        """How many runs there are in a table."""
        query = f"SELECT count(*) FROM {table} WHERE id >= ? AND id < ?"
        ((count,),) = next(self.selected(query, (self.place(0), self.place(2**BITS))))
        return int(count)

    def forget(self, runs: Iterable[int]) -> None:
        """Remove runs, so that they are done again."""
        if places := [self.place(run) for run in runs]:
            with self.changing():
                remove(self.connection, places)

    def contents(self, table: str = RUNS) -> Iterator[list[bytes]]:
        """Contents of a table in the order of the runs, some at a time, with heads and checksums."""
        query = f"SELECT content FROM {table} WHERE id >= ? AND id < ? ORDER BY id"
        for rows in self.selected(query, (self.place(0), self.place(2**BITS))):
            found = [content for (content,) in rows]
            if not are_whole(found):
                query = f"SELECT id, content FROM {table} WHERE id >= ? AND id < ?"
                all_rows = self.selected(query, (self.place(0), self.place(2**BITS)))
                damaged = [place for group in all_rows for place in damaged_of(group)]
                raise InputError([f"{self.file}: {of_runs(damaged)} damaged. {AGAIN}."])
            yield found

    def content(self, table: str, run: int) -> bytes | None:
        """Content of one run in a table, None if there is none."""
        found = next(self.selected(f"SELECT id, content FROM {table} WHERE id = ?", (self.place(run),)), [])
        if damaged_of(found):
            raise InputError([f"{self.file}: {table} of run {run} are damaged. {AGAIN}."])
        return payload(found[0][1]) if found else None

    def texts(self, table: str, most: int = 2**BITS) -> Iterator[tuple[int, Any]]:
        """The first runs in a table of JSON, and what they have there."""
        for contents in self.contents(table):
            for content in contents[:most]:
                yield HEAD.unpack_from(content)[0] - self.place(0), json.loads(payload(content))
            most -= len(contents)
            if most <= 0:
                return

    def selected(self, query: str, values: tuple[int, ...]) -> Iterator[list[Any]]:
        """Rows of a query, some at a time."""
        try:
            with told(self.file):
                cursor = self.connection.execute(query, values)
                rows = cursor.fetchmany(GROUP)
            while rows:
                yield rows
                with told(self.file):
                    rows = cursor.fetchmany(GROUP)
        except UNREADABLE as error:
            raise InputError([f"{self.file}: it is damaged ({error}). {AGAIN}."]) from None


def sealed(place: int, content: bytes, bits: int = 0) -> bytes:
    """A content with its place in front and its checksum behind."""
    whole = HEAD.pack(place, bits) + content
    return whole + crc32(whole).to_bytes(4, "little")


def payload(content: bytes) -> bytes:
    """A content without head and checksum."""
    return content[HEAD.size : -4]


def are_whole(contents: Sequence[Any]) -> bool:
    """Whether contents are as they were written."""
    try:
        return {*map(crc32, contents)} <= {RESIDUE}
    except TypeError:  # damage has made something else of one
        return False


def damaged_of(rows: Iterable[tuple[int, Any]]) -> list[int]:
    """Places whose content is damaged, or another one's."""
    return [place for place, own in rows if not are_whole([own]) or HEAD.unpack_from(own)[0] != place]


def of_runs(places: Sequence[int]) -> str:
    """Some runs in words, with their verb."""
    runs = [place & (2**BITS - 1) for place in places]
    first, more = ", ".join(map(str, runs[:SHOWN])), len(runs) - SHOWN
    return f"run {first} is" if len(runs) == 1 else f"runs {first}{f' and {more} more' if more > 0 else ''} are"


def connect(file: Path, mode: str = "rwc") -> sqlite3.Connection:
    """Connection to a file, in which transactions are begun by hand."""
    uri = f"{file.resolve().as_uri()}?mode={mode}"
    return sqlite3.connect(uri, uri=True, isolation_level=None, timeout=PATIENCE)


def reading(file: Path) -> sqlite3.Connection:
    """The file as it is; an InputError if its structure is damaged."""
    try:
        connection = connect(file, "ro")
        problem = wrong(connection)
    except UNREADABLE as error:
        problem = damage(error)
    if problem:
        raise InputError([f"{file}: it is damaged ({problem}). {AGAIN}."])
    return connection


def writing(file: Path | None) -> sqlite3.Connection:
    """The file, made if need be; what is damaged in it is told and forgotten."""
    if file is None:
        return prepared(sqlite3.connect(":memory:", isolation_level=None))
    file.parent.mkdir(parents=True, exist_ok=True)
    commits = logged(file)
    try:
        connection = prepared(connect(file))
        if commits > max(0, connection.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()[1]):
            LOG.warning("%s: the log of its last runs is damaged. Lost runs are computed again.", file)
        problem = wrong(connection)
        if not problem:
            forget_damaged(connection, file)
            return connection
        connection.close()
    except UNREADABLE as error:
        problem = damage(error)
    rebuild(file, problem)
    return prepared(connect(file))


def prepared(connection: sqlite3.Connection) -> sqlite3.Connection:
    """A connection with the tables, which are the first pages of a new file."""
    connection.execute(f"PRAGMA page_size = {PAGE}")
    connection.execute("PRAGMA synchronous = FULL")
    if not connection.execute("SELECT 1 FROM sqlite_master").fetchone():
        connection.execute("BEGIN IMMEDIATE")
        for name in TABLES:
            connection.execute(f"CREATE TABLE {name} (id INTEGER PRIMARY KEY, content BLOB)")
        connection.execute("COMMIT")
    return connection


def mode_of(file: Path) -> str:
    """How SQLite keeps a change whole: by a write-ahead log, which needs memory that all who read or write share."""
    if is_remote(file):
        LOG.warning("%s: on a network file system there is no write-ahead log, and each run takes longer.", file)
        return "DELETE"
    return "WAL"


def is_remote(file: Path) -> bool:
    """True on a network file system, as far as the system tells."""
    try:
        mounts = [line.split()[1:3] for line in MOUNTS.read_text("utf-8", "replace").splitlines()]
    except OSError:
        return False
    above = {str(folder) for folder in file.resolve().parents}
    return max(((len(place), kind) for place, kind in mounts if place in above), default=(0, ""))[1] in REMOTE


def wrong(connection: sqlite3.Connection) -> str:
    """What is wrong with the structure of a file, or nothing."""
    (found,) = connection.execute("PRAGMA quick_check(1)").fetchone()
    tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master")}
    return " ".join(str(found).split()) if found != "ok" else "" if tables == {*TABLES} else "tables are missing"


def logged(file: Path) -> int:
    """Place of the last commit in a write-ahead log that a kill has left, damaged or not."""
    try:
        content = file.with_name(f"{file.name}-wal").read_bytes()
    except FileNotFoundError:
        return 0
    frames = [content[at : at + FRAME_HEAD] for at in range(LOG_HEAD, len(content), FRAME_HEAD + PAGE)]
    alike = next((k for k, frame in enumerate(frames) if frame[8:16] != frames[0][8:16]), len(frames))
    return max((k for k, frame in enumerate(frames[:alike], 1) if any(frame[4:8])), default=0)


def forget_damaged(connection: sqlite3.Connection, file: Path) -> None:
    """Tell and remove runs of which something is damaged or gone."""
    for name in TABLES:
        cursor, damaged = connection.execute(f"SELECT id, content FROM {name} ORDER BY id"), list[int]()
        while rows := cursor.fetchmany(GROUP):
            found = damaged_of(rows)
            damaged += found or (incomplete(connection, rows) if name == RUNS else [])
        if damaged and name in (ABOUT, COPY):
            restore(connection, COPY if name == ABOUT else ABOUT, name)
            LOG.warning("%s: its description of the runs is damaged; the copy is used.", file)
        elif damaged:
            LOG.warning("%s: %s damaged, and computed again.", file, of_runs(damaged))
            remove(connection, damaged)


def incomplete(connection: sqlite3.Connection, rows: Sequence[tuple[int, bytes]]) -> list[int]:
    """Places of runs that should have more in other tables."""
    found = list[int]()
    for k, name in enumerate(MORE):
        needed = {place for place, content in rows if content[8] >> k & 1}
        there = connection.execute(f"SELECT id FROM {name} WHERE id BETWEEN ? AND ?", (rows[0][0], rows[-1][0]))
        found += needed.difference(place for (place,) in (there if needed else ()))
    return sorted({*found})


def restore(connection: sqlite3.Connection, source: str, target: str) -> None:
    """Take what is good of one copy for the other."""
    connection.execute(f"DELETE FROM {target}")
    rows = [row for row in connection.execute(f"SELECT id, content FROM {source}") if not damaged_of([row])]
    connection.executemany(f"INSERT INTO {target} VALUES (?, ?)", rows)


def remove(connection: sqlite3.Connection, places: Sequence[int]) -> None:
    """Remove runs from all tables."""
    for name in (RUNS, *MORE):
        connection.executemany(f"DELETE FROM {name} WHERE id = ?", [(place,) for place in places])


def rebuild(file: Path, problem: str) -> None:
    """Make a new file of what can be read of a damaged one, which is put aside."""
    aside, new = file.with_name(DAMAGED + file.name), file.with_name(f".{file.name}{PART}")
    for ending in ("", "-wal", "-shm"):
        for old in (aside, new):
            old.with_name(old.name + ending).unlink(missing_ok=True)
        with suppress(FileNotFoundError):
            shutil.copyfile(file.with_name(file.name + ending), aside.with_name(aside.name + ending))
    with closing(prepared(connect(new))) as fresh:
        graft(aside, new)
        fresh.execute("BEGIN")
        for name in TABLES:
            fresh.executemany(f"INSERT OR IGNORE INTO {name} VALUES (?, ?)", readable(aside, name))
        ((count,),) = fresh.execute(f"SELECT count(*) FROM {RUNS}").fetchall()
        fresh.execute("COMMIT")
    for ending in ("-wal", "-shm"):
        for old in (file, aside):
            old.with_name(old.name + ending).unlink(missing_ok=True)
    new.replace(file)
    with closing(connect(file)) as fresh:
        for name, other in ((ABOUT, COPY), (COPY, ABOUT)):
            fresh.execute(f"INSERT OR IGNORE INTO {name} SELECT * FROM {other}")
        forget_damaged(fresh, file)
    words = "%s: it is damaged (%s), and kept as %s. It held %d runs that can be read; others are computed again."
    LOG.warning(words, file, problem, aside.name, count)


def readable(file: Path, table: str) -> Iterator[tuple[int, bytes]]:
    """Rows of a table that are good: from both ends until something cannot be read."""
    for order in ("ASC", "DESC"):
        with closing(connect(file)) as connection, suppress(*UNREADABLE):
            for row in connection.execute(f"SELECT id, content FROM {table} ORDER BY id {order}"):
                if not damaged_of([row]):
                    yield row


def graft(file: Path, new: Path) -> None:
    """Give a file the first page of a new one: all of ours have the same, but for the number of pages."""
    page = bytearray(new.read_bytes()[:PAGE])
    page[18:20] = b"\2\2" if file.with_name(f"{file.name}-wal").is_file() else b"\1\1"  # whether there is a log
    page[28:32] = (file.stat().st_size // PAGE).to_bytes(4, "big")
    with file.open("r+b") as opened:
        opened.write(page)


def damage(error: Exception) -> str:
    """What an error says of damage; another one is raised again."""
    if isinstance(error, sqlite3.OperationalError) and not is_of_damage(str(error)):
        raise error
    return str(error)


def is_of_damage(said: str) -> bool:
    """True for what SQLite says of damage."""
    return any(words in said for words in OF_DAMAGE)


@contextmanager
def told(file: Path | None) -> Iterator[None]:
    """Tell errors of the operating system, of which SQLite says little, in its words and with the file."""
    try:
        yield
    except sqlite3.OperationalError as error:
        if file is None or is_of_damage(str(error)):
            raise
        raise os_error(file, str(error)) from error


def os_error(file: Path, said: str) -> OSError:
    """What is behind an error of SQLite: what the system says if the same is tried without it."""
    if "full" in said:
        return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(file))
    try:
        with naming(file), file.open("r+b"), file.with_name(f".{file.name}{PART}").open("wb"):
            file.with_name(f".{file.name}{PART}").unlink()
    except OSError as error:
        return error
    return OSError(errno.EIO, said, str(file))


@contextmanager
def alone(file: Path | None) -> Iterator[None]:
    """Wait until no other process works with a file, and keep others waiting; a kill ends that too.

    The lock is on a file beside it, which is removed in the end.
    """
    if file is None:
        return (yield)
    beside, is_told = file.with_name(f".{file.name}{LOCK}"), False
    beside.parent.mkdir(parents=True, exist_ok=True)
    while True:
        with naming(beside):
            mine = beside.open("ab")
        with mine:
            is_mine = is_locked(mine)
            if is_mine and is_same(mine, beside):
                try:
                    return (yield)
                finally:
                    with suppress(OSError):  # Windows keeps a file that is open
                        beside.unlink()
        if not is_mine:
            if not is_told:
                LOG.warning("%s: another process is using it; waiting for its end.", file)
            is_told = True
            sleep(PAUSE)


def is_same(file: IO[bytes], path: Path) -> bool:
    """True if an open file is still the one with that name."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False


def is_locked(file: IO[bytes]) -> bool:
    """True if the file is locked by us now, or cannot be locked where it is."""
    try:
        return lock(file)
    except OSError:
        return True
