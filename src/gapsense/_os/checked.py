"""JSON with checksums: files, and lines of which each has its own.

What a kill or a disk did to a line is seen, and costs that line only.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import IO, Any
from zlib import crc32

from gapsense._os.files import SHOWN, naming

Entry = dict[str, Any]
LINE = re.compile(rb'(\{.*), "crc32": "([0-9a-f]{8})"\}\n')
BLOCK = 2**16  # bytes
SEAL = "checksum"  # of a file of JSON


def fingerprint(facts: Any) -> str:
    """Hash of facts of JSON, whatever the order of names in them."""
    return sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


def sealed(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Facts as JSON has them, with their hash."""
    plain = json.loads(json.dumps(facts))
    return {**plain, SEAL: fingerprint(plain)}


def is_sealed(facts: Mapping[str, Any]) -> bool:
    """Whether facts are those that were sealed."""
    return facts.get(SEAL) == fingerprint({name: value for name, value in facts.items() if name != SEAL})


def written(entry: Mapping[str, Any]) -> bytes:
    """Line of an entry."""
    text = json.dumps(entry)[:-1].encode()
    return b'%b, "crc32": "%08x"}\n' % (text, crc32(text))


def parsed(line: bytes) -> Entry | None:
    """Entry of a line; None if it is another one than was written."""
    found = LINE.fullmatch(line)
    if not found or crc32(found[1]) != int(found[2], 16):
        return None
    entry: Entry = json.loads(found[1] + b"}")
    return entry


def read_lines(file: Path) -> tuple[list[Entry], list[int]]:
    """Entries of a file, and the numbers of its lines that are damaged; nothing if there is no file.

    A last line that a kill has torn is neither.
    """
    entries: list[Entry] = []
    damaged: list[int] = []
    with suppress(FileNotFoundError), file.open("rb") as opened:
        for number, line in enumerate(opened, 1):
            if entry := parsed(line.removesuffix(b"\n") + b"\n"):
                entries.append(entry)
            elif line.endswith(b"\n"):
                damaged.append(number)
    return entries, damaged


def append_lines(file: Path, entries: Iterable[Mapping[str, Any]]) -> int:
    """Add lines, see them on the disk, and tell the size of the file; a torn line at its end goes."""
    with naming(file), file.open("ab+") as opened:
        cut_torn(opened)
        opened.write(b"".join(map(written, entries)))
        opened.flush()
        os.fsync(opened.fileno())
        return opened.tell()


def cut_torn(file: IO[bytes]) -> None:
    """Let a file end with the end of a line; a last one that is whole but for its end is kept."""
    begin = size = file.seek(0, os.SEEK_END)
    found = 0
    while begin and not found:
        end, begin = begin, max(0, begin - BLOCK)
        file.seek(begin)
        found = file.read(end - begin).rfind(b"\n") + 1
    file.seek(begin + found)
    if begin + found < size and parsed(file.read() + b"\n"):
        file.write(b"\n")
    else:
        file.truncate(begin + found)


def damage(file: Path, numbers: list[int]) -> str:
    """Where a file is damaged, as messages say it."""
    first = ", ".join(map(str, numbers[:SHOWN]))
    more = f" and {len(numbers) - SHOWN} more" if len(numbers) > SHOWN else ""
    return f"{file}, line {first}{more}: no checksum, or a wrong one"
