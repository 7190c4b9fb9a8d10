"""How much work `Mhe` puts into a window: where damping, core and bend are learnt too, it takes more to find them."""

from __future__ import annotations

from typing import NamedTuple

from gapsense.estimators.mhe_parameters import Parameters
from gapsense.estimators.mhe_records import START, Learnt, N, get, priors
from gapsense.records import Scalar
from gapsense.trace import clip, not_, where

Starts = tuple[dict[int, float], ...]

# where a search begins if nothing explains the currents: fields of `Device`, and how many deviations off
STARTS: Starts = (
    *({k: by} for by in (-1.0, 1.0, -2.0, 2.0) for k in (7, 2)),
    *({1: 2.0}, {5: 1.0}, {1: 2.0, 5: 1.0}),  # more losses than told
)
# the same with `option.further`, in deviations of what is known by now
MORE_STARTS: Starts = (
    *({k: by} for by in (-1.0, 1.0, -2.0, 2.0) for k in (7, 2, 6)),
    *({2: by, 7: by} for by in (-1.0, 1.0)),
    *({k: by} for by in (-2.0, 2.0) for k in (8, 10)),
)
LEAST = 0.01  # of these deviations
WORSE = 2.0  # times the last misfit: a search is worth its time


class Effort(NamedTuple):
    """When a fit is good enough, or has taken too long."""

    tries: Scalar  # passes with derivatives
    retries: Scalar  # of a step that is worse than what it left; the last one goes nowhere
    # samples behind the end of a window after which a cost far below the promised one is no reason for another pass
    # with derivatives, and after which there is none
    late: Scalar
    later: Scalar
    latest: Scalar  # the same for a bad fit
    bad: Scalar  # misfit with which a search begins
    starts: Scalar
    searches: Scalar  # among these
    backlog: Scalar  # samples that may wait behind a window that nothing explained; more are dropped


USUAL = Effort(
    tries=5.0,
    retries=3.0,
    late=140.0,
    later=300.0,
    latest=2000.0,
    bad=6.0,
    starts=float(len(STARTS)),
    searches=1.0,
    backlog=200.0,
)
# after a window that nothing explained: the next one will hardly be
HASTY = USUAL._replace(tries=2.0, late=0.0, later=0.0, latest=0.0, searches=0.0)
# a window that was left too early makes the next ones worse: it is better to be late for some cycles
THOROUGH = Effort(
    tries=15.0,
    retries=5.0,
    late=2500.0,
    later=2500.0,
    latest=4000.0,
    bad=1.0,
    starts=float(len(MORE_STARTS)),
    searches=4.0,
    backlog=5000.0,
)


def is_untaught(learnt: Learnt, par: Parameters) -> Scalar:
    """No window with a motion was explained so far, and the device may be far from the one told; with
    `option.further` the search is thorough anyway.
    """
    return (learnt.explained < 1.0) & not_(par.option_further > 0.0)


def effort(learnt: Learnt, par: Parameters) -> Effort:
    """What a window is worth; a search that will find nothing, as the last one, is not."""
    bad = clip(WORSE * learnt.misfit, THOROUGH.bad, USUAL.bad)
    thorough = THOROUGH._replace(bad=bad)
    is_hopeless = (learnt.rejected > 0.0) & not_(is_untaught(learnt, par))
    usual = [where(is_hopeless, hasty, one) for hasty, one in zip(HASTY, USUAL)]
    return Effort(*(where(par.option_further > 0.0, more, one) for one, more in zip(usual, thorough)))


def start_of(n: Scalar, learnt: Learnt, par: Parameters) -> list[Scalar]:
    """Corrections of the start `n`, from 1 on; none of 0."""
    known = [where(s > LEAST, s, LEAST) for s in get(learnt.deviations, START)]
    both = zip(_start(n, STARTS, priors(par)), _start(n, MORE_STARTS, known))
    return [where(par.option_further > 0.0, more, usual) for usual, more in both]


def _start(n: Scalar, starts: Starts, deviations: list[Scalar]) -> list[Scalar]:
    changes: list[Scalar] = [0.0] * N
    for place, start in enumerate(starts, 1):
        for k, by in start.items():
            changes[k] = where(n == float(place), by * deviations[k], changes[k])
    return changes
