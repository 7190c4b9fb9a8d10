"""Parameters of `Mhe`."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from gapsense.estimators.reduced_model import GapLaw
from gapsense.kernels.layout import Array, Scalar, Table


class Parameters(NamedTuple):
    """The actuator as a user knows it, how well, and the tuning."""

    sample_time: Scalar  # T_s [s]
    coil_resistance: Scalar  # R [ohm]
    coil_turns: Scalar  # N [1]
    mover_mass: Scalar  # m [kg]
    spring_stiffness: Scalar  # k_sp [N/m]
    spring_rest: Scalar  # z_sp [m]
    damping: Scalar  # c_f [N s/m]
    stop_lower: Scalar  # z_min [m]
    stop_upper: Scalar  # z_max [m]
    core_reluctance: Scalar  # R_c0 [1/H]
    core_saturation: Scalar  # lambda_sat [Wb]
    core_bend: Scalar  # K: b = K lambda_sat / N^2 [1/H]; 0: the core is that of Froehlich and Kennelly
    core_eddy: Scalar  # g_e [S]
    core_hysteresis: Scalar  # I_h [A]
    core_turnover: Scalar  # l_h [Wb]
    gap_law: Annotated[Scalar, GapLaw]
    gap_reluctance: Scalar  # R_g0 [1/H]
    gap_slope: Scalar  # R_g0' [1/(H m)]
    gap_fringing: Scalar  # k_f [1/m]
    gap_window: Scalar  # c_f [m]
    gap_file_gap: Annotated[Array, Table()]  # increasing [m]
    gap_file_reluctance: Annotated[Array, Table()]  # increasing [1/H]
    gap_file_spline: Annotated[Array, Table()]  # second derivative of its spline [1/(H m^2)]
    gap_factor: Scalar  # of R_g [1]
    gap_bend: Scalar  # added to it between the stops [1]
    option_further: Scalar  # 1: damping, core reluctance and bend are learnt too
    option_command: Scalar  # 1: a window ends when the input `command` changes
    option_zero: Scalar  # 1: the current that is left after a long time without voltage is the sensor's offset
    option_mean: Scalar  # 1: the voltage is the mean since the last sample
    noise_voltage: Scalar  # sigma_v [V]
    noise_current: Scalar  # sigma_i [A]
    model_error: Scalar  # of the current, the same over `SAME` samples [A]
    edge: Scalar  # jump of the voltage beyond which a sample's current does not count [V]
    window_tail: Scalar  # at rest after a landing until the window ends [s]
    window_longest: Scalar  # [s]
    window_pace: Scalar  # pieces of a pass that a step may take; 0: as many as the sample time allows
    publish_within: Scalar  # age of a sample beyond which it is not published; 0: all are [s]
    prior_resistance: Scalar  # relative standard deviations before the first window
    prior_eddy: Scalar
    prior_gap: Scalar
    prior_knee: Scalar
    prior_saturation: Scalar
    prior_hysteresis: Scalar
    prior_mass: Scalar
    prior_rest: Scalar
    prior_damping: Scalar  # with `option_further`
    prior_core: Scalar  # the same; standard deviation [1/H]
    prior_bend: Scalar  # the same [1]
    range_voltage: Scalar  # a reading beyond counts as lost [V]
    range_current: Scalar  # [A]
    health_limit: Scalar  # largest misfit [1]
