"""Make a scenario of a system structure package: a folder with `scenario.toml` and its FMUs."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any
from xml.etree.ElementTree import Element as Xml
from xml.etree.ElementTree import ParseError

from gapsense.cosim.check import check, described
from gapsense.cosim.fmu.archive import UnusableError, shown
from gapsense.cosim.fmu.descriptions import Description
from gapsense.cosim.scenario.read import Document
from gapsense.cosim.scenario.write import write_document
from gapsense.parameters import is_file
from gapsense.problems import InputError
from gapsense.ssp import structure
from gapsense.ssp.package import Package, opened
from gapsense.ssp.scenario import Maker, Told, Wiring, plain_names
from gapsense.ssp.structure import Element, read_element
from gapsense.ssp.units import Units, read_units, together, units_of
from gapsense.ssp.values import Reader
from gapsense.ssp.words import DESCRIPTION, numbered, tag

FMUS, FILES = "fmus", "files"  # folders beside the scenario


def bring(
    path: Path, folder: Path, base_step: float | None = None, stop: float | None = None, method: str | None = None
) -> list[str]:
    """Write the scenario of a package, complete or not at all.

    Parameters
    ----------
    path : Path
        The package.
    folder : Path
        To make.
    base_step, stop : float, optional
        Base step and end of the run [s], where the package does not tell or something else is wanted.
    method : str, optional
        Coupling, as in `[experiment]`; by default what our annotation tells, and without one `jacobi`.

    Returns
    -------
    list of str
        What of the package was left out or taken for granted, one sentence each.

    Raises
    ------
    InputError
        With everything that is wrong with it or not supported.
    """
    if folder.exists():
        raise InputError([f"`{folder}` exists already. Choose another name, or remove it."])
    partial = folder.with_name(f".{folder.name}.part")
    problems: list[str] = []
    notes: list[str] = []
    shutil.rmtree(partial, ignore_errors=True)  # what a kill left
    try:
        (partial / FMUS).mkdir(parents=True)
        with opened(path) as package:
            data = content(package, partial, problems, notes, base_step=base_step, stop=stop, method=method)
        refuse(path, problems)
        write_document(Document(partial / "scenario.toml", data), partial / "scenario.toml")
        refuse(path, check(partial, fmus=partial / FMUS))
        partial.rename(folder)
    finally:  # complete or absent
        shutil.rmtree(partial, ignore_errors=True)
    return list(dict.fromkeys(notes))


def refuse(path: Path, problems: list[str]) -> None:
    """Raise an InputError with all problems, if there are any."""
    if problems:
        raise InputError([f"{path.name}: {problem}" for problem in problems])


def content(package: Package, folder: Path, problems: list[str], notes: list[str], **options: Any) -> dict[str, Any]:
    """Tables of the scenario; FMUs and other files are put into its folder. Not complete if there are problems."""
    root, outer = read_structure(package, problems, notes)
    told = Told(root, problems, notes)
    components = [*outer.components()]
    fmus = take_fmus(package, components, folder, problems)
    descriptions = described_all(components, fmus, folder, problems)
    units = all_units(root, list({d.path: None for d in descriptions.values()}), problems)
    reader = Reader(package, units, {path: d.variables for path, d in descriptions.items()}, problems, notes)
    reader.read(outer)
    reader.finish()
    wiring = Wiring(outer, units, problems)
    experiment = told.experiment(**options)
    problems += [] if components else ["there is no component in it. Add one."]
    if problems:
        return {}
    names = plain_names([one.path for one in components])
    notes += [f"`{one.name}` is called `{names[one.path]}`." for one in components if names[one.path] != one.name]
    named = {path: f"{FMUS}/{file}" for path, file in fmus.items()}
    maker = Maker(
        components=components,
        names=names,
        fmus=named,
        descriptions=descriptions,
        wiring=wiring,
        given=reader.given,
        units=units,
        told=told,
        problems=problems,
        notes=notes,
    )
    data = maker.made(root.get("name", "") or package.path.stem, experiment)
    take_files(package, data, folder)
    return data


def read_structure(package: Package, problems: list[str], notes: list[str]) -> tuple[Xml, Element]:
    """The document and its outermost system."""
    try:
        root, violations = package.document(DESCRIPTION, "ssd")
        system, version = root.find(tag("ssd:System")), root.get("version", "")
        if system is None or not version.startswith("1."):
            raise UnusableError(f"it is of SSP `{shown(version)}`, a system of SSP 1.0 is expected. Export it as that.")
        notes += [f"{DESCRIPTION} is not as the schema says: {text}" for text in violations]
        return root, read_element(system, (), problems)
    except (ParseError, ValueError) as error:
        raise InputError([f"{package.path}: {error}"]) from error


def all_units(root: Xml, fmus: list[Path], problems: list[str]) -> Units:
    """Units of the FMUs, and those of the document, which go before them."""
    units, other = together(map(units_of, fmus))
    problems += [f"the unit `{shown(name)}` is not the same in two FMUs. Correct one of them." for name in other]
    return {**units, **read_units(root, f"{tag('ssd:Units')}/{tag('ssc:Unit')}")}


def take_fmus(
    package: Package, components: list[Element], folder: Path, problems: list[str]
) -> dict[structure.Path, str]:
    """Name of the FMU file of each component, which is in the folder of FMUs now."""
    files: dict[str, str] = {}
    out: dict[structure.Path, str] = {}
    for one in components:
        try:
            member = package.member(one.source)
        except UnusableError as error:
            problems.append(f"{one.name}: {error}")
            continue
        if member not in files:
            files[member] = fresh(f"{PurePosixPath(member).stem}.fmu", set(files.values()))
            package.copy(member, folder / FMUS / files[member])
        out[one.path] = files[member]
    return out


def fresh(name: str, taken: set[str]) -> str:
    """A file name that none of the others has, whatever the case of its letters."""
    others, path = {other.lower() for other in taken}, PurePosixPath(name)
    return next(name for name in numbered(path.stem, path.suffix) if name.lower() not in others)


def described_all(
    components: list[Element], fmus: Mapping[structure.Path, str], folder: Path, problems: list[str]
) -> dict[structure.Path, Description]:
    """Model descriptions of components, as far as they can be read."""
    out: dict[structure.Path, Description] = {}
    wrong: dict[str, str] = {}
    for one in components:
        if one.path not in fmus or fmus[one.path] in wrong:
            continue
        try:
            out[one.path] = described(folder / FMUS / fmus[one.path])
        except UnusableError as error:
            wrong[fmus[one.path]] = f"{one.name}, `{shown(one.source)}`: it cannot be used: {error}"
    problems += wrong.values()
    return out


def take_files(package: Package, data: Mapping[str, Any], folder: Path) -> None:
    """Put files that parameters name into the folder, if they are in the package."""
    taken: dict[str, str] = {}
    for component in data["components"].values():
        for name, value in component.get("set", {}).items():
            if is_file(name, value) and value in package.names:
                (folder / FILES).mkdir(exist_ok=True)
                if value not in taken:
                    taken[value] = fresh(PurePosixPath(value).name, set(taken.values()))
                    package.copy(value, folder / FILES / taken[value])
                component["set"][name] = f"{FILES}/{taken[value]}"
