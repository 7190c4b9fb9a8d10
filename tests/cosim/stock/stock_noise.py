import random

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real

PARAMETER = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.fixed}


class Noise(Fmi2Slave):
    """Sampled Gaussian noise."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.seed, self.sample_time, self.y = 0, 0.1, 0.0
        self.register_variable(Integer("seed", **PARAMETER))
        self.register_variable(Real("sample_time", **PARAMETER))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def exit_initialization_mode(self):
        self.generator = random.Random(self.seed)

    def do_step(self, t, h):
        self.y = self.generator.gauss(0.0, 1.0)
        return True
