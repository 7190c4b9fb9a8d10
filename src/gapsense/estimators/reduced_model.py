"""Reduced model of a reluctance actuator, Section II-B of [RTS]: what its estimators believe.

State x = (z*_k, z*_(k-1), lambda_k, e_i, e_F) (19), with the position normalised to [0, 1] and its past value in place
of the velocity (Verlet).  The mode (1: lower stop, 2: moving, 3: upper stop) is an input.  Hysteresis and eddy currents
are left out; e_i and e_F, constant but for noise, stand for what the current and the force equation do not say.

At rest a flux linkage and the e_i that hides it are not observed and, in the paper, never forgotten: an integral of a
wrong resistance runs away.  So e_i may have a memory there, e_i(k+1) = exp(-T_s / tau) e_i(k) + noise.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators.core_losses import SATURATED, advance_hysteresis, bent_reluctance, lossy
from gapsense.estimators.readings import RANGE_CURRENT, RANGE_INNOVATION, RANGE_VOLTAGE
from gapsense.kernels.elementary import exp, log, spline
from gapsense.kernels.interface import COLUMN, choice, fixed, option, parameter, ports, sample_time, table
from gapsense.kernels.layout import Array, Choice, Scalar, Table
from gapsense.kernels.linalg import vector
from gapsense.kernels.trace import clip, cond, fabs, is_traced, square, where

SMALLEST_GAP = 1e-6  # [m]; below it, and above the length of fringing, the gap reluctance goes on linearly
FLUX_LIMIT = 2.0  # largest |lambda| / lambda_sat: Euler's method is unstable beyond
POSITION, POSITION_PREV, FLUX_LINKAGE, CURRENT_ERROR, FORCE_ERROR = range(5)


class GapLaw(Choice):
    """Where the reluctance of the gap comes from: a formula with fringing, or a table."""

    fringing, table = range(2)


@ports()
class Parameters(NamedTuple):
    """The reduced model as a user knows it, Tables I and II, and the tuning."""

    sample_time: Scalar = sample_time(20e-6)  # T_s
    coil_resistance: Scalar = parameter("Ohm", "Resistance R", 48.0, min=1e-9)
    coil_turns: Scalar = fixed("1", "Number of turns N", 1200.0, min=1e-9)
    mover_mass: Scalar = parameter("kg", "Mass of the mover m", 1.6e-3, min=1e-9)
    spring_stiffness: Scalar = parameter("N/m", "Stiffness k_sp", 61.8, min=0.0)
    spring_rest: Scalar = parameter("m", "Position without spring force z_sp", 19.2e-3)
    damping: Scalar = parameter("N.s/m", "Viscous damping c_f", 0.8, min=0.0)
    stop_lower: Scalar = fixed("m", "Smallest position z_min", 0.4e-3, min=0.0)
    stop_upper: Scalar = fixed("m", "Largest position z_max", 1.4e-3, min=1e-9)
    core_reluctance: Scalar = parameter("1/H", "Reluctance of the core without flux, N^2 R_c0*", 2.52e6, min=1e-9)
    core_saturation: Scalar = parameter("Wb", "Flux linkage of saturation lambda_sat", 23.8e-3, min=1e-12)
    core_bend: Scalar = parameter(
        "1/H", "K of the core R_c0 + K x^2/(1 - x^2), x = flux linkage/saturation; 0: R_c0/(1 - x)", 0.0, min=0.0
    )
    core_eddy: Scalar = parameter("S", "Eddy currents, k_eddy / N^2; 0: none, as in the paper", 0.0, min=0.0)
    core_hysteresis: Scalar = parameter("A", "Largest current of hysteresis; 0: none, as in the paper", 0.0, min=0.0)
    core_turnover: Scalar = parameter("Wb", "Flux linkage in which hysteresis turns over", 1.7e-3, min=1e-9)  # l_h
    gap_law: Annotated[Scalar, GapLaw] = choice("Reluctance of the gap")
    gap_reluctance: Scalar = parameter("1/H", "Fringing law: reluctance of the closed gap R_g0", 0.0)
    gap_slope: Scalar = parameter("1/(H.m)", "Fringing law: reluctance per gap without fringing", 4.7e10, min=0.0)
    gap_fringing: Scalar = parameter("1/m", "Fringing law: strength k_f; 0: none", 300.0, min=0.0)
    gap_window: Scalar = fixed("m", "Fringing law: length along which the flux fringes c_f", 9.73e-3, min=1e-5)
    gap_file_gap: Annotated[Array, Table()] = table(
        "Table: CSV file with the columns gap [m], reluctance [1/H], both rising; interpolated by a cubic spline",
        ("rising:gap [m]", "rising:reluctance [1/H]", "spline:reluctance"),
        "fringing_29.csv",
    )
    gap_file_reluctance: Annotated[Array, Table()] = COLUMN
    gap_file_spline: Annotated[Array, Table()] = COLUMN
    gap_tilt: Scalar = parameter("1/(H.m)", "Slope added around the middle of the stroke", 0.0)
    option_force_error: Scalar = option("Estimate the force error e_F, as in the paper", True)  # 1: with e_F
    option_current_error: Scalar = option("Estimate the current error e_i, as in the paper", True)  # 1: with e_i
    process_flux_linkage: Scalar = parameter("Wb", "Standard deviation of its process noise in 20 us", 19e-6, min=0.0)
    process_current_error: Scalar = parameter("A", "Standard deviation of its process noise in 20 us", 2.2e-3, min=0.0)
    process_current_error_memory: Scalar = parameter(
        "s",
        "Time constant with which the current error is forgotten at rest; 0: it never is, as in the paper",
        0.66e-3,
        min=0.0,
    )
    process_force_error: Scalar = parameter("N", "Standard deviation of its process noise in 20 us", 21e-3, min=0.0)
    noise_current: Scalar = parameter("A", "Standard deviation of the current noise", 2e-3, min=1e-12)  # sigma_i
    prior_flux_linkage: Scalar = parameter("Wb", "Flux linkage at the start", 0.0)  # lambda_0
    prior_flux_linkage_std: Scalar = parameter("Wb", "Its standard deviation", 0.0, min=0.0)
    range_voltage: Scalar = RANGE_VOLTAGE
    range_current: Scalar = RANGE_CURRENT
    range_innovation: Scalar = RANGE_INNOVATION
    health_samples: Scalar = parameter("1", "Samples over which the innovations are averaged", 50.0, min=1.0)
    health_limit: Scalar = parameter("1", "Largest mean of the squared normalised innovation", 6.0, min=0.0)
    health_current_error: Scalar = parameter(
        "1", "Largest root mean square of the current error at rest, in stationary deviations", 6.0, min=0.0
    )


class Model(NamedTuple):
    """The same normalised, (13) and (17)."""

    T_s: Scalar
    R: Scalar
    m: Scalar
    k_sp: Scalar
    z_sp: Scalar
    c_f: Scalar
    R_c0: Scalar
    lam_sat: Scalar
    l_z: Scalar
    z_min: Scalar
    gap_is_table: Scalar
    gap_knots: Annotated[Array, Table()]  # [m]
    gap_reluctance: Annotated[Array, Table()]  # [1/H]
    gap_curvature: Annotated[Array, Table()]  # [1/(H m^2)]
    gap_scale: Scalar  # 1/N^2
    gap_offset: Scalar
    gap_slope: Scalar
    gap_fringing: Scalar
    gap_window: Scalar
    gap_tilt: Scalar
    has_force_error: Scalar
    memory: Scalar  # what is left of e_i after a sample at rest; 1 in the paper
    bend: Scalar = 0.0  # of `core_losses`, as the following
    eddy: Scalar = 0.0
    amplitude: Scalar = 0.0
    length: Scalar = 1.0


class Held(NamedTuple):
    """Input u_k (21), held until the next sample."""

    voltage: Scalar
    mode: Scalar
    hysteresis: Scalar = 0.0  # h of `core_losses` [A]


UNDRIVEN = Held(0.0, 3.0)


def normalise_model(par: Parameters) -> Model:
    """Normalised model for physical parameters: (17)."""
    l_z = par.stop_upper - par.stop_lower
    area, scale = square(l_z), l_z / square(par.coil_turns)
    return Model(
        T_s=par.sample_time,
        R=par.coil_resistance,
        m=par.mover_mass * area,
        k_sp=par.spring_stiffness * area,
        z_sp=(par.spring_rest - par.stop_lower) / l_z,
        c_f=par.damping * area,
        R_c0=par.core_reluctance / square(par.coil_turns),
        lam_sat=par.core_saturation,
        l_z=l_z,
        z_min=par.stop_lower,
        gap_is_table=par.gap_law == GapLaw.table,
        gap_knots=_constant(par.gap_file_gap),
        gap_reluctance=_constant(par.gap_file_reluctance),
        gap_curvature=_constant(par.gap_file_spline),
        gap_scale=1.0 / square(par.coil_turns),
        gap_offset=par.gap_reluctance / square(par.coil_turns),
        gap_slope=par.gap_slope * scale,
        gap_fringing=par.gap_fringing,
        gap_window=par.gap_window,
        gap_tilt=par.gap_tilt * scale,
        has_force_error=par.option_force_error,
        memory=_memory(par.sample_time, par.process_current_error_memory),
        bend=par.core_bend / square(par.coil_turns),
        eddy=par.core_eddy,
        amplitude=par.core_hysteresis,
        length=par.core_turnover,
    )


def _memory(T_s: Scalar, tau: Scalar) -> Scalar:
    """exp(-T_s / tau), and 1 for tau = 0, which means an infinite memory."""
    return where(tau > 0.0, exp(-T_s / where(tau > 0.0, tau, 1.0)), 1.0)


def _constant(table: Array) -> Array:
    """A table that can be compared and hashed, like the rest of the model."""
    return table if is_traced(table) else tuple(table)


def gap_law(z: Scalar, m: Model) -> tuple[Scalar, Scalar]:
    """R_g* = R_g(z_min + l_z z*) / N^2 by formula or from a table, and its derivative by z*."""
    g = m.z_min + m.l_z * z
    R, slope = cond(m.gap_is_table, lambda: _from_table(g, m), lambda: _from_formula(g, m))
    return R + (z - 0.5) * m.gap_tilt, slope + m.gap_tilt


def _from_table(g: Scalar, m: Model) -> tuple[Scalar, Scalar]:
    """The spline of a table, beyond its ends with the second derivative there."""
    R, slope, _ = spline(g, m.gap_knots, m.gap_reluctance, m.gap_curvature)
    return m.gap_scale * R, m.gap_scale * m.l_z * slope


def _from_formula(g: Scalar, m: Model) -> tuple[Scalar, Scalar]:
    """R_g = R_g0 + R_g0' g / (1 + k g ln(c/g))."""

    def beyond() -> tuple[Scalar, Scalar]:
        end = where(g < m.gap_window, SMALLEST_GAP, m.gap_window)
        R, slope = _fringing(end, m)
        return R + slope * ((g - end) / m.l_z), slope

    R, slope = cond((g > SMALLEST_GAP) & (g < m.gap_window), lambda: _fringing(g, m), beyond)
    return m.gap_offset + R, slope


def _fringing(g: Scalar, m: Model) -> tuple[Scalar, Scalar]:
    widening = 1.0 + m.gap_fringing * g * log(m.gap_window / g)
    return m.gap_slope / m.l_z * g / widening, m.gap_slope * (1.0 + m.gap_fringing * g) / square(widening)


def core_law(lam: Scalar, m: Model) -> Scalar:
    """R_c*(lambda) of Froehlich and Kennelly (15), continued linearly above `SATURATED`; or with a sharper bend."""
    x = fabs(lam) / m.lam_sat

    def beyond() -> Scalar:
        return m.R_c0 / (1.0 - SATURATED) + m.R_c0 / square(1.0 - SATURATED) * (x - SATURATED)

    def froehlich() -> Scalar:
        return cond(x < SATURATED, lambda: m.R_c0 / (1.0 - x), beyond)

    return cond(m.bend > 0.0, lambda: bent_reluctance(x, m.R_c0, m.bend)[0], froehlich)


def current(R_g: Scalar, lam: Scalar, e_i: Scalar, m: Model, u: Held = UNDRIVEN) -> Scalar:
    """f_i* (14) [A], for the reluctance of the gap; with the losses of the core, if it has any."""
    return lossy((R_g + core_law(lam, m)) * lam, lam, u, m) + e_i


def acceleration(z: Scalar, v: Scalar, force: Scalar, m: Model) -> Scalar:
    """f_v* (16) [1/s^2], for the sum of the magnetic force and e_F."""
    return (m.k_sp * (m.z_sp - z) - m.c_f * v + force) / m.m


def magnetic_force(slope: Scalar, lam: Scalar) -> Scalar:
    """Its part of (16), for the slope of the gap reluctance."""
    return -0.5 * slope * square(lam)


def is_moving(mode: Scalar) -> Scalar:
    """Mode 2."""
    return (mode > 1.5) & (mode < 2.5)


def limit(mode: Scalar) -> Scalar:
    """Normalised position on a stop: 0 on the lower, 1 on the upper."""
    return where(mode > 1.5, 1.0, 0.0)


def transition(x: Array, u: Held, m: Model) -> Array:
    """f(x, u) (20): position (22), (66), its past value (24), flux linkage (25), with minus R i, errors (26)."""
    return cond(is_moving(u.mode), lambda: move(x, u, m), lambda: stay(x, u, m))


def move(x: Array, u: Held, m: Model) -> Array:
    """f(x, u) between the stops."""
    z, z_prev, lam, e_i, e_F = x
    R_g, slope = gap_law(z, m)
    force = magnetic_force(slope, lam) + e_F
    z_next = 2.0 * z - z_prev + square(m.T_s) * acceleration(z, (z - z_prev) / m.T_s, force, m)
    return _next(x, z_next, R_g, u, e_i, m)


def stay(x: Array, u: Held, m: Model) -> Array:
    """f(x, u) on a stop, where e_i is forgotten with its memory."""
    z, _, lam, e_i, e_F = x
    R_g, slope = gap_law(z, m)
    z_stop = limit(u.mode)
    force = magnetic_force(slope if z is z_stop else gap_law(z_stop, m)[1], lam) + e_F
    rise = where(m.has_force_error > 0.0, square(m.T_s) * acceleration(z_stop, 0.0, force, m), 0.0)
    return _next(x, z_stop + rise, R_g, u, m.memory * e_i, m)


def _next(x: Array, z_next: Scalar, R_g: Scalar, u: Held, e_i_next: Scalar, m: Model) -> Array:
    z, _, lam, e_i, e_F = x
    lam_next = lam + m.T_s * (u.voltage - m.R * current(R_g, lam, e_i, m, u))
    most = FLUX_LIMIT * m.lam_sat
    lam_next = cond(fabs(lam_next) < most, lambda: lam_next, lambda: clip(lam_next, -most, most))
    return vector([z_next, z, lam_next, e_i_next, e_F])


def observation(x: Array, m: Model, u: Held = UNDRIVEN) -> Array:
    """The current of h(x) (28); the position of a stop is a row of its own."""
    return vector([current(gap_law(x[POSITION], m)[0], x[FLUX_LINKAGE], x[CURRENT_ERROR], m, u)])


def after(u: Held, lam: Scalar, lam_next: Scalar, m: Model) -> Held:
    """The same voltage and mode, with the hysteresis of the core at the end of the interval."""
    return u._replace(hysteresis=advance_hysteresis(u.hysteresis, lam, lam_next - lam, m))


def rest(mode: Scalar, lam: Scalar, m: Model) -> Array:
    """State at rest on a stop (61): e_F holds the mover there."""
    z = limit(mode)
    force = magnetic_force(gap_law(z, m)[1], lam)
    e_F = where(m.has_force_error > 0.0, -m.m * acceleration(z, 0.0, force, m), 0.0)
    return vector([z, z, lam, 0.0, e_F])
