"""The pot magnet against an independent model in the printed states (i, s, v), integrated by DOP853 with events."""

import numpy as np
import pytest
from magnets import POT_MAGNET, POT_MAGNET_PRINTED
from scipy.integrate import solve_ivp

from gapsense.actuators import pot_magnet
from gapsense.kernels.kernel import Kernel

MU_0 = 1.257e-6
TIME = 1e-7  # of a change of mode [s]
SCALE = np.array([0.2, 0.5e-3, 0.1])
VOLTAGE = ((2, 3), (3, 2))  # changes that an edge of the voltage brings about


class Oracle:
    """(9) to (20) with all transitions of the automaton, also those not in print, in current."""

    def __init__(self, par):
        self.par = p = par
        self.up = -1.0 if p.orientation else 1.0  # sign of dL/ds
        self.K5 = p.coil_turns**2 * p.core_permeability * MU_0 * p.pole_area

    def inductance(self, s):
        p = self.par
        path = p.core_length + 2.0 * p.core_permeability * (s if p.orientation else p.stop_upper - s)
        return self.K5 / path, self.up * 2.0 * p.core_permeability * self.K5 / path**2

    def net_force(self, i, s):
        return 0.5 * i**2 * abs(self.inductance(s)[1]) - self.par.mover_mass * self.par.gravity

    def rates(self, t, y, u, q):
        i, s, v = y * SCALE
        L, slope = self.inductance(s)
        R = self.par.coil_resistance_upper if q >= 3 else self.par.coil_resistance
        if q in (0, 2, 3):
            return np.array([(u - R * i) / L, 0.0, 0.0]) / SCALE
        return np.array([(u - (R + slope * v) * i) / L, v, self.net_force(i, s) / self.par.mover_mass]) / SCALE

    def guards(self, q):
        """Functions that fall through zero where the mode ends, and the mode after each."""
        p = self.par

        def lift(t, y, u, q):
            i, s, _ = y * SCALE
            return -min(i / p.current_on - 1.0, self.net_force(i, s))

        def drop(t, y, u, q):
            i, s, _ = y * SCALE
            return -min(1.0 - i / p.current_off, -self.net_force(i, s))

        landing = (lambda t, y, u, q: y[1], 0)
        arrival = (lambda t, y, u, q: p.stop_upper / SCALE[1] - y[1], 2 if q == 1 else 3)
        guards = {0: [(lift, 1)], 1: [landing, arrival], 2: [], 3: [(drop, 4)], 4: [landing, arrival, (lift, 1)]}[q]
        for guard, _ in guards:
            guard.terminal, guard.direction = True, -1
        return guards

    def run(self, segments, times):
        """States (n, 3) and modes (n,) at `times`, and the events (time, mode before, mode after)."""
        p, q, events, y = self.par, 0, [], np.zeros(3)
        found, modes = np.zeros((len(times), 3)), np.zeros(len(times))
        for t, end, u in segments:
            while t < end:
                sustains = u >= p.coil_resistance_upper * p.current_off
                if q in (2, 3) and (new := 2 if sustains else 3) != q:
                    events.append((t, q, new))
                    q = new
                guards = self.guards(q)
                part = solve_ivp(
                    self.rates, (t, end), y, "DOP853", events=[g for g, _ in guards] or None, args=(u, q),
                    rtol=1e-12, atol=1e-13, max_step=2e-4, dense_output=True,
                )  # fmt: skip
                for k in np.flatnonzero((times >= t - 1e-15) & (times <= part.t[-1] + 1e-15)):
                    found[k], modes[k] = part.sol(np.clip(times[k], t, part.t[-1])) * SCALE, q
                t, y = part.t[-1], part.y[:, -1]
                if part.status == 1:
                    new = next(m for (_, m), hits in zip(guards, part.t_events) if len(hits))
                    events.append((t, q, new))
                    q = new
                    if q in (0, 2, 3):
                        y[1:] = (0.0 if q == 0 else p.stop_upper) / SCALE[1], 0.0
        return found, modes, events


def pulses(*parts):
    """Segments (start, end, voltage) from durations and voltages."""
    ends = np.cumsum([duration for duration, _ in parts]).tolist()
    return [(end - duration, end, u) for end, (duration, u) in zip(ends, parts)]


CYCLE = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 0)]
CASES = {
    "consistent": (POT_MAGNET, pulses((0.05, 24.0), (0.05, 0.0)), CYCLE),
    "printed": (POT_MAGNET_PRINTED, pulses((0.05, 24.0), (0.05, 0.0)), CYCLE),
    "printed, 0.2 mm": (POT_MAGNET_PRINTED._replace(stop_upper=0.2e-3), pulses((0.05, 24.0), (0.05, 0.0)), CYCLE),
    "consistent, 0.5 mm": (POT_MAGNET._replace(stop_upper=0.5e-3), pulses((0.1, 24.0), (0.05, 0.0)), []),
    "lift that fails": (POT_MAGNET, pulses((0.003, 24.0), (0.03, 0.0)), [(0, 1), (1, 0)]),
    "voltage back in time": (
        POT_MAGNET,
        pulses((0.05, 24.0), (0.005, 0.0), (0.03, 24.0)),
        [(0, 1), (1, 2), (2, 3), (3, 2)],
    ),
    "pulled back": (
        POT_MAGNET,
        pulses((0.05, 24.0), (0.017, 0.0), (0.03, 24.0)),
        [(0, 1), (1, 2), (2, 3), (3, 4), (4, 3), (3, 2)],
    ),
    "energised again while falling": (
        POT_MAGNET,
        pulses((0.05, 24.0), (0.021, 0.0), (0.05, 60.0)),
        [(0, 1), (1, 2), (2, 3), (3, 4), (4, 1), (1, 2)],
    ),
}


@pytest.fixture(scope="module")
def kernel():
    return Kernel(pot_magnet)


@pytest.mark.parametrize("case", CASES)
def test_pot_magnet_equals_dop853(kernel, run, case):
    par, segments, transitions = CASES[case]
    times = np.arange(round(segments[-1][1] / 1e-4) + 1) * 1e-4
    expected, modes, events = Oracle(par).run(segments, times)
    assert [e[1:] for e in events] == transitions

    found = run(kernel, par, segments, times, step=1e-4)
    states = np.array([[o.current, o.position, o.velocity] for _, o in found])
    assert np.abs(states - expected)[:, 0].max() < 1e-8
    assert np.abs(states - expected)[:, 1].max() < 1e-10
    assert np.abs(states - expected)[:, 2].max() < 1e-6
    away = np.min(np.abs(times[:, None] - [segment[1] for segment in segments]), axis=1) > 1e-9  # from the edges
    assert np.array([o.mode for _, o in found])[away].tolist() == modes[away].tolist()

    located = [e for e in events if e[1:] not in VOLTAGE]
    for shift, place in ((-TIME, 1), (TIME, 2)):
        around = run(kernel, par, segments, np.array([e[0] for e in located]) + shift, step=1e-4)
        for (state, _), event in zip(around, located):
            assert state.mode == event[place] or (event[place], state.mode) in VOLTAGE  # 3 -> 2 follows 4 -> 3 at once
