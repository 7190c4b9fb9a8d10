"""Flux linkage by the integral of u - R i over a cycle, and the resistance with which a cycle closes."""

from __future__ import annotations

from gapsense.control.mover import balance, make_mover
from gapsense.control.records import Coil, Inputs, Parameters
from gapsense.estimators.mhe.model import gap, make_gap
from gapsense.estimators.readings import can_be_read
from gapsense.kernels.layout import Scalar, blank
from gapsense.kernels.trace import clip, fabs, not_, sqrt, square, where

FOLLOWED, GAINS = 0.1e-3, (0.5, 1.5)  # time in which the gain of the bridge is followed [s], and where it stays
RECENT, LATE = 0.32e-3, 0.8e-3  # time constants of the means of late, and of that which tells the zero [s]
LOWEST, HIGHEST = 0.6, 1.9  # resistance, over that which is believed
SETTLED, CALM = 0.01, 1.5e-3  # of the usual current: a change within the times above that is none; for so long [s]
DRIFTS = 9.0  # errors by noise: a change of the resistance that is farther from its trend has another one
TREND = 0.1  # part of a change of the resistance that is expected again
OFFSET = 0.05  # of the usual current: an offset is less
DRIVEN, RAISED = 0.9, 1.2  # current of an ordinary closing: at least, of the usual one; after one that did not close
OPEN, AFLOAT = 1.3, 0.8  # of the flux linkage that balances the spring of the open actuator; where the current changes
OPENED = (0.9, 2.0)  # of its reluctance
WARM = 0.85  # share of the voltage that the resistance may need
HOLDS = 0.1  # of the usual current: less does not tell the resistance
MEAN = 0.5  # of a zero that noise explains
LANDED, SURE = 0.01, 5.0  # of the usual current: it rises by more where a mover lands; standard deviations of noise
TOP, APART = 0.3, 6.0  # share by which the mean of the last closings follows; farther from it is another one [Wb]
SOMEWHERE = 2e-3  # the latter if the current is noisy
SLOWER = 0.1  # then: share by which the resistance and the first flux linkage follow, once there were so many cycles
AVERAGED = 0.0075  # of the usual current: from such a noise on its means are used with a contact, and longer pieces
QUIET = 2.0  # of that noise: with more the bend of the current tells no delay of a contact
NOISY, PER_CHANGE = 0.004, 0.886  # noise of the current, of the usual one, at first; over its mean change of a sample
FAR, NEAR = 0.15e-3, 0.15  # an error of the first flux linkage that is corrected at once [Wb], else by this share
SOLVED = 3.0  # windows of an estimator until its resistance is that of a solved operation, the first one being rest
STEADY, WANDERING = 3.5, 1e-3  # misfit of an estimator whose flux linkage and resistance are followed; error [Wb]
OLDER = 0.22e-3  # age of the mean of late, less what eddy currents add to a flux linkage that decays [s]
STEADYING = 0.5e-3  # if the current is noisy: error of a sample's R i over this is the share that is followed [Wb]
# what an estimator changes in an operation: standard deviations of what noise sums up, and what else may be wrong [Wb]
EXPLAINED, BESIDE = 2.0, 0.1e-3
BEYOND, LARGEST = 4.0, 4.0  # largest voltage of the bridge, and current that this drives: a reading beyond is lost
JUMP, FASTER, PATIENCE = 0.2, 3.0, 5.0  # of the usual current; than the open coil; wild readings in a row
BALANCED = 0.3  # share by which the mean of the resistance of cycles follows
JUMPED, SHARE, YOUNG = 0.01, 0.4, 3.0  # a change of the resistance that is taken at once, else a share; first cycles


def first_coil(inputs: Inputs, par: Parameters) -> Coil:
    """Without flux."""
    R = par.coil_resistance
    u = where(can_be_read(inputs.voltage, LARGEST * par.voltage_most), inputs.voltage, 0.0)
    i = where(can_be_read(inputs.current, LARGEST * par.voltage_most / R), inputs.current, 0.0)
    return blank(
        Coil,
        bridge_gain=1.0,
        last_voltage=u,
        last_current=i,
        used=i,
        noise=NOISY * usual_current(par),
        resistance=R,
        measured=R,
        held_voltage=u,
        held_current=i,
        late_current=i,
        needed=DRIVEN * usual_current(par),
        balanced=R,
    )


def can_be_used(coil: Coil, inputs: Inputs, par: Parameters) -> tuple[Scalar, Scalar]:
    """Whether the readings of voltage and current are neither lost nor wild.

    In a sample the current changes by what the voltage drives through the open coil, plus eddy currents and noise. A
    reading that is farther from the last one is wild. After more than `PATIENCE` wild ones in a row the reading is
    true.
    """
    u, i = inputs.voltage, inputs.current - coil.zero
    highest = where(par.voltage_most > -par.voltage_least, par.voltage_most, -par.voltage_least)
    has_voltage = can_be_read(u, BEYOND * highest)
    slope = reluctance_at(par.stop_upper, par)
    change = par.sample_time * slope * (highest + par.coil_resistance * fabs(coil.last_current))
    is_near = fabs(i - coil.last_current) <= JUMP * usual_current(par) + FASTER * change
    has_current = can_be_read(i, LARGEST * highest / par.coil_resistance) & (is_near | (coil.far >= PATIENCE))
    return has_voltage, has_current


def integrate_sample(
    coil: Coil, inputs: Inputs, is_late: Scalar, expected: Scalar, share: Scalar, par: Parameters
) -> tuple[Coil, Scalar]:
    """Integrate one sample, and tell whether a reading was lost or wild.

    The measured current has a share; the rest is that which is expected. Late in an operation the flux linkage stays
    with a current that rests, and no error of R is summed up.
    """
    has_voltage, has_current = can_be_used(coil, inputs, par)
    u = where(has_voltage, inputs.voltage - coil.voltage_zero, coil.last_voltage)
    i, T_s = where(has_current, inputs.current - coil.zero, coil.last_current), par.sample_time
    used = where(share < 1.0, expected + share * (i - expected), i)
    mean, recent, late = 0.5 * (coil.used + used), T_s / (RECENT + T_s), T_s / (LATE + T_s)
    calm = where(is_late & _is_settled(coil, par), coil.calm + 1.0, 0.0)
    dt = where(calm * T_s > CALM, 0.0, T_s)
    is_level = fabs(u - coil.held_voltage) < OFFSET * par.voltage_most  # eddy currents answer a step at once
    told = where((calm > 0.0) & is_level, late, 0.0)
    noise = coil.noise + told * (PER_CHANGE * fabs(i - coil.last_current) - coil.noise)
    held = coil.held_current + recent * (i - coil.held_current)
    lowest = where((held > coil.highest) | (held < coil.lowest), held, coil.lowest)
    new = coil._replace(
        flux=coil.flux + dt * (u - coil.resistance * mean),
        charge=coil.charge + dt * mean,
        passed=coil.passed + dt * 0.5 * (coil.last_current + i),
        bridge_gain=_bridge_gain(coil, u, par),
        last_voltage=u,
        last_current=i,
        used=used,
        far=where(has_current, 0.0, coil.far + 1.0),
        calm=calm,
        change=i - coil.last_current,
        noise=noise,
        held_voltage=coil.held_voltage + recent * (u - coil.held_voltage),
        held_current=held,
        highest=where(held > coil.highest, held, coil.highest),
        lowest=lowest,
        rise=where(held - lowest > coil.rise, held - lowest, coil.rise),
        late_current=coil.late_current + late * (i - coil.late_current),
    )
    return new, not_(has_voltage & has_current)


def _bridge_gain(coil: Coil, u: Scalar, par: Parameters) -> Scalar:
    """Measured voltage over what was asked; a supply that sags is followed within the lead of an operation."""
    share = par.sample_time / (FOLLOWED + par.sample_time) * coil.asked / square(par.voltage_most)
    return clip(coil.bridge_gain + share * (u - coil.bridge_gain * coil.asked), *GAINS)


def usual_current(par: Parameters) -> Scalar:
    """Final current of an ordinary closing [A]."""
    return par.voltage_hold / par.coil_resistance


def is_quiet(coil: Coil, par: Parameters) -> Scalar:
    """Whether the noise of the current is small enough for the delay of a contact to be learnt."""
    return coil.noise < QUIET * AVERAGED * usual_current(par)


def driving(coil: Coil, par: Parameters) -> Scalar:
    """Voltage of an ordinary closing: enough to hold, or more if its current needs more."""
    needed = coil.resistance * coil.needed
    possible = where(needed < par.voltage_most, needed, par.voltage_most)
    return where(possible > par.voltage_hold, possible, par.voltage_hold)


def is_scarce(coil: Coil, par: Parameters) -> Scalar:
    """Whether the resistance needs nearly all voltage: a slow approach may not arrive."""
    return DRIVEN * coil.resistance * usual_current(par) > WARM * par.voltage_most


def learn_zero(coil: Coil, par: Parameters) -> Coil:
    """Learn the zeros of both readings from an ordinary opening; a large current there has not decayed yet."""
    u, noise = coil.held_voltage, coil.noise * sqrt(0.5 * par.sample_time / LATE)
    share = where(fabs(coil.late_current) > SURE * noise, 1.0, MEAN)  # what may be noise is no other zero
    off = where(fabs(coil.late_current) < OFFSET * usual_current(par), share * coil.late_current, 0.0)
    return coil._replace(
        voltage_zero=coil.voltage_zero + where(fabs(u) < OFFSET * par.voltage_most, u, 0.0),
        zero=coil.zero + off,
        held_current=coil.held_current - off,
        late_current=coil.late_current - off,
        last_current=coil.last_current - off,
        used=coil.used - off,
    )


def held_resistance(coil: Coil, par: Parameters) -> Scalar:
    """Resistance at the end of an ordinary closing: voltage over current."""
    is_large = coil.held_current > HOLDS * usual_current(par)
    R = coil.held_voltage / where(is_large, coil.held_current, 1.0)
    return where(is_large, _possible(R, par), coil.resistance)


def _is_settled(coil: Coil, par: Parameters) -> Scalar:
    return fabs(coil.held_current - coil.late_current) < SETTLED * usual_current(par)


def left_open(coil: Coil, par: Parameters) -> Scalar:
    """Whether an ordinary closing that ends has left the mover open, by the reluctance.

    At the open stop, with the current of an open gap, the flux linkage is at most what balances the spring there. A
    mover that floats on has less, by the resistance of a current that still changes. While a mover moves the current
    falls; once it has landed the current rises again, however slowly.
    """
    m, T_s = make_mover(par), par.sample_time
    noise = coil.noise * sqrt(T_s / (T_s + 2.0 * RECENT))
    has_landed = coil.rise > LANDED * usual_current(par) + SURE * noise
    flux = coil.flux - (coil.measured - coil.resistance) * coil.charge
    is_driven = coil.held_current > HOLDS * usual_current(par)
    share = flux / sqrt(balance(m.gap.largest, m))
    is_gap = (open_flux(coil, par) > OPENED[0] * flux) & (open_flux(coil, par) < OPENED[1] * flux)
    is_left = where(_is_settled(coil, par), is_gap & (share < OPEN), share < AFLOAT)
    return is_driven & is_left & not_(has_landed)


def raise_hold(coil: Coil) -> Coil:
    """Ask for more current, after an ordinary closing whose current did not close."""
    needed = RAISED * coil.held_current
    return coil._replace(needed=where(needed > coil.needed, needed, coil.needed))


def _possible(R: Scalar, par: Parameters) -> Scalar:
    return clip(R, LOWEST * par.coil_resistance, HIGHEST * par.coil_resistance)


def open_flux(coil: Coil, par: Parameters) -> Scalar:
    """Flux linkage of the latest current with an open gap [Wb]."""
    return coil.held_current / reluctance_at(par.stop_upper, par)


def last_flux(coil: Coil, par: Parameters) -> Scalar:
    """Flux linkage of the last current with an open gap; while much of it decays, its mean of late is older [Wb]."""
    decay = coil.resistance * coil.held_current - coil.held_voltage - SETTLED * par.voltage_hold
    return open_flux(coil, par) - OLDER * where(decay > 0.0, decay, 0.0)


def reluctance_at(z: Scalar, par: Parameters) -> Scalar:
    """Reluctance at a position, current over flux linkage, by the parameters [1/H]."""
    return gap(z, make_gap(par), par.gap_factor, par.gap_bend)[0] + par.core_reluctance / square(par.coil_turns)


def cycle_resistance(coil: Coil, par: Parameters) -> Scalar:
    """Resistance with which the integral over the cycle ends at the flux linkage of its last current."""
    ahead = coil.resistance * (coil.charge - coil.passed)
    seen = coil._replace(charge=coil.passed)
    return _resistance_of(seen, coil.flux + ahead - coil.shift - last_flux(coil, par), par)


def _resistance_of(coil: Coil, off: Scalar, par: Parameters) -> Scalar:
    """Resistance with which the integral over the cycle ends elsewhere by `off`."""
    has_charge = coil.charge > HOLDS * par.voltage_hold / par.coil_resistance * par.closing_travel
    return where(
        has_charge, _possible(coil.resistance + off / where(has_charge, coil.charge, 1.0), par), coil.resistance
    )


def learn_resistance(coil: Coil, cycles: Scalar, is_open: Scalar, is_noisy: Scalar, par: Parameters) -> Coil:
    """Learn the resistance at the end of a cycle: the last one plus its trend, or a mean where noise is large."""
    R, end = cycle_resistance(coil, par), last_flux(coil, par)
    off = end - coil.remanence
    slow = follow(cycles, SLOWER)
    start = coil.remanence + where(is_noisy, slow, where(fabs(off) > FAR, 1.0, NEAR)) * off
    new = _follow_resistance(coil, R, where(is_noisy, slow, 1.0), where(cycles > YOUNG, TREND, 0.0), par)
    start = where(is_open, start, coil.flux - (new.measured - coil.resistance) * coil.charge)
    return _restart_sums(new, start)._replace(remanence=start, balanced=new.measured)


def _follow_resistance(coil: Coil, R: Scalar, share: Scalar, gain: Scalar, par: Parameters) -> Coil:
    """Follow the resistance of a cycle by a share, and its trend by a gain.

    A change that is farther from the trend than noise explains ends the trend, as no step is expected again. The second
    one in a row and in one direction begins a new one: the smaller one of both. A large noise hides both.
    """
    change, before = R - coil.found, coil.step
    smaller = where(fabs(change) < fabs(before), change, before)
    least = HOLDS * usual_current(par) * par.closing_travel
    charge = where(coil.charge > least, coil.charge, least)
    noise = DRIFTS * coil.resistance * coil.noise * sqrt(par.sample_time / (usual_current(par) * charge))
    is_told = is_quiet(coil, par)
    is_off = is_told & (fabs(change - coil.trend) > noise)
    drifts = is_off & (change * before > 0.0) & (fabs(smaller) > noise)
    measured = where(drifts, R, coil.resistance + share * (R - coil.resistance))
    slowly = coil.trend + gain * ((measured - coil.measured) - coil.trend)
    trend = where(drifts, smaller, where((is_told | (gain > 0.0)) & not_(is_off), slowly, 0.0))
    return coil._replace(resistance=measured + trend, measured=measured, trend=trend, found=R, step=change)


def follow(count: Scalar, least: Scalar) -> Scalar:
    """Share of the latest value in a mean of `count` values, at least `least`."""
    return where(count * least < 1.0, 1.0 / count, least)


def take_estimates(coil: Coil, cycles: Scalar, inputs: Inputs, par: Parameters) -> Coil:
    """Take the flux linkage from an estimator at the end of a cycle, and once it explains an operation the resistance.

    That is the one with which the loop's own integral ends at that flux linkage, as the estimator's is late if it
    changes from cycle to cycle. With a noisy current the estimator's is steadier.
    """
    has_solved = (inputs.windows >= SOLVED) & (inputs.estimated_resistance > 0.0) & (inputs.misfit < STEADY)
    by_loop = _resistance_of(coil, coil.flux - coil.drawn - inputs.estimated_flux_linkage, par)
    is_noisy = coil.noise > AVERAGED * usual_current(par)
    R = where(is_noisy, _possible(inputs.estimated_resistance, par), by_loop)
    R = where(has_solved, R, coil.measured)
    is_new = (cycles < YOUNG) | (fabs(R - coil.resistance) > JUMPED * coil.resistance)
    new = _follow_resistance(coil, R, where(is_new, 1.0, SHARE), where(is_noisy | is_new, 0.0, TREND), par)
    balanced = coil.balanced + where(cycles < YOUNG, 1.0, BALANCED) * (by_loop - coil.balanced)
    return _restart_sums(new, inputs.estimated_flux_linkage)._replace(balanced=balanced)


def wandering(coil: Coil, par: Parameters) -> Scalar:
    """Error of the flux linkage at the end of a closing's travel, summed up from the noise of the current [Wb]."""
    time = par.closing_lead + par.closing_travel
    return coil.resistance * coil.noise * sqrt(par.sample_time * time)


def steadied_error(coil: Coil, par: Parameters) -> Scalar:
    """Error of the flux linkage by noise while an estimator steadies it [Wb]."""
    return sqrt(0.5 * coil.resistance * coil.noise * par.sample_time * STEADYING)


def steady_flux(
    coil: Coil, inputs: Inputs, time: Scalar, before: Scalar, is_noisy: Scalar, is_ending: Scalar, par: Parameters
) -> Coil:
    """Draw the flux linkage to that of an estimator, which does not sum up the noise of the current.

    If that is noisy, draw faster, but by no more than noise explains since the operation began (`before` had been added
    then). Otherwise an estimator that wrongly reports a landing would pull the flux linkage away. It reports that of a
    mover that stalls near the end of an opening, and less flux linkage would hold it there, so none is taken away.
    """
    off = inputs.estimated_flux_linkage - coil.flux
    noise = coil.resistance * coil.noise
    share = noise * par.sample_time / where(is_noisy, STEADYING, WANDERING)
    most = BESIDE + EXPLAINED * noise * sqrt(par.sample_time * time)
    is_near = (inputs.misfit < STEADY) & (fabs(off) < WANDERING)
    so_far = coil.drawn - before
    less = where((so_far > -most) & not_(is_ending), -most - so_far, 0.0)
    more = where(so_far < most, most - so_far, 0.0)
    change = where(is_near, share * off, 0.0)
    return shift_flux(coil, where(is_noisy, clip(change, less, more), change))


def shift_flux(coil: Coil, change: Scalar) -> Coil:
    """Change the flux linkage by what an estimator says."""
    return coil._replace(flux=coil.flux + change, drawn=coil.drawn + change)


def average_top(coil: Coil, is_noisy: Scalar, par: Parameters) -> Coil:
    """Average the flux linkage at the end of soft closings, which is nearly the same each time.

    With more noise the mean follows more slowly, but no more than that takes: a coil that gets warm has less each time.
    """
    off, least = coil.flux - coil.top, AVERAGED * usual_current(par)
    share = TOP * where(is_noisy & (coil.noise > least), least / coil.noise, 1.0)
    is_near = fabs(off) < where(is_noisy, SOMEWHERE, APART * wandering(coil, par))
    top = where(is_near, coil.top + share * off, coil.flux)
    return coil._replace(top=top, shift=top - coil.flux, flux=top)


def _restart_sums(coil: Coil, start: Scalar) -> Coil:
    return coil._replace(flux=start, charge=0.0, passed=0.0, shift=0.0, drawn=0.0, highest=0.0, lowest=0.0, rise=0.0)
