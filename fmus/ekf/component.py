"""Port table of the extended Kalman filter."""

from gapsense.fmi.ports import Component
from gapsense.fmi.shared_ports import GAP_TABLE, estimates, measurements, reduced_model

COMPONENT = Component(
    name="Ekf",
    description="Extended Kalman filter: position, velocity and flux linkage from voltage, current and contact",
    kernel="gapsense.estimators.ekf",
    step_size=20e-6,
    resources=(GAP_TABLE,),
    rising=(("stop.lower", "stop.upper"),),
    ports=(*measurements(), *estimates(("current", "mode")), *reduced_model()),
)
