"""Files: what can be read to its end, what is complete or absent; CSV with exact numbers, JSON, hashes."""

from __future__ import annotations

import csv
import errno
import hashlib
import io
import json
import math
import os
import re
import stat
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache, lru_cache, wraps
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TextIO, TypeVar

from gapsense._os.locks import held, remove_abandoned
from gapsense.problems import InputError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt


FOREIGN = frozenset('<>:"/\\|?*')  # characters
# Of Windows:
DEVICE = re.compile(r"(con|prn|aux|nul|conin\$|conout\$|(com|lpt)[0-9\u00b9\u00b2\u00b3])(\..*)?", re.IGNORECASE)
LONGEST_NAME = 150  # bytes, so that there is room for what results have in front and behind
UNBLOCKED = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)  # does not wait for bytes
LARGEST = 2 * 10**9  # bytes of a file that is read at once
NAME_MAX = 255  # bytes of a name, of most systems
FILE, FOLDER = "a file", "a folder"
KINDS = {
    stat.S_IFDIR: FOLDER,
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
T = TypeVar("T")
Columns = Mapping[str, "npt.NDArray[Any]"]
Write = Callable[[TextIO], None]
HEADER = re.compile(r"(.*\S)\s+\[\s*([^\[\]]*?)\s*\]")  # the blank tells a unit from the index in `x[1]`
PART = ".gapsense-part"
SHOWN = 3  # cells and lines that are named for each kind of problem
LOOKED_AT = 100  # rows that tell whether a file holds a table


def write_atomically(path: Path, write: Write) -> None:
    """Write to a temporary name in the same folder, then rename; a failure leaves the old file as it was."""
    with prepare_file(path, write) as part:
        rename(part, path)


@contextmanager
def prepare_file(path: Path, write: Write) -> Iterator[Path]:
    """Write a file beside `path`, in a folder that is made if need be, for `rename`; else it is removed again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    clean(path.parent.resolve())
    with naming(path):
        mine = held(lambda: new_part(path))
    part = Path(mine.name)
    try:
        with naming(path), part.open("w", encoding="utf-8", newline="\n") as file:
            write(file)
        part.chmod(0o666 & ~mask())
        if sys.platform == "win32":  # which renames no open file
            mine.close()
        yield part
    finally:
        mine.close()
        part.unlink(missing_ok=True)


def new_part(path: Path) -> Path:
    """An empty file beside `path` with a name of its own."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=PART)
    os.close(handle)
    return Path(name)


@cache
def clean(folder: Path) -> None:
    """Remove what writers that were killed left in a folder; once in each process."""
    for part in folder.glob(f".*{PART}"):
        remove_abandoned(part, Path.unlink)


def rename(part: Path, path: Path) -> None:
    """Put a prepared file in its place."""
    with naming(path):
        part.replace(path)


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Tell which file an error of the operating system is about; that of a full disk does not say."""
    try:
        yield
    except OSError as error:
        error.filename, error.filename2 = str(path), None
        raise


def header(name: str, unit: str = "") -> str:
    """Head of a column: `name [unit]`, or the name alone where there is no unit."""
    return f"{name} [{unit}]" if unit else name


def split_header(cell: str) -> tuple[str, str]:
    """Name and unit that the head of a column says; the unit is empty where there is none."""
    found = HEADER.fullmatch(cell.strip())
    return (found[1], found[2]) if found else (cell.strip(), "")


def write_columns(file: TextIO, columns: Columns, units: Mapping[str, str] | None = None) -> None:
    """CSV with quoted heads `name [unit]`, quoted texts, and the shortest numbers that read back to the same bits."""
    heads = (header(name, (units or {}).get(name, "")) for name in columns)
    file.write(",".join(map(cell, heads)) + "\n")
    cells = (texts(column) if column.dtype.kind == "f" else map(cell, column.tolist()) for column in columns.values())
    file.writelines(",".join(row) + "\n" for row in zip(*cells))


def texts(column: npt.NDArray[Any]) -> list[str]:
    """Numbers as texts; many signals keep a value for some samples, and a text takes long to make."""
    import numpy as np  # here, so that what needs no arrays starts fast

    bits = np.ascontiguousarray(column, dtype=np.float64).view(np.int64)
    new = np.flatnonzero(np.diff(bits, prepend=~bits[:1]))
    made = np.array([*map(repr, bits[new].view(np.float64).tolist())], dtype=object)
    repeated: list[str] = np.repeat(made, np.diff(new, append=len(bits))).tolist()
    return repeated


def cell(value: Any) -> str:
    """A number, or a text in quotes."""
    return '"{}"'.format(value.replace('"', '""')) if isinstance(value, str) else repr(value)


class Sheet(NamedTuple):
    """Cells of a CSV file: its path, names and units from the first line, then rows with the lines they are in."""

    path: Path
    names: tuple[str, ...]
    units: tuple[str, ...]
    lines: list[int]
    rows: list[list[str]]

    @property
    def is_table(self) -> bool:
        """True if most cells are numbers. Other content may be private, and no message quotes it."""
        cells = [text for row in self.rows[:LOOKED_AT] for text in row]
        return bool(cells) and 2 * sum(number(text) is not None for text in cells) >= len(cells)

    @property
    def known(self) -> tuple[str, ...]:
        """Names of the columns of a table, which messages may offer."""
        return self.names if self.is_table else ()

    def place(self, row: int, column: int) -> str:
        """Where a cell is, as messages name it."""
        return f"{self.path}, line {self.lines[row]}, column {column + 1} (`{self.names[column]}`)"


def read_sheet(path: Path, problems: list[str], content: bytes | None = None) -> Sheet:
    """Cells of a CSV file, or of its `content` if that was read; `problems` takes what is wrong with its form.

    Lines with more or fewer cells than there are columns are left out.
    """
    try:
        content = read_bytes(path) if content is None else content
        if b"\0" in content:  # before it is copied: some versions of the reader take it
            raise csv.Error("it contains NUL bytes")
        text = content.decode("utf-8-sig")
        reader = csv.reader(io.StringIO(text, newline=""))
        lines = [(reader.line_num, row) for row in reader if row]
    except (UnicodeDecodeError, csv.Error) as error:
        problems.append(f"{path}: not a CSV file in UTF-8 ({why_unreadable(error)}). Save it as one.")
        lines = []
    names, units = zip(*map(split_header, lines[0][1])) if lines else ((), ())
    good = [(n, row) for n, row in lines[1:] if len(row) == len(names)]
    sheet = Sheet(path=path, names=names, units=units, lines=[n for n, _ in good], rows=[row for _, row in good])
    problems += [*twice(path, sheet.known), *ragged_lines(path, len(names), lines[1:])]
    return sheet


def why_unreadable(error: Exception) -> str:
    """Say why a text cannot be read, without a character of it."""
    return f"byte {error.start} is not UTF-8" if isinstance(error, UnicodeDecodeError) else str(error)


def twice(path: Path, names: Sequence[str]) -> list[str]:
    """Sentences on names that several columns have."""
    places = {name: [k for k, other in enumerate(names, 1) if other == name] for name in names}
    return [
        f"{path}, line 1: columns {' and '.join(map(str, at))} are both called `{name}`. Rename or remove one."
        for name, at in places.items()
        if len(at) > 1
    ]


def ragged_lines(path: Path, width: int, lines: Sequence[tuple[int, list[str]]]) -> list[str]:
    """Say which first lines have more or fewer cells than there are columns."""
    wrong = [(n, len(row)) for n, row in lines if len(row) != width]
    told = [f"{path}, line {n}: {count} values found, {width} expected. Correct it." for n, count in wrong[:SHOWN]]
    return told + more(path, len(wrong), "lines have a wrong number of values")


def more(path: Path, count: int, what: str) -> list[str]:
    """A sentence that counts the problems of one kind which were not listed one by one, if there are any."""
    return [f"{path}: {count - SHOWN} more {what}."] if count > SHOWN else []


def read_columns(
    path: Path, units: Mapping[str, str] | None = None, content: bytes | None = None
) -> dict[str, npt.NDArray[np.float64]]:
    """Columns of a CSV file by name, without the units in its heads.

    A column with another unit than that in `units` is refused; nothing is converted. One without a unit is accepted.
    The InputError lists all that is wrong.
    """
    import numpy as np  # here, so that what needs no arrays starts fast

    problems: list[str] = []
    sheet = read_sheet(path, problems, content)
    problems += other_units(sheet, units or {})
    try:
        table = np.array([[float(text) for text in row] for row in sheet.rows], dtype=np.float64)
    except ValueError:
        problems += no_numbers(sheet)
    if problems:
        raise InputError(problems)
    table = table.reshape(len(sheet.rows), len(sheet.names))
    return {name: np.ascontiguousarray(table[:, index]) for index, name in enumerate(sheet.names)}


def other_units(sheet: Sheet, units: Mapping[str, str]) -> list[str]:
    """Sentences on columns with another unit than they must have."""
    pairs = [(name, unit, units.get(name, unit)) for name, unit in zip(sheet.names, sheet.units) if unit]
    return [
        f"{sheet.path}, line 1: `{name}` is in `{unit}`, `{expected or '1'}` is expected, and nothing is converted. "
        f"Convert the column and write `{header(name, expected)}`."
        for name, unit, expected in pairs
        if unit != expected
    ]


def no_numbers(sheet: Sheet) -> list[str]:
    """Sentences on the first cells that hold no number, and how many more there are."""
    if sheet.rows and not sheet.is_table:
        return [f"{sheet.path}: no table of numbers below a line of names `name [unit]`. Name another file."]
    cells = [(i, j, text) for i, row in enumerate(sheet.rows) for j, text in enumerate(row) if number(text) is None]
    told = [f"{sheet.place(i, j)}: `{text}` found, a number expected. Correct it." for i, j, text in cells[:SHOWN]]
    return told + more(sheet.path, len(cells), "cells do not hold a number")


def number(text: str) -> float | None:
    """Number that a cell holds, or None."""
    try:
        return float(text)
    except ValueError:
        return None


def finite(text: str) -> float | None:
    """The finite number that a text holds, or None."""
    value = number(text)
    return value if value is not None and math.isfinite(value) else None


def write_json(file: TextIO, data: Any) -> None:
    """JSON for people and programs: indented, in the order given."""
    json.dump(data, file, indent=2)
    file.write("\n")


def facts_beside(path: Path) -> dict[str, Any]:
    """Content of the JSON file beside a file, which may be itself; empty if there is none that can be read."""
    try:
        data = json.loads(read_bytes(path.with_suffix(".json")).decode("utf-8"))
    except (OSError, ValueError):
        return {}
    return data if isinstance(data, dict) else {}


def write_with_facts(
    path: Path, columns: Columns, units: Mapping[str, str], about: Callable[[str], Mapping[str, Any]]
) -> None:
    """Write a table and beside it, sealed as JSON, what is told about a table with its hash.

    Both are written before one of them takes its place: if that fails, what was there before is still whole.
    """
    with prepare_file(path, lambda file: write_columns(file, columns, units)) as table:
        content = seal(about(sha256(table)))
        with prepare_file(path.with_suffix(".json"), lambda file: write_json(file, content)) as beside:
            rename(table, path)
            rename(beside, path.with_suffix(".json"))


def refuse_export(file: Path, *endings: str) -> None:
    """Raise an InputError for a file whose ending is no format of an export."""
    if file.suffix not in endings:
        known = " or ".join(f"`{ending}`" for ending in endings)
        raise InputError([f"--export: `{file}` found, a file expected that ends in {known}. Correct it."])


def state(path: Path) -> tuple[int, int, int]:
    """What is another number when a file has changed: its time, size and inode."""
    about = path.stat()
    return about.st_mtime_ns, about.st_size, about.st_ino


def remember(read: Callable[..., T]) -> Callable[..., T]:
    """Wrap a function of a file, and of more, so that it reads the file again only if that has changed."""
    known = lru_cache(maxsize=256)(lambda path, _, *more: read(path, *more))
    return wraps(read)(lambda path, *more: known(path.resolve(), state(path), *more))


def sha256(path: Path) -> str:
    """Hash of a file's content."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


# What is a file that can be read to its end, what a file may be called, and who may read a new one.


def read_bytes(path: Path, most: int = LARGEST) -> bytes:
    """Content of a file; an OSError refuses what is not a file, before it is opened, and what is too large.

    A pipe or a device may give bytes for ever, or none.
    """
    try:
        about = path.stat()
    except ValueError:  # a NUL character in its name
        raise OSError(errno.EINVAL, "a file cannot have this name", str(path)) from None
    if not stat.S_ISREG(about.st_mode):
        found = KINDS.get(stat.S_IFMT(about.st_mode), "something else")
        raise OSError(errno.EINVAL, f"it is {found}, a file is expected", str(path))
    with os.fdopen(os.open(path, UNBLOCKED), "rb") as file:  # files of the system may have more than their size
        content = (file.read(most + 1) if about.st_size <= most else None) or b""
    if max(len(content), about.st_size) > most:
        raise OSError(errno.EINVAL, f"it has more than {most / 1e6:.9g} MB, which is too large", str(path))
    return content


def refuse_unwritable(*files: Path, folders: Iterable[Path] = ()) -> None:
    """Raise an InputError that tells which files and folders cannot be written, before anything is done for them."""
    reasons: dict[str, Path] = {}  # each is told once
    for path, is_folder in (*((file, False) for file in files), *((folder, True) for folder in folders)):
        reasons.setdefault(unwritable(path, is_folder), path)
    if problems := [f"`{p}` cannot be written: {why}. Choose another place." for why, p in reasons.items() if why]:
        raise InputError(problems)


def unwritable(path: Path, is_folder: bool = False) -> str:
    """Why nothing can be written to a file, or into a folder, that may have to be made; or nothing.

    Rights do not tell, so a file without a name is made where the new ones would be.
    """
    place = path if is_folder else path.parent
    try:
        if not is_folder and kind(path) not in ("", FILE):
            return f"it is {kind(path)}, a file is expected"
        missing = [*takewhile(lambda folder: not kind(folder), (place, *place.parents))]
        place = missing[-1].parent if missing else place
        if kind(place) != FOLDER:
            return f"`{place}` is {kind(place)}, a folder is expected"
        if any(len(os.fsencode(folder.name)) > NAME_MAX for folder in (path, *missing)):
            return f"a name in it is longer than {NAME_MAX} bytes"
        with tempfile.TemporaryFile(dir=place):
            return ""
    except OSError as error:
        return f"no new file can be made in `{place}` ({error.strerror})"


def kind(path: Path) -> str:
    """What is at a path: a file, a folder, or something else; nothing if there is nothing."""
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return "a broken link" if path.is_symlink() else ""
    return FILE if stat.S_ISREG(mode) else KINDS.get(stat.S_IFMT(mode), "something else")


def unfit(name: str, foreign: frozenset[str] = FOREIGN) -> str:
    """Why a file cannot have a name on every system, or nothing."""
    if not name.isprintable() or foreign.intersection(name):
        return "has characters that some systems do not allow in file names"
    if DEVICE.fullmatch(name) or name.endswith((".", " ")) or name.startswith(("-", " ")):
        return "has another meaning to commands or to some systems"
    return f"is longer than {LONGEST_NAME} bytes" if len(name.encode("utf-8", "replace")) > LONGEST_NAME else ""


def mask() -> int:
    """Rights that new files do not get; temporary files do not respect them by themselves."""
    os.umask(found := os.umask(0))
    return found


# Facts as JSON with a checksum.


SEAL = "checksum"  # of a file of JSON


def fingerprint(facts: Any) -> str:
    """Hash of facts of JSON, whatever the order of names in them."""
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


def seal(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Facts as JSON, with their hash."""
    plain = json.loads(json.dumps(facts))
    return {**plain, SEAL: fingerprint(plain)}


def is_sealed(facts: Mapping[str, Any]) -> bool:
    """Whether facts are those that were sealed."""
    return facts.get(SEAL) == fingerprint({name: value for name, value in facts.items() if name != SEAL})
