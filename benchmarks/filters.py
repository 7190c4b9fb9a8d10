"""Nanoseconds per step and run of the estimators of [RTS] in motion: `python benchmarks/filters.py [--figure-9]`.

Filter, smoother and open loop over many runs in C, and one run in scalar Python; the generated Python and
C of the component `Ekf` (with its outputs in SI units); and filterpy's ExtendedKalmanFilter with the same model, whose
functions and Jacobians are written out in numpy.  All but the C of the component step the motion of the soft-landing
cycle; that steps random inputs, as in kernels.py.  CPU time, the best of some passes.  On request also the seconds of
all of Fig. 9, `gapsense study monte-carlo`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter, process_time
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
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.lanes import Code, Row, plan
from gapsense.scenarios.soft_landing.batch import (
    MOVING,
    Tuning,
    Variant,
    Varied,
    backward_step,
    forward_step,
    open_step,
)
from gapsense.scenarios.soft_landing.comparison import compare
from gapsense.scenarios.soft_landing.cycle import sampled, soft_landing
from gapsense.scenarios.soft_landing.rts import motions
from gapsense.scenarios.soft_landing.runs import Estimator, filtered
from gapsense.scenarios.soft_landing.setting import CHUNK, Study, errors, noise, nominal, perturbed, studied, unvaried

TUNING = Tuning(1.94e-5, 1.2e-3, 21e-3, 2e-3)
PASSES, REPEATS = 5, 20
STEPS = ("filter", "backward step of the smoother", "open loop")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--figure-9", action="store_true", help="also the seconds of the whole study, on 2 processes")
    study = Study(sampled(soft_landing()[-1]), nominal())
    table = Table(title="Nanoseconds per step and run, in motion")
    table.add_column("what")
    table.add_column("ns", justify="right")
    table.add_column("remark")
    if parser.parse_args().figure_9:
        table.add_row("all of Fig. 9, 130,000 runs", f"{figure_9():.1f} s", "not nanoseconds")
    for what, (code, rows) in zip(STEPS, steps_of(study)):
        for count in (1000, CHUNK):
            table.add_row(f"{what}, C over {count} runs", f"{in_lanes(code, rows, count):.1f}", "as in the studies")
        table.add_row(f"{what}, scalar Python", f"{alone(code, rows):.0f}", "without a compiler")
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


def figure_9() -> float:
    """Seconds of the study, with a library that was compiled before."""
    study = studied("fitted", 1)
    compare(study, [0.01], 1, 1)
    begin = perf_counter()
    compare(study)
    return perf_counter() - begin


def steps_of(study: Study) -> list[tuple[Code, list[Row]]]:
    """A step of each of `STEPS` and the rows of a run that it takes, in the middle of the making."""
    s, m = study.samples, study.model
    varied = Varied(*(float(np.squeeze(value)) for value in perturbed(m, 0.01 * errors(1, 0, 1))))
    current = (s.current + noise(1, 0, 1, s.time.size, TUNING.noise_current)[:, 0]).tolist()
    motion = next(filtered(s, current, varied, Estimator(Variant(), TUNING, m)))
    middle = len(motion.filtered) // 2
    voltage = float(s.voltage[motion.first + middle])
    row, later = motion.filtered[middle : middle + 2]
    return [
        (
            forward_step(m, Variant(), MOVING, MOVING),
            [row, (voltage, current[motion.first + middle + 1]), varied, TUNING],
        ),
        (backward_step(m, Variant()), [row, (voltage,), later, varied, TUNING]),
        (open_step(m, MOVING, MOVING), [row[:3], (voltage,), varied]),
    ]


def in_lanes(code: Code, rows: list[Row], runs: int) -> float:
    """As calls of a plan; what a run takes does not depend on its numbers."""
    columns = {f"row_{k}": np.array([np.full(runs, entry) for entry in row]) for k, row in enumerate(rows)}

    def repeated(**columns: Row) -> Row:
        return [code(*columns.values()) for _ in range(REPEATS)][-1]

    made = plan(repeated, **{name: len(column) for name, column in columns.items()})
    made.run(runs, **columns)
    return 1e9 * best(lambda: made.run(runs, **columns), 3) / (runs * REPEATS)


def alone(code: Code, rows: list[Row]) -> float:
    """One run in scalar Python."""
    return 1e9 * best(lambda: code.python(*rows), 1000)


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
        """States of ours from sample to sample."""
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
        """State and covariance of the peer from sample to sample."""
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
