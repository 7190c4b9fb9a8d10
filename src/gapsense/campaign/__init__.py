"""Campaigns: thousands of runs of a scenario over what a study file varies, here or on a cluster, kept as Parquet.

>>> from gapsense import campaign
>>> result = campaign.run("tolerances.toml")  # doctest: +SKIP
>>> result.quantiles()["current_noise"]  # doctest: +SKIP

What is offered here is loaded when it is asked for; it needs the extra `campaign`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gapsense.problems import InputError

if TYPE_CHECKING:
    from gapsense.campaign.engine import run as run
    from gapsense.campaign.prepare import check as check
    from gapsense.campaign.result import Campaign as Campaign
    from gapsense.campaign.result import read as read

OFFERED = {
    "run": "gapsense.campaign.engine",
    "check": "gapsense.campaign.prepare",
    "Campaign": "gapsense.campaign.result",
    "read": "gapsense.campaign.result",
}
OPTIONAL = ("pyarrow", "distributed", "dask")


def __getattr__(name: str) -> Any:
    if name not in OFFERED:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return getattr(import_module(OFFERED[name]), name)
    except ModuleNotFoundError as error:
        raise missing(error) from error


def __dir__() -> list[str]:
    return [*globals(), *OFFERED]


def missing(error: ModuleNotFoundError) -> Exception:
    """What to tell about a package that is not there."""
    package = (error.name or "").partition(".")[0]
    if package not in OPTIONAL:
        return error
    return InputError([f"campaigns need {package}, which is not installed: `pip install 'gapsense[campaign]'`."])
