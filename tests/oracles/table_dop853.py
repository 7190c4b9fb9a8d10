"""The actuator from a table as an independent model, integrated by DOP853 with events.

States flux linkage, gap and velocity; the table as products of SciPy's cardinal splines.  Phases: the mover rests, or
slides in one direction, on a stop or on none.  Hysteresis is not in it.
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

SCALE = np.array([1e-2, 1e-3, 0.5])
GRAZED = 1e-9  # in units of SCALE, beyond a zero: rounding errors end no motion that has just begun


class Oracle:
    """The equations of the component's page; states scaled to about one."""

    def __init__(self, par):
        self.p = p = par
        self.gaps = np.unique(par.map_file_gap)
        columns = len(par.map_file_gap) // len(self.gaps)
        lam = np.array(par.map_file_axis[:columns])
        current = np.reshape(par.map_file_current, (len(self.gaps), columns))
        self.table = np.hstack([-current[:, :0:-1], current])
        self.across = CubicSpline(self.gaps, np.eye(len(self.gaps)))
        self.along = CubicSpline(np.r_[-lam[:0:-1], lam], np.eye(2 * columns - 1))
        self.energies = self.along.antiderivative()
        self.mass = p.mover_mass + p.mover_load
        self.k = p.core_eddy_conductance * p.eddy_currents
        self.elastic = p.stop_law == 1.0

    def static_current(self, lam, h):
        return self.across(h) @ self.table @ self.along(lam)

    def energy(self, lam, h, derivative=0):
        return self.across(h, derivative) @ self.table @ (self.energies(lam) - self.energies(0.0))

    def current(self, lam, h, u):
        """N i = N i_s + k dphi/dt with dphi/dt = (u - R i) / N."""
        p = self.p
        per_turn = self.k / p.coil_turns**2
        return (self.static_current(lam, h) + per_turn * u) / (1.0 + per_turn * p.coil_resistance)

    def other_forces(self, h):
        p = self.p
        spring = p.spring_stiffness * (p.spring_rest - h)
        if p.spring_law == 1.0:
            spring = np.interp(h, p.spring_file_gap, p.spring_file_force)
        return spring + p.spring_preload + self.mass * p.gravity

    def stop_force(self, q, h, v):
        if not self.elastic or q == 2:
            return 0.0
        depth, speed = (self.p.stop_lower - h, -v) if q == 1 else (h - self.p.stop_upper, v)
        return (2 - q) * self.p.stop_stiffness * depth * max(0.0, 1.0 + self.p.stop_damping * speed)

    def net_force(self, lam, h, q, v=0.0):
        return -self.energy(lam, h, 1) + self.other_forces(h) + self.stop_force(q, h, v)

    def rates(self, t, y, u, q, s):
        lam, h, v = y * SCALE
        rate = u - self.p.coil_resistance * self.current(lam, h, u)
        if s == 0:
            return np.array([rate, 0.0, 0.0]) / SCALE
        force = self.net_force(lam, h, q, v) - self.p.damping * v - self.p.friction * s
        return np.array([rate, v, force / self.mass]) / SCALE

    def held(self, lam, h, q):
        """By how much a mover at rest is held."""
        net = self.net_force(lam, h, q)
        return self.p.friction - ((2 - q) * net if q != 2 and not self.elastic else abs(net))

    def guards(self, q, s):
        p, low, high = self.p, self.p.stop_lower / SCALE[1], self.p.stop_upper / SCALE[1]
        if s == 0:
            guards = [(lambda t, y, *_: GRAZED + self.held(*(y * SCALE)[:2], q), "released")]
        else:
            guards = [(lambda t, y, *_: GRAZED + s * y[2], "turned")] if p.friction else []
            places = {1: low + GRAZED, 3: -high + GRAZED}
            if q == 2:
                guards += [(lambda t, y, *_: GRAZED + y[1] - low, 1), (lambda t, y, *_: GRAZED + high - y[1], 3)]
            else:
                guards += [(lambda t, y, *_: places[q] + (q - 2) * y[1], 2)]
        for guard, _ in guards:
            guard.terminal, guard.direction = True, -1
        return guards

    def settle(self, y, q):
        """Direction and stop of a mover whose speed is zero."""
        y[2] = 0.0
        lam, h, _ = y * SCALE
        if self.held(lam, h, q) >= 0.0:
            return 0, q
        return (1 if self.net_force(lam, h, q) > 0.0 else -1), (q if self.elastic else 2)

    def run(self, segments, times):
        """States (n, 3) at `times`, and what happened: (time, what, speed)."""
        p, events = self.p, []
        q = 1 if p.initial_position <= p.stop_lower else 3 if p.initial_position >= p.stop_upper else 2
        h = p.initial_position
        if self.elastic and q != 2:
            h += max(0.0, (q - 2) * self.other_forces(h)) * (q - 2) / p.stop_stiffness
        y, found = np.array([0.0, h, 0.0]) / SCALE, np.zeros((len(times), 3))
        s, q = self.settle(y, q)
        for t, end, u in segments:
            while t < end:
                guards = self.guards(q, s)
                part = solve_ivp(
                    self.rates, (t, end), y, "DOP853", events=[g for g, _ in guards], args=(u, q, s),
                    rtol=1e-11, atol=1e-12, max_step=1e-4, dense_output=True,
                )  # fmt: skip
                for k in np.flatnonzero((times >= t - 1e-15) & (times <= part.t[-1] + 1e-15)):
                    found[k] = part.sol(np.clip(times[k], t, part.t[-1])) * SCALE
                t, y = part.t[-1], part.y[:, -1]
                if part.status != 1:
                    continue
                what = next(w for (_, w), hits in zip(guards, part.t_events) if len(hits))
                events.append((t, what, y[2] * SCALE[2]))
                if what in ("released", "turned"):
                    s, q = self.settle(y, q)
                elif self.elastic:
                    q = what
                else:
                    y[1] = (p.stop_lower if what == 1 else p.stop_upper) / SCALE[1]
                    y[2] *= -p.stop_restitution
                    s, q = (-s if s else 0), 2
                    if abs(y[2] * SCALE[2]) < 1e-3:
                        s, q = self.settle(y, what)
                    else:
                        s = 1 if y[2] > 0.0 else -1
        return found, events
