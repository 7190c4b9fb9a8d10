"""The bridge of an output stage: which voltages it can give, and with which pulses it gives their mean."""

from __future__ import annotations

from typing import NamedTuple

from gapsense.drive.curve import positive
from gapsense.drive.pulses import ALWAYS, Pulse, Wave
from gapsense.kernels.layout import Choice, Scalar
from gapsense.kernels.trace import clip, fabs, floor, where


class Kind(Choice):
    """Full bridge: both directions; half bridge: one, and zero by the freewheeling path."""

    full, half = range(2)


class Bridge(NamedTuple):
    """What it is made of."""

    kind: Scalar
    supply: Scalar  # positive [V]
    frequency: Scalar  # of the carrier, 0 for an output that is steady during the step [Hz]
    levels: Scalar  # of the mean between zero and the supply, 0 for any


def wave(reference: Scalar, bridge: Bridge) -> Wave:
    """Pulses between zero and the supply, in the direction of the mean voltage that is wanted."""
    share = granted(reference, bridge)
    rail = where(share < 0.0, -bridge.supply, bridge.supply)
    has_carrier, duty = bridge.frequency > 0.0, fabs(share)
    steady = rail * duty
    period = 1.0 / positive(bridge.frequency)
    low, high = where(has_carrier, 0.0, steady), where(has_carrier, rail, steady)
    return Wave(low, high, Pulse(period, duty, delay=0.0, first=ALWAYS))


def granted(reference: Scalar, bridge: Bridge) -> Scalar:
    """Mean voltage that the bridge gives, as a share of its supply."""
    least = where(bridge.kind == Kind.half, 0.0, -1.0)
    share = clip(reference / bridge.supply, least, 1.0)
    levels = positive(bridge.levels)
    return where(bridge.levels > 0.0, floor(share * levels + 0.5) / levels, share)
