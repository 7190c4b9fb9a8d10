"""What studies share. What repeats a paper stands beside its scenario, in `scenarios/<name>/study.py`.

A `study.py` registers commands (`cli.common.study`) and figures (`FIGURES`). It loads at each start of the command
line, so it loads heavy packages inside its functions. The files are found by walking: there is no list of them.
"""

from collections.abc import Callable, Collection, Iterable
from importlib import import_module
from typing import Any

from gapsense._os.importable import import_function
from gapsense.shipped import SCENARIOS


def modules() -> list[str]:
    """Full names of the modules `study` beside scenarios."""
    return [f"gapsense.scenarios.{file.parent.name}.study" for file in sorted(SCENARIOS.glob("*/study.py"))]


FIGURES = {"overview": "gapsense.report.plot:overview"}  # `module:function` by name; each study adds its own


def drawer(kind: str) -> Callable[[Any], Any]:
    """Function from a result to the figure of a kind. A ValueError lists the kinds there are, before a long run."""
    for name in modules():
        import_module(name)
    if kind not in FIGURES:
        kinds = ", ".join(FIGURES)
        raise ValueError(f"the scenario asks for figure `{kind}`; there are {kinds}. Correct its key `figure`.")
    drawn: Callable[[Any], Any] = import_function(FIGURES[kind])
    return drawn


def refuse_unrecorded(needed: Iterable[str], recorded: Collection[str], scenario: str, own: str) -> None:
    """Refuse a scenario that does not record what a study needs, with all that is missing; `own` is one that does."""
    if missing := ", ".join(f"`{name}`" for name in needed if name not in recorded):
        raise ValueError(
            f"{scenario}: the study of the {own} needs {missing}, not recorded. Add them to `[record]`, or take the "
            f"scenario `{own}`."
        )
