"""Results as tables of pandas, which is optional."""

from __future__ import annotations

from typing import Any

from gapsense.cosim import Result, Sweep
from gapsense.problems import InputError


def frame(shown: Result | Sweep) -> Any:
    """A row per recorded time, or per run of a sweep; units by column are in `attrs["units"]`."""
    try:
        import pandas
    except ImportError:
        sentence = "pandas is not installed. Install it with `pip install 'gapsense[pandas]'`."
        raise InputError([sentence]) from None
    if isinstance(shown, Result):
        made = pandas.DataFrame(dict(shown.signals), index=pandas.Index(shown.times, name="time"))
    else:
        made = pandas.DataFrame({**shown.grid, **shown.metrics}, index=pandas.Index(shown.indices, name="run"))
    made.attrs["units"] = dict(shown.units)
    return made
