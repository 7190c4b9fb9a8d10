"""Lines of JSON with a checksum each: what a kill or a disk did to a line is seen, and costs that line only."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any
from zlib import crc32

from gapsense.files import SHOWN, naming

Entry = dict[str, Any]
LINE = re.compile(rb'(\{.*), "crc32": "([0-9a-f]{8})"\}\n')
BLOCK = 2**16  # bytes


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


def read_lines(file: Path) -> Iterator[tuple[int, Entry | None]]:
    """Number and entry of each line, without a last one that has no end: it was torn by a kill."""
    with suppress(FileNotFoundError), file.open("rb") as opened:
        for number, line in enumerate(opened, 1):
            if line.endswith(b"\n"):
                yield number, parsed(line)


def append_lines(file: Path, entries: Iterable[Mapping[str, Any]]) -> int:
    """Add lines, see them on the disk, and tell the size of the file; a torn line at its end goes."""
    with naming(file), file.open("ab+") as opened:
        cut_torn(opened)
        opened.write(b"".join(map(written, entries)))
        opened.flush()
        os.fsync(opened.fileno())
        return opened.tell()


def cut_torn(file: IO[bytes]) -> None:
    """Let a file end with the end of a line."""
    end = file.seek(0, os.SEEK_END)
    while end:
        begin = file.seek(max(0, end - BLOCK))
        if found := file.read(end - begin).rfind(b"\n") + 1:
            end = begin + found
            break
        end = begin
    file.truncate(end)


def damage(file: Path, numbers: list[int]) -> str:
    """Where a file is damaged, as messages say it."""
    first = ", ".join(map(str, numbers[:SHOWN]))
    more = f" and {len(numbers) - SHOWN} more" if len(numbers) > SHOWN else ""
    return f"{file}, line {first}{more}: no checksum, or a wrong one"
