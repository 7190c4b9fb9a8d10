from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

PARAMETER = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.fixed}


class Lag(Fmi2Slave):
    """First-order lag by explicit Euler; its output has no direct feedthrough."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.y, self.constant = 0.0, 0.0, 0.5
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        self.register_variable(
            Real(
                "time.constant",
                getter=lambda: self.constant,
                setter=lambda v: setattr(self, "constant", v),
                **PARAMETER,
            )
        )

    def do_step(self, t, h):
        self.y += h / self.constant * (self.u - self.y)
        return True
