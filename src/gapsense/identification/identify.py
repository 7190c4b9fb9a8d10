"""An identification from files to files: what the user asks, which model it is, what was found."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure
from rich.table import Table

from gapsense._os.workers import Progress
from gapsense.actuators.solenoid_valve import Parameters
from gapsense.identification import temperature
from gapsense.identification.assumptions import ask
from gapsense.identification.coil.fit import Coil, fit_coil, validate_coil
from gapsense.identification.coil.show import coil_errors, coil_tables, write_coil
from gapsense.identification.gap_law.laws import Law
from gapsense.identification.measurements.operations import operations
from gapsense.identification.measurements.reading import read_records
from gapsense.identification.measurements.record import Reading, Record, part, with_convention
from gapsense.identification.options import AUTO, CONVENTIONS, FORMS, PLAIN, SHARP
from gapsense.identification.parameter_set import parameters_of
from gapsense.identification.residual import noises
from gapsense.identification.scale import find_tuning
from gapsense.identification.show import measured_and_model, say_what_is_exact
from gapsense.identification.temperature import temperature_notes, temperature_tables, with_temperatures
from gapsense.identification.valve import show
from gapsense.identification.valve.driver import OHMS, Driver, doubt_resistance, driver_notes, read_driver, split_names
from gapsense.identification.valve.fit import Identified, fit_valve
from gapsense.identification.valve.form import FITTED, LOSSES, SCALES, Sought, find_needed, missing, plain
from gapsense.identification.valve.gap import TURNS, Gap, describe_gap, find_gap, keep_law
from gapsense.identification.valve.model import check_guess, take_out_causes
from gapsense.problems import InputError

FIELDS = (*FITTED, *SCALES.values(), "gap_window", *LOSSES)  # that may be sought, and so may be held


def parse_sought(forms: str, hold: Sequence[str], known: show.Known, accuracy: Mapping[str, float]) -> Sought:
    """Parse the values of `--forms` and `--hold`, names with commas between; a ValueError tells what is wrong."""
    tried = {AUTO: FORMS, PLAIN: ()}.get(forms, tuple(split_names([forms])))
    names = {show.PORTS[field].name: field for field in FIELDS}
    for name in tried:
        if name not in FORMS:
            raise ValueError(f"--forms: `{name}` found; {AUTO}, {PLAIN}, or some of {', '.join(FORMS)} expected.")
    held = split_names(hold)
    for name in held:
        if name not in names:
            because = " It follows from (23)." if name == "coil.resistance" else ""
            raise ValueError(f"--hold: `{name}` found, one of {', '.join(names)} expected.{because}")
        if names[name] in LOSSES and names[name] not in known.losses:
            raise ValueError(f"--hold: `{name}` has no value to be held at. Give one in the file of `--parameters`.")
    if OHMS in accuracy and known.resistance is None:
        raise ValueError(
            f"--accuracy: `{OHMS}` has no value. Give what an ohmmeter shows in the file of `--parameters`."
        )
    errors = {field: accuracy[port.name] for field, port in show.PORTS.items() if port.name in accuracy}
    fields = frozenset(names[name] for name in held)
    return Sought(tried, fields, known.losses, given=known.given, accuracy=errors)


def check_believed(parameters: Path | None, others: Mapping[str, object]) -> Path:
    """What `--commission` takes for the device; a ValueError tells what is missing, or which options it has not."""
    if parameters is None:
        raise ValueError("--commission: `--parameters` is missing. Give a set with what is believed of the device.")
    if given := [f"--{name}" for name, value in others.items() if value and value != AUTO]:
        raise ValueError(f"--commission: {', '.join(given)} found; this command has no such option. Leave it out.")
    return parameters


TABLE_I = "[SEMERA] Table I"
HOLD = " (in place of `gap.slope` also `coil.turns`, with `--hold coil.turns`)"
TITLE = "Measured and identified"
LAW = Law("sought", 0.0, ())


class Given(NamedTuple):
    """What was asked and what was read."""

    known: show.Known
    drive: Driver
    sought: Sought
    records: list[Record]
    kept: list[Record]  # for the validation
    conventions: Sequence[str]  # of the voltage between samples, that are left to the fit
    convention: str  # with which the records were read
    sources: Sequence[Path]
    file: Path | None  # of what is known
    is_assumed: bool  # what is missing
    model: str
    period: float | None
    inductance: Path | None

    def ask(self) -> None:
        """Ask for what a valve needs that the user has not given, before anything is fitted."""
        is_law_known = bool({"gap_law", "gap_slope", "gap_area"} & self.known.given)
        has_position = any(record.position is not None for record in self.records)
        is_told = self.inductance is not None or (has_position and not is_law_known)
        sought = self.sought._replace(held=(*self.sought.held, TURNS), gap=()) if is_told else self.sought
        self.ask_for(self.known.parameters, sought)

    def ask_for(self, parameters: Parameters, sought: Sought) -> None:
        """The same, with what is sought of the gap."""
        form = plain(parameters, sought)
        names = missing(form if sought.gap is None else form._replace(law=LAW), self.known.given)
        if not self.is_assumed:
            where = self.file.name if self.file else "--parameters"
            more = HOLD if "gap_slope" in names else ""
            ask([show.PORTS[name].name for name in names], show.BY_NAME, where, TABLE_I, more)


def read(
    data: Sequence[Path],
    how: Reading,
    validate: Sequence[Path],
    parameters: Path | None,
    assume: bool,
    *,
    model: str,
    period: float | None,
    temperature: str | None,
    forms: str,
    hold: Sequence[str],
    inductance: Path | None,
    driver: str | None,
    accuracy: str | None,
) -> Given:
    """Read all files, as the options of the command say; an error tells what is wrong with them or with an option."""
    known, drive = show.read_known(parameters), read_driver(driver, accuracy)
    seeking = parse_sought(forms, hold, known, drive.accuracy)
    records = with_temperatures(temperature, read_records(data, how, period))
    is_open = how.convention == AUTO and not all(record.is_mean for record in records)
    return Given(
        known=known,
        drive=drive,
        sought=seeking,
        records=[record._replace(drive=drive.values) for record in records],
        kept=read_records(validate, how, needs="rest"),
        conventions=CONVENTIONS * is_open,
        convention=how.convention,
        sources=data,
        file=parameters,
        is_assumed=assume,
        model=model,
        period=period,
        inductance=inductance,
    )


MANY = 5000  # samples from which the first operations are looked at alone
FAR = 2.0  # times what a coil may leave of them
NEITHER = (
    "Nor does a coil without motion explain the current: what it leaves is {:.2g} times the noise. `--model coil` fits"
    " one all the same."
)


def quick(records: Sequence[Record], period: float | None, conventions: Sequence[str]) -> Coil | None:
    """The coil of the first operations alone, if no coil explains any of them: then none explains the records."""
    firsts = [part(record, slice(operations(record, period)[0].stop + 1)) for record in records]
    if not all(operations(record, period) for record in firsts):
        return None
    each = [fit_coil([record], period, conventions, False) for record in firsts]
    if any(r.rms < FAR * r.limit for coil in each for r in coil.residuals):
        return None
    return max(each, key=lambda coil: coil.residuals[0].rms / coil.residuals[0].noise)


def coil_of(
    model: str,
    records: Sequence[Record],
    known: Parameters,
    period: float | None,
    conventions: Sequence[str],
    progress: Progress = lambda done, total: None,
) -> tuple[Coil | None, list[str]]:
    """The coil, if it is wanted or explains all records, and what to say; else the guess of a valve is checked."""
    found, told = None, list[str]()
    if model == AUTO and sum(record.times.size for record in records) > MANY:
        found = quick(records, period, conventions)
    if model == "coil" or (model == AUTO and found is None):
        found = fit_coil(records, period, conventions, model == "coil", progress)
        if model == "coil" or found.is_explained:
            return found, told
        is_coil = [fit_coil([r], period, conventions, False).is_explained for r in records if len(records) > 1]
        if is_coil and all(is_coil):
            told = ["Each record is that of a coil without motion, but no one coil explains them all."]
            return fit_coil(records, period, conventions, progress=progress), told
        told = [
            f"{record.name}: a coil without motion explains it, but not the others."
            for record, is_one in zip(records, is_coil)
            if is_one
        ]
    try:
        check_guess(known, records, period)
    except InputError as error:
        worst = max((r.rms / r.noise for r in found.residuals), default=0.0) if found else 0.0
        raise InputError([*error.problems, *([NEITHER.format(worst)] if found else [])]) from None
    return None, told


class Finished(NamedTuple):
    """For the user."""

    shown: Sequence[Table | str]
    figure: Callable[[], Figure]
    passed: bool  # whether it explains the records
    standard_errors: Mapping[str, float]


def identify(given: Given, to: Path, starts: int, seed: int, progress: Progress) -> Finished:
    """A coil or a valve, written to a parameter-set file."""
    if given.model == "solenoid_valve":
        given.ask()
    par, period, open_ = given.known.parameters, given.period, given.conventions
    coil, told = coil_of(given.model, given.records, par, period, open_[: len(SHARP)], progress)
    if coil is not None:
        return finish_coil(given, coil, told, to)
    given.ask()
    start = find_gap(par, given.records, given.sought, given.inductance, open_, period)
    given.ask_for(start.parameters, start.sought)
    sought = start.conventions, start.sought, given.drive
    result = fit_valve(start.records, start.parameters, starts, seed, period, progress, *sought)
    return finish_valve(given, start, result, told, to)


def finish_valve(given: Given, start: Gap, result: Identified, told: Sequence[str], to: Path) -> Finished:
    """A valve, written."""
    records, R = start.records, result.resistance
    coefficient = temperature.coefficient(records, result.fluxes)
    convention = result.convention or given.convention
    kept = [with_convention(record._replace(drive=result.drive), convention) for record in given.kept]
    checks = show.validate_valve(result.parameters, kept, coefficient)
    notes = [*driver_notes(result.drive), *temperature_notes(R, coefficient)]
    tuning = {**noises(records), **find_tuning(records, result.models, result.residuals, parameters_of("mhe", None))}
    show.write_valve(to, result, keep_law(given.known, result, to), given.sources, tuning, notes)
    doubts = doubt_resistance(R, given.known.resistance, given.drive.accuracy.get(OHMS))
    is_sound = result.is_explained and not doubts
    stops = [show.PORTS[field].name for field in find_needed(result.form) if field not in result.assumed]
    said = say_what_is_exact(stops, given.drive.accuracy, " `--accuracy` puts what is known of them into the errors.")
    doubts = [*doubts, *([said] if said else [])]
    tables = [*start.told, *show.valve_tables(result, records, checks), *describe_gap(result, records)]
    return Finished(
        shown=[*tables, *temperature_tables(records, R, coefficient), *doubts, *told],
        figure=lambda: measured_and_model(TITLE, [*zip(records, result.models)], checks),
        passed=is_sound,
        standard_errors=show.valve_errors(result),
    )


def finish_coil(given: Given, result: Coil, told: Sequence[str], to: Path) -> Finished:
    """A coil, written."""
    kept = [take_out_causes(record._replace(drive=given.drive.values), result.convention) for record in given.kept]
    checks = [validate_coil(result, record) for record in kept]
    turns = given.known.parameters.coil_turns if "coil_turns" in given.known.given else 0.0
    write_coil(to, result, turns, given.sources)
    said = say_what_is_exact((), given.drive.accuracy)
    return Finished(
        shown=[*coil_tables(result, turns, checks), *([said] if said else []), *told],
        figure=lambda: measured_and_model(TITLE, [*zip(result.records, result.models)], checks, shows_flux=True),
        passed=result.is_explained,
        standard_errors=coil_errors(result, turns),
    )
