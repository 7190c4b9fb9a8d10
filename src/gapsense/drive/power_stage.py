"""Power stage between supply and coil: low-side switch, half and full bridge, peak and hold; see `power_circuit`.

The stage learns the coil's current at communication points only.  In a step it takes the coil for an inductance with a
voltage of its own, which both come from what the coil did so far.

If it gets the current of the start, each step is computed twice: ahead, for the outputs, and again once its current is
known, with a coil that ends there.  What the first was wrong by, the next step makes up.  If it gets the current of the
end, from a loop that is iterated, the coil's own voltage is sought that ends there.  Then nothing switches inside a
step, so that what comes back depends smoothly on the current: `edge` says where the step should end.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from gapsense.drive import power_circuit
from gapsense.drive.power_circuit import (
    BESIDE,
    Chop,
    Circuit,
    Coil,
    Command,
    Gates,
    Law,
    Net,
    Path,
    Restart,
    Stores,
    Topology,
    advance_circuit,
)
from gapsense.kernels.elementary import exp
from gapsense.kernels.interface import choice, fixed, input_, output, parameter, ports
from gapsense.kernels.layout import Choice, Scalar, blank
from gapsense.kernels.trace import clip, cond, fabs, flag, is_set, loop, not_, sqrt, square, where, where_each

LEAST_CONDUCTANCE = 1e-9  # beside the coil: it blocks no current that matters, and needs no case of its own [S]
WANDER = 0.2  # share by which a is taken to change in a step
DRIFT = 0.03  # change of F in a step, in that which the supply would give
KEPT = 0.8  # of F, from one step to the next
STEADY = 0.1  # change of the voltage, in that of the supply, up to which a trend goes on
COARSE = 1e-3  # of the voltage of the supply: how much of that of the path may be a guess
LONG = 1e-7  # a shorter step tells nothing of the coil [s]
PASSES = 5  # at most, of a step at whose end the current is known
FINE = 1e-9  # of the voltage of the supply: what may be missing then
STIFF = 0.05  # what F changes the end by, at least: an open coil without eddy currents has no current, whatever F is
SPREAD = 4.0  # by which factor a may change in a step


class At(Choice):
    """Which current of the step is given: that of its start or that of its end."""

    start, end = range(2)


@ports()
class Parameters(NamedTuple):
    """Topology, control, supply, switches, and what is known of the coil."""

    topology: Annotated[Scalar, Topology] = choice("What the coil is switched by")
    control_law: Annotated[Scalar, Law] = choice("What the switches follow")
    control_chop: Annotated[Scalar, Chop] = choice("Decay of a regulated current")
    control_restart: Annotated[Scalar, Restart] = choice("What switches a regulated current on again")
    control_frequency: Scalar = fixed("Hz", "Carrier of PWM and restart; a period begins at the start", 20e3, min=1e-3)
    control_band: Scalar = parameter("A", "A regulated current is between its level and this much less", 0.05, min=0.0)
    peak_current: Scalar = parameter("A", "Peak and hold: level at first", 0.6, min=0.0)
    peak_duration: Scalar = fixed("s", "Peak and hold: time from gate to hold", 4e-3, min=0.0)
    hold_current: Scalar = parameter("A", "Peak and hold: level then", 0.3, min=0.0)
    supply_voltage: Scalar = parameter("V", "Supply", 30.0, min=1e-9)
    supply_resistance: Scalar = parameter("Ohm", "Supply and its wires", 0.1, min=0.0)
    supply_inductance: Scalar = fixed("H", "Supply and its wires", 10e-6, min=1e-9)
    link_capacitance: Scalar = fixed("F", "DC link", 1e-3, min=1e-9)
    link_resistance: Scalar = parameter("Ohm", "Series resistance of its capacitor", 0.02, min=0.0)
    cable_resistance: Scalar = parameter("Ohm", "Cable to the coil", 0.0, min=0.0)
    cable_inductance: Scalar = fixed("H", "Cable to the coil", 0.0, min=0.0)
    switch_resistance: Scalar = parameter("Ohm", "Switch that is on", 0.1, min=0.0)
    switch_dead_time: Scalar = fixed("s", "Full bridge: from one switch of a leg to the other", 1e-6, min=0.0)
    switch_minimum: Scalar = fixed("s", "Shortest time on; of a regulated current off, too", 2e-6, min=1e-7)
    diode_voltage: Scalar = parameter("V", "Threshold of a diode", 0.7, min=0.0)
    diode_resistance: Scalar = parameter("Ohm", "Slope of a diode", 0.05, min=0.0)
    clamp_voltage: Scalar = parameter("V", "Zener diode or TVS", 60.0, min=1e-9)
    clamp_resistance: Scalar = parameter("Ohm", "Slope of the Zener diode or TVS", 0.5, min=0.0)
    freewheel_resistance: Scalar = parameter("Ohm", "Resistor in series with the diode", 100.0, min=0.0)
    boost_capacitance: Scalar = fixed("F", "Boost capacitor", 100e-6, min=1e-9)
    boost_voltage: Scalar = parameter("V", "To which it is charged", 65.0, min=1e-9)
    boost_current: Scalar = parameter("A", "With which it is charged", 0.5, min=0.0)
    boost_efficiency: Scalar = parameter("1", "Of its converter", 0.85, min=0.01, max=1.0)
    coil_resistance: Scalar = parameter("Ohm", "Resistance R of the coil", 48.0, min=1e-9)
    coil_inductance: Scalar = fixed("H", "The largest that it has; it starts with it", 0.1, min=1e-9)
    coil_conductance: Scalar = parameter(
        "S", "Eddy currents, seen from the coil: k_eddy / N^2 of ReluctanceActuator", 0.0, min=0.0
    )
    micro_step: Scalar = fixed("s", "Longest step of the integrator", 10e-6, min=1e-7, name="micro_step")
    current_at: Annotated[Scalar, At] = choice("To which end of the step the coil's current belongs; end: iterated")


class Learnt(NamedTuple):
    """Of the coil, and how uncertain it is: a covariance."""

    inverse: Scalar  # a [1/H]
    drift: Scalar  # F [A/s]
    P_a: Scalar
    P_both: Scalar
    P_F: Scalar
    trend: Scalar  # by which the rate of m is taken to change from one step to the next [A/s]
    inner: Scalar  # v of the last step [V]


class Trial(NamedTuple):
    """A step at whose end the current is known, with one F."""

    drift: Scalar  # the F to be tried next [A/s]
    change: Scalar  # from this one to that
    missing: Scalar  # in this one
    then: Circuit
    edge: Scalar
    held: Scalar  # [V]
    m: Scalar  # of the coil, at the end [A]


class State(NamedTuple):
    """When the last step began, what was asked of it, and what it gave."""

    at: Circuit  # at its start
    command: Command
    step: Scalar  # its length [s]
    held: Scalar  # voltage that it gave [V]
    began: Scalar  # m of the coil at its start, measured [A]
    inside: Scalar  # whether a switch switched within it
    steady: Scalar  # whether one path conducted all the time
    learnt: Learnt


@ports()
class Inputs(NamedTuple):
    """What is wanted, and the coil's current at the start of the step."""

    time: Scalar  # end of the step [s]
    dt: Scalar  # [s]
    gate: Scalar = input_("1", "Above 0.5: the upper switch, or the only one, is on; or peak and hold begins")
    gate_low: Scalar = input_("1", "Above 0.5: the lower switch of a bridge is on", start=1.0)
    reference: Scalar = input_("1", "PWM: duty, -1 to 1; current: level [A]; held during the step")
    enable: Scalar = input_("1", "0.5 or less: all switches are off", start=1.0)
    coil_current: Scalar = input_(
        "A", "Current of the coil at the start of the step", nominal=0.6, source="plant.current"
    )


@ports(feedthrough=Inputs._fields[2:])
class Outputs(NamedTuple):
    """Values at the end of the step, save for the mean."""

    voltage: Scalar = output("V", "Coil voltage; on an edge, just before it", nominal=30.0)
    voltage_mean: Scalar = output("V", "Voltage that, held, takes the coil where the step takes it", nominal=30.0)
    current: Scalar = output("A", "Coil current as the stage has it", nominal=0.6)
    supply_current: Scalar = output("A", "Current of the supply", nominal=0.6)
    link_voltage: Scalar = output("V", "Capacitor of the DC link", nominal=30.0)
    boosted_voltage: Scalar = output("V", "Boost capacitor", nominal=65.0)
    leg_a: Scalar = output("1", "1: upper switch on, -1: lower one, 0: none", min=-1.0, max=1.0)
    leg_b: Scalar = output("1", "Likewise, of the other end of the coil", min=-1.0, max=1.0)
    path: Scalar = output("1", "Sign of the current that can flow; 0: none", min=-1.0, max=1.0)
    coil_inductance: Scalar = output("H", "Differential inductance, learnt", nominal=0.05)
    edge: Scalar = output("s", "From the start of the step to the first edge inside, or else its end", nominal=1e-5)
    supplied_energy: Scalar = output("J", "From the supply since the start", nominal=0.1)
    delivered_energy: Scalar = output("J", "To the coil since the start", nominal=0.1)
    dissipated_energy: Scalar = output("J", "Lost in the stage since the start", nominal=0.01)
    stored_energy: Scalar = output("J", "In inductances and capacitors of the stage", nominal=0.5)


def initial(inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """All switches off, capacitors charged, no current from the supply."""
    a = 1.0 / par.coil_inductance
    net, learnt = net_of(par), Learnt(inverse=a, drift=0.0, P_a=a * a, P_both=0.0, P_F=0.0, trend=0.0, inner=0.0)
    coil = _coil(par, learnt)
    m = inputs.coil_current * (1.0 + coil.resistance * coil.conductance)
    stores = Stores(magnetizing=m, supply=0.0, link=par.supply_voltage, boost=par.boost_voltage)
    at = blank(Circuit, stores=stores, gates=blank(Gates, age_a=1.0, age_b=1.0), current=inputs.coil_current)
    state, outputs = _begin_step(net, coil, learnt, at, m, inputs._replace(dt=0.0))
    return state._replace(held=0.0), outputs


def step(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """One communication step."""
    return cond(
        par.current_at == At.end, lambda: _step_coupled(state, inputs, par), lambda: _step_ahead(state, inputs, par)
    )


def _step_coupled(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Make a step for which the current at its end is given."""
    net, at, dt, start = net_of(par), state.at, inputs.dt, state.began
    command = Command(*inputs[2:6])
    plain = _foresee_coil(par, state.learnt)
    floor, soon = FINE * par.supply_voltage * plain.inverse, where(dt < BESIDE, dt, BESIDE)
    begun, _ = advance_circuit(net, plain, command, at, soon, False)  # what switches at once, whatever current comes

    def closer(*before: Any) -> tuple[Trial, Scalar]:
        """A secant step of F, towards the drift with which the step ends at the current that came (8)."""
        trial = Trial(*before)
        coil = plain._replace(drift=trial.drift)
        then, track = advance_circuit(net, coil, command, begun, dt - soon, True)
        mean = coil.drift + (plain.drift - coil.drift) * soon / where(dt > 0.0, dt, 1.0)
        held = _held(coil._replace(drift=mean), start, then.stores.magnetizing, dt)
        m = _magnetizing(inputs.coil_current, held, par)
        missing = _drive(coil, start, m, dt) - _drive(coil, start, then.stores.magnetizing, dt)
        fall = trial.missing - missing
        is_new = trial.change == 0.0
        slope = where(is_new, 1.0, fall / where(is_new, 1.0, trial.change))
        change = missing / where(slope > STIFF, slope, STIFF)
        conducts = fabs(then.path) > 0.0
        is_done = conducts & (fabs(missing) < floor)  # an open coil takes all passes: where it stops must not jump
        drift = where(is_done, trial.drift, trial.drift + change)
        guessed = dt * track.path.resistance * fabs(coil.drift - plain.drift)
        edge, half = soon + track.edge, 0.5 * dt
        is_coarse = conducts & (guessed > COARSE * par.supply_voltage) & (dt > LONG)
        edge = where(is_coarse & (edge > half), half, edge)
        return Trial(drift=drift, change=change, missing=missing, then=then, edge=edge, held=held, m=m), is_done

    found = loop(PASSES, closer, Trial(drift=plain.drift, change=0.0, missing=0.0, then=at, edge=dt, held=0.0, m=0.0))
    then, held, m = found.then, found.held, found.m
    is_steady = (then.path == at.path) & (fabs(then.path) > 0.0)
    last = State(at, command, step=dt, held=held, began=start, inside=0.0, steady=flag(is_steady), learnt=state.learnt)
    learnt = cond(dt > LONG, lambda: _learn(last, m, par), lambda: state.learnt._replace(trend=0.0))
    return last._replace(at=then, began=m, learnt=learnt), _outputs(net, then, held, learnt.inverse, found.edge)


def _magnetizing(current: Scalar, held: Scalar, par: Parameters) -> Scalar:
    """Magnetizing current of a coil at a voltage that was held, (2)."""
    return current * (1.0 + par.coil_resistance * par.coil_conductance) - par.coil_conductance * held


def _step_ahead(state: State, inputs: Inputs, par: Parameters) -> tuple[State, Outputs]:
    """Make a step for which the current at its start is given."""
    net = net_of(par)
    m = _magnetizing(inputs.coil_current, state.held, par)

    def learn_coil() -> tuple[Learnt, Circuit]:
        """Learn what the last step tells of the coil, and the circuit after it, now that its current is known (7)."""
        learnt, is_inside = _learn(state, m, par), is_set(state.inside)
        before, after = _foresee_coil(par, state.learnt), _coil(par, learnt)
        coil = where_each(is_inside, before, after)
        at, _ = advance_circuit(net, coil, state.command, state.at, state.step, False)
        reached = where(is_inside, m, at.stores.magnetizing)
        return learnt, at._replace(stores=at.stores._replace(magnetizing=reached))

    learnt, at = cond(state.step > 0.0, learn_coil, lambda: (state.learnt, state.at))
    return _begin_step(net, _foresee_coil(par, learnt), learnt, at, m, inputs)


def _begin_step(net: Net, coil: Coil, learnt: Learnt, at: Circuit, m: Scalar, inputs: Inputs) -> tuple[State, Outputs]:
    """Begin a step, and tell what the stage gives in it, where the coil has `m` and should have that of `at`."""
    dt = inputs.dt
    command = Command(*inputs[2:6])
    then, track = advance_circuit(net, coil, command, at, dt, False)
    held = where(dt > 0.0, _held(coil, m, then.stores.magnetizing, dt), then.voltage)
    outputs = _outputs(net, then, held, coil.inverse, track.edge)
    is_inside = not_(power_circuit.is_over(then.gates.age_a, dt))
    is_steady = (then.path == at.path) & (fabs(then.path) > 0.0) & not_(is_inside)
    state = State(
        at, command, step=dt, held=held, began=m, inside=flag(is_inside), steady=flag(is_steady), learnt=learnt
    )
    return state, outputs


def _outputs(net: Net, at: Circuit, held: Scalar, inverse: Scalar, edge: Scalar) -> Outputs:
    leg_a, leg_b = power_circuit.levels(net, at.gates)
    return Outputs(
        voltage=at.voltage,
        voltage_mean=held,
        current=at.current,
        supply_current=at.stores.supply,
        link_voltage=at.stores.link,
        boosted_voltage=at.stores.boost,
        leg_a=leg_a,
        leg_b=leg_b,
        path=at.path,
        coil_inductance=1.0 / inverse,
        edge=edge,
        supplied_energy=at.sums.supplied,
        delivered_energy=at.sums.delivered,
        dissipated_energy=at.sums.dissipated,
        stored_energy=power_circuit.sum_energy(net, at),
    )


def _held(coil: Coil, start: Scalar, end: Scalar, dt: Scalar) -> Scalar:
    """Voltage that, held, takes the coil from `start` to `end` in a step [V], (4)."""
    inner = _drive(coil, start, end, dt) - coil.drift
    return inner / coil.inverse * (1.0 + coil.resistance * coil.conductance)


def _drive(coil: Coil, start: Scalar, end: Scalar, dt: Scalar) -> Scalar:
    """What the coil is driven by in a step from `start` to `end` with one voltage: a u / (1 + R G) + F [A/s], (4)."""
    x = coil.inverse * coil.resistance * dt / (1.0 + coil.resistance * coil.conductance)
    is_small = x < 1e-4
    held = where(is_small, 1.0 - 0.5 * x, (1.0 - exp(clip(-x, -700.0, 0.0))) / where(is_small, 1.0, x))
    return (end - start * (1.0 - x * held)) / (where(dt > 0.0, dt, 1.0) * held)


def _learn(state: State, m: Scalar, par: Parameters) -> Learnt:
    """The coil that fits the last step exactly, by a Kalman filter of a and F without measurement noise, (5).

    If the voltage stays, the surprise counts for the inductance the more, the higher the voltage is. Where the voltage
    changes, its covariance tells a and F apart.
    """
    before, learnt = _coil(par, state.learnt), state.learnt
    share = 1.0 / (1.0 + before.resistance * before.conductance)
    inner = share * state.held
    v = inner - share * before.resistance * 0.5 * (state.began + m)
    P_a = (1.0 - WANDER * WANDER) * learnt.P_a + square(WANDER * learnt.inverse)
    P_both = sqrt(1.0 - WANDER * WANDER) * KEPT * learnt.P_both
    P_F = KEPT * KEPT * learnt.P_F + square(DRIFT * par.supply_voltage * learnt.inverse)
    S_a, S_F = P_a * v + P_both, P_both * v + P_F
    S = S_a * v + S_F
    unforeseen = _drive(before, state.began, m, state.step) - before.inverse * inner - before.drift
    inverse = before.inverse + S_a / S * (unforeseen + (1.0 - KEPT) * before.drift)
    inverse = clip(inverse, before.inverse / SPREAD, before.inverse * SPREAD)
    inverse = where(inverse * par.coil_inductance > 1.0, inverse, 1.0 / par.coil_inductance)
    after = before._replace(inverse=inverse)
    drift = _drive(after, state.began, m, state.step) - inverse * inner
    is_steady = is_set(state.steady) & (fabs(v - learnt.inner) < STEADY * par.supply_voltage)
    trend = where(is_steady, unforeseen, 0.0)
    return Learnt(
        inverse=inverse,
        drift=drift,
        P_a=P_a - S_a * S_a / S,
        P_both=P_both - S_a * S_F / S,
        P_F=P_F - S_F * S_F / S,
        trend=trend,
        inner=v,
    )


def _coil(par: Parameters, learnt: Learnt) -> Coil:
    return Coil(par.coil_resistance, par.coil_conductance + LEAST_CONDUCTANCE, learnt.inverse, learnt.drift)


def _foresee_coil(par: Parameters, learnt: Learnt) -> Coil:
    """Foresee the coil of the next step."""
    return _coil(par, learnt._replace(drift=learnt.drift + learnt.trend))


def net_of(par: Parameters) -> Net:
    """Constants of the circuit."""
    topology = par.topology
    is_boost, is_tvs = topology == Topology.boost, topology == Topology.low_side_tvs
    is_zener = topology == Topology.low_side_zener
    added = where(is_zener, par.clamp_voltage, 0.0)
    series = where(
        is_zener, par.clamp_resistance, where(topology == Topology.low_side_resistor, par.freewheel_resistance, 0.0)
    )
    diode = Path(0.0, 0.0, par.diode_voltage, par.diode_resistance)
    return Net(
        topology=topology,
        law=par.control_law,
        is_slow=par.control_chop == Chop.slow,
        is_restarted=(par.control_law >= Law.current) & (par.control_restart == Restart.pwm),
        source=par.supply_voltage,
        resistance=par.supply_resistance,
        inductance=par.supply_inductance,
        capacitance=par.link_capacitance,
        esr=par.link_resistance,
        cable_resistance=par.cable_resistance,
        cable_inductance=par.cable_inductance,
        switch=par.switch_resistance,
        diode=diode,
        clamp=Path(
            bus=flag(not_(is_boost | is_tvs)),
            boost=flag(is_boost),
            offset=where(is_tvs, par.clamp_voltage, par.diode_voltage + added),
            resistance=where(is_tvs, par.clamp_resistance, par.diode_resistance + series),
        ),
        dead_time=par.switch_dead_time,
        minimum=par.switch_minimum,
        period=1.0 / par.control_frequency,
        peak=par.peak_current,
        peak_duration=par.peak_duration,
        hold=par.hold_current,
        band=par.control_band,
        boost_capacitance=par.boost_capacitance,
        boost_voltage=par.boost_voltage,
        boost_current=par.boost_current,
        boost_efficiency=par.boost_efficiency,
        micro_step=par.micro_step,
    )
