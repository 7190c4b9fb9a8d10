"""Functions and kernels over many runs at once: in C if there is a compiler, else one by one in Python.

Each run has the bits of scalar Python alone. They do not depend on the other runs, nor on the processor's vectors.
"""

from gapsense.kernels.lanes.code import Code, Row
from gapsense.kernels.lanes.kernels import OverRuns, is_compiled, over_runs, step_runs
from gapsense.kernels.lanes.plan import Array, Plan, plan

__all__ = ["Array", "Code", "OverRuns", "Plan", "Row", "is_compiled", "over_runs", "plan", "step_runs"]
