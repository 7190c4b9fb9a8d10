"""Loops that repeat each step from saved states until their values agree: `method = "iterative"`."""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import root

from gapsense.cosim import Checkpoint, FmuError, ScenarioError, check, read_result, run
from gapsense.cosim.run import iterate
from gapsense.cosim.run.iterate import Secants, Spent, Sweep, identity, invert_matrix
from gapsense.cosim.run.loop import compiled
from gapsense.cosim.run.turns import line
from gapsense.report import runs

HEAD = """
title = "A loop"
[experiment]
stop = STOP
base_step = STEP
method = "iterative"
"""
ISOLATED = ['isolation = "process"', ""]


def head(stop=1.0, step=0.1, more=""):
    return HEAD.replace("STOP", repr(stop)).replace("STEP", repr(step)) + more + "\n"


def ring(gains, bends, biases, lazy=0, more="", own=""):
    """Nodes in a ring, the first of which a swinging mass drives too."""
    n = len(gains)
    text = head(more=more) + '[components.swing]\nfmu = "Mass"\nset = { x0 = 1.0, k = 40.0, m = 1.0 }\n'
    for i, (gain, bend, bias) in enumerate(zip(gains, bends, biases)):
        values = f"bias = {bias!r}, gain = {gain!r}, bend = {bend!r}, lazy = {lazy}"
        text += f'[components.n{i}]\nfmu = "Node"\nset = {{ {values} }}\n{own}\n'
    text += "[connect]\n" + "".join(f'"n{i}.u" = "n{(i - 1) % n}.y"\n' for i in range(n))
    text += '[inputs]\n"swing.force" = 0\n' + "".join(f'"n{i}.v" = {0.1 * i!r}\n' for i in range(1, n))
    return text + '[[connections]]\nfrom = "swing.x"\nto = "n0.v"\nfactor = 1.0\nunit = "V"\n'


def residuals(result, gains, bends, biases):
    """What each node's equation is off by, at every row."""
    for i, (gain, bend, bias) in enumerate(zip(gains, bends, biases)):
        u, v = result[f"n{i}.u"], result[f"n{i}.v"]
        yield np.abs(bias + gain * u + bend * np.sin(u + v) - result[f"n{i}.y"])


FIVE = ([-1.2, 0.7, 1.5, 0.9, 0.8], [0.4, 0.3, -0.2, 0.5, 0.1], [0.3, -0.5, 0.2, 0.1, -0.4])


@pytest.mark.parametrize("lazy", [0, 1])
def test_loop_of_five_is_solved_at_every_row(write, coupled, lazy):
    """Also at the start, where the lazy ones compute nothing before the initialization ends."""
    path = write(ring(*FIVE, lazy, "loop_tolerance = 1e-10"))
    assert check(path, fmus=coupled) == []
    result = run(path, fmus=coupled)
    assert result.run.order[0] == "swing" and np.ptp(result["n0.y"]) > 0.1 and result.times.size == 11
    assert max(r.max() for r in residuals(result, *FIVE)) < 1e-12
    assert max(np.abs(result[f"n{i}.u"] - result[f"n{i - 1}.y"]).max() for i in range(1, 5)) == 0.0
    assert np.abs(result["n0.u"] - result["n4.y"]).max() < 1e-10
    loop = result.run.loops["n0, n1, n2, n3, n4"]
    assert loop.steps == 10 and loop.mean < 6.0 and loop.most <= 12
    assert result.timing["n0"].calls == 10


def a_loop(seed):
    """Wires, gains, shares, bends and biases of two to six nodes in a ring, of which some listen to one more.

    y = A y + b + bend sin(S y) has one solution where the rows of |(1 - A)^-1 bend S| sum up to less than 1, here 0.5.
    """
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 7))
    more = {i: int(random.choice([j for j in range(n) if j != i])) for i in range(1, n) if random.random() < 0.6}
    gains, shares, biases, bends = (random.uniform(-most, most, n) for most in (2.0, 1.5, 1.0, 1.0))
    direct, heard = np.zeros((n, n)), np.zeros((n, n))
    for i in range(n):
        for j, gain in ((i - 1, gains[i]), (more.get(i, i - 1), shares[i] * (i in more))):
            direct[i, j] += gain
            heard[i, j] = 1.0 + (more.get(i) == (i - 1) % n)
    bends *= 0.5 / np.abs(np.linalg.inv(np.eye(n) - direct) * bends @ heard).sum(axis=1).max()
    return more, gains.tolist(), shares.tolist(), bends.tolist(), biases.tolist()


@pytest.mark.parametrize("seed", range(20))
def test_any_loop_is_solved_as_scipy_solves_it_in_at_most_twelve_evaluations(write, coupled_2, seed):
    """Those of seeds 1000 to 2999 took 12 at most when this was written."""
    more, gains, shares, bends, biases = a_loop(seed)
    text, n = ring(gains, bends, biases, more="loop_tolerance = 1e-10"), len(gains)
    for i, share in enumerate(shares):
        text = text.replace(f"bias = {biases[i]!r}, ", f"bias = {biases[i]!r}, share = {share!r}, ")
    for i, j in more.items():
        text = text.replace(f'"n{i}.v" = {0.1 * i!r}\n', "").replace("[connect]", f'[connect]\n"n{i}.v" = "n{j}.y"')
    result = run(write(text), fmus=coupled_2)
    found = np.array([result[f"n{i}.y"] for i in range(n)])

    def residual(y, row):
        u, v = np.roll(y, 1), np.array([y[more[i]] if i in more else result[f"n{i}.v"][row] for i in range(n)])
        return biases + gains * u + shares * v + bends * np.sin(u + v) - y

    expected = np.transpose([root(residual, np.zeros(n), row, tol=1e-14).x for row in range(found.shape[1])])
    values = max(1.0, np.abs(expected).max())
    heard = [result[f"n{i}.u"] - found[i - 1] for i in range(n)] + [
        result[f"n{i}.v"] - found[j] for i, j in more.items()
    ]
    assert np.abs(heard).max() <= 1e-10 * values
    assert np.abs(found - expected).max() <= 1e-8 * values
    assert all(loop.most <= 12 for loop in result.run.loops.values())


# Two masses -----------------------------------------------------------------------------------------------------------

MASSES = """
[components.mass]
fmu = "Mass"
set = { m = 1.0, k = 40.0, d = 0.5, x0 = 0.01 }
OWN
[components.spring]
fmu = "Spring"
set = { m = 2.0, k = 60.0, d = 0.5, x0 = 0.01, kc = KC, dc = DC, parts = 400 }
OWN
[connect]
"spring.x" = "mass.x"
"spring.speed" = "mass.speed"
[[connections]]
from = "spring.force_mean"
to = "mass.force"
mean = true
"""


def masses(kc, method="iterative", own="", stop=2.0, more=""):
    text = head(stop, 1e-3, more).replace("iterative", method)
    return text + MASSES.replace("KC", repr(kc)).replace("DC", repr(1e-4 * kc)).replace("OWN", own)


def exact(kc, times):
    """Positions of the first mass: matrix exponential of the whole."""
    dc = 1e-4 * kc
    first, second = [-(40 + kc), -(0.5 + dc), kc, dc], [kc / 2, dc / 2, -(60 + kc) / 2, -(0.5 + dc) / 2]
    step = expm(np.array([[0, 1, 0, 0], first, [0, 0, 0, 1], second]) * (times[1] - times[0]))
    z = [np.array([0.01, 0.0, 0.01, 0.0])]
    for _ in times[1:]:
        z.append(step @ z[-1])
    return np.array(z)[:, 0]


def test_two_masses_at_a_hundred_times_the_stiffness_at_which_explicit_steps_are_unstable(write, coupled_2):
    unstable = 1e5
    stable = run(write(masses(unstable / 30.0, "gauss-seidel")), fmus=coupled_2)
    explicit = run(write(masses(unstable, "gauss-seidel")), fmus=coupled_2)
    assert np.abs(stable["mass.x"]).max() < 0.011 and np.abs(explicit["mass.x"]).max() > 1e3
    result = run(write(masses(100.0 * unstable)), fmus=coupled_2)
    assert np.abs(result["mass.x"] - exact(100.0 * unstable, result.times)).max() < 1e-4 * 0.01
    assert result.run.loops["mass, spring"].mean < 2.1


def test_error_of_two_masses_falls_with_the_square_of_the_step(write, coupled_2):
    errors = []
    for step in (4e-3, 2e-3, 1e-3):
        result = run(write(masses(1e4, stop=0.4).replace("base_step = 0.001", f"base_step = {step!r}")), fmus=coupled_2)
        errors.append(np.abs(result["mass.x"] - exact(1e4, result.times)).max())
    assert all(coarse / fine > 3.0 for coarse, fine in pairwise(errors))


def test_energy_that_leaves_one_mass_arrives_at_the_other(write, coupled_2):
    """With means and inputs in a straight line, at any stiffness; with inputs that are held it does not."""
    text = masses(1e7).replace("d = 0.5", "d = 0.0").replace("dc = 1000.0", "dc = 0.0")
    result = run(write(text), fmus=coupled_2)
    x, v, x2, v2 = (result[name] for name in ("mass.x", "mass.speed", "spring.x2", "spring.speed2"))
    energy = 0.5 * (v**2 + 2.0 * v2**2 + 40.0 * x**2 + 60.0 * x2**2 + 1e7 * (x2 - x) ** 2)
    assert np.ptp(energy) < 1e-6 * energy[0]
    held = run(write(text.replace("stop = 2.0", 'inputs = "hold"\nstop = 2.0')), fmus=coupled_2)
    assert np.abs(held["mass.x"] - x).max() > 1e-3


def test_value_that_was_lost_has_no_line():
    assert line(1.0, 3.0, 0.5) == (1.0, 4.0)
    begin, slope = line(1.0, math.nan, 0.5)
    assert math.isnan(begin) and slope == 0.0
    assert line(math.nan, 2.0, 0.5) == (2.0, 0.0)


# As other runs --------------------------------------------------------------------------------------------------------


def same(one, other):
    assert list(one.signals) == list(other.signals)
    assert all(one[name].tobytes() == other[name].tobytes() for name in one.signals)


@pytest.mark.parametrize("apart", ["run", "components"])
@pytest.mark.parametrize("kind", ["ring", "masses"])
def test_apart_gives_the_same_bits(write, coupled, apart, kind):
    texts = {"ring": lambda own: ring(*FIVE, own=own), "masses": lambda own: masses(1e6, own=own, stop=0.05)}
    here = run(write(texts[kind]("")), fmus=coupled)
    path = write(texts[kind]('isolation = "process"' if apart == "components" else ""))
    there = run(path, fmus=coupled, isolation="process" if apart == "run" else None)
    same(here, there)
    assert here.run.loops == there.run.loops and here.run.loops


@pytest.mark.parametrize("kind", ["ring", "masses"])
def test_resumed_run_has_the_same_bits(write, coupled, tmp_path, kind):
    path = write({"ring": ring(*FIVE), "masses": masses(1e6, stop=0.01)}[kind])
    whole, file = run(path, fmus=coupled), tmp_path / "saved"
    halted = []

    def halt(done, count):
        if done >= 4 and not halted:
            halted.append(done)
            raise KeyboardInterrupt

    every = 0.3 if kind == "ring" else 0.003
    assert run(path, fmus=coupled, progress=halt, checkpoint=Checkpoint(file, every)).interrupted
    resumed = run(path, fmus=coupled, checkpoint=Checkpoint(file, every, resume=True))
    same(whole, resumed)
    assert whole.run.loops == resumed.run.loops


EVENT = '[events.off]\ntarget = "n2.u"\naction = "bias"\nvalue = 0.5\nat = 0.5\n'
SLOW_NODE = ring(*FIVE).replace('[components.n1]\nfmu = "Node"', '[components.n1]\nfmu = "Node"\nstep = 2')
REFUSES = ring([-6.0, 1.0], [0.0, 0.0], [1.0, 0.0], lazy=1).replace("lazy = 1 }", "lazy = 1, least = -1.0 }")
LOOPS = {
    "ring": ring(*FIVE) + EVENT,
    "slow": SLOW_NODE,
    "masses": masses(1e6, stop=0.05),
    "control": masses(1e4, stop=0.064, more="step_control = 1e-3") + "[record]\ndecimation = 16\n",
    "refuses": REFUSES + EVENT.replace("n2", "n0").replace("0.5", "1.0", 1),
    "unsolved": ring([1.0, 1.0], [0.0, 0.0], [0.0, 0.0]) + EVENT.replace("n2", "n1"),
}


@pytest.mark.parametrize("kind", LOOPS)
def test_c_solves_loops_with_the_bits_of_python(write, coupled, monkeypatch, kind):
    """What it does not solve Python does again: a component that refuses a step, a loop without a solution."""
    path, found, solved = write(LOOPS[kind]), [], []
    call = compiled.InLoop.__call__
    monkeypatch.setattr(compiled.InLoop, "__call__", lambda self: solved.append(call(self)) or solved[-1])
    for binary in (compiled.BINARY, Path("none.so")):
        monkeypatch.setattr(compiled, "BINARY", binary)
        try:
            found.append((run(path, fmus=coupled), ""))
        except FmuError as error:
            found.append((error.result, str(error)))
    (one, said), (other, words) = found
    same(one, other)
    assert one.run.loops == other.run.loops and said == words
    assert solved.count(True) > 3 and (False in solved) == (kind in ("refuses", "unsolved"))


def test_without_loops_it_is_gauss_seidel(write, chain, fmus):
    path = write(chain)
    other = write(chain.replace("stop = 1.0", 'stop = 1.0\nmethod = "iterative"'), "other")
    same(run(path, fmus=fmus), run(other, fmus=fmus))
    assert run(other, fmus=fmus).run.loops == {}


def test_twice_gives_the_same_bits_and_can_be_saved(write, coupled, tmp_path):
    path = write(ring(*FIVE))
    first, second = run(path, fmus=coupled), run(path, fmus=coupled)
    same(first, second)
    again = read_result(first.save(tmp_path / "result.csv"))
    assert again.run == first.run and again.run.loops["n0, n1, n2, n3, n4"].mean > 1.0
    shown = runs.loops(again)[0]
    assert [str(c.header) for c in shown.columns] == ["loop of", "steps", "mean", "most", "at"]


def test_slow_component_of_a_loop_joins_when_its_turn_comes(write, coupled):
    gains, bends, biases = [0.5, -0.8], [0.2, 0.1], [1.0, 0.3]
    text = ring(gains, bends, biases).replace(
        '[components.n1]\nfmu = "Node"', '[components.n1]\nfmu = "Node"\nstep = 2'
    )
    result = run(write(text), fmus=coupled)
    first, second = residuals(result, gains, bends, biases)
    gap = np.abs(result["n1.u"] - result["n0.y"])
    assert max(first.max(), second[::2].max()) < 1e-12 and gap[::2].max() < 1e-7 and gap[1::2].max() > 1e-3
    assert np.array_equal(result["n1.y"][2:-1:2], result["n1.y"][3::2])
    assert {name: loop.steps for name, loop in result.run.loops.items()} == {"n0, n1": 5}


def test_value_that_is_small_where_it_comes_from_and_large_where_it_goes_is_solved_for_both(write, coupled_2):
    """n1.y is a billionth, of a nominal value of 1, and its connection makes a number about 1 of it."""
    text = ring([-0.7, 1e-9], [0.0, 0.0], [2.0, 0.0]).replace('"n0.u" = "n1.y"\n', "")
    text += '[[connections]]\nfrom = "n1.y"\nto = "n0.u"\nfactor = 1e9\nunit = "V"\n'
    result = run(write(text), fmus=coupled_2)
    assert np.abs(result["n0.u"] - 2.0 / 1.7).max() < 1e-8


def test_delayed_connection_carries_the_value_of_the_step_before(write, coupled):
    gains, bends, biases = [0.5, -0.8, 0.7], [0.2, 0.1, 0.0], [1.0, 0.3, 0.0]
    text = ring(gains, bends, biases).replace('"n2.u" = "n1.y"\n', "")
    text += '[[connections]]\nfrom = "n1.y"\nto = "n2.u"\ndelayed = true\n'
    result = run(write(text), fmus=coupled)
    assert np.array_equal(result["n2.u"][1:], result["n1.y"][:-1]) and result.run.loops == {}
    assert result.run.delayed == ("n1.y -> n2.u",)
    looped = text.replace("[connect]", '[connect]\n"n3.u" = "n1.y"').replace('"n0.u" = "n2.y"', '"n0.u" = "n3.y"')
    looped = looped.replace("[connect]", '[components.n3]\nfmu = "Node"\nset = { gain = 0.9 }\n[connect]', 1)
    looped = looped.replace("[inputs]", '[inputs]\n"n3.v" = 0')
    result = run(write(looped), fmus=coupled)
    assert np.array_equal(result["n2.u"][1:], result["n1.y"][:-1])
    assert np.abs(0.9 * result["n1.y"] - result["n3.y"]).max() < 1e-12
    assert [*result.run.loops] == ["n0, n1, n3"]


def test_event_acts_inside_a_loop(write, coupled):
    text = ring(*FIVE) + '[events.off]\ntarget = "n2.u"\naction = "bias"\nvalue = 0.5\nat = 0.5\n'
    result, plain = run(write(text), fmus=coupled), run(write(ring(*FIVE)), fmus=coupled)
    assert np.allclose(result["n2.u"] - result["n1.y"], 0.5 * (np.arange(11) >= 5), atol=1e-12)
    change = np.abs(result["n0.y"] - plain["n0.y"])
    assert change[:5].max() == 0.0 and change[5:].min() > 1e-3
    u, v, y = result["n0.u"], result["n0.v"], result["n0.y"]
    assert np.abs(FIVE[2][0] + FIVE[0][0] * u + FIVE[1][0] * np.sin(u + v) - y).max() < 1e-7


def test_whole_numbers_in_a_loop_settle(write, fmus):
    text = head() + '[components.a]\nfmu = "Switch"\n[components.b]\nfmu = "Switch"\n'
    text += '[connect]\n"a.before" = "b.mode"\n"b.before" = "a.mode"\n[inputs]\n"a.u" = 0.1\n"b.u" = 0.1\n'
    result = run(write(text), fmus=fmus)
    assert result["a.mode"].tolist() == [0.0] + [3.0] * 10 == result["b.mode"].tolist()


# What cannot be done --------------------------------------------------------------------------------------------------


def test_component_that_cannot_save_its_state_is_refused_by_name(write, chain, fmus):
    text = chain.replace('from = "lag.y"', 'from = "gain.y"\nfactor = 1.0')
    assert 'method = "iterative"' in "".join(check(write(text), fmus=fmus))
    found = check(write(text.replace("stop", 'method = "iterative"\nstop')), fmus=fmus)
    assert len(found) == 1 and "components.gain.fmu" in found[0]
    assert "canGetAndSetFMUstate" in found[0] and "delayed = true" in found[0]


def test_loop_without_solution_ends_the_run_with_its_residuals(write, coupled):
    """`y = u + bias` has none; what was recorded before is kept."""
    text = ring([1.0, 1.0], [0.0, 0.0], [0.0, 0.0], more="loop_evaluations = 40")
    text += '[events.off]\ntarget = "n1.u"\naction = "bias"\nvalue = 0.5\nat = 0.5\n'
    with pytest.raises(FmuError) as caught:
        run(write(text), fmus=coupled)
    error, words = caught.value, str(caught.value)
    assert (error.instance, error.step) == ("run", 5) and error.time == pytest.approx(0.4)
    assert "`n0, n1`" in words and "40 evaluations" in words and "`n1.y` = " in words and " V, off by 0.5 of" in words
    assert all(word in words for word in ("base_step", "loop_tolerance", "loop_evaluations", "delayed = true"))
    assert error.result.times.size == 5 and error.result["n0.y"].tolist() == [0.0] * 5


def test_loop_that_cannot_be_solved_at_the_start_says_so(write, coupled):
    with pytest.raises(FmuError, match=r"run, t = 0 s \(base step 0\): the loop of `n0, n1` was not solved"):
        run(write(ring([1.0, 1.0], [0.0, 0.0], [0.5, 0.0])), fmus=coupled)


def test_noise_larger_than_the_tolerance_is_not_taken_for_a_solution(write, coupled):
    text = ring([0.5, 0.5], [0.0, 0.0], [0.0, 0.0], more="loop_evaluations = 30")
    noisy = text.replace("lazy = 0 }", "lazy = 0, noise = 1e-3 }", 1)
    with pytest.raises(FmuError, match="was not solved in 30 evaluations"):
        run(write(noisy), fmus=coupled)
    assert run(write(noisy.replace("stop", "loop_tolerance = 0.01\nstop", 1)), fmus=coupled).times.size == 11


def test_step_that_a_component_refuses_is_halved(write, coupled):
    """The first step of the fixed point goes to -5, which `n1` refuses, the solution is at 0.16."""
    text = ring([-6.0, 1.0], [0.0, 0.0], [1.0, 0.0], lazy=1).replace("lazy = 1 }", "lazy = 1, least = -1.0 }")
    result = run(write(text), fmus=coupled)
    assert np.abs(result["n0.y"] - 1.0 / 7.0).max() < 1e-7


def test_component_that_fails_of_every_trial_tells_of_the_loop(write, coupled_2):
    """`n0.y` = -1 solves it, and neither takes anything below 0."""
    text = ring([1.0, 0.9], [0.0, 0.0], [0.0, -0.1], lazy=1).replace("lazy = 1 }", "lazy = 1, least = 0.0 }")
    with pytest.raises(
        FmuError, match=r"n0: .* It fails in a trial: the loop of `n0, n1` was not solved .* = 0 comes back as -0\.1 V"
    ):
        run(write(text), fmus=coupled_2)


def test_scenario_of_another_method_refuses_nothing_new(write, chain, fmus):
    with pytest.raises(ScenarioError, match="algebraic loop"):
        run(write(chain.replace('from = "lag.y"', 'from = "gain.y"\nfactor = 1.0')), fmus=fmus)


# The solver -----------------------------------------------------------------------------------------------------------


class Equations(Sweep):
    """A sweep whose outputs are a function, in place of components."""

    def __init__(self, function, start, nominals=None, tolerance=1e-10, most=100):
        self.function, self.buffer, self.parts, self.others, self.said = function, list(start), [], [], []
        self.unknowns, self.nominals = [*range(len(start))], nominals or [1.0] * len(start)
        self.inverse, self.is_settled, self.count = identity(len(start), -1.0), True, 0
        self.experiment = type("", (), {"loop_tolerance": tolerance, "loop_evaluations": most})

    def evaluate(self, x, act):
        if self.count >= self.experiment.loop_evaluations:
            raise Spent
        self.count += 1
        self.buffer[:] = self.function(np.array(x))
        return [float((y - v) / n) for y, v, n in zip(self.buffer, x, self.nominals)]


@pytest.mark.parametrize("seed", range(20))
def test_linear_equations_take_as_many_evaluations_as_unknowns_and_two(seed):
    """Whatever the fixed point does; and two when they are known from the step before."""
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 8))
    matrix, constant = 3.0 * random.normal(size=(n, n)), random.normal(size=n)
    equations = Equations(lambda x: matrix @ x + constant, [0.0] * n, tolerance=1e-8)
    equations.search(None)
    solution = np.linalg.solve(np.eye(n) - matrix, constant)
    assert np.abs(equations.buffer - solution).max() < 1e-6 * max(1.0, np.abs(solution).max())
    assert equations.count <= n + 3
    constant += 0.1
    equations.count = 0
    equations.search(None)
    assert equations.count <= 3


def test_differences_find_what_secants_do_not(monkeypatch):
    """A curve like an arc tangent, from where the steps of secants and of Newton go ever farther away."""

    def found():
        equations = Equations(lambda x: x - np.arctan(20.0 * (x - 3.0)) * [1.0, 3.0], [4.0, 1.5])
        equations.search(None)
        return equations.best[1]

    assert np.abs(np.array(found()) - 3.0).max() < 1e-9
    monkeypatch.setattr(iterate, "PATIENCE", math.inf)
    with pytest.raises(Spent):
        found()


@pytest.mark.parametrize(
    ("slope", "center", "height", "wave", "start"), [(1.1, -0.2, 2.7, 1.4, 1.3), (1.6, 0.0, 1.6, 4.0, 2.1)]
)
def test_single_unknown_is_found_between_points_whose_residuals_differ_in_sign(slope, center, height, wave, start):
    """Beside a minimum of the residual that is no solution, where all steps end that only make it smaller."""
    equations = Equations(lambda x: x + slope * (x - center) + height * np.sin(wave * x), [start])
    equations.search(None)
    x = equations.best[1][0]
    assert abs(slope * (x - center) + height * math.sin(wave * x)) < 1e-9 and equations.count < 60


def test_steps_that_make_the_residual_larger_lead_out_of_where_it_has_no_solution():
    matrix = np.array([[0.7, -1.5], [0.5, 0.4]])
    equations = Equations(lambda x: x + matrix @ x + 0.6 * np.sin(2.8 * x[::-1] + 1.0), [-1.7, -1.6])
    equations.search(None)
    x = np.array(equations.best[1])
    assert np.abs(matrix @ x + 0.6 * np.sin(2.8 * x[::-1] + 1.0)).max() < 1e-9


@pytest.mark.parametrize(("start", "solution"), [(0.0, 0.2763932), (0.27, 0.2763932), (0.73, 0.7236068)])
def test_of_two_solutions_it_is_the_one_to_which_the_values_before_lead(start, solution):
    equations = Equations(lambda x: 0.2 + x * x, [start])
    equations.search(None)
    assert equations.best[1][0] == pytest.approx(solution, abs=1e-7) and equations.count <= 12


def test_far_away_is_no_solution():
    """Where a step has led very far, a residual that is small beside the value there counts as large all the same."""
    equations = Equations(lambda x: x - 1.0 - 1e3 / (1.0 + np.abs(x)), [0.5])
    with pytest.raises(Spent):
        equations.search(None)


def test_differences_are_those_of_the_function():
    matrix = np.array([[0.0, 2.0], [0.5, -1.0]])
    equations = Equations(lambda x: matrix @ x, [1.0, 2.0], nominals=[1.0, 1e-3])
    x = [1.0, 2.0]
    equations.differ(x, equations.evaluate(x, None), None)
    scale = np.diag([1.0, 1e-3])
    assert np.allclose(equations.inverse, np.linalg.inv(np.linalg.inv(scale) @ (matrix - np.eye(2)) @ scale), rtol=1e-6)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_inverse_is_one(n):
    matrix = np.random.default_rng(n).normal(size=(n, n))
    assert np.allclose(np.array(invert_matrix(matrix.T.tolist())) @ matrix, np.eye(n))
    assert invert_matrix([[0.0] * n] * n) is None


def test_secants_keep_all_pairs_of_a_step():
    random = np.random.default_rng(3)
    jacobian = random.normal(size=(4, 4))
    secants = Secants(identity(4, -1.0))
    for _ in range(4):
        dx = random.normal(size=4)
        secants.learn(dx.tolist(), (jacobian @ dx).tolist())
    assert np.allclose(np.array(secants.inverse) @ jacobian, np.eye(4))
    secants.learn([0.0] * 4, [0.0] * 4)  # which says nothing
    assert np.allclose(np.array(secants.inverse) @ jacobian, np.eye(4))


# The power bond -------------------------------------------------------------------------------------------------------

BOND = """
[metrics.bond]
kind = "bond"
signal = "spring.force"
reference = "mass.force"
flows = ["spring.speed", "mass.speed"]
bounds = [0.0, 1e-6]
"""


def bond(method, stop=0.5):
    text = masses(1e3, method, stop=stop).replace("force_mean", "force").replace("mean = true\n", "")
    return text + BOND


def test_residual_energy_of_the_bond_is_that_of_the_values_that_both_took(write, coupled_2):
    found = {m: run(write(bond(m)), fmus=coupled_2) for m in ("gauss-seidel", "jacobi", "iterative")}
    assert found["iterative"].metrics["bond"].passed and found["iterative"].metrics["bond"].unit == ""
    assert not any(found[m].metrics["bond"].passed for m in ("gauss-seidel", "jacobi"))
    result = found["gauss-seidel"]  # the mass steps first, with the force of the step before
    force, speed = result["spring.force"], result["mass.speed"]
    lost, through = (
        np.abs((force[1:] - force[:-1]) * speed[1:]),
        np.abs(force * speed)[1:] + np.abs(force[:-1] * speed[1:]),
    )
    assert result.metrics["bond"].value == pytest.approx(lost.sum() / (0.5 * through.sum()), rel=1e-12)
    result = found["jacobi"]  # both step with the values of the step before
    force, speed = result["spring.force"], result["mass.speed"]
    leaving, arriving = force[1:] * speed[:-1], force[:-1] * speed[1:]
    expected = np.abs(leaving - arriving).sum() / (0.5 * (np.abs(leaving) + np.abs(arriving)).sum())
    assert result.metrics["bond"].value == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            '["spring.speed", "mass.speed"]',
            '["spring.speed"]',
            "metrics.bond.flows: 1 signals found, 2 expected for `bond`",
        ),
        (
            '["spring.speed", "mass.speed"]',
            '["spring.sped", "mass.speed"]',
            "metrics.bond.flows[0]: unknown signal `spring.sped`",
        ),
        ('"mass.speed"]', '"mass.x"]', "units differ"),
        ('kind = "bond"', 'kind = "rmse"', "2 signals found, 0 expected for `rmse`"),
    ],
)
def test_bond_that_is_none_is_refused(write, coupled_2, old, new, words):
    path = write(bond("iterative").replace(old, new))
    assert words in "\n".join(check(path, fmus=coupled_2))
