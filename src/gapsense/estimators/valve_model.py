"""Model of a solenoid valve without a contact sensor, as [UKF] Section IV-A discretises it.

State x = (lambda_k, z_k, z_(k-1), epsilon_k) (33): the flux linkage in place of the flux, and the past position in
place of the velocity (Verlet).  The reluctance of the gap and its derivative come from a table, linearly interpolated.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators import reduced_model
from gapsense.estimators.core_losses import SATURATED, advance_hysteresis, bent_reluctance, lossy, share
from gapsense.estimators.readings import RANGE_CURRENT, RANGE_VOLTAGE
from gapsense.kernels.interface import COLUMN, choice, fixed, option, parameter, ports, same, sample_time, table
from gapsense.kernels.layout import Array, Choice, Scalar, Table
from gapsense.kernels.linalg import vector
from gapsense.kernels.trace import clip, cond, fabs, load, locate, square, where

FLUX_LINKAGE, POSITION, POSITION_PREV, CURRENT_ERROR = range(4)


class Filter(Choice):
    """Kind of filter."""

    bounded_ukf, unbounded_ukf, bounded_ekf, open_loop = range(4)


class Noise(Choice):
    """How process noise reaches the sigma points: they are drawn again, or have dimensions for it."""

    additive, augmented = range(2)


class Interval(Choice):
    """Which sample of the voltage stands for an interval."""

    at_start, mean, at_end = range(3)


class Tuned(Choice):
    """Process noise: one of the two built-in tunings, or the parameters process_*."""

    robust, paper, own = range(3)


EKF = same(reduced_model.Parameters)


@ports()
class Parameters(NamedTuple):
    """The valve as a user knows it (16), and the tuning."""

    sample_time: Scalar = sample_time(20e-6)  # Delta t
    coil_resistance: Scalar = parameter("Ohm", "Resistance R", 77.5, min=1e-9)
    coil_turns: Scalar = fixed("1", "Number of turns N", 1200.0, min=1e-9)
    gap_file_gap: Annotated[Array, Table()] = table(
        "Gap reluctance: CSV file with the columns gap [m], reluctance [1/H], slope [1/(H.m)]",
        ("gap [m]", "reluctance [1/H]", "slope [1/(H.m)]"),
        "fringing_19.csv",
    )
    gap_file_reluctance: Annotated[Array, Table()] = COLUMN
    gap_file_slope: Annotated[Array, Table()] = COLUMN
    core_reluctance: Scalar = parameter("1/H", "Reluctance of the core without flux k_1", 3.25e6, min=1e-9)
    core_saturation: Scalar = parameter("Wb", "Flux linkage of saturation, N / k_2", 0.024, min=1e-12)
    core_bend: Scalar = EKF
    core_eddy: Scalar = EKF
    core_hysteresis: Scalar = EKF
    core_turnover: Scalar = EKF
    mover_mass: Scalar = parameter("kg", "Mass of the mover m", 1.6e-3, min=1e-9)
    spring_stiffness: Scalar = parameter("N/m", "Stiffness k_sp", 37.0, min=0.0)
    spring_rest: Scalar = parameter("m", "Gap without spring force z_sp", 22.5e-3)
    damping: Scalar = parameter("N.s/m", "Viscous damping c_f", 0.4, min=0.0)
    stop_lower: Scalar = fixed("m", "Smallest gap", 0.0, min=0.0)
    stop_upper: Scalar = fixed("m", "Largest gap z_max", 0.9e-3, min=1e-9)
    option_filter: Annotated[Scalar, Filter] = choice("Filter")
    option_noise: Annotated[Scalar, Noise] = choice("Process noise in the sigma points")
    option_voltage: Annotated[Scalar, Interval] = choice("Sample that stands for an interval")
    option_tuning: Annotated[Scalar, Tuned] = choice("Process noise; `own` takes the parameters process.*")
    option_current_error: Scalar = option("Estimate the current error, as in the paper", True)
    sigma_spread: Scalar = fixed("1", "Spread of the sigma points, n + kappa", 8.0, min=1e-6)
    process_flux_linkage: Scalar = parameter("Wb", "Tuning `own`: standard deviation per sample", 16e-6, min=0.0)
    process_position: Scalar = parameter("m", "Tuning `own`: standard deviation per sample", 60e-9, min=0.0)
    process_current_error: Scalar = parameter("A", "Tuning `own`: standard deviation per sample", 1e-6, min=0.0)
    process_memory: Scalar = parameter("1", "Tuning `own`: what is left of it after a sample", 0.99, min=0.0, max=1.0)
    process_limit: Scalar = parameter("1", "Tuning `own`: largest innovation that counts, in deviations", 1.2, min=1e-9)
    noise_voltage: Scalar = parameter("V", "Standard deviation of the voltage noise", 0.15, min=0.0)  # sigma_v
    noise_current: Scalar = parameter("A", "Standard deviation of the current noise", 2e-3, min=1e-12)  # sigma_i
    range_voltage: Scalar = RANGE_VOLTAGE
    range_current: Scalar = RANGE_CURRENT
    prior_position: Scalar = fixed("m", "Position at the start, at rest", 0.9e-3)
    prior_position_std: Scalar = fixed("m", "Its standard deviation", 0.0, min=0.0)
    prior_flux_linkage: Scalar = fixed("Wb", "Flux linkage at the start", 0.0)
    prior_flux_linkage_std: Scalar = fixed("Wb", "Its standard deviation", 0.0, min=0.0)
    prior_current_error_std: Scalar = fixed("A", "Standard deviation of the current error at the start", 0.0, min=0.0)
    health_samples: Scalar = parameter("1", "Samples over which the innovations are averaged", 50.0, min=1.0)
    health_limit: Scalar = parameter("1", "Largest mean of the squared normalised innovation", 80.0, min=0.0)


class Model(NamedTuple):
    """The coefficients of one step, made from physical parameters."""

    inverse_square: Scalar  # 1 / N^2
    core: Scalar  # k_1 [1/H]
    lam_sat: Scalar  # N / k_2 [Wb]
    T_s: Scalar
    R: Scalar
    keep: Scalar  # of (28) and (30): factor of z_(k-1)
    lose: Scalar  # factor of z_(k-2)
    spring: Scalar  # constant part
    mobility: Scalar  # T_s^2 / 2 m
    memory: Scalar  # phi of (31)
    low: Scalar  # where positions are clipped
    high: Scalar
    bend: Scalar  # of `core_losses`, as the following
    eddy: Scalar
    amplitude: Scalar
    length: Scalar


class Held(NamedTuple):
    """Inputs between two samples."""

    voltage: Scalar  # mean of the interval [V]
    push: Scalar  # w_z, inside the bound [m]
    hysteresis: Scalar  # h of `core_losses` [A]


class Segment(NamedTuple):
    """The piece of the table in which a gap lies: its start and width, and both columns and how much they rise."""

    gap: Scalar
    width: Scalar
    R_g: Scalar
    R_g_rise: Scalar
    slope: Scalar
    slope_rise: Scalar


def model(par: Parameters, resistance: Scalar, memory: Scalar, low: Scalar, high: Scalar) -> Model:
    """Coefficients for physical parameters."""
    mobility = square(par.sample_time) / par.mover_mass
    drag, stiffness = par.damping * par.sample_time / par.mover_mass, mobility * par.spring_stiffness
    return Model(
        inverse_square=1.0 / square(par.coil_turns),
        core=par.core_reluctance,
        lam_sat=par.core_saturation,
        T_s=par.sample_time,
        R=resistance,
        keep=2.0 - drag - stiffness,
        lose=1.0 - drag,
        spring=stiffness * par.spring_rest,
        mobility=0.5 * mobility,
        memory=where(par.option_current_error > 0.5, memory, 0.0),
        low=low,
        high=high,
        bend=par.core_bend,
        eddy=par.core_eddy,
        amplitude=par.core_hysteresis,
        length=par.core_turnover,
    )


def segment(z: Scalar, par: Parameters) -> Segment:
    """Piece of the gap table around `z`; the first and last ones are extended."""
    k = locate(par.gap_file_gap, z)
    left, R_g, slope = (load(t, k) for t in (par.gap_file_gap, par.gap_file_reluctance, par.gap_file_slope))
    return Segment(
        gap=left,
        width=load(par.gap_file_gap, k, 1) - left,
        R_g=R_g,
        R_g_rise=load(par.gap_file_reluctance, k, 1) - R_g,
        slope=slope,
        slope_rise=load(par.gap_file_slope, k, 1) - slope,
    )


def reluctance(z: Scalar, lam: Scalar, s: Segment, m: Model) -> tuple[Scalar, Scalar]:
    """Reluctance of gap and core (4), (8), and the derivative of its product with lambda by lambda [1/H]."""
    R_g = s.R_g + (z - s.gap) / s.width * s.R_g_rise
    x = fabs(lam) / m.lam_sat
    R_c, rate = cond(m.bend > 0.0, lambda: bent_reluctance(x, m.core, m.bend), lambda: _froehlich(x, m.core))
    R = R_g + R_c
    return R, R + x * rate


def _froehlich(x: Scalar, core: Scalar) -> tuple[Scalar, Scalar]:
    """Reluctance of the core (8), from `SATURATED` on linear, and its derivative by x."""
    y = where(x < SATURATED, x, SATURATED)
    R_c = core / (1.0 - y)
    rate = R_c / (1.0 - y)
    return R_c + (x - y) * rate, rate


def bound_positions(x: Array, m: Model) -> Array:
    """Bound both positions by the stops (29)."""
    z, z_prev = (clip(x[k], m.low, m.high) for k in (POSITION, POSITION_PREV))
    return vector([x[FLUX_LINKAGE], z, z_prev, x[CURRENT_ERROR]])


def transition(x: Array, u: Held, s: Segment, m: Model) -> Array:
    """f_d(x, y_v) (32): flux linkage (26), with minus R i, positions (28)-(30), current error (31).

    Flux linkage by the trapezoidal rule, linearised: R i is that of the middle of the step.  Euler's method would lag
    half a sample behind.
    """
    lam, z, z_prev, e_i = x
    R, rate = reluctance(z, lam, s, m)
    turned = lam * m.inverse_square  # phi / N
    pull = (s.slope + (z - s.gap) / s.width * s.slope_rise) * turned  # derivative of the current by the position
    drop = m.T_s * m.R
    half_drop = 0.5 * drop * share(m)  # what is left to the current of a change of the magnetomotive force
    change = m.T_s * u.voltage - drop * (lossy(R * turned, lam, u, m) - e_i) - half_drop * pull * (z - z_prev)
    z_next = m.keep * z - m.lose * z_prev + (m.spring - m.mobility * pull * lam) + u.push
    lam_next = lam + change / (1.0 + half_drop * m.inverse_square * rate)
    return vector([lam_next, clip(z_next, m.low, m.high), z, m.memory * e_i])


def observation(x: Array, u: Held, s: Segment, m: Model) -> Array:
    """h(x) (35): the current [A]; epsilon is the model's current minus the measured one (27)."""
    return vector([model_current(x[POSITION], x[FLUX_LINKAGE], u, s, m) - x[CURRENT_ERROR]])


def model_current(z: Scalar, lam: Scalar, u: Held, s: Segment, m: Model) -> Scalar:
    """Current by (17) [A], with the losses of the core, if it has any."""
    return lossy(reluctance(z, lam, s, m)[0] * (lam * m.inverse_square), lam, u, m)


def after(u: Held, lam: Scalar, lam_next: Scalar, m: Model) -> Held:
    """The same voltage, with the core's hysteresis at the end of the interval."""
    return u._replace(hysteresis=advance_hysteresis(u.hysteresis, lam, lam_next - lam, m))
