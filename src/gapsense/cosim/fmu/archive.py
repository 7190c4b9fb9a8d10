"""FMU files as archives of strangers: what a reader must not trust is refused before anything of it is read."""

from __future__ import annotations

import re
import stat
import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path, PurePosixPath
from xml.parsers import expat

DESCRIPTION = "modelDescription.xml"
MOST_MEMBERS = 50_000
LARGEST_CONTENT = 4 * 10**9  # bytes, unpacked
LARGEST_DESCRIPTION = 64 * 10**6  # bytes
HIGHEST_RATIO = 100  # of unpacked to packed size; FMUs have 2 to 10
SMALL_CONTENT = 100 * 10**6  # bytes: up to here any ratio is harmless
ENCODINGS = (None, "utf-8", "us-ascii", "ascii", "iso-8859-1", "utf-16")
ENCRYPTED = 0x1  # bit of a member's flags
KINDS = (0, stat.S_IFREG, stat.S_IFDIR)  # of a member; 0 where the packing system has none
METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
LONGEST_NAME = 500  # characters
BLOCK = 2**20  # bytes that are read at once
SHOWN = 60  # characters of a stranger's text in a message
UNTRUSTED = "Do not use this file unless you trust its source; ask there for a clean one."


class UnusableError(ValueError):
    """Why an FMU cannot be used, in sentences, the last of which says what to do."""


def printable(text: str) -> str:
    """A stranger's text without control characters."""
    return "".join(c if c.isprintable() else "?" for c in text)


def sanitise(text: str) -> str:
    """Make a stranger's text fit for a message: short, without control characters."""
    plain = printable(text)
    return plain if len(plain) <= SHOWN else f"{plain[:SHOWN]}..."


def read_description(path: Path) -> tuple[bytes, list[str]]:
    """Model description of an FMU file and the names of its members, after the archive was looked through."""
    try:
        with zipfile.ZipFile(path) as archive:
            members = refuse_dangerous(archive.infolist(), path.stat().st_size)
            refuse_damaged(archive)
            if DESCRIPTION not in members:
                raise UnusableError(f"the archive has no {DESCRIPTION}, so it is not an FMU. Export it again.")
            if archive.getinfo(DESCRIPTION).file_size > LARGEST_DESCRIPTION:
                most = LARGEST_DESCRIPTION // 10**6
                raise UnusableError(f"its {DESCRIPTION} has more than {most} MB. Export it with fewer variables.")
            data = archive.read(DESCRIPTION)
    except UnusableError:
        raise
    except Exception as error:  # zipfile raises many kinds; each means that the file is damaged
        raise UnusableError(f"not a readable FMU: {' '.join(str(error).split())}. Export or copy it again.") from error
    refuse_document_type(data)
    return data, members


def refuse_dangerous(infos: list[zipfile.ZipInfo], packed: int) -> list[str]:
    """Names of the members, unless unpacking them could reach outside a folder or fill the disk."""
    content = sum(info.file_size for info in infos)
    if len(infos) > MOST_MEMBERS:
        raise UnusableError(f"it holds {len(infos)} files; at most {MOST_MEMBERS} are unpacked. {UNTRUSTED}")
    if content > LARGEST_CONTENT:
        most = LARGEST_CONTENT // 10**9
        raise UnusableError(f"unpacked it has {content / 1e9:.1f} GB; at most {most} GB are unpacked. {UNTRUSTED}")
    if content > SMALL_CONTENT and content > HIGHEST_RATIO * packed:
        ratio = f"it unpacks to {content / 1e6:.0f} MB, {content / packed:.0f} times its size"
        raise UnusableError(f"{ratio}; at most {HIGHEST_RATIO} times are unpacked. {UNTRUSTED}")
    for info in infos:
        if problem := member_problem(info):
            raise UnusableError(f"its member `{sanitise(info.orig_filename)}` {problem}. {UNTRUSTED}")
    refuse_collisions(infos)
    return [info.filename for info in infos]


def member_problem(info: zipfile.ZipInfo) -> str | None:
    """Why a member of an archive is not unpacked, or None."""
    name = info.orig_filename
    if len(name) > LONGEST_NAME:
        return f"has a name of more than {LONGEST_NAME} characters"
    if "\\" in name or ":" in name or not name.isprintable() or not name:
        return "has a name with a backslash, a colon or a control character"
    if name.startswith("/") or ".." in PurePosixPath(name).parts:
        return "would be unpacked outside its folder"
    if stat.S_IFMT(info.external_attr >> 16) not in KINDS:
        return "is a link or a device, not a file"
    if info.flag_bits & ENCRYPTED:
        return "is encrypted"
    return None if info.compress_type in METHODS else "is not packed by `deflate`, as FMI requires"


def refuse_damaged(archive: zipfile.ZipFile) -> None:
    """Raise if the content of a member does not have its checksum."""
    for info in archive.infolist():
        try:
            with archive.open(info) as member:
                while member.read(BLOCK):
                    pass
        except (zipfile.BadZipFile, zlib.error, EOFError) as error:
            raise UnusableError(
                f"its member `{sanitise(info.filename)}` is damaged. Copy or export it again."
            ) from error


def refuse_collisions(infos: Iterable[zipfile.ZipInfo]) -> None:
    """Raise if two members that differ would be unpacked to one file, or a file stands where another has its folder."""
    files: dict[str, tuple[int, int]] = {}
    inside: set[str] = set()
    for info in infos:
        name = info.filename
        inside.update(str(parent) for parent in PurePosixPath(name).parents)
        content = (info.CRC, info.file_size)
        if not name.endswith("/") and files.setdefault(str(PurePosixPath(name)), content) != content:
            raise UnusableError(f"its member `{sanitise(name)}` is there twice, with different content. {UNTRUSTED}")
    for name in sorted(inside & files.keys()):
        raise UnusableError(f"its member `{sanitise(name)}` is a file and a folder. {UNTRUSTED}")


def refuse_document_type(data: bytes, name: str = DESCRIPTION) -> None:
    """Raise for XML with a document type, the only place where entities are declared, or in an odd encoding."""
    name = sanitise(name)

    def document_type(*_: object) -> None:
        raise UnusableError(f"its {name} declares a document type, which it must not. {UNTRUSTED}")

    def declaration(_: str, encoding: str | None, __: int) -> None:
        if (encoding and encoding.lower()) not in ENCODINGS:
            found = f"its {name} is encoded as `{sanitise(encoding or '')}`, UTF-8 is expected"
            raise UnusableError(f"{found}. Export it again.")

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler, parser.XmlDeclHandler = document_type, declaration
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise UnusableError(f"its {name} is not XML: {error}. Export it again.") from error
    except (LookupError, ValueError) as error:
        if isinstance(error, UnusableError):
            raise
        raise UnusableError(f"its {name} cannot be read: {error}. Export it again.") from error


def refuse_identifier(identifier: str) -> None:
    """Raise for a model identifier that is more than the name of a file: it becomes that of the library loaded."""
    if not re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.-]*", identifier):
        found = f"its model identifier is `{sanitise(identifier)}`, letters, digits and `_` expected"
        raise UnusableError(f"{found}. {UNTRUSTED}")
