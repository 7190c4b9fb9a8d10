"""A power stage and the reluctance actuator as one system, integrated by DOP853 with events.

Written independently of the kernel: no communication points, no local coil.  The coil's current follows from the flux
of the actuator and from the voltage of the circuit at the same instant.
"""

import numpy as np
from reluctance_dop853 import SCALE, Oracle
from scipy.integrate import solve_ivp

LOW_SIDE = ("low_side_diode", "low_side_zener", "low_side_tvs", "low_side_resistor")
TINY = 1e-9  # current beyond a threshold [A]
SOON = 1e-11  # a timer runs out, and a period begins, where so little is left [s]


class Stage:
    """The system; `p` parameters of the actuator, `s` those of the stage, `topology` and `law` their names.

    `commands` are rows (time, gate, lower gate, reference): what holds from this time on.
    """

    def __init__(self, actuator, stage, topology, law, commands):
        self.oracle, self.p, self.s = Oracle(actuator), actuator, stage
        self.topology, self.law, self.commands = topology, law, commands
        self.is_fast = stage.control_chop == 1.0
        self.a = self.b = self.live = self.boosting = False
        self.changed_a = self.changed_b = self.begun = -1.0
        self.q, self.delta, self.walls, self.sign = 3, 1, 0, 0
        self.dead = False, False  # legs whose switches are both off, in a part between two events
        self.switches = []  # times at which the current began or ceased to flow, or the upper switch changed

    # circuit

    def ways(self, sign):
        """Shares of link and boost capacitor, voltage and resistance on the way of a current of this sign."""
        s, kind = self.s, self.topology
        falls, rises = (0, 0, -s.diode_voltage, s.diode_resistance), (1, 0, s.diode_voltage, s.diode_resistance)
        ground, link, store = ((*share, 0.0, s.switch_resistance) for share in ((0, 0), (1, 0), (0, 1)))
        if kind in LOW_SIDE:
            Vd, rd, Vz, rz = s.diode_voltage, s.diode_resistance, s.clamp_voltage, s.clamp_resistance
            clamp = {
                "low_side_diode": (1, 0, Vd, rd),
                "low_side_zener": (1, 0, Vd + Vz, rd + rz),
                "low_side_tvs": (0, 0, Vz, rz),
                "low_side_resistor": (1, 0, Vd, rd + s.freewheel_resistance),
            }[kind]
            upper, lower = (1, 0, 0.0, 0.0), ground if self.a else clamp if sign > 0 else falls
        elif kind == "full_bridge":
            upper = (falls if sign > 0 else rises) if self.dead[0] or not self.live else link if self.a else ground
            lower = (rises if sign > 0 else falls) if self.dead[1] or not self.live else ground if self.b else link
        else:
            recovered = (0, 1, s.diode_voltage, s.diode_resistance) if kind == "boost" else rises
            fed = store if kind == "boost" and self.boosting else link
            upper = fed if self.a else falls if sign > 0 else rises
            lower = ground if self.b else recovered if sign > 0 else falls
        return tuple(x - y for x, y in zip(upper[:3], lower[:3])) + (upper[3] + lower[3] + s.cable_resistance,)

    def draw(self, y):
        """Charging current of the boost capacitor, and what is drawn for it."""
        s, link, boost = self.s, y[5], y[6]
        charge = s.boost_current * min(max((s.boost_voltage - boost) / (0.01 * s.boost_voltage), 0.0), 1.0)
        charge *= self.topology == "boost"
        return charge, charge * boost / (s.boost_efficiency * link)

    def coil(self, y):
        """Current without voltage [A], and its share by the voltage [S]."""
        p, (phi, H, z) = self.p, (y[:4] * SCALE)[:3]
        mmf = self.oracle.gap(z)[0] * phi + H * p.core_length
        total = p.coil_turns**2 + p.coil_resistance * self.oracle.k
        return p.coil_turns * mmf / total, self.oracle.k / total

    def conducting(self, y, sign):
        """Current, voltage of the coil and voltage of the link, if a current of this sign flows."""
        bus, boost, offset, Z = self.ways(sign)
        still, share = self.coil(y)
        link = y[5] + self.s.link_resistance * (y[4] - self.draw(y)[1])
        Z = Z + self.s.link_resistance * bus * bus
        source = bus * link + boost * y[6] + offset
        i = (still + share * source) / (1.0 + share * Z)
        return i, source - Z * i, link - self.s.link_resistance * bus * i, (bus, boost)

    def open_voltage(self, y):
        """Voltage of the coil without current [V]."""
        still, share = self.coil(y)
        if share:
            return -still / share
        p, (phi, H, z, v) = self.p, y[:4] * SCALE
        reluctance, slope = self.oracle.gap(z)
        chi = self.susceptibility(phi, H)
        mu = 4e-7 * np.pi * (1 + (1 - p.core_coupling) * chi) / (1 - p.core_coupling * chi)
        return -p.coil_turns * slope * v * phi * (self.q == 2) / (reluctance + p.core_length / (p.core_area * mu))

    def susceptibility(self, phi, H):
        p, (D, slope) = self.p, self.oracle.core(phi, H)
        c = p.core_reversibility
        return (1 - c) * self.walls * D / p.core_pinning + c * slope if p.hysteresis else slope

    def electric(self, y):
        """Current, voltage, voltage of the link, shares."""
        if self.sign:
            return self.conducting(y, self.sign)
        link = y[5] + self.s.link_resistance * (y[4] - self.draw(y)[1])
        return 0.0, self.open_voltage(y), link, (0, 0)

    def rates(self, t, y):
        s = self.s
        i, u, link, (bus, boost) = self.electric(y)
        charge, draw = self.draw(y)
        moved = self.oracle.rates(t, y[:4], lambda _: u, self.q, self.walls)
        return [
            *moved,
            (s.supply_voltage - s.supply_resistance * y[4] - link) / s.supply_inductance,
            (y[4] - draw - bus * i) / s.link_capacitance,
            (charge - boost * i) / s.boost_capacitance,
        ]

    # switches

    def level(self, t):
        """Upper threshold of a regulated current [A]."""
        if self.law == "current":
            return self.command(t)[2]
        return self.s.peak_current if t < self.begun + self.s.peak_duration - SOON else self.s.hold_current

    def command(self, t):
        return next(row[1:] for row in reversed(self.commands) if t >= row[0] - SOON)

    def phase(self, t):
        period = 1.0 / self.s.control_frequency
        return (t + SOON) % period, period

    def decide(self, t, i):
        """Set the switches for what comes after time t, where the current was i before it."""
        gate, lower, reference = self.command(t)
        if self.law in ("gate", "pwm"):
            live = True
            if self.law == "gate":
                a, b = gate > 0.5, lower > 0.5
            else:
                phase, period = self.phase(t)
                pulse = phase < abs(reference) * period
                a, b = (pulse, True) if reference >= 0 else (False, not pulse)
        else:
            live = reference > 0 if self.law == "current" else gate > 0.5
            if live and not self.live:
                a, self.begun, self.boosting = True, t, True
            else:
                a, is_timed = self.a, t >= self.changed_a + self.s.switch_minimum - SOON
                if is_timed and a and i >= self.level(t) - TINY:
                    a = False
                elif is_timed and not a:
                    by_clock = self.s.control_restart == 1.0 and self.phase(t)[0] < 2 * SOON and i < self.level(t)
                    a = by_clock or (self.s.control_restart == 0.0 and i <= self.level(t) - self.s.control_band + TINY)
                a = a and live
            b = live and (a or not self.is_fast)
            self.boosting = self.boosting and a
        if a != self.a or live != self.live:
            self.changed_a = t
            self.switches.append(t)
        if b != self.b or live != self.live:
            self.changed_b = t
        self.a, self.b, self.live = a, b, live
        self.dead = tuple(t < when + self.s.switch_dead_time - SOON for when in (self.changed_a, self.changed_b))

    def direct(self, y):
        """Which way current flows now."""
        ahead, back = (self.conducting(y, sign) for sign in (1, -1))
        is_free = self.ways(1)[:3] == self.ways(-1)[:3]
        if is_free:
            self.sign = 1
        elif self.coil(y)[1]:
            self.sign = 1 if ahead[0] > TINY else -1 if back[0] < -TINY else 0
        else:
            i = ahead[0]
            self.sign = 1 if i > TINY else -1 if i < -TINY else 0
        return is_free

    def next_time(self, t, end):
        """Next instant at which something is due."""
        s = self.s
        times = [end, self.changed_a + s.switch_minimum, self.changed_a + s.switch_dead_time]
        times += [self.changed_b + s.switch_dead_time, self.begun + s.peak_duration, *(row[0] for row in self.commands)]
        phase, period = self.phase(t)
        if self.law == "pwm" or s.control_restart == 1.0:
            times += [t + period - phase + SOON]
        if self.law == "pwm":
            times += [t - phase + SOON + abs(self.command(t)[2]) * period]
        return min(time for time in times if time > t + SOON)

    def guards(self, t, is_free):
        s, found = self.s, []
        if self.sign and not is_free:
            found.append(lambda t, y: self.sign * self.conducting(y, self.sign)[0])
        if not self.sign and self.coil_has_eddies:
            found.append(lambda t, y: TINY * 2 - self.conducting(y, 1)[0])
            found.append(lambda t, y: TINY * 2 + self.conducting(y, -1)[0])
        if self.law in ("current", "peak_hold") and self.live and t >= self.changed_a + s.switch_minimum - SOON:
            level = self.level(t)
            if self.a:
                found.append(lambda t, y: level - self.electric(y)[0])
            elif s.control_restart == 0.0:
                found.append(lambda t, y: self.electric(y)[0] - level + s.control_band)
        return found

    @property
    def coil_has_eddies(self):
        return self.oracle.k > 0.0

    def run(self, times):
        """Current, voltage of the coil, current of the supply, voltages of link and boost capacitor, gap at `times`."""
        p, s = self.p, self.s
        y = np.array([0.0, 0.0, p.initial_position / SCALE[2], 0.0, 0.0, s.supply_voltage, s.boost_voltage])
        t, end, i = 0.0, times[-1], 0.0
        found = np.zeros((len(times), 6))
        found[0, 3:] = s.supply_voltage, s.boost_voltage, p.initial_position
        while t < end - 1e-12:
            self.decide(t, i)
            is_free = self.direct(y)
            u = self.electric(y)[1]
            phi, H, z = (y[:4] * SCALE)[:3]
            delta = 1 if self.oracle.flux_rate(phi, H, z, u) >= 0 else -1
            if delta != self.delta:  # else the walls move or rest as before
                self.delta, self.walls = delta, delta if delta * self.oracle.core(phi, H)[0] >= 0 else 0
            moving = [self.of_actuator(g) for g, _ in self.oracle.guards(self.q, self.delta, self.walls)]
            modes = [mode for _, mode in self.oracle.guards(self.q, self.delta, self.walls)]
            guards = moving + self.guards(t, is_free)
            for guard in guards:
                guard.terminal, guard.direction = True, -1
            part = solve_ivp(
                self.rates, (t, self.next_time(t, end)), y, "DOP853", events=guards, rtol=1e-9, atol=1e-11,
                max_step=1e-4, dense_output=True,
            )  # fmt: skip
            for k in np.flatnonzero((times > t + 1e-12) & (times <= part.t[-1] + 1e-12)):
                at = part.sol(min(times[k], part.t[-1]))
                now, u, *_ = self.electric(at)
                found[k] = now, u, at[4], at[5], at[6], at[2] * SCALE[2]
            t, y = part.t[-1], part.y[:, -1]
            i = self.electric(y)[0]
            if part.status == 1:
                hit = next(n for n, hits in enumerate(part.t_events) if len(hits))
                contacts = len(moving) and (2 if self.q == 2 else 1)
                if hit < contacts:
                    self.q = modes[hit]
                    if self.q != 2:
                        y[2:4] = (p.stop_lower if self.q == 1 else p.stop_upper) / SCALE[2], 0.0
                elif contacts < hit < len(moving):
                    self.walls = self.delta
        return found

    def of_actuator(self, guard):
        """A guard of the actuator alone, with the voltage of the circuit."""
        return lambda t, y: guard(t, y[:4], lambda time: self.electric(y)[1], self.q, self.walls)
