"""What no run could do is refused with a sentence: without a traceback, and before memory goes."""

import itertools

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gapsense.cosim import ScenarioError, check, load, run, sweep
from gapsense.cosim.check import check_size
from gapsense.cosim.scenario.records import Plan, Port, blocks
from gapsense.tables import describe_value

HUGE = "1" + 400 * "0"
LIMIT = st.none() | st.integers(-2, 45)
METRIC = '[metrics.m]\nkind = "max_abs"\nsignal = "lag.y"\n'


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("stop = 1.0", "stop = 1e12", "is 1e+13 steps of 0.1 s, at most 1e+10 expected"),
        ("base_step = 0.1", "base_step = 1e-320", "is inf steps of"),
        ("base_step = 0.1", "base_step = 1e-12", "is 1e+12 steps of 1e-12 s"),
        ("stop = 1.0", "start = -1e308\nstop = 1e308", "is inf steps of"),
        ("stop = 1.0", f"stop = {HUGE}", "experiment.stop: a number of more than 308 digits found, a finite number"),
        ("slope = 2.0", f"slope = {HUGE}", "a number of more than 308 digits found, a finite number"),
        ("slope = 2.0", f"seed = {HUGE}", "a number of more than 308 digits found"),
        ("slope = 2.0", f"seed = {10**300}", "`seed` is 1000"),
        ('fmu = "Lag"', f'fmu = "Lag"\nstep = {HUGE}', "components.lag.step: a number of more than 308 digits found"),
        ('fmu = "Lag"', f'fmu = "Lag"\noffset = {10**300}', "components.lag.offset: `1000"),
        ('fmu = "Lag"', f'fmu = "Lag"\nstep = {2**53}', "its first step ends after 9007199254740992 base steps"),
        ("slope = 2.0", f"slope = 1{5000 * '0'}", "cannot be read: Exceeds the limit"),
        ("slope = 2.0", f"slope = {2000 * '['}{2000 * ']'}", "cannot be read"),
        ("slope = 2.0", f'slope = "{5000 * "x"}"', "xxx`... a value".replace("`...", "...`,")),
    ],
)
def test_numbers_beyond_reason_get_a_sentence(write, chain, fmus, old, new, words):
    assert old in chain
    problems = check(write(chain.replace(old, new, 1)), fmus=fmus)
    assert any(words in problem for problem in problems), [problem[:300] for problem in problems]
    assert all(len(problem) < 700 for problem in problems)


def test_long_values_are_shown_by_their_beginning():
    assert describe_value(10**400) == "a number of more than 308 digits"
    assert len(describe_value(500 * "x")) < 120


def test_grid_of_a_billion_points_is_refused_before_memory_goes(write, chain, fmus):
    values = [float(k) for k in range(1000)]
    lists = "".join(f'"source.{name}" = {values}\n' for name in ("level", "slope")) + f'"gain.gain" = {values}\n'
    path = write(f"{chain}[sweep]\n{lists}")
    words = "sweep: 1000 x 1000 x 1000 combinations found, at most 10000000 expected"
    assert words in check(path, fmus=fmus)[0]
    with pytest.raises(ScenarioError, match=words):
        sweep(path, fmus=fmus)
    plan = Plan(blocks([], {Port("gain", str(k)): values for k in range(3)}))
    assert plan.points == 10**9 and plan.point(10**9 - 2)[Port("gain", "2")] == 998.0


@given(st.lists(st.integers(1, 4), max_size=4), st.integers(1, 3))
def test_points_are_made_in_the_order_of_the_file(lengths, rows):
    grid = {Port("a", str(k)): list(range(n)) for k, n in enumerate(lengths)}
    own = [{Port("b", "x"): k} for k in range(rows)]
    expected = [{**row, **dict(zip(grid, point))} for row in own for point in itertools.product(*grid.values())]
    plan = Plan(blocks(own, grid))
    assert [plan.point(k) for k in range(plan.points)] == expected
    assert [*plan.point(0)] == [*expected[0]] and plan.point(-1) == expected[-1]
    with pytest.raises(IndexError):
        plan.point(plan.points)


def test_record_that_does_not_fit_into_the_memory_is_refused(write, chain):
    scenario = load(write(chain))
    assert [*check_size(scenario, 6, 8 * 11 * 7)] == []
    (told,) = check_size(scenario, 6, 615.0)
    assert "11 rows of 6 signals are 6.16e-07 GB, at most 6.15e-07 GB" in told


def test_run_that_no_memory_holds_is_refused(write, chain, fmus):
    path = write(chain.replace("stop = 1.0", "stop = 1e9"))
    assert "record: 10000000001 rows of 7 signals are 640 GB" in check(path, fmus=fmus)[0]
    assert check(write(chain.replace("stop = 1.0", "stop = 1e9") + "[record]\ndecimation = 100000\n"), fmus=fmus) == []


@pytest.mark.parametrize(
    ("window", "words"),
    [
        ("after = 1.0", "no sample has `after` = 1 s in a run from 0 s to 1 s with a sample every 0.1 s"),
        ("after = 2.0", "no sample has `after` = 2 s"),
        ("after = 1e300", "no sample has `after` = 1e+300 s"),
        ("before = 0.0", "no sample has `before` = 0 s"),
        ("before = 0.1", "no sample has `before` = 0.1 s"),
        ("before = -1e300", "no sample has `before`"),
        ("after = 0.31\nbefore = 0.39", "no sample has `after` = 0.31 s and `before` = 0.39 s"),
        ("after = 0.3\nbefore = 0.4", "no sample has"),
        ("after = 0.95", ""),
        ("before = 0.15", ""),
        ("after = 0.3\nbefore = 0.5", ""),
        ('after = 5.0\ntime = "clock.y"', ""),
    ],
)
def test_window_without_samples_is_refused(write, chain, fmus, window, words):
    found = check(write(f'{chain}[components.clock]\nfmu = "Faulty"\nset = {{ u = 0 }}\n{METRIC}{window}\n'), fmus=fmus)
    assert words in found[0] if words else found == []


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.integers(1, 6),
    st.integers(0, 4),
    st.integers(1, 7),
    st.none() | st.integers(-2, 45),
    st.none() | st.integers(-2, 45),
)
def test_window_is_refused_exactly_if_the_metric_has_no_value(
    write, chain, fmus, step, offset, decimation, after, before
):
    window = "".join(f"{k} = {v * 0.05}\n" for k, v in (("after", after), ("before", before)) if v is not None)
    if after is not None and before is not None and after >= before:
        return
    text = chain.replace("stop = 1.0", "stop = 2.0").replace(
        'fmu = "Lag"', f'fmu = "Lag"\nstep = {step}\noffset = {offset}'
    )
    good, metric = f"{text}[record]\ndecimation = {decimation}\n", METRIC + window
    is_refused = bool(check(write(good + metric), fmus=fmus))
    result = run(write(good), fmus=fmus)
    times = result.times[result.stepped("lag.y")]
    low, high = (-np.inf if after is None else after * 0.05), (np.inf if before is None else before * 0.05)
    assert is_refused == (not ((times > low + 1e-10) & (times < high - 1e-10)).any())
