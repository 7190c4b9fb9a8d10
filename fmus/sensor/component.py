"""Port table of the sensor chain."""

from gapsense.fmi.ports import Component, choice, fixed, input_, output, parameter, sample_time, seed

COMPONENT = Component(
    name="Sensor",
    description="Sensor chain: errors, noise, saturation, quantisation, sample and hold, dropouts; contact detection",
    kernel="gapsense.sensor.sensor",
    step_size=50e-6,
    rising=(("contact.lower", "contact.upper"),),
    ports=(
        input_("voltage", "V", "True coil voltage", nominal=30.0),
        input_("current", "A", "True coil current", nominal=0.4),
        input_("position", "m", "True position", nominal=1e-3),
        input_("mode", "1", "True mode: 1 lower stop, 2 moving, 3 upper stop", start=2.0, min=1.0, max=3.0),
        output("voltage_measured", "V", "Measured voltage", nominal=30.0, feedthrough=("voltage",)),
        output("current_measured", "A", "Measured current", nominal=0.4, feedthrough=("current",)),
        output("mode_measured", "1", "Measured mode", min=1.0, max=3.0, feedthrough=("position", "mode")),
        output("dropout", "1", "1: this sample was lost, and the outputs hold the one before", min=0.0, max=1.0),
        sample_time(50e-6),
        seed(),
        parameter("gain_error.voltage", "1", "Relative: 0.01 reads 1 % too much", 0.0),
        parameter("gain_error.current", "1", "Relative: 0.01 reads 1 % too much", 0.0),
        parameter("offset.voltage", "V", "Reading at 0 V", 0.0),
        parameter("offset.current", "A", "Reading at 0 A", 0.0),
        parameter("noise.voltage", "V", "Standard deviation of the voltage noise", 15e-3, min=0.0),
        parameter("noise.current", "A", "Standard deviation of the current noise", 1e-3, min=0.0),
        parameter("resolution.voltage", "V", "Step of the converter; 0: none", 0.0, min=0.0),
        parameter("resolution.current", "A", "Step of the converter; 0: none", 0.0, min=0.0),
        parameter("range.voltage", "V", "Readings saturate at plus and minus this; 0: never", 0.0, min=0.0),
        parameter("range.current", "A", "Readings saturate at plus and minus this; 0: never", 0.0, min=0.0),
        parameter("dropout.probability", "1", "Probability that a sample is lost", 0.0, min=0.0, max=1.0),
        choice("contact.source", "Where the measured mode comes from", ("mode", "position")),
        fixed("contact.lower", "m", "Lower stop below this position", 0.05e-3),
        fixed("contact.upper", "m", "Upper stop above this position", 0.85e-3),
        fixed("contact.hysteresis", "m", "Way back past a threshold before the contact opens", 0.01e-3, min=0.0),
        fixed("contact.bounce", "1", "Samples for which a contact opens again after it has closed", 0.0, min=0.0),
    ),
)
