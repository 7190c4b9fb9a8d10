"""JSON schemas of scenario and study files, made from the tables of keys, as are their pages: `docs/reference.py`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from gapsense.cosim.scenario.keys import FILE, VARIANT
from gapsense.many.keys import STUDY
from gapsense.tables import TABLES, Key, Section

DRAFT = "http://json-schema.org/draft-07/schema#"


def schema() -> dict[str, Any]:
    """JSON schema of a scenario file, as editors take it."""
    own = {key.name: of_value(key) for key in VARIANT.keys}
    laid_over = {key.name: of_key(FILE, key, True) for key in FILE.keys if key.name != "variants"}
    variant = {"type": "object", "properties": {**laid_over, **own}, "additionalProperties": False}
    return {
        "$schema": DRAFT,
        "title": "Scenario of Gapsense",
        **of_section(FILE, False),
        "definitions": {"variant": variant, **dict(definitions(FILE))},
    }


def study_schema() -> dict[str, Any]:
    """JSON schema of a study file."""
    own = of_section(STUDY, False)
    return {"$schema": DRAFT, "title": "Study of Gapsense", **own, "definitions": dict(definitions(STUDY))}


def of_section(section: Section, is_partial: bool) -> dict[str, Any]:
    """Schema of a table; of a part of one nothing is required."""
    if section is VARIANT:
        return {"$ref": "#/definitions/variant"}
    made: dict[str, Any] = {
        "type": "object",
        "description": section.what,
        "properties": {key.name: of_key(section, key, is_partial) for key in section.keys},
        "additionalProperties": of_key(section, section.free, is_partial) if section.free else False,
    }
    if section.free and section.free.pattern:
        made |= {"propertyNames": {"pattern": f"^{section.free.pattern}$"}, "minProperties": 1}
    required = [key.name for key in section.keys if key.required and not is_partial]
    return {**made, "required": required} if required else made


def of_key(section: Section, key: Key, is_partial: bool) -> dict[str, Any]:
    """Schema of a value."""
    if key.is_dotted:
        return {"$ref": f"#/definitions/{name_of(section)}"}
    if key.section and key.kind is TABLES:
        return {"type": "array", "items": of_section(key.section, False)}
    return of_section(key.section, is_partial) if key.section else of_value(key)


def of_value(key: Key) -> dict[str, Any]:
    """Schema of a value that is no table."""
    made = {**key.kind.schema, "description": f"{key.what} [{key.unit}]" if key.unit else key.what}
    if key.choices:
        made["enum"] = list(key.choices)
    return made if key.default is None else {**made, "default": key.default}


def definitions(section: Section) -> Iterator[tuple[str, Any]]:
    """Schemas of values by dotted name, which may be written as tables too."""
    for key in (*section.keys, *filter(None, [section.free])):
        if key.is_dotted:
            name = name_of(section)
            table = {"type": "object", "additionalProperties": {"$ref": f"#/definitions/{name}"}}
            own = [of_section(key.section, False)] if key.section else []
            yield name, {"anyOf": [of_value(key), *own, table], "description": key.what}
        elif key.section:
            yield from definitions(key.section)


def name_of(section: Section) -> str:
    """The last word of its header, as name of a definition."""
    return section.header.strip("[]").rpartition(".")[2]
