"""The same experiment in other masters.  Each function returns seconds, component-steps and the last outputs."""

from __future__ import annotations

import json
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Any
from xml.sax.saxutils import quoteattr

import fmpy
from experiment import COUNT, ROOT, STEP, WATCHED, Experiment, common, component_steps, reference, start_values
from fmpy.fmi2 import FMU2Slave

from gapsense.cosim.scenario.records import Port

Outcome = tuple[float, int, dict[str, float]]


def fmpy_loop(fmus: Path) -> Outcome:
    """Gauss-Seidel with fmpy's methods, one setReal and one getReal per variable, as its examples do."""
    from gapsense.cosim.run.master import Master

    experiment = common(fmus)
    scenario = experiment[0]
    with Master(*experiment) as master:
        master.initialize(scenario.seeds, {})
        used = {c.source for c in scenario.connections} | set(WATCHED)
        parts = []
        for part in master.parts:
            name = part.component.name
            inputs = [(c.source, [reference(experiment, c.target)]) for c in scenario.connections
                      if c.target.component == name]  # fmt: skip
            outputs = [(port, [reference(experiment, port)]) for port in used if port.component == name]
            parts.append((part.instance.slave, inputs, outputs))
        values = {port: slave.getReal(ref)[0] for slave, _, outputs in parts for port, ref in outputs}
        rows = []
        begin = perf_counter()
        for k in range(COUNT):
            for slave, inputs, outputs in parts:
                for source, ref in inputs:
                    slave.setReal(ref, [values[source]])
                slave.doStep(currentCommunicationPoint=k * STEP, communicationStepSize=STEP)
                for port, ref in outputs:
                    values[port] = slave.getReal(ref)[0]
            rows.append([values[port] for port in WATCHED])
        return perf_counter() - begin, component_steps(experiment), dict(zip(map(str, WATCHED), rows[-1]))


# --- fmpy.ssp ---


def simulate_ssp(fmus: Path) -> Outcome:
    """`simulate_ssp` of fmpy: the time of the whole run less that of a run of one step, which loads just as much."""
    from fmpy.ssp.simulation import simulate_ssp
    from fmpy.ssp.ssd import Parameter, ParameterSet

    experiment = common(fmus)
    values = [Parameter(name=f"{c}.{v.name}", type=v.type, value=value) for c, v, value in start_values(experiment)]
    with tempfile.TemporaryDirectory() as folder:
        path = write_ssp(experiment, Path(folder, "scenario.ssp"))

        def seconds(count: int) -> tuple[float, Any]:
            """How long so many steps take, and their rows."""
            begin = perf_counter()
            stop = (count - 0.5) * STEP  # it accumulates time and goes on while it is below the stop time
            rows = simulate_ssp(str(path), 0.0, stop, STEP, ParameterSet(parameters=values))
            return perf_counter() - begin, rows

        seconds(1)
        loading = seconds(1)[0]
        total, rows = seconds(COUNT)
    last = {str(p): float(rows[-1][str(p)]) for p in WATCHED}
    return total - loading, component_steps(experiment) - len(experiment[0].components), last


def write_ssp(experiment: Experiment, path: Path) -> Path:
    """The scenario in the part of SSP that fmpy understands: no parameters, and no input without a source."""
    scenario, descriptions = experiment
    links = scenario.connections
    used = [*dict.fromkeys([*(c.source for c in links), *WATCHED, *(c.target for c in links)])]
    targets = {c.target for c in links}
    elements = ""
    for name in scenario.components:
        kinds = {p.variable: "input" if p in targets else "output" for p in used if p.component == name}
        connectors = "".join(
            f"<ssd:Connector name={quoteattr(v)} kind='{kind}'><ssc:Real/></ssd:Connector>" for v, kind in kinds.items()
        )
        elements += (
            f"<ssd:Component name={quoteattr(name)} type='application/x-fmu-sharedlibrary'"
            f" source='resources/{descriptions[name].path.name}'><ssd:Connectors>{connectors}</ssd:Connectors>"
            "</ssd:Component>"
        )
    connections = "".join(
        f"<ssd:Connection startElement='{c.source.component}' startConnector='{c.source.variable}'"
        f" endElement='{c.target.component}' endConnector='{c.target.variable}'/>"
        for c in links
    )
    text = (
        "<?xml version='1.0' encoding='UTF-8'?><ssd:SystemStructureDescription version='1.0' name='semera_valve'"
        " xmlns:ssd='http://ssp-standard.org/SSP1/SystemStructureDescription'"
        " xmlns:ssc='http://ssp-standard.org/SSP1/SystemStructureCommon'>"
        f"<ssd:System name='semera_valve'><ssd:Elements>{elements}</ssd:Elements>"
        f"<ssd:Connections>{connections}</ssd:Connections></ssd:System></ssd:SystemStructureDescription>"
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", text)
        for file in {d.path for d in descriptions.values()}:
            archive.write(file, f"resources/{file.name}")
    return path


# --- libcosim ---


def libcosim(fmus: Path) -> Outcome:
    """libcosimpy, one call of step(n).  It is observed in the last step only, since observing costs time."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.ERROR)
    experiment = common(fmus)
    scenario, descriptions = experiment
    execution = CosimExecution.from_step_size(round(STEP * 1e9))
    slaves = {n: CosimLocalSlave(str(descriptions[n].path), n) for n in scenario.components}
    index = {name: execution.add_local_slave(slave) for name, slave in slaves.items()}
    setters = {"Real": execution.real_initial_value, "Integer": execution.integer_initial_value,
               "Boolean": execution.boolean_initial_value, "String": execution.string_initial_value}  # fmt: skip
    for name, variable, value in start_values(experiment):
        setters[variable.type](index[name], variable.reference, value)
    for link in scenario.connections:
        ends = [(index[port.component], reference(experiment, port)) for port in (link.source, link.target)]
        execution.connect_real_variables(*ends[0], *ends[1])
    execution.step()  # this initialises
    begin = perf_counter()
    execution.step(COUNT - 2)
    seconds = perf_counter() - begin
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    execution.step()
    last = {str(p): observer.last_real_values(index[p.component], [reference(experiment, p)])[0] for p in WATCHED}
    return seconds, len(scenario.components) * (COUNT - 2), last


# --- fmu_manipulation_toolbox ---


def container(fmus: Path) -> Outcome:
    """A sequential container, one doStep of fmpy per step."""
    return _container(fmus, 1)


def container_100(fmus: Path) -> Outcome:
    """The same with 100 steps inside each doStep: nothing can be recorded in between."""
    return _container(fmus, 100)


def _container(fmus: Path, steps_per_call: int) -> Outcome:
    experiment = common(fmus)
    with tempfile.TemporaryDirectory() as folder:
        slave, references, unzipped = load_container(build_container(experiment, Path(folder)))
        begin = perf_counter()
        for k in range(0, COUNT, steps_per_call):
            slave.doStep(currentCommunicationPoint=k * STEP, communicationStepSize=steps_per_call * STEP)
        seconds = perf_counter() - begin
        last = dict(zip(references, slave.getReal([*references.values()])))
        slave.terminate()
        slave.freeInstance()
        shutil.rmtree(unzipped, ignore_errors=True)
    return seconds, component_steps(experiment), last


def build_container(experiment: Experiment, folder: Path) -> Path:
    """The FMU made of the scenario."""
    from fmu_manipulation_toolbox.assembly import Assembly

    scenario, descriptions = experiment
    paths: Mapping[str, str] = {f"{name}.fmu": str(descriptions[name].path.resolve()) for name in scenario.components}
    assembly = {
        "name": "scenario.fmu", "fmu": [*paths], "path": paths, "step_size": STEP, "sequential": True,
        "auto_link": False, "auto_input": False, "auto_output": False,
        "link": [[f"{c.source.component}.fmu", c.source.variable, f"{c.target.component}.fmu", c.target.variable]
                 for c in scenario.connections],
        "start": [[f"{name}.fmu", variable.name, value] for name, variable, value in start_values(experiment)],
        "output": [[f"{p.component}.fmu", p.variable, str(p)] for p in WATCHED],
    }  # fmt: skip
    Path(folder, "scenario.json").write_text(json.dumps(assembly))
    Assembly("scenario.json", fmu_directory=folder).make_fmu()
    return folder / "scenario.fmu"


def load_container(path: Path) -> tuple[FMU2Slave, dict[str, int], str]:
    """The container initialised, and the references of the watched outputs."""
    model = fmpy.read_model_description(str(path), validate=False)
    unzipped = fmpy.extract(str(path))
    slave = FMU2Slave(guid=model.guid, unzipDirectory=unzipped, instanceName="container",
                      modelIdentifier=model.coSimulation.modelIdentifier)  # fmt: skip
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    found = {v.name: v.valueReference for v in model.modelVariables}
    return slave, {str(p): found[str(p)] for p in WATCHED}, unzipped


# --- cofmupy ---


def cofmupy(fmus: Path) -> Outcome:
    """Its coordinator, Gauss-Seidel, in an environment of its own, for it wants another fmpy and pythonfmu.

    It sets parameters after initialization, which no fixed one allows: the FMUs are built to start with them.
    """
    python = ROOT / ".venv-cofmupy" / "bin" / "python"
    if not python.exists():
        raise ImportError("cofmupy", name="cofmupy")
    experiment = common(fmus)
    with tempfile.TemporaryDirectory() as folder:
        task = Path(folder, "task.json")
        task.write_text(json.dumps(coordinator_task(experiment, Path(folder))))
        command = [python, Path(__file__).with_name("cofmupy_peer.py"), task]
        found = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[-1])
    return found["seconds"], component_steps(experiment), found["last"]


def coordinator_task(experiment: Experiment, folder: Path) -> dict[str, Any]:
    """What cofmupy is to do, with the FMUs for it in `folder`."""
    from gapsense.fmi.components import own
    from gapsense.fmi.package import build

    scenario, descriptions = experiment
    values: dict[str, dict[str, Any]] = {name: {} for name in scenario.components}
    for name, variable, value in start_values(experiment):
        values[name][variable.name] = value
    paths = {name: build(own(descriptions[name].name), folder / name, values[name]) for name in values}

    def end(port: Port) -> dict[str, str]:
        return {"id": port.component, "variable": port.variable, "unit": "", "type": "fmu"}

    given: dict[str, dict[str, float]] = {name: {} for name in paths}  # it sets all inputs to zero without this
    for port, value in scenario.inputs.items():
        given[port.component][port.variable] = value
    config = {
        "fmus": [{"id": name, "path": str(path), "initialization": given[name]} for name, path in paths.items()],
        "connections": [{"source": end(c.source), "target": end(c.target)} for c in scenario.connections],
        "cosim_method": "gauss_seidel", "iterative": False, "root": "", "edge_sep": " -> ", "data_storages": [],
    }  # fmt: skip
    return {"config": config, "count": COUNT, "step": STEP, "watched": WATCHED}
