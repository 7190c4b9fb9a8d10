"""Functions and kernels over many runs at once: in C where there is a compiler, by numpy where there is none.

In C a run has the bits that it has alone in scalar Python: they do not depend on the other runs, nor on the processor's
vectors.  Those of numpy may differ where there are logarithms, by their last bit.
"""

from gapsense.lanes.code import Code, Row
from gapsense.lanes.kernels import OverRuns, over_runs, stepped
from gapsense.lanes.plan import Array, Plan, plan

__all__ = ["Array", "Code", "OverRuns", "Plan", "Row", "over_runs", "plan", "stepped"]
