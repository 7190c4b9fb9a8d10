"""Scenario with a component that fails in the way that is put for FAULT."""

FAULTY = """
title = "A component that fails"
[experiment]
stop = 1.0
base_step = 0.1
[components.lag]
fmu = "Lag"
[components.coil]
fmu = "Faulty"
set = { fault = "FAULT" }
[[connections]]
from = "lag.y"
to = "coil.u"
[inputs]
"lag.u" = 1.0
"""
