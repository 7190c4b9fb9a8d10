"""Every number of a scenario file may be anything: what no run can do gets a sentence, and nothing hangs or breaks."""

import copy
import math
import resource
import time
from typing import Any

import pytest

from gapsense.cosim import FmuError, ScenarioError, check, run
from gapsense.cosim.scenario import keys
from gapsense.cosim.scenario.read import Document
from gapsense.tables import Section
from gapsense.tables import parse_toml as read

NUMBERS = (1e308, -1e308, 1e300, 5e-324, 2**63, 2**53, 2**31, 10**18, 1e18, 1e16, -1, -1.0, 0, 0.0, -0.0, 1, 1e-9, 7.3)
NUMBERS += (math.nan, math.inf, -math.inf)
FEW = (1e308, 5e-324, 2**63, -1, 0, 7.3, math.nan, math.inf)
WHOLE = """
title = "Everything"

[experiment]
start = 0.0
stop = 1.0
base_step = 0.1
pace = 1e5
step_limit = 10.0
loop_tolerance = 1e-8
loop_evaluations = 50

[components.source]
fmu = "Source"
step = 1
offset = 0
set = { slope = 2.0, seed = 1 }

[components.noise]
fmu = "Noise"
clock = 168e6

[components.tuned]
fmu = "Tuned"

[components.lag]
fmu = "Lag"

[components.gain]
fmu = "Gain"

[[connections]]
from = "source.y"
to = "lag.u"
factor = 2.0
bias = 1.0

[inputs]
tuned.u = 1.0

[inputs.gain.u]
times = [0.0, 2.0]
values = [0.0, 1.0]

[seeds]
noise = 1

[sweep]
"source.level" = [1.0, 2.0]
"events.jump.at" = [0.2, 0.3]

[events.jump]
target = "lag.u"
action = "bias"
value = 1.0
at = 0.2
until = 0.9

[events.grow]
target = "lag.u"
action = "ramp"
value = 1.0
at = 0.3
over = 0.2
duration = 0.4

[events.shaken]
target = "gain.u"
action = "noise"
value = 0.1
at = 0.1
seed = 3

[events.late]
target = "gain.u"
action = "set"
value = 0.5
duration = 0.2

[events.late.when]
signal = "lag.y"
above = 0.1
for = 0.2
after = 0.1

[events.low]
target = "gain.u"
action = "set"
value = 0.5

[events.low.when]
signal = "lag.y"
below = -5.0

[record]
decimation = 1

[metrics.error]
kind = "rmse"
signal = "lag.y"
reference = 1.0
after = 0.2
before = 0.9
bounds = [0.0, 100.0]
published = 1.0

[baseline]
decimation = 1
rtol = 1e-9
atol = 0.0
edge_steps = 0

[baseline.tolerances."lag.*"]
rtol = 1e-9
atol = 0.0
edge_steps = 0
"""
NUMERIC = {"number", "integer"}
CONTROL = {"step_control", "shortest_step", "longest_step"}  # in test_step_control.py, with FMUs that save their state
SECONDS = 30.0  # that one scenario may take, of which most is none of its own


def places(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Where there is a number."""
    if isinstance(data, dict):
        return [found for key, value in data.items() for found in places(value, (*path, key))]
    if isinstance(data, list):
        return [found for index, value in enumerate(data) for found in places(value, (*path, index))]
    return [path] if isinstance(data, (int, float)) and not isinstance(data, bool) else []


def numeric(section: Section) -> set[str]:
    """Names of the keys that hold numbers, in this table and those below it."""
    found = set()
    for key in section.keys:
        schema = key.kind.schema
        kind = schema["items"]["type"] if "items" in schema else schema.get("type")
        found |= {key.name} if isinstance(kind, str) and kind in NUMERIC else set()
    for key in (*section.keys, *((section.free,) if section.free else ())):
        found |= numeric(key.section) if key.section and key.section is not keys.SECTIONS["variants"] else set()
    return found


def changed(path: tuple[Any, ...], value: Any) -> Document:
    """The scenario with another number at one place."""
    data = copy.deepcopy(DATA)
    inner = data
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    return Document(FOLDER / "scenario.toml", data)


@pytest.fixture(scope="module", autouse=True)
def data(tmp_path_factory):
    """The tables of the scenario, in a folder without a file."""
    global DATA, FOLDER
    DATA, FOLDER = read(WHOLE), tmp_path_factory.mktemp("every")


@pytest.fixture(autouse=True)
def memory():
    """No more memory than a reasonable run needs; what wants more fails here."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (12 * 10**9, hard))
    yield
    resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def test_scenario_has_every_numeric_key_of_the_format():
    given = {str(path[-1] if isinstance(path[-1], str) else path[-2]) for path in places(read(WHOLE))}
    wanted = numeric(keys.FILE) - CONTROL
    assert len(wanted) > 20 and wanted <= given, wanted - given


def test_scenario_is_good(fmus):
    assert check(Document(FOLDER / "scenario.toml", DATA), fmus=fmus) == []


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("path", places(read(WHOLE)), ids=lambda path: ".".join(map(str, path)))
@pytest.mark.parametrize(
    "numbers", [pytest.param(FEW, id="few"), pytest.param(NUMBERS, id="all", marks=pytest.mark.slow)]
)
def test_any_number_is_run_or_refused(fmus, path, numbers):
    for value in numbers:
        source, begin = changed(path, value), time.monotonic()
        problems = check(source, fmus=fmus)
        for problem in problems:
            assert len(problem) < 600 and problem.endswith((".", "?")), problem
        if not problems and fast(source):
            try:
                run(source, fmus=fmus, point=0 if path[0] == "sweep" else None)
            except (ScenarioError, FmuError) as error:
                assert str(error)
        assert time.monotonic() - begin < SECONDS, value


def fast(source: Document) -> bool:
    """True for a run of few steps."""
    experiment = source.data["experiment"]
    return (experiment["stop"] - experiment["start"]) / experiment["base_step"] < 1000
