"""Kinks of the current while the voltage is held: a mover that closes or opens changes the inductance.

While the current rises, no coil at rest lets it fall: where it does, the mover goes, and where it rises again, it has
landed.  While the current falls, that of a coil at rest falls ever more slowly, however its core saturates: where it
does not, the mover goes back.  PWM may hide the former in its ripple.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gapsense.identification.inspection.drive import Carrier
from gapsense.identification.measurements.operations import Operation, noise
from gapsense.identification.measurements.record import Record, Vector

STEADY = 0.05  # of the largest voltage: a voltage that changes less is held
SIGMAS = 6.0  # times the noise of what is compared
SMOOTHED = 0.04  # part of a stretch over which the current is averaged
LEAST = 1e-3  # of the largest current: a smaller change of its course is none
GONE = 0.03  # of the largest current: less says nothing
AFTER = 3  # samples after a change of the voltage, in which filters still follow
SHORTEST = 12  # samples of a held voltage
LOW = 0.25  # of the largest voltage: less does not drive
RISEN = 0.9  # of where it begins to fall: a current that begins there has not risen
MOST = 64  # stretches of an operation that are searched
FINER = 12  # parts of a fall of the current, over which it is averaged to find its end
SCALES = (6, 8, 12, 16, 24, 48)  # parts of a falling current in which it is compared with a straight line


class Kink(NamedTuple):
    """Where the course of the current tells of a motion."""

    begin: float  # [s]
    end: float  # where it rises again, or bends most: on closing, the mover lands there [s]
    samples: int  # between them


def closing(record: Record, operation: Operation, sigma: float, carrier: Carrier | None = None) -> Kink | None:
    """Where the current, with noise `sigma`, falls though the voltage is held, or switched by PWM."""
    v, i = record.voltage[operation.inside], record.current[operation.inside]
    driven = held(v)
    if carrier is not None:
        i, sigma, driven = averaged(v, i, sigma, carrier)
    for a, b in driven:
        found = fall(i[a:b], sigma, LEAST * float(i.max())) if v[a:b].mean() > LOW * v.max() else None
        if found and i[a] < RISEN * i[a + found[0]]:
            return kink(record, operation, a + found[0], a + found[1])
    return None


def opening(record: Record, operation: Operation, sigma: float) -> Kink | None:
    """Where the falling current, with noise `sigma`, falls faster again."""
    v, i = record.voltage[operation.inside], record.current[operation.inside]
    for a, b in held(v):
        flows = np.flatnonzero(i[a:b] > GONE * i.max() + 4.0 * sigma)
        b = a + int(flows[-1]) + 1 if flows.size else a
        if b - a < SHORTEST or i[a] <= i[b - 1] or v[a:b].mean() > LOW * v.max():
            continue
        if found := bulge(i[a:b], sigma, LEAST * float(i.max())):
            return kink(record, operation, a + found[0], a + found[1])
    return None


def kink(record: Record, operation: Operation, begin: int, end: int) -> Kink:
    """Between two samples of an operation."""
    times = record.times[operation.start + 1 + begin], record.times[operation.start + 1 + end]
    return Kink(float(times[0]), float(times[1]), end - begin)


def averaged(v: Vector, i: Vector, sigma: float, carrier: Carrier) -> tuple[Vector, float, list[tuple[int, int]]]:
    """Current over a period of PWM, its noise, that of aliases included, and where the voltage is switched."""
    width, on = max(2, round(carrier.samples)), np.flatnonzero(v > 0.5 * v.max())
    mean = np.convolve(i, np.ones(width) / width, mode="same")
    a, b = int(on[0]) + width, int(on[-1]) - width
    return mean, max(sigma / float(np.sqrt(width)), noise(mean[a:b:width])), [(a, b)] if b - a >= SHORTEST else []


def held(v: Vector) -> list[tuple[int, int]]:
    """Stretches in which the voltage stays what it is, without the samples in which filters still follow a change."""
    limit, found = max(STEADY * float(np.abs(v).max()), SIGMAS * noise(v)), list[tuple[int, int]]()
    jumps = np.flatnonzero(np.abs(np.diff(v)) > limit) + 1
    ends = [0, *jumps.tolist(), v.size]
    long = [(a + AFTER, b) for a, b in zip(ends[:-1], ends[1:]) if b - a >= SHORTEST + AFTER]
    for begin, end in long[:MOST]:
        windows = np.lib.stride_tricks.sliding_window_view(v[begin:end], SHORTEST)
        quiet = np.flatnonzero(windows.max(axis=1) - windows.min(axis=1) < limit)
        if quiet.size:
            a = begin + int(quiet[0])
            left = np.flatnonzero(np.abs(v[a:end] - np.median(v[a : a + SHORTEST])) > limit)
            found.append((a, a + int(left[0]) if left.size else end))
    return found


def fall(i: Vector, sigma: float, least: float) -> tuple[int, int] | None:
    """Where a rising current begins to fall, and where it rises again."""
    width = max(1, round(SMOOTHED * i.size))
    smooth = np.convolve(i, np.ones(width) / width, mode="valid")
    top = np.maximum.accumulate(smooth)
    falls = np.flatnonzero(top - smooth > SIGMAS * sigma / np.sqrt(width) + least)
    if not falls.size:
        return None
    begin = int(np.argmax(smooth[: falls[0] + 1]))
    rises = np.flatnonzero(np.minimum.accumulate(smooth[falls[0] :]) < smooth[falls[0] :] - least)
    last = int(falls[0]) + (int(rises[0]) if rises.size else smooth.size - 1 - int(falls[0])) + width
    return begin + width // 2, lowest(i, begin, last, max(1, (last - begin) // FINER))


def lowest(i: Vector, begin: int, end: int, width: int) -> int:
    """Where the current, averaged over fewer samples, is lowest between two of them."""
    return begin + int(np.argmin(np.convolve(i[begin:end], np.ones(width) / width, mode="valid"))) + width // 2


def bulge(i: Vector, sigma: float, least: float) -> tuple[int, int] | None:
    """Where a falling current falls more slowly than a straight line to what follows, and where it bends down."""
    found = None
    for part in SCALES:  # the coarsest sees where it begins, the finest that noise lets through where it ends
        h = i.size // part
        width = max(1, h // 2)
        if h < 2 or i.size <= 2 * h + width:
            continue
        smooth = np.convolve(i, np.ones(width) / width, mode="valid")
        bend = smooth[2 * h :] - 2.0 * smooth[h:-h] + smooth[: -2 * h]
        is_bent = bend < -SIGMAS * sigma * np.sqrt(6.0 / width) - least
        if is_bent.any():
            place = h + width // 2
            found = found[0] if found else int(np.argmax(is_bent)) + place, int(np.argmin(bend)) + place
    return found if found is None else (min(found), max(found))
