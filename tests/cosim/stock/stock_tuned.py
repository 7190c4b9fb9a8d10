import math

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real

PARAMETER, TUNABLE = Fmi2Causality.parameter, Fmi2Variability.tunable


class Tuned(Fmi2Slave):
    """Adds up `gain * h` and, in `seen`, its inputs; a lost sample counts in `lost`. Gain and mode may be changed."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.gain, self.mode, self.start = 0.0, 2.0, 1, 0.0
        self.y, self.seen, self.lost = 0.0, 0.0, 0.0
        self.register_variable(Real("gain", causality=PARAMETER, variability=TUNABLE))
        self.register_variable(Integer("mode", causality=PARAMETER, variability=TUNABLE))
        self.register_variable(Real("start", causality=PARAMETER, variability=Fmi2Variability.fixed))
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        for name in ("y", "seen", "lost"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def do_step(self, t, h):
        if self.gain == 13.0:
            raise ValueError("unlucky gain")
        self.y += self.gain * self.mode * h
        if math.isnan(self.u):
            self.lost += 1.0
        else:
            self.seen += self.u
        return True
