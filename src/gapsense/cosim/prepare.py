"""From a scenario file to what can be run: the scenario and the descriptions of its FMUs, with everything checked."""

from __future__ import annotations

from pathlib import Path

from gapsense.cosim.check.coarse import remarks as on_grid
from gapsense.cosim.check.scenario import check_scenario, read_descriptions
from gapsense.cosim.check.values import taken
from gapsense.cosim.fmu.descriptions import Description
from gapsense.cosim.scenario.document import Source, scenario_file
from gapsense.cosim.scenario.read import load, read_draft
from gapsense.cosim.scenario.records import Scenario
from gapsense.problems import ScenarioError
from gapsense.shipped import FMU_FOLDER, ROOT


def check(scenario: Source, variant: str | None = None, fmus: str | Path | None = None) -> list[str]:
    """Problems of a scenario, found without running it.

    Parameters
    ----------
    scenario : str, Path or Document
        Scenario file, its folder, or its content.
    variant : str, optional
        Variant to check; by default the scenario as it is and then every variant.
    fmus : str or Path, optional
        Folder of the FMUs, as in `run`.

    Returns
    -------
    list of str
        One sentence each with file, place, what was found, what was expected and what to do; empty if all is well.
    """
    problems, read = inspect(scenario, variant, fmus)[:2]
    if variant is None and read is not None:
        for name in read.variants:
            more = [f"variant {name}: {p}" for p in inspect(scenario, name, fmus)[0] if p not in problems]
            problems = problems + more
    return problems


def remarks(scenario: Source, variant: str | None = None, fmus: str | Path | None = None) -> list[str]:
    """Sentences on what falls between the steps of a scenario without problems, as in `check`; it can be run."""
    sources = [variant] if variant else [None, *load(scenario).variants]
    found = {name: on_grid(*prepare(scenario, name, fmus)) for name in sources}
    base = found[sources[0]]
    more = (f"variant {name}: {said}" for name, own in found.items() for said in own if name and said not in base)
    return base if variant else [*base, *more]


def prepare(
    scenario: Source, variant: str | None = None, fmus: str | Path | None = None
) -> tuple[Scenario, dict[str, Description]]:
    """Scenario and model descriptions, checked; raises ScenarioError with all problems of both."""
    problems, read, descriptions = inspect(scenario, variant, fmus)
    if problems or read is None:
        raise ScenarioError(problems)
    return read, descriptions


def inspect(
    scenario: Source, variant: str | None, fmus: str | Path | None
) -> tuple[list[str], Scenario | None, dict[str, Description]]:
    """Problems of file and FMUs together, the scenario as far as it could be read, and the model descriptions."""
    draft = read_draft(scenario, variant)
    if draft.scenario is None:
        return draft.problems, None, {}
    problems = list(draft.problems)
    folder = Path(fmus) if fmus is not None else find_fmus(scenario_file(scenario))
    descriptions = read_descriptions(draft.scenario, folder, problems)
    read = taken(draft.scenario, descriptions)
    problems += check_scenario(read, descriptions, draft.broken)
    return problems, read, descriptions


def find_fmus(scenario: Path, name: Path = FMU_FOLDER) -> Path:
    """Folder `build/fmus` in a folder above the scenario, or below the working directory, or else what was shipped."""
    above = (folder / name for folder in scenario.resolve().parents)
    return next((folder for folder in (*above, name, ROOT / name) if folder.is_dir()), name)
