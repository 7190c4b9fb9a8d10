from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real


class Switch(Fmi2Slave):
    """`mode` counts up to 3 with its input, and `y` is the double of `u`; it can save its state."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.before, self.u, self.mode, self.y = 0, 0.0, 0, 0.0
        kind = {"variability": Fmi2Variability.discrete}
        self.register_variable(Integer("before", causality=Fmi2Causality.input, **kind))
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Integer("mode", causality=Fmi2Causality.output, **kind))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, t, h):
        self.mode, self.y = min(self.before + 1, 3), 2.0 * self.u
        return True
