# Made by `python -m gapsense.cli._stubs` from the port tables; do not edit.
from collections.abc import Iterable
from typing import NamedTuple

import numpy.typing as npt

from gapsense.runnable import Floats, Response, Runnable


class BoundedUkfOutputs(NamedTuple):
    position: float
    velocity: float
    flux_linkage: float
    current_error: float
    position_std: float
    velocity_std: float
    flux_linkage_std: float
    current_error_std: float
    innovation: float
    innovation_std: float
    health: float
    health_causes: float

class BoundedUkfResponse(Response):
    position: Floats
    velocity: Floats
    flux_linkage: Floats
    current_error: Floats
    position_std: Floats
    velocity_std: Floats
    flux_linkage_std: Floats
    current_error_std: Floats
    innovation: Floats
    innovation_std: Floats
    health: Floats
    health_causes: Floats

class BoundedUkf(Runnable):
    """
    Bounded unscented Kalman filter: position from voltage and current, without a contact sensor.

    Parameters
    ----------
    sample_time : float [s], at least 1e-09, by default 2e-05
        Sampling period; the communication step is a whole multiple or a whole fraction of it.
    coil_resistance : float [Ohm], at least 1e-09, by default 77.5
        Resistance R.
    coil_turns : float, at least 1e-09, by default 1200.0
        Number of turns N.
    gap_file : str, by default 'fringing_19.csv'
        Gap reluctance: CSV file with the columns gap [m], reluctance [1/H], slope [1/(H.m)].
    core_reluctance : float [1/H], at least 1e-09, by default 3250000.0
        Reluctance of the core without flux k_1.
    core_saturation : float [Wb], at least 1e-12, by default 0.024
        Flux linkage of saturation, N / k_2.
    core_bend : float [1/H], at least 0, by default 0.0
        K of the core R_c0 + K x^2/(1 - x^2), x = flux linkage/saturation; 0: R_c0/(1 - x).
    core_eddy : float [S], at least 0, by default 0.0
        Eddy currents, k_eddy / N^2; 0: none, as in the paper.
    core_hysteresis : float [A], at least 0, by default 0.0
        Largest current of hysteresis; 0: none, as in the paper.
    core_turnover : float [Wb], at least 1e-09, by default 0.0017
        Flux linkage in which hysteresis turns over.
    mover_mass : float [kg], at least 1e-09, by default 0.0016
        Mass of the mover m.
    spring_stiffness : float [N/m], at least 0, by default 37.0
        Stiffness k_sp.
    spring_rest : float [m], by default 0.0225
        Gap without spring force z_sp.
    damping : float [N.s/m], at least 0, by default 0.4
        Viscous damping c_f.
    stop_lower : float [m], at least 0, by default 0.0
        Smallest gap.
    stop_upper : float [m], at least 1e-09, by default 0.0009
        Largest gap z_max.
    option_filter : str, one of bounded_ukf, unbounded_ukf, bounded_ekf, open_loop, by default 'bounded_ukf'
        Filter: bounded_ukf, unbounded_ukf, bounded_ekf, open_loop.
    option_noise : str, one of additive, augmented, by default 'additive'
        Process noise in the sigma points: additive, augmented.
    option_voltage : str, one of at_start, mean, at_end, by default 'at_start'
        Sample that stands for an interval: at_start, mean, at_end.
    option_tuning : str, one of robust, paper, own, by default 'robust'
        Process noise; `own` takes the parameters process.*: robust, paper, own.
    option_current_error : bool, by default True
        Estimate the current error, as in the paper.
    sigma_spread : float, at least 1e-06, by default 8.0
        Spread of the sigma points, n + kappa.
    process_flux_linkage : float [Wb], at least 0, by default 1.6e-05
        Tuning `own`: standard deviation per sample.
    process_position : float [m], at least 0, by default 6e-08
        Tuning `own`: standard deviation per sample.
    process_current_error : float [A], at least 0, by default 1e-06
        Tuning `own`: standard deviation per sample.
    process_memory : float, 0 to 1, by default 0.99
        Tuning `own`: what is left of it after a sample.
    process_limit : float, at least 1e-09, by default 1.2
        Tuning `own`: largest innovation that counts, in deviations.
    noise_voltage : float [V], at least 0, by default 0.15
        Standard deviation of the voltage noise.
    noise_current : float [A], at least 1e-12, by default 0.002
        Standard deviation of the current noise.
    range_voltage : float [V], at least 1e-09, by default 100.0
        A reading beyond plus or minus this counts as lost.
    range_current : float [A], at least 0, by default 0.0
        A reading beyond plus or minus this counts as lost; 0: twice what range.voltage drives.
    prior_position : float [m], by default 0.0009
        Position at the start, at rest.
    prior_position_std : float [m], at least 0, by default 0.0
        Its standard deviation.
    prior_flux_linkage : float [Wb], by default 0.0
        Flux linkage at the start.
    prior_flux_linkage_std : float [Wb], at least 0, by default 0.0
        Its standard deviation.
    prior_current_error_std : float [A], at least 0, by default 0.0
        Standard deviation of the current error at the start.
    health_samples : float, at least 1, by default 50.0
        Samples over which the innovations are averaged.
    health_limit : float, at least 0, by default 80.0
        Largest mean of the squared normalised innovation.

    Inputs of run and step
    ----------------------
    voltage : float [V]
        Measured coil voltage; NaN where it was lost.
    current : float [A]
        Measured coil current; NaN where it was lost.
    resistance : float [Ohm], optional
        Resistance that is known from elsewhere; `coil.resistance` counts where this is not positive and finite.

    Outputs
    -------
    position : float [m]
        Estimated position.
    velocity : float [m/s]
        Estimated mean velocity since the last sample.
    flux_linkage : float [Wb]
        Estimated flux linkage.
    current_error : float [A]
        Estimated: model's current minus the true one.
    position_std : float [m], at least 0
        Standard deviation in the filter.
    velocity_std : float [m/s], at least 0
        Standard deviation in the filter.
    flux_linkage_std : float [Wb], at least 0
        Standard deviation in the filter.
    current_error_std : float [A], at least 0
        Standard deviation in the filter.
    innovation : float [A]
        Measured minus predicted current.
    innovation_std : float [A], at least 0
        Standard deviation expected of it.
    health : float, 0 to 1
        1: to be trusted as far as the filter can tell; 0: not.
    health_causes : float, 0 to 4095
        Why not, a sum of 1: innovations larger than expected, 2: current error larger than expected, 4: flux linkage beyond saturation, 8: position held at a bound for long, 16: a reading lost or wild, 32: covariance lost, restarted, 64: no motion after a command, 128: device far from the one told, 256: noise or switching larger than told, 512: first impact perhaps missed by the contact, 1024: device not learnt yet, operate it twice, 2048: what was learnt keeps changing.
    """

    def __init__(
        self,
        *,
        sample_time: float = ...,
        coil_resistance: float = ...,
        coil_turns: float = ...,
        gap_file: str = ...,
        core_reluctance: float = ...,
        core_saturation: float = ...,
        core_bend: float = ...,
        core_eddy: float = ...,
        core_hysteresis: float = ...,
        core_turnover: float = ...,
        mover_mass: float = ...,
        spring_stiffness: float = ...,
        spring_rest: float = ...,
        damping: float = ...,
        stop_lower: float = ...,
        stop_upper: float = ...,
        option_filter: str = ...,
        option_noise: str = ...,
        option_voltage: str = ...,
        option_tuning: str = ...,
        option_current_error: bool = ...,
        sigma_spread: float = ...,
        process_flux_linkage: float = ...,
        process_position: float = ...,
        process_current_error: float = ...,
        process_memory: float = ...,
        process_limit: float = ...,
        noise_voltage: float = ...,
        noise_current: float = ...,
        range_voltage: float = ...,
        range_current: float = ...,
        prior_position: float = ...,
        prior_position_std: float = ...,
        prior_flux_linkage: float = ...,
        prior_flux_linkage_std: float = ...,
        prior_current_error_std: float = ...,
        health_samples: float = ...,
        health_limit: float = ...,
    ) -> None: ...
    def run(  # type: ignore[override]
        self,
        voltage: npt.ArrayLike,
        current: npt.ArrayLike,
        resistance: npt.ArrayLike = ...,
        *,
        sample_time: float | None = ...,
        start_time: float = ...,
        outputs: Iterable[str] = ...,
    ) -> BoundedUkfResponse: ...
    def step(  # type: ignore[override]
        self,
        voltage: float,
        current: float,
        resistance: float = ...,
        *,
        sample_time: float | None = ...,
    ) -> BoundedUkfOutputs: ...


class DriveVoltageOutputs(NamedTuple):
    voltage: float
    voltage_mean: float

class DriveVoltageResponse(Response):
    voltage: Floats
    voltage_mean: Floats

class DriveVoltage(Runnable):
    """
    Drive voltage: square wave, step, table from a CSV file, PWM, pulse profile, soft landing, bridge.

    Parameters
    ----------
    waveform : str, one of square, step, table, pwm, profile, soft_landing, bridge, by default 'square'
        What is generated: square, step, table, pwm, profile, soft_landing, bridge.
    square_amplitude : float [V], by default 30.0
        Height above square.low.
    square_low : float [V], by default 0.0
        Low level, also before the delay.
    square_period : float [s], at least 1e-09, by default 0.02
        Period.
    square_duty : float, 0 to 1, by default 0.5
        Share of the period that is high and comes first.
    square_delay : float [s], by default 0.0
        Time of the first rising edge.
    step_initial : float [V], by default 0.0
        Voltage before the step.
    step_final : float [V], by default 30.0
        Voltage after the step.
    step_time : float [s], by default 0.0
        Time of the step.
    table_file : str, by default 'voltage.csv'
        Table: CSV file with the columns time [s], voltage [V]; a repeated time is a jump, the ends are held.
    table_period : float [s], at least 0, by default 0.0
        Period with which the table repeats; 0: it does not.
    table_repeat_from : float [s], by default 0.0
        Start of the part that repeats; what is before comes once.
    pwm_high : float [V], by default 30.0
        High level.
    pwm_low : float [V], by default 0.0
        Low level.
    pwm_frequency : float [Hz], at least 0.001, by default 20000.0
        Carrier frequency; the carrier starts at time 0.
    profile_amplitude : float [V], by default 30.0
        Height above profile.low.
    profile_low : float [V], by default 0.0
        Low level, also before the delay.
    profile_first : float [s], at least 0, by default 0.0045
        dt1: high first, in the second half low.
    profile_second : float [s], at least 0, by default 0.0015
        dt2: then low, in the second half high.
    profile_half_period : float [s], at least 1e-09, by default 0.02
        Half of the period: making, then breaking.
    profile_delay : float [s], by default 0.0
        Time of the first rising edge.
    soft_landing_file : str, by default 'soft_landing.csv'
        Voltage of soft-landing cycles, a table like table.file; `gapsense soft-landing` makes others.
    soft_landing_period : float [s], at least 0, by default 0.02
        Period of the cycles.
    soft_landing_repeat_from : float [s], by default 0.02
        Start of the cycle that repeats, as table.repeat_from.
    bridge_kind : str, one of full, half, by default 'full'
        Bridge: both directions, or one and zero: full, half.
    bridge_supply : float [V], at least 1e-09, by default 30.0
        Bridge: largest voltage.
    bridge_frequency : float [Hz], at least 0, by default 20000.0
        Bridge: carrier from time 0; 0: steady during the step.
    bridge_levels : float, at least 0, by default 0.0
        Bridge: steps of the mean between 0 and the supply; 0: any.

    Inputs of run and step
    ----------------------
    enable : float
        0.5 or less: both outputs are 0 V.
    reference : float [V]
        Mean voltage that PWM or bridge gives, held during the step.

    Outputs
    -------
    voltage : float [V]
        At the end of the step; on an edge, just before it.
    voltage_mean : float [V]
        Mean over the step, exact.
    """

    def __init__(
        self,
        *,
        waveform: str = ...,
        square_amplitude: float = ...,
        square_low: float = ...,
        square_period: float = ...,
        square_duty: float = ...,
        square_delay: float = ...,
        step_initial: float = ...,
        step_final: float = ...,
        step_time: float = ...,
        table_file: str = ...,
        table_period: float = ...,
        table_repeat_from: float = ...,
        pwm_high: float = ...,
        pwm_low: float = ...,
        pwm_frequency: float = ...,
        profile_amplitude: float = ...,
        profile_low: float = ...,
        profile_first: float = ...,
        profile_second: float = ...,
        profile_half_period: float = ...,
        profile_delay: float = ...,
        soft_landing_file: str = ...,
        soft_landing_period: float = ...,
        soft_landing_repeat_from: float = ...,
        bridge_kind: str = ...,
        bridge_supply: float = ...,
        bridge_frequency: float = ...,
        bridge_levels: float = ...,
    ) -> None: ...
    def run(  # type: ignore[override]
        self,
        enable: npt.ArrayLike,
        reference: npt.ArrayLike,
        *,
        sample_time: float | None = ...,
        start_time: float = ...,
        outputs: Iterable[str] = ...,
    ) -> DriveVoltageResponse: ...
    def step(  # type: ignore[override]
        self,
        enable: float,
        reference: float,
        *,
        sample_time: float | None = ...,
    ) -> DriveVoltageOutputs: ...


class EkfOutputs(NamedTuple):
    position: float
    velocity: float
    flux_linkage: float
    current_error: float
    force_error: float
    position_std: float
    velocity_std: float
    flux_linkage_std: float
    current_error_std: float
    force_error_std: float
    innovation: float
    innovation_std: float
    health: float
    health_causes: float

class EkfResponse(Response):
    position: Floats
    velocity: Floats
    flux_linkage: Floats
    current_error: Floats
    force_error: Floats
    position_std: Floats
    velocity_std: Floats
    flux_linkage_std: Floats
    current_error_std: Floats
    force_error_std: Floats
    innovation: Floats
    innovation_std: Floats
    health: Floats
    health_causes: Floats

class Ekf(Runnable):
    """
    Extended Kalman filter: position, velocity and flux linkage from voltage, current and contact.

    Parameters
    ----------
    sample_time : float [s], at least 1e-09, by default 2e-05
        Sampling period; the communication step is a whole multiple or a whole fraction of it.
    coil_resistance : float [Ohm], at least 1e-09, by default 48.0
        Resistance R.
    coil_turns : float, at least 1e-09, by default 1200.0
        Number of turns N.
    mover_mass : float [kg], at least 1e-09, by default 0.0016
        Mass of the mover m.
    spring_stiffness : float [N/m], at least 0, by default 61.8
        Stiffness k_sp.
    spring_rest : float [m], by default 0.0192
        Position without spring force z_sp.
    damping : float [N.s/m], at least 0, by default 0.8
        Viscous damping c_f.
    stop_lower : float [m], at least 0, by default 0.0004
        Smallest position z_min.
    stop_upper : float [m], at least 1e-09, by default 0.0014
        Largest position z_max.
    core_reluctance : float [1/H], at least 1e-09, by default 2520000.0
        Reluctance of the core without flux, N^2 R_c0*.
    core_saturation : float [Wb], at least 1e-12, by default 0.0238
        Flux linkage of saturation lambda_sat.
    core_bend : float [1/H], at least 0, by default 0.0
        K of the core R_c0 + K x^2/(1 - x^2), x = flux linkage/saturation; 0: R_c0/(1 - x).
    core_eddy : float [S], at least 0, by default 0.0
        Eddy currents, k_eddy / N^2; 0: none, as in the paper.
    core_hysteresis : float [A], at least 0, by default 0.0
        Largest current of hysteresis; 0: none, as in the paper.
    core_turnover : float [Wb], at least 1e-09, by default 0.0017
        Flux linkage in which hysteresis turns over.
    gap_law : str, one of fringing, table, by default 'fringing'
        Reluctance of the gap: fringing, table.
    gap_reluctance : float [1/H], by default 0.0
        Fringing law: reluctance of the closed gap R_g0.
    gap_slope : float [1/(H.m)], at least 0, by default 47000000000.0
        Fringing law: reluctance per gap without fringing.
    gap_fringing : float [1/m], at least 0, by default 300.0
        Fringing law: strength k_f; 0: none.
    gap_window : float [m], at least 1e-05, by default 0.00973
        Fringing law: length along which the flux fringes c_f.
    gap_file : str, by default 'fringing_29.csv'
        Table: CSV file with the columns gap [m], reluctance [1/H], both rising; interpolated by a cubic spline.
    gap_tilt : float [1/(H.m)], by default 0.0
        Slope added around the middle of the stroke.
    option_force_error : bool, by default True
        Estimate the force error e_F, as in the paper.
    option_current_error : bool, by default True
        Estimate the current error e_i, as in the paper.
    process_flux_linkage : float [Wb], at least 0, by default 1.9e-05
        Standard deviation of its process noise in 20 us.
    process_current_error : float [A], at least 0, by default 0.0022
        Standard deviation of its process noise in 20 us.
    process_current_error_memory : float [s], at least 0, by default 0.00066
        Time constant with which the current error is forgotten at rest; 0: it never is, as in the paper.
    process_force_error : float [N], at least 0, by default 0.021
        Standard deviation of its process noise in 20 us.
    noise_current : float [A], at least 1e-12, by default 0.002
        Standard deviation of the current noise.
    prior_flux_linkage : float [Wb], by default 0.0
        Flux linkage at the start.
    prior_flux_linkage_std : float [Wb], at least 0, by default 0.0
        Its standard deviation.
    range_voltage : float [V], at least 1e-09, by default 100.0
        A reading beyond plus or minus this counts as lost.
    range_current : float [A], at least 0, by default 0.0
        A reading beyond plus or minus this counts as lost; 0: twice what range.voltage drives.
    range_innovation : float, at least 0, by default 50.0
        A current with an innovation beyond so many deviations is wild, but not more than 5 in a row; 0: none is.
    health_samples : float, at least 1, by default 50.0
        Samples over which the innovations are averaged.
    health_limit : float, at least 0, by default 6.0
        Largest mean of the squared normalised innovation.
    health_current_error : float, at least 0, by default 6.0
        Largest root mean square of the current error at rest, in stationary deviations.

    Inputs of run and step
    ----------------------
    voltage : float [V]
        Measured coil voltage; NaN where it was lost.
    current : float [A]
        Measured coil current; NaN where it was lost.
    mode : float, 1 to 3
        1: at the lower stop, 2: moving, 3: at the upper stop; anything else, as NaN, counts as lost.
    resistance : float [Ohm], optional
        Resistance that is known from elsewhere; `coil.resistance` counts where this is not positive and finite.

    Outputs
    -------
    position : float [m]
        Estimated position.
    velocity : float [m/s]
        Estimated mean velocity since the last sample.
    flux_linkage : float [Wb]
        Estimated flux linkage.
    current_error : float [A]
        Estimated error of the model's current.
    force_error : float [N]
        Estimated error of the model's force; the normal force at a stop.
    position_std : float [m], at least 0
        Standard deviation in the filter.
    velocity_std : float [m/s], at least 0
        Standard deviation in the filter.
    flux_linkage_std : float [Wb], at least 0
        Standard deviation in the filter.
    current_error_std : float [A], at least 0
        Standard deviation in the filter.
    force_error_std : float [N], at least 0
        Standard deviation in the filter.
    innovation : float [A]
        Measured minus predicted current.
    innovation_std : float [A], at least 0
        Standard deviation expected of it.
    health : float, 0 to 1
        1: to be trusted as far as the filter can tell; 0: not.
    health_causes : float, 0 to 4095
        Why not, a sum of 1: innovations larger than expected, 2: current error larger than expected, 4: flux linkage beyond saturation, 8: position held at a bound for long, 16: a reading lost or wild, 32: covariance lost, restarted, 64: no motion after a command, 128: device far from the one told, 256: noise or switching larger than told, 512: first impact perhaps missed by the contact, 1024: device not learnt yet, operate it twice, 2048: what was learnt keeps changing.
    """

    def __init__(
        self,
        *,
        sample_time: float = ...,
        coil_resistance: float = ...,
        coil_turns: float = ...,
        mover_mass: float = ...,
        spring_stiffness: float = ...,
        spring_rest: float = ...,
        damping: float = ...,
        stop_lower: float = ...,
        stop_upper: float = ...,
        core_reluctance: float = ...,
        core_saturation: float = ...,
        core_bend: float = ...,
        core_eddy: float = ...,
        core_hysteresis: float = ...,
        core_turnover: float = ...,
        gap_law: str = ...,
        gap_reluctance: float = ...,
        gap_slope: float = ...,
        gap_fringing: float = ...,
        gap_window: float = ...,
        gap_file: str = ...,
        gap_tilt: float = ...,
        option_force_error: bool = ...,
        option_current_error: bool = ...,
        process_flux_linkage: float = ...,
        process_current_error: float = ...,
        process_current_error_memory: float = ...,
        process_force_error: float = ...,
        noise_current: float = ...,
        prior_flux_linkage: float = ...,
        prior_flux_linkage_std: float = ...,
        range_voltage: float = ...,
        range_current: float = ...,
        range_innovation: float = ...,
        health_samples: float = ...,
        health_limit: float = ...,
        health_current_error: float = ...,
    ) -> None: ...
    def run(  # type: ignore[override]
        self,
        voltage: npt.ArrayLike,
        current: npt.ArrayLike,
        mode: npt.ArrayLike,
        resistance: npt.ArrayLike = ...,
        *,
        sample_time: float | None = ...,
        start_time: float = ...,
        outputs: Iterable[str] = ...,
    ) -> EkfResponse: ...
    def step(  # type: ignore[override]
        self,
        voltage: float,
        current: float,
        mode: float,
        resistance: float = ...,
        *,
        sample_time: float | None = ...,
    ) -> EkfOutputs: ...


class ErtssOutputs(NamedTuple):
    position: float
    velocity: float
    flux_linkage: float
    current_error: float
    force_error: float
    position_std: float
    velocity_std: float
    flux_linkage_std: float
    current_error_std: float
    force_error_std: float
    innovation: float
    innovation_std: float
    health: float
    health_causes: float
    smoothed_published: float
    smoothed_time: float
    smoothed_position: float
    smoothed_velocity: float
    smoothed_flux_linkage: float
    smoothed_current_error: float
    smoothed_force_error: float
    smoothed_position_std: float
    smoothed_velocity_std: float
    takeoff_time: float
    landing_time: float
    impact_speed: float
    bounces: float
    rest_time: float

class ErtssResponse(Response):
    position: Floats
    velocity: Floats
    flux_linkage: Floats
    current_error: Floats
    force_error: Floats
    position_std: Floats
    velocity_std: Floats
    flux_linkage_std: Floats
    current_error_std: Floats
    force_error_std: Floats
    innovation: Floats
    innovation_std: Floats
    health: Floats
    health_causes: Floats
    smoothed_published: Floats
    smoothed_time: Floats
    smoothed_position: Floats
    smoothed_velocity: Floats
    smoothed_flux_linkage: Floats
    smoothed_current_error: Floats
    smoothed_force_error: Floats
    smoothed_position_std: Floats
    smoothed_velocity_std: Floats
    takeoff_time: Floats
    landing_time: Floats
    impact_speed: Floats
    bounces: Floats
    rest_time: Floats

class Ertss(Runnable):
    """
    Extended RTS smoother: each motion again after its landing, with landing time and impact speed.

    Parameters
    ----------
    sample_time : float [s], at least 1e-09, by default 2e-05
        Sampling period; the communication step is a whole multiple or a whole fraction of it.
    coil_resistance : float [Ohm], at least 1e-09, by default 48.0
        Resistance R.
    coil_turns : float, at least 1e-09, by default 1200.0
        Number of turns N.
    mover_mass : float [kg], at least 1e-09, by default 0.0016
        Mass of the mover m.
    spring_stiffness : float [N/m], at least 0, by default 61.8
        Stiffness k_sp.
    spring_rest : float [m], by default 0.0192
        Position without spring force z_sp.
    damping : float [N.s/m], at least 0, by default 0.8
        Viscous damping c_f.
    stop_lower : float [m], at least 0, by default 0.0004
        Smallest position z_min.
    stop_upper : float [m], at least 1e-09, by default 0.0014
        Largest position z_max.
    core_reluctance : float [1/H], at least 1e-09, by default 2520000.0
        Reluctance of the core without flux, N^2 R_c0*.
    core_saturation : float [Wb], at least 1e-12, by default 0.0238
        Flux linkage of saturation lambda_sat.
    core_bend : float [1/H], at least 0, by default 0.0
        K of the core R_c0 + K x^2/(1 - x^2), x = flux linkage/saturation; 0: R_c0/(1 - x).
    core_eddy : float [S], at least 0, by default 0.0
        Eddy currents, k_eddy / N^2; 0: none, as in the paper.
    core_hysteresis : float [A], at least 0, by default 0.0
        Largest current of hysteresis; 0: none, as in the paper.
    core_turnover : float [Wb], at least 1e-09, by default 0.0017
        Flux linkage in which hysteresis turns over.
    gap_law : str, one of fringing, table, by default 'fringing'
        Reluctance of the gap: fringing, table.
    gap_reluctance : float [1/H], by default 0.0
        Fringing law: reluctance of the closed gap R_g0.
    gap_slope : float [1/(H.m)], at least 0, by default 47000000000.0
        Fringing law: reluctance per gap without fringing.
    gap_fringing : float [1/m], at least 0, by default 300.0
        Fringing law: strength k_f; 0: none.
    gap_window : float [m], at least 1e-05, by default 0.00973
        Fringing law: length along which the flux fringes c_f.
    gap_file : str, by default 'fringing_29.csv'
        Table: CSV file with the columns gap [m], reluctance [1/H], both rising; interpolated by a cubic spline.
    gap_tilt : float [1/(H.m)], by default 0.0
        Slope added around the middle of the stroke.
    option_force_error : bool, by default True
        Estimate the force error e_F, as in the paper.
    option_current_error : bool, by default True
        Estimate the current error e_i, as in the paper.
    process_flux_linkage : float [Wb], at least 0, by default 1.9e-05
        Standard deviation of its process noise in 20 us.
    process_current_error : float [A], at least 0, by default 0.0022
        Standard deviation of its process noise in 20 us.
    process_current_error_memory : float [s], at least 0, by default 0.00066
        Time constant with which the current error is forgotten at rest; 0: it never is, as in the paper.
    process_force_error : float [N], at least 0, by default 0.021
        Standard deviation of its process noise in 20 us.
    noise_current : float [A], at least 1e-12, by default 0.002
        Standard deviation of the current noise.
    prior_flux_linkage : float [Wb], by default 0.0
        Flux linkage at the start.
    prior_flux_linkage_std : float [Wb], at least 0, by default 0.0
        Its standard deviation.
    range_voltage : float [V], at least 1e-09, by default 100.0
        A reading beyond plus or minus this counts as lost.
    range_current : float [A], at least 0, by default 0.0
        A reading beyond plus or minus this counts as lost; 0: twice what range.voltage drives.
    range_innovation : float, at least 0, by default 50.0
        A current with an innovation beyond so many deviations is wild, but not more than 5 in a row; 0: none is.
    health_samples : float, at least 1, by default 50.0
        Samples over which the innovations are averaged.
    health_limit : float, at least 0, by default 6.0
        Largest mean of the squared normalised innovation.
    health_current_error : float, at least 0, by default 6.0
        Largest root mean square of the current error at rest, in stationary deviations.
    contact_debounce : float [s], at least 0, by default 0.0002
        A mover that leaves its stop and is back in this time has bounced.
    motion_memory : float, 2 to 1024, by default 1024.0
        Samples of a motion that are kept, the last ones; exported C has memory for no more.

    Inputs of run and step
    ----------------------
    voltage : float [V]
        Measured coil voltage; NaN where it was lost.
    current : float [A]
        Measured coil current; NaN where it was lost.
    mode : float, 1 to 3
        1: at the lower stop, 2: moving, 3: at the upper stop; anything else, as NaN, counts as lost.
    resistance : float [Ohm], optional
        Resistance that is known from elsewhere; `coil.resistance` counts where this is not positive and finite.

    Outputs
    -------
    position : float [m]
        Estimated position.
    velocity : float [m/s]
        Estimated mean velocity since the last sample.
    flux_linkage : float [Wb]
        Estimated flux linkage.
    current_error : float [A]
        Estimated error of the model's current.
    force_error : float [N]
        Estimated error of the model's force; the normal force at a stop.
    position_std : float [m], at least 0
        Standard deviation in the filter.
    velocity_std : float [m/s], at least 0
        Standard deviation in the filter.
    flux_linkage_std : float [Wb], at least 0
        Standard deviation in the filter.
    current_error_std : float [A], at least 0
        Standard deviation in the filter.
    force_error_std : float [N], at least 0
        Standard deviation in the filter.
    innovation : float [A]
        Measured minus predicted current.
    innovation_std : float [A], at least 0
        Standard deviation expected of it.
    health : float, 0 to 1
        1: to be trusted as far as the filter can tell; 0: not.
    health_causes : float, 0 to 4095
        Why not, a sum of 1: innovations larger than expected, 2: current error larger than expected, 4: flux linkage beyond saturation, 8: position held at a bound for long, 16: a reading lost or wild, 32: covariance lost, restarted, 64: no motion after a command, 128: device far from the one told, 256: noise or switching larger than told, 512: first impact perhaps missed by the contact, 1024: device not learnt yet, operate it twice, 2048: what was learnt keeps changing.
    smoothed_published : float, 0 to 1
        1: smoothed values of the sample at smoothed_time; 0: those of the filter, now.
    smoothed_time : float [s]
        Time of the sample that the smoothed values belong to.
    smoothed_position : float [m]
        Smoothed position.
    smoothed_velocity : float [m/s]
        Smoothed mean velocity since the sample before.
    smoothed_flux_linkage : float [Wb]
        Smoothed flux linkage.
    smoothed_current_error : float [A]
        Smoothed error of the model's current.
    smoothed_force_error : float [N]
        Smoothed error of the model's force.
    smoothed_position_std : float [m], at least 0
        Its standard deviation.
    smoothed_velocity_std : float [m/s], at least 0
        Its standard deviation.
    takeoff_time : float [s]
        Last sample at rest before the last motion that has landed.
    landing_time : float [s]
        Landing of the last motion.
    impact_speed : float [m/s], at least 0
        Speed before that landing.
    bounces : float, at least 0
        How often the mover came off its stop again after it.
    rest_time : float [s]
        Last contact after it; the landing if there was no bounce.
    """

    def __init__(
        self,
        *,
        sample_time: float = ...,
        coil_resistance: float = ...,
        coil_turns: float = ...,
        mover_mass: float = ...,
        spring_stiffness: float = ...,
        spring_rest: float = ...,
        damping: float = ...,
        stop_lower: float = ...,
        stop_upper: float = ...,
        core_reluctance: float = ...,
        core_saturation: float = ...,
        core_bend: float = ...,
        core_eddy: float = ...,
        core_hysteresis: float = ...,
        core_turnover: float = ...,
        gap_law: str = ...,
        gap_reluctance: float = ...,
        gap_slope: float = ...,
        gap_fringing: float = ...,
        gap_window: float = ...,
        gap_file: str = ...,
        gap_tilt: float = ...,
        option_force_error: bool = ...,
        option_current_error: bool = ...,
        process_flux_linkage: float = ...,
        process_current_error: float = ...,
        process_current_error_memory: float = ...,
        process_force_error: float = ...,
        noise_current: float = ...,
        prior_flux_linkage: float = ...,
        prior_flux_linkage_std: float = ...,
        range_voltage: float = ...,
        range_current: float = ...,
        range_innovation: float = ...,
        health_samples: float = ...,
        health_limit: float = ...,
        health_current_error: float = ...,
        contact_debounce: float = ...,
        motion_memory: float = ...,
    ) -> None: ...
    def run(  # type: ignore[override]
        self,
        voltage: npt.ArrayLike,
        current: npt.ArrayLike,
        mode: npt.ArrayLike,
        resistance: npt.ArrayLike = ...,
        *,
        sample_time: float | None = ...,
        start_time: float = ...,
        outputs: Iterable[str] = ...,
    ) -> ErtssResponse: ...
    def step(  # type: ignore[override]
        self,
        voltage: float,
        current: float,
        mode: float,
        resistance: float = ...,
        *,
        sample_time: float | None = ...,
    ) -> ErtssOutputs: ...


class HybridEkfOutputs(NamedTuple):
    current_estimated: float
    position: float
    velocity: float
    mode: float
    current_std: float
    position_std: float
    velocity_std: float
    innovation: float
    innovation_std: float
    health: float
    health_causes: float

class HybridEkfResponse(Response):
    current_estimated: Floats
    position: Floats
    velocity: Floats
    mode: Floats
    current_std: Floats
    position_std: Floats
    velocity_std: Floats
    innovation: Floats
    innovation_std: Floats
    health: Floats
    health_causes: Floats

class HybridEkf(Runnable):
    """
    Hybrid extended Kalman filter: current, position, velocity and mode of a pot magnet.

    Parameters
    ----------
    sample_time : float [s], at least 1e-09, by default 0.0001
        Sampling period; the communication step is a whole multiple or a whole fraction of it.
    orientation : str, one of consistent, printed, by default 'consistent'
        Gap under the upper stop, or above the lower one as in the paper: consistent, printed.
    tuning : str, one of robust, paper, none, by default 'robust'
        Noise of the parameters, that of the paper, or no correction: robust, paper, none.
    coil_turns : float, at least 1e-09, by default 964.0
        Number of windings N.
    coil_resistance : float [Ohm], at least 1e-09, by default 114.3
        Resistance in modes 0 to 2, K6 = R_i + R_m.
    coil_resistance_upper : float [Ohm], at least 1e-09, by default 120.0
        Resistance in modes 3 and 4, K7 = R_d + R_m.
    core_permeability : float, at least 1e-09, by default 200.0
        Relative permeability mu_r.
    core_length : float [m], at least 1e-09, by default 0.022
        Average length of the field lines l_1.
    pole_area : float [m2], at least 1e-12, by default 7.6341e-05
        Area of the flux A.
    mover_mass : float [kg], at least 1e-09, by default 0.34
        Mass of the armature m.
    gravity : float [m/s2], at least 1e-09, by default 9.81
        Gravity g.
    stop_upper : float [m], at least 1e-09, by default 0.0002
        Position of the upper stop s_max; [HEKF] prints 0.5 mm.
    current_on : float [A], at least 1e-09, by default 0.1
        Least current for a lift i_on.
    current_off : float [A], at least 1e-09, by default 0.02
        Current below which it drops i_off.
    sub_steps : float, 1 to 64, by default 2.0
        Steps of a sampling interval in the air.
    landing_band : float, at least 0, by default 0.03
        Share of s_max within which an approach counts as a landing.
    noise_current : float [A], at least 1e-12, by default 0.001
        Standard deviation of the current noise.
    noise_sensor : float [A], at least 0, by default 0.0
        That of the sensor alone, where `noise.current` has an error of the model, too; 0: the same.
    noise_voltage : float [V], at least 0, by default 0.03
        Standard deviation of the voltage noise, beyond which health looks for edges.
    process_current : float [A], at least 0, by default 0.0003
        Standard deviation of its process noise per sample, on a stop.
    process_current_moving : float [A], at least 0, by default 0.001
        Standard deviation of the same in the air.
    process_position : float [m], at least 0, by default 1e-07
        Standard deviation of its process noise per sample.
    process_velocity : float [m/s], at least 0, by default 0.0003
        Standard deviation of its process noise per sample.
    release_position_std : float [m], at least 0, by default 1e-06
        Standard deviation after leaving a stop.
    release_velocity_std : float [m/s], at least 0, by default 0.001
        Standard deviation after leaving a stop.
    prior_current : float [A], by default 0.0
        Current at the start.
    prior_current_std : float [A], at least 0, by default 0.001
        Its standard deviation.
    prior_position : float [m], at least 0, by default 0.0
        Stop at the start: the upper one from half of s_max on.
    range_voltage : float [V], at least 1e-09, by default 100.0
        A reading beyond plus or minus this counts as lost.
    range_current : float [A], at least 0, by default 0.0
        A reading beyond plus or minus this counts as lost; 0: twice what range.voltage drives.
    range_innovation : float, at least 0, by default 50.0
        A current with an innovation beyond so many deviations is wild, but not more than 5 in a row; 0: none is.
    health_samples : float, at least 1, by default 50.0
        Samples over which the innovations are averaged.
    health_limit : float, at least 0, by default 25.0
        Largest mean of the squared normalised innovation.

    Inputs of run and step
    ----------------------
    voltage : float [V]
        Measured coil voltage; NaN where it was lost.
    current : float [A]
        Measured coil current; NaN where it was lost.

    Outputs
    -------
    current_estimated : float [A]
        Estimated current.
    position : float [m]
        Estimated lift: 0 at the lower stop.
    velocity : float [m/s]
        Estimated rate of the position.
    mode : float, 0 to 4
        0: at the lower stop, 1: lifting, 2: contact, 3: at the upper stop, 4: falling.
    current_std : float [A], at least 0
        Standard deviation in the filter.
    position_std : float [m], at least 0
        Standard deviation in the filter.
    velocity_std : float [m/s], at least 0
        Standard deviation in the filter.
    innovation : float [A]
        Measured minus predicted current.
    innovation_std : float [A], at least 0
        Standard deviation expected of it.
    health : float, 0 to 1
        1: to be trusted as far as the filter can tell; 0: not.
    health_causes : float, 0 to 4095
        Why not, a sum of 1: innovations larger than expected, 2: current error larger than expected, 4: flux linkage beyond saturation, 8: position held at a bound for long, 16: a reading lost or wild, 32: covariance lost, restarted, 64: no motion after a command, 128: device far from the one told, 256: noise or switching larger than told, 512: first impact perhaps missed by the contact, 1024: device not learnt yet, operate it twice, 2048: what was learnt keeps changing.
    """

    def __init__(
        self,
        *,
        sample_time: float = ...,
        orientation: str = ...,
        tuning: str = ...,
        coil_turns: float = ...,
        coil_resistance: float = ...,
        coil_resistance_upper: float = ...,
        core_permeability: float = ...,
        core_length: float = ...,
        pole_area: float = ...,
        mover_mass: float = ...,
        gravity: float = ...,
        stop_upper: float = ...,
        current_on: float = ...,
        current_off: float = ...,
        sub_steps: float = ...,
        landing_band: float = ...,
        noise_current: float = ...,
        noise_sensor: float = ...,
        noise_voltage: float = ...,
        process_current: float = ...,
        process_current_moving: float = ...,
        process_position: float = ...,
        process_velocity: float = ...,
        release_position_std: float = ...,
        release_velocity_std: float = ...,
        prior_current: float = ...,
        prior_current_std: float = ...,
        prior_position: float = ...,
        range_voltage: float = ...,
        range_current: float = ...,
        range_innovation: float = ...,
        health_samples: float = ...,
        health_limit: float = ...,
    ) -> None: ...
    def run(  # type: ignore[override]
        self,
        voltage: npt.ArrayLike,
        current: npt.ArrayLike,
        *,
        sample_time: float | None = ...,
        start_time: float = ...,
        outputs: Iterable[str] = ...,
    ) -> HybridEkfResponse: ...
    def step(  # type: ignore[override]
        self,
        voltage: float,
        current: float,
        *,
        sample_time: float | None = ...,
    ) -> HybridEkfOutputs: ...


class IntegralEstimatorOutputs(NamedTuple):
    resistance: float
    inductance: float
    flux_linkage: float
    quality: float
    published: float
    published_time: float
    health: float
    health_causes: float

class IntegralEstimatorResponse(Response):
    resistance: Floats
    inductance: Floats
    flux_linkage: Floats
    quality: Floats
    published: Floats
    published_time: Floats
    health: Floats
    health_causes: Floats

class IntegralEstimator(Runnable):
    """
    Flux linkage by integration, with the resistance recalculated at the start of each operation.

    Parameters
    ----------
    sample_time : float [s], at least 1e-09, by default 5e-05
        Sampling period; the communication step is a whole multiple or a whole fraction of it.
    prior_resistance : float [Ohm], at least 1e-09, by default 77.5
        Resistance until the first operation has ended.
    prior_inductance : float [H], at least 0, by default 0.05
        Inductance at rest.
    prior_flux_linkage : float [Wb], by default 0.0
        Flux linkage at the start of every operation.
    noise_current : float [A], at least 0, by default 0.001
        Standard deviation of the current noise.
    gate_sigmas : float, at least 0, by default 3.29
        Half width of the noise band, in standard deviations (3.29: 99.9 %).
    noise_voltage : float [V], at least 0, by default 0.015
        Standard deviation of the voltage noise.
    edge_voltage : float [V], at least 0, by default 0.0
        An operation starts when the voltage rises above it; 0: a quarter of the highest of late.
    offline : bool, by default False
        Publish an operation after it has ended, with the resistance that it gave.
    range_voltage : float [V], at least 1e-09, by default 100.0
        A reading beyond plus or minus this counts as lost.
    range_current : float [A], at least 0, by default 0.0
        A reading beyond plus or minus this counts as lost; 0: twice what range.voltage drives.

    Inputs of run and step
    ----------------------
    voltage : float [V]
        Measured coil voltage; NaN where it was lost.
    current : float [A]
        Measured coil current; NaN where it was lost.

    Outputs
    -------
    resistance : float [Ohm]
        Mean resistance of the last operation.
    inductance : float [H]
        Estimated apparent inductance.
    flux_linkage : float [Wb]
        Estimated flux linkage.
    quality : float, 0 to 1
        1: current outside the noise band; 0: inductance at rest.
    published : float, 0 to 1
        1: the estimates belong to published_time; 0: no operation to replay.
    published_time : float [s]
        Time of the sample that the estimates belong to.
    health : float, 0 to 1
        1: to be trusted as far as the filter can tell; 0: not.
    health_causes : float, 0 to 4095
        Why not, a sum of 1: innovations larger than expected, 2: current error larger than expected, 4: flux linkage beyond saturation, 8: position held at a bound for long, 16: a reading lost or wild, 32: covariance lost, restarted, 64: no motion after a command, 128: device far from the one told, 256: noise or switching larger than told, 512: first impact perhaps missed by the contact, 1024: device not learnt yet, operate it twice, 2048: what was learnt keeps changing.
    """

    def __init__(
        self,
        *,
        sample_time: float = ...,
        prior_resistance: float = ...,
        prior_inductance: float = ...,
        prior_flux_linkage: float = ...,
        noise_current: float = ...,
        gate_sigmas: float = ...,
        noise_voltage: float = ...,
        edge_voltage: float = ...,
        offline: bool = ...,
        range_voltage: float = ...,
        range_current: float = ...,
    ) -> None: ...
    def run(  # type: ignore[override]
        self,
        voltage: npt.ArrayLike,
        current: npt.ArrayLike,
        *,
        sample_time: float | None = ...,
        start_time: float = ...,
        outputs: Iterable[str] = ...,
    ) -> IntegralEstimatorResponse: ...
    def step(  # type: ignore[override]
        self,
        voltage: float,
        current: float,
        *,
        sample_time: float | None = ...,
    ) -> IntegralEstimatorOutputs: ...


class MheOutputs(NamedTuple):
    position: float
    velocity: float
    flux_linkage: float
    mode: float
    innovation: float
    health: float
    health_causes: float
    smoothed_published: float
    smoothed_time: float
    smoothed_position: float
    smoothed_velocity: float
    smoothed_flux_linkage: float
    takeoff_time: float
    landing_time: float
    impact_speed: float
    bounces: float
    windows: float
    misfit: float
    resistance: float
    eddy: float
    gap_factor: float
    knee: float
    saturation: float
    hysteresis: float
    mass: float
    rest_position: float
    viscous_damping: float
    core_reluctance: float
    gap_bend: float
    resistance_std: float
    eddy_std: float
    gap_factor_std: float
    knee_std: float
    saturation_std: float
    hysteresis_std: float
    mass_std: float
    rest_position_std: float
    viscous_damping_std: float
    core_reluctance_std: float
    gap_bend_std: float
    voltage_offset: float

class MheResponse(Response):
    position: Floats
    velocity: Floats
    flux_linkage: Floats
    mode: Floats
    innovation: Floats
    health: Floats
    health_causes: Floats
    smoothed_published: Floats
    smoothed_time: Floats
    smoothed_position: Floats
    smoothed_velocity: Floats
    smoothed_flux_linkage: Floats
    takeoff_time: Floats
    landing_time: Floats
    impact_speed: Floats
    bounces: Floats
    windows: Floats
    misfit: Floats
    resistance: Floats
    eddy: Floats
    gap_factor: Floats
    knee: Floats
    saturation: Floats
    hysteresis: Floats
    mass: Floats
    rest_position: Floats
    viscous_damping: Floats
    core_reluctance: Floats
    gap_bend: Floats
    resistance_std: Floats
    eddy_std: Floats
    gap_factor_std: Floats
    knee_std: Floats
    saturation_std: Floats
    hysteresis_std: Floats
    mass_std: Floats
    rest_position_std: Floats
    viscous_damping_std: Floats
    core_reluctance_std: Floats
    gap_bend_std: Floats
    voltage_offset: Floats

class Mhe(Runnable):
    """
    Moving-horizon estimator: position from voltage and current only; learns the device from each motion.

    Parameters
    ----------
    sample_time : float [s], at least 1e-09, by default 2e-05
        Sampling period; the communication step is a whole multiple or a whole fraction of it.
    coil_resistance : float [Ohm], at least 1e-09, by default 48.0
        Resistance R.
    coil_turns : float, at least 1e-09, by default 1200.0
        Number of turns N.
    mover_mass : float [kg], at least 1e-09, by default 0.0016
        Mass of the mover m.
    spring_stiffness : float [N/m], at least 0, by default 61.8
        Stiffness k_sp.
    spring_rest : float [m], by default 0.0192
        Position without spring force z_sp.
    damping : float [N.s/m], at least 0, by default 0.8
        Viscous damping c_f.
    stop_lower : float [m], at least 0, by default 0.0004
        Smallest position z_min.
    stop_upper : float [m], at least 1e-09, by default 0.0014
        Largest position z_max.
    stop_law : str, one of hard, elastic, by default 'hard'
        Stops: hard, elastic.
    stop_restitution : float, 0 to 0.95, by default 0.0
        Hard: speed after an impact over that before it.
    stop_stiffness : float [N/m], at least 0.001, by default 1000000.0
        Elastic: force by depth.
    stop_damping : float [s/m], at least 0, by default 0.5
        Elastic: share by which it is larger, by speed inwards.
    core_reluctance : float [1/H], at least 1e-09, by default 2520000.0
        Reluctance of the core without flux, N^2 R_c0*.
    core_saturation : float [Wb], at least 1e-12, by default 0.0238
        Flux linkage of saturation lambda_sat.
    core_bend : float [1/H], at least 0, by default 0.0
        K of the core R_c0 + K x^2/(1 - x^2), x = flux linkage/saturation; 0: R_c0/(1 - x).
    core_exponent : float, at least 0, by default 0.0
        Power n of a sharper knee b m^n, as `commission` finds it; 0: none.
    core_sharp_reluctance : float [1/H], at least 1e-09, by default 1000000.0
        With core.exponent: core.reluctance.
    core_sharp_bend : float [1/H], at least 1e-09, by default 1000000.0
        With core.exponent: core.bend, b N^2 / core.saturation.
    gap_law : str, one of fringing, table, by default 'fringing'
        Reluctance of the gap: fringing, table.
    gap_reluctance : float [1/H], by default 0.0
        Fringing law: reluctance of the closed gap R_g0.
    gap_slope : float [1/(H.m)], at least 0, by default 47000000000.0
        Fringing law: reluctance per gap without fringing.
    gap_fringing : float [1/m], at least 0, by default 300.0
        Fringing law: strength k_f; 0: none.
    gap_window : float [m], at least 1e-05, by default 0.00973
        Fringing law: length along which the flux fringes c_f.
    gap_file : str, by default 'fringing_29.csv'
        Table: CSV file with the columns gap [m], reluctance [1/H], both rising; interpolated by a cubic spline.
    noise_current : float [A], at least 1e-12, by default 0.002
        Standard deviation of the current noise.
    range_voltage : float [V], at least 1e-09, by default 100.0
        A reading beyond plus or minus this counts as lost.
    range_current : float [A], at least 0, by default 0.0
        A reading beyond plus or minus this counts as lost; 0: twice what range.voltage drives.
    core_eddy : float [S], at least 1e-09, by default 0.0005
        Eddy currents, k_eddy / N^2; a guess, see prior.eddy.
    core_hysteresis : float [A], at least 1e-09, by default 0.005
        Largest current of hysteresis; a guess, see prior.hysteresis.
    core_turnover : float [Wb], at least 1e-09, by default 0.0018
        Flux linkage in which hysteresis turns over.
    gap_factor : float, at least 1e-09, by default 1.0
        Factor of the gap reluctance.
    gap_bend : float, by default 0.0
        Bend of the gap law, zero at both stops.
    option_further : bool, by default False
        Learn damping, core reluctance and bend of the gap law too.
    option_command : bool, by default False
        A window ends where the input command changes, not after a landing.
    option_mean : bool, by default False
        The voltage is the mean since the last sample: that of a held or switched one.
    option_zero : bool, by default False
        The current that is left after `window.tail` without voltage is an offset.
    option_ahead : bool, by default False
        R, rest and damping that change steadily are expected to go on doing so.
    noise_voltage : float [V], at least 0, by default 0.03
        Standard deviation of the voltage noise.
    model_error : float [A], at least 0, by default 0.001
        Standard deviation of the model's error of the current.
    edge : float [V], at least 1e-09, by default 1.0
        A voltage that changes by more is an edge: the current does not count.
    window_tail : float [s], at least 1e-09, by default 0.002
        Time at rest after a landing until the window ends.
    window_longest : float [s], at least 1e-09, by default 0.02
        Longest window; at most 2000 samples.
    window_pace : float, 0 to 64, by default 0.0
        Pieces of the work on a window in a step; 0: by the sample time.
    window_memory : float, 64 to 8192, by default 8192.0
        Samples that are kept; a constant of exported C, which has room for no more.
    publish_within : float [s], at least 0, by default 0.0
        Age beyond which a sample is not published; 0: all are.
    prior_resistance : float, at least 0, by default 0.15
        Resistance R: relative deviation before the first window.
    prior_eddy : float, at least 0, by default 0.5
        Eddy currents g_e: relative deviation before the first window.
    prior_gap : float, at least 0, by default 0.04
        Factor of the gap reluctance: relative deviation before the first window.
    prior_knee : float, at least 0, by default 0.4
        Knee b of the core: relative deviation before the first window.
    prior_saturation : float, at least 0, by default 0.06
        Flux linkage of saturation: relative deviation before the first window.
    prior_hysteresis : float, at least 0, by default 1.0
        Amplitude I_h of the hysteresis: relative deviation before the first window.
    prior_mass : float, at least 0, by default 0.04
        Mass of the mover: relative deviation before the first window.
    prior_rest : float, at least 0, by default 0.04
        Position without spring force: relative deviation before the first window.
    prior_damping : float, at least 0, by default 0.1
        Viscous damping: relative deviation before the first window.
    prior_core : float, at least 0, by default 0.2
        Reluctance R_c of the core without its knee, over N^2: relative deviation before the first window.
    prior_bend : float, at least 0, by default 0.1
        Bend of the gap law, zero at both stops: relative deviation before the first window.
    prior_voltage : float [V], at least 0, by default 0.0
        Offset of the voltage: deviation; 0: none is learnt.
    health_limit : float, at least 0, by default 3.0
        Largest misfit; good windows have less than 1.

    Inputs of run and step
    ----------------------
    voltage : float [V]
        Measured coil voltage; NaN where it was lost.
    current : float [A]
        Measured coil current; NaN where it was lost.
    command : float, optional
        With option.command: a window ends where this changes; any number.

    Outputs
    -------
    position : float [m]
        Causal estimate of the position.
    velocity : float [m/s]
        Its velocity.
    flux_linkage : float [Wb]
        Causal estimate of the flux linkage.
    mode : float, 1 to 3
        1: at the lower stop, 2: moving, 3: at the upper stop.
    innovation : float [A]
        Measured current minus that of the causal estimate.
    health : float, 0 to 1
        1: to be trusted as far as the filter can tell; 0: not.
    health_causes : float, 0 to 4095
        Why not, a sum of 1: innovations larger than expected, 2: current error larger than expected, 4: flux linkage beyond saturation, 8: position held at a bound for long, 16: a reading lost or wild, 32: covariance lost, restarted, 64: no motion after a command, 128: device far from the one told, 256: noise or switching larger than told, 512: first impact perhaps missed by the contact, 1024: device not learnt yet, operate it twice, 2048: what was learnt keeps changing.
    smoothed_published : float, 0 to 1
        1: smoothed values of the sample at smoothed_time; 0: the causal ones, now.
    smoothed_time : float [s]
        Time of the sample that the smoothed values belong to.
    smoothed_position : float [m]
        Smoothed position.
    smoothed_velocity : float [m/s]
        Smoothed mean velocity since the sample before.
    smoothed_flux_linkage : float [Wb]
        Smoothed flux linkage.
    takeoff_time : float [s]
        Last sample at rest before the last motion that was solved.
    landing_time : float [s]
        Its first landing; before any, that of the first sample.
    impact_speed : float [m/s], at least 0
        Speed before that landing; 0 before any.
    bounces : float, at least 0
        Landings after the first one in the same window.
    windows : float, at least 0
        Windows solved so far.
    misfit : float, at least 0
        Cost of the last window over what noise and model error make.
    resistance : float [Ohm]
        Resistance R.
    eddy : float [S]
        Eddy currents g_e.
    gap_factor : float
        Factor of the gap reluctance.
    knee : float [A]
        Knee b of the core.
    saturation : float [Wb]
        Flux linkage of saturation.
    hysteresis : float [A]
        Amplitude I_h of the hysteresis.
    mass : float [kg]
        Mass of the mover.
    rest_position : float [m]
        Position without spring force.
    viscous_damping : float [N.s/m]
        Viscous damping.
    core_reluctance : float [1/H]
        Reluctance R_c of the core without its knee, over N^2.
    gap_bend : float
        Bend of the gap law, zero at both stops.
    resistance_std : float [Ohm], at least 0
        Its standard deviation.
    eddy_std : float [S], at least 0
        Its standard deviation.
    gap_factor_std : float, at least 0
        Its standard deviation.
    knee_std : float [A], at least 0
        Its standard deviation.
    saturation_std : float [Wb], at least 0
        Its standard deviation.
    hysteresis_std : float [A], at least 0
        Its standard deviation.
    mass_std : float [kg], at least 0
        Its standard deviation.
    rest_position_std : float [m], at least 0
        Its standard deviation.
    viscous_damping_std : float [N.s/m], at least 0
        Its standard deviation.
    core_reluctance_std : float [1/H], at least 0
        Its standard deviation.
    gap_bend_std : float, at least 0
        Its standard deviation.
    voltage_offset : float [V]
        Offset of the voltage, by its rests.
    """

    def __init__(
        self,
        *,
        sample_time: float = ...,
        coil_resistance: float = ...,
        coil_turns: float = ...,
        mover_mass: float = ...,
        spring_stiffness: float = ...,
        spring_rest: float = ...,
        damping: float = ...,
        stop_lower: float = ...,
        stop_upper: float = ...,
        stop_law: str = ...,
        stop_restitution: float = ...,
        stop_stiffness: float = ...,
        stop_damping: float = ...,
        core_reluctance: float = ...,
        core_saturation: float = ...,
        core_bend: float = ...,
        core_exponent: float = ...,
        core_sharp_reluctance: float = ...,
        core_sharp_bend: float = ...,
        gap_law: str = ...,
        gap_reluctance: float = ...,
        gap_slope: float = ...,
        gap_fringing: float = ...,
        gap_window: float = ...,
        gap_file: str = ...,
        noise_current: float = ...,
        range_voltage: float = ...,
        range_current: float = ...,
        core_eddy: float = ...,
        core_hysteresis: float = ...,
        core_turnover: float = ...,
        gap_factor: float = ...,
        gap_bend: float = ...,
        option_further: bool = ...,
        option_command: bool = ...,
        option_mean: bool = ...,
        option_zero: bool = ...,
        option_ahead: bool = ...,
        noise_voltage: float = ...,
        model_error: float = ...,
        edge: float = ...,
        window_tail: float = ...,
        window_longest: float = ...,
        window_pace: float = ...,
        window_memory: float = ...,
        publish_within: float = ...,
        prior_resistance: float = ...,
        prior_eddy: float = ...,
        prior_gap: float = ...,
        prior_knee: float = ...,
        prior_saturation: float = ...,
        prior_hysteresis: float = ...,
        prior_mass: float = ...,
        prior_rest: float = ...,
        prior_damping: float = ...,
        prior_core: float = ...,
        prior_bend: float = ...,
        prior_voltage: float = ...,
        health_limit: float = ...,
    ) -> None: ...
    def run(  # type: ignore[override]
        self,
        voltage: npt.ArrayLike,
        current: npt.ArrayLike,
        command: npt.ArrayLike = ...,
        *,
        sample_time: float | None = ...,
        start_time: float = ...,
        outputs: Iterable[str] = ...,
    ) -> MheResponse: ...
    def step(  # type: ignore[override]
        self,
        voltage: float,
        current: float,
        command: float = ...,
        *,
        sample_time: float | None = ...,
    ) -> MheOutputs: ...


class MonitorOutputs(NamedTuple):
    verdict: float
    cause: float
    onset: float
    faults: float
    passed: float
    commands: float
    motions: float
    strangeness: float
    wear: float
    evidence_stuck_upper: float
    evidence_stuck_lower: float
    evidence_lower_stop: float
    evidence_upper_stop: float
    evidence_spring: float
    evidence_turns: float
    evidence_contact: float
    evidence_open: float
    evidence_supply: float
    evidence_gain: float
    evidence_friction: float
    evidence_still: float
    since_stuck_upper: float
    since_stuck_lower: float
    since_lower_stop: float
    since_upper_stop: float
    since_spring: float
    since_turns: float
    since_contact: float
    since_open: float
    since_supply: float
    since_gain: float
    since_friction: float
    since_still: float
    profile_closing_before: float
    profile_closing_moving: float
    profile_closing_landed: float
    profile_closing_held: float
    profile_opening_before: float
    profile_opening_moving: float
    profile_opening_landed: float
    profile_opening_held: float
    moved_resistance: float
    moved_eddy: float
    moved_gap_factor: float
    moved_knee: float
    moved_saturation: float
    moved_hysteresis: float
    moved_mass: float
    moved_rest_position: float
    trend_resistance: float
    trend_eddy: float
    trend_gap_factor: float
    trend_knee: float
    trend_saturation: float
    trend_hysteresis: float
    trend_mass: float
    trend_rest_position: float
    baseline_windows: float
    baseline_size: float
    baseline_closing_before: float
    baseline_closing_moving: float
    baseline_closing_landed: float
    baseline_closing_held: float
    baseline_opening_before: float
    baseline_opening_moving: float
    baseline_opening_landed: float
    baseline_opening_held: float
    baseline_resistance: float
    baseline_eddy: float
    baseline_gap_factor: float
    baseline_knee: float
    baseline_saturation: float
    baseline_hysteresis: float
    baseline_mass: float
    baseline_rest_position: float

class MonitorResponse(Response):
    verdict: Floats
    cause: Floats
    onset: Floats
    faults: Floats
    passed: Floats
    commands: Floats
    motions: Floats
    strangeness: Floats
    wear: Floats
    evidence_stuck_upper: Floats
    evidence_stuck_lower: Floats
    evidence_lower_stop: Floats
    evidence_upper_stop: Floats
    evidence_spring: Floats
    evidence_turns: Floats
    evidence_contact: Floats
    evidence_open: Floats
    evidence_supply: Floats
    evidence_gain: Floats
    evidence_friction: Floats
    evidence_still: Floats
    since_stuck_upper: Floats
    since_stuck_lower: Floats
    since_lower_stop: Floats
    since_upper_stop: Floats
    since_spring: Floats
    since_turns: Floats
    since_contact: Floats
    since_open: Floats
    since_supply: Floats
    since_gain: Floats
    since_friction: Floats
    since_still: Floats
    profile_closing_before: Floats
    profile_closing_moving: Floats
    profile_closing_landed: Floats
    profile_closing_held: Floats
    profile_opening_before: Floats
    profile_opening_moving: Floats
    profile_opening_landed: Floats
    profile_opening_held: Floats
    moved_resistance: Floats
    moved_eddy: Floats
    moved_gap_factor: Floats
    moved_knee: Floats
    moved_saturation: Floats
    moved_hysteresis: Floats
    moved_mass: Floats
    moved_rest_position: Floats
    trend_resistance: Floats
    trend_eddy: Floats
    trend_gap_factor: Floats
    trend_knee: Floats
    trend_saturation: Floats
    trend_hysteresis: Floats
    trend_mass: Floats
    trend_rest_position: Floats
    baseline_windows: Floats
    baseline_size: Floats
    baseline_closing_before: Floats
    baseline_closing_moving: Floats
    baseline_closing_landed: Floats
    baseline_closing_held: Floats
    baseline_opening_before: Floats
    baseline_opening_moving: Floats
    baseline_opening_landed: Floats
    baseline_opening_held: Floats
    baseline_resistance: Floats
    baseline_eddy: Floats
    baseline_gap_factor: Floats
    baseline_knee: Floats
    baseline_saturation: Floats
    baseline_hysteresis: Floats
    baseline_mass: Floats
    baseline_rest_position: Floats

class Monitor(Runnable):
    """
    Condition of a device by what Mhe says of it: healthy or not, since when, why, and where it goes.

    Parameters
    ----------
    sample_time : float [s], at least 1e-09, by default 2e-05
        Sampling period; the communication step is a whole multiple or a whole fraction of it.
    settle : float [s], at least 0, by default 0.003
        Time after a landing that has a mean innovation of its own.
    limit_strange : float, at least 1, by default 3.0
        Size from which an operation is strange, in usual sizes.
    limit_worn : float, at least 0.1, by default 3.0
        Size of what has moved from which a device is worn, in usual wanderings.
    least_size : float [A], at least 0, by default 0.0007
        Usual size of a profile, at least.
    learn_windows : float, at least 2, by default 60.0
        Good windows that make a baseline.
    baseline_windows : float, at least 0, by default 0.0
        Windows behind the baseline below; fewer than learn.windows: it is learnt.
    baseline_size : float [A], at least 0, by default 0.001
        Usual size of a profile; counts with baseline.windows.
    baseline_closing_before : float [A], by default 0.0
        Usual mean innovation before the motion, closing; counts with baseline.windows.
    baseline_closing_moving : float [A], by default 0.0
        Usual mean innovation in the motion, closing; counts with baseline.windows.
    baseline_closing_landed : float [A], by default 0.0
        Usual mean innovation after the landing, closing; counts with baseline.windows.
    baseline_closing_held : float [A], by default 0.0
        Usual mean innovation in the rest, closing; counts with baseline.windows.
    baseline_opening_before : float [A], by default 0.0
        Usual mean innovation before the motion, opening; counts with baseline.windows.
    baseline_opening_moving : float [A], by default 0.0
        Usual mean innovation in the motion, opening; counts with baseline.windows.
    baseline_opening_landed : float [A], by default 0.0
        Usual mean innovation after the landing, opening; counts with baseline.windows.
    baseline_opening_held : float [A], by default 0.0
        Usual mean innovation in the rest, opening; counts with baseline.windows.
    baseline_resistance : float, by default 0.0
        Logarithm of the resistance of the healthy device; counts with baseline.windows.
    baseline_eddy : float, by default 0.0
        Logarithm of the eddy currents of the healthy device; counts with baseline.windows.
    baseline_gap_factor : float, by default 0.0
        Logarithm of the gap factor of the healthy device; counts with baseline.windows.
    baseline_knee : float, by default 0.0
        Logarithm of the knee of the healthy device; counts with baseline.windows.
    baseline_saturation : float, by default 0.0
        Logarithm of the saturation of the healthy device; counts with baseline.windows.
    baseline_hysteresis : float, by default 0.0
        Logarithm of the hysteresis of the healthy device; counts with baseline.windows.
    baseline_mass : float, by default 0.0
        Logarithm of the mass of the healthy device; counts with baseline.windows.
    baseline_rest_position : float, by default 0.0
        Logarithm of the rest position of the healthy device; counts with baseline.windows.

    Inputs of run and step
    ----------------------
    command : float
        Above 0.5: the coil is to be switched on.
    current : float [A]
        Measured coil current; NaN where it was lost.
    innovation : float [A]
        Innovation.
    mode : float, 0 to 3
        Mode that Mhe expects: 2 moving.
    health_causes : float, at least 0
        Why Mhe is not healthy: bit 1 counts.
    windows : float, at least 0
        Windows solved so far.
    misfit : float, at least 0
        Misfit of the last one.
    resistance : float [Ohm]
        `resistance` of Mhe.
    eddy : float [S]
        `eddy` of Mhe.
    gap_factor : float
        `gap_factor` of Mhe.
    knee : float [A]
        `knee` of Mhe.
    saturation : float [Wb]
        `saturation` of Mhe.
    hysteresis : float [A]
        `hysteresis` of Mhe.
    mass : float [kg]
        `mass` of Mhe.
    rest_position : float [m]
        `rest_position` of Mhe.
    resistance_std : float [Ohm]
        `resistance_std` of Mhe.
    eddy_std : float [S]
        `eddy_std` of Mhe.
    gap_factor_std : float
        `gap_factor_std` of Mhe.
    knee_std : float [A]
        `knee_std` of Mhe.
    saturation_std : float [Wb]
        `saturation_std` of Mhe.
    hysteresis_std : float [A]
        `hysteresis_std` of Mhe.
    mass_std : float [kg]
        `mass_std` of Mhe.
    rest_position_std : float [m]
        `rest_position_std` of Mhe.

    Outputs
    -------
    verdict : float, 0 to 3
        0: learning, 1: healthy, 2: worn, 3: faulty.
    cause : float, 0 to 12
        The most likely cause, by the number of its evidence; 0: none, or one that is not known.
    onset : float [s]
        Begin of the first operation of the last fault; 0: there was none.
    faults : float, at least 0
        Faults so far.
    passed : float, at least 0
        Faults that have passed: the device is healthy again.
    commands : float, at least 0
        Operations that were commanded and are over.
    motions : float, at least 0
        Those with a motion.
    strangeness : float, at least 0
        Size of the last operation's profile, in usual sizes.
    wear : float, at least 0
        Size of what has moved since the baseline, in usual wanderings.
    evidence_stuck_upper : float, 0 to 1
        Evidence, 0 to 1: stuck at the upper stop.
    evidence_stuck_lower : float, 0 to 1
        Evidence, 0 to 1: stuck at the lower stop.
    evidence_lower_stop : float, 0 to 1
        Evidence, 0 to 1: lower stop higher.
    evidence_upper_stop : float, 0 to 1
        Evidence, 0 to 1: upper stop lower.
    evidence_spring : float, 0 to 1
        Evidence, 0 to 1: spring weaker or broken.
    evidence_turns : float, 0 to 1
        Evidence, 0 to 1: turns shorted.
    evidence_contact : float, 0 to 1
        Evidence, 0 to 1: resistance in the circuit higher at once, as of a contact.
    evidence_open : float, 0 to 1
        Evidence, 0 to 1: circuit open.
    evidence_supply : float, 0 to 1
        Evidence, 0 to 1: voltage lower than measured.
    evidence_gain : float, 0 to 1
        Evidence, 0 to 1: current sensor reads too little.
    evidence_friction : float, 0 to 1
        Evidence, 0 to 1: friction, damping or mass higher.
    evidence_still : float, 0 to 1
        Evidence, 0 to 1: no voltage, or none that moves the device.
    since_stuck_upper : float [s], at least -1
        Begin of the operation in which the evidence passed 0.5, or -1: stuck at the upper stop.
    since_stuck_lower : float [s], at least -1
        Begin of the operation in which the evidence passed 0.5, or -1: stuck at the lower stop.
    since_lower_stop : float [s], at least -1
        Begin of the operation in which the evidence passed 0.5, or -1: lower stop higher.
    since_upper_stop : float [s], at least -1
        Begin of the operation in which the evidence passed 0.5, or -1: upper stop lower.
    since_spring : float [s], at least -1
        Begin of the operation in which the evidence passed 0.5, or -1: spring weaker or broken.
    since_turns : float [s], at least -1
        Begin of the operation in which the evidence passed 0.5, or -1: turns shorted.
    since_contact : float [s], at least -1
        Begin of the operation in which the evidence passed 0.5, or -1: resistance higher at once.
    since_open : float [s], at least -1
        Begin of the operation in which the evidence passed 0.5, or -1: circuit open.
    since_supply : float [s], at least -1
        Begin of the operation in which the evidence passed 0.5, or -1: voltage lower than measured.
    since_gain : float [s], at least -1
        Begin of the operation in which the evidence passed 0.5, or -1: current sensor reads too little.
    since_friction : float [s], at least -1
        Begin of the operation in which the evidence passed 0.5, or -1: friction, damping or mass higher.
    since_still : float [s], at least -1
        Begin of the operation in which the evidence passed 0.5, or -1: no voltage, or none that moves the device.
    profile_closing_before : float [A]
        Mean innovation less the usual one, of the last operation or of the fault: closing, before the motion.
    profile_closing_moving : float [A]
        Mean innovation less the usual one, of the last operation or of the fault: closing, in the motion.
    profile_closing_landed : float [A]
        Mean innovation less the usual one, of the last operation or of the fault: closing, after the landing.
    profile_closing_held : float [A]
        Mean innovation less the usual one, of the last operation or of the fault: closing, in the rest.
    profile_opening_before : float [A]
        Mean innovation less the usual one, of the last operation or of the fault: opening, before the motion.
    profile_opening_moving : float [A]
        Mean innovation less the usual one, of the last operation or of the fault: opening, in the motion.
    profile_opening_landed : float [A]
        Mean innovation less the usual one, of the last operation or of the fault: opening, after the landing.
    profile_opening_held : float [A]
        Mean innovation less the usual one, of the last operation or of the fault: opening, in the rest.
    moved_resistance : float
        Change since the baseline, in usual wanderings: resistance.
    moved_eddy : float
        Change since the baseline, in usual wanderings: eddy currents.
    moved_gap_factor : float
        Change since the baseline, in usual wanderings: gap factor.
    moved_knee : float
        Change since the baseline, in usual wanderings: knee.
    moved_saturation : float
        Change since the baseline, in usual wanderings: saturation.
    moved_hysteresis : float
        Change since the baseline, in usual wanderings: hysteresis.
    moved_mass : float
        Change since the baseline, in usual wanderings: mass.
    moved_rest_position : float
        Change since the baseline, in usual wanderings: rest position.
    trend_resistance : float
        Relative change per 1,000 operations: resistance.
    trend_eddy : float
        Relative change per 1,000 operations: eddy currents.
    trend_gap_factor : float
        Relative change per 1,000 operations: gap factor.
    trend_knee : float
        Relative change per 1,000 operations: knee.
    trend_saturation : float
        Relative change per 1,000 operations: saturation.
    trend_hysteresis : float
        Relative change per 1,000 operations: hysteresis.
    trend_mass : float
        Relative change per 1,000 operations: mass.
    trend_rest_position : float
        Relative change per 1,000 operations: rest position.
    baseline_windows : float
        For the parameter of that name after a restart: windows behind the baseline.
    baseline_size : float [A]
        For the parameter of that name after a restart: usual size of a profile.
    baseline_closing_before : float [A]
        For the parameter of that name after a restart: mean innovation of a closing before the motion.
    baseline_closing_moving : float [A]
        For the parameter of that name after a restart: in the motion.
    baseline_closing_landed : float [A]
        For the parameter of that name after a restart: after the landing.
    baseline_closing_held : float [A]
        For the parameter of that name after a restart: in the rest.
    baseline_opening_before : float [A]
        For the parameter of that name after a restart: mean innovation of an opening before the motion.
    baseline_opening_moving : float [A]
        For the parameter of that name after a restart: in the motion.
    baseline_opening_landed : float [A]
        For the parameter of that name after a restart: after the landing.
    baseline_opening_held : float [A]
        For the parameter of that name after a restart: in the rest.
    baseline_resistance : float
        For the parameter of that name after a restart: logarithm of the resistance [ohm].
    baseline_eddy : float
        For the parameter of that name after a restart: logarithm of the eddy currents [S].
    baseline_gap_factor : float
        For the parameter of that name after a restart: logarithm of the gap factor.
    baseline_knee : float
        For the parameter of that name after a restart: logarithm of the knee [A].
    baseline_saturation : float
        For the parameter of that name after a restart: logarithm of the saturation [Wb].
    baseline_hysteresis : float
        For the parameter of that name after a restart: logarithm of the hysteresis [A].
    baseline_mass : float
        For the parameter of that name after a restart: logarithm of the mass [kg].
    baseline_rest_position : float
        For the parameter of that name after a restart: logarithm of the rest position [m].
    """

    def __init__(
        self,
        *,
        sample_time: float = ...,
        settle: float = ...,
        limit_strange: float = ...,
        limit_worn: float = ...,
        least_size: float = ...,
        learn_windows: float = ...,
        baseline_windows: float = ...,
        baseline_size: float = ...,
        baseline_closing_before: float = ...,
        baseline_closing_moving: float = ...,
        baseline_closing_landed: float = ...,
        baseline_closing_held: float = ...,
        baseline_opening_before: float = ...,
        baseline_opening_moving: float = ...,
        baseline_opening_landed: float = ...,
        baseline_opening_held: float = ...,
        baseline_resistance: float = ...,
        baseline_eddy: float = ...,
        baseline_gap_factor: float = ...,
        baseline_knee: float = ...,
        baseline_saturation: float = ...,
        baseline_hysteresis: float = ...,
        baseline_mass: float = ...,
        baseline_rest_position: float = ...,
    ) -> None: ...
    def run(  # type: ignore[override]
        self,
        command: npt.ArrayLike,
        current: npt.ArrayLike,
        innovation: npt.ArrayLike,
        mode: npt.ArrayLike,
        health_causes: npt.ArrayLike,
        windows: npt.ArrayLike,
        misfit: npt.ArrayLike,
        resistance: npt.ArrayLike,
        eddy: npt.ArrayLike,
        gap_factor: npt.ArrayLike,
        knee: npt.ArrayLike,
        saturation: npt.ArrayLike,
        hysteresis: npt.ArrayLike,
        mass: npt.ArrayLike,
        rest_position: npt.ArrayLike,
        resistance_std: npt.ArrayLike,
        eddy_std: npt.ArrayLike,
        gap_factor_std: npt.ArrayLike,
        knee_std: npt.ArrayLike,
        saturation_std: npt.ArrayLike,
        hysteresis_std: npt.ArrayLike,
        mass_std: npt.ArrayLike,
        rest_position_std: npt.ArrayLike,
        *,
        sample_time: float | None = ...,
        start_time: float = ...,
        outputs: Iterable[str] = ...,
    ) -> MonitorResponse: ...
    def step(  # type: ignore[override]
        self,
        command: float,
        current: float,
        innovation: float,
        mode: float,
        health_causes: float,
        windows: float,
        misfit: float,
        resistance: float,
        eddy: float,
        gap_factor: float,
        knee: float,
        saturation: float,
        hysteresis: float,
        mass: float,
        rest_position: float,
        resistance_std: float,
        eddy_std: float,
        gap_factor_std: float,
        knee_std: float,
        saturation_std: float,
        hysteresis_std: float,
        mass_std: float,
        rest_position_std: float,
        *,
        sample_time: float | None = ...,
    ) -> MonitorOutputs: ...


class PlayActuatorOutputs(NamedTuple):
    current: float
    position: float
    velocity: float
    flux_linkage: float
    force: float
    mode: float
    contact: float
    eddy_current: float
    hysteresis_current: float
    impact_speed: float

class PlayActuatorResponse(Response):
    current: Floats
    position: Floats
    velocity: Floats
    flux_linkage: Floats
    force: Floats
    mode: Floats
    contact: Floats
    eddy_current: Floats
    hysteresis_current: Floats
    impact_speed: Floats

class PlayActuator(Runnable):
    """
    Reluctance actuator of another physics: hysteresis of play elements, two poles of eddy currents.

    Parameters
    ----------
    coil_resistance : float [Ohm], at least 1e-09, by default 48.0
        Resistance R.
    coil_turns : float, at least 1e-09, by default 1200.0
        Number of turns N.
    core_reluctance : float [1/H], at least 1e-09, by default 2018880.0
        Reluctance of the core without flux.
    core_saturation : float [Wb], at least 1e-12, by default 0.02471
        Flux linkage of saturation.
    hysteresis_amplitude : float [A], at least 0, by default 0.015
        Current of all play elements at their limits.
    hysteresis_reach : float [Wb], at least 1e-12, by default 0.003
        Flux linkage from zero to the limit of the widest.
    eddy_fast : float [S], at least 0, by default 0.0007
        Fast eddy current per rate of the flux linkage.
    eddy_fast_time : float [s], at least 1e-05, by default 5e-05
        Its time constant.
    eddy_slow : float [S], at least 0, by default 0.0005
        Slow eddy current per rate of the flux linkage.
    eddy_slow_time : float [s], at least 1e-05, by default 0.0005
        Its time constant.
    gap_slope : float [1/(H.m)], at least 0, by default 47000000000.0
        Fringing law: reluctance per gap without fringing, R_gp.
    gap_fringing : float [1/m], at least 0, by default 300.0
        Fringing law: strength k_f.
    gap_window : float [m], at least 1e-09, by default 0.00973
        Fringing law: reach c_f; no fringing in larger gaps.
    mover_mass : float [kg], at least 1e-09, by default 0.0016
        Mass of the mover m.
    spring_stiffness : float [N/m], at least 0, by default 61.8
        Stiffness k_sp.
    spring_rest : float [m], by default 0.0192
        Gap without spring force, z_sp.
    damping : float [N.s/m], at least 0, by default 0.8
        Viscous damping c_f.
    stop_lower : float [m], at least 0, by default 0.0004
        Smallest gap z_min.
    stop_upper : float [m], at least 1e-09, by default 0.0014
        Largest gap z_max.
    stop_restitution : float, 0 to 0.95, by default 0.0
        Speed after an impact over that before it.
    initial_position : float [m], at least 0, by default 0.0014
        Gap at the start.
    micro_step : float [s], 1e-07 to 1e-05, by default 5e-06
        Longest step of the integrator.

    Inputs of run and step
    ----------------------
    voltage : float [V]
        Coil voltage, held during the step.

    Outputs
    -------
    current : float [A]
        Coil current; at a jump of the voltage, that before it.
    position : float [m]
        Gap: the smallest is closed.
    velocity : float [m/s]
        Rate of the gap.
    flux_linkage : float [Wb]
        Flux linkage.
    force : float [N]
        Magnetic force; negative: it closes the gap.
    mode : float, 1 to 3
        1: at the lower stop, 2: moving, 3: at the upper stop.
    contact : float, 0 to 1
        1 on a stop, else 0.
    eddy_current : float [A]
        Part of the current that eddy currents need.
    hysteresis_current : float [A]
        Part of the current that the play elements need.
    impact_speed : float [m/s]
        Hardest impact since the mover last left its rest.
    """

    def __init__(
        self,
        *,
        coil_resistance: float = ...,
        coil_turns: float = ...,
        core_reluctance: float = ...,
        core_saturation: float = ...,
        hysteresis_amplitude: float = ...,
        hysteresis_reach: float = ...,
        eddy_fast: float = ...,
        eddy_fast_time: float = ...,
        eddy_slow: float = ...,
        eddy_slow_time: float = ...,
        gap_slope: float = ...,
        gap_fringing: float = ...,
        gap_window: float = ...,
        mover_mass: float = ...,
        spring_stiffness: float = ...,
        spring_rest: float = ...,
        damping: float = ...,
        stop_lower: float = ...,
        stop_upper: float = ...,
        stop_restitution: float = ...,
        initial_position: float = ...,
        micro_step: float = ...,
    ) -> None: ...
    def run(  # type: ignore[override]
        self,
        voltage: npt.ArrayLike,
        *,
        sample_time: float | None = ...,
        start_time: float = ...,
        outputs: Iterable[str] = ...,
    ) -> PlayActuatorResponse: ...
    def step(  # type: ignore[override]
        self,
        voltage: float,
        *,
        sample_time: float | None = ...,
    ) -> PlayActuatorOutputs: ...


class PotMagnetOutputs(NamedTuple):
    current: float
    position: float
    velocity: float
    flux_linkage: float
    inductance: float
    force: float
    mode: float
    contact: float
    dissipated_energy: float
    stored_energy: float
    supplied_energy: float
    created_energy: float
    impact_speed: float

class PotMagnetResponse(Response):
    current: Floats
    position: Floats
    velocity: Floats
    flux_linkage: Floats
    inductance: Floats
    force: Floats
    mode: Floats
    contact: Floats
    dissipated_energy: Floats
    stored_energy: Floats
    supplied_energy: Floats
    created_energy: Floats
    impact_speed: Floats

class PotMagnet(Runnable):
    """
    Pot magnet that lifts its armature against gravity, with five modes.

    Parameters
    ----------
    orientation : str, one of consistent, printed, by default 'consistent'
        Gap under the upper stop, or above the lower one as in the paper: consistent, printed.
    coil_turns : float, at least 1e-09, by default 964.0
        Number of windings N.
    coil_resistance : float [Ohm], at least 1e-09, by default 114.3
        Resistance in modes 0 to 2, K6 = R_i + R_m.
    coil_resistance_upper : float [Ohm], at least 1e-09, by default 120.0
        Resistance in modes 3 and 4, K7 = R_d + R_m.
    core_permeability : float, at least 1e-09, by default 200.0
        Relative permeability mu_r.
    core_length : float [m], at least 1e-09, by default 0.022
        Average length of the field lines l_1.
    pole_area : float [m2], at least 1e-12, by default 7.6341e-05
        Area of the flux A.
    mover_mass : float [kg], at least 1e-09, by default 0.34
        Mass of the armature m.
    gravity : float [m/s2], at least 1e-09, by default 9.81
        Gravity g.
    stop_upper : float [m], at least 1e-09, by default 0.0002
        Position of the upper stop s_max; [HEKF] prints 0.5 mm.
    stop_restitution : float, 0 to 0.95, by default 0.0
        Speed after an impact over that before it.
    current_on : float [A], at least 1e-09, by default 0.1
        Least current for a lift i_on.
    current_off : float [A], at least 1e-09, by default 0.02
        Current below which it drops i_off.
    initial_position : float [m], at least 0, by default 0.0
        Position at the start.
    micro_step : float [s], at least 1e-07, by default 2.5e-05
        Longest step of the integrator.

    Inputs of run and step
    ----------------------
    voltage : float [V]
        Coil voltage, held during the step.

    Outputs
    -------
    current : float [A]
        Coil current.
    position : float [m]
        Lift of the armature: 0 at the lower stop.
    velocity : float [m/s]
        Rate of the position.
    flux_linkage : float [Wb]
        Flux linkage.
    inductance : float [H]
        Inductance, flux linkage / current.
    force : float [N]
        Magnetic force, upwards.
    mode : float, 0 to 4
        0: at the lower stop, 1: lifting, 2: contact, 3: at the upper stop, 4: falling.
    contact : float, 0 to 1
        1 on a stop, else 0.
    dissipated_energy : float [J]
        Lost in the coil and the impacts since the start.
    stored_energy : float [J]
        Magnetic, potential and kinetic energy.
    supplied_energy : float [J]
        Integral of voltage times current since the start.
    created_energy : float [J]
        What the printed orientation creates out of nothing, since the start.
    impact_speed : float [m/s]
        Hardest impact since the armature last left its rest.
    """

    def __init__(
        self,
        *,
        orientation: str = ...,
        coil_turns: float = ...,
        coil_resistance: float = ...,
        coil_resistance_upper: float = ...,
        core_permeability: float = ...,
        core_length: float = ...,
        pole_area: float = ...,
        mover_mass: float = ...,
        gravity: float = ...,
        stop_upper: float = ...,
        stop_restitution: float = ...,
        current_on: float = ...,
        current_off: float = ...,
        initial_position: float = ...,
        micro_step: float = ...,
    ) -> None: ...
    def run(  # type: ignore[override]
        self,
        voltage: npt.ArrayLike,
        *,
        sample_time: float | None = ...,
        start_time: float = ...,
        outputs: Iterable[str] = ...,
    ) -> PotMagnetResponse: ...
    def step(  # type: ignore[override]
        self,
        voltage: float,
        *,
        sample_time: float | None = ...,
    ) -> PotMagnetOutputs: ...


class PowerStageOutputs(NamedTuple):
    voltage: float
    voltage_mean: float
    current: float
    supply_current: float
    link_voltage: float
    boosted_voltage: float
    leg_a: float
    leg_b: float
    path: float
    coil_inductance: float
    edge: float
    supplied_energy: float
    delivered_energy: float
    dissipated_energy: float
    stored_energy: float

class PowerStageResponse(Response):
    voltage: Floats
    voltage_mean: Floats
    current: Floats
    supply_current: Floats
    link_voltage: Floats
    boosted_voltage: Floats
    leg_a: Floats
    leg_b: Floats
    path: Floats
    coil_inductance: Floats
    edge: Floats
    supplied_energy: Floats
    delivered_energy: Floats
    dissipated_energy: Floats
    stored_energy: Floats

class PowerStage(Runnable):
    """
    Power stage: low-side switch with its clamp, half and full bridge, boost; a supply that sags.

    Parameters
    ----------
    topology : str, one of low_side_diode, low_side_zener, low_side_tvs, low_side_resistor, half_bridge, full_bridge, boost, by default 'low_side_diode'
        What the coil is switched by: low_side_diode, low_side_zener, low_side_tvs, low_side_resistor, half_bridge, full_bridge, boost.
    control_law : str, one of gate, pwm, current, peak_hold, by default 'gate'
        What the switches follow: gate, pwm, current, peak_hold.
    control_chop : str, one of slow, fast, by default 'slow'
        Decay of a regulated current: slow, fast.
    control_restart : str, one of hysteresis, pwm, by default 'hysteresis'
        What switches a regulated current on again: hysteresis, pwm.
    control_frequency : float [Hz], at least 0.001, by default 20000.0
        Carrier of PWM and restart; a period begins at the start.
    control_band : float [A], at least 0, by default 0.05
        A regulated current is between its level and this much less.
    peak_current : float [A], at least 0, by default 0.6
        Peak and hold: level at first.
    peak_duration : float [s], at least 0, by default 0.004
        Peak and hold: time from gate to hold.
    hold_current : float [A], at least 0, by default 0.3
        Peak and hold: level then.
    supply_voltage : float [V], at least 1e-09, by default 30.0
        Supply.
    supply_resistance : float [Ohm], at least 0, by default 0.1
        Supply and its wires.
    supply_inductance : float [H], at least 1e-09, by default 1e-05
        Supply and its wires.
    link_capacitance : float [F], at least 1e-09, by default 0.001
        DC link.
    link_resistance : float [Ohm], at least 0, by default 0.02
        Series resistance of its capacitor.
    cable_resistance : float [Ohm], at least 0, by default 0.0
        Cable to the coil.
    cable_inductance : float [H], at least 0, by default 0.0
        Cable to the coil.
    switch_resistance : float [Ohm], at least 0, by default 0.1
        Switch that is on.
    switch_dead_time : float [s], at least 0, by default 1e-06
        Full bridge: from one switch of a leg to the other.
    switch_minimum : float [s], at least 1e-07, by default 2e-06
        Shortest time on; of a regulated current off, too.
    diode_voltage : float [V], at least 0, by default 0.7
        Threshold of a diode.
    diode_resistance : float [Ohm], at least 0, by default 0.05
        Slope of a diode.
    clamp_voltage : float [V], at least 1e-09, by default 60.0
        Zener diode or TVS.
    clamp_resistance : float [Ohm], at least 0, by default 0.5
        Slope of the Zener diode or TVS.
    freewheel_resistance : float [Ohm], at least 0, by default 100.0
        Resistor in series with the diode.
    boost_capacitance : float [F], at least 1e-09, by default 0.0001
        Boost capacitor.
    boost_voltage : float [V], at least 1e-09, by default 65.0
        To which it is charged.
    boost_current : float [A], at least 0, by default 0.5
        With which it is charged.
    boost_efficiency : float, 0.01 to 1, by default 0.85
        Of its converter.
    coil_resistance : float [Ohm], at least 1e-09, by default 48.0
        Resistance R of the coil.
    coil_inductance : float [H], at least 1e-09, by default 0.1
        The largest that it has; it starts with it.
    coil_conductance : float [S], at least 0, by default 0.0
        Eddy currents, seen from the coil: k_eddy / N^2 of ReluctanceActuator.
    micro_step : float [s], at least 1e-07, by default 1e-05
        Longest step of the integrator.
    current_at : str, one of start, end, by default 'start'
        To which end of the step the coil's current belongs; end: iterated: start, end.

    Inputs of run and step
    ----------------------
    gate : float
        Above 0.5: the upper switch, or the only one, is on; or peak and hold begins.
    gate_low : float
        Above 0.5: the lower switch of a bridge is on.
    reference : float
        PWM: duty, -1 to 1; current: level [A]; held during the step.
    enable : float
        0.5 or less: all switches are off.
    coil_current : float [A]
        Current of the coil at the start of the step.

    Outputs
    -------
    voltage : float [V]
        Coil voltage; on an edge, just before it.
    voltage_mean : float [V]
        Voltage that, held, takes the coil where the step takes it.
    current : float [A]
        Coil current as the stage has it.
    supply_current : float [A]
        Current of the supply.
    link_voltage : float [V]
        Capacitor of the DC link.
    boosted_voltage : float [V]
        Boost capacitor.
    leg_a : float, -1 to 1
        1: upper switch on, -1: lower one, 0: none.
    leg_b : float, -1 to 1
        Likewise, of the other end of the coil.
    path : float, -1 to 1
        Sign of the current that can flow; 0: none.
    coil_inductance : float [H]
        Differential inductance, learnt.
    edge : float [s]
        From the start of the step to the first edge inside, or else its end.
    supplied_energy : float [J]
        From the supply since the start.
    delivered_energy : float [J]
        To the coil since the start.
    dissipated_energy : float [J]
        Lost in the stage since the start.
    stored_energy : float [J]
        In inductances and capacitors of the stage.
    """

    def __init__(
        self,
        *,
        topology: str = ...,
        control_law: str = ...,
        control_chop: str = ...,
        control_restart: str = ...,
        control_frequency: float = ...,
        control_band: float = ...,
        peak_current: float = ...,
        peak_duration: float = ...,
        hold_current: float = ...,
        supply_voltage: float = ...,
        supply_resistance: float = ...,
        supply_inductance: float = ...,
        link_capacitance: float = ...,
        link_resistance: float = ...,
        cable_resistance: float = ...,
        cable_inductance: float = ...,
        switch_resistance: float = ...,
        switch_dead_time: float = ...,
        switch_minimum: float = ...,
        diode_voltage: float = ...,
        diode_resistance: float = ...,
        clamp_voltage: float = ...,
        clamp_resistance: float = ...,
        freewheel_resistance: float = ...,
        boost_capacitance: float = ...,
        boost_voltage: float = ...,
        boost_current: float = ...,
        boost_efficiency: float = ...,
        coil_resistance: float = ...,
        coil_inductance: float = ...,
        coil_conductance: float = ...,
        micro_step: float = ...,
        current_at: str = ...,
    ) -> None: ...
    def run(  # type: ignore[override]
        self,
        gate: npt.ArrayLike,
        gate_low: npt.ArrayLike,
        reference: npt.ArrayLike,
        enable: npt.ArrayLike,
        coil_current: npt.ArrayLike,
        *,
        sample_time: float | None = ...,
        start_time: float = ...,
        outputs: Iterable[str] = ...,
    ) -> PowerStageResponse: ...
    def step(  # type: ignore[override]
        self,
        gate: float,
        gate_low: float,
        reference: float,
        enable: float,
        coil_current: float,
        *,
        sample_time: float | None = ...,
    ) -> PowerStageOutputs: ...


class ReluctanceActuatorOutputs(NamedTuple):
    current: float
    position: float
    velocity: float
    flux_linkage: float
    inductance: float
    force: float
    mode: float
    contact: float
    core_field: float
    flux_density: float
    dissipated_energy: float
    eddy_energy: float
    hysteresis_energy: float
    stored_energy: float
    supplied_energy: float
    impact_speed: float

class ReluctanceActuatorResponse(Response):
    current: Floats
    position: Floats
    velocity: Floats
    flux_linkage: Floats
    inductance: Floats
    force: Floats
    mode: Floats
    contact: Floats
    core_field: Floats
    flux_density: Floats
    dissipated_energy: Floats
    eddy_energy: Floats
    hysteresis_energy: Floats
    stored_energy: Floats
    supplied_energy: Floats
    impact_speed: Floats

class ReluctanceActuator(Runnable):
    """
    Reluctance actuator with eddy currents, hysteresis, saturation, fringing, spring, damping, stops.

    Parameters
    ----------
    coil_resistance : float [Ohm], at least 1e-09, by default 48.0
        Resistance R.
    coil_turns : float, at least 1e-09, by default 1200.0
        Number of turns N.
    hysteresis : bool, by default True
        Hysteresis of the core; off: its anhysteretic curve.
    saturation : bool, by default True
        Saturation of the core; off: its slope is that at zero.
    eddy_currents : bool, by default True
        Eddy currents in the core.
    core_length : float [m], at least 1e-09, by default 0.055
        Length of the flux path l_c.
    core_area : float [m2], at least 1e-12, by default 1.26e-05
        Cross section A_c.
    core_magnetization : float [A/m], at least 1, by default 1450000.0
        Saturation magnetization M_sat.
    core_shape : float [A/m], at least 0.001, by default 1949.6
        Shape of the anhysteretic curve a = b/mu0.
    core_coupling : float, 0 to 0.9, by default 0.00366
        Coupling of the domains alpha.
    core_pinning : float [A/m], at least 0.001, by default 942.0
        Pinning of the walls kappa.
    core_reversibility : float, 0 to 0.999, by default 0.736
        Reversible share of the magnetization c.
    core_eddy_conductance : float [S], at least 0, by default 1630.0
        Eddy current per rate of flux, k_eddy.
    gap_law : str, one of fringing, table, by default 'fringing'
        Reluctance of the gap: fringing, table.
    gap_reluctance : float [1/H], at least 0, by default 0.0
        Fringing law: reluctance without gap, R_g0.
    gap_slope : float [1/(H.m)], at least 0, by default 47000000000.0
        Fringing law: reluctance per gap without fringing, R_gp.
    gap_fringing : float [1/m], at least 0, by default 300.0
        Fringing law: strength k_f.
    gap_window : float [m], at least 1e-09, by default 0.00973
        Fringing law: reach c_f; no fringing in larger gaps.
    gap_file : str, by default 'fringing_29.csv'
        Table: CSV file with the columns gap [m], reluctance [1/H], both rising; interpolated by a cubic spline.
    mover_mass : float [kg], at least 1e-09, by default 0.0016
        Mass of the mover m.
    spring_stiffness : float [N/m], at least 0, by default 61.8
        Stiffness k_sp.
    spring_rest : float [m], by default 0.0192
        Gap without spring force, z_sp.
    damping : float [N.s/m], at least 0, by default 0.8
        Viscous damping c_f.
    friction : float [N], at least 0, by default 0.0
        Dry friction, at rest and in motion.
    stop_lower : float [m], at least 0, by default 0.0004
        Smallest gap z_min.
    stop_upper : float [m], at least 1e-09, by default 0.0014
        Largest gap z_max.
    stop_restitution : float, 0 to 0.95, by default 0.0
        Speed after an impact over that before it.
    initial_position : float [m], at least 0, by default 0.0014
        Gap at the start.
    micro_step : float [s], at least 1e-07, by default 1e-05
        Longest step of the integrator.

    Inputs of run and step
    ----------------------
    voltage : float [V]
        Coil voltage, held during the step.

    Outputs
    -------
    current : float [A]
        Coil current; at a jump of the voltage, that before it.
    position : float [m]
        Gap: the smallest is closed.
    velocity : float [m/s]
        Rate of the gap.
    flux_linkage : float [Wb]
        Flux linkage.
    inductance : float [H]
        Flux linkage / current, limited to 10 times that of the demagnetized coil.
    force : float [N]
        Magnetic force; negative: it closes the gap.
    mode : float, 1 to 3
        1: at the lower stop, 2: moving, 3: at the upper stop.
    contact : float, 0 to 1
        1 on a stop, else 0.
    core_field : float [A/m]
        Magnetic field strength in the core, H_c.
    flux_density : float [T]
        Flux density in the core, B_c.
    dissipated_energy : float [J]
        Lost in coil, core, damping and impacts since the start.
    eddy_energy : float [J]
        Part of it lost to eddy currents.
    hysteresis_energy : float [J]
        Part of it lost to hysteresis.
    stored_energy : float [J]
        Magnetic, elastic and kinetic energy.
    supplied_energy : float [J]
        Integral of voltage times current since the start.
    impact_speed : float [m/s]
        Hardest impact since the mover last left its rest.
    """

    def __init__(
        self,
        *,
        coil_resistance: float = ...,
        coil_turns: float = ...,
        hysteresis: bool = ...,
        saturation: bool = ...,
        eddy_currents: bool = ...,
        core_length: float = ...,
        core_area: float = ...,
        core_magnetization: float = ...,
        core_shape: float = ...,
        core_coupling: float = ...,
        core_pinning: float = ...,
        core_reversibility: float = ...,
        core_eddy_conductance: float = ...,
        gap_law: str = ...,
        gap_reluctance: float = ...,
        gap_slope: float = ...,
        gap_fringing: float = ...,
        gap_window: float = ...,
        gap_file: str = ...,
        mover_mass: float = ...,
        spring_stiffness: float = ...,
        spring_rest: float = ...,
        damping: float = ...,
        friction: float = ...,
        stop_lower: float = ...,
        stop_upper: float = ...,
        stop_restitution: float = ...,
        initial_position: float = ...,
        micro_step: float = ...,
    ) -> None: ...
    def run(  # type: ignore[override]
        self,
        voltage: npt.ArrayLike,
        *,
        sample_time: float | None = ...,
        start_time: float = ...,
        outputs: Iterable[str] = ...,
    ) -> ReluctanceActuatorResponse: ...
    def step(  # type: ignore[override]
        self,
        voltage: float,
        *,
        sample_time: float | None = ...,
    ) -> ReluctanceActuatorOutputs: ...


class RunToRunOutputs(NamedTuple):
    voltage_reference: float
    flux_reference: float
    flux_linkage: float
    resistance: float
    approach_speed: float
    balance_flux: float
    cycle: float
    state: float
    warnings: float

class RunToRunResponse(Response):
    voltage_reference: Floats
    flux_reference: Floats
    flux_linkage: Floats
    resistance: Floats
    approach_speed: Floats
    balance_flux: Floats
    cycle: Floats
    state: Floats
    warnings: Floats

class RunToRun(Runnable):
    """
    Soft landing from cycle to cycle: a flux linkage that the voltage follows, learnt from each operation.

    Parameters
    ----------
    sample_time : float [s], at least 1e-09, by default 2e-05
        Sampling period; the communication step is a whole multiple or a whole fraction of it.
    law : str, one of contact, model, by default 'contact'
        What it learns from: contact, model.
    coil_resistance : float [Ohm], at least 1e-09, by default 48.0
        Resistance R.
    coil_turns : float, at least 1e-09, by default 1200.0
        Number of turns N.
    mover_mass : float [kg], at least 1e-09, by default 0.0016
        Mass of the mover m.
    spring_stiffness : float [N/m], at least 0, by default 61.8
        Stiffness k_sp.
    spring_rest : float [m], by default 0.0192
        Position without spring force z_sp.
    damping : float [N.s/m], at least 0, by default 0.8
        Viscous damping c_f.
    stop_lower : float [m], at least 0, by default 0.0004
        Smallest position z_min.
    stop_upper : float [m], at least 1e-09, by default 0.0014
        Largest position z_max.
    core_reluctance : float [1/H], at least 1e-09, by default 2520000.0
        Reluctance of the core without flux, N^2 R_c0*.
    gap_law : str, one of fringing, table, by default 'fringing'
        Reluctance of the gap: fringing, table.
    gap_reluctance : float [1/H], by default 0.0
        Fringing law: reluctance of the closed gap R_g0.
    gap_slope : float [1/(H.m)], at least 0, by default 47000000000.0
        Fringing law: reluctance per gap without fringing.
    gap_fringing : float [1/m], at least 0, by default 300.0
        Fringing law: strength k_f; 0: none.
    gap_window : float [m], at least 1e-05, by default 0.00973
        Fringing law: length along which the flux fringes c_f.
    gap_file : str, by default 'fringing_29.csv'
        Table: CSV file with the columns gap [m], reluctance [1/H], both rising; interpolated by a cubic spline.
    gap_factor : float, at least 1e-09, by default 1.0
        Factor of the gap reluctance.
    gap_bend : float, by default 0.0
        Bend of the gap law, zero at both stops.
    voltage_least : float [V], by default -30.0
        Least mean voltage of the bridge; 0: half bridge.
    voltage_most : float [V], at least 1e-09, by default 30.0
        Largest mean voltage of the bridge.
    voltage_hold : float [V], at least 1e-09, by default 24.0
        Of an ordinary closing, and after a soft one.
    closing_lead : float [s], at least 1e-09, by default 0.0015
        From the command until the mover is to take off.
    closing_travel : float [s], at least 1e-09, by default 0.0034
        Then until it is near the other stop, in the first cycle.
    opening_lead : float [s], at least 1e-09, by default 0.0012
        From the command until the mover is to take off.
    opening_travel : float [s], at least 1e-09, by default 0.0034
        Then until it is near the other stop, in the first cycle.
    approach_time : float [s], at least 0, by default 0.0035
        Then for so long it is expected to land.
    approach_distance : float [m], at least 0, by default 8e-05
        Distance from the stop at which the approach begins.
    approach_first : float [m/s], at least 1e-09, by default 0.4
        Speed of the first approaches.
    approach_least : float [m/s], at least 1e-09, by default 0.08
        Speed of the slowest ones.

    Inputs of run and step
    ----------------------
    enable : float
        0.5 or less when a closing begins: the cycle is an ordinary one.
    command : float
        Above 0.5: closed.
    voltage : float [V]
        Mean voltage since the last sample.
    current : float [A]
        Measured coil current.
    mode : float, 0 to 3
        Law contact: 1 at the lower stop, 2 moving, 3 at the upper stop; 0: not known.
    impact_speed : float [m/s], at least 0, optional
        Law contact: speed of the landing, of the operation that ends.
    estimated_flux_linkage : float [Wb], optional
        Law model: `flux_linkage` of `Mhe`.
    windows : float, optional
        Law model: `windows` of `Mhe`.
    misfit : float, optional
        Law model: `misfit` of `Mhe`.
    landing_time : float [s], optional
        Law model: `landing_time` of `Mhe`.
    estimated_impact_speed : float [m/s], optional
        Law model: `impact_speed` of `Mhe`.
    smoothed_published : float, optional
        Law model: `smoothed_published` of `Mhe`.
    smoothed_time : float [s], optional
        Law model: `smoothed_time` of `Mhe`.
    smoothed_flux_linkage : float [Wb], optional
        Law model: `smoothed_flux_linkage` of `Mhe`.
    estimated_resistance : float [Ohm], optional
        Law model: `resistance` of `Mhe`.
    estimated_mass : float [kg], optional
        Law model: `mass` of `Mhe`.
    estimated_rest_position : float [m], optional
        Law model: `rest_position` of `Mhe`.
    estimated_viscous_damping : float [N.s/m], optional
        Law model: `viscous_damping` of `Mhe`.
    estimated_gap_factor : float, optional
        Law model: `gap_factor` of `Mhe`.
    estimated_gap_bend : float, optional
        Law model: `gap_bend` of `Mhe`.
    estimated_voltage_offset : float [V], optional
        Law model: `voltage_offset` of `Mhe`.

    Outputs
    -------
    voltage_reference : float [V]
        Mean voltage that is to be until the next sample.
    flux_reference : float [Wb]
        Flux linkage at the next sample; 0: no profile.
    flux_linkage : float [Wb]
        By the integral of u - R i.
    resistance : float [Ohm]
        Resistance R in use.
    approach_speed : float [m/s], at least 0
        Speed that this operation is to land with.
    balance_flux : float [Wb]
        Flux linkage that balances the spring where this operation begins.
    cycle : float, at least 0
        Cycles begun so far.
    state : float, 0 to 5
        0: no command yet, 1: first cycles, ordinary, 2: soft, 3: soft, but the last operation that was judged did not arrive in time, 4: ordinary cycle after that, 5: ordinary, as ordinary closings leave the mover open.
    warnings : float, 0 to 1023
        Of this cycle and the last one, a sum of 1: contact silent in an ordinary operation, 2: profile faster than the voltage allows, 4: voltage used up by the resistance, 8: estimator has explained no window, 16: a reading lost or wild, 32: the reading of the voltage has an offset, 64: a soft operation landed hard, 128: an operation landed hard or not at all, and the next ones are ordinary, 256: the current is too noisy for what a contact teaches, 512: an ordinary closing has left the mover open.
    """

    def __init__(
        self,
        *,
        sample_time: float = ...,
        law: str = ...,
        coil_resistance: float = ...,
        coil_turns: float = ...,
        mover_mass: float = ...,
        spring_stiffness: float = ...,
        spring_rest: float = ...,
        damping: float = ...,
        stop_lower: float = ...,
        stop_upper: float = ...,
        core_reluctance: float = ...,
        gap_law: str = ...,
        gap_reluctance: float = ...,
        gap_slope: float = ...,
        gap_fringing: float = ...,
        gap_window: float = ...,
        gap_file: str = ...,
        gap_factor: float = ...,
        gap_bend: float = ...,
        voltage_least: float = ...,
        voltage_most: float = ...,
        voltage_hold: float = ...,
        closing_lead: float = ...,
        closing_travel: float = ...,
        opening_lead: float = ...,
        opening_travel: float = ...,
        approach_time: float = ...,
        approach_distance: float = ...,
        approach_first: float = ...,
        approach_least: float = ...,
    ) -> None: ...
    def run(  # type: ignore[override]
        self,
        enable: npt.ArrayLike,
        command: npt.ArrayLike,
        voltage: npt.ArrayLike,
        current: npt.ArrayLike,
        mode: npt.ArrayLike,
        impact_speed: npt.ArrayLike = ...,
        estimated_flux_linkage: npt.ArrayLike = ...,
        windows: npt.ArrayLike = ...,
        misfit: npt.ArrayLike = ...,
        landing_time: npt.ArrayLike = ...,
        estimated_impact_speed: npt.ArrayLike = ...,
        smoothed_published: npt.ArrayLike = ...,
        smoothed_time: npt.ArrayLike = ...,
        smoothed_flux_linkage: npt.ArrayLike = ...,
        estimated_resistance: npt.ArrayLike = ...,
        estimated_mass: npt.ArrayLike = ...,
        estimated_rest_position: npt.ArrayLike = ...,
        estimated_viscous_damping: npt.ArrayLike = ...,
        estimated_gap_factor: npt.ArrayLike = ...,
        estimated_gap_bend: npt.ArrayLike = ...,
        estimated_voltage_offset: npt.ArrayLike = ...,
        *,
        sample_time: float | None = ...,
        start_time: float = ...,
        outputs: Iterable[str] = ...,
    ) -> RunToRunResponse: ...
    def step(  # type: ignore[override]
        self,
        enable: float,
        command: float,
        voltage: float,
        current: float,
        mode: float,
        impact_speed: float = ...,
        estimated_flux_linkage: float = ...,
        windows: float = ...,
        misfit: float = ...,
        landing_time: float = ...,
        estimated_impact_speed: float = ...,
        smoothed_published: float = ...,
        smoothed_time: float = ...,
        smoothed_flux_linkage: float = ...,
        estimated_resistance: float = ...,
        estimated_mass: float = ...,
        estimated_rest_position: float = ...,
        estimated_viscous_damping: float = ...,
        estimated_gap_factor: float = ...,
        estimated_gap_bend: float = ...,
        estimated_voltage_offset: float = ...,
        *,
        sample_time: float | None = ...,
    ) -> RunToRunOutputs: ...


class SemeraOutputs(NamedTuple):
    resistance: float
    inductance: float
    flux_linkage: float
    quality: float
    resistance_std: float
    inductance_std: float
    innovation: float
    innovation_std: float
    flux: float
    reluctance: float
    health: float
    health_causes: float

class SemeraResponse(Response):
    resistance: Floats
    inductance: Floats
    flux_linkage: Floats
    quality: Floats
    resistance_std: Floats
    inductance_std: Floats
    innovation: Floats
    innovation_std: Floats
    flux: Floats
    reluctance: Floats
    health: Floats
    health_causes: Floats

class Semera(Runnable):
    """
    SEMERA: resistance, inductance and flux linkage from the coil's voltage and current.

    Parameters
    ----------
    sample_time : float [s], at least 1e-09, by default 5e-05
        Sampling period; the communication step is a whole multiple or a whole fraction of it.
    prior_resistance : float [Ohm], at least 1e-09, by default 77.5
        Expected resistance at the start.
    prior_resistance_std : float [Ohm], at least 0, by default 1.0
        Its standard deviation.
    prior_inductance : float [H], at least 0, by default 0.05
        Expected inductance at rest.
    prior_inductance_std : float [H], at least 0, by default 0.005
        Its standard deviation.
    process_resistance_rate : float [Ohm/s], at least 0, by default 1.0
        Standard deviation of the resistance's rate.
    process_inductance_acceleration : float [H/s2], at least 0, by default 100000000.0
        Standard deviation of d2l/dt2.
    noise_voltage : float [V], at least 0, by default 0.015
        Standard deviation of the voltage noise.
    noise_current : float [A], at least 0, by default 0.001
        Standard deviation of the current noise.
    gate_sigmas : float, at least 0, by default 3.29
        Half width of the noise band, in standard deviations (3.29: 99.9 %).
    gate_update : bool, by default True
        Noise-only samples update the filter while it sleeps, too.
    gate_decay : float [s], at least 0, by default 0.005
        Time after an operation until the filter falls asleep and learns no more from noise; 0: never, as printed.
    range_voltage : float [V], at least 1e-09, by default 100.0
        A reading beyond plus or minus this counts as lost.
    range_current : float [A], at least 0, by default 0.0
        A reading beyond plus or minus this counts as lost; 0: twice what range.voltage drives.
    coil_turns : float, at least 0, by default 0.0
        Number of turns, for flux and reluctance; 0: unknown.

    Inputs of run and step
    ----------------------
    voltage : float [V]
        Measured coil voltage; NaN where it was lost.
    current : float [A]
        Measured coil current; NaN where it was lost.

    Outputs
    -------
    resistance : float [Ohm]
        Estimated coil resistance.
    inductance : float [H]
        Estimated apparent inductance.
    flux_linkage : float [Wb]
        Estimated flux linkage.
    quality : float, 0 to 1
        1: current outside the noise band; 0: estimates follow the expert rule.
    resistance_std : float [Ohm], at least 0
        Standard deviation of the resistance in the filter.
    inductance_std : float [H]
        Standard deviation of the inductance in the filter.
    innovation : float [V]
        Measured minus predicted voltage.
    innovation_std : float [V]
        Standard deviation expected of the innovation.
    flux : float [Wb]
        Estimated flux; 0 while coil.turns is 0.
    reluctance : float [1/H]
        Estimated reluctance; 0 while coil.turns is 0.
    health : float, 0 to 1
        1: to be trusted as far as the filter can tell; 0: not.
    health_causes : float, 0 to 4095
        Why not, a sum of 1: innovations larger than expected, 2: current error larger than expected, 4: flux linkage beyond saturation, 8: position held at a bound for long, 16: a reading lost or wild, 32: covariance lost, restarted, 64: no motion after a command, 128: device far from the one told, 256: noise or switching larger than told, 512: first impact perhaps missed by the contact, 1024: device not learnt yet, operate it twice, 2048: what was learnt keeps changing.
    """

    def __init__(
        self,
        *,
        sample_time: float = ...,
        prior_resistance: float = ...,
        prior_resistance_std: float = ...,
        prior_inductance: float = ...,
        prior_inductance_std: float = ...,
        process_resistance_rate: float = ...,
        process_inductance_acceleration: float = ...,
        noise_voltage: float = ...,
        noise_current: float = ...,
        gate_sigmas: float = ...,
        gate_update: bool = ...,
        gate_decay: float = ...,
        range_voltage: float = ...,
        range_current: float = ...,
        coil_turns: float = ...,
    ) -> None: ...
    def run(  # type: ignore[override]
        self,
        voltage: npt.ArrayLike,
        current: npt.ArrayLike,
        *,
        sample_time: float | None = ...,
        start_time: float = ...,
        outputs: Iterable[str] = ...,
    ) -> SemeraResponse: ...
    def step(  # type: ignore[override]
        self,
        voltage: float,
        current: float,
        *,
        sample_time: float | None = ...,
    ) -> SemeraOutputs: ...


class SensorOutputs(NamedTuple):
    voltage_measured: float
    current_measured: float
    mode_measured: float
    dropout: float

class SensorResponse(Response):
    voltage_measured: Floats
    current_measured: Floats
    mode_measured: Floats
    dropout: Floats

class Sensor(Runnable):
    """
    Sensor chain: errors, noise, saturation, quantisation, sample and hold, dropouts; contact detection.

    Parameters
    ----------
    sample_time : float [s], at least 1e-09, by default 5e-05
        Sampling period; the communication step is a whole multiple or a whole fraction of it.
    seed : int, 0 to 2.14748e+09, by default 1
        Seed of the random numbers: the same seed gives the same bits.
    gain_error_voltage : float, by default 0.0
        Relative: 0.01 reads 1 % too much.
    gain_error_current : float, by default 0.0
        Relative: 0.01 reads 1 % too much.
    offset_voltage : float [V], by default 0.0
        Reading at 0 V.
    offset_current : float [A], by default 0.0
        Reading at 0 A.
    noise_voltage : float [V], at least 0, by default 0.015
        Standard deviation of the voltage noise.
    noise_current : float [A], at least 0, by default 0.001
        Standard deviation of the current noise.
    resolution_voltage : float [V], at least 0, by default 0.0
        Step of the converter; 0: none.
    resolution_current : float [A], at least 0, by default 0.0
        Step of the converter; 0: none.
    range_voltage : float [V], at least 0, by default 0.0
        Readings saturate at plus and minus this; 0: never.
    range_current : float [A], at least 0, by default 0.0
        Readings saturate at plus and minus this; 0: never.
    dropout_probability : float, 0 to 1, by default 0.0
        Probability that a sample is lost.
    contact_source : str, one of mode, position, by default 'mode'
        Where the measured mode comes from: mode, position.
    contact_lower : float [m], by default 5e-05
        Lower stop below this position.
    contact_upper : float [m], by default 0.00085
        Upper stop above this position.
    contact_hysteresis : float [m], at least 0, by default 1e-05
        Way back past a threshold before the contact opens.
    contact_bounce : float, at least 0, by default 0.0
        Samples for which a contact opens again after it has closed.

    Inputs of run and step
    ----------------------
    voltage : float [V]
        True coil voltage.
    current : float [A]
        True coil current.
    position : float [m]
        True position.
    mode : float, 0 to 3
        True mode: 1 lower stop, 2 moving, 3 upper stop; 0, not known, counts as moving; others are refused.

    Outputs
    -------
    voltage_measured : float [V]
        Measured voltage.
    current_measured : float [A]
        Measured current.
    mode_measured : float, 1 to 3
        Measured mode.
    dropout : float, 0 to 1
        1: this sample was lost, and the outputs hold the one before.
    """

    def __init__(
        self,
        *,
        sample_time: float = ...,
        seed: int = ...,
        gain_error_voltage: float = ...,
        gain_error_current: float = ...,
        offset_voltage: float = ...,
        offset_current: float = ...,
        noise_voltage: float = ...,
        noise_current: float = ...,
        resolution_voltage: float = ...,
        resolution_current: float = ...,
        range_voltage: float = ...,
        range_current: float = ...,
        dropout_probability: float = ...,
        contact_source: str = ...,
        contact_lower: float = ...,
        contact_upper: float = ...,
        contact_hysteresis: float = ...,
        contact_bounce: float = ...,
    ) -> None: ...
    def run(  # type: ignore[override]
        self,
        voltage: npt.ArrayLike,
        current: npt.ArrayLike,
        position: npt.ArrayLike,
        mode: npt.ArrayLike,
        *,
        sample_time: float | None = ...,
        start_time: float = ...,
        outputs: Iterable[str] = ...,
    ) -> SensorResponse: ...
    def step(  # type: ignore[override]
        self,
        voltage: float,
        current: float,
        position: float,
        mode: float,
        *,
        sample_time: float | None = ...,
    ) -> SensorOutputs: ...


class SolenoidValveOutputs(NamedTuple):
    current: float
    position: float
    velocity: float
    flux_linkage: float
    inductance: float
    force: float
    mode: float
    contact: float
    dissipated_energy: float
    stored_energy: float
    supplied_energy: float
    impact_speed: float

class SolenoidValveResponse(Response):
    current: Floats
    position: Floats
    velocity: Floats
    flux_linkage: Floats
    inductance: Floats
    force: Floats
    mode: Floats
    contact: Floats
    dissipated_energy: Floats
    stored_energy: Floats
    supplied_energy: Floats
    impact_speed: Floats

class SolenoidValve(Runnable):
    """
    Solenoid valve with magnetic saturation, spring, damping and stops.

    Parameters
    ----------
    coil_resistance : float [Ohm], at least 1e-09, by default 76.0
        Resistance r.
    coil_turns : float, at least 1e-09, by default 1200.0
        Number of turns N.
    gap_law : str, one of linear, fringing, table, by default 'linear'
        Reluctance of the gap: linear, fringing, table.
    gap_slope : float [1/(H.m)], at least 0, by default 27000000000.0
        Linear law: reluctance per gap, k_air.
    gap_area : float [m2], at least 1e-12, by default 1.75e-05
        Fringing law: pole area A.
    gap_window : float [m], at least 1e-09, by default 0.01
        Fringing law: height of the winding window G.
    gap_file : str, by default 'fringing_19.csv'
        Table: CSV file with the columns gap [m], reluctance [1/H], slope [1/(H.m)].
    core_reluctance : float [1/H], at least 1e-09, by default 3250000.0
        Reluctance of the core without flux, R_iron0.
    core_saturation : float [Wb], at least 1e-12, by default 0.024
        Flux linkage of saturation, lambda_sat.
    mover_mass : float [kg], at least 1e-09, by default 0.0016
        Mass of the mover m.
    spring_stiffness : float [N/m], at least 0, by default 37.0
        Stiffness k_s.
    spring_rest : float [m], by default 0.0225
        Gap without spring force, h_s.
    damping : float [N.s/m], at least 0, by default 0.4
        Viscous damping c.
    stop_lower : float [m], at least 0, by default 0.0
        Smallest gap h_min.
    stop_upper : float [m], at least 1e-09, by default 0.0009
        Largest gap h_max.
    stop_restitution : float, 0 to 0.95, by default 0.0
        Speed after an impact over that before it.
    initial_position : float [m], at least 0, by default 0.0009
        Gap at the start.
    micro_step : float [s], at least 1e-07, by default 1.25e-05
        Longest step of the integrator.

    Inputs of run and step
    ----------------------
    voltage : float [V]
        Coil voltage, held during the step.

    Outputs
    -------
    current : float [A]
        Coil current.
    position : float [m]
        Gap: 0 is closed.
    velocity : float [m/s]
        Rate of the gap.
    flux_linkage : float [Wb]
        Flux linkage.
    inductance : float [H]
        Apparent inductance, flux linkage / current.
    force : float [N]
        Magnetic force; negative: it closes the gap.
    mode : float, 1 to 3
        1: at the lower stop, 2: moving, 3: at the upper stop.
    contact : float, 0 to 1
        1 on a stop, else 0.
    dissipated_energy : float [J]
        Lost in the coil, the damping and the impacts since the start.
    stored_energy : float [J]
        Magnetic, elastic and kinetic energy.
    supplied_energy : float [J]
        Integral of voltage times current since the start.
    impact_speed : float [m/s]
        Hardest impact since the mover last left its rest.
    """

    def __init__(
        self,
        *,
        coil_resistance: float = ...,
        coil_turns: float = ...,
        gap_law: str = ...,
        gap_slope: float = ...,
        gap_area: float = ...,
        gap_window: float = ...,
        gap_file: str = ...,
        core_reluctance: float = ...,
        core_saturation: float = ...,
        mover_mass: float = ...,
        spring_stiffness: float = ...,
        spring_rest: float = ...,
        damping: float = ...,
        stop_lower: float = ...,
        stop_upper: float = ...,
        stop_restitution: float = ...,
        initial_position: float = ...,
        micro_step: float = ...,
    ) -> None: ...
    def run(  # type: ignore[override]
        self,
        voltage: npt.ArrayLike,
        *,
        sample_time: float | None = ...,
        start_time: float = ...,
        outputs: Iterable[str] = ...,
    ) -> SolenoidValveResponse: ...
    def step(  # type: ignore[override]
        self,
        voltage: float,
        *,
        sample_time: float | None = ...,
    ) -> SolenoidValveOutputs: ...


class TableActuatorOutputs(NamedTuple):
    current: float
    position: float
    velocity: float
    flux_linkage: float
    inductance: float
    force: float
    spring_force: float
    mode: float
    contact: float
    dissipated_energy: float
    eddy_energy: float
    hysteresis_energy: float
    stored_energy: float
    supplied_energy: float
    impact_speed: float

class TableActuatorResponse(Response):
    current: Floats
    position: Floats
    velocity: Floats
    flux_linkage: Floats
    inductance: Floats
    force: Floats
    spring_force: Floats
    mode: Floats
    contact: Floats
    dissipated_energy: Floats
    eddy_energy: Floats
    hysteresis_energy: Floats
    stored_energy: Floats
    supplied_energy: Floats
    impact_speed: Floats

class TableActuator(Runnable):
    """
    Actuator from a table of current over gap and flux linkage, with eddy currents, hysteresis and stops.

    Parameters
    ----------
    coil_resistance : float [Ohm], at least 1e-09, by default 48.0
        Resistance R.
    coil_turns : float, at least 1e-09, by default 1200.0
        Number of turns N.
    map_file : str, by default 'map.csv'
        CSV file with the columns gap [m], flux_linkage [Wb], current [A]: for each gap, from the smallest on, the static current at the same flux linkages, from 0 on.
    eddy_currents : bool, by default True
        Eddy currents in the core.
    core_eddy_conductance : float [S], at least 0, by default 1630.0
        Eddy current per rate of flux, k_eddy.
    hysteresis : bool, by default False
        Hysteresis of the core, besides the table, which has none.
    core_length : float [m], at least 1e-09, by default 0.055
        Length of the flux path l_c.
    core_area : float [m2], at least 1e-12, by default 1.26e-05
        Cross section A_c.
    core_magnetization : float [A/m], at least 1, by default 1450000.0
        Saturation magnetization M_sat.
    core_shape : float [A/m], at least 0.001, by default 1949.6
        Shape of the anhysteretic curve a = b/mu0.
    core_coupling : float, 0 to 0.9, by default 0.00366
        Coupling of the domains alpha.
    core_pinning : float [A/m], at least 0.001, by default 942.0
        Pinning of the walls kappa.
    core_reversibility : float, 0 to 0.999, by default 0.736
        Reversible share of the magnetization c.
    mover_mass : float [kg], at least 1e-09, by default 0.0016
        Mass of the mover m.
    mover_load : float [kg], at least 0, by default 0.0
        Mass of the load that moves with it.
    gravity : float [m/s2], by default 0.0
        Acceleration of gravity along the gap; positive: it opens the gap.
    spring_law : str, one of linear, table, by default 'linear'
        Force of the spring: linear, table.
    spring_stiffness : float [N/m], at least 0, by default 61.8
        Stiffness k_sp.
    spring_rest : float [m], by default 0.0192
        Gap without spring force, z_sp.
    spring_preload : float [N], by default 0.0
        Constant force besides the spring; positive: it opens the gap.
    spring_file : str, by default 'spring.csv'
        Table: CSV file with the columns gap [m], force [N], positive: it opens the gap; straight between the rows.
    damping : float [N.s/m], at least 0, by default 0.8
        Viscous damping c_f.
    friction : float [N], at least 0, by default 0.0
        Dry friction; what is less holds the mover, wherever it is.
    stop_lower : float [m], at least 0, by default 0.0004
        Smallest gap z_min.
    stop_upper : float [m], at least 1e-09, by default 0.0014
        Largest gap z_max.
    stop_law : str, one of hard, elastic, by default 'hard'
        Stops: hard, elastic.
    stop_restitution : float, 0 to 0.95, by default 0.0
        Hard: speed after an impact over that before it.
    stop_stiffness : float [N/m], at least 0.001, by default 1000000.0
        Elastic: force by depth.
    stop_damping : float [s/m], at least 0, by default 0.5
        Elastic: share by which it is larger, by speed inwards.
    initial_position : float [m], at least 0, by default 0.0014
        Gap at the start.
    micro_step : float [s], at least 1e-07, by default 1e-05
        Longest step of the integrator.

    Inputs of run and step
    ----------------------
    voltage : float [V]
        Coil voltage, held during the step.

    Outputs
    -------
    current : float [A]
        Coil current; at a jump of the voltage, that before it.
    position : float [m]
        Gap: the smallest is closed.
    velocity : float [m/s]
        Rate of the gap.
    flux_linkage : float [Wb]
        Flux linkage.
    inductance : float [H]
        Flux linkage / static current, of the table.
    force : float [N]
        Magnetic force; negative: it closes the gap.
    spring_force : float [N]
        Force of spring, preload and gravity; positive: it opens the gap.
    mode : float, 1 to 3
        1: at the lower stop, 2: moving, 3: at the upper stop.
    contact : float, 0 to 1
        1 on a stop, else 0.
    dissipated_energy : float [J]
        Lost in coil, core, damping, friction and impacts since the start.
    eddy_energy : float [J]
        Part of it lost to eddy currents.
    hysteresis_energy : float [J]
        Part of it lost to hysteresis.
    stored_energy : float [J]
        Magnetic, elastic, kinetic energy, and that of height.
    supplied_energy : float [J]
        Integral of voltage times current since the start.
    impact_speed : float [m/s]
        Hardest impact on the stop since the mover came to it.
    """

    def __init__(
        self,
        *,
        coil_resistance: float = ...,
        coil_turns: float = ...,
        map_file: str = ...,
        eddy_currents: bool = ...,
        core_eddy_conductance: float = ...,
        hysteresis: bool = ...,
        core_length: float = ...,
        core_area: float = ...,
        core_magnetization: float = ...,
        core_shape: float = ...,
        core_coupling: float = ...,
        core_pinning: float = ...,
        core_reversibility: float = ...,
        mover_mass: float = ...,
        mover_load: float = ...,
        gravity: float = ...,
        spring_law: str = ...,
        spring_stiffness: float = ...,
        spring_rest: float = ...,
        spring_preload: float = ...,
        spring_file: str = ...,
        damping: float = ...,
        friction: float = ...,
        stop_lower: float = ...,
        stop_upper: float = ...,
        stop_law: str = ...,
        stop_restitution: float = ...,
        stop_stiffness: float = ...,
        stop_damping: float = ...,
        initial_position: float = ...,
        micro_step: float = ...,
    ) -> None: ...
    def run(  # type: ignore[override]
        self,
        voltage: npt.ArrayLike,
        *,
        sample_time: float | None = ...,
        start_time: float = ...,
        outputs: Iterable[str] = ...,
    ) -> TableActuatorResponse: ...
    def step(  # type: ignore[override]
        self,
        voltage: float,
        *,
        sample_time: float | None = ...,
    ) -> TableActuatorOutputs: ...

