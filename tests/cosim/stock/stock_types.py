from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Integer, Real, String


class Types(Fmi2Slave):
    """Variables of all types, and nothing said about their variability."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.step, self.count, self.is_odd, self.is_on, self.label, self.said = 1, 0, False, True, "", ""
        self.half = 0.0
        for make, name in ((Integer, "step"), (Boolean, "is_on"), (String, "label")):
            self.register_variable(make(name, causality=Fmi2Causality.input))
        for make, name in ((Integer, "count"), (Boolean, "is_odd"), (String, "said"), (Real, "half")):
            self.register_variable(make(name, causality=Fmi2Causality.output))

    def do_step(self, t, h):
        self.count += self.step * self.is_on
        self.is_odd, self.half = bool(self.count % 2), self.count / 2
        self.said = f"{self.label}{self.count}"
        return True
