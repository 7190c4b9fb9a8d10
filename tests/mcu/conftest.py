"""The helpers of this folder, and the signals of estimators, can be imported by its tests."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(folder) for folder in (HERE, HERE.parent / "estimators", HERE.parent / "kernels")]
