"""A scenario as an object: the content of a scenario file, and its FMUs once they are loaded."""

from __future__ import annotations

import re
import weakref
from collections.abc import Callable, Mapping, Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from gapsense._os.files import write_atomically
from gapsense.cosim.check import check, describe_fmu, find_fmus, prepare
from gapsense.cosim.fmu.descriptions import Description, find_fmu
from gapsense.cosim.result.result import Measure, Result
from gapsense.cosim.result.sidecar import relative
from gapsense.cosim.run.master import Master, Progress
from gapsense.cosim.run.run import run, run_once
from gapsense.cosim.scenario.keys import FILE, key_of
from gapsense.cosim.scenario.read import Document, document_of, scenario_file
from gapsense.cosim.show import pages
from gapsense.problems import ScenarioError, suggest
from gapsense.tables import Section, flatten_table

if TYPE_CHECKING:
    from gapsense.cosim.convergence import Convergence
    from gapsense.many.sweep import Sweep


Self = TypeVar("Self", bound="Scenario")
KEYS = ("step", "offset", "edge", "parameters", "board", "firmware", "clock")  # of a component, beside its parameters
UNFIT = re.compile(r"[^\w .-]")  # for the name of a file


class Scenario:
    """A co-simulation that a program puts together, runs, changes and runs again.

    What a scenario file says is in `data`, as TOML is read; whatever has no method of its own is changed there. What is
    wrong is told when the scenario is checked or run, all at once and in the words for a file.

    Parameters
    ----------
    title : str
        Title of tables and figures; what the scenario is called.
    folder : str or Path
        Where relative paths start: of FMUs, parameter sets and other files.
    fmus : str or Path, optional
        Folder of the FMUs that are given by name, as for `run`.
    experiment : float or str
        Keys of `[experiment]`: `stop` and `base_step` [s] are needed.
    """

    master: Master | None = None
    end: Callable[[], object] | None = None

    def __init__(
        self,
        title: str = "scenario",
        folder: str | PathLike[str] = ".",
        fmus: str | Path | None = None,
        **experiment: float | str,
    ) -> None:
        self.data: dict[str, Any] = {"title": title, "experiment": plain(experiment), "components": {}}
        self.path, self.fmus = Path(folder).resolve() / (UNFIT.sub("_", title) or "scenario"), fmus

    @classmethod
    def load(cls: type[Self], source: str | Path, fmus: str | Path | None = None) -> Self:
        """The scenario of a file, or of `scenario.toml` in a folder."""
        made = cls(fmus=fmus)
        made.data, made.path = dict(document_of(source).data), scenario_file(source).resolve()
        return made

    def save(self, path: str | Path) -> Path:
        """Write the scenario file, at a path that ends in `.toml`, or `scenario.toml` in a folder.

        An old one is replaced.
        """
        path = Path(path)
        file = path if path.suffix == ".toml" else path / "scenario.toml"
        write_document(self.document, file)
        return file

    @property
    def document(self) -> Document:
        """What `cosim.run`, `check` and `sweep` take."""
        return Document(self.path, plain(self.data))

    def add(
        self: Self, name: str, fmu: str | PathLike[str], values: Mapping[str, Any] | None = None, **more: Any
    ) -> Self:
        """Add a component.

        Parameters
        ----------
        name : str
            Its name in the scenario.
        fmu : str or Path
            One of the FMUs by name, or the path of an FMU file.
        values : mapping, optional
            Parameters, constant inputs and the seed by name, as for `set`.
        more
            The same where the name has no dots; `step`, `offset`, `edge`, `parameters`, `board`, `firmware` and `clock`
            are the keys of `[components.NAME]`.
        """
        if name in self.components:
            raise ScenarioError([f"{self.path.name}: there is a component `{name}` already. Choose another name."])
        own = {key: plain(more.pop(key)) for key in KEYS if key in more}
        self.components[name] = {"fmu": Path(fspath(fmu)).as_posix(), **own}
        given: dict[str, Any] = {**(values or {}), **more}
        for variable, value in flatten_table(plain(given)):
            self.set(f"{name}.{variable}", value)
        return self

    def connect(self: Self, source: str | Mapping[str, str], *targets: str, **conversion: float | str | bool) -> Self:
        """Connect an output to inputs, which get nothing else any more.

        Parameters
        ----------
        source : str or mapping
            Output as `component.variable`. A component alone: each of its outputs goes to the input of that name of
            the targets, which are components too. A mapping gives the output for each input, as `[connect]` does.
        targets : str
            Inputs.
        conversion : float, str or bool
            `factor`, `bias`, `unit`, `delayed` and `mean` as in `[[connections]]`.
        """
        if not isinstance(source, str):
            for target, output in source.items():
                self.connect(output, target)
            return self
        for target in targets:
            for output, to in self.pairs(source, target):
                self.release(to)
                if conversion:
                    self.section("connections", []).append({"from": output, "to": to, **plain(conversion)})
                else:
                    self.section("connect")[to] = output
        return self

    def set(self: Self, name: str, value: Any) -> Self:
        """Give a parameter, a constant input or the seed of a component a value.

        Parameters
        ----------
        name : str
            As `component.variable`.
        value : float, int, bool, str or Path
            An input that was connected has this value instead.
        """
        component, variable = self.split(name)
        description = self.description(component)
        known = description.variables.get(variable) if description else None
        if known is not None and known.causality == "input":
            self.release(name)
            self.section("inputs")[name] = plain(value)
        elif variable == "seed":
            self.section("seeds")[component] = plain(value)
        else:
            own = self.components[component].setdefault("set", {})
            drop(own, variable)
            own[variable] = plain(value)
        return self

    def record(self: Self, *signals: str, decimation: int = 1) -> Self:
        """Record the signals of these names or patterns, by default all, at every `decimation`-th base step."""
        self.data["record"] = {"signals": list(signals) or ["*"], "decimation": decimation}
        return self

    def metric(self: Self, name: str, kind: str, signal: str, **more: Any) -> Self:
        """Measure something at the end of every run; `more` has the other keys of `[metrics.NAME]`."""
        self.section("metrics")[name] = {"kind": kind, "signal": signal, **plain(more)}
        return self

    def event(self: Self, name: str, target: str, action: str, **more: Any) -> Self:
        """Let something happen to an input or a parameter in a run; `more` has the other keys of `[events.NAME]`."""
        self.section("events")[name] = {"target": target, "action": action, **plain(more)}
        return self

    @property
    def components(self) -> dict[str, Any]:
        """The section of components."""
        found: dict[str, Any] = self.section("components")
        return found

    def section(self, name: str, empty: Any = None) -> Any:
        """A section of `data`, made if there is none."""
        return self.data.setdefault(name, {} if empty is None else empty)

    def split(self, name: str) -> tuple[str, str]:
        """Component and variable of a name; the component must be there."""
        component, dot, variable = name.partition(".")
        if component in self.components and variable:
            return component, variable
        found = f"there is no component `{component}`. {suggest(component, self.components)}"
        raise ScenarioError([f"{self.path.name}, {name}: {found if dot else '`component.variable` expected.'}"])

    def description(self, component: str) -> Description | None:
        """Model description of a component's FMU, or None where there is none; a run tells why."""
        fmus = find_fmus(self.path) if self.fmus is None else Path(self.fmus)
        try:
            return describe_fmu(find_fmu(self.components[component]["fmu"], self.path, fmus))
        except (OSError, ValueError):
            return None

    def pairs(self, source: str, target: str) -> list[tuple[str, str]]:
        """Outputs and inputs to connect: two ports, or those of the same name of two components."""
        if "." in source or "." in target:
            return [(".".join(self.split(source)), ".".join(self.split(target)))]
        ends = [self.description(self.split(f"{name}.*")[0]) for name in (source, target)]
        outputs, inputs = ([v.name for v in d.of(c)] if d else [] for d, c in zip(ends, ("output", "input")))
        if not set(outputs) & set(inputs):
            known = f"`{source}` has {', '.join(outputs) or 'none'}; `{target}` takes {', '.join(inputs) or 'nothing'}"
            raise ScenarioError([f"{self.path.name}: no output and input of one name: {known}. Name both."])
        return [(f"{source}.{name}", f"{target}.{name}") for name in outputs if name in inputs]

    def release(self, target: str) -> None:
        """Let an input be driven by nothing."""
        drop(self.data.get("connect", {}), target)
        drop(self.data.get("inputs", {}), target)
        if "connections" in self.data:
            self.data["connections"] = [c for c in self.data["connections"] if c.get("to") != target]

    def check(self, variant: str | None = None) -> list[str]:
        """Problems of the scenario, found without running it, one sentence each."""
        return check(self.document, variant, self.fmus)

    def run(self, variant: str | None = None, seed_shift: int = 0, progress: Progress | None = None) -> Result:
        """Run it as `cosim.run` does.

        FMUs are loaded for the first run, and again only if components or connections have changed.
        """
        read, descriptions = prepare(self.document, variant, self.fmus)
        if read.experiment.isolation == "process":
            return run(self.document, variant, self.fmus, seed_shift, progress)
        if self.master is None or not self.master.adopt(read, descriptions):
            self.close()
            self.master = Master(read, descriptions)
            self.end = weakref.finalize(self, Master.close, self.master)
        try:
            return run_once(self.master, seed_shift, progress)
        except BaseException:
            self.close()  # what has failed is not run again
            raise

    def sweep(
        self,
        grid: Mapping[str, Sequence[Any]] | None = None,
        seeds: int | None = None,
        workers: int = 2,
        out: str | Path | None = None,
        measure: Measure | None = None,
        progress: Progress | None = None,
    ) -> Sweep:
        """Run every combination of values, with several seeds, and collect the metrics, as `cosim.sweep` does.

        The `grid` has values by parameter; it becomes the scenario's `[sweep]`.
        """
        from gapsense.many.sweep import sweep  # which stands above this package

        if alone := [name for name, values in (grid or {}).items() if isinstance(values, (str, bool, int, float))]:
            raise ScenarioError([f"sweep.{alone[0]}: one value found, a list of values expected. Correct it."])
        if grid is not None:
            self.data["sweep"] = {name: [plain(value) for value in values] for name, values in grid.items()}
        options = {"out": out, "fmus": self.fmus, "measure": measure, "progress": progress}
        return sweep(self.document, seeds, workers=workers, **options)  # type: ignore[arg-type]

    def converge(self, variant: str | None = None, **options: Any) -> Convergence:
        """Tell how large the error of its base step is, with the options of `gapsense.converge`."""
        from gapsense.cosim.convergence import converge  # which stands above this package

        return converge(self.document, variant, self.fmus, **options)

    def close(self) -> None:
        """Free the FMUs; the next run loads them again."""
        if self.end:
            self.end()
        self.master = self.end = None

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        components = ", ".join(f"{name} ({own.get('fmu')})" for name, own in self.components.items())
        loaded = "loaded" if self.master else "not loaded"
        return f"<Scenario {self.data.get('title')!r}: {components or 'no components'}, {loaded}>"

    def _repr_html_(self) -> Any:
        return pages().of_scenario(self.data, repr(self))


def drop(table: dict[str, Any], name: str) -> None:
    """Remove a dotted name from a table, however it was written."""
    table.pop(name, None)
    head, dot, rest = name.partition(".")
    if dot and isinstance(table.get(head), dict):
        drop(table[head], rest)
        if not table[head]:
            del table[head]


def plain(value: Any) -> Any:
    """A value as TOML has it: lists for sequences, texts for paths, numbers for those of numpy."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, PathLike):
        return Path(value).as_posix()
    return value.item() if hasattr(value, "item") else value


# The content of a scenario as a TOML file, in whichever folder.


def write_document(document: Document, path: Path) -> None:
    """Write a scenario file; what it names by a relative path is found from there too."""
    import tomli_w  # here, so that a run that writes no file starts fast

    data = rebase_tables(document.data, FILE, document.path.parent.resolve(), path.parent.resolve())
    text = tomli_w.dumps(data, multiline_strings="\\r" not in repr(data))  # over several lines TOML drops these
    write_atomically(path, lambda file: print(text, end="", file=file))


def rebase_tables(tables: Mapping[str, Any], section: Section, old: Path, new: Path) -> dict[str, Any]:
    """Rebase the paths in a table whose file moves from one folder to another."""

    def value(name: str, item: Any) -> Any:
        """Value of a key, whatever it is, as the table in the new folder has it."""
        key = key_of(section, name)
        if isinstance(item, dict):
            return rebase_tables(item, (key and key.section) or section, old, new)
        if isinstance(item, list):
            return [value(name, entry) for entry in item]
        is_path = isinstance(item, str) and key and key.is_path and key.is_path(name, item)
        is_other = is_path and old != new and not Path(item).is_absolute()
        return relative(str(old / item), new) if is_other else item

    return {name: value(name, item) for name, item in tables.items()}
