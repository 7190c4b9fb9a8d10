"""Helpers of these tests stand beside them, in files of their own."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.extend(
    str(Path(__file__).parents[1] / folder) for folder in ("kernels", "oracles", "estimators", "identification")
)
