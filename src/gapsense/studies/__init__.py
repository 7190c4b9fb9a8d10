"""Studies, one folder each: the computation, `show.py` (its tables and figures), `command.py` (its command line).

The folders are found by walking: there is no list of them.
"""

from pathlib import Path


def modules(name: str) -> list[str]:
    """Full names of the modules called `name` in the folders of the studies."""
    return [f"{__name__}.{file.parent.name}.{name}" for file in sorted(Path(__file__).parent.glob(f"*/{name}.py"))]
