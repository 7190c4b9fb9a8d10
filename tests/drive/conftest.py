"""Kernels in C and the oracles can be imported here."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.extend(str(Path(__file__).parents[1] / folder) for folder in ("kernels", "oracles"))
