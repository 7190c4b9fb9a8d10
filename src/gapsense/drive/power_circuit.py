"""The circuit of a power stage between two communication points: supply, DC link, switches, diodes, cable, coil.

The coil is a local model: a conductance G of its eddy currents beside an inductance 1/a with a voltage of its own,

    i = m + G v,   dm/dt = a v + F,   v = u - R i.

A leg ties one end of the coil to the link, to the boost capacitor or to ground. A switch does so, or what conducts
while its switches are off, which depends on the sign of the current.  So the path is one voltage and one resistance for
each sign, and if neither conducts, the current is zero and the coil has the voltage of its own.  A micro-step ends
where the path or a comparator changes, and at every edge, timer and dead time.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from gapsense.kernels.elementary import exp
from gapsense.kernels.integrate import add_integrals, crossing, least, next_part, rk4
from gapsense.kernels.layout import Choice, Scalar
from gapsense.kernels.trace import clip, cond, fabs, flag, is_set, loop, not_, sqrt, square, where, where_each

MICRO_STEPS = 100_000  # at most, per communication step
FINENESS = 0.25  # micro-step at most, in time constants
STABLE = 2.0  # likewise, of the supply that has settled after the last edge; Runge-Kutta 4 is stable up to 2.7
REFINEMENT = 1024.0  # a micro-step is shortened at most so many times for that
CLOSE, TICK = 1.0 - 2e-7, 1e-12  # share and time [s] by which a timer may run out early, for single precision
NEVER = 1e9  # [s]
BESIDE = 5e-10  # so close to the end of a step a change of the path lies on it [s]
FULL = 0.01  # share of its voltage from which on the boost capacitor is charged more slowly


class Topology(Choice):
    """What conducts: one switch below the coil, and a path beside it that takes over; or two switches, or four."""

    low_side_diode, low_side_zener, low_side_tvs, low_side_resistor, half_bridge, full_bridge, boost = range(7)


class Law(Choice):
    """What the switches follow."""

    gate, pwm, current, peak_hold = range(4)


class Chop(Choice):
    """Decay of the current while it is regulated: through one switch and one diode, or back into the supply."""

    slow, fast = range(2)


class Restart(Choice):
    """What switches a regulated current on again: the lower threshold, or the carrier."""

    hysteresis, pwm = range(2)


class Coil(NamedTuple):
    """The local model."""

    resistance: Scalar  # R [Ohm]
    conductance: Scalar  # G [S]
    inverse: Scalar  # a [1/H]
    drift: Scalar  # F [A/s]


class Command(NamedTuple):
    """Inputs, as they hold during a step."""

    gate: Scalar
    gate_low: Scalar
    reference: Scalar
    enable: Scalar


class Path(NamedTuple):
    """What the coil is tied to: shares of the voltages of link and boost capacitor, more voltage [V], resistance."""

    bus: Scalar
    boost: Scalar
    offset: Scalar
    resistance: Scalar


class Net(NamedTuple):
    """Constants."""

    topology: Scalar
    law: Scalar
    is_slow: Scalar
    is_restarted: Scalar  # by the carrier
    source: Scalar  # of the supply [V]
    resistance: Scalar  # of the supply [Ohm]
    inductance: Scalar  # of the supply [H]
    capacitance: Scalar  # of the link [F]
    esr: Scalar  # of the link [Ohm]
    cable_resistance: Scalar
    cable_inductance: Scalar
    switch: Scalar  # resistance of a switch that is on [Ohm]
    diode: Path  # voltage and resistance of a diode
    clamp: Path  # what leads from the lower end of the coil while the lower switch is off
    dead_time: Scalar
    minimum: Scalar  # time for which a switch stays on, or a regulated one off [s]
    period: Scalar  # of the carrier [s]
    peak: Scalar
    peak_duration: Scalar
    hold: Scalar
    band: Scalar
    boost_capacitance: Scalar
    boost_voltage: Scalar  # to which it is charged [V]
    boost_current: Scalar  # with which [A]
    boost_efficiency: Scalar
    micro_step: Scalar


class Stores(NamedTuple):
    """What is integrated."""

    magnetizing: Scalar  # m [A]
    supply: Scalar  # current [A]
    link: Scalar  # voltage of the capacitor [V]
    boost: Scalar  # likewise [V]


class Sums(NamedTuple):
    """Energies since the start [J]."""

    supplied: Scalar
    delivered: Scalar
    dissipated: Scalar
    cabled: Scalar  # into the inductance of the cable


class Gates(NamedTuple):
    """Discrete states."""

    a: Scalar  # upper switch, or the only one
    b: Scalar  # lower switch
    live: Scalar  # 0: all switches are off
    boosting: Scalar
    age_a: Scalar  # since `a` or `live` changed [s]
    age_b: Scalar
    clock: Scalar  # since the carrier's period began [s]
    since: Scalar  # it is live [s]


class Circuit(NamedTuple):
    """State of the circuit."""

    stores: Stores
    gates: Gates
    sums: Sums
    current: Scalar  # of the coil, at the end of the last micro-step [A]
    voltage: Scalar  # likewise [V]
    path: Scalar  # likewise: sign of the current that can flow, 0: none


class Track(NamedTuple):
    """What conducts in a micro-step, and when this changed first in the step."""

    edge: Scalar  # [s]
    path: Path
    is_blocked: Scalar


class Flow(NamedTuple):
    """Voltages and currents at one instant."""

    current: Scalar  # of the coil
    voltage: Scalar  # of the coil
    inner: Scalar  # v
    source: Scalar  # of the path, without current


def advance_circuit(
    net: Net, coil: Coil, command: Command, at: Circuit, dt: Scalar, keeps: Scalar
) -> tuple[Circuit, Track]:
    """Advance by a communication step: state, what conducted last, and where the path should first have changed.

    If the step `keeps` its path, the path does not change: the step should have ended there.
    """
    first = Track(edge=dt, path=Path(0.0, 0.0, 0.0, 0.0), is_blocked=0.0)
    _, at, track = loop(MICRO_STEPS, partial(_micro_step, net, coil, command, dt, keeps), (dt, at, first))
    return at, track


def levels(net: Net, gates: Gates) -> tuple[Scalar, Scalar]:
    """Of each leg: 1 if its upper switch is on, -1 if the lower one is, 0 if none is."""
    a, b, is_full = is_set(gates.a), is_set(gates.b), net.topology == Topology.full_bridge
    is_low_side, live = net.topology <= Topology.low_side_resistor, is_set(gates.live)
    ready_a, ready_b = (live & is_over(age, net.dead_time) for age in (gates.age_a, gates.age_b))
    upper = where(is_full, where(ready_a, where(a, 1.0, -1.0), 0.0), flag(a & not_(is_low_side)))
    lower = where(is_full, where(ready_b, where(b, -1.0, 1.0), 0.0), -where(is_low_side, gates.a, gates.b))
    return upper, lower


def sum_energy(net: Net, at: Circuit) -> Scalar:
    """Sum the energy in coils and capacitors of the stage [J]."""
    y = at.stores
    capacitors = net.capacitance * square(y.link) + net.boost_capacitance * square(y.boost)
    return 0.5 * (net.inductance * square(y.supply) + capacitors) + at.sums.cabled


def _micro_step(
    net: Net, coil: Coil, command: Command, dt: Scalar, keeps: Scalar, left: Scalar, at: Circuit, track: Track
) -> tuple[tuple[Scalar, Circuit, Track], Scalar]:
    """Switch, see what conducts, and integrate up to the next edge or timer, or to where path or comparator changes."""
    at = at._replace(gates=_set_gates(net, command, at))
    gates, y = at.gates, at.stores
    way, track = _conduct(net, coil, at, track, dt, keeps, left)
    margin = _margins(net, coil, command, gates, way)
    length = next_part(left, _next(net, command, gates, _fine(net, coil, way.path, gates)))
    end, sums, then = _integrate(net, coil, way, y, length)

    def shorter() -> tuple[Scalar, Stores, Sums, Flow]:
        def value(length: Scalar) -> Scalar:
            end, _, then = _integrate(net, coil, way, y, length)
            return margin(end, then.current)

        found = crossing(value, length, margin(y, way.flow(net, coil, y).current), margin(end, then.current))
        return found, *_integrate(net, coil, way, y, found)

    length, end, sums, then = cond(margin(end, then.current) < 0.0, shorter, lambda: (length, end, sums, then))
    done = Circuit(
        stores=end,
        gates=_later(net, gates, length),
        sums=add_integrals(at.sums, sums),
        current=then.current,
        voltage=then.voltage,
        path=where(way.is_blocked, 0.0, where(way.is_ahead, 1.0, -1.0)),
    )
    return (left - length, done, track), not_(left > length)


class Way(NamedTuple):
    """What conducts in a micro-step."""

    path: Path  # of the current
    ahead: Path  # of a positive one
    back: Path  # of a negative one
    is_ahead: Scalar  # the current is positive
    is_free: Scalar  # it may change its sign: one of the paths takes it over from the other at zero
    is_blocked: Scalar  # neither conducts: the current is zero
    is_past: Scalar  # the step should have ended before: nothing changes any more

    def flow(self, net: Net, coil: Coil, y: Stores) -> Flow:
        """What flows; nothing does if it is blocked, and then the coil has the voltage of its own."""
        found = _flow(net, coil, self.path, y)
        v = where(self.is_blocked, -y.magnetizing / coil.conductance, found.inner)
        return Flow(
            where(self.is_blocked, 0.0, found.current), where(self.is_blocked, v, found.voltage), v, found.source
        )


def _conduct(
    net: Net, coil: Coil, at: Circuit, track: Track, dt: Scalar, keeps: Scalar, left: Scalar
) -> tuple[Way, Track]:
    """What conducts from now on, and where that changed first in the step."""
    legs = levels(net, at.gates)
    positive, negative = (_path(net, at.gates, legs, forward) for forward in (True, False))
    ahead, back = (_flow(net, coil, path, at.stores) for path in (positive, negative))
    is_free = ahead.source >= back.source
    is_ahead = is_free | (ahead.current > 0.0)
    is_blocked = not_(is_ahead) & not_(back.current < 0.0)
    path = where_each(is_ahead, positive, negative)
    is_changed = _is_changed(track, path, is_blocked) & (left < dt)
    is_first = is_changed & (left > BESIDE) & not_(track.edge < dt)
    is_past = keeps & (is_changed | (track.edge < dt))
    path = where_each(is_past, track.path, path)
    is_blocked = (is_past & is_set(track.is_blocked)) | (not_(is_past) & is_blocked)
    track = Track(where(is_first, dt - left, track.edge), path, flag(is_blocked))
    return Way(
        path=path,
        ahead=positive,
        back=negative,
        is_ahead=is_ahead,
        is_free=is_free,
        is_blocked=is_blocked,
        is_past=is_past,
    ), track


def _margins(net: Net, coil: Coil, command: Command, gates: Gates, way: Way) -> Callable[[Stores, Scalar], Scalar]:
    """How far path and comparators are from a change, by what is stored and the current [A]; negative: it is past."""
    level = _level(net, command, gates)
    is_watched = _is_regulated(net) & is_set(gates.live) & is_over(gates.age_a, net.minimum)

    def margin(y: Stores, i: Scalar) -> Scalar:
        waiting = least(-_flow(net, coil, way.ahead, y).current, _flow(net, coil, way.back, y).current)
        turning = where(way.is_blocked, waiting, where(way.is_free, 1.0, where(way.is_ahead, i, -i)))
        below = where(net.is_restarted, 1.0, i - (level - net.band))
        found = least(turning, where(is_watched, where(is_set(gates.a), level - i, below), 1.0))
        return where(way.is_past, 1.0, found)

    return margin


def _integrate(net: Net, coil: Coil, way: Way, y: Stores, length: Scalar) -> tuple[Stores, Sums, Flow]:
    """What is stored after a micro-step of this length, what was added to the sums, and what flows then."""

    def rates(y: Stores) -> tuple[Stores, Sums]:
        return _rates(net, coil, way.path, way.is_blocked, way.flow(net, coil, y), y)

    end, sums = rk4(rates, y, length)
    settled, decay = coil.drift * coil.conductance / coil.inverse, coil.conductance / coil.inverse
    fallen = (y.magnetizing - settled) * exp(clip(-length / decay, -700.0, 0.0))
    end = end._replace(magnetizing=where(way.is_blocked, settled + fallen, end.magnetizing))
    return end, sums, way.flow(net, coil, end)


def _is_changed(track: Track, path: Path, is_blocked: Scalar) -> Scalar:
    """Whether this is not the path of the last micro-step."""
    is_same = is_set(track.is_blocked) == is_blocked
    for before, now in zip(track.path, path):
        is_same = is_same & (before == now)
    return not_(is_same)


def _set_gates(net: Net, command: Command, at: Circuit) -> Gates:
    """Set the switches as comparators, carrier and inputs want them now."""
    gates, i = at.gates, at.current
    was_on, is_timed = is_set(gates.a), is_over(gates.age_a, net.minimum)
    is_regulated, is_following = _is_regulated(net), net.law == Law.current
    wanted = where(is_following, command.reference > 0.0, command.gate > 0.5)
    live = (command.enable > 0.5) & (not_(is_regulated) | wanted)
    is_new = live & not_(is_set(gates.live))
    since = where(is_new, 0.0, gates.since)
    level = _level(net, command, gates._replace(since=since))
    is_below = where(net.is_restarted, (gates.clock <= 0.0) & (i < level), i <= level - net.band)
    regulated = is_new | (was_on & not_(is_timed & (i >= level))) | (not_(was_on) & is_timed & is_below)
    is_pulse = not_(is_over(gates.clock, fabs(_duty(command)) * net.period))
    is_pwm, is_forward = net.law == Law.pwm, command.reference >= 0.0
    plain = where(is_pwm, is_forward & is_pulse, command.gate > 0.5)
    a = live & where(is_regulated, regulated, plain | (was_on & not_(is_timed)))
    lower = where(is_pwm, is_forward | not_(is_pulse), command.gate_low > 0.5)
    b = live & where(is_regulated, a | net.is_slow, lower)
    is_same = not_(is_new) & (flag(live) == gates.live)
    return Gates(
        a=flag(a),
        b=flag(b),
        live=flag(live),
        boosting=flag(a & is_regulated & (is_new | is_set(gates.boosting))),
        age_a=where(is_same & (flag(a) == gates.a), gates.age_a, 0.0),
        age_b=where(is_same & (flag(b) == gates.b), gates.age_b, 0.0),
        clock=gates.clock,
        since=since,
    )


def _is_regulated(net: Net) -> Scalar:
    return net.law >= Law.current


def is_over(age: Scalar, limit: Scalar) -> Scalar:
    """Whether a timer has run out."""
    return age > CLOSE * limit - TICK


def _duty(command: Command) -> Scalar:
    return clip(command.reference, -1.0, 1.0)


def _level(net: Net, command: Command, gates: Gates) -> Scalar:
    """Upper threshold of the regulated current [A]."""
    planned = where(is_over(gates.since, net.peak_duration), net.hold, net.peak)
    return where(net.law == Law.current, command.reference, planned)


def _next(net: Net, command: Command, gates: Gates, fine: Scalar) -> Scalar:
    """Longest micro-step: up to the next edge or timer, and fine enough [s]."""

    def rest(age: Scalar, limit: Scalar) -> Scalar:
        return where(is_over(age, limit), NEVER, limit - age)

    finest = net.micro_step / REFINEMENT
    length = least(net.micro_step, where(fine < finest, finest, fine))
    for age, limit in ((gates.age_a, net.minimum), (gates.age_a, net.dead_time), (gates.age_b, net.dead_time)):
        length = least(length, rest(age, limit))
    length = where(net.law == Law.peak_hold, least(length, rest(gates.since, net.peak_duration)), length)
    is_pwm = net.law == Law.pwm
    pulse = where(is_pwm, rest(gates.clock, fabs(_duty(command)) * net.period), NEVER)
    edge = least(pulse, rest(gates.clock, net.period))
    return where(is_pwm | net.is_restarted, least(length, edge), length)


def _later(net: Net, gates: Gates, length: Scalar) -> Gates:
    clock = gates.clock + length
    return gates._replace(
        age_a=gates.age_a + length,
        age_b=gates.age_b + length,
        clock=where(is_over(clock, net.period), 0.0, clock),
        since=gates.since + length,
    )


def _path(net: Net, gates: Gates, legs: tuple[Scalar, Scalar], is_forward: bool) -> Path:
    """What a current of this sign flows through."""
    ground, link, store = (Path(bus, boost, 0.0, net.switch) for bus, boost in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))
    fall, rise = net.diode._replace(offset=-net.diode.offset), net.diode._replace(bus=1.0)
    is_boosted = (net.topology == Topology.boost) & is_set(gates.boosting)
    upper, lower = legs
    a = where_each(
        upper > 0.0, where_each(is_boosted, store, link), where_each(upper < 0.0, ground, fall if is_forward else rise)
    )
    a = where_each(net.topology <= Topology.low_side_resistor, link._replace(resistance=0.0), a)
    b = where_each(lower < 0.0, ground, where_each(lower > 0.0, link, net.clamp if is_forward else fall))
    return Path(a.bus - b.bus, a.boost - b.boost, a.offset - b.offset, a.resistance + b.resistance)


def _draw(net: Net, y: Stores) -> tuple[Scalar, Scalar]:
    """Current that charges the boost capacitor, and what the converter draws for it from the link [A]."""
    is_boost = net.topology == Topology.boost
    charge = net.boost_current * clip((net.boost_voltage - y.boost) / (FULL * net.boost_voltage), 0.0, 1.0)
    charge = where(is_boost & (y.link > 0.0), charge, 0.0)
    return charge, charge * y.boost / (net.boost_efficiency * where(y.link > 0.0, y.link, 1.0))


def _flow(net: Net, coil: Coil, path: Path, y: Stores) -> Flow:
    """What flows if the path conducts."""
    R, G, a, m = coil.resistance, coil.conductance, coil.inverse, y.magnetizing
    link = y.link + net.esr * (y.supply - _draw(net, y)[1])
    source = path.bus * link + path.boost * y.boost + path.offset
    Z = R + path.resistance + net.cable_resistance + net.esr * square(path.bus)
    v = (source - Z * m - net.cable_inductance * coil.drift) / (1.0 + Z * G + a * net.cable_inductance)
    i = m + G * v
    return Flow(i, v + R * i, v, source)


def _rates(net: Net, coil: Coil, path: Path, is_blocked: Scalar, flow: Flow, y: Stores) -> tuple[Stores, Sums]:
    """Rates of what is stored, and of the sums."""
    i = flow.current
    charge, draw = _draw(net, y)
    through = y.supply - draw - path.bus * i  # the capacitor of the link
    link = y.link + net.esr * through
    rate = where(is_blocked, 0.0, coil.inverse * flow.inner + coil.drift)
    stores = Stores(
        magnetizing=rate,
        supply=(net.source - net.resistance * y.supply - link) / net.inductance,
        link=through / net.capacitance,
        boost=(charge - path.boost * i) / net.boost_capacitance,
    )
    heat = net.resistance * square(y.supply) + net.esr * square(through) + (link * draw - y.boost * charge)
    heat = heat + (path.resistance + net.cable_resistance) * square(i) - path.offset * i
    return stores, Sums(net.source * y.supply, flow.voltage * i, heat, net.cable_inductance * rate * i)


def _fine(net: Net, coil: Coil, path: Path, gates: Gates) -> Scalar:
    """Micro-step that is fine enough [s].

    What is left of the answer of the supply to the last edge falls with its damping, and the error of a step grows with
    the fifth power of its length.  So steps grow, as far as they are stable and fine enough for what goes on slowly.
    """
    Z, R = coil.resistance + path.resistance + net.cable_resistance, net.resistance + net.esr
    slow = coil.inverse * Z / (1.0 + Z * coil.conductance + coil.inverse * net.cable_inductance)
    fast = slow + R / net.inductance + 1.0 / sqrt(net.inductance * net.capacitance)
    calm = clip(least(gates.age_a, gates.age_b) - net.dead_time, 0.0, 1.0) * R / (10.0 * net.inductance)
    grown = least(STABLE / fast, FINENESS * (1.0 + calm * (1.0 + 0.5 * calm)) / fast)
    longest = FINENESS / (slow + 1.0 / (where(R > 0.0, R, 1e-9) * net.capacitance))
    fine = least(grown, longest)
    return where(fine > FINENESS / fast, fine, FINENESS / fast)
