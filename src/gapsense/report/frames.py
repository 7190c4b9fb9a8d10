"""Results as tables of pandas, which is optional."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gapsense.problems import InputError


def frame(columns: Mapping[str, Any], name: str, index: Any, units: Mapping[str, str]) -> Any:
    """A DataFrame with an index of that name; units by column are in `attrs["units"]`."""
    try:
        import pandas
    except ImportError:
        sentence = "pandas is not installed. Install it with `pip install 'gapsense[pandas]'`."
        raise InputError([sentence]) from None
    made = pandas.DataFrame(dict(columns), index=pandas.Index(index, name=name))
    made.attrs["units"] = dict(units)
    return made
