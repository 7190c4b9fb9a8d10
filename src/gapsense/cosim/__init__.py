"""Scenarios: read, check, run, measure, compare. Knows FMU files and model descriptions, never our components.

>>> from gapsense.cosim import run
>>> result = run("scenarios/semera_valve")  # doctest: +SKIP
>>> print(result.metrics["semera_resistance_rmse"])  # doctest: +SKIP
"""

from gapsense.cosim.changes import changed
from gapsense.cosim.checkpoint import Checkpoint
from gapsense.cosim.compare import compare
from gapsense.cosim.junit import write_junit
from gapsense.cosim.load import load
from gapsense.cosim.master import Master
from gapsense.cosim.metrics import Measured
from gapsense.cosim.prepare import check, prepare
from gapsense.cosim.record import FmuError, Result, read_result
from gapsense.cosim.regression import Outcome, Update, find_scenarios, test_scenario, test_scenarios, update_baseline
from gapsense.cosim.run import run, run_once
from gapsense.cosim.scenario import Scenario
from gapsense.cosim.sensitivity import Growth, sensitivity
from gapsense.cosim.sidecar import own_file, refuse_other, relative, result_file
from gapsense.cosim.sweep import Sweep, sweep
from gapsense.problems import ScenarioError

__all__ = [
    "Checkpoint",
    "FmuError",
    "Growth",
    "Master",
    "Measured",
    "Outcome",
    "Result",
    "Scenario",
    "ScenarioError",
    "Sweep",
    "Update",
    "changed",
    "check",
    "compare",
    "find_scenarios",
    "load",
    "own_file",
    "prepare",
    "read_result",
    "refuse_other",
    "relative",
    "result_file",
    "run",
    "run_once",
    "sensitivity",
    "sweep",
    "test_scenario",
    "test_scenarios",
    "update_baseline",
    "write_junit",
]
