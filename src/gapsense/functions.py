"""The commands on records and results as functions: same options, and an answer that can be printed, read and drawn.

>>> import gapsense
>>> found = gapsense.inspect("sample_valve.csv")
>>> found.passed
True

Each imports what it needs when it is called.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, TypeAlias

from gapsense.identification.options import MODELS, document_arguments
from gapsense.problems import InputError
from gapsense.shipped import record as shipped

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    from matplotlib.figure import Figure
    from rich.table import Table

    from gapsense.cosim.result.compare import Comparison
    from gapsense.cosim.scenario.records import Baseline

File: TypeAlias = "str | Path"
Data: TypeAlias = "File | Mapping[str, Any] | Sequence[File | Mapping[str, Any]]"
Several: TypeAlias = "str | Sequence[str] | Mapping[str, object]"
Progress: TypeAlias = Callable[[int, int], None]
RTOL, EDGE_STEPS = 1e-9, 1
TABLES = ("_law.csv", "-gap.csv", "_map.csv")  # endings of what is written beside a parameter set
UNITS = {"time": "s", "voltage": "V", "current": "A", "position": "m", "mode": "1", "temperature": "degC"}


def quiet(done: int, total: int) -> None:
    """Progress that nobody looks at."""


@dataclass(frozen=True, repr=False)
class Found:
    """What a function found: `print(found)` shows what the command of the same name prints.

    What was fitted has a standard error, `found.standard_errors["coil.resistance"]` in Ohm: infinite, if the records do
    not tell the value at all, or if it ends at a limit of the search.
    """

    shown: Sequence[Table | str]  # tables and sentences
    passed: bool = True  # False where the command ends with exit code 1
    parameters: Mapping[str, Any] = field(default_factory=dict)  # by name, as `coil.resistance`, in SI units
    standard_errors: Mapping[str, float] = field(default_factory=dict)  # of those that were fitted, in the same units
    signals: Mapping[str, npt.NDArray[np.float64]] = field(default_factory=dict)  # by `Estimator.output`
    doubts: Sequence[str] = ()  # what cannot be right, and why
    notes: Sequence[str] = ()  # about the record, and what was left out
    files: Sequence[Path] = ()  # that were written
    drawn: Callable[[], Figure] | None = None
    kept: Any = None  # a folder that is removed with this object

    def __str__(self) -> str:
        from gapsense.report.table import text

        return text(*self.notes, *self.shown, *self.doubts)

    def __repr__(self) -> str:
        return f"<Found: {'passed' if self.passed else 'failed'}, {len(self.parameters)} parameters>"

    def _repr_markdown_(self) -> str:
        return f"```text\n{self}\n```"

    def plot(self) -> Figure:
        """The figure that the command draws."""
        if self.drawn is None:
            raise ValueError("there is nothing to draw.")
        return self.drawn()


@document_arguments
def inspect(
    data: Data,
    *,
    period: float | None = None,
    resistance: float | None = None,
    column: Several = (),
    separator: str = ",",
    decimal: str = ".",
    clipped: bool = False,
    figure: File | None = None,
) -> Found:
    """Show what can be learnt from a record of voltage and current, before anything is fitted.

    Returns
    -------
    Found
        Tables of what is in the record.
    """
    from gapsense.identification.inspection.facts import facts
    from gapsense.identification.inspection.show import inspection_figure, inspection_tables
    from gapsense.identification.measurements.reading import read_records, reading
    from gapsense.identification.show import about

    picture = check_figure(figure)
    how = reading(pairs(column), separator=separator, decimal=decimal, may_clip=True)
    with files(data) as paths:
        records = read_records(paths, how, needs="samples")
    found = [facts(record, period, clipped) for record in records]
    shown = [part for r, f in zip(records, found) for part in (*inspection_tables(r, f, resistance), *about(r))]
    return answer(shown, lambda: inspection_figure(records, found), picture)


@document_arguments
def identify(
    data: Data,
    *,
    model: str = "auto",
    commission: bool = False,
    parameters: File | None = None,
    assume: bool = False,
    validate: Data = (),
    period: float | None = None,
    voltage: str = "auto",
    temperature: str | None = None,
    forms: str = "auto",
    hold: Several = (),
    inductance: File | None = None,
    driver: str | None = None,
    accuracy: str | None = None,
    column: Several = (),
    separator: str = ",",
    decimal: str = ".",
    clipped: bool = False,
    starts: int = 6,
    seed: int = 1,
    out: File | None = None,
    figure: File | None = None,
    progress: Progress = quiet,
) -> Found:
    """Identify a solenoid valve or a coil from voltage and current of complete operations, recorded from rest.

    Returns
    -------
    Found
        Its `parameters` and their `standard_errors` by name; `passed` is False where the model does not explain the
        records.
    """
    from gapsense.identification import identify as way
    from gapsense.identification.measurements.reading import reading

    if model not in MODELS:
        raise ValueError(f"--model: `{model}` found, one of {', '.join(MODELS)} expected.")
    known = None if parameters is None else shipped(parameters)
    others: dict[str, Any] = {"model": model, "period": period, "temperature": temperature, "forms": forms}
    others |= {"hold": pairs(hold), "inductance": path(inductance), "driver": driver, "accuracy": accuracy}
    if commission:
        believed = way.check_believed(known, others)
        form: dict[str, Any] = {"column": column, "separator": separator, "decimal": decimal, "clipped": clipped}
        form |= {"assume": assume, "validate": validate, "voltage": voltage}
        return _commission(data, believed, **form, out=out, figure=figure, progress=progress)
    with files(data) as paths, files(validate, 0) as kept, set_file(out, data, validate, inductance) as (to, folder):
        how, picture = reading(pairs(column), voltage, separator, decimal, clipped), check_figure(figure)
        given = way.read(paths, how, kept, known, assume, **others)
        found = way.identify(given, to, starts, seed, progress)._asdict()
        return answer(found.pop("shown"), found.pop("figure"), picture, to=to, kept=folder, **found)


@document_arguments
def commission(
    data: Data,
    parameters: File,
    *,
    assume: bool = False,
    validate: Data = (),
    voltage: str = "auto",
    column: Several = (),
    separator: str = ",",
    decimal: str = ".",
    clipped: bool = False,
    out: File | None = None,
    figure: File | None = None,
    progress: Progress = quiet,
) -> Found:
    """Find all parameters of a reluctance actuator, including core losses, from records that start at rest.

    Returns
    -------
    Found
        Its `parameters` and their `standard_errors` by name; `passed` is False where the model does not explain the
        records.
    """
    from gapsense.identification.actuator import fit, show
    from gapsense.identification.assumptions import ask
    from gapsense.identification.measurements.reading import read_records, reading
    from gapsense.identification.parameter_set import parameters_of, read_sets
    from gapsense.identification.scale import GUESSED

    picture, believed = check_figure(figure), shipped(parameters)
    known, (given, marked) = parameters_of("mhe", believed), read_sets([believed])
    lacking = show.missing(known, {*given} - {*marked})
    if not assume:
        ask(lacking, {port.name: port for port in show.PORTS.values()}, believed.name, "the component `Mhe`")
    how = reading(pairs(column), voltage, separator, decimal, clipped)
    with files(data) as paths, files(validate, 0) as others, set_file(out, data, validate) as (to, folder):
        records, kept = (read_records(group, how, needs="rest") for group in (paths, others))
        result = fit.commission(records, known, progress, show.doubts(lacking))
        names = " ".join(path.name for path in paths)
        given = {name: value for name, value in given.items() if name not in {*GUESSED} & {*marked}}
        show.write_actuator(to, result, given, f"gapsense commission {names} --parameters {believed.name}", lacking)
        checks = [fit.validate(result.parameters, record, result.beyond) for record in kept]
        return answer(
            show.actuator_tables(result, known, checks, lacking),
            lambda: show.actuator_figure(result, checks),
            picture,
            to=to,
            kept=folder,
            passed=result.is_explained,
            standard_errors=show.standard_errors(result),
        )


_commission = commission


def turns_are_assumed(
    turns: float | None, given: Collection[str], marked: Collection[str], assume: bool, source: str
) -> bool:
    """Whether nobody gave the turns: they are asked for, unless those of `source` may be assumed."""
    from gapsense.identification.assumptions import ask
    from gapsense.identification.valve.show import BY_NAME

    is_assumed = turns is None and ("coil.turns" not in given or "coil.turns" in marked)
    if is_assumed and not assume:
        ask(["coil.turns"], BY_NAME, "--turns", source, ", or as `--turns`")
    return is_assumed


@document_arguments
def gap_law(
    data: File,
    *,
    turns: float | None = None,
    parameters: File | None = None,
    assume: bool = False,
    column: Several = (),
    out: File | None = None,
    figure: File | None = None,
) -> Found:
    """Make a gap law from inductances of a coil that were measured at known gaps.

    Returns
    -------
    Found
        Its `parameters`, which `identify` takes from the file, and their `standard_errors`.
    """
    from gapsense.identification.assumptions import list_values, meanings
    from gapsense.identification.gap_law.laws import best_law, candidates
    from gapsense.identification.gap_law.show import gap_law_figure, gap_law_tables, standard_errors, write_gap_law
    from gapsense.identification.gap_law.table import columns_given, read_inductances
    from gapsense.identification.identify import TABLE_I
    from gapsense.identification.parameter_set import parameters_of, read_sets
    from gapsense.identification.valve.show import BY_NAME

    picture, source, known = check_figure(figure), Path(data), path(parameters)
    given, marked = read_sets([known] if known else [])
    par = parameters_of("solenoid_valve", known)
    is_assumed = turns_are_assumed(turns, given, marked, assume, TABLE_I)
    number = turns or float(par.coil_turns)
    measured = read_inductances(source, columns_given(pairs(column)))
    found = candidates(measured.gap, number**2 / measured.inductance)
    upper = float(measured.gap[-1])
    taken, upper = best_law(found), max(float(par.stop_upper), upper) if "stop.upper" in given else upper
    replaced = ("coil.turns", "core.reluctance", "gap.")
    assumed = [*["coil.turns"] * is_assumed, *(name for name in marked if not name.startswith(replaced))]
    shown = gap_law_tables(measured, number, found, taken)
    if assumed:
        values = list_values({**given, "coil.turns": number}, BY_NAME, assumed)
        shown = [*shown, f"Assumed: {values}.", *meanings(assumed)]
    with set_file(out, data) as (to, folder):
        written = write_gap_law(to, taken.law, number, upper, given, f"gapsense gap-law {source.name}", assumed)
        return answer(
            shown,
            lambda: gap_law_figure(measured, number, taken),
            picture,
            to=to,
            files=written[1:],
            kept=folder,
            standard_errors=standard_errors(taken, number),
        )


@document_arguments
def fem(
    data: File,
    *,
    turns: float | None = None,
    current: float | None = None,
    symmetry: int = 1,
    closed: float | None = None,
    supply: float | None = None,
    parameters: File | None = None,
    assume: bool = False,
    column: Several = (),
    separator: str = ",",
    decimal: str = ".",
    out: File | None = None,
    figure: File | None = None,
) -> Found:
    """Make plant and estimators from a table of flux linkage and force that finite elements gave.

    Returns
    -------
    Found
        Its `parameters`; `passed` is False where the table contradicts itself, and `doubts` say where.
    """
    from gapsense.identification.assumptions import meanings
    from gapsense.identification.fem import show
    from gapsense.identification.fem.reading import Given, read_solved
    from gapsense.identification.measurements.reading import reading
    from gapsense.identification.parameter_set import read_sets
    from gapsense.identification.scale import GUESSED, untold_losses
    from gapsense.identification.valve.show import BY_NAME

    picture, source, how = check_figure(figure), Path(data), reading(pairs(column), "end", separator, decimal)
    known, marked = read_sets([Path(parameters)] if parameters else [])
    no_turns = turns_are_assumed(turns, known, marked, assume, "the component `Mhe`")
    number = float(turns or known.get("coil.turns", BY_NAME["coil.turns"].start))
    points = read_solved(source, how, Given(number, current, float(symmetry), closed))
    stops = {"stop.lower": float(points.gap[0]), "stop.upper": float(points.gap[-1])}
    given = {"initial.position": known.get("stop.upper", stops["stop.upper"]), **stops, **known}
    assumed = [*["coil.turns"] * no_turns, *(n for n in stops if n not in known), *marked]
    models = show.make_models(points, number, float(given["stop.lower"]), float(given["stop.upper"]))
    tuning, told = show.windows(models, given, supply)
    losses = untold_losses(number, models.reduced.saturation, {*known} - {*marked})
    every = {**losses, **tuning}  # what was assumed before is made anew
    tuning = {name: value for name, value in every.items() if name not in known or name in marked}
    assumed = [*dict.fromkeys((*assumed, *(name for name in GUESSED if name in tuning)))]
    shown = [*show.fem_tables(models), *told, *show.beyond(points, given, assumed), *meanings(assumed)]
    wrong = show.doubts(models)
    with set_file(out, data) as (to, folder):
        files = show.write_fem(to, models, {**given, **tuning}, f"gapsense fem {source.name}", assumed)
        return answer(
            shown,
            lambda: show.fem_figure(models),
            picture,
            to=to,
            files=files,
            kept=folder,
            passed=not wrong,
            doubts=wrong,
        )


@document_arguments
def estimate(
    data: Data,
    *,
    estimator: str | Sequence[str] | None = None,
    parameters: File | Sequence[File] = (),
    column: Several = (),
    separator: str = ",",
    decimal: str = ".",
    clipped: bool = False,
    offset: Several = (),
    fmus: File | None = None,
    out: File | None = None,
    figure: File | None = None,
    progress: Progress = quiet,
) -> Found:
    """Run estimators, through their FMUs, on a measured record.

    Returns
    -------
    Found
        Its `signals` by `Estimator.output`; `passed` is False where an estimator cannot be right, and `doubts` say why.
    """
    from gapsense.cosim.check import find_fmus
    from gapsense.fmi.components import components_folder, find_components
    from gapsense.identification import estimate as judge
    from gapsense.identification.measurements.prepare import thin
    from gapsense.identification.measurements.reading import read_records, reading
    from gapsense.identification.parameter_set import read_sets, take_values
    from gapsense.identification.show import about

    picture, every, folder = check_figure(figure), components_folder(), path(fmus) or find_fmus(Path("here"))
    sets = [shipped(file) for file in ([parameters] if isinstance(parameters, (str, Path)) else parameters)]
    wanted = ",".join([estimator] if isinstance(estimator, str) else estimator or ()) or None
    with files(data) as paths:
        if len(paths) > 1:
            raise InputError([f"{len(paths)} records found, one expected. Estimate each on its own."])
        spare(path(out), paths)
        how = reading(pairs(column), "end", separator, decimal, clipped)
        record = thin(*read_records(paths, how, needs="samples"))
    record, (values, assumed) = judge.subtract_given(record, pairs(offset)), read_sets(sets)
    record = judge.coarsen(record, wanted, judge.estimators(every), values)
    names, left_out = judge.choose_estimators(wanted, judge.estimators(every), record, values)
    fmu_files = [folder / f"{name}.fmu" for name in names]
    if absent := [file for file in fmu_files if not file.is_file()]:
        raise InputError([f"there is no FMU `{absent[0]}`. Build them with `gapsense build`, or correct `--fmus`."])
    take_values(find_components(every, names), sets, find_components(every))  # before any run
    placed = judge.with_placed_edges(record, values) if "Mhe" in names else record
    notes = [*about(placed), *(f"left out: {reason}" for reason in left_out)]
    estimates = judge.run_all(fmu_files, record, values, progress, placed)
    doubts = judge.doubts(record, estimates)
    return answer(
        [*judge.estimate_tables(estimates), *judge.repeat_assumed(values, assumed)],
        lambda: judge.estimate_figure(record, estimates),
        picture,
        files=[judge.save(Path(out), record, estimates)] if out else [],
        passed=not doubts,
        parameters=values,
        signals=judge.columns_of(record, estimates),
        doubts=doubts,
        notes=notes,
    )


def compare(
    result: File,
    reference: File,
    *,
    rtol: float = RTOL,
    atol: float = 0.0,
    tolerance: Several = (),
    edge_steps: int = EDGE_STEPS,
    signal: str | Sequence[str] = (),
    after: float = -math.inf,
    before: float = math.inf,
) -> Mapping[str, Comparison]:
    """Compare two results signal by signal: |result - reference| <= atol + rtol x nominal.

    Parameters
    ----------
    result, reference : paths
        CSV files of results, or two folders of results.
    rtol : float
        Allowed difference as a share of the nominal value.
    atol : float
        Allowed difference in the unit of the signal, in addition.
    tolerance : mapping, optional
        For the signals of a pattern: `{"ekf.*": "1e-6"}`, or `"1e-6,1e-9"` with both.
    edge_steps : int
        Steps of its component by which an edge may come earlier or later.
    signal : str or sequence of str
        Signals or patterns; all others are left out.
    after, before : float
        Only rows from this time on, and up to this one [s].

    Returns
    -------
    mapping
        By file, in the order of their names: each comparison has `passed`, `failing` and `sentences`.

    Raises
    ------
    ValueError
        A file is no result, or an option is wrong.
    """
    from gapsense.cosim.result.pairs import Window, compare_trajectories, pair_files, read_trajectories

    how = tolerances(rtol, atol, edge_steps, pairs(tolerance))
    window = Window(tuple([signal] if isinstance(signal, str) else signal) or ("*",), after, before)
    read = [
        (ours, read_trajectories(ours), read_trajectories(theirs))
        for ours, theirs in pair_files(Path(result), Path(reference))
    ]
    return {str(name): compare_trajectories(ours, theirs, how, window) for name, ours, theirs in read}


def tolerances(rtol: float, atol: float, edge_steps: int, exceptions: Sequence[str]) -> Baseline:
    """Tolerances of all signals; an InputError has all that is wrong with them."""
    from gapsense.cosim.scenario.records import Baseline, Tolerance

    own, problems = {}, []
    for text in exceptions:
        pattern, _, numbers = text.rpartition("=")
        values = parse_numbers(numbers)
        if not pattern or not 1 <= len(values) <= 2 or not are_tolerances(values):
            problems.append(f"--tolerance, {text}: `PATTERN=RTOL` or `PATTERN=RTOL,ATOL` expected. Correct it.")
        else:
            own[pattern] = Tolerance(values[0], values[1] if len(values) == 2 else atol, edge_steps)
    for name, value in {"--rtol": rtol, "--atol": atol}.items():
        if not are_tolerances([value]):
            problems.append(f"{name}: {value} found, a number not below 0 expected. Correct the value.")
    if problems:
        raise InputError(problems)
    return Baseline(Path(), None, Tolerance(rtol, atol, edge_steps), own)


def parse_numbers(text: str) -> list[float]:
    """Parse numbers with commas between; none if something else is there."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        return []


def are_tolerances(values: Sequence[float]) -> bool:
    """True for finite numbers not below 0."""
    return all(math.isfinite(value) and value >= 0.0 for value in values)


def pairs(several: Several) -> list[str]:
    """`NAME=VALUE` texts of an option that may be given several times."""
    if isinstance(several, Mapping):
        return [f"{name}={value}" for name, value in several.items()]
    return [several] if isinstance(several, str) else [*several]


def path(file: File | None) -> Path | None:
    """As a path."""
    return None if file is None else Path(file)


def check_figure(figure: File | None) -> Path | None:
    """Check, before a long run, that a figure can be written to this file."""
    if figure is not None:
        from gapsense.report import plot

        plot.check_file(Path(figure))
    return path(figure)


@contextmanager
def files(data: Data, least: int = 1) -> Iterator[list[Path]]:
    """Records as files: those that are named, and arrays in a temporary folder."""
    several = [data] if isinstance(data, (str, Path, Mapping)) or not isinstance(data, Iterable) else [*data]
    if not all(isinstance(each, (str, Path, Mapping)) for each in several):
        raise TypeError(f"`{data!r:.60}` found; a file, a mapping of arrays, or a list of some expected.")
    if len(several) < least:
        raise InputError(["no record is given. Name a file."])
    with TemporaryDirectory() as folder:
        yield [
            arrays(each, Path(folder, f"record_{k}.csv")) if isinstance(each, Mapping) else shipped(each)
            for k, each in enumerate(several)
        ]


def arrays(columns: Mapping[str, Any], file: Path) -> Path:
    """Arrays by quantity as a CSV file, in SI units."""
    import numpy as np

    from gapsense._os.files import write_atomically, write_columns

    if missing := {"time", "voltage", "current"} - {*columns}:
        raise ValueError(f"a record needs arrays for time, voltage and current; {', '.join(sorted(missing))} missing.")
    try:
        values = {name: np.asarray(column, float) for name, column in columns.items()}
    except (TypeError, ValueError) as error:
        raise InputError([f"a record needs arrays of numbers: {error}."]) from None
    if {column.ndim for column in values.values()} != {1} or len({column.shape for column in values.values()}) > 1:
        shapes = ", ".join(f"{name} {column.shape}" for name, column in values.items())
        raise ValueError(f"shapes {shapes} found, (samples,) for each and equal ones expected. Correct them.")
    write_atomically(file, lambda out: write_columns(out, values, UNITS))
    return file


@contextmanager
def set_file(out: File | None, *read: Data | None) -> Iterator[tuple[Path, TemporaryDirectory[str] | None]]:
    """Where a parameter set is written: the file that was asked for, or one in a temporary folder.

    Neither it nor a table beside it may replace what is `read`.
    """
    if out is not None:
        to = Path(out)
        if to.suffix.lower() != ".toml":
            raise InputError([f"--out: `{to}` found; parameters are written as .toml. Change the ending."])
        named = [each for data in read for each in ([data] if isinstance(data, (str, Path)) else data or ())]
        tables = [to.with_name(f"{to.stem}{ending}") for ending in TABLES]
        spare(to, [Path(each) for each in named if isinstance(each, (str, Path))], tables)
        yield to, None
    else:
        folder = TemporaryDirectory()
        yield Path(folder.name, "found.toml"), folder


def spare(out: Path | None, read: Sequence[Path], beside: Sequence[Path] = ()) -> None:
    """Refuse to write what would replace a file that is read."""
    for file in (out, *beside) if out else ():
        if any(file.resolve() == one.resolve() for one in read):
            raise InputError([f"--out: `{out}` would replace `{file}`, which is read. Choose another name."])


def answer(
    shown: Sequence[Table | str],
    drawn: Callable[[], Figure],
    picture: Path | None,
    *,
    to: Path | None = None,
    files: Sequence[Path] = (),
    **more: Any,
) -> Found:
    """What was found, with the parameters of the set that was written, and the figure."""
    from gapsense.parameters import read_parameters
    from gapsense.report import plot

    more |= {} if to is None else {"parameters": read_parameters(to, [])}
    written = [*([to] if to else []), *files, *([plot.save(drawn(), picture)] if picture else [])]
    return Found(shown, drawn=drawn, files=written, **more)
