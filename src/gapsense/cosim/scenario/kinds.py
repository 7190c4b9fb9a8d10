"""What a file or folder is that was given where something else is expected, and which command is right for it."""

from __future__ import annotations

import json
from pathlib import Path
from shlex import quote

from gapsense._os.plain_files import read_bytes
from gapsense.tables import read_toml

CAMPAIGN_FILE = "campaign.sqlite"
SCENARIO, STUDY, RESULT, RECORD, REPORTED, CAMPAIGN = "scenario", "study", "result", "record", "reported", "campaign"
TAKEN = {  # kinds that are right, by what is expected
    SCENARIO: ("scenario",),
    STUDY: ("study",),
    RESULT: ("result", "table"),
    RECORD: ("result", "table"),
    REPORTED: ("result", "table", "sweep", "campaign"),
    CAMPAIGN: ("campaign",),
}
CAMPAIGNS = "gapsense campaign show {%s}` or `gapsense report {%s}"
WORDS = {  # what it is, and what to do
    "campaign": ("the folder of a campaign's result", f"Look at it with `{CAMPAIGNS % ('path', 'path')}`"),
    "store": ("a file of a campaign's result", f"Name its folder: `{CAMPAIGNS % ('folder', 'folder')}`"),
    "ledger": ("what a sweep continues from", "Name the table beside it: `gapsense report {table}`"),
    "sweep": ("the table of a sweep", "Look at it with `gapsense report {path}`"),
    "sidecar": ("the side-car of a result", "Name the CSV file beside it, `{table}`"),
    "result": ("the result of a run", "Look at it with `gapsense figure {path}` or `gapsense report {path}`"),
    "table": ("a CSV file", "If it is a record of measurements, try `gapsense inspect {path}`"),
    "fmu": ("an FMU", "Look at its ports with `gapsense info {path}`"),
    "checkpoint": ("the checkpoint of a run", "`gapsense run SCENARIO --resume` continues from it"),
    "study": ("the study of a campaign", "Run it with `gapsense campaign {path}`"),
    "scenario": ("a scenario", "Run it with `gapsense run {path}`"),
    "picture": ("a picture or a page", "Name what it was made of"),
    "parquet": ("a Parquet file", "Name a CSV file, or the folder of a campaign"),
    "json": ("a JSON file", "Name a CSV file, or the folder of a campaign"),
}
ENDINGS = {
    ".fmu": "fmu",
    ".checkpoint": "checkpoint",
    ".parquet": "parquet",
    **dict.fromkeys((".png", ".pdf", ".svg", ".html"), "picture"),
}


def other_kind(path: Path, expected: str) -> str:
    """Sentence on what is there if that is surely not what is expected, with the command that is right for it."""
    kind = kind_of(path)
    if not kind or kind in TAKEN[expected]:
        return ""
    what, remedy = WORDS[kind]
    places = {"path": path, "folder": path.parent, "table": path.with_suffix(".csv")}
    named = {name: quote(str(place)) for name, place in places.items()}  # commands are to be copied
    return f"`{path}`: it is {what}. {remedy.format(**named)}."


def kind_of(path: Path) -> str:
    """Kind of a file or folder, by its name and by what stands beside it; nothing if it may be anything."""
    ending = path.suffix.lower()
    if path.is_dir():
        return "campaign" if (path / CAMPAIGN_FILE).is_file() else ""
    if not path.is_file():
        return ""
    if ending == ".sqlite":
        return "store" if path.name == CAMPAIGN_FILE else "ledger"
    if ending == ".csv":
        return {"result": "result", "sweep": "sweep"}.get(format_of(path.with_suffix(".json")), "table")
    if ending == ".json":
        return {"result": "sidecar", "sweep": "sidecar", "campaign": "json"}.get(format_of(path), "json")
    if ending == ".toml":
        data = read_toml(path, []) or {}
        return "scenario" if "components" in data else "study" if isinstance(data.get("scenario"), str) else ""
    return ENDINGS.get(ending, "")


def format_of(file: Path) -> str:
    """What a JSON file of ours is of: a result, a sweep, a campaign; nothing for another file."""
    try:
        data = json.loads(read_bytes(file))
    except (OSError, ValueError):
        return ""
    words = str(data.get("format", "") if isinstance(data, dict) else "").split()
    return words[1] if len(words) == 3 and words[0] == "gapsense" else ""
