"""The valve against an independent model, integrated by DOP853 with events."""

import numpy as np
import pytest
from relay import RELAY
from scipy.integrate import solve_ivp

from gapsense.studies.devices import VALVE

MU_0 = 4e-7 * np.pi
TIME = 1e-7  # contact and release [s]
SLOWEST, START = 1e-3, 1e-9  # rebound at least [m/s]; its first Euler step [s]


class Oracle:
    """(49) to (53) written down a second time; states scaled to about one for the tolerances."""

    def __init__(self, par):
        self.par, self.scale = par, np.array([par.core_saturation, par.stop_upper, 0.5])

    def gap(self, h):
        p = self.par
        if p.gap_law == 0:
            return p.gap_slope * h, p.gap_slope
        if p.gap_law == 2:
            columns = p.gap_file_reluctance, p.gap_file_slope
            return tuple(np.interp(h, p.gap_file_gap, column) for column in columns)
        r0, k = 1 / (MU_0 * p.gap_area), p.gap_area**-0.5
        if h <= 1e-12:
            return r0 * h, r0
        below = 1 + k * h * np.log(2 * p.gap_window / h)
        return r0 * h / below, r0 * (1 + k * h) / below**2

    def net_force(self, flux_linkage, h):
        p = self.par
        magnetic = -0.5 * (flux_linkage / p.coil_turns) ** 2 * self.gap(h)[1]
        return magnetic - p.spring_stiffness * (h - p.spring_rest)

    def rates(self, t, y, u, mode):
        p, (flux_linkage, h, v) = self.par, y * self.scale
        R = self.gap(h)[0] + p.core_reluctance / (1 - abs(flux_linkage) / p.core_saturation)
        rates = [u - p.coil_resistance * flux_linkage * R / p.coil_turns**2, 0.0, 0.0]
        if mode == 2:
            rates[1:] = v, (self.net_force(flux_linkage, h) - p.damping * v) / p.mover_mass
        return rates / self.scale

    def guards(self, mode):
        """Functions that fall through zero where the mode ends, and the mode after each."""
        p, (a, b, _) = self.par, self.scale
        if mode == 2:
            guards = [(lambda t, y, u, m: y[1] - p.stop_lower / b, 1), (lambda t, y, u, m: p.stop_upper / b - y[1], 3)]
        else:
            guards = [(lambda t, y, u, m: (m - 2) * self.net_force(y[0] * a, y[1] * b), 2)]
        for guard, _ in guards:
            guard.terminal, guard.direction = True, -1
        return guards

    def run(self, segments, times):
        """States (n, 3) and modes (n,) at `times`, and the events (time, mode before, mode after)."""
        p, mode, events = self.par, 3, []
        y, found, modes = (
            np.array([0.0, p.initial_position, 0.0]) / self.scale,
            np.zeros((len(times), 3)),
            [0] * len(times),
        )
        for t, end, u in segments:
            while t < end:
                guards = self.guards(mode)
                part = solve_ivp(
                    self.rates, (t, end), y, "DOP853", events=[g for g, _ in guards], args=(u, mode),
                    rtol=1e-12, atol=1e-13, max_step=2e-4, dense_output=True,
                )  # fmt: skip
                for k in np.flatnonzero((times >= t - 1e-15) & (times <= part.t[-1] + 1e-15)):
                    found[k], modes[k] = part.sol(np.clip(times[k], t, part.t[-1])) * self.scale, mode
                t, y = part.t[-1], part.y[:, -1]
                if part.status == 1:
                    after = next(m for (_, m), hits in zip(guards, part.t_events) if len(hits))
                    events.append((t, mode, after))
                    mode = after
                    if mode != 2:
                        back = -p.stop_restitution * y[2]
                        is_back = abs(back) * self.scale[2] >= SLOWEST
                        y[1:] = (p.stop_lower if mode == 1 else p.stop_upper) / self.scale[1], back if is_back else 0.0
                        if is_back:  # a little on, for a guard must not begin at its zero
                            mode, y, t = 2, y + self.rates(t, y, u, 2) * START, t + START
        return found, np.array(modes), events


# The kinks of the table cost the flux linkage two digits: Runge-Kutta steps cross them unseen.
@pytest.mark.parametrize(
    ("par", "period", "cycles", "flux_tolerance"),
    [
        pytest.param(VALVE, 20e-3, 2, 1e-9, id="linear"),
        pytest.param(VALVE._replace(gap_law=1.0), 20e-3, 2, 1e-9, id="fringing"),
        pytest.param(VALVE._replace(gap_law=2.0), 20e-3, 2, 1e-6, id="table"),
        pytest.param(RELAY, 50e-3, 2, 1e-9, id="relay", marks=pytest.mark.slow),
    ],
)
def test_valve_equals_dop853(kernel, square, run, par, period, cycles, flux_tolerance):
    segments = square(period, cycles)
    times = np.arange(round(cycles * period / 50e-6) + 1) * 50e-6
    expected, modes, events = Oracle(par).run(segments, times)
    assert [e[1:] for e in events] == [(3, 2), (2, 1), (1, 2), (2, 3)] * cycles

    found = run(kernel, par, segments, times)
    states = np.array([state[:3] for state, _ in found], dtype=float)
    assert np.abs(states - expected)[:, 0].max() < flux_tolerance * expected[:, 0].max()
    assert np.abs(states - expected)[:, 1].max() < 1e-9
    assert np.abs(states - expected)[:, 2].max() < 1e-5
    assert [outputs.mode for _, outputs in found] == modes.tolist()

    instants = np.array([t for t, _, _ in events])
    before = [state.mode for state, _ in run(kernel, par, segments, instants - TIME)]
    after = [state.mode for state, _ in run(kernel, par, segments, instants + TIME)]
    assert (before, after) == ([e[1] for e in events], [e[2] for e in events])


@pytest.mark.parametrize("restitution", [0.3, 0.7])
def test_bouncing_valve_equals_dop853(kernel, square, run, restitution):
    par, segments = VALVE._replace(stop_restitution=restitution), square(20e-3, 1)
    times = np.arange(401) * 50e-6
    expected, modes, events = Oracle(par).run(segments, times)
    assert [e[2] for e in events if e[1] == 2].count(1) > 4  # impacts on the lower stop
    found = run(kernel, par, segments, times)
    states = np.array([state[:3] for state, _ in found], dtype=float)
    assert np.abs(states - expected).max(axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=2e-5)
    assert np.abs(states - expected)[:, 1].max() < 2e-9
    assert [outputs.mode for _, outputs in found] == modes.tolist()
