"""Studies: what repeats the papers stands beside its scenario, `scenarios/<name>/study.py`; here is what they share.

A `study.py` registers commands (`cli.common.study`) and figures (`figures.FIGURES`).  It loads at each start of the
command line, so what is heavy loads in its functions.  The files are found by walking: there is no list of them.
"""

from pathlib import Path

from gapsense.shipped import SCENARIOS


def modules() -> list[str]:
    """Full names of the modules of all studies: `study` beside a scenario, `command` in a folder here."""
    here = [f"{__name__}.{file.parent.name}.command" for file in sorted(Path(__file__).parent.glob("*/command.py"))]
    return here + [f"gapsense.scenarios.{file.parent.name}.study" for file in sorted(SCENARIOS.glob("*/study.py"))]
