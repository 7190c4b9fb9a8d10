"""What the contract tests do with FMUs, each call in a process of its own: `python drivers.py FUNCTION`.

The arguments (standard input) and what the function returns (standard output) are JSON; `fresh` makes the call.
"""

from __future__ import annotations

import gc
import json
import os
import subprocess
import sys
import tempfile
import traceback
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import warm

if __name__ == "__main__" or TYPE_CHECKING:
    from fmu_host import LOG, FMICallException, Fmu, Instance, attempt

ROOT = Path(__file__).resolve().parents[2]
STEPS = 200
LONG = 5000  # steps of an experiment
IMPORTS = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); import fmu_host"
RUN = f"import runpy; runpy.run_path({__file__!r}, run_name='__main__')"
WINE = {  # one folder for all tests with wine, which takes ten seconds to make it; nothing of browsers and of .NET
    "WINEPREFIX": str(ROOT / "build" / "wine"),
    "WINEDEBUG": "-all",
    "WINEDLLOVERRIDES": "mscoree,mshtml=",
}
AWKWARD = "für 100 %s %n #1"  # as the name of an instance and of a folder


def communication_step(step: float, stop: float) -> float:
    """That of the tests: a long experiment says that little happens in a few hundred of its own steps."""
    return step * max(1, round(stop / step / LONG))


def call(function: str, *arguments: Any) -> subprocess.CompletedProcess[str]:
    """Run a function of this file in a process that Python has started just now."""
    return _call(function, json.dumps(arguments, default=str))


def _call(function: str, given: str, is_warm: bool = False) -> subprocess.CompletedProcess[str]:
    env = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHONPATH", "COV_"))}  # sees nothing of ours
    with tempfile.TemporaryDirectory() as folder:  # FMUs are extracted into it
        env["TMPDIR"] = folder
        if is_warm:
            return warm.run(RUN, function, imports=IMPORTS, given=given, env=env, seconds=120)
        options = {"capture_output": True, "text": True, "encoding": "utf-8", "timeout": 120}
        return subprocess.run([sys.executable, __file__, function], input=given, env=env, **options)


def fresh(function: str, *arguments: Any) -> Any:
    """What the function returns; the process must exit cleanly.  Asked again, the same answer."""
    return _fresh(function, json.dumps(arguments, default=str))


@cache
def _fresh(function: str, given: str) -> Any:
    done = _call(function, given, is_warm=True)
    assert done.returncode == 0, f"{function} ended with {done.returncode}\n{done.stdout}\n{done.stderr}"
    return json.loads(done.stdout.splitlines()[-1])


# Traces ---------------------------------------------------------------------------------------------------------------


def together(*paths: str) -> list[list[list[float]]]:
    """Outputs of one instance of each FMU, stepped in turn in one process."""
    fmus = [Fmu(path) for path in paths]
    instances = [Instance(fmu, f"number {k}") for k, fmu in enumerate(fmus)]
    stimuli = [fmu.stimulus(STEPS) for fmu in fmus]
    traces = [[i.start(rows[0])] for i, rows in zip(instances, stimuli)]
    for k in range(1, STEPS + 1):
        for instance, rows, trace in zip(instances, stimuli, traces):
            trace += instance.go_on(rows[: k + 1], k)
    for instance in instances:
        instance.free()
    return traces


def variants(path: str, sets: list[dict[str, Any]], tuned: dict[str, float]) -> list[dict[str, Any]]:
    """Inputs and outputs with each set of parameters; others are tuned half-way."""
    fmu, results = Fmu(path), []
    rows = fmu.stimulus(STEPS)
    for parameters in sets:
        instance = Instance(fmu)
        outputs = instance.run(rows[: STEPS // 2], parameters)
        instance.set(tuned)
        outputs += instance.go_on(rows, STEPS // 2)
        results.append({"inputs": rows, "outputs": outputs, "step": fmu.step})
        instance.free()
    return results


def life(path: str) -> dict[str, Any]:
    """The trace `first` of an instance, what it reads at its start, and what follows the inputs."""
    fmu = Fmu(path)
    rows = fmu.stimulus(STEPS)
    one = Instance(fmu)
    facts: dict[str, Any] = {"starts": fmu.starts(), "read": _at_start(one)}
    facts["first"] = one.run(rows)
    facts["follows"] = _following(one, rows[-1], fmu)
    return facts


def _at_start(instance: Instance) -> dict[str, Any]:
    """Values while the instance is being initialised; it is reset then."""
    instance.slave.setupExperiment(startTime=0.0)
    instance.slave.enterInitializationMode()
    values = instance.get(instance.fmu.starts())
    instance.slave.reset()
    return values


def _following(instance: Instance, values: list[float], fmu: Fmu) -> dict[str, list[str]]:
    """Outputs that change with each input while the instance is being initialised."""
    instance.slave.reset()
    instance.slave.setupExperiment(startTime=0.0)
    instance.slave.enterInitializationMode()
    before, follows = instance.slave.getReal(instance.outputs), {}
    for variable, value in zip(fmu.of("input"), values):
        start = float(variable.start)
        instance.set({variable.name: value if value != start else start + 0.1})
        after = instance.slave.getReal(instance.outputs)
        follows[variable.name] = [v.name for v, b, a in zip(fmu.of("output"), before, after) if a != b]
        instance.set({variable.name: start})
    return follows


def memory(path: str, cycles: int) -> dict[str, float]:
    """Growth over so many cycles of loading, running and freeing, after some to warm up."""
    fmu = Fmu(path)
    rows = fmu.stimulus(3)

    def cycle() -> None:
        instance = Instance(fmu)
        instance.run(rows)
        instance.slave.terminate()
        instance.free()

    gc.set_threshold(700, 10, 10)  # as in a host; forks of ours clear up seldom (warm.py)
    for _ in range(30):
        cycle()
    gc.collect()
    before = _resident(), len(sys.path), len(sys.modules)
    for _ in range(cycles):
        cycle()
    gc.collect()
    after = _resident(), len(sys.path), len(sys.modules)
    return dict(zip(("bytes", "paths", "modules"), (b - a for a, b in zip(before, after))))


def _resident() -> int:
    pages = Path("/proc/self/statm").read_text().split()[1]
    return int(pages) * os.sysconf("SC_PAGE_SIZE")


def reference(
    path: str, step: float, rows: int, inputs: list[list[float]] | None = None, parameters: dict[str, Any] | None = None
) -> dict[str, Any]:
    """A short run: names, inputs (the stimulus, unless given; the first hold in the first step too) and outputs."""
    fmu = Fmu(path)
    first, *others = inputs or fmu.stimulus(rows - 1)
    stimulus = [first, *others] if inputs else [first, first, *others]
    one = Instance(fmu)
    outputs = [one.start(stimulus[0], parameters)]
    outputs += [one.step(row, k * step, step) for k, row in enumerate(stimulus[1:])]
    names = [[v.name for v in fmu.of(causality)] for causality in ("input", "output")]
    nominal = [float(v.nominal) for v in fmu.of("output")]
    return {"names": names, "nominal": nominal, "inputs": stimulus, "outputs": outputs}


# State ----------------------------------------------------------------------------------------------------------------


def save(path: str, tuned: dict[str, Any]) -> dict[str, Any]:
    """Continue from a saved state in several ways, also after parameters have been tuned; its bytes."""
    fmu = Fmu(path)
    half, rows = STEPS // 2, fmu.stimulus(STEPS)
    one, two = Instance(fmu), Instance(fmu, "two")
    names = list(fmu.variables)
    early = one.slave.getFMUstate()
    one.run(rows[:half])
    state = one.slave.getFMUstate()
    data = one.slave.serializeFMUstate(state)
    values = one.get(names)
    facts: dict[str, Any] = {"bytes": data.hex(), "straight": one.go_on(rows, half)}
    for name in ("once", "twice"):
        one.set(tuned)
        one.slave.setFMUstate(state)
        facts[f"values_{name}"] = one.get(names) == values
        facts[name] = one.go_on(rows, half)
    two.slave.setFMUstate(two.slave.deSerializeFMUstate(data))
    facts["values_in_another"] = two.get(names) == values
    facts["in_another"] = two.go_on(rows, half)
    facts["bytes_again"] = one.slave.serializeFMUstate(state).hex()
    one.slave.setFMUstate(early)
    facts["early"] = one.run(rows)[half:]
    for handle in (state, early):
        one.slave.freeFMUstate(handle)
    one.free()
    return facts


def elsewhere(path: str, data: str) -> dict[str, Any]:
    """How a run goes on from bytes, and then the trace of another instance."""
    fmu = Fmu(path)
    rows, one = fmu.stimulus(STEPS), Instance(fmu)
    one.slave.setFMUstate(one.slave.deSerializeFMUstate(bytes.fromhex(data)))
    return {"restored": one.go_on(rows, STEPS // 2), "first": Instance(fmu, "two").run(rows)}


# Failures -------------------------------------------------------------------------------------------------------------


def refusals(path: str, folder: str, cases: list[dict[str, Any]]) -> dict[str, Any]:
    """What each case answers, and the trace of one more instance afterwards; name and folder are awkward.

    A case has a name and, all optional, `parameters` before the start, `phase` (before, running), `inputs` by name,
    `step` as (time, step), `call` as [function of fmpy's slave, arguments].
    """
    fmu = Fmu(path, Path(folder) / AWKWARD)
    rows, answers = fmu.stimulus(STEPS), {}
    for case in cases:
        answers[case["name"]] = attempt(_refused, Instance(fmu, AWKWARD), fmu, case)
    return {"answers": answers, "afterwards": Instance(fmu, AWKWARD).run(rows)}


def _refused(instance: Instance, fmu: Fmu, case: dict[str, Any]) -> None:
    instance.set(case.get("parameters", {}))
    if case.get("phase") != "before":
        instance.start()
        instance.slave.doStep(0.0, fmu.step)
    instance.set(case.get("inputs", {}))
    if "call" in case:
        function, *arguments = case["call"]
        getattr(instance.slave, function)(*arguments)
    if "step" in case:
        instance.slave.doStep(*case["step"])


def faults(path: str, count: int) -> dict[str, Any]:
    """Answers of instances whose kernel fails in its own way at their first step; then the trace of a sound one."""
    fmu = Fmu(path)
    rows, answers = fmu.stimulus(STEPS), []
    for k in range(count):
        instance = Instance(fmu, f"broken {k}")
        instance.start(rows[0])
        answers.append(attempt(instance.step, rows[1], 0.0, fmu.step))
        answers[-1]["again"] = attempt(instance.slave.doStep, fmu.step, fmu.step)["status"]
    return {"answers": answers, "afterwards": Instance(fmu).run(rows), "inputs": rows[1]}


def end(paths: list[str], steps: int, is_freed: bool) -> list[int]:
    """Status of running FMUs to the end of the process, where a damaged heap shows."""
    fmus = [Fmu(path) for path in paths]
    instances = [Instance(fmu) for fmu in fmus]
    stati = []
    for instance, fmu in zip(instances, fmus):
        stati.append(attempt(instance.run, fmu.stimulus(steps))["status"])
    for instance, status in zip(instances, stati):
        if is_freed and status == 0:
            instance.slave.terminate()
            instance.free()
    return stati


# Building -------------------------------------------------------------------------------------------------------------

SECOND = """

COMPONENT = COMPONENT._replace(
    description="Second version",
    kernel="{module}_second",
    ports=tuple(p._replace(start={start!r}) if p.name == "{name}" else p for p in COMPONENT.ports),
)
"""
SECOND_KERNEL = '''
from gapsense.kernels.layout import flat, names, record

from {kernel} import Inputs, Outputs, Parameters, State
from {kernel} import initial as first_initial
from {kernel} import step as first_step


def initial(inputs, par):
    return doubled(*first_initial(inputs, par))


def step(state, inputs, par):
    return doubled(*first_step(state, inputs, par))


def doubled(state, outputs):
    """A constant of the kernel has changed."""
    values = dict(zip(names(Outputs), flat(outputs)))
    values["{field}"] = 2.0 * values["{field}"] + 0.5
    return state, record(Outputs, values.values())
'''
FAULTS = """

_begin, _sound, _faults, fault = initial, advance, iter(["exception", "nothing", "nan", "infinite"]), "none"


def initial(inputs, par):
    global fault
    fault = next(_faults, "none")
    return _begin(inputs, par)


def advance(state, inputs, constants):
    if fault == "exception":
        raise ArithmeticError("kaputt: für 100 %s %d %n")
    if fault == "nothing":
        return None
    state, outputs = _sound(state, inputs, constants)
    wrong = {"nan": float("nan"), "infinite": float("inf")}
    return state, (outputs if fault == "none" else (wrong[fault],) * len(outputs))
"""


def build(folders: list[str], out: str, *kernels: str) -> None:
    """Build components as build_fmus.py does, without validation; kernels may be in further folders."""
    sys.path[:0] = [str(ROOT / "src"), *kernels]
    from gapsense.fmi import package

    for folder in folders:
        package.build(Path(folder), Path(out))


def build_second_versions(folders: list[str], work: str, out: str) -> dict[str, str]:
    """Build each component with another description, another start value and another kernel; the parameter changed."""
    import shutil

    sys.path[:0] = [str(ROOT / "src"), work]
    from gapsense.fmi.components import load_component
    from gapsense.fmi.package import build

    changed = {}
    for folder in map(Path, folders):
        component = load_component(folder)
        port = next(p for p in reversed(component.ports) if p.causality == "parameter" and p.kind == "Real" and p.start)
        copy = Path(shutil.copytree(folder, Path(work) / folder.name))
        is_within = port.max is None or 1.0625 * port.start <= port.max
        about = {"module": folder.name, "name": port.name, "start": port.start * (1.0625 if is_within else 0.9375)}
        with (copy / "component.py").open("a", encoding="utf-8") as file:
            file.write(SECOND.format(**about))
        field = component.of("output")[0].field
        kernel = SECOND_KERNEL.format(kernel=component.kernel, field=field)
        (Path(work) / f"{folder.name}_second.py").write_text(kernel, encoding="utf-8")
        build(copy, Path(out))
        changed[component.name] = port.name
    return changed


def break_kernel(fmu: Path, out: Path) -> Path:
    """A copy of an FMU whose kernel fails at the first steps taken in a process, each time in another way."""
    import zipfile

    with zipfile.ZipFile(fmu) as archive, zipfile.ZipFile(out / fmu.name, "w") as broken:
        for name in archive.namelist():
            data = archive.read(name)
            broken.writestr(name, data + FAULTS.encode() if name.endswith("/kernel.py") else data)
    return out / fmu.name


if __name__ == "__main__":
    try:
        print(json.dumps(globals()[sys.argv[1]](*json.load(sys.stdin))))
    except FMICallException as error:  # last of all, the first line of what the FMU said
        traceback.print_exc()
        said = [text.splitlines()[0] for _, _, category, text in LOG if category == "logStatusError"]
        sys.exit(said[-1] if said else str(error))
