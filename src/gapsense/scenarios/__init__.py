"""The folders in scenarios/ as packages, in a checkout and installed.

`scenarios/semera_valve/show.py` is the module `gapsense.scenarios.semera_valve.show`, in worker processes too.  Inside
they import each other relatively: `.show` is beside, `..estimators.parameters` in another folder.
"""

from gapsense.shipped import SCENARIOS

__path__ = [str(SCENARIOS)]
