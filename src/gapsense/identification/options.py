"""What the user asks a fit to seek and to hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from gapsense.identification.measurements.conventions import AUTO, FORMS, PLAIN
from gapsense.identification.valve.file import PORTS, Known
from gapsense.identification.valve.form import FITTED
from gapsense.identification.valve.forms import LOSSES, SCALES, Sought

FIELDS = (*FITTED, *SCALES.values(), "gap_window", *LOSSES)  # that may be sought, and so may be held
NOT_COMMISSIONED = (
    "--model",
    "--period",
    "--temperature",
    "--forms",
    "--hold",
    "--inductance",
    "--driver",
    "--accuracy",
)


def sought(forms: str, hold: Sequence[str], known: Known, accuracy: Mapping[str, float]) -> Sought:
    """From the values of `--forms` and `--hold`, names with commas between; a ValueError tells what is wrong."""
    tried = {AUTO: FORMS, PLAIN: ()}.get(forms, tuple(split([forms])))
    names = {PORTS[field].name: field for field in FIELDS}
    for name in tried:
        if name not in FORMS:
            raise ValueError(f"--forms: `{name}` found; {AUTO}, {PLAIN}, or some of {', '.join(FORMS)} expected.")
    held = split(hold)
    for name in held:
        if name not in names:
            because = " It follows from (23)." if name == "coil.resistance" else ""
            raise ValueError(f"--hold: `{name}` found, one of {', '.join(names)} expected.{because}")
        if names[name] in LOSSES and names[name] not in known.losses:
            raise ValueError(f"--hold: `{name}` has no value to be held at. Give one in the file of `--parameters`.")
    errors = {field: accuracy[port.name] for field, port in PORTS.items() if port.name in accuracy}
    fields = frozenset(names[name] for name in held)
    return Sought(tried, fields, known.losses, given=known.given, accuracy=errors)


def believed(parameters: Path | None, others: Sequence[object]) -> Path:
    """What `--commission` takes for the device; a ValueError tells what is missing, or which options it has not."""
    if parameters is None:
        raise ValueError("--commission: `--parameters` is missing. Give a set with what is believed of the device.")
    if given := [name for name, value in zip(NOT_COMMISSIONED, others) if value and value != AUTO]:
        raise ValueError(f"--commission: {', '.join(given)} found; it has no such option. Leave it out.")
    return parameters


def split(texts: Sequence[str]) -> list[str]:
    """Names with commas between."""
    return [name.strip() for text in texts for name in text.split(",") if name.strip()]
