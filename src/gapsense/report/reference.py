"""The reference of scenario and study files, as pages and as JSON schemas; both are made from the tables of keys.

`python -m gapsense.report.reference docs` writes them again.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gapsense._os.files import write_atomically
from gapsense.cosim.result.metrics import KINDS
from gapsense.cosim.scenario.keys import FILE, VARIANT
from gapsense.cosim.scenario.records import ACTIONS
from gapsense.many.keys import STUDY
from gapsense.parameters import PARAMETER_SET, VALUES
from gapsense.tables import TABLES, Key, Section

BEGIN, END = "<!-- keys: made by gapsense.report.reference -->\n", "<!-- end of keys -->\n"
PAGE, SCHEMA = "scenario-file.md", "scenario.schema.json"
STUDY_PAGE, STUDY_SCHEMA = "campaigns.md", "study.schema.json"
DRAFT = "http://json-schema.org/draft-07/schema#"
USES = {
    "required": "needed: signal, parameter or number",
    "optional": "may be given",
    "none": "none",
    "axis": "needed: the signal over which the curve is drawn",
}


# JSON schema ----------------------------------------------------------------------------------------------------------


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
    made = {**key.kind.schema, "description": key.what}
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


# Page -----------------------------------------------------------------------------------------------------------------


def rewritten(page: str, made: str) -> str:
    """The page with its tables of keys made anew; what is written by hand stays."""
    head, _, rest = page.partition(BEGIN)
    return f"{head}{BEGIN}\n{made}\n{END}{rest.partition(END)[2]}"


def study_keys() -> str:
    """The keys of a study file; its examples are written by hand."""
    chapters = [f"### {heading(section)}\n\n{section.what}\n\n{table(section)}" for section in with_keys(STUDY)]
    return "\n".join(chapters)


def heading(section: Section) -> str:
    """How a kind of table is called."""
    return f"`{section.header}`" if section.header else "At the top"


def keys() -> str:
    """A chapter for each kind of table, one for the actions of events, and one for the kinds of metrics."""
    return "\n".join([*(chapter(section) for section in with_keys(FILE)), actions(), metrics(), parameter_set()])


def with_keys(section: Section) -> Iterator[Section]:
    """A kind of table and those of the tables in it, as far as they have keys of their own."""
    if own(section):
        yield section
    for key in (*section.keys, *filter(None, [section.free])):
        if key.section:
            yield from with_keys(key.section)


def own(section: Section) -> list[Key]:
    """Keys that are no tables, or need not be any."""
    keys = (*section.keys, *filter(None, [section.free]))
    return [key for key in keys if key.section is None or key.is_dotted]


def chapter(section: Section) -> str:
    """What a kind of table is for, its keys, an example."""
    return f"## {heading(section)}\n\n{section.what}\n\n{table(section)}\n{block(section)}"


def table(*sections: Section) -> str:
    """Keys of kinds of tables."""
    rows = [row(key) for section in sections for key in own(section)]
    return "\n".join(["| key | value | without it | what |", "| --- | --- | --- | --- |", *rows, ""])


def block(*sections: Section) -> str:
    """Examples of all their keys, as a file has them."""
    parts = [
        [section.before, section.at or section.header, *(line(key) for key in own(section) if not key.is_other)]
        for section in sections
    ]
    text = "\n\n".join("\n".join(filter(None, part)) for part in parts)
    return f"```toml\n{text}\n```\n"


def parameter_set() -> str:
    """The chapter of the other kind of file."""
    both = (PARAMETER_SET, VALUES)
    return f"## Parameter sets\n\n{VALUES.what}\n\n{table(*both)}\n<!-- file: my_valve/valve.toml -->\n{block(*both)}"


def row(key: Key) -> str:
    """Row of a key in its table."""
    value = " or ".join(f"`{choice}`" for choice in key.choices) or key.kind.name
    if len(key.choices) > 4:
        value = "one of those below"
    return f"| `{key.name}` | {value} | {without(key)} | {key.what} |"


def without(key: Key) -> str:
    """What holds where a key is left out."""
    if key.required:
        return "must be there"
    if key.name.startswith("<") or key.default is None:
        return key.otherwise or "-"
    return f"`{json.dumps(key.default)}`"


def line(key: Key) -> str:
    """Example of a key, as a file has it."""
    return key.example if key.name.startswith("<") else f"{key.name} = {key.example}"


def actions() -> str:
    """Actions of events."""
    rows = [
        f"| `{name}` | the target {act.what} | {act.value or 'none'} | {act.over or 'no'} | "
        f"{'inputs, parameters' if act.on_parameter else 'inputs'} | {'Real' if act.only_real else 'but text'} |"
        for name, act in ACTIONS.items()
    ]
    head = ["| action | what | `value` | `over` | of | types |", "| --- | --- | --- | --- | --- | --- |"]
    return "\n".join(["## Actions of events\n", *head, *rows, ""])


def metrics() -> str:
    """Kinds of metrics."""
    rows = [f"| `{name}` | {kind.what} | {USES[kind.reference]} |" for name, kind in KINDS.items()]
    return "\n".join(["## Kinds of metrics\n", "| kind | what | reference |", "| --- | --- | --- |", *rows, ""])


def write(folder: Path) -> None:
    """Write both again."""
    pages = {PAGE: keys(), STUDY_PAGE: study_keys()}
    texts = {name: rewritten((folder / name).read_text(encoding="utf-8"), made) for name, made in pages.items()}
    schemas = {SCHEMA: schema(), STUDY_SCHEMA: study_schema()}
    texts |= {name: f"{json.dumps(made, indent=2)}\n" for name, made in schemas.items()}
    for name, text in texts.items():
        write_atomically(folder / name, lambda file, text=text: print(text, end="", file=file))  # type: ignore[misc]


if __name__ == "__main__":
    write(Path(sys.argv[1]))
