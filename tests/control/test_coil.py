"""Resistance and flux linkage of a coil whose resistance is another one than believed."""

from random import Random

import pytest
from commanded import inputs, parameters

from gapsense.control.coil import (
    AVERAGED,
    DRIVEN,
    TOP,
    average_top,
    cycle_resistance,
    driving,
    first_coil,
    integrate_sample,
    is_scarce,
    last_flux,
    learn_resistance,
    learn_zero,
    left_open,
    open_flux,
    raise_hold,
    steady_flux,
    take_estimates,
    usual_current,
)
from gapsense.estimators.mhe.model import gap, make_gap

PAR = parameters()
AS_MEASURED = (False, 0.0, 1.0)  # not late, no expected current


def driven(R, resistance, remanence=0.0, samples=1000, position=PAR.stop_upper):
    """A closing and an opening of a coil whose gap stays as it is, an open one, seen by a belief."""
    R_g, *_ = gap(position, make_gap(PAR), 1.0, 0.0)
    reluctance = R_g + PAR.core_reluctance / PAR.coil_turns**2
    flux = remanence
    coil = first_coil(inputs(current=flux * reluctance), PAR)
    coil = coil._replace(resistance=resistance, measured=resistance, flux=remanence)
    for k in range(samples):
        u = 24.0 if k < 490 else 0.0
        middle = (flux + 0.5 * PAR.sample_time * u) / (1.0 + 0.5 * PAR.sample_time * R * reluctance)
        flux += PAR.sample_time * (u - R * middle * reluctance)
        coil = integrate_sample(coil, inputs(voltage=u, current=flux * reluctance), *AS_MEASURED, PAR)[0]
    return coil, flux


def test_noise_counts_by_the_share_that_the_measured_current_has():
    spread = {}
    for share in (1.0, 0.25):
        noise, coil = Random(1), first_coil(inputs(current=0.4), PAR)
        for _ in range(500):
            read = inputs(current=0.4 + noise.gauss(0.0, 20e-3))
            coil = integrate_sample(coil, read, False, 0.4, share, PAR)[0]
        spread[share] = coil.flux + 500 * PAR.sample_time * 0.4 * PAR.coil_resistance
    assert spread[0.25] == pytest.approx(0.25 * spread[1.0], rel=1e-6) and abs(spread[1.0]) > 50e-6


def test_with_noise_resistance_and_flux_linkage_are_means():
    coil, _ = driven(53.0, 48.0)
    assert learn_resistance(coil, 20.0, 1.0, True, PAR).measured == pytest.approx(48.5, rel=1e-3)
    assert learn_resistance(coil, 1.0, 1.0, True, PAR).measured == pytest.approx(53.0, rel=1e-3)
    for noise, share in ((1e-3, TOP), (2.0 * AVERAGED * usual_current(PAR), 0.5 * TOP)):
        top = average_top(coil._replace(top=coil.flux - 1e-3, noise=noise), True, PAR).top
        assert top == pytest.approx(coil.flux - (1.0 - share) * 1e-3, rel=1e-9)


@pytest.mark.parametrize("R", [44.0, 48.0, 53.0])
def test_resistance_is_the_one_that_closes_the_cycle(R):
    coil, flux = driven(R, 48.0)
    assert open_flux(coil, PAR) == pytest.approx(flux, abs=1e-6)
    assert cycle_resistance(coil, PAR) == pytest.approx(R, rel=2e-4)
    assert learn_resistance(coil, 1.0, 1.0, False, PAR).resistance == pytest.approx(R, rel=2e-4)


@pytest.mark.parametrize(
    ("resistances", "noise", "expected"),
    [
        ((48.0, 48.36, 48.72, 49.08), 2e-3, 49.44),
        ((48.0, 47.64, 47.28, 46.92), 2e-3, 46.56),
        ((48.0, 48.36, 48.72, 49.08), 20e-3, 49.12),  # may be noise: a tenth of the last change
        ((48.0, 48.02, 48.0, 48.01), 2e-3, 48.01),
        ((48.0, 48.0, 48.0, 53.0), 2e-3, 53.0),  # a step
        ((48.0, 48.0, 53.0, 53.0), 2e-3, 53.0),
    ],
)
def test_resistance_that_drifts_is_expected_to_drift_on(resistances, noise, expected):
    coil = first_coil(inputs(), PAR)
    for k, R in enumerate(resistances):
        known = {name: getattr(coil, name) for name in ("found", "step", "measured", "trend")}
        coil = learn_resistance(driven(R, 48.0)[0]._replace(noise=noise, **known), k + 1.0, 1.0, False, PAR)
    assert coil.resistance == pytest.approx(expected, abs=0.02)


def test_resistance_is_that_of_the_loop_itself_where_an_estimator_follows_late():
    coil, flux = driven(53.0, 48.0)
    given = inputs(windows=4.0, misfit=1.0, estimated_resistance=52.0, estimated_flux_linkage=flux)
    assert take_estimates(coil, 1.0, given, PAR).resistance == pytest.approx(53.0, rel=2e-4)
    assert take_estimates(coil._replace(noise=20e-3), 1.0, given, PAR).resistance == 52.0  # steadier


@pytest.mark.parametrize("samples, left", [(520, 0.34), (560, 0.35), (1000, 1.0)], ids=["decays", "later", "settled"])
def test_last_flux_linkage_of_a_decaying_current_is_not_that_of_its_mean(samples, left):
    coil, flux = driven(50.0, 50.0, samples=samples)
    off = open_flux(coil, PAR) - flux
    assert last_flux(coil, PAR) - flux == pytest.approx(left * off, abs=0.05 * off)  # eddy currents have the rest
    assert coil.held_current > 0.0 and off > 0.0


def test_right_resistance_follows_the_flux_linkage():
    coil, flux = driven(48.0, 48.0)
    assert coil.flux == pytest.approx(flux, abs=2e-6)


def test_without_current_nothing_is_said_of_the_resistance():
    coil = first_coil(inputs(), PAR)
    for _ in range(500):
        coil = integrate_sample(coil, inputs(voltage=0.5), *AS_MEASURED, PAR)[0]
    assert cycle_resistance(coil, PAR) == PAR.coil_resistance


def test_resistance_stays_within_what_a_coil_can_be():
    assert cycle_resistance(driven(200.0, 48.0)[0], PAR) <= 1.9 * PAR.coil_resistance
    assert cycle_resistance(driven(5.0, 48.0)[0], PAR) >= 0.6 * PAR.coil_resistance


@pytest.mark.parametrize(("left", "zero"), [(5e-3, 5e-3), (-5e-3, -5e-3), (0.1, 0.0)])
def test_what_an_opening_leaves_is_the_zero_unless_it_is_too_large(left, zero):
    coil = first_coil(inputs(), PAR)
    for _ in range(500):
        coil = integrate_sample(coil, inputs(current=left), *AS_MEASURED, PAR)[0]
    coil = learn_zero(coil, PAR)
    assert coil.zero == pytest.approx(zero, rel=1e-4)
    assert integrate_sample(coil, inputs(current=left), *AS_MEASURED, PAR)[0].last_current == pytest.approx(
        left - zero, abs=1e-6
    )


def test_resistance_does_not_depend_on_what_an_opening_is_told_of_its_beginning():
    """The mean of the last closings replaces the flux linkage; the cycle still closes as it was measured."""
    coil = driven(48.0, 47.0)[0]._replace(noise=3e-3)
    for off in (0.1e-3, -0.2e-3, 0.05e-3):
        shifted = average_top(coil._replace(top=coil.flux + off), False, PAR)
        assert abs(shifted.flux - coil.flux) == pytest.approx(0.7 * abs(off))
        assert cycle_resistance(shifted, PAR) == pytest.approx(cycle_resistance(coil, PAR), rel=1e-12)


def test_the_cycle_tells_the_resistance_by_the_current_that_is_measured():
    """Half of what is integrated is expected, and that is wrong by a tenth."""
    coil, _ = driven(53.0, 48.0)
    off = 0.05 * coil.charge
    expected = coil._replace(charge=coil.charge + off, flux=coil.flux - coil.resistance * off)
    assert cycle_resistance(expected, PAR) == pytest.approx(cycle_resistance(coil, PAR), rel=1e-12)


def test_closing_that_ends_far_from_the_last_ones_counts_alone():
    coil = first_coil(inputs(), PAR)._replace(flux=18e-3, top=17e-3)
    coil = average_top(coil, False, PAR)
    assert (coil.flux, coil.top) == (18e-3, 18e-3)


@pytest.mark.parametrize(
    ("warmth", "volts", "scarce"),
    [
        (0.5, PAR.voltage_hold, False),
        (1.1, PAR.voltage_hold, False),
        (1.15, 1.15 * DRIVEN * PAR.voltage_hold, False),
        (1.3, 1.3 * DRIVEN * PAR.voltage_hold, True),
        (1.9, PAR.voltage_most, True),
    ],
)
def test_ordinary_closing_of_a_warm_coil_takes_the_voltage_that_its_current_needs(warmth, volts, scarce):
    coil = first_coil(inputs(), PAR)._replace(resistance=warmth * PAR.coil_resistance)
    assert driving(coil, PAR) == pytest.approx(volts) and bool(is_scarce(coil, PAR)) is scarce


@pytest.mark.parametrize("R", [44.0, 53.0])
@pytest.mark.parametrize("position", [PAR.stop_upper, PAR.stop_lower])
def test_ordinary_closing_that_leaves_the_mover_open_is_told_by_the_reluctance(R, position):
    """The shipped actuator at 0.7 of its voltage; the resistance of such a closing is that of its end."""
    coil, _ = driven(R, 48.0, samples=490, position=position)
    coil = coil._replace(flux=0.7 * coil.flux, charge=0.7 * coil.charge, held_current=0.7 * coil.held_current)
    coil = coil._replace(late_current=coil.held_current, measured=R)
    assert left_open(coil, PAR) == (position == PAR.stop_upper)
    changing = coil._replace(late_current=0.9 * coil.held_current)
    assert not left_open(changing, PAR)
    assert left_open(changing._replace(flux=5e-3, measured=48.0), PAR)  # and floats
    assert not left_open(coil._replace(held_current=0.0, late_current=0.0), PAR)


def test_mover_that_closes_slowly_is_not_left_open():
    """The reluctance says that it is; the current, which falls by 3 % while the mover moves, that it has landed."""
    noise, coil = Random(1), driven(48.0, 48.0, samples=490)[0]
    level, rows = 0.7 * coil.last_current, {}
    for dip in (0.0, 0.03):
        now = coil._replace(last_current=level, held_current=level, late_current=level, highest=0.0, rise=0.0)
        for k in range(300):
            current = level * (1.0 - dip * (k < 100)) + noise.gauss(0.0, 2e-3)
            now = integrate_sample(now, inputs(voltage=24.0, current=current), *AS_MEASURED, PAR)[0]
        rows[dip] = left_open(now._replace(flux=0.7 * coil.flux, charge=0.0, noise=2e-3), PAR)
    assert rows == {0.0: True, 0.03: False}


def test_resistance_is_that_of_an_estimator_only_where_it_explains_its_windows():
    """Else ordinary closings would get the voltage of a wrong one, by up to 1.9."""
    given = {"windows": 4.0, "estimated_resistance": 70.0}
    coil = first_coil(inputs(), PAR)._replace(measured=49.0, noise=20e-3)
    assert take_estimates(coil, 1.0, inputs(misfit=7.0, **given), PAR).resistance == 49.0
    assert take_estimates(coil, 1.0, inputs(misfit=1.0, **given), PAR).resistance == 70.0


def test_ordinary_closing_takes_more_current_than_that_which_left_the_mover_open():
    coil = first_coil(inputs(), PAR)._replace(held_current=PAR.voltage_hold / PAR.coil_resistance)
    assert driving(raise_hold(coil), PAR) == pytest.approx(1.2 * PAR.voltage_hold)
    assert driving(raise_hold(raise_hold(coil)), PAR) == pytest.approx(1.2 * PAR.voltage_hold)
    assert driving(raise_hold(coil._replace(held_current=1e3)), PAR) == PAR.voltage_most
    assert driving(raise_hold(coil._replace(held_current=0.01)), PAR) == PAR.voltage_hold  # it had none


@pytest.mark.parametrize(("left", "share"), [(1e-3, 0.5), (-1e-3, 0.5), (20e-3, 1.0)])
def test_a_current_that_noise_leaves_is_no_zero_at_once(left, share):
    """The mean of the last 0.8 ms has a deviation of 2.2 mA with 20 mA of noise."""
    coil = first_coil(inputs(), PAR)._replace(late_current=left, held_current=left, last_current=left, noise=20e-3)
    assert learn_zero(coil, PAR).zero == pytest.approx(share * left)
    assert learn_zero(coil._replace(noise=0.1e-3), PAR).zero == left


def test_answer_of_the_current_to_a_step_of_the_voltage_is_no_noise():
    """Eddy currents: it falls at once by 0.2 A with 16 V, before the means of late have changed."""
    coil = first_coil(inputs(voltage=40.0, current=0.7), PAR)._replace(held_voltage=40.0)
    for k in range(40):
        u, current = (40.0, 0.7) if k < 20 else (24.0, 0.5)
        coil = integrate_sample(coil, inputs(voltage=u, current=current), True, 0.0, 1.0, PAR)[0]
    assert coil.noise < first_coil(inputs(), PAR).noise


@pytest.mark.parametrize(
    ("off", "is_ending", "changes"), [(-1e-3, False, True), (-1e-3, True, False), (1e-3, True, True)]
)
def test_an_estimator_takes_no_flux_linkage_away_where_a_mover_may_stall(off, is_ending, changes):
    """With 20 mA it took a mover that had stalled before the upper stop for landed; less flux linkage held it there."""
    coil = first_coil(inputs(), PAR)._replace(flux=10e-3, drawn=0.0, noise=20e-3)
    told = inputs(estimated_flux_linkage=10e-3 + off, misfit=0.6)
    after = steady_flux(coil, told, 4e-3, 0.0, True, is_ending, PAR)
    assert (after.flux != coil.flux) == changes and (after.flux - coil.flux) * off >= 0.0
