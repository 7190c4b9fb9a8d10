"""Scenarios: read, check, run, measure, compare. Knows FMU files and model descriptions, never our components.

>>> from gapsense.cosim import run
>>> result = run("scenarios/semera_valve")  # doctest: +SKIP
>>> print(result.metrics["semera_resistance_rmse"])  # doctest: +SKIP

What is offered here is loaded when it is asked for, so that nothing waits for what it does not need.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from gapsense._os.offered import offered_names

if TYPE_CHECKING:
    from gapsense.cosim.check import check as check
    from gapsense.cosim.check import find_fmus as find_fmus
    from gapsense.cosim.check import prepare as prepare
    from gapsense.cosim.check import remarks as remarks
    from gapsense.cosim.convergence import Convergence as Convergence
    from gapsense.cosim.convergence import converge as converge
    from gapsense.cosim.regression import Outcome as Outcome
    from gapsense.cosim.regression import Update as Update
    from gapsense.cosim.regression import find_scenarios as find_scenarios
    from gapsense.cosim.regression import test_scenario as test_scenario
    from gapsense.cosim.regression import test_scenarios as test_scenarios
    from gapsense.cosim.regression import update_baseline as update_baseline
    from gapsense.cosim.regression import write_junit as write_junit
    from gapsense.cosim.result.compare import compare as compare
    from gapsense.cosim.result.metrics import Measured as Measured
    from gapsense.cosim.result.pairs import compare_results as compare_results
    from gapsense.cosim.result.result import Result as Result
    from gapsense.cosim.result.result import read_result as read_result
    from gapsense.cosim.result.sidecar import own_file as own_file
    from gapsense.cosim.result.sidecar import refuse_other as refuse_other
    from gapsense.cosim.result.sidecar import relative as relative
    from gapsense.cosim.result.sidecar import result_file as result_file
    from gapsense.cosim.run.checkpoint import Checkpoint as Checkpoint
    from gapsense.cosim.run.master import Master as Master
    from gapsense.cosim.run.run import run as run
    from gapsense.cosim.run.run import run_once as run_once
    from gapsense.cosim.scenario.read import changed as changed
    from gapsense.cosim.scenario.read import load as load
    from gapsense.cosim.scenario.read import scenario_file as scenario_file
    from gapsense.cosim.scenario.records import Scenario as Scenario
    from gapsense.cosim.sensitivity import Growth as Growth
    from gapsense.cosim.sensitivity import sensitivity as sensitivity
    from gapsense.many.sweep import Sweep as Sweep
    from gapsense.many.sweep import sweep as sweep
    from gapsense.problems import FmuError as FmuError
    from gapsense.problems import ScenarioError as ScenarioError

OFFERED = offered_names(__file__)  # module of each name in the block above


def __getattr__(name: str) -> Any:
    if name not in OFFERED:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value = getattr(import_module(OFFERED[name]), name)
    return value


def __dir__() -> list[str]:
    return [*globals(), *OFFERED]


class Package(ModuleType):
    """A package with functions that are called like the modules they are in: loading these does not hide them."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in OFFERED and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = Package
