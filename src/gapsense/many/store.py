"""Runs that were done, in a SQLite file. Each run is on the disk before it counts, and everything has a checksum.

One file may hold runs under several keys. New runs go to a write-ahead log, so that others can read at the same time.
The log is gone when the writer has closed the file. Damage is reported: a reader refuses the file, the writer keeps
what is whole.
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
from itertools import chain
from math import isqrt
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
GROUP = 31**2  # rows that are in memory at once, the square of an odd number for `are_whole`
PAGE = 4096  # bytes
SYNCHRONOUS = "FULL"  # a run that was counted outlives a loss of power; a kill it outlives in any case
WRITTEN_BY, NEWEST = 18, 2  # byte with the version of the format, and the last one that SQLite writes
LOG_HEAD, FRAME_HEAD = 32, 24  # bytes of the write-ahead log: at its begin, and before each page
BITS = 48  # for the number of a run, below that of its key
REMOTE = {"nfs", "nfs4", "cifs", "smb3", "smbfs", "afs", "9p", "ceph", "lustre", "fuse.sshfs"}
MOUNTS = Path("/proc/self/mounts")
OF_DAMAGE = ("malformed", "unsupported", "no such table", "no such column", "not a database", "Could not decode")
UNREADABLE = (sqlite3.DatabaseError, UnicodeDecodeError)  # the latter for names, and for messages with these
ABOUT, COPY, RUNS, ERRORS, WORDS, SIGNALS = TABLES = ("about", "about_copy", "runs", "errors", "words", "signals")
CREATED = [f"CREATE TABLE {name} (id INTEGER PRIMARY KEY, content BLOB)" for name in TABLES]
MORE = (ERRORS, WORDS, SIGNALS)  # what a run may have besides
HEAD = Struct("<qB")  # of a content: its place, and one bit for each table in which the run has more
RESIDUE = 0x2144DF1C  # the CRC-32 of all that ends with its own


class Store:
    """Runs under one key, and what is said about them. A file of None keeps them in memory.

    There is one writer, see `alone`.
    """

    def __init__(self, file: Path | None, key: str, is_reader: bool = False) -> None:
        self.file, self.key = file, key
        with tell_errors(file):
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
        query = " UNION ALL ".join(f"SELECT id, content, whole(id, content) FROM {name}" for name in (ABOUT, COPY))
        rows = [row for rows in self.select(query) for row in rows]
        if not all(is_good for *_, is_good in rows):
            LOG.warning("%s: its description of the runs is damaged; the copy is used. %s.", self.file, AGAIN)
        return {place: json.loads(payload(content)) for place, content, is_good in rows if is_good}

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
            content = seal(self.number, text.encode())
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
                    (self.place(run), seal(self.place(run), content, bits[run] if name == RUNS else 0))
                    for run, content in contents.items()
                ]
                self.connection.executemany(f"INSERT OR IGNORE INTO {name} VALUES (?, ?)", rows)

    @contextmanager
    def changing(self) -> Iterator[Callable[..., sqlite3.Cursor]]:
        """One change of the file, whole or not at all."""
        with tell_errors(self.file):
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
        found = [np.array(rows)[:, 0] - self.place(0) for rows in self.of_key("id", table, "ORDER BY id", below)]
        return np.concatenate([np.empty(0, dtype=np.int64), *found])

    def count(self, table: str = RUNS) -> int:
        """How many runs there are in a table."""
        ((count,),) = next(self.of_key("count(*)", table))
        return int(count)

    def forget(self, runs: Iterable[int]) -> None:
        """Remove runs, so that they are done again."""
        if places := [self.place(run) for run in runs]:
            with self.changing():
                remove(self.connection, places)

    def contents(self, table: str = RUNS, below: int = 2**BITS, most: int = -1) -> Iterator[list[bytes]]:
        """Contents of a table in the order of the runs, some at a time, with heads and checksums; -1: all of them."""
        for rows in self.of_key("content", table, f"ORDER BY id LIMIT {most}", below):
            found = [*chain.from_iterable(rows)]
            if not are_whole(found):
                groups = self.of_key("id", table, "AND NOT whole(id, content) ORDER BY id")
                raise InputError([f"{self.file}: {of_runs([*chain.from_iterable(chain(*groups))])} damaged. {AGAIN}."])
            yield found

    def content(self, table: str, run: int) -> bytes | None:
        """Content of one run in a table, None if there is none."""
        found = next(self.select(f"SELECT id, content FROM {table} WHERE id = ?", self.place(run)), [])
        if not all(is_whole(*row) for row in found):
            raise InputError([f"{self.file}: {table} of run {run} are damaged. {AGAIN}."])
        return payload(found[0][1]) if found else None

    def texts(self, table: str, below: int = 2**BITS, most: int = -1) -> dict[int, Any]:
        """What the first runs have in a table of JSON, by run."""
        found = chain.from_iterable(self.contents(table, below, most))
        return {HEAD.unpack_from(content)[0] - self.place(0): json.loads(payload(content)) for content in found}

    def of_key(self, what: str, table: str, more: str = "", below: int = 2**BITS) -> Iterator[list[Any]]:
        """Rows of the runs under this key, some at a time."""
        query = f"SELECT {what} FROM {table} WHERE id >= ? AND id < ? {more}"
        return self.select(query, self.place(0), self.place(below))

    def select(self, query: str, *values: int) -> Iterator[list[Any]]:
        """Rows of a query, some at a time."""
        try:
            with tell_errors(self.file):
                cursor = self.connection.execute(query, values)
                rows = cursor.fetchmany(GROUP)
            while rows:
                yield rows
                with tell_errors(self.file):
                    rows = cursor.fetchmany(GROUP)
        except UNREADABLE as error:
            raise InputError([f"{self.file}: it is damaged ({error}). {AGAIN}."]) from None


def seal(place: int, content: bytes, bits: int = 0) -> bytes:
    """Put the place in front of a content, and its checksum behind."""
    whole = HEAD.pack(place, bits) + content
    return whole + crc32(whole).to_bytes(4, "little")


def payload(content: bytes) -> bytes:
    """A content without head and checksum."""
    return content[HEAD.size : -4]


def are_whole(contents: Sequence[Any]) -> bool:
    """Whether contents are as they were written.

    A CRC is linear: the exclusive or of an odd number of whole contents of one length is whole. So contents are laid
    out in a square and checked by rows and by columns. If two have the same damage, it shows in one or the other.
    """
    try:
        side, (length, *others) = isqrt(len(contents)), {*map(len, contents)}
        if side % 2 and side**2 == len(contents) and not others:
            square = np.frombuffer(b"".join(contents), "u1").reshape(side, side, length)
            contents = [*np.bitwise_xor.reduce(square, 0), *np.bitwise_xor.reduce(square, 1)]
        return {*map(crc32, contents)} == {RESIDUE}
    except TypeError:  # damage has made something else of one
        return False


def is_whole(place: int, content: Any) -> bool:
    """Whether a content is as it was written, and at its place; SQL knows it as `whole`."""
    return isinstance(content, bytes) and crc32(content) == RESIDUE and HEAD.unpack_from(content)[0] == place


def of_runs(places: Sequence[int]) -> str:
    """Some runs in words, with their verb."""
    runs = [place & (2**BITS - 1) for place in places]
    first, more = ", ".join(map(str, runs[:SHOWN])), len(runs) - SHOWN
    return f"run {first} is" if len(runs) == 1 else f"runs {first}{f' and {more} more' if more > 0 else ''} are"


def connect(file: Path, mode: str = "rwc") -> sqlite3.Connection:
    """Connection to a file, in which transactions are begun by hand."""
    return knowing(f"{file.resolve().as_uri()}?mode={mode}", timeout=PATIENCE)


def knowing(uri: str, timeout: float = 0.0) -> sqlite3.Connection:
    """A connection that knows `whole`; one that nobody has closed is closed by the thread that collects garbage."""
    connection = sqlite3.connect(uri, uri=True, timeout=timeout, isolation_level=None, check_same_thread=False)
    connection.create_function("whole", 2, is_whole, deterministic=True)
    return connection


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
    """The file, opened for writing and made if need be; damaged entries are reported and deleted."""
    if file is None:
        return prepare_connection(knowing("file::memory:"))
    file.parent.mkdir(parents=True, exist_ok=True)
    commits = last_commit(file)
    try:
        connection = prepare_connection(connect(file))
        if commits > max(0, connection.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()[1]):
            LOG.warning("%s: the log of its last runs is damaged. Lost runs are computed again.", file)
        with file.open("rb") as opened:  # of an unknown version SQLite would only read
            is_known = opened.read(WRITTEN_BY + 1)[-1] <= NEWEST
        problem = wrong(connection) or ("" if is_known else "the version of its format is unknown")
        if not problem:
            forget_damaged(connection, file)
            return connection
        connection.close()
    except UNREADABLE as error:
        problem = damage(error)
    rebuild(file, problem)
    return prepare_connection(connect(file))


def prepare_connection(connection: sqlite3.Connection) -> sqlite3.Connection:
    """A connection with the tables, which are the first pages of a new file."""
    connection.execute(f"PRAGMA page_size = {PAGE}")
    connection.execute(f"PRAGMA synchronous = {SYNCHRONOUS}")
    if not connection.execute("SELECT 1 FROM sqlite_master").fetchone():
        connection.execute("BEGIN IMMEDIATE")
        for sql in CREATED:
            connection.execute(sql)
        connection.execute("COMMIT")
    return connection


def mode_of(file: Path) -> str:
    """How SQLite keeps a change whole. A write-ahead log needs memory that all readers and writers share."""
    try:
        mounts = [line.split()[1:3] for line in MOUNTS.read_text("utf-8", "replace").splitlines()]
    except OSError:  # of a system that does not tell
        mounts = []
    above = {str(folder) for folder in file.resolve().parents}
    kind = max(((len(place), kind) for place, kind in mounts if place in above), default=(0, ""))[1]
    if kind in REMOTE:
        LOG.warning("%s: on a network file system there is no write-ahead log, and each run takes longer.", file)
        return "DELETE"
    return "WAL"


def wrong(connection: sqlite3.Connection) -> str:
    """What is wrong with the structure of a file, or nothing."""
    (found,) = connection.execute("PRAGMA quick_check(1)").fetchone()
    tables = [sql for (sql,) in connection.execute("SELECT sql FROM sqlite_master")]
    return " ".join(str(found).split()) if found != "ok" else "" if tables == CREATED else "its tables are not ours"


def last_commit(file: Path) -> int:
    """Place of the last commit in a write-ahead log that a kill has left, damaged or not."""
    try:
        content = file.with_name(f"{file.name}-wal").read_bytes()
    except FileNotFoundError:
        return 0
    frames = [content[at : at + FRAME_HEAD] for at in range(LOG_HEAD, len(content), FRAME_HEAD + PAGE)]
    alike = next((k for k, frame in enumerate(frames) if frame[8:16] != frames[0][8:16]), len(frames))
    return max((k for k, frame in enumerate(frames[:alike], 1) if any(frame[4:8])), default=0)


def forget_damaged(connection: sqlite3.Connection, file: Path) -> None:
    """Tell and remove runs of which something is damaged or gone; of what is said about them take the good copy."""
    if damaged := [place for (place,) in connection.execute(f"{' UNION '.join(DAMAGED_RUNS)} ORDER BY 1")]:
        LOG.warning("%s: %s damaged, and computed again.", file, of_runs(damaged))
        remove(connection, damaged)
    for name, other in ((ABOUT, COPY), (COPY, ABOUT)):
        if connection.execute(f"SELECT 1 FROM {name} WHERE NOT whole(id, content)").fetchone():
            LOG.warning("%s: its description of the runs is damaged; the copy is used.", file)
            connection.execute(f"DELETE FROM {name} WHERE NOT whole(id, content)")
        connection.execute(f"INSERT OR IGNORE INTO {name} SELECT * FROM {other} WHERE whole(id, content)")


DAMAGED_RUNS = [
    *(f"SELECT id FROM {name} WHERE NOT whole(id, content)" for name in (RUNS, *MORE)),
    *(  # that should have more in another table
        f"SELECT id FROM {RUNS} WHERE substr(content, 9, 1) IN ({bits}) AND id NOT IN (SELECT id FROM {name})"
        for k, name in enumerate(MORE)
        for bits in [", ".join(f"x'{byte:02x}'" for byte in range(2 ** len(MORE)) if byte >> k & 1)]
    ),
]


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
    with closing(prepare_connection(connect(new))) as fresh:
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
        forget_damaged(fresh, file)
    words = "%s: it is damaged (%s), and kept as %s. It held %d runs that can be read; others are computed again."
    LOG.warning(words, file, problem, aside.name, count)


def readable(file: Path, table: str) -> Iterator[tuple[int, bytes]]:
    """Rows of a table that are good: from both ends until something cannot be read."""
    for order in ("ASC", "DESC"):
        with closing(connect(file)) as connection, suppress(*UNREADABLE):
            yield from connection.execute(f"SELECT * FROM {table} WHERE whole(id, content) ORDER BY id {order}")


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
def tell_errors(file: Path | None) -> Iterator[None]:
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
