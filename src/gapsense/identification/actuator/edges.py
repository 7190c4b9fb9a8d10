"""Where between its samples the voltage of a record switched, as far as the currents at rest after each edge tell.

Half a sampling period of doubt is flux linkage, and moves all positions until the next landing.  A shift of an edge is
nearly the same offset of the current as eddy currents, so that these, coil and gap are sought too, with their priors.
"""

from __future__ import annotations

import numpy as np

from gapsense.estimators.mhe.model import Parameters
from gapsense.identification.actuator.drive import Excitation, read_excitation
from gapsense.identification.actuator.fit import BESIDE, ENOUGH, LONGEST, Problem, is_fitted, simulate, with_bend
from gapsense.identification.least_squares import Vector, minimise, rms
from gapsense.identification.measurements.operations import starts
from gapsense.identification.measurements.record import Record, with_convention
from gapsense.identification.measurements.signals import ANYWHERE

DOUBTED = {  # fields that go with the places, and what `Mhe` knows of them before its first window
    "coil_resistance": "prior_resistance",
    "core_eddy": "prior_eddy",
    "gap_factor": "prior_gap",
    "core_hysteresis": "prior_hysteresis",
}
MATTERS = 5e-3  # of the stroke: an error of the position that half a sampling period makes
WORTH = 0.01  # the same, from which it is told
TOLD = 0.2  # sampling periods: standard errors of places that are told
LEFT = 0.4  # part of that error that is left where they do not help
MOST = 40  # edges that are placed
MOVED = 0.01  # of the stroke, from which a mover is no longer at rest
EXPLAINED = 4.0  # mean square of what is left, in that of noise and model's error


def place_edges(record: Record, known: Parameters) -> Record:
    """The record with the mean voltages that its currents tell, if that matters and they do; a remark says so."""
    read, par = with_convention(record, "trapezoid"), with_bend(known)
    if record.is_mean or read.slow or not starts(read):
        return record
    whole = read_excitation(read, known)
    last = whole.edges[MOST] if whole.edges.size > MOST else whole.current.size
    drive = whole.shorten_to(last / whole.current.size)
    if not drive.edges.size or whole.is_too_fast:
        return record
    off = shift(par, drive, np.zeros(drive.edges.size), np.full(drive.edges.size, 0.5))
    stroke = float(par.stop_upper - par.stop_lower)
    if off < MATTERS * stroke:
        return record
    said = (
        f"every {1e6 * record.dt:.4g} us the voltage does not tell where in between it switches, which alone moves"
        f" positions of the model by up to {1e6 * off:.2g} um RMS"
    )
    places, errors = find_places(par, drive)
    left = shift(par, drive, places, errors)
    if left > LEFT * off:
        told = (
            f"{said}. Nor do the currents, by the priors and `model.error` of `Mhe`. Sample faster, or know coil, core"
            " and gap better."
        )
        return record._replace(remarks=(*record.remarks, told)) if off > WORTH * stroke else record
    voltage, means = record.voltage.copy(), drive.voltage(places).reshape(-1, drive.parts).mean(axis=1)
    first = drive.first + 1
    voltage[first:] = read.applied[first:]
    voltage[first : first + means.size] = means
    said = f"{said}. The currents do, to {1e6 * left:.2g} um; `Mhe` gets mean voltages with these edges."
    return record._replace(voltage=voltage, is_mean=True, remarks=(*record.remarks, said))


def find_places(par: Parameters, drive: Excitation) -> tuple[Vector, Vector]:
    """Places of edges and their standard errors, in sampling periods; those that are not told stay in the middle."""
    names = [name for name in DOUBTED if is_fitted(par, name)]
    doubts = {name: float(getattr(par, DOUBTED[name])) for name in names}
    at = drive._replace(weights=drive.weights * rests(par, drive))
    p = Problem(par, names, [at], doubts=doubts)
    found = minimise(p, np.zeros(p.deviations.size), LONGEST, ENOUGH)
    left, J, own = found.residuals[: at.current.size], p.jacobian(found.point), len(names) + BESIDE
    to_places = np.hstack([np.zeros((at.edges.size, own)), np.eye(at.edges.size)])
    to_places[:, own - 1] = 1.0  # what all of them share
    errors = np.sqrt(np.einsum("ij,jk,ik->i", to_places, np.linalg.inv(J.T @ J), to_places))
    is_near = float(left @ left) < EXPLAINED * np.count_nonzero(at.weights)
    is_told = (errors < TOLD) & is_near
    return np.where(is_told, p.places(found.point)[0], 0.0), np.where(is_told, errors, ANYWHERE)


def rests(par: Parameters, drive: Excitation) -> Vector:
    """1 at samples before the model has left where it was at the last edge, else 0."""
    z, least = simulate(par, drive, np.zeros(drive.edges.size)).position, MOVED * (par.stop_upper - par.stop_lower)
    found = np.ones(z.size)
    for begin, end in zip(drive.edges, [*drive.edges[1:], z.size]):
        found[begin:end] = np.logical_and.accumulate(np.abs(z[begin:end] - z[begin - 1]) < least)
    return found


def shift(par: Parameters, drive: Excitation, places: Vector, errors: Vector) -> float:
    """By how much such errors of places move the position of the model in the motion that has most of it, RMS [m]."""
    late, early = (simulate(par, drive, places + by).position for by in (errors, -errors))
    off, ends = 0.5 * (late - early), [*drive.edges, late.size]
    return max(
        rms(moved) if (moved := x[x != 0.0]).size else 0.0 for x in map(off.__getitem__, map(slice, ends, ends[1:]))
    )
