"""The reluctance actuator as an independent model, integrated by DOP853 with events.

The model is written with the symbols of the paper: states flux and H_c, M_irr explicit, mu_delta by its formula.
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

MU_0 = 4e-7 * np.pi
SETTLED = 1e-7
GRAZED = 1e-9
SCALE = np.array([2e-5, 1e3, 1e-3, 0.5])


def constant(level):
    return lambda t: level


class Oracle:
    """(1) to (12) and our choices where the paper is silent; states scaled to about one for the tolerances."""

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
        phi_dot = self.flux_rate(phi, H, z, u(t))
        D, slope = self.core(phi, H)
        c = p.core_reversibility
        chi = (1 - c) * walls * D / p.core_pinning + c * slope if p.hysteresis else slope
        mu_delta = MU_0 * (1 + (1 - p.core_coupling) * chi) / (1 - p.core_coupling * chi)
        rates = [phi_dot, phi_dot / (p.core_area * mu_delta), 0.0, 0.0]
        if q == 2:
            rates[2:] = v, (self.net_force(phi, z) - p.damping * v - p.friction * v / (abs(v) + 2e-3)) / p.mover_mass
        return rates / SCALE

    def guards(self, q, delta, walls):
        """Functions that fall through zero where a branch of the model ends, and the mode after each."""
        p = self.p
        guards = []
        if q == 2:  # beyond the stop by some atoms, or rounding errors would end a motion that starts without force
            guards += [(lambda t, y, *_: GRAZED + y[2] - p.stop_lower / SCALE[2], 1)]
            guards += [(lambda t, y, *_: GRAZED + p.stop_upper / SCALE[2] - y[2], 3)]
        else:
            guards += [(lambda t, y, *_: p.friction + (q - 2) * self.net_force(y[0] * SCALE[0], y[2] * SCALE[2]), 2)]
        if p.hysteresis:
            # beyond zero, or rounding errors would turn round the flux of a settled coil for ever
            guards += [(lambda t, y, u, *_: delta * self.flux_rate(*(y * SCALE)[:3], u(t)) / 0.01 + SETTLED, q)]
            if walls == 0:
                guards += [(lambda t, y, *_: -delta * self.core(*(y * SCALE)[:2])[0] / 1e5, q)]
        for guard, _ in guards:
            guard.terminal, guard.direction = True, -1
        return guards

    def run(self, segments, times):
        """States (n, 4) at `times`, the events (time, mode before, mode after), and the number of other switches.

        Segments are (start, end, voltage), the voltage a number or a function of time.
        """
        p, q, events, switches = self.p, 3, [], 0
        y, found = np.array([0.0, 0.0, p.initial_position, 0.0]) / SCALE, np.zeros((len(times), 4))
        for t, end, level in segments:
            u = level if callable(level) else constant(level)
            delta = 1 if self.flux_rate(*(y * SCALE)[:3], u(t)) >= 0 else -1
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
