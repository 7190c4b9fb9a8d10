"""Core with hysteresis, saturation or neither: the model of Jiles and Atherton, as a function of the effective field.

With the effective field H_e = H + alpha M and B = flux / A_c = mu0 (H + M), the magnetization is
M = (B/mu0 - H_e) / (1 - alpha): flux and H_e are the whole memory.  M = (1 - c) M_irr + c M_an gives
(1 - c) (M_an - M_irr) = M_an - M, the `excess`, so that M_irr need not be known:

    chi = dM/dH_e = max(0, delta (M_an - M)) / kappa + c dM_an/dH_e
    dH_e/dB = 1 / (mu0 (1 + (1 - alpha) chi)), the dH/dB = 1/mu_delta of [RTS] (10) plus alpha dM/dB

The maximum is a switch: the domain walls either move in the direction delta of the flux, or are frozen.  Whoever
integrates holds `walls` (delta or 0) through a step, and ends it where they switch.

Energy per volume: H dB = d(stored) + mu0 (M_an - M) dH_e.  The last term is the work on the walls.  While they are
frozen it is given back, so a part of it is stored: mu0 (1 - c) times the integral of M_an - M_irr from H* where
M_an(H*) = M_irr to H_e.  The rest, mu0 (1 - c) (H_e - H*) dM_irr, is lost: never negative, and on a closed cycle the
area of the loop.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from gapsense.actuators.magnetics import MU_0
from gapsense.kernels.elementary import exp, log, tanh
from gapsense.kernels.layout import Scalar
from gapsense.kernels.trace import clip, cond, fabs, square, where

SMALL = 0.1  # argument below which the Langevin function is taken from its series
UNSATURABLE = 1e9  # factor of M_sat and a by which the core becomes linear at the same initial slope
FULL = 1.0 - 1e-6  # |M_irr| / M_sat at most, where the inverse Langevin function is needed
NEWTON_STEPS = 2  # from 5 %; the energy takes the square of the error


class Core(NamedTuple):
    """Constants of the core, made once per step by `make_core`."""

    length: Scalar  # l_c [m]
    volume: Scalar  # mu0 A_c l_c [H m^2]: energy by product of two fields
    per_flux: Scalar  # 1/(mu0 A_c) [A/(m Wb)]
    saturation: Scalar  # M_sat [A/m]
    shape: Scalar  # a [A/m]
    slope: Scalar  # M_sat / a [1]
    coupling: Scalar  # alpha [1]
    uncoupled: Scalar  # 1 - alpha [1]
    pinning: Scalar  # kappa [A/m]
    reversible: Scalar  # c [1]; 1 without hysteresis
    reversible_slope: Scalar  # c M_sat / a [1]
    steepest: Scalar  # largest susceptibility of moving walls, (1 - c) M_sat / (3 a) [1]
    is_hysteretic: Scalar


def make_core(par: Any, is_saturable: Scalar = True) -> Core:
    """Core of a plant whose parameters have these names, [RTS] Table I; alpha M_sat / (3 a) must be below 1."""
    is_hysteretic, stretch = par.hysteresis > 0.5, where(is_saturable, 1.0, UNSATURABLE)
    slope, c = par.core_magnetization / par.core_shape, where(is_hysteretic, par.core_reversibility, 1.0)
    return Core(
        length=par.core_length,
        volume=MU_0 * par.core_area * par.core_length,
        per_flux=1.0 / (MU_0 * par.core_area),
        saturation=par.core_magnetization * stretch,
        shape=par.core_shape * stretch,
        slope=slope,
        coupling=par.core_coupling,
        uncoupled=1.0 - par.core_coupling,
        pinning=par.core_pinning,
        reversible=c,
        reversible_slope=c * slope,
        steepest=(1.0 - c) * slope / 3.0,
        is_hysteretic=is_hysteretic,
    )


def langevin(x: Scalar) -> tuple[Scalar, Scalar]:
    """L(x) = coth x - 1/x and its derivative."""

    def series() -> tuple[Scalar, Scalar]:
        q = x * x
        value = x * (1 / 3 - q * (1 / 45 - q * (2 / 945 - q * (1 / 4725 - q * (2 / 93555)))))
        return value, 1 / 3 - q * (1 / 15 - q * (2 / 189 - q * (1 / 675 - q * (2 / 10395))))

    def closed() -> tuple[Scalar, Scalar]:
        inverse, coth = 1.0 / x, 1.0 / tanh(x)
        return coth - inverse, inverse * inverse - coth * coth + 1.0

    return cond(fabs(x) < SMALL, series, closed)


def langevin_integral(x: Scalar) -> Scalar:
    """ln(sinh(x) / x), the integral of the Langevin function from 0."""

    def series() -> Scalar:
        q = x * x
        return q * (1 / 6 - q * (1 / 180 - q * (1 / 2835 - q * (1 / 37800 - q * (1 / 467775)))))

    def closed() -> Scalar:
        y = fabs(x)
        return y + log((1.0 - exp(-2.0 * y)) / (2.0 * y))

    return cond(fabs(x) < SMALL, series, closed)


def inverse_langevin(m: Scalar) -> Scalar:
    """Root x of L(x) = m to about 1e-5, by Newton's method from Cohen's approximation."""
    x = m * (3.0 - m * m) / (1.0 - m * m)
    for _ in range(NEWTON_STEPS):
        value, slope = langevin(x)
        x = x - (value - m) / slope
    return x


def anhysteretic(H_e: Scalar, core: Core) -> tuple[Scalar, Scalar]:
    """M_an = M_sat L(H_e / a) [A/m], and L'(H_e / a)."""
    value, steepness = langevin(H_e / core.shape)
    return core.saturation * value, steepness


def magnetization(flux: Scalar, H_e: Scalar, core: Core) -> Scalar:
    """M [A/m]."""
    return (core.per_flux * flux - H_e) / core.uncoupled


def moving_walls(direction: Scalar, excess: Scalar) -> Scalar:
    """`direction` of the flux if the walls move with it, 0 if they are frozen."""
    return where(direction * excess < 0.0, 0.0, direction)


def susceptibility(excess: Scalar, steepness: Scalar, walls: Scalar, core: Core) -> Scalar:
    """dM/dH_e [1]; `steepness` is that of `anhysteretic`.  The upper limit is never reached but by absurd steps."""
    return core.reversible_slope * steepness + clip(walls * excess / core.pinning, 0.0, core.steepest)


def field_rate(flux_rate: Scalar, chi: Scalar, core: Core) -> Scalar:
    """dH_e/dt [A/(m s)]."""
    return core.per_flux * flux_rate / (1.0 + core.uncoupled * chi)


def differential_reluctance(chi: Scalar, core: Core) -> Scalar:
    """l_c / (A_c mu_delta) [1/H], (10)."""
    return core.length * core.per_flux * (1.0 - core.coupling * chi) / (1.0 + core.uncoupled * chi)


def settle_field(flux: Scalar, H_e: Scalar, core: Core) -> Scalar:
    """Put H_e onto the anhysteretic curve if there is no hysteresis: integration errors do not add up."""

    def correct() -> Scalar:
        M_an, steepness = anhysteretic(H_e, core)
        residue = core.per_flux * flux - H_e - core.uncoupled * M_an
        return H_e + residue / (1.0 + core.uncoupled * core.slope * steepness)

    return cond(core.is_hysteretic, lambda: H_e, correct)


def energies(flux: Scalar, H_e: Scalar, core: Core) -> tuple[Scalar, Scalar]:
    """Energy stored in the core, that of the walls included, and the latter by itself [J]."""
    M = magnetization(flux, H_e, core)
    area = core.saturation * core.shape
    elastic = area * langevin_integral(H_e / core.shape)  # integral of M_an

    def wall() -> Scalar:
        M_an, _ = anhysteretic(H_e, core)
        fixed = M - core.reversible * M_an  # (1 - c) M_irr
        x = inverse_langevin(clip(fixed / ((1.0 - core.reversible) * core.saturation), -FULL, FULL))
        free = (1.0 - core.reversible) * (elastic - area * langevin_integral(x))
        return free - fixed * (H_e - core.shape * x)

    walls = cond(core.is_hysteretic, wall, lambda: 0.0)
    stored = 0.5 * square(H_e) + core.uncoupled * M * (H_e - 0.5 * core.coupling * M) - elastic
    return core.volume * (stored + walls), core.volume * walls
