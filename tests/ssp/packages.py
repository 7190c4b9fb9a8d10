"""Packages as other tools write them, put together by hand."""

from __future__ import annotations

import zipfile
from pathlib import Path

SPACES = " ".join(
    f'xmlns:{prefix}="http://ssp-standard.org/SSP1/{name}"'
    for prefix, name in {
        "ssd": "SystemStructureDescription",
        "ssc": "SystemStructureCommon",
        "ssv": "SystemStructureParameterValues",
        "ssm": "SystemStructureParameterMapping",
    }.items()
)
OSP = 'xmlns:osp="http://opensimulationplatform.com/SSP/OSPAnnotations"'
OMS = 'xmlns:oms="https://openmodelica.org/oms.xsd"'
V = '<ssc:Real unit="V"/>'
MASTER = """<ssd:Annotations><ssc:Annotation type="org.openmodelica"><oms:Annotations><oms:SimulationInformation>
<oms:FixedStepMaster description="oms-ma" stepSize="0.100000" absoluteTolerance="0.000100" relativeTolerance="0.0001"/>
</oms:SimulationInformation></oms:Annotations></ssc:Annotation></ssd:Annotations>"""
UNITS = """<ssd:Units><ssc:Unit name="V"><ssc:BaseUnit kg="1" m="2" s="-3" A="-1"/></ssc:Unit>
<ssc:Unit name="mV"><ssc:BaseUnit kg="1" m="2" s="-3" A="-1" factor="0.001"/></ssc:Unit>
<ssc:Unit name="A"><ssc:BaseUnit A="1"/></ssc:Unit>
<ssc:Unit name="odd"><ssc:BaseUnit kg="1" m="2" s="-3" A="-1" factor="2.0" offset="10.0"/></ssc:Unit></ssd:Units>"""


def connectors(**kinds: str) -> str:
    """Connectors by name: the kind, and after a blank the unit; `_` is a dot."""
    made = ""
    for name, text in kinds.items():
        kind, _, unit = text.partition(" ")
        real = f'<ssc:Real unit="{unit}"/>' if unit else "<ssc:Real/>"
        made += f'<ssd:Connector name="{name.replace("__", ".")}" kind="{kind}">{real}</ssd:Connector>'
    return f"<ssd:Connectors>{made}</ssd:Connectors>" if made else ""


def values(**given: float | str) -> str:
    """Parameter set of Real values; a text is an element as it stands."""
    made = "".join(
        f'<ssv:Parameter name="{name.replace("__", ".")}">'
        f'{value if isinstance(value, str) else f"""<ssv:Real value="{value!r}"/>"""}</ssv:Parameter>'
        for name, value in given.items()
    )
    return f'<ssv:ParameterSet version="1.0" name="set"><ssv:Parameters>{made}</ssv:Parameters></ssv:ParameterSet>'


def binding(content: str, **attributes: str) -> str:
    """One binding with values inline."""
    more = "".join(f' {name}="{value}"' for name, value in attributes.items())
    return f"<ssd:ParameterBinding{more}><ssd:ParameterValues>{content}</ssd:ParameterValues></ssd:ParameterBinding>"


def bindings(*content: str) -> str:
    return f"<ssd:ParameterBindings>{''.join(content)}</ssd:ParameterBindings>"


def component(name: str, fmu: str, *content: str, more: str = "") -> str:
    return f'<ssd:Component name="{name}" source="resources/{fmu}.fmu" {more}>{"".join(content)}</ssd:Component>'


def link(start: str, end: str, inside: str = "", more: str = "") -> str:
    """Connection between `element.connector` or, of the system, `.connector`."""
    ends = [text.partition(".") for text in (start, end)]
    text = "".join(
        f' {k}Element="{e}"' * bool(e) + f' {k}Connector="{c}"' for k, (e, _, c) in zip(("start", "end"), ends)
    )
    return f"<ssd:Connection{text} {more}>{inside}</ssd:Connection>"


def linear(factor: float, offset: float = 0.0) -> str:
    return f'<ssc:LinearTransformation factor="{factor!r}" offset="{offset!r}"/>'


def system(name: str, *head: str, elements: str = "", links: str = "", tail: str = "") -> str:
    inside = f"<ssd:Elements>{elements}</ssd:Elements>" * bool(elements)
    inside += f"<ssd:Connections>{links}</ssd:Connections>" * bool(links)
    return f'<ssd:System name="{name}">{"".join(head)}{inside}{tail}</ssd:System>'


def structure(content: str, experiment: str = 'stopTime="1.0"', units: str = UNITS, version: str = "1.0") -> str:
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<ssd:SystemStructureDescription {SPACES} {OSP} {OMS} name="other" '
        f'version="{version}">{content}{units}<ssd:DefaultExperiment {experiment}/></ssd:SystemStructureDescription>'
    )


def packed(path: Path, ssd: str, fmus: Path, *names: str, **more: str) -> Path:
    """A package with FMUs and further documents, `set__ssv` for `resources/set.ssv`."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("SystemStructure.ssd", ssd)
        for name in names:
            archive.write(fmus / f"{name}.fmu", f"resources/{name}.fmu", zipfile.ZIP_STORED)  # they are compressed
        for name, text in more.items():
            head = f'<?xml version="1.0"?>\n{text}'
            for prefix in ("ssv:ParameterSet", "ssm:ParameterMapping"):
                head = head.replace(f"<{prefix}", f"<{prefix} {SPACES}", 1)
            archive.writestr(f"resources/{name.replace('__', '.')}", head)
    return path


CHAIN = system(
    "chain",
    elements=component("source", "Source", connectors(y="output V"), bindings(binding(values(slope=2.0))))
    + component("lag", "Lag", connectors(u="input V", y="output V"))
    + component("gain", "Gain", connectors(u="input V", y="output A"), bindings(binding(values(gain=3.0)))),
    links=link("source.y", "lag.u") + link("lag.y", "gain.u"),
    tail=MASTER,
)
FMUS = ("Source", "Lag", "Gain")
SCENARIO = """
title = "Ramp through a lag and a gain"
[experiment]
stop = 1.0
base_step = 0.1
method = "jacobi"
[components.source]
fmu = "Source"
set = { slope = 2.0 }
[components.lag]
fmu = "Lag"
[components.gain]
fmu = "Gain"
set = { gain = 3.0 }
[connect]
"lag.u" = "source.y"
"gain.u" = "lag.y"
"""
