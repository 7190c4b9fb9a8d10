"""A record as what drives the model: the mean voltage of every step, with edges whose places are sought.

Where the voltage jumps from one sample to the next, the samples do not say when.  Half a sample of doubt on a step of
30 V is as much flux linkage as an offset of many milliamperes. So the place of the edges is a parameter, in sampling
periods after the middle: one of all edges together, and one of each edge unless they are in step with the samples.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from gapsense.estimators.mhe.mhe import SAME
from gapsense.estimators.mhe.model import Parameters
from gapsense.estimators.readings import JUMP
from gapsense.identification.measurements.operations import coarse, starts
from gapsense.identification.measurements.prepare import remaining
from gapsense.identification.measurements.record import Record, Vector
from gapsense.identification.measurements.signals import hidden
from gapsense.identification.residual import REST, noise_of, noises

FINEST = 20e-6  # s; the model takes no longer steps, for which its errors are below 1 um
BEFORE = 2  # samples at rest that are kept
LEFT = 0.5  # of the model's error, once the places of edges are sought
SURE = 1e-3  # of the noise; no offset is known better
ALIKE = 0.01  # as `ANYWHERE`, of edges that are in step with the samples
TUNED = 20e-6  # s; the sampling period for which `SAME` samples of the model's error are the same
MANY, SLOWEST = 20, 3.0  # edges that are PWM, and samples between two that are too few
Matrix = npt.NDArray[np.float64]
Places = npt.NDArray[np.int_]
Truths = npt.NDArray[np.bool_]


class Excitation(NamedTuple):
    """One record, from just before its first operation on."""

    record: Record
    first: int  # sample of the record with which it begins
    current: Vector  # [A]
    halves: Vector  # voltage in each interval before and after its edge (n, 2) [V]
    edges: Places  # samples at the end of intervals in which the voltage jumps, with a place to be found
    weights: Vector  # of the current; 0 where it does not count
    noise: float  # of the current [A]
    doubt: float  # standard error of what rest says of the current's offset [A]
    parts: int  # steps of a sampling period

    @property
    def is_too_fast(self) -> bool:
        """Whether it switches faster than the samples tell: flux linkage of places that are guessed adds up."""
        gaps = np.diff(self.edges)
        return self.parts > 1 and gaps.size >= MANY and float(np.median(gaps)) < SLOWEST

    @property
    def step(self) -> float:
        """Step of the model [s]."""
        return self.record.dt / self.parts

    def voltage(self, places: Vector) -> Vector:
        """Mean voltage of each step, from the first sample on; places of the edges from the middle of their period."""
        at = np.full(len(self.halves), 0.5)
        at[self.edges] += np.clip(places, -0.5, 0.5)
        return means(self.halves[1:], at[1:], self.parts).ravel()

    def move_each_edge(self, places: Vector, by: Vector) -> Matrix:
        """Move each edge alone by so much: the voltages, (steps, edges)."""
        volts = np.repeat(self.voltage(places)[:, None], self.edges.size, axis=1)
        at = 0.5 + np.clip(places + by, -0.5, 0.5)
        rows = (self.edges[:, None] - 1) * self.parts + np.arange(self.parts)
        volts[rows, np.arange(self.edges.size)[:, None]] = means(self.halves[self.edges], at, self.parts)
        return volts

    def shorten_to(self, share: float) -> Excitation:
        """Keep the first part only."""
        n = max(round(share * self.current.size), BEFORE + 1)
        return self._replace(
            current=self.current[:n], halves=self.halves[:n], edges=self.edges[self.edges < n], weights=self.weights[:n]
        )

    def count_only_first(self, share: float) -> Excitation:
        """Let only the first part count; so the model of each part is the same code."""
        part = self.shorten_to(share)
        return self._replace(edges=part.edges, weights=np.pad(part.weights, (0, self.weights.size - part.weights.size)))


def means(halves: Matrix, at: Vector, parts: int) -> Matrix:
    """Mean voltages (periods, parts), each period with one voltage up to `at` and another one from there on."""
    bounds = np.arange(parts + 1) / parts
    total = halves[:, :1] * bounds + np.diff(halves, axis=1) * np.maximum(bounds - at[:, None], 0.0)
    return np.asarray(np.diff(total, axis=1) * parts)


def calm_noise(record: Record, first: int, is_edge: Truths) -> float:
    """Noise of the current where the voltage does not jump: PWM looks like noise in second differences."""
    near = np.convolve(is_edge, np.ones(3), mode="same") > 0.0
    curvature = np.abs(np.diff(record.current[first:], 2))[~near[1:-1]]
    if curvature.size < REST:
        return noise_of(record, first)
    rest = float(record.current[:first].std()) if first >= REST else 0.0
    found = 1.4826 * float(np.median(curvature)) / math.sqrt(6.0)
    return max(found, hidden(record.current), coarse(record.current), rest)


def read_excitation(record: Record, par: Parameters) -> Excitation:
    """The drive of a record, and how its current counts: as in `Mhe`, with the noise of this record."""
    first = max(starts(record)[0] - BEFORE, 0)
    parts = math.ceil(record.dt / FINEST - 1e-6)
    least = par.edge + JUMP * noises([record])["noise.voltage"]
    is_edge = (np.abs(np.diff(record.voltage, prepend=record.voltage[0])) > least)[first:]
    noise = calm_noise(record, first, is_edge)
    jumps = (np.abs(np.diff(record.halves, axis=1)[:, 0]) > least)[first:]
    jumps[0] = False
    variance = noise**2 + SAME * TUNED / record.dt * (LEFT * float(par.model_error)) ** 2
    return Excitation(
        record=record,
        first=first,
        current=record.current[first:],
        halves=record.halves[first:],
        edges=np.flatnonzero(jumps),
        weights=np.where(is_edge, 0.0, 1.0 / math.sqrt(variance)),
        noise=noise,
        doubt=max(noise / math.sqrt(max(1, first)), remaining(record).get("current", 0.0), SURE * noise),
        parts=parts,
    )
