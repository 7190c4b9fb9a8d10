"""Studies: what repeats the papers stands beside its scenario, `scenarios/<name>/study.py`; here is what they share.

A `study.py` registers commands (`cli.common.study`) and figures (`figures.FIGURES`).  It loads at each start of the
command line, so what is heavy loads in its functions.  The files are found by walking: there is no list of them.
"""

from gapsense.shipped import SCENARIOS


def modules() -> list[str]:
    """Full names of the modules `study` beside scenarios."""
    return [f"gapsense.scenarios.{file.parent.name}.study" for file in sorted(SCENARIOS.glob("*/study.py"))]
