"""What is said of outcomes: quantiles of impact speeds, arrivals, energies, and what must hold of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.control.records import Noted
from gapsense.control.run_to_run import SHORT, TRACKING

from .cycles import NEVER, Outcome

Floats = npt.NDArray[np.float64]
OPERATIONS = ("closing", "opening")
LEVELS = {"median": 0.5, "90 %": 0.9, "99 %": 0.99, "worst": 1.0}
LAST = 10  # cycles at the end that are taken together
LEARNT = 3  # cycle from which an operation that does not arrive counts
WARNINGS = tuple(name.replace("_", " ") for name in Noted._fields)  # in the order of their bits
LANDED = sum(2 ** WARNINGS.index(name) for name in ("hard", "changed"))  # warnings of how an operation has landed
STANDING = 2 ** WARNINGS.index("noisy")  # is there for good, whatever an operation does: tells nothing of it
HARD, SOFT = 0.5, 0.2  # impact speeds of operations that are to be told, and that are not [m/s]
HELD = 0.3  # impact speed below which soft operations are to stay [m/s]
FOLLOWED = 10  # cycle from which they are
ORDINARY = 1.1  # ordinary impacts of the same cycle: what is harder is worse than without the controller
SHOWN = (2, 5, 10, 20)  # cycles of the tables, and the last one


class Noticed(NamedTuple):
    """What the controller has said of the operations that it wanted soft."""

    hard: int  # above `HARD`
    told: int  # of these: by a warning or an ordinary operation, in the next one
    later: int  # of these: at the latest in the next one of the same kind
    soft: int  # below `SOFT`
    wrongly: int  # of these: those of which it warned
    twice: int  # operations of all kinds harder than ordinary ones, the one before of the same kind too


class Demand(NamedTuple):
    """A bound of the impact speed in closings and in openings [m/s]."""

    condition: str
    law: str
    level: str
    first: int  # cycle, or -`LAST`
    bound: float


DEMANDS = tuple(
    Demand(condition=condition, law=law, level=level, first=first, bound=bound)
    for conditions, laws, level, first, bound in (
        ("plain", "contact", "median", 5, 0.12),
        ("plain", "contact", "90 %", 10, 0.25),
        ("plain", "contact", "90 %", 20, 0.20),
        ("plain", "model", "median", 5, 0.12),
        ("plain", "model", "90 %", 10, 0.18),
        ("plain", "model", "90 %", 20, 0.16),
        ("plain", "model", "99 %", -LAST, 0.25),
        ("warm", "contact model", "median", -LAST, 0.12),
        ("warm", "contact model", "90 %", -LAST, 0.17),
        ("warm-fast", "contact", "median", -LAST, 0.13),
        ("warm-fast", "model", "median", -LAST, 0.10),
        ("warm-fast", "contact", "90 %", 10, 0.20),
        ("warm-fast", "model", "90 %", -LAST, 0.14),
        ("noise", "contact model", "median", -LAST, 0.13),
        ("offset negative-offset", "contact model", "median", 20, 0.12),
        ("no-reserve", "contact model", "90 %", -LAST, 0.25),
        ("half-bridge", "contact", "median", -LAST, 0.22),
        ("lengths gain", "contact model", "median", 10, 0.12),
        ("lengths gain", "contact model", "worst", 10, 0.40),
        ("missed spike lost", "contact model", "median", 18, 0.12),  # one thing goes wrong, once
        ("missed spike lost", "contact model", "90 %", 18, 0.18),
        ("voltage-offset", "contact", "90 %", 10, 0.20),
        ("voltage-offset", "model", "median", 10, 0.12),
        ("voltage-offset", "model", "worst", 10, 0.30),
        ("supply", "contact model", "90 %", -LAST, 0.15),
        ("supply", "contact", "median", -LAST, 0.12),
        ("softer", "contact model", "median", -LAST, 0.12),
        ("supply", "model", "median", -LAST, 0.10),
        ("damping-step rest-step", "contact model", "median", -LAST, 0.12),
        ("play", "model", "median", -LAST, 0.12),
        ("play", "model", "90 %", -LAST, 0.30),
        ("untold-noise", "model", "median", -LAST, 0.12),
        ("told-noise untold-noise", "contact", "median", 10, 0.14),
        ("told-noise untold-noise", "contact", "90 %", 10, 0.22),
        ("untold-noise", "both", "median", -LAST, 0.13),
        ("late", "contact", "median", -LAST, 0.12),
        ("late", "contact", "worst", -LAST, 0.30),
        ("bounce late", "both", "median", 10, 0.12),
        ("bounce late", "both", "90 %", 20, 0.30),
    )
    for condition in conditions.split()
    for law in laws.split()
)
EARLY = slice(2, 11)  # cycles in which the hardest impact of `model` is held to that of `contact`
MISSED = 1e-3  # share of the operations that need not arrive


class Verdict(NamedTuple):
    """What was demanded and what was found, closing and opening."""

    sentence: str
    found: tuple[float, float]
    bound: float

    @property
    def holds(self) -> bool:
        """Whether both do."""
        return max(self.found) <= self.bound


def quantile(speeds: Floats, level: str) -> Floats:
    """Of closings and openings, (2,) of (cycles, 2, runs)."""
    return np.asarray(np.quantile(np.swapaxes(speeds, 1, 2).reshape(-1, 2), LEVELS[level], axis=0))


def worst_cycle(speeds: Floats, level: str) -> Floats:
    """The largest quantile of a single cycle, of closings and openings."""
    return np.asarray(np.quantile(speeds, LEVELS[level], axis=2).max(axis=0))


def missed(outcome: Outcome) -> tuple[tuple[int, int], int]:
    """Closings and openings that did not arrive since the laws had learnt, and how many of each there were."""
    speeds = outcome.speeds[LEARNT:]
    closing, opening = (speeds == NEVER).sum(axis=(0, 2)).tolist()
    return (closing, opening), speeds[:, 0].size


def warned(outcome: Outcome) -> list[float]:
    """Shares of the last cycles in which the controller gave each of its `WARNINGS`."""
    bits = outcome.warnings[-LAST:].astype(int)
    return [float(np.mean(bits >> k & 1)) for k in range(len(WARNINGS))]


def was_soft(states: Floats) -> npt.NDArray[np.bool_]:
    """Which operations were to be soft."""
    return np.isin(states, (TRACKING, SHORT))


def noticed(outcome: Outcome) -> Noticed:
    """Of all operations since the laws had learnt."""
    speeds, states, said = (x.reshape(-1, x.shape[-1]) for x in (outcome.speeds, outcome.states, outcome.said))
    is_soft, was_warned = was_soft(states), said.astype(int) & LANDED > 0
    is_told = (said.astype(int) & ~STANDING > 0) | ~is_soft
    since, end = 2 * LEARNT, len(speeds) - 2
    now, next_one, same = slice(since, end), slice(since + 1, end + 1), slice(since + 2, end + 2)
    is_hard, is_gentle = is_soft[now] & (speeds[now] > HARD), is_soft[now] & (speeds[now] < SOFT)
    is_new = was_warned[next_one] & ~was_warned[now]
    has_closed = outcome.ordinary[:, :1] < NEVER  # else its ordinary opening is none, from where the mover floats
    harder = outcome.speeds > ORDINARY * np.where(has_closed, outcome.ordinary, NEVER)
    found = (
        is_hard,
        is_hard & is_told[next_one],
        is_hard & (is_told[next_one] | is_told[same]),
        is_gentle,
        is_gentle & is_new,
        harder[LEARNT:] & harder[LEARNT - 1 : -1],
    )
    return Noticed(*(int(np.sum(x)) for x in found))


def soft_speeds(outcome: Outcome) -> list[Floats]:
    """Of the closings and of the openings that were to be soft, from cycle `FOLLOWED` on."""
    speeds, is_soft = outcome.speeds[FOLLOWED:], was_soft(outcome.states[FOLLOWED:])
    return [speeds[:, k][is_soft[:, k]] for k in range(len(OPERATIONS))]


def impact_energy(outcome: Outcome) -> Floats:
    """Of closing and opening together: what can be heard, (cycles, runs) [J]; nothing where nobody arrived."""
    arrived = np.where(outcome.speeds < NEVER, outcome.speeds, 0.0)
    return np.asarray(0.5 * outcome.mass * np.sum(arrived**2, axis=1))


def verdicts(outcomes: Mapping[tuple[str, str], Outcome]) -> list[Verdict]:
    """Of all demands on rows that there are, with enough cycles."""
    speeds = {d[:2]: outcomes[d[:2]].speeds for d in DEMANDS if d[:2] in outcomes}
    made = [_judged(d, speeds[d[:2]]) for d in DEMANDS if d[:2] in speeds and _fits(d, speeds[d[:2]])]
    arrivals = [_arriving(law, outcomes["plain", law]) for law in ("contact", "model") if ("plain", law) in outcomes]
    return made + arrivals + _early(outcomes)


def _early(outcomes: Mapping[tuple[str, str], Outcome]) -> list[Verdict]:
    """The hardest early impacts of the law `model` over those of the law `contact`."""
    both = [outcomes["plain", law].speeds for law in ("contact", "model") if ("plain", law) in outcomes]
    if len(both) < 2 or len(both[0]) < EARLY.stop:
        return []
    contact, model = (speeds[EARLY].max(axis=(0, 2)) for speeds in both)
    sentence = f"plain, model over contact: hardest impact of the cycles {EARLY.start} to {EARLY.stop - 1}"
    return [Verdict(sentence, tuple((model / contact).tolist()), 1.0)]


def _fits(demand: Demand, speeds: Floats) -> bool:
    return len(speeds) > max(demand.first, LAST)


def _judged(demand: Demand, speeds: Floats) -> Verdict:
    name = f"{demand.condition}, {demand.law}: {demand.level}"
    if demand.first < 0:
        found = quantile(speeds[demand.first :], demand.level)
        return Verdict(f"{name} of the last {LAST} cycles", tuple(found.tolist()), demand.bound)
    found = worst_cycle(speeds[demand.first :], demand.level)
    return Verdict(f"{name} of each cycle from {demand.first} on", tuple(found.tolist()), demand.bound)


def _arriving(law: str, outcome: Outcome) -> Verdict:
    (closing, opening), count = missed(outcome)
    return Verdict(f"plain, {law}: share that did not arrive", (closing / count, opening / count), MISSED)
