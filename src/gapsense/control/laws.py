"""What is known of the two kinds of operation, in memory, and how approaches get slower from cycle to cycle.

A landing in time makes the next approach slower. A landing that is late or missing makes it faster, and sets a floor:
for a while no approach is slower than that.
"""

from __future__ import annotations

from gapsense.control.records import LAW, Law, LawKind, Parameters
from gapsense.kernels.layout import Array, Scalar, blank, flat, record
from gapsense.kernels.linalg import diagonal, vector
from gapsense.kernels.trace import clip, load, not_, store, where

BEFORE = (0.2, 0.15, 0.2, 0.15)  # standard deviations of a, b, q, r before anything is learnt
DOUBTED = (0.2, 0.15, 0.2, 0.6)  # the same after a sudden change
SHRINK, RAISE, KEEP = 0.6, 1.2, 0.98  # of the approach speed; of its floor where it was late; of a floor per cycle
HIGHEST_FLOOR = 0.25  # [m/s]
EXPLAINED = 0.17  # first approaches after a contact has handed over to an estimator are no faster [m/s]
UNJUDGED = 0.6  # operations that did not arrive: what one counts for until it is judged
LATE, LATER = 0.4, 0.6  # first travels after the planned arrival; the same with a noisy current
STRETCH, LONGEST_TRAVEL = 1.04, 1.5  # of a travel that the voltage does not allow; of the first one
LIMITED = 5.0  # samples at a limit of the voltage that are too many
EASED, EASIEST = 60.0, 0.1  # of the square of the flux linkage, by the time that openings are late [1/s]; at most
LATEST, REMEMBERED = 1e-3, 0.995  # a time beyond this is not believed [s]; share of it that is kept
UNFOLLOWED = 0.3  # of a travel at a limit: the flux linkage was another one than the profile


def read(laws: Array, half: Scalar) -> Law:
    """What is known of a kind of operation."""
    law: Law = record(Law, [load(laws, half * LAW + k) for k in range(LAW)])
    return law


def write(laws: Array, half: Scalar, law: Law) -> Array:
    """`laws` with one kind of operation replaced."""
    for k, entry in enumerate(flat(law)):
        laws = store(laws, half * LAW + k, entry)
    return laws


def first(travel: Scalar, by_model: Scalar, par: Parameters) -> Law:
    """Before anything is learnt."""
    is_handed = (by_model > 0.0) & (par.law == LawKind.contact)
    slower = is_handed & (par.approach_first > EXPLAINED)
    return blank(
        Law,
        cov=diagonal([s * s for s in BEFORE]),
        speed=where(slower, EXPLAINED, par.approach_first),
        floor=par.approach_least,
        travel=travel,
        was_plain=1.0,
        was_followed=1.0,
    )


def forget(law: Law, by_model: Scalar, par: Parameters) -> Law:
    """Take what was learnt for a guess after a sudden change, and learn afresh from there."""
    new = first(law.travel, by_model, par)
    cov = diagonal([s * s for s in DOUBTED])
    return law._replace(cov=cov, slopes=new.slopes, trend=new.trend, speed=new.speed, floor=new.floor)


def start_operation(law: Law, is_plain: Scalar) -> Law:
    """Count an operation that begins as not judged yet."""
    missed = law.missed + where(is_plain, 0.0, UNJUDGED)
    return law._replace(missed=missed, was_plain=where(is_plain, 1.0, 0.0), was_followed=1.0, floated=0.0)


def is_late(has_landed: Scalar, after: Scalar, travel: Scalar, is_noisy: Scalar) -> Scalar:
    """Whether an operation fell short: its landing came this long after the planned one, if at all."""
    return (has_landed < 1.0) | (after > where(is_noisy, LATER, LATE) * travel)


def raise_approach(law: Law, par: Parameters) -> tuple[Scalar, Scalar]:
    """Speed and floor of the next approach after an operation that fell short."""
    raised, faster = RAISE * law.speed, law.speed / SHRINK
    higher = where(law.floor > raised, law.floor, raised)
    higher = where(higher < HIGHEST_FLOOR, higher, HIGHEST_FLOOR)
    return where(faster < par.approach_first, faster, par.approach_first), higher


def raise_where(law: Law, is_so: Scalar, par: Parameters) -> Law:
    """`law` with the next approach raised, where that is due."""
    faster, higher = raise_approach(law, par)
    return law._replace(speed=where(is_so, faster, law.speed), floor=where(is_so, higher, law.floor))


def has_raised(law: Law, half: Scalar) -> Scalar:
    """Whether the next approach was raised when the last operation ended: a closing that floated."""
    return (law.floated > 0.0) & (half > 0.5)


def choose_approach(
    law: Law, half: Scalar, has_landed: Scalar, fell_short: Scalar, least: Scalar, par: Parameters
) -> Law:
    """Choose the next approach after a soft operation; `least` is the speed of the slowest ones."""
    faster, higher = raise_approach(law, par)
    slower = SHRINK * law.speed
    least = where(least < HIGHEST_FLOOR, least, HIGHEST_FLOOR)
    floor = where(fell_short, higher, least + KEEP * where(law.floor > least, law.floor - least, 0.0))
    speed = where(fell_short, faster, where(slower > floor, slower, floor))
    # without following the plan it was the voltage that fell short, not the approach
    is_told = (law.was_followed > 0.0) & not_(has_raised(law, half))
    return law._replace(
        speed=where(is_told, speed, law.speed),
        floor=where(is_told, floor, law.floor),
        missed=missed_by(law, has_landed),
    )


def ease_opening(law: Law, is_told: Scalar, after: Scalar) -> Law:
    """Plan less flux linkage near the open stop, if an estimator tells two late openings in a row.

    The estimator only tells late ones: while the mover floats before its stop, a model of another core drifts, and soon
    takes it for landed where it is not.
    """
    late = where(is_told, where(law.floated > 0.0, LATEST, clip(after, 0.0, LATEST)), 0.0)
    both = where(late < law.late, late, law.late)
    a = where(is_told, clip(REMEMBERED * law.mean[0] - EASED * both, -EASIEST, 0.0), law.mean[0])
    b = where(is_told, -a, law.mean[1])
    return law._replace(late=late, mean=vector([a, b, *law.mean[2:]]))


def missed_by(law: Law, has_landed: Scalar) -> Scalar:
    """Operations in a row that did not arrive; a soft one counts as `UNJUDGED` from its beginning on."""
    return where(has_landed > 0.0, 0.0, law.missed + (1.0 - UNJUDGED))


def stretch_travel(law: Law, first: Scalar) -> Scalar:
    """Lengthen the travel, because the voltage was at its limit for more than some samples."""
    travel, longest = STRETCH * law.travel, LONGEST_TRAVEL * first
    return where(travel < longest, travel, longest)
