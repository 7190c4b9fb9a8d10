"""The valve that is identified, with or without losses in its core: its kernel, and its parameters by name."""

from __future__ import annotations

from functools import cache
from operator import itemgetter
from typing import Any, TypeAlias

from gapsense.actuators import solenoid_valve
from gapsense.identification.valve import lossy_valve
from gapsense.kernels.kernel import Kernel

Device: TypeAlias = "solenoid_valve.Parameters | lossy_valve.Parameters"
KERNELS = {module.Parameters: Kernel(module) for module in (solenoid_valve, lossy_valve)}
TURNOVER = 0.07  # flux linkage in which hysteresis turns over, of that of saturation: as in the actuator of [RTS]
SEEN = ("current", "flux_linkage", "position")


def kernel_of(par: Device) -> Kernel:
    """The model with these parameters, scalar: for fewer than about sixty runs faster than numpy."""
    return KERNELS[type(par)]


@cache
def seen(kernel: Kernel) -> itemgetter[Any]:
    """Current, flux linkage and position of a kernel's outputs."""
    return itemgetter(*map(kernel.module.Outputs._fields.index, SEEN))


def value(par: Device, name: str) -> Any:
    """A parameter."""
    return getattr(par if name in par._fields else valve(par), name)


def changed(par: Device, **values: Any) -> Device:
    """The device with other values."""
    own = {name: values.pop(name) for name in [*values] if name in par._fields}
    if isinstance(par, lossy_valve.Parameters):
        return par._replace(valve=par.valve._replace(**values), **own)
    return par._replace(**own, **values)


def valve(par: Device) -> solenoid_valve.Parameters:
    """Without losses."""
    return par.valve if isinstance(par, lossy_valve.Parameters) else par


def with_losses(par: Device) -> lossy_valve.Parameters:
    """With losses, which are none as yet."""
    if isinstance(par, lossy_valve.Parameters):
        return par
    return lossy_valve.Parameters(
        valve=par, core_eddy=0.0, core_hysteresis=0.0, core_turnover=TURNOVER * par.core_saturation, coil_factor=1.0
    )
