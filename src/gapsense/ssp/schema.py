"""Hold documents of SSP against its schemas, those of version 1.0 that fmpy brings."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from gapsense.ssp.words import SCHEMAS

SHOWN = 5  # violations that are told


def violations(content: bytes, kind: str) -> list[str]:
    """What in a document is not as the schema says, one sentence each.

    Parameters
    ----------
    content : bytes
        XML without a document type.
    kind : str
        `ssd`, `ssv` or `ssm`.
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
