"""The JSON file beside the CSV of a result: that both are of one run, and of which scenario they are."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

from gapsense._os.files import SEAL, facts_beside, is_sealed, read_bytes
from gapsense.cosim.scenario.read import RESULT, missing, other_kind, scenario_file
from gapsense.problems import InputError

FORMAT = "gapsense result 3"
ELSEWHERE = "choose another place with `--out`"
PLAIN = re.compile(r"[\w.+=-]+")
LONGEST = 80  # characters of settings in the name of a file
# Of files, so that they are no folders.
ENDINGS = (".json", ".png", ".pdf", ".svg", ".html", ".toml", ".txt", ".xlsx", ".parquet", ".sqlite")
SIGNALS = re.compile(rb'"time( \[s\])?","?[A-Za-z_]\w*\.')  # of a result
LOOKED_AT = 1000  # bytes
OLDER = "gapsense result 2"  # which has no checksum of its own
OLD = "gapsense result 1"  # which tells no hash


def read_whole(path: Path) -> tuple[dict[str, Any], bytes]:
    """Side-car and CSV of a result; an InputError says why they cannot be believed."""
    if wrong := other_kind(path, RESULT):
        raise InputError([wrong])
    sidecar = path.with_suffix(".json")
    content, data = read_bytes(path), read_sidecar(path)
    if data is None and not SIGNALS.match(content[:LOOKED_AT]):
        found = f"{sidecar.name} beside it is missing, damaged or not a side-car"
        found = f"{found}, and no column is a signal `component.variable`"
        record = f"If it is a record of measurements, try `gapsense inspect {path}`"
        raise InputError([f"{path}: {found}, so it is not the result of a run. {record}."])
    if data is None:
        raise InputError([f"{path}: {sidecar.name} beside it is missing, damaged or not a side-car. Run again."])
    if data["format"] == OLD:
        raise InputError([f"{path}: an old result, whose side-car lacks the hash of the CSV file. Run again."])
    found, expected = sha256(content).hexdigest(), data.get("sha256")
    if found != expected:
        said = f"has the SHA-256 {found}, {sidecar.name} expects {expected}"
        raise InputError(
            [f"{path}: {said}. One of them belongs to another run, or was edited. Run again, or restore both."]
        )
    return data, content


def is_whole(path: Path) -> bool:
    """Whether a result is there as it was written."""
    try:
        read_whole(path)
    except (OSError, InputError):
        return False
    return True


def read_sidecar(path: Path) -> dict[str, Any] | None:
    """Side-car of the result `path` (CSV), or None if there is none that is whole; the CSV is not looked at."""
    data = facts_beside(path)
    if data.get("format") not in (FORMAT, OLDER, OLD):
        return None
    return data if is_sealed(data) or (data["format"] != FORMAT and SEAL not in data) else None


def result_file(folder: Path, scenario: str | Path, variant: str | None = None, settings: Sequence[str] = ()) -> Path:
    """CSV for the result of a scenario in `folder`, or `folder` itself if that is called so.

    It has the name of the scenario's folder, and another scenario may have the same: an InputError if that is there,
    or something else.
    """
    file, own = own_file(folder, scenario, variant, ".csv", settings)
    if folder.suffix == ".csv" and not folder.is_dir():
        file, own = folder, relative(str(scenario_file(scenario).resolve()), folder.parent)
    elif folder.suffix.lower() in ENDINGS and not folder.is_dir():
        raise InputError([f"--out: `{folder}` found, a folder or a file that ends in `.csv` expected. Correct it."])
    data = read_sidecar(file)
    if data is None and (file.exists() or file.with_suffix(".json").exists()):
        raise InputError([f"{file}: this file exists and is not the result of a run. Remove it, or {ELSEWHERE}."])
    refuse_other(file, data["run"].get("source", own) if data else own, own)
    return file


def own_file(
    folder: Path, scenario: str | Path, variant: str | None, ending: str, settings: Sequence[str] = ()
) -> tuple[Path, str]:
    """File in `folder` that has the name of the scenario's folder, and the path of the scenario from there.

    Settings that were laid over the scenario are part of the name: they make another result.
    """
    source = scenario_file(scenario)
    if not source.is_file():
        raise InputError([missing(source)])
    source = source.resolve()
    name = "_".join(filter(None, (source.parent.name, variant, *name_parts(settings))))
    return folder / f"{name}{ending}", relative(str(source), folder)


def name_parts(settings: Sequence[str]) -> list[str]:
    """Make parts of a file name from settings, or one hash of them where their texts are none."""
    plain = [re.sub(r"\s", "", setting) for setting in settings]
    if all(map(PLAIN.fullmatch, plain)) and sum(map(len, plain)) <= LONGEST:
        return plain
    return [f"set-{sha256(repr(plain).encode()).hexdigest()[:12]}"]


def refuse_other(file: Path, found: str, own: str) -> None:
    """Raise an InputError if what is in a file is of another scenario."""
    if found != own:
        raise InputError([f"{file}: it belongs to the scenario `{found}`, not to `{own}`. {ELSEWHERE.capitalize()}."])


def relative(file: str, folder: Path) -> str:
    """Path of a file from a folder; they may be moved together."""
    try:
        return Path(os.path.relpath(file, folder.resolve())).as_posix() if file else ""
    except ValueError:  # another drive
        return Path(file).as_posix()


def absolute(file: str, folder: Path) -> str:
    """Path of a file that was `relative` to a folder."""
    return os.path.normpath(folder.resolve() / file) if file else ""
