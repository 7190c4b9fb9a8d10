"""Port table of the drive-voltage generator."""

from gapsense.fmi.ports import Component, choice, fixed, input_, output, parameter, table

COMPONENT = Component(
    name="DriveVoltage",
    description="Drive voltage: square wave, step, table from a CSV file, or PWM of a reference",
    kernel="gapsense.drive.drive_voltage",
    resources=("voltage.csv",),
    rising=(("pwm.low", "pwm.high"),),
    ports=(
        input_("enable", "1", "0.5 or less: both outputs are 0 V", start=1.0),
        input_("reference", "V", "Mean voltage that the PWM gives, held during the step", nominal=30.0),
        output(
            "voltage",
            "V",
            "At the end of the step; on an edge, just before it",
            nominal=30.0,
            feedthrough=("enable", "reference"),
        ),
        output("voltage_mean", "V", "Mean over the step, exact", nominal=30.0, feedthrough=("enable", "reference")),
        choice("waveform", "What is generated", ("square", "step", "table", "pwm")),
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
            ("time", "voltage", "integral:voltage"),
            "voltage.csv",
        ),
        parameter("pwm.high", "V", "High level", 30.0),
        parameter("pwm.low", "V", "Low level", 0.0),
        fixed("pwm.frequency", "Hz", "Carrier frequency; the carrier starts at time 0", 20e3, min=1e-3),
    ),
)
