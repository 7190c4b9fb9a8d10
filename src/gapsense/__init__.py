"""Gapsense: FMI co-simulation components for short-stroke reluctance actuators.

>>> from gapsense import Scenario, SolenoidValve
>>> moved = SolenoidValve(damping=0.2).run(24.0, sample_time=25e-6)
>>> scenario = Scenario("my valve", stop=20e-3, base_step=25e-6)

A class for each component, `Scenario` and `run` for co-simulations, and a function for each command on records and
results: `inspect`, `identify`, `commission`, `gap_law`, `fem`, `estimate`, `compare`. All of it is loaded when it is
asked for.
"""

import _signal  # type: ignore[import-not-found]  # what `signal` is made of, which takes a while to load
import os
import sys

# `python -m gapsense...`: what is in the working folder comes last.
_is_module = sys.argv[:1] == ["-m"] and sys.path[0] == os.getcwd()  # noqa: PTH109
sys.path.extend([sys.path.pop(0)] if _is_module else [])
if _is_module or "".join(sys.argv[:1]).endswith("gapsense"):  # until `__main__` has a word for a Ctrl-C
    _signal.signal(_signal.SIGINT, _signal.SIG_DFL)

from gapsense._os.offered import offered_names  # noqa: E402
from gapsense.version import __version__ as __version__  # noqa: E402

TYPE_CHECKING = False  # that of `typing` takes a while to load, in which a Ctrl-C would be shown as a traceback
if TYPE_CHECKING:
    from gapsense.components import BoundedUkf as BoundedUkf
    from gapsense.components import DriveVoltage as DriveVoltage
    from gapsense.components import Ekf as Ekf
    from gapsense.components import Ertss as Ertss
    from gapsense.components import HybridEkf as HybridEkf
    from gapsense.components import IntegralEstimator as IntegralEstimator
    from gapsense.components import Mhe as Mhe
    from gapsense.components import Monitor as Monitor
    from gapsense.components import PlayActuator as PlayActuator
    from gapsense.components import PotMagnet as PotMagnet
    from gapsense.components import PowerStage as PowerStage
    from gapsense.components import ReluctanceActuator as ReluctanceActuator
    from gapsense.components import RunToRun as RunToRun
    from gapsense.components import Semera as Semera
    from gapsense.components import Sensor as Sensor
    from gapsense.components import SolenoidValve as SolenoidValve
    from gapsense.components import TableActuator as TableActuator
    from gapsense.cosim.check import check as check
    from gapsense.cosim.convergence import converge as converge
    from gapsense.cosim.result.result import Result as Result
    from gapsense.cosim.result.result import read_result as read_result
    from gapsense.cosim.run.run import run as run
    from gapsense.cosim.scenario.build import Scenario as Scenario
    from gapsense.functions import Found as Found
    from gapsense.functions import commission as commission
    from gapsense.functions import compare as compare
    from gapsense.functions import estimate as estimate
    from gapsense.functions import fem as fem
    from gapsense.functions import gap_law as gap_law
    from gapsense.functions import identify as identify
    from gapsense.functions import inspect as inspect
    from gapsense.many.campaign import campaign as campaign
    from gapsense.many.prepare import check_study as check_study
    from gapsense.many.result import read_campaign as read_campaign
    from gapsense.many.sweep import sweep as sweep

_PLACES = offered_names(__file__)  # module of each name in the block above
__all__ = sorted(_PLACES)


def __getattr__(name: str) -> object:
    from importlib import import_module

    if name not in _PLACES:
        # With its object, so that Python offers the nearest name.
        raise AttributeError(f"module 'gapsense' has no attribute {name!r}", name=name, obj=sys.modules[__name__])
    return getattr(import_module(_PLACES[name]), name)


def __dir__() -> list[str]:
    return [*_PLACES, "__version__"]
