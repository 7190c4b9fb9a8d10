"""The reluctance actuator against an independent model, integrated by DOP853 with events.

The model is written with the symbols of the paper: states flux and H_c, M_irr explicit, mu_delta by its formula.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from gapsense.actuators import reluctance_actuator
from gapsense.actuators.parameters import RTS_VALVE
from gapsense.fmi.tables import read_table
from gapsense.kernel import Kernel

MU_0 = 4e-7 * np.pi
TIME = 1e-7  # contact and release [s]
SETTLED = 1e-7
SCALE = np.array([2e-5, 1e3, 1e-3, 0.5])


class Oracle:
    """(1) to (12) and the choices of papers.md; states scaled to about one for the tolerances."""

    def __init__(self, par):
        self.p = par
        self.spline = CubicSpline(par.gap_file_gap, par.gap_file_reluctance)
        self.k = par.core_eddy_conductance * par.eddy_currents

    def gap(self, z):
        p = self.p
        if p.gap_law == 1:
            return self.spline(z), self.spline(z, 1)
        w = 1 + p.gap_fringing * z * np.log(p.gap_window / z)
        R_prime = p.gap_slope * (1 / w - z * p.gap_fringing * (np.log(p.gap_window / z) - 1) / w**2)
        return p.gap_reluctance + p.gap_slope * z / w, R_prime

    def core(self, phi, H):
        """M_an - M_irr, and dM_an/dH_e."""
        p = self.p
        M = phi / (p.core_area * MU_0) - H
        H_e = H + p.core_coupling * M
        x = H_e / p.core_shape
        L = x / 3 - x**3 / 45 + 2 * x**5 / 945 if abs(x) < 1e-2 else 1 / np.tanh(x) - 1 / x
        L_prime = (
            1 / 3 - x**2 / 15 + 2 * x**4 / 189 if abs(x) < 1e-2 else 1 / x**2 - 1 / np.sinh(np.clip(x, -300, 300)) ** 2
        )
        if not p.saturation:
            L, L_prime = x / 3, 1 / 3
        M_an, c = p.core_magnetization * L, p.core_reversibility
        return M_an - (M - c * M_an) / (1 - c), p.core_magnetization / p.core_shape * L_prime

    def flux_rate(self, phi, H, z, u):
        p, N = self.p, self.p.coil_turns
        total = N**2 + p.coil_resistance * self.k
        i = N * (self.gap(z)[0] * phi + H * p.core_length) / total + self.k / total * u
        return (u - p.coil_resistance * i) / N

    def net_force(self, phi, z):
        return self.p.spring_stiffness * (self.p.spring_rest - z) - 0.5 * self.gap(z)[1] * phi**2

    def rates(self, t, y, u, q, walls):
        p, (phi, H, z, v) = self.p, y * SCALE
        phi_dot = self.flux_rate(phi, H, z, u)
        D, slope = self.core(phi, H)
        c = p.core_reversibility
        chi = (1 - c) * walls * D / p.core_pinning + c * slope if p.hysteresis else slope
        mu_delta = MU_0 * (1 + (1 - p.core_coupling) * chi) / (1 - p.core_coupling * chi)
        rates = [phi_dot, phi_dot / (p.core_area * mu_delta), 0.0, 0.0]
        if q == 2:
            rates[2:] = v, (self.net_force(phi, z) - p.damping * v) / p.mover_mass
        return rates / SCALE

    def guards(self, q, delta, walls):
        """Functions that fall through zero where a branch of the model ends, and the mode after each."""
        p = self.p
        guards = []
        if q == 2:
            guards += [(lambda t, y, *_: y[2] - p.stop_lower / SCALE[2], 1)]
            guards += [(lambda t, y, *_: p.stop_upper / SCALE[2] - y[2], 3)]
        else:
            guards += [(lambda t, y, *_: (q - 2) * self.net_force(y[0] * SCALE[0], y[2] * SCALE[2]), 2)]
        if p.hysteresis:
            # beyond zero, or rounding errors would turn round the flux of a settled coil for ever
            guards += [(lambda t, y, u, *_: delta * self.flux_rate(*(y * SCALE)[:3], u) / 0.01 + SETTLED, q)]
            if walls == 0:
                guards += [(lambda t, y, *_: -delta * self.core(*(y * SCALE)[:2])[0] / 1e5, q)]
        for guard, _ in guards:
            guard.terminal, guard.direction = True, -1
        return guards

    def run(self, segments, times):
        """States (n, 4) at `times`, and the events (time, mode before, mode after)."""
        p, q, events, switches = self.p, 3, [], 0
        y, found = np.array([0.0, 0.0, p.initial_position, 0.0]) / SCALE, np.zeros((len(times), 4))
        for t, end, u in segments:
            delta = 1 if self.flux_rate(*(y * SCALE)[:3], u) >= 0 else -1
            walls = delta if delta * self.core(*(y * SCALE)[:2])[0] >= 0 else 0
            while t < end:
                guards = self.guards(q, delta, walls)
                part = solve_ivp(
                    self.rates, (t, end), y, "DOP853", events=[g for g, _ in guards], args=(u, q, walls),
                    rtol=1e-12, atol=1e-13, max_step=2e-4, dense_output=True,
                )  # fmt: skip
                for k in np.flatnonzero((times >= t - 1e-15) & (times <= part.t[-1] + 1e-15)):
                    found[k] = part.sol(np.clip(times[k], t, part.t[-1])) * SCALE
                t, y = part.t[-1], part.y[:, -1]
                if part.status != 1:
                    continue
                hit = next(n for n, hits in enumerate(part.t_events) if len(hits))
                contacts = 2 if q == 2 else 1
                if hit < contacts:
                    events.append((t, q, guards[hit][1]))
                    q = guards[hit][1]
                    if q != 2:
                        y[2:] = (p.stop_lower if q == 1 else p.stop_upper) / SCALE[2], 0.0
                elif hit == contacts:  # the flux turns round: moving walls freeze, frozen ones move
                    delta, walls, switches = -delta, 0 if walls else -delta, switches + 1
                else:
                    walls, switches = delta, switches + 1
        return found, events, switches


LEVELS = [30.0, 12.0, 20.0, 8.0, 0.0, -6.0, 3.0, 0.0, 40.0, 0.0]
STEPS = [(k * 5e-3, (k + 1) * 5e-3, u) for k, u in enumerate(LEVELS)]
FILE = Path(__file__).parents[2] / "fmus" / "reluctance_actuator" / "fringing_29.csv"
COLUMNS = read_table(FILE, ("rising:gap", "rising:reluctance", "spline:reluctance"))
TABLE = RTS_VALVE._replace(
    gap_law=1.0, gap_file_gap=COLUMNS[0], gap_file_reluctance=COLUMNS[1], gap_file_spline=COLUMNS[2]
)


@pytest.fixture(scope="module")
def actuator():
    return Kernel(reluctance_actuator)


@pytest.mark.parametrize(
    ("par", "levels"),
    [
        pytest.param(RTS_VALVE, False, id="complete"),
        pytest.param(RTS_VALVE, True, id="minor loops"),
        pytest.param(TABLE, False, id="table"),
        pytest.param(RTS_VALVE._replace(eddy_currents=0.0), False, id="no eddy currents"),
        pytest.param(RTS_VALVE._replace(hysteresis=0.0), False, id="no hysteresis"),
        pytest.param(RTS_VALVE._replace(saturation=0.0), False, id="no saturation"),
    ],
)
def test_actuator_equals_dop853(actuator, square, run, par, levels):
    segments = STEPS if levels else square(20e-3, 2)
    times = np.arange(round(segments[-1][1] / 100e-6) + 1) * 100e-6
    expected, events, switches = Oracle(par).run(segments, times)
    assert len(events) >= 6
    assert switches >= (7 if levels else 3) or not par.hysteresis

    found = run(actuator, par, segments, times, step=50e-6)
    states = np.array([[s.flux, o.core_field, s.position, s.velocity] for s, o in found], dtype=float)
    errors = np.abs(states - expected).max(axis=0)
    assert errors[0] < 3e-8 * expected[:, 0].max()
    assert errors[1] < 3e-7 * expected[:, 1].max()
    assert errors[2] < 1e-9
    assert errors[3] < 1e-5

    instants = np.array([t for t, _, _ in events])
    before = [s.mode for s, _ in run(actuator, par, segments, instants - TIME, step=50e-6)]
    after = [s.mode for s, _ in run(actuator, par, segments, instants + TIME, step=50e-6)]
    assert (before, after) == ([e[1] for e in events], [e[2] for e in events])
