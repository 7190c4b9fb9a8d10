"""How much work a communication step may be: micro-steps, counted at what the port tables allow."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest

from gapsense.actuators import pot_magnet, reluctance_actuator, solenoid_valve
from gapsense.fmi.components import kernel_parameters, load_component, own
from gapsense.fmi.values import problems

KERNELS = {"pot_magnet": pot_magnet, "reluctance_actuator": reluctance_actuator, "solenoid_valve": solenoid_valve}
MOST = 4000  # by the table; a micro-step of the FMU costs 4 us
REFINED = 256 * 2 + 8  # a step of two micro-steps, each shortened at most 256 times, and what contacts take
LARGE = 1e3  # factor above the start


def cases() -> list[Any]:
    """One parameter at its declared minimum, all of them, and one a thousand times its start."""
    found = []
    for name in KERNELS:
        ports = [p for p in load_component(own(name)).of("parameter") if p.kind == "Real" and p.min is not None]
        lowest = {p.name: float(p.min or 0.0) for p in ports}
        single = [{low: value} for low, value in lowest.items()] + [lowest]
        large = [{p.name: LARGE * p.start} for p in ports if p.max is None and isinstance(p.start, float) and p.start]
        found += [pytest.param(name, given, id=f"{name} {', '.join(given)}"[:60]) for given in single + large]
    return found


def counted(monkeypatch: pytest.MonkeyPatch, module: ModuleType, par: Any, dt: float) -> int:
    """Micro-steps of one communication step from rest, at 30 V; those beyond `MOST` are not made."""
    count = 0

    def loop(limit: int, body: Any, state: Any) -> Any:
        nonlocal count
        stop = False
        while not stop and count <= MOST:
            state, stop = body(*state)
            count += 1
        return state

    monkeypatch.setattr(module, "loop", loop)
    state, _ = module.initial(module.Inputs(0.0, 0.0, 0.0), par)
    module.step(state, module.Inputs(dt, dt, 30.0), par)
    return count


@pytest.mark.parametrize(("name", "given"), cases())
def test_micro_steps_are_bounded_wherever_parameters_are_taken(
    name: str, given: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Refused with a reason, or integrated in a bounded number of micro-steps."""
    component = load_component(own(name))
    found = problems(component, given)
    if not found:
        assert counted(monkeypatch, KERNELS[name], kernel_parameters(own(name), given), component.step_size) <= MOST


@pytest.mark.parametrize("name", ["coil.turns", "core.permeability", "pole.area"])
def test_pot_magnet_refuses_a_coil_that_costs_a_hundred_thousand_steps(name: str) -> None:
    component = load_component(own("pot_magnet"))
    (port,) = (p for p in component.ports if p.name == name)
    assert any("would settle within microseconds" in text for text in problems(component, {name: port.min}))


@pytest.mark.parametrize("share", [0.02, 0.5, 0.98])
def test_pot_magnet_at_its_limits_takes_a_few_thousand_micro_steps(
    share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both terms of R / L just below what is taken: the fastest coil there is."""
    component = load_component(own("pot_magnet"))
    start = {p.name: p.start for p in component.of("parameter")}
    worst = {"coil.turns": 1.0, "core.permeability": 1.0, "pole.area": 1e-4, "coil.resistance": share}
    worst |= {"coil.resistance_upper": share, "core.length": 0.599e-4 / share, "stop.upper": 0.299e-4 / share}
    assert set(worst) <= set(start)
    assert not problems(component, worst)
    par = kernel_parameters(own("pot_magnet"), worst)
    assert 3000 < counted(monkeypatch, pot_magnet, par, component.step_size) <= MOST


def test_refinement_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """A valve with hardly a turn saturates at once: its micro-steps are shortened, 256 times at most."""
    par = kernel_parameters(own("solenoid_valve"), {"coil.turns": 1e-9})
    assert 256 < counted(monkeypatch, solenoid_valve, par, 25e-6) <= REFINED
