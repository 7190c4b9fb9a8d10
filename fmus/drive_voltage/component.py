"""Port table of the drive-voltage generator."""

from gapsense.fmi.ports import Component, choice, fixed, input_, output, parameter, table

WAVEFORMS = ("square", "step", "table", "pwm", "profile", "soft_landing", "bridge")

COMPONENT = Component(
    name="DriveVoltage",
    description="Drive voltage: square wave, step, table from a CSV file, PWM, pulse profile, soft landing, bridge",
    kernel="gapsense.drive.drive_voltage",
    resources=("voltage.csv", "soft_landing.csv"),
    rising=(("pwm.low", "pwm.high"),),
    ports=(
        input_("enable", "1", "0.5 or less: both outputs are 0 V", start=1.0),
        input_("reference", "V", "Mean voltage that PWM or bridge gives, held during the step", nominal=30.0),
        output(
            "voltage",
            "V",
            "At the end of the step; on an edge, just before it",
            nominal=30.0,
            feedthrough=("enable", "reference"),
        ),
        output("voltage_mean", "V", "Mean over the step, exact", nominal=30.0, feedthrough=("enable", "reference")),
        choice(
            "waveform", "What is generated", ("square", "step", "table", "pwm", "profile", "soft_landing", "bridge")
        ),
        parameter("square.amplitude", "V", "Height above square.low", 30.0),
        parameter("square.low", "V", "Low level, also before the delay", 0.0),
        fixed("square.period", "s", "Period", 20e-3, min=1e-9),
        parameter("square.duty", "1", "Share of the period that is high and comes first", 0.5, min=0.0, max=1.0),
        fixed("square.delay", "s", "Time of the first rising edge", 0.0),
        parameter("step.initial", "V", "Voltage before the step", 0.0),
        parameter("step.final", "V", "Voltage after the step", 30.0),
        fixed("step.time", "s", "Time of the step", 0.0),
        table(
            "table.file",
            "Table: CSV file with the columns time [s], voltage [V]; a repeated time is a jump, the ends are held",
            ("time [s]", "voltage [V]", "integral:voltage"),
            "voltage.csv",
        ),
        fixed("table.period", "s", "Period with which the table repeats; 0: it does not", 0.0, min=0.0),
        fixed("table.repeat_from", "s", "Start of the part that repeats; what is before comes once", 0.0),
        parameter("pwm.high", "V", "High level", 30.0),
        parameter("pwm.low", "V", "Low level", 0.0),
        fixed("pwm.frequency", "Hz", "Carrier frequency; the carrier starts at time 0", 20e3, min=1e-3),
        parameter("profile.amplitude", "V", "Height above profile.low", 30.0),
        parameter("profile.low", "V", "Low level, also before the delay", 0.0),
        parameter("profile.first", "s", "dt1: high first, in the second half low", 4.5e-3, min=0.0),
        parameter("profile.second", "s", "dt2: then low, in the second half high", 1.5e-3, min=0.0),
        fixed("profile.half_period", "s", "Half of the period: making, then breaking", 20e-3, min=1e-9),
        fixed("profile.delay", "s", "Time of the first rising edge", 0.0),
        table(
            "soft_landing.file",
            "Voltage of soft-landing cycles, a table like table.file; `gapsense soft-landing` makes others",
            ("time [s]", "voltage [V]", "integral:voltage"),
            "soft_landing.csv",
        ),
        fixed("soft_landing.period", "s", "Period of the cycles", 20e-3, min=0.0),
        fixed("soft_landing.repeat_from", "s", "Start of the cycle that repeats, as table.repeat_from", 20e-3),
        choice("bridge.kind", "Bridge: both directions, or one and zero", ("full", "half")),
        parameter("bridge.supply", "V", "Bridge: largest voltage", 30.0, min=1e-9),
        fixed("bridge.frequency", "Hz", "Bridge: carrier from time 0; 0: steady during the step", 20e3, min=0.0),
        fixed("bridge.levels", "1", "Bridge: steps of the mean between 0 and the supply; 0: any", 0.0, min=0.0),
    ),
)
