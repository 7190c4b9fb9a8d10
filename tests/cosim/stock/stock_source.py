from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real, String

PARAMETER = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.fixed}


class Source(Fmi2Slave):
    """Ramp `level + slope * t`, negative if inverted; it counts its steps."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.level, self.slope, self.inverted, self.seed = 1.0, 0.0, False, 0
        self.shape, self.table, self.y, self.steps = "ramp", "", 0.0, 0.0
        for name in ("level", "slope"):
            self.register_variable(Real(name, **PARAMETER))
        self.register_variable(Boolean("inverted", **PARAMETER))
        self.register_variable(Integer("seed", **PARAMETER))
        self.register_variable(String("shape", **PARAMETER))
        self.register_variable(
            String("table.file", getter=lambda: self.table, setter=lambda v: setattr(self, "table", v), **PARAMETER)
        )
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        self.register_variable(Real("steps", causality=Fmi2Causality.output))

    def value(self, t):
        return (self.level + self.slope * t) * (-1.0 if self.inverted else 1.0)

    def setup_experiment(self, start_time, stop_time, tolerance):
        self.start = start_time

    def exit_initialization_mode(self):
        self.y = self.value(self.start)

    def do_step(self, t, h):
        self.y = self.value(t + h)
        self.steps += 1.0
        return True
