"""Error against cost of coupling, with our methods and in other masters: `python benchmarks/coupling.py`.

Three problems of two to five components, whose solution as one system is known: (a) a circuit and a valve, by DOP853 of
SciPy; (b) two masses and a spring of five stiffnesses between them, by the matrix exponential; (c) five nodes in a loop
without delay, by the roots of their equations. The error is the greatest of a watched signal at the communication
points, over the signal's greatest value. The cost is in steps of components per communication step and component: what
FMUs count themselves, whoever lets them step. Every measurement is a process of its own.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import fsolve

ROOT = Path(__file__).resolve().parents[1]
for folder in (ROOT / "tests" / "cosim", ROOT / "tests" / "actuators"):
    sys.path.insert(0, str(folder))
from coupled import coupled_fmus  # noqa: E402

from gapsense.problems import FmuError  # noqa: E402
from gapsense.studies.devices import VALVE  # noqa: E402

Vector = npt.NDArray[np.float64]
GAINS, BENDS, BIASES = [-1.2, 0.7, 1.5, 0.9, 0.8], [0.4, 0.3, -0.2, 0.5, 0.1], [0.3, -0.5, 0.2, 0.1, -0.4]
STIFFNESS = (1e2, 1e3, 1e4, 1e5, 1e6)  # of the spring between the masses [N/m]
SUPPLY, RESISTANCE, CAPACITY = 24.0, 20.0, 10e-6  # of the circuit [V, Ohm, F]
PARTS, ROW = 16, 20  # with controlled steps: base steps of a communication step of the others, of which a row has 20
LOST = 10.0  # an error above which a run counts as unstable


class Problem(NamedTuple):
    """Components with their values, wires (source, target, mean over a step), and the watched signal's solution."""

    title: str
    step: float  # [s]
    count: int
    components: Mapping[str, tuple[str, Mapping[str, float]]]  # FMU and values
    wires: tuple[tuple[str, str], ...]
    means: Mapping[str, str]  # outputs that are means over a step, for those that are not
    constants: Mapping[str, float]
    watched: str
    solution: Callable[[Vector], Vector]

    @property
    def times(self) -> Vector:
        """Communication points [s]."""
        return np.arange(self.count + 1) * self.step


# The problems.


def circuit_and_valve() -> Problem:
    """A capacitor that is charged over a resistor drives the coil of a valve, until before it lands."""
    return Problem(
        title="(a)",
        step=20e-6,
        count=60,
        components={
            "circuit": ("Circuit", {"supply": SUPPLY, "r": RESISTANCE, "c": CAPACITY}),
            "valve": ("SolenoidValve", {}),
        },
        wires=(("circuit.voltage", "valve.voltage"), ("valve.current", "circuit.current")),
        means={"circuit.voltage": "circuit.voltage_mean"},
        constants={},
        watched="valve.current",
        solution=valve_current,
    )


def valve_current(times: Vector) -> Vector:
    """Current of the valve and its circuit as one system [A]."""
    from test_valve_against_scipy import Oracle

    oracle, scale = Oracle(VALVE), Oracle(VALVE).scale

    def current(y: Vector) -> float:
        reluctance = oracle.gap(y[1] * scale[1])[0] + VALVE.core_reluctance / (1 - abs(y[0]))
        return float(y[0] * scale[0] * reluctance / VALVE.coil_turns**2)

    def rates(t: float, y: Vector, mode: int) -> Vector:
        charge = ((SUPPLY - y[3]) / RESISTANCE - current(y)) / CAPACITY
        return np.append(oracle.rates(t, y[:3], y[3], mode), charge)

    def leaves(t: float, y: Vector, mode: int) -> float:
        return float(oracle.net_force(y[0] * scale[0], y[1] * scale[1]))

    leaves.terminal = True  # type: ignore[attr-defined]
    y = np.array([0.0, VALVE.initial_position / scale[1], 0.0, SUPPLY])
    found, begin = np.zeros(times.size), 0.0
    for mode in (3, 2):
        part = solve_ivp(
            rates, (begin, times[-1]), y, "DOP853", events=[leaves] if mode == 3 else None, args=(mode,),
            rtol=1e-12, atol=1e-14, dense_output=True,
        )  # fmt: skip
        inside = (times >= begin) & (times <= part.t[-1])
        found[inside] = [current(part.sol(t)) for t in times[inside]]
        begin, y = part.t[-1], part.y[:, -1]
    return found


def two_masses(stiffness: float) -> Problem:
    """Two masses on springs of their own, and between them a stiff one with some damping."""
    first, second = {"m": 1.0, "k": 40.0, "d": 0.5, "x0": 0.01}, {"m": 2.0, "k": 60.0, "d": 0.5, "x0": 0.01}
    damping = 1e-4 * stiffness

    def solution(times: Vector) -> Vector:
        """Position of the first mass, by the matrix exponential."""
        a = [-(40.0 + stiffness), -(0.5 + damping), stiffness, damping]
        b = [stiffness / 2, damping / 2, -(60.0 + stiffness) / 2, -(0.5 + damping) / 2]
        step = expm(np.array([[0, 1, 0, 0], a, [0, 0, 0, 1], b]) * (times[1] - times[0]))
        z = [np.array([0.01, 0.0, 0.01, 0.0])]
        for _ in times[1:]:
            z.append(step @ z[-1])
        return np.array(z)[:, 0]

    return Problem(
        title=f"(b) {stiffness:.0e}",
        step=1e-3,
        count=2000,
        components={
            "mass": ("Mass", first),
            "spring": ("Spring", {**second, "kc": stiffness, "dc": damping, "parts": 400.0}),
        },
        wires=(("spring.force", "mass.force"), ("mass.x", "spring.x"), ("mass.speed", "spring.speed")),
        means={"spring.force": "spring.force_mean"},
        constants={},
        watched="mass.x",
        solution=solution,
    )


def five_nodes() -> Problem:
    """Five nodes in a ring, the first of which a swinging mass drives too."""
    values = {f"n{i}": (g, b, c) for i, (g, b, c) in enumerate(zip(GAINS, BENDS, BIASES))}

    def solution(times: Vector) -> Vector:
        """The first node, by a root for each time."""

        def off(y: Vector, v: float) -> list[float]:
            u, inputs = np.roll(y, 1), [v, 0.1, 0.2, 0.3, 0.4]
            return [BIASES[i] + GAINS[i] * u[i] + BENDS[i] * np.sin(u[i] + inputs[i]) - y[i] for i in range(5)]

        y, found = np.zeros(5), []
        for v in np.cos(np.sqrt(40.0) * times):
            y = fsolve(off, y, args=(v,), xtol=1e-13)
            found.append(y[0])
        return np.array(found)

    return Problem(
        title="(c)",
        step=0.01,
        count=200,
        components={
            "swing": ("Mass", {"x0": 1.0, "k": 40.0}),
            **{name: ("Node", {"gain": g, "bend": b, "bias": c}) for name, (g, b, c) in values.items()},
        },
        wires=(*((f"n{(i - 1) % 5}.y", f"n{i}.u") for i in range(5)), ("swing.x", "n0.v")),
        means={},
        constants={"swing.force": 0.0, **{f"n{i}.v": 0.1 * i for i in range(1, 5)}},
        watched="n0.y",
        solution=solution,
    )


PROBLEMS = {p.title: p for p in (circuit_and_valve(), *map(two_masses, STIFFNESS), five_nodes())}


def built(problem: Problem, folder: Path) -> dict[str, Path]:
    """The FMU of each component, which starts with its values, in the folder above: built once for all masters."""
    own = {**{p.partition(".")[0]: {} for p in problem.constants}}
    for port, value in problem.constants.items():
        own[port.partition(".")[0]][port.partition(".")[2]] = value
    paths = {}
    for name, (fmu, values) in problem.components.items():
        if fmu in coupled_fmus.MODELS:
            paths[name] = folder.parent / f"{name}.fmu"
            if not paths[name].is_file():
                coupled_fmus.build_one(fmu, folder.parent, 2, {**values, **own.get(name, {})}, name)
        else:
            paths[name] = next(
                path for kind in ("native", "fmus") if (path := ROOT / "build" / kind / f"{fmu}.fmu").is_file()
            )
    return paths


def linked(problem: Problem, has_means: bool = False) -> list[tuple[str, str]]:
    """Wires of a problem, from means where there are some."""
    return [(problem.means.get(source, source) if has_means else source, target) for source, target in problem.wires]


# Masters: each gives the watched signal at the communication points after the start.


def ours(
    problem: Problem, folder: Path, method: str, has_means: bool = False, goes_on: bool = False, allowed: float = 0.0
) -> Vector:
    """Gapsense; `goes_on` where inputs go in straight lines, `allowed` is the error of steps that are controlled."""
    from gapsense.cosim import run

    paths, parts = built(problem, folder), PARTS if allowed else 1
    lines = ['title = "Coupling"', "[experiment]", f"stop = {problem.count * problem.step!r}"]
    lines += [f"base_step = {problem.step / parts!r}", f'method = "{method}"', "loop_tolerance = 1e-10"]
    lines += ['inputs = "linear"'] if goes_on else []
    lines += [f"step_control = {allowed!r}"] if allowed else []
    for name, path in paths.items():
        lines += [f"[components.{name}]", f'fmu = "{path}"']
    for (source, target), (plain, _) in zip(linked(problem, has_means), problem.wires):
        lines += ["[[connections]]", f'from = "{source}"', f'to = "{target}"', "factor = 1.0"]
        lines += ["mean = true"] if source != plain else []
    if problem.constants:
        lines += ["[inputs]", *(f'"{port}" = {value!r}' for port, value in problem.constants.items())]
    lines += ["[record]", f'signals = ["{problem.watched}"]', f"decimation = {parts * ROW}"] if allowed else []
    (folder / "scenario.toml").write_text("\n".join(lines))
    return run(folder / "scenario.toml")[problem.watched][1:]


def fmpy_ssp(problem: Problem, folder: Path) -> Vector:
    """`simulate_ssp` of fmpy."""
    from fmpy.ssp.simulation import simulate_ssp

    rows = simulate_ssp(str(package(problem, folder)), 0.0, (problem.count - 0.5) * problem.step, problem.step)
    return np.asarray(rows[problem.watched])[-problem.count :]


def package(problem: Problem, folder: Path) -> Path:
    """The problem as an SSP package."""
    paths, elements = built(problem, folder), ""
    used = {port: "output" for port, _ in problem.wires} | {problem.watched: "output"}
    used |= {port: "input" for _, port in problem.wires}
    for name, path in paths.items():
        own = [(port.partition(".")[2], kind) for port, kind in used.items() if port.partition(".")[0] == name]
        connectors = "".join(f"<ssd:Connector name='{v}' kind='{kind}'><ssc:Real/></ssd:Connector>" for v, kind in own)
        elements += (
            f"<ssd:Component name='{name}' type='application/x-fmu-sharedlibrary' source='resources/{path.name}'>"
            f"<ssd:Connectors>{connectors}</ssd:Connectors></ssd:Component>"
        )
    ends = [(*source.split(".", 1), *target.split(".", 1)) for source, target in problem.wires]
    wires = "".join(
        f"<ssd:Connection startElement='{a}' startConnector='{b}' endElement='{c}' endConnector='{d}'/>"
        for a, b, c, d in ends
    )
    text = (
        "<?xml version='1.0' encoding='UTF-8'?><ssd:SystemStructureDescription version='1.0' name='coupling'"
        " xmlns:ssd='http://ssp-standard.org/SSP1/SystemStructureDescription'"
        " xmlns:ssc='http://ssp-standard.org/SSP1/SystemStructureCommon'><ssd:System name='coupling'>"
        f"<ssd:Elements>{elements}</ssd:Elements><ssd:Connections>{wires}</ssd:Connections></ssd:System>"
        "</ssd:SystemStructureDescription>"
    )
    with zipfile.ZipFile(folder / "coupling.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", text)
        for path in paths.values():
            archive.write(path, f"resources/{path.name}")
    return folder / "coupling.ssp"


def libcosim(problem: Problem, folder: Path) -> Vector:
    """libcosimpy, its fixed-step algorithm."""
    from fmpy import read_model_description
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.ERROR)
    execution, paths = CosimExecution.from_step_size(round(problem.step * 1e9)), built(problem, folder)
    slaves = {name: CosimLocalSlave(str(path), name) for name, path in paths.items()}
    index = {name: execution.add_local_slave(slave) for name, slave in slaves.items()}
    models = {name: read_model_description(str(path)) for name, path in paths.items()}

    def end(port: str) -> tuple[int, int]:
        """Slave and variable of a port."""
        name, _, variable = port.partition(".")
        found = {v.name: v.valueReference for v in models[name].modelVariables}
        return index[name], found[variable]

    for source, target in problem.wires:
        execution.connect_real_variables(*end(source), *end(target))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    slave, reference = end(problem.watched)
    found = []
    for _ in range(problem.count):
        execution.step()
        found.append(observer.last_real_values(slave, [reference])[0])
    return np.array(found)


def cofmupy(problem: Problem, folder: Path, method: str, is_iterative: bool) -> Vector:
    """CoFmuPy's coordinator, in an environment of its own."""
    python = ROOT / ".venv-cofmupy" / "bin" / "python"
    if not python.exists():
        raise ImportError("cofmupy", name="cofmupy")
    ends = [[dict(zip(("id", "variable"), port.split(".", 1))) for port in wire] for wire in problem.wires]
    given: dict[str, dict[str, float]] = {name: {} for name in problem.components}
    for port, value in problem.constants.items():
        given[port.partition(".")[0]][port.partition(".")[2]] = value
    config = {
        "fmus": [{"id": n, "path": str(p), "initialization": given[n]} for n, p in built(problem, folder).items()],
        "connections": [
            {"source": {**a, "unit": "", "type": "fmu"}, "target": {**b, "unit": "", "type": "fmu"}} for a, b in ends
        ],
        "cosim_method": method, "iterative": is_iterative, "root": "", "edge_sep": " -> ", "data_storages": [],
    }  # fmt: skip
    watched = [problem.watched.split(".", 1)]
    task = {"config": config, "count": problem.count, "step": problem.step, "watched": watched}
    (folder / "task.json").write_text(json.dumps(task))
    command = [python, Path(__file__).with_name("cofmupy_peer.py"), folder / "task.json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return np.array(next(iter(json.loads(done.stdout.splitlines()[-1])["rows"].values()))[-problem.count :])


MASTERS: dict[str, Callable[[Problem, Path], Vector]] = {
    "gapsense, gauss-seidel": lambda p, f: ours(p, f, "gauss-seidel"),
    "gapsense, gauss-seidel, means": lambda p, f: ours(p, f, "gauss-seidel", has_means=True),
    "gapsense, jacobi": lambda p, f: ours(p, f, "jacobi"),
    "gapsense, gauss-seidel, linear": lambda p, f: ours(p, f, "gauss-seidel", goes_on=True),
    "gapsense, jacobi, linear": lambda p, f: ours(p, f, "jacobi", goes_on=True),
    "gapsense, gauss-seidel, linear, 1e-3": lambda p, f: ours(p, f, "gauss-seidel", goes_on=True, allowed=1e-3),
    "gapsense, iterative, means, 1e-3": lambda p, f: ours(p, f, "iterative", has_means=True, allowed=1e-3),
    "gapsense, iterative": lambda p, f: ours(p, f, "iterative"),
    "gapsense, iterative, means": lambda p, f: ours(p, f, "iterative", has_means=True),
    "fmpy, simulate_ssp": fmpy_ssp,
    "libcosim": libcosim,
    "CoFmuPy, gauss_seidel": lambda p, f: cofmupy(p, f, "gauss_seidel", is_iterative=False),
    "CoFmuPy, iterative": lambda p, f: cofmupy(p, f, "jacobi", is_iterative=True),
}


# Measure.


def measure(master: str, title: str, fmus: str) -> dict[str, Any]:
    """Error and cost of one run, or why there are none; `fmus` is a folder that the FMUs of the problem share."""
    problem = PROBLEMS[title]
    with tempfile.TemporaryDirectory(dir=fmus) as folder:
        try:
            found = MASTERS[master](problem, Path(folder))
        except FmuError:  # of values that are no longer finite
            return {"error": None}
        except ImportError as error:
            return {"missing": str(error.name or error)}
        except Exception as error:  # of any master: that it does not run is a result
            return {"refused": f"{type(error).__name__}: {error}"[:300]}
    expected = problem.solution(problem.times)
    every = (expected.size - 1) // found.size
    with np.errstate(all="ignore"):
        error = float(np.max(np.abs(found - expected[every::every])) / np.max(np.abs(expected)))
    return {"error": error if np.isfinite(error) else None}


def apart(master: str, title: str, fmus: Path) -> dict[str, Any]:
    """The same in a process of its own, with the steps that its FMUs have counted."""
    with tempfile.NamedTemporaryFile("r") as calls:
        environment = {**os.environ, "COUPLED_CALLS": calls.name}
        command = [sys.executable, __file__, "--one", master, title, fmus]
        done = subprocess.run(command, env=environment, capture_output=True, text=True)
        counted = [int(line) for line in calls.read().split() if int(line)]
    try:
        found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    except (IndexError, ValueError):
        return {"refused": f"its process ended with exit code {done.returncode}"}
    problem, found["steps"] = PROBLEMS[title], None
    with suppress(ZeroDivisionError):
        found["steps"] = sum(counted) / len(counted) / problem.count
    return found


def cell(found: Mapping[str, Any]) -> str:
    """Error and cost, as the table shows them."""
    if "missing" in found:
        return "-"
    if "refused" in found:
        return "refused"
    steps = "" if found["steps"] is None else f", {found['steps']:.2g}"
    return f"unstable{steps}" if found["error"] is None or found["error"] > LOST else f"{found['error']:.1e}{steps}"


def main() -> None:
    """Print the table: error and steps of each component per communication step."""
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(measure(*sys.argv[2:5])), flush=True)
        return
    titles = list(PROBLEMS) if "--small" not in sys.argv else ["(b) 1e+04"]
    print("| master | " + " | ".join(titles) + " |")
    print("| --- " * (len(titles) + 1) + "|")
    said = []
    with tempfile.TemporaryDirectory() as home:
        folders = {title: Path(home, str(k)) for k, title in enumerate(titles)}
        for folder in folders.values():
            folder.mkdir()
        for master in MASTERS:
            row = {title: apart(master, title, folder) for title, folder in folders.items()}
            print(f"| {master} | " + " | ".join(map(cell, row.values())) + " |", flush=True)
            said += [f"{master}, {title}: {found['refused']}" for title, found in row.items() if "refused" in found]
            missing = [found["missing"] for found in row.values() if "missing" in found]
            said += [f"{master}: `{name}` is not installed" for name in missing[:1]]
    print(*said, sep="\n")


if __name__ == "__main__":
    main()
