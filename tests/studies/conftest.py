"""The oracles can be imported here."""

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1] / "oracles")]
