"""The generator against its published values, and the distributions over samples and over seeds."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from gapsense.kernels import random
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes import Code, plan
from gapsense.kernels.layout import Array, Scalar, Vector, flat
from gapsense.kernels.linalg import vector

RUNS = 100_000


class Seed(NamedTuple):
    seed: Scalar


class Generator(NamedTuple):
    state: Annotated[Array, Vector(6)]


class Nothing(NamedTuple):
    nothing: Scalar


class Draws(NamedTuple):
    z: Scalar
    u: Scalar


def step(state, inputs, par):
    after, z = random.normal(state.state)
    after, u = random.uniform(after)
    return Generator(after), Draws(z, u)


def initial(inputs, par):
    return Generator(random.seed_state(par.seed)), Draws(0.0, 0.0)


KERNEL = Kernel(
    SimpleNamespace(
        __name__="draws", Parameters=Seed, State=Generator, Inputs=Nothing, Outputs=Draws, initial=initial, step=step
    )
)


@pytest.fixture(scope="module")
def draws():
    """Five draws of normal and uniform numbers, (5, RUNS) each, for the seeds 0, 1, 2, ..."""

    def drawn(seeds):
        initial, step = map(Code, KERNEL.graphs)
        state, _ = initial([0.0], seeds)
        for _ in range(5):
            state, outputs = step(state, [0.0], seeds)
            yield from outputs

    rows = plan(lambda seeds: [*drawn(seeds)], seeds=1).run(RUNS, seeds=np.arange(RUNS, dtype=float)[None])
    return rows[0::2], rows[1::2]


@pytest.fixture(scope="module")
def sequence():
    """20000 draws of normal and uniform numbers, (20000, 2), of the seed 1."""
    generated = KERNEL.scalar["step"]
    state, _ = KERNEL.scalar["initial"]([0.0], [1.0])
    rows = []
    for _ in range(20_000):
        state, row = generated(state, [0.0], [1.0])
        rows.append(row)
    return np.array(rows)


def uniforms(state, count):
    numbers = []
    for _ in range(count):
        state, u = random.uniform(state)
        numbers.append(u)
    return state, numbers


def test_uniform_gives_published_values():
    # results of the test program of RngStreams (L'Ecuyer et al., github.com/umontreal-simul/RngStreams)
    state, u = uniforms(vector([12345.0] * 6), 35)
    assert [f"{x:.15f}" for x in u[:2]] == ["0.127011122046577", "0.318527565396794"]
    assert [*state] == [1040577685, 3747037609, 277208355, 1712706441, 627445683, 2408037141]
    assert sum(int(1 + 10 * x) for x in u) == 186
    assert f"{random.uniform(state)[1]:.14f}" == "0.07941673614985"
    _, u = uniforms(vector([1015873554.0, 1310354410.0, 2249465273.0, 994084013.0, 2912484720.0, 3876682925.0]), 101)
    assert [f"{x:.13g}" for x in u[:3]] == ["0.7285097861965", "0.9655872822837", "0.9961841304801"]
    assert sum(u[1:]) == pytest.approx(  # the program has drawn one before
        53.98590159232, abs=1e-11
    )


components = [st.integers(0, int(m) - 1) for m in [random.M1] * 3 + [random.M2] * 3]


@given(st.tuples(*components))
def test_uniform_is_exact_for_every_state(state):
    a0, a1, a2, b0, b1, b2 = state
    m1, m2 = int(random.M1), int(random.M2)
    a3, b3 = (1403580 * a1 - 810728 * a0) % m1, (527612 * b2 - 1370589 * b0) % m2
    after, u = random.uniform(vector([float(x) for x in state]))
    assert [*after] == [a1, a2, a3, b1, b2, b3]
    assert u == ((a3 - b3) % m1 or m1) * (1.0 / (m1 + 1.0))
    assert 0.0 < u < 1.0


@given(st.integers(0, int(random.M1) - 1))
def test_scrambling_is_exact(x):
    expected = x
    for c in random.ROUND_CONSTANTS:
        expected = pow(expected + c, 3, int(random.M1))
    assert random._scramble(float(x)) == expected


def test_scrambling_is_a_bijection_that_leads_to_valid_states():
    assert (int(random.M1) - 1) % 3 != 0  # so that no two numbers have the same cube
    # three words in a row are never all 0 modulo M1, nor modulo M2
    assert random._scramble(0.0) not in (0.0, random.M2)
    assert random._scramble(random.M2) not in (0.0, random.M2)


@pytest.mark.parametrize("seed", [0, 1, 2, 2**31 - 2, 2**31 - 1])
def test_seeded_state_is_valid(seed):
    state = random.seed_state(float(seed))
    assert all(x == int(x) and x >= 0 for x in state)
    assert all(x < random.M1 for x in state[:3]) and any(state[:3])
    assert all(x < random.M2 for x in state[3:]) and any(state[3:])


def test_bits_of_a_seed_never_change():
    # frozen: a change here changes every stored baseline
    state = random.seed_state(1.0)
    assert [*state] == [4168996445, 2473134036, 1727586019, 2177411920, 2444871016, 1036303530]
    state, z = random.normal(state)
    assert z.hex() == "0x1.d85126f1261dbp-1"


def test_generated_code_gives_the_bits_of_the_source(sequence):
    state, _ = initial(None, Seed(1.0))
    for row in sequence[:2000]:
        state, outputs = step(state, None, None)
        assert [*row] == flat(outputs)


def test_batch_gives_the_bits_of_single_runs(draws):
    for seed in (0, 1, 777, RUNS - 1):
        state, _ = initial(None, Seed(float(seed)))
        for z, u in zip(*draws):
            state, outputs = step(state, None, None)
            assert (z[seed], u[seed]) == outputs


def test_normal_is_normal_over_seeds(draws):
    z = draws[0].ravel()
    n = z.size
    assert stats.kstest(z, "norm").pvalue > 1e-3
    assert abs(z.mean()) * n**0.5 < 4.0
    assert abs(z.var() - 1.0) * (n / 2) ** 0.5 < 4.0
    assert abs(stats.skew(z)) * (n / 6) ** 0.5 < 4.0
    assert abs(stats.kurtosis(z)) * (n / 24) ** 0.5 < 4.0
    for limit in (3.0, 4.0):  # tails
        expected = 2 * n * stats.norm.sf(limit)
        assert abs(np.count_nonzero(abs(z) > limit) - expected) < 4.0 * expected**0.5


def test_each_draw_is_independent_of_its_seeds_neighbours(draws):
    for row in (*draws[0], *(draws[1] - 0.5)):
        for lag in (1, 2, 3, 1000):
            assert abs(np.corrcoef(row[lag:], row[:-lag])[0, 1]) * RUNS**0.5 < 4.5
    for u in draws[1]:  # what a seed spread by a linear congruence fails
        assert stats.kstest((u[2:] - 2.0 * u[1:-1] + u[:-2])[::3] % 1.0, "uniform").pvalue > 1e-4


def test_sequence_of_one_seed_is_white_and_normal(sequence):
    z, u = sequence.T
    assert stats.kstest(z, "norm").pvalue > 1e-3
    assert stats.kstest(u, "uniform").pvalue > 1e-3
    for lag in range(1, 11):
        assert abs(np.corrcoef(z[lag:], z[:-lag])[0, 1]) * len(z) ** 0.5 < 4.0
        assert abs(np.corrcoef(z[lag:] ** 2, z[:-lag] ** 2)[0, 1]) * len(z) ** 0.5 < 4.0
    assert abs(np.corrcoef(z, u)[0, 1]) * len(z) ** 0.5 < 4.0
