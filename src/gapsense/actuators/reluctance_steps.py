"""One micro-step of the reluctance actuator: flux, field and motion, up to the next switch of mode or walls."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

from gapsense.actuators import hysteresis, magnetics, motion
from gapsense.actuators.hysteresis import Core
from gapsense.actuators.magnetics import LocalGap, SmoothGap
from gapsense.actuators.motion import CLOSED, MOVING, OPEN, Mover
from gapsense.integrate import crossing, least, next_part, rk4
from gapsense.records import Scalar
from gapsense.trace import cond, fabs, not_, where

REFINEMENT = 256.0  # a micro-step is shortened at most so many times
UNSEEN = 1e-10  # flux, magnetization (in those of saturation) and gap (in strokes) by which a switch may come late


class Actuator(NamedTuple):
    """Constants of a step."""

    voltage: Scalar
    resistance: Scalar
    turns: Scalar
    eddy: Scalar  # k_eddy [S]
    per_mmf: Scalar  # current by magnetomotive force in (7) [1]
    bias: Scalar  # current by the voltage in (7) [A]
    gap: SmoothGap
    core: Core
    mover: Mover
    micro_step: Scalar  # length of the equal micro-steps [s]
    flux_need: Scalar  # steps per second for a reluctance of one, by FLUX_FINENESS [H/s]
    field_need: Scalar  # steps for a change of the field by one, by FIELD_FINENESS [m/A]
    flux_weight: Scalar  # flux of a micro-step in units of the saturated one, per rate [s/Wb]
    excess_weight: Scalar  # 1/M_sat [m/A]
    stroke: Scalar  # [m]


class Circuit(NamedTuple):
    """The magnetic circuit at one instant."""

    gap: LocalGap  # the law of the gap around there
    reluctance: Scalar  # of the gap
    slope: Scalar  # its derivative
    current: Scalar
    flux_rate: Scalar
    excess: Scalar  # M_an - M
    steepness: Scalar  # of M_an


def micro_step(
    act: Actuator, left: Scalar, flux: Scalar, H_e: Scalar, h: Scalar, v: Scalar, mode: Scalar, *sums: Scalar
) -> tuple[Any, Any]:
    """One step of the loop; `left` is what is left of the communication step [s], `sums` are the integrals."""
    circuit = circuit_at(act, flux, H_e, h)
    # direction of the flux; 0 without hysteresis, where it is of no importance
    direction = where(act.core.is_hysteretic, where(circuit.flux_rate < 0.0, -1.0, 1.0), 0.0)
    walls = hysteresis.moving_walls(direction, circuit.excess)
    dt = _limited(act, next_part(left, act.micro_step), circuit, walls)
    is_moving = mode == MOVING
    dt, flux, H_e, h, v, mode, *parts = cond(
        is_moving,
        lambda: _move(act, circuit, (direction, walls), dt, (flux, H_e, h, v), is_moving),
        lambda: _rest(act, circuit, (direction, walls), dt, (flux, H_e), h, mode),
    )
    left = left - dt
    return (left, flux, H_e, h, v, mode, *(a + b for a, b in zip(sums, parts))), not_(left > 0.0)


def circuit_at(act: Actuator, flux: Scalar, H_e: Scalar, h: Scalar) -> Circuit:
    """The magnetic circuit and what drives it, in a state."""
    return _circuit(act, magnetics.gap_near(h, act.gap), flux, H_e, h)


def _circuit(act: Actuator, gap: LocalGap, flux: Scalar, H_e: Scalar, h: Scalar) -> Circuit:
    reluctance, slope, _ = magnetics.local_gap_law(h, gap)
    return Circuit(gap, reluctance, slope, *_electric(act, flux, H_e, reluctance))


def _electric(act: Actuator, flux: Scalar, H_e: Scalar, reluctance: Scalar) -> tuple[Scalar, Scalar, Scalar, Scalar]:
    """Current (7), rate of the flux (8), M_an - M and the steepness of M_an."""
    core = act.core
    M = hysteresis.magnetization(flux, H_e, core)
    mmf = reluctance * flux + (H_e - core.coupling * M) * core.length
    i = act.per_mmf * mmf + act.bias
    M_an, steepness = hysteresis.anhysteretic(H_e, core)
    return i, (act.voltage - act.resistance * i) / act.turns, M_an - M, steepness


def _limited(act: Actuator, dt: Scalar, circuit: Circuit, walls: Scalar) -> Scalar:
    """Step `dt`, or less where the core saturates: there the flux settles fast and the field runs away."""
    chi = hysteresis.susceptibility(circuit.excess, circuit.steepness, walls, act.core)
    reluctance = circuit.reluctance + hysteresis.differential_reluctance(chi, act.core)
    field_rate = hysteresis.field_rate(circuit.flux_rate, chi, act.core)
    need = act.flux_need * reluctance + act.field_need * fabs(field_rate)  # steps per second

    def shortened() -> Scalar:
        fine, finest = 1.0 / need, act.micro_step / REFINEMENT
        longest = where(fine < finest, finest, fine)
        return where(dt < longest, dt, longest)

    return cond(need * dt > 1.0, shortened, lambda: dt)


def _magnetic_rates(act: Actuator, walls: Scalar, electric: Any) -> tuple[Any, Any, Any]:
    """Rates of flux (8) and effective field (10); integrands: copper, eddy currents / k, walls / volume."""
    i, rate, excess, steepness = electric
    field_rate = hysteresis.field_rate(rate, hysteresis.susceptibility(excess, steepness, walls, act.core), act.core)
    return (rate, field_rate), (act.resistance * (i * i), rate * rate, excess * field_rate), (rate, excess)


def _moving_rates(act: Actuator, gap: LocalGap, walls: Scalar, y: Any) -> tuple[Any, Any, Any]:
    flux, H_e, h, _ = y
    return _rates_from(act, walls, y, _circuit(act, gap, flux, H_e, h))


def _rates_from(act: Actuator, walls: Scalar, y: Any, circuit: Circuit) -> tuple[Any, Any, Any]:
    """As `_magnetic_rates`, with velocity and acceleration (11), and with the loss in the damper."""
    flux, _, h, v = y
    rates, (copper, *more), watched = _magnetic_rates(act, walls, circuit[3:])
    drag = act.mover.damping * v
    net_force = magnetics.flux_force(flux, circuit.slope) + motion.spring_force(h, act.mover) - drag
    return (*rates, v, net_force / act.mover.mass), (copper + drag * v, *more), watched


def _resting_rates(act: Actuator, walls: Scalar, reluctance: Scalar, y: Any) -> tuple[Any, Any, Any]:
    flux, H_e = y
    return _magnetic_rates(act, walls, _electric(act, flux, H_e, reluctance))


def _switch(act: Actuator, switches: Any, watched: Any) -> tuple[Scalar, Scalar]:
    """Margins, negative once the flux turns round and once frozen walls start to move; 1 if they cannot."""
    direction, walls = switches
    rate, excess = watched
    turning = where(act.core.is_hysteretic, UNSEEN + direction * rate * act.flux_weight, 1.0)
    thawing = where(walls == direction, 1.0, UNSEEN - direction * excess * act.excess_weight)
    return turning, thawing


def _move(act: Actuator, circuit: Circuit, switches: Any, dt: Scalar, y: Any, is_moving: Scalar) -> Any:
    """Step of the moving mover, up to the first contact or switch if there is one."""
    mover, walls = act.mover, switches[1]
    first = _rates_from(act, walls, y, circuit)

    def after(length: Scalar) -> Any:
        return rk4(partial(_moving_rates, act, circuit.gap, walls), y, length, first)

    def margin(y: Any, watched: Any) -> Scalar:
        clearance = least(y[2] - mover.lower, mover.upper - y[2]) / act.stroke
        return least(clearance, least(*_switch(act, switches, watched)))

    y_next, sums, watched = after(dt)

    def shorter() -> Any:
        def value(length: Scalar) -> Scalar:
            y, _, watched = after(length)
            return margin(y, watched)

        length = crossing(value, dt, margin(y, first[2]), margin(y_next, watched))
        (flux, H_e, h, v), (heat, *more), _ = after(length)
        is_below = h < mover.lower
        stop = where(is_below, mover.lower, mover.upper)

        def land() -> Any:
            mode = motion.leaving(where(is_below, CLOSED, OPEN), _net_force(act, flux, stop))
            return stop, 0.0, mode, heat + motion.kinetic_energy(v, mover)

        h, v, mode, heat = cond(is_below | (h > mover.upper), land, lambda: (h, v, MOVING, heat))
        return length, flux, H_e, h, v, mode, heat, *more

    turning, thawing = _switch(act, switches, watched)
    is_beyond = (y_next[2] < mover.lower) | (y_next[2] > mover.upper) | (turning < 0.0) | (thawing < 0.0)
    # `is_moving` spares many runs at once the search for a contact in those that rest: they compute both branches
    return cond(is_moving & is_beyond, shorter, lambda: (dt, *y_next, MOVING, *sums))


def _rest(act: Actuator, circuit: Circuit, switches: Any, dt: Scalar, y: Any, h: Scalar, mode: Scalar) -> Any:
    """Step on a stop, of the core only, up to the first release or switch if there is one."""
    walls, spring = switches[1], motion.spring_force(h, act.mover)
    first = _magnetic_rates(act, walls, circuit[3:])

    def after(length: Scalar) -> Any:
        return rk4(partial(_resting_rates, act, walls, circuit.reluctance), y, length, first)

    def hold(flux: Scalar) -> Scalar:
        return -motion.inward(mode, magnetics.flux_force(flux, circuit.slope) + spring)

    def margin(flux: Scalar, watched: Any) -> Scalar:
        return least(hold(flux), least(*_switch(act, switches, watched)))

    y_next, sums, watched = after(dt)

    def shorter() -> Any:
        def value(length: Scalar) -> Scalar:
            (flux, _), _, watched = after(length)
            return margin(flux, watched)

        length = crossing(value, dt, margin(y[0], first[2]), margin(y_next[0], watched))
        (flux, H_e), sums, _ = after(length)
        return length, flux, H_e, h, 0.0, where(hold(flux) < 0.0, MOVING, mode), *sums

    turning, thawing = _switch(act, switches, watched)
    is_beyond = (hold(y_next[0]) < 0.0) | (turning < 0.0) | (thawing < 0.0)
    return cond(is_beyond, shorter, lambda: (dt, *y_next, h, 0.0, mode, *sums))


def _net_force(act: Actuator, flux: Scalar, h: Scalar) -> Scalar:
    """Force on the mover at rest [N], (11)."""
    _, slope, _ = magnetics.smooth_gap_law(h, act.gap)
    return magnetics.flux_force(flux, slope) + motion.spring_force(h, act.mover)
