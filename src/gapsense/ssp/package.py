"""System structure packages as archives of strangers: looked through before anything is read, and read in part."""

from __future__ import annotations

import posixpath
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit
from xml.etree.ElementTree import Element, fromstring

from gapsense.cosim.fmu.archive import UnusableError, refuse_damaged, refuse_dangerous, refuse_document_type, sanitise
from gapsense.problems import InputError
from gapsense.ssp.words import DESCRIPTION, SCHEMAS

SHOWN = 5  # violations that are told
LARGEST = 64 * 10**6  # bytes of a document
UNREADABLE = (zipfile.BadZipFile, zipfile.LargeZipFile, zlib.error, NotImplementedError, EOFError, UnicodeError)
CHUNK = 2**20  # bytes that are unpacked at once


class Package:
    """An open package whose archive was looked through."""

    def __init__(self, path: Path, archive: zipfile.ZipFile, names: list[str]) -> None:
        self.path, self.archive, self.names = path, archive, frozenset(names)

    def document(self, name: str, kind: str) -> tuple[Element, list[str]]:
        """A document of SSP, and what in it is not as the schema of its kind says; UnusableError if it is no XML."""
        info = self.archive.getinfo(name)
        if info.file_size > LARGEST:
            raise UnusableError(f"`{sanitise(name)}` has more than {LARGEST // 10**6} MB. Export it with less in it.")
        content = self.archive.read(info)
        refuse_document_type(content, name)
        return fromstring(content), violations(content, kind)

    def copy(self, name: str, to: Path) -> None:
        """Unpack one member to a file."""
        with self.archive.open(name) as source, to.open("wb") as target:
            while block := source.read(CHUNK):
                target.write(block)

    def member(self, source: str) -> str:
        """Name of the member that a URI relative to the description means; UnusableError if it means none."""
        parts = urlsplit(source)
        if parts.scheme or parts.netloc or source.startswith("/"):
            raise UnusableError(f"`{sanitise(source)}` is outside the package. Put it in.")
        name = posixpath.normpath(unquote(parts.path))
        if name not in self.names:
            raise UnusableError(f"there is no `{sanitise(source)}` in the package. Put it in, or correct the source.")
        return name


@contextmanager
def open_package(path: Path) -> Iterator[Package]:
    """Open a package once its archive was looked through; an InputError says why it is refused."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = refuse_dangerous(archive.infolist(), path.stat().st_size)
            refuse_damaged(archive)
            if DESCRIPTION not in names:
                raise UnusableError(f"the archive has no {DESCRIPTION}, so it is not an SSP. Export it again.")
            yield Package(path, archive, names)
    except UnusableError as error:
        raise InputError([f"{path}: {error}"]) from error
    except UNREADABLE as error:
        raise InputError([f"{path}: not a readable package: {error}. Export or copy it again."]) from error


# Hold documents of SSP against its schemas, those of version 1.0 that fmpy brings.


def violations(content: bytes, kind: str) -> list[str]:
    """What in a document, XML without a document type, is not as the schema says, one sentence each.

    The `kind` is `ssd`, `ssv` or `ssm`.
    """
    from lxml import etree

    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    schema = load_schema(kind)
    try:
        if schema.validate(etree.fromstring(content, parser)):
            return []
    except etree.XMLSyntaxError as error:  # limits that others do not have
        return [str(error)]
    found = [f"line {error.line}: {error.message}" for error in schema.error_log]
    return found[:SHOWN] + ([f"{len(found) - SHOWN} more violations."] if len(found) > SHOWN else [])


@cache
def load_schema(kind: str) -> Any:
    """Schema of a kind of document."""
    from lxml import etree

    package = find_spec("fmpy")
    folder = Path(str(package and package.origin)).parent / "ssp" / "schema"
    return etree.XMLSchema(file=str(folder / SCHEMAS[kind]))
