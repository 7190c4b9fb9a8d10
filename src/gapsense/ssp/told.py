"""What a package tells about a run: start and stop, steps, and in our own annotation what SSP has no words for."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from typing import Any
from xml.etree.ElementTree import Element as Xml

from gapsense.cosim.fmu.archive import shown
from gapsense.ssp.carried import OF_COMPONENTS, WHOLE
from gapsense.ssp.words import OSP, OWN, tag

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

JACOBI = "jacobi"  # what tools of SSP do where nothing else is told
SIGNAL = ("times", "values", "interpolation")


class Told:
    """What the document says on the run; `problems` and `notes` take what is wrong, and what is left out."""

    def __init__(self, root: Xml, problems: list[str], notes: list[str]) -> None:
        self.root, self.problems, self.notes = root, problems, notes
        self.own = self.read_own()
        kinds = dict.fromkeys(xml.get("type", "") for xml in root.iter(tag("ssc:Annotation")))
        for kind in (kind for kind in kinds if kind not in (OWN, OSP)):
            notes.append(f"annotations of `{shown(kind)}` are left out, but for a step in them.")

    def read_own(self) -> dict[str, Any]:
        """Tables of our annotation, but for what SSP itself tells."""
        found = self.root.find(f"{tag('ssd:DefaultExperiment')}//{tag('gapsense:Scenario')}")
        if found is None:
            return {}
        try:
            data = tomllib.loads(found.text or "")
        except ValueError as error:
            self.problems.append(f"annotation `{OWN}`: not valid TOML: {error}. Export it again, or remove it.")
            return {}
        return {key: value for key, value in data.items() if isinstance(value, (dict, list)) or key in WHOLE}

    def table(self, key: str) -> dict[str, Any]:
        """A table of our annotation; empty if there is none."""
        found = self.own.get(key)
        return found if isinstance(found, dict) else {}

    def experiment(self, **options: Any) -> dict[str, Any]:
        """The section `[experiment]`: options go before the document, and that before our annotation."""
        xml = self.root.find(tag("ssd:DefaultExperiment"))
        times = {} if xml is None else {"start": xml.get("startTime"), "stop": xml.get("stopTime")}
        read = {key: number for key, text in times.items() if text and (number := finite(text)) is not None}
        steps = {} if (step := self.step()) is None else {"base_step": step}
        made = {"start": 0.0, **steps, "method": JACOBI, **self.table("experiment"), **read}
        made |= {key: value for key, value in options.items() if value is not None}
        for key, option in (("stop", "--stop"), ("base_step", "--step")):
            if key not in made:
                self.problems.append(f"experiment: the package does not tell `{key}`. Give it with `{option}`.")
        if "method" not in self.table("experiment") and options.get("method") is None:
            self.notes.append(f"experiment.method: SSP says nothing on the coupling; `{JACOBI}` is taken.")
        return made

    def step(self) -> float | None:
        """Base step that annotations of other tools tell [s]: that of OSP, or else the least of OMSimulator."""
        names = {"FixedStepAlgorithm": "baseStepSize", "FixedStepMaster": "stepSize"}
        for name, key in names.items():
            told = (finite(xml.get(key, "")) for xml in self.root.iter() if xml.tag.rpartition("}")[2] == name)
            steps = [step for step in told if step is not None and step > 0.0]
            if steps:
                return min(steps)
        return None

    def component(self, name: str, xml: Xml, base_step: float | None) -> dict[str, Any]:
        """Step, offset and process of a component, where they are not as usual."""
        hints = (one.get("value", "") for one in xml.iter(tag("osp:StepSizeHint")))
        hint = next((step for text in hints if (step := finite(text)) is not None), None)
        own = self.table("components").get(name)
        made = {key: own[key] for key in OF_COMPONENTS if key in own} if isinstance(own, dict) else {}
        if hint is None or not base_step or "step" in made:
            return made
        ratio = hint / base_step
        if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-9 * ratio:
            self.notes.append(f"{name}: its step of {hint:.9g} s is no multiple of {base_step:.9g} s, and left out.")
        elif round(ratio) > 1:
            made["step"] = round(ratio)
        return made

    def signals(self) -> dict[str, dict[str, Any]]:
        """Signals that inputs follow."""
        found = {name: one for name, one in self.table("inputs").items() if isinstance(one, dict)}
        return {name: {key: one[key] for key in SIGNAL if key in one} for name, one in found.items()}

    def delayed(self) -> set[tuple[str, str]]:
        """Source and target of connections that carry the value of one step before."""
        links = self.own.get("connections")
        found = [link for link in links if isinstance(link, dict)] if isinstance(links, list) else []
        return {(str(link.get("from")), str(link.get("to"))) for link in found if link.get("delayed") is True}

    def rest(self) -> Mapping[str, Any]:
        """Events, record and metrics."""
        return {key: self.own[key] for key in ("events", "record", "metrics") if isinstance(self.own.get(key), dict)}


def finite(text: str) -> float | None:
    """The finite number that a text holds, or None."""
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
