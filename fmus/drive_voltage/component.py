"""The drive-voltage generator as an FMU."""

from gapsense.drive import drive_voltage
from gapsense.fmi.ports import Component
from gapsense.kernels.interface import ports_of

COMPONENT = Component(
    name="DriveVoltage",
    description="Drive voltage: square wave, step, table from a CSV file, PWM, pulse profile, soft landing, bridge",
    kernel=drive_voltage.__name__,
    ports=ports_of(drive_voltage),
    resources=("voltage.csv", "soft_landing.csv"),
    rising=(("pwm.low", "pwm.high"),),
)
