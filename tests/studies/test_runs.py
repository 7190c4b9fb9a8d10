"""The steps of the study in one run against the kernel of the smoother."""

from __future__ import annotations

import numpy as np
import pytest
from wrong_models import Textbook, filter_parameters

from gapsense.scenarios.soft_landing.batch import MOVING, Tuning, Variant, uncertain
from gapsense.scenarios.soft_landing.rts import smooth_record
from gapsense.scenarios.soft_landing.runs import Estimator, filtered, open_loop, smoothed
from gapsense.scenarios.soft_landing.setting import errors, gap_means, noise, perturbed

RUNS = 2
TUNING = Tuning(1.94e-5, 1.2e-3, 21e-3, 2e-3)
UNIT = np.array([1.0, 1.0, 0.02, 0.1, 1e-3])
VARIANTS = [Variant(), Variant(0.0, 1.0), Variant(1.0, 0.0)]


def alone(varied, run):
    """The model of one run."""
    return type(varied)(*(float(np.broadcast_to(value, RUNS)[run]) for value in varied))


def assert_equal(rows, estimates, samples, states):
    """Means and covariances of the uncertain states, in units of their size."""
    found = np.array([*rows])
    mean, cov = estimates.mean[samples], estimates.cov[samples][:, states][:, :, states]
    i, j = np.triu_indices(len(states))
    scale = np.outer(UNIT[states], UNIT[states])[i, j]
    np.testing.assert_allclose(found[:, :5] / UNIT, mean / UNIT, atol=1e-9)
    np.testing.assert_allclose(found[:, 5:] / scale, cov[:, i, j] / scale, atol=1e-9)
    known = [k for k in range(5) if k not in states]
    assert not np.any(estimates.cov[samples][:, known]) and not np.any(estimates.mean[samples][:, known])


@pytest.mark.parametrize(
    ("width", "memory", "variant"),
    [
        *((0.3, 0.97, variant) for variant in VARIANTS),
        (0.01, 1.0, VARIANTS[0]),
        *(pytest.param(0.01, 1.0, variant, marks=pytest.mark.slow) for variant in VARIANTS[1:]),
        *(pytest.param(0.3, 1.0, variant, marks=pytest.mark.slow) for variant in VARIANTS),
    ],
)
def test_filter_and_smoother_equal_the_scalar_kernel(study, variant, width, memory):
    s, m = study.samples, study.model._replace(memory=memory)
    varied = perturbed(m, width * errors(3, 0, RUNS))
    current = s.current[:, None] + noise(3, 0, RUNS, s.time.size, 2e-3)
    estimator = Estimator(variant, TUNING, m)
    states = uncertain(variant, MOVING)
    for run in range(RUNS):
        own = alone(varied, run)
        motions = [*filtered(s, current[:, run].tolist(), own, estimator)]
        found = [(motion, [*smoothed(motion, s, own, estimator)][::-1]) for motion in motions]
        assert len(found) == 2
        par = filter_parameters(m, varied, run, TUNING, variant)
        expected = smooth_record(s.voltage, current[:, run], s.mode, par)
        for (motion, rows), operation in zip(found, expected.operations):
            assert (motion.first, motion.first + len(rows)) == (operation.first, operation.landed)
            samples = slice(operation.first, operation.landed)
            assert_equal(motion.filtered, expected.filtered, samples, states)
            assert_equal(rows, expected.smoothed, samples, states)


def test_open_loop_equals_a_plain_loop(study):
    s, m = study.samples, study.model
    relative = 0.1 * errors(3, 0, RUNS)
    moving = np.flatnonzero(s.mode == MOVING)
    for run in range(RUNS):
        found = dict(open_loop(s, alone(perturbed(m, relative), run), m))
        assert sorted(found) == moving.tolist()
        model = Textbook(m, relative[:, run], *gap_means(m))
        z, z_prev, lam = 1.0, 1.0, 0.0
        for k in range(1, moving[-1] + 1):
            after = model.next_position(z, z_prev, lam, 0.0, s.mode[k - 1], False)
            lam += m.T_s * (s.voltage[k - 1] - m.R * model.current(z, lam))
            z, z_prev = {1.0: 0.0, 3.0: 1.0}.get(s.mode[k], min(max(after, 0.0), 1.0)), z
            if s.mode[k] == MOVING:
                assert found[k] == pytest.approx([z, z_prev, lam], rel=1e-9, abs=1e-12)


def test_record_without_a_complete_motion_gives_none(study):
    s = study.samples
    short = type(s)(*(values[:200] for values in s))
    varied = perturbed(study.model, np.zeros((8, 2)))
    estimator = Estimator(Variant(), TUNING, study.model)
    assert not [*filtered(short, np.tile(short.current[:, None], 2), varied, estimator)]
    assert not [*open_loop(short, varied, study.model)]
