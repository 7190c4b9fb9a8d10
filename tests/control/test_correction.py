"""Smoothed values come late: they belong to samples of this operation, of the last one, or of the one before."""

import pytest
from commanded import inputs, parameters

from gapsense.control import correction, laws, run_to_run
from gapsense.control.records import BAD, LONGEST

PAR = parameters()._replace(law=1.0)
AGE, LAST, OLDER = 100.0, 510.0, 490.0  # samples of a closing so far, of the opening before it, of the last closing
WANTED, ERROR = 0.015, 0.1e-3  # Wb


def changed(back, misfit=0.5, published=1.0):
    """Places of the errors that change with a value that is so many samples old, and by how much."""
    state, _ = run_to_run.initial(inputs(), PAR)
    known = laws.write(state.laws, 1.0, laws.first(3e-3, 0.0, PAR)._replace(length=OLDER))
    known = laws.write(known, 0.0, laws.first(3e-3, 0.0, PAR)._replace(length=LAST))
    state = state._replace(
        laws=known,
        running=state.running._replace(command=1.0, age=AGE),
        profiles=[WANTED] * (2 * LONGEST),
        errors=[0.0] * (2 * LONGEST),
    )
    now = 3.0
    given = inputs(
        time=now,
        smoothed_time=now - back * PAR.sample_time,
        smoothed_published=published,
        smoothed_flux_linkage=WANTED - ERROR,
        misfit=misfit,
    )
    errors = run_to_run.learn_from_estimator(state, given, PAR).errors
    return {k: value for k, value in enumerate(errors) if value}


@pytest.mark.parametrize(
    ("back", "place"),
    [
        (0, LONGEST + 100),
        (30, LONGEST + 70),
        (100, LONGEST),
        (101, 509),
        (610, 0),
        (611, LONGEST + 489),
        (999, LONGEST + 101),
    ],
)
def test_sample_is_found_by_its_age(back, place):
    assert changed(back) == {place: pytest.approx(correction.GAIN * ERROR)}


@pytest.mark.parametrize("back", [1000, 1050, 1101, 5000])
def test_what_is_overwritten_is_left(back):
    """Samples of the last closing that this one has reached already, and older ones."""
    assert changed(back) == {}


def test_bad_estimates_and_those_that_are_not_published_are_left():
    assert changed(610, misfit=BAD) == {} == changed(610, published=0.0)


def test_errors_are_smooth_over_samples():
    errors = [0.0] * (2 * LONGEST)
    errors[LONGEST + 50] = 11.0
    found = [correction.at_sample(errors, 1.0, float(k)) for k in (44, 45, 50, 55, 56)]
    assert found == pytest.approx([0.0, 1.0, 1.0, 1.0, 0.0])
    assert correction.at_sample(errors, 0.0, 50.0) == 0.0
    assert correction.at_sample([1.0] * (2 * LONGEST), 1.0, 5000.0) == pytest.approx(1.0)
