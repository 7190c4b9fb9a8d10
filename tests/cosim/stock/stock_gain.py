from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real

PARAMETER = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.fixed}


class Gain(Fmi2Slave):
    """`y = gain * u`, with direct feedthrough, also at the start."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.gain, self.y, self.mode = 0.0, 2.0, 0.0, 0
        self.register_variable(Real("gain", **PARAMETER))
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        self.register_variable(Integer("mode", causality=Fmi2Causality.output, variability=Fmi2Variability.discrete))

    def exit_initialization_mode(self):
        self.y = self.gain * self.u

    def do_step(self, t, h):
        self.y = self.gain * self.u
        return True
