"""Nanoseconds per step and run of the filter of [RTS] in motion: `python benchmarks/filters.py`.

Our numpy code over many runs, the generated Python and C of the component `Ekf` (with its outputs in SI units), and
filterpy's ExtendedKalmanFilter with the same model, whose functions and Jacobians are written out in numpy.  All but C
step the motion of the soft-landing cycle; C steps random inputs, as in kernels.py.  CPU time, the best of some passes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

sys.path.extend(
    str(Path(__file__).resolve().parents[1] / "tests" / folder)
    for folder in ("kernels", "oracles", "estimators", "studies")
)
import reduced_model_textbook as textbook
from kernels import in_c
from wrong_models import filter_parameters

from gapsense.estimators import ekf
from gapsense.estimators.rts import motions
from gapsense.kernel import Kernel
from gapsense.studies.smoother.batch import MOVING, Tuning, Variant, Varied, backward_step, forward_step
from gapsense.studies.smoother.models import CHUNK, errors, noise, nominal, perturbed, unvaried
from gapsense.studies.smoother.runs import Estimator, filtered
from gapsense.studies.smoother.study import Study
from gapsense.studies.soft_landing.cycle import sampled, soft_landing

TUNING = Tuning(1.94e-5, 1.2e-3, 21e-3, 2e-3)
PASSES = 5


def main() -> None:
    """Measure and print."""
    study = Study(sampled(soft_landing()[-1]), nominal())
    table = Table(title="Nanoseconds per step and run, in motion")
    table.add_column("what")
    table.add_column("ns", justify="right")
    table.add_column("remark")
    for runs in (1000, CHUNK):
        forward, backward = over_runs(study, runs)
        table.add_row(f"filter, numpy over {runs} runs", f"{forward:.0f}", "as in `gapsense study monte-carlo`")
        table.add_row(f"smoother's backward step, numpy over {runs} runs", f"{backward:.0f}", "")
    ours, states = component(study)
    table.add_row("component Ekf, generated Python", f"{ours:.0f}", "what its FMU runs")
    table.add_row("component Ekf, generated C", f"{1e3 * in_c('gapsense.estimators.ekf', single=False):.0f}", "gcc -O2")
    try:
        theirs, found = peer(study, states)
        free = np.cumprod((states[1:, 0] > 0.0) & (states[1:, 0] < 1.0)) == 1  # it knows no bounds
        difference = np.max(np.abs(found - states[1:, :5])[free] / [1.0, 1.0, 0.02, 0.1, 1e-3])
        table.add_row(
            "filterpy ExtendedKalmanFilter",
            f"{theirs:.0f}",
            f"same states within {difference:.0e} for {free.sum()} samples",
        )
    except ImportError:
        table.add_row("filterpy ExtendedKalmanFilter", "-", "not installed: pip install -e '.[peers]'")
    Console(width=None if sys.stdout.isatty() else 120).print(table)


def over_runs(study: Study, runs: int) -> tuple[float, float]:
    """The numpy code: a step of the filter and one of the smoother, in the middle of the making."""
    s, m = study.samples, study.model
    varied = perturbed(m, 0.01 * errors(1, 0, runs))
    current = s.current[:, None] + noise(1, 0, runs, s.time.size, TUNING.noise_current)
    motion = next(filtered(s, current, varied, Estimator(Variant(), TUNING, m)))
    middle = len(motion.filtered) // 2
    given = (float(s.voltage[motion.first + middle]), current[motion.first + middle + 1])
    rows = motion.filtered[middle : middle + 2]
    forward, backward = forward_step(m, Variant(), MOVING, MOVING), backward_step(m, Variant())
    steps = (
        lambda: forward(rows[0], given, varied, TUNING),
        lambda: backward(rows[0], given[:1], rows[1], varied, TUNING),
    )
    return tuple(1e9 * best(step, 20) / runs for step in steps)


def component(study: Study) -> tuple[float, Any]:
    """The generated Python of the component along the making, and its states (N, 5)."""
    s, m = study.samples, study.model
    par = tuple(filter_parameters(m, Varied(*([value] for value in unvaried(m))), 0, TUNING, Variant()))
    measured = zip(s.voltage.tolist(), s.current.tolist(), s.mode.tolist())
    given = [tuple(ekf.Inputs(*row)) for row in measured]
    scalar, (first, landed) = Kernel(ekf).scalar, motions(s.mode)[0]
    state, _ = scalar["initial"](given[0], par)
    advance, constants = scalar["advance"], scalar["constants"](par)
    for inputs in given[1 : first + 1]:
        state, _ = advance(state, inputs, constants)

    def run() -> list[Any]:
        states = [state]
        for inputs in given[first + 1 : landed]:
            states.append(advance(states[-1], inputs, constants)[0])
        return states

    return 1e9 * best(run, 3) / (landed - first - 1), np.array([row[:20] for row in run()])


def peer(study: Study, ours: Any) -> tuple[float, Any]:
    """Filterpy along the making from the same start, and its states."""
    from filterpy.kalman import ExtendedKalmanFilter

    s, m = study.samples, study.model
    p = {**textbook.TABLE_I, "R_c0": m.R_c0, "lam_sat": m.lam_sat}
    first, landed = motions(s.mode)[0]
    P = np.empty((5, 5))
    i, j = np.triu_indices(5)
    P[i, j] = P[j, i] = ours[0, 5:20]
    voltage, current = s.voltage.tolist(), s.current.tolist()

    class Peer(ExtendedKalmanFilter):  # type: ignore[misc]
        def predict_x(self, u: float = 0.0) -> None:
            self.F = textbook.F(self.x, 2, p)
            self.x = textbook.f(self.x, u, 2, p)

    def run() -> list[Any]:
        peer, found = Peer(5, 1), []
        peer.x, peer.P, peer.R = ours[0, :5].copy(), P.copy(), np.array([[TUNING.noise_current**2]])
        variances = np.square(
            [TUNING.process_flux_linkage, TUNING.process_current_error, TUNING.process_force_error * m.l_z]
        )
        peer.Q = np.diag([0.0, 0.0, *variances])
        for k in range(first + 1, landed):
            peer.predict(voltage[k - 1])
            peer.update(
                np.array([current[k]]), lambda x: textbook.H(x, p)[None], lambda x: np.array([textbook.h(x, p)])
            )
            found.append(peer.x)
        return found

    seconds = best(run, 3)
    return 1e9 * seconds / (landed - first - 1), np.array(run())


def best(function: Callable[[], Any], repeats: int) -> float:
    """Seconds per call in the fastest of some passes."""
    found = []
    for _ in range(PASSES):
        begin = process_time()
        for _ in range(repeats):
            function()
        found.append((process_time() - begin) / repeats)
    return min(found)


if __name__ == "__main__":
    main()
