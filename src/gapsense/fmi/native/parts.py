"""What the native FMUs of a component are made of: sources, resources, variables and the identity of all these."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from uuid import UUID

from gapsense.fmi import package
from gapsense.fmi.fmi3.variables import Variable, arrays_c, shapes, variables
from gapsense.fmi.native import SOURCES, headers
from gapsense.fmi.native.headers import array as _array
from gapsense.fmi.native.headers import literal
from gapsense.fmi.native.platforms import FLAGS, PLATFORMS, SMALL
from gapsense.fmi.ports import Component, Port
from gapsense.fmi.shim.build import headers as fmi_headers
from gapsense.fmi.tables import GRID, _parts, column_name, fewest_rows, heads, read_table
from gapsense.kernels.kernel import Kernel
from gapsense.kernels.layout import fields, names
from gapsense.version import __version__

EXACT = '\n#include "exact.h"\n'
COLUMN_KINDS = {kind: kind.upper() for kind in ("integral", "spline", *GRID)}
MODEL = """/* {description} Generated from the port table. */
#include "model.h"

#include <math.h>
#include <stddef.h>

Kernel {kernel}_initial, {kernel}_constants, {kernel}_advance;

{arrays}
const Model model = {{
    .name = {name}, .guid = {guid}, .build = {build},
    .ports = ports, .inputs = {inputs}, .signals = {signals}, .port_count = {port_count},
    .rising = {rising}, .rising_count = {rising_count},
    .limits = {limits}, .limit_count = {limit_count},
    .resources = {resources}, .resource_count = {resource_count},
    .survives = {survives}, .clock = {clock}, .sample_time = {sample_time},
    .par_count = {par_count}, .state_count = {state_count}, .table_count = {table_count},
    .memory_sizes = {memory_sizes}, .memory_count = {memory_count},
    .wholes = {wholes}, .whole_count = {whole_count},
    .constant_count = {constant_count},
    .initial = {kernel}_initial, .constants = {kernel}_constants, .advance = {kernel}_advance,
#ifdef GAPSENSE_COMPONENT
    .content = {content},
#endif
}};
"""


class Parts(NamedTuple):
    """What the native FMUs of a component are made of, whatever the version of FMI."""

    component: Component
    given: Mapping[str, Any]  # start values in place of those of the port table
    guid: str
    variables: list[Variable]  # of FMI 3.0
    files: dict[str, str]  # C sources and headers
    resources: dict[str, bytes]
    folder: Path  # of the component

    def sources(self, fmi: int) -> dict[str, bytes]:
        """C sources and headers that it takes to compile the library for one version of FMI."""
        other = f"fmi{5 - fmi}"
        return {f"sources/{n}": text.encode() for n, text in self.files.items() if not n.startswith(other)}


def gather(folder: Path, values: Mapping[str, Any], *, with_arrays: bool = True) -> Parts:
    """Parts of the component in a folder, with these start values of its parameters.

    `with_arrays` says whether FMI 3.0 lists variables that are arrays; there are hosts that take all for scalars.
    """
    component, kernel, paths = package.prepare_component(folder, values)
    resources = {path.name: path.read_bytes() for path in paths}
    tables = shipped_columns(component, {path.name: path for path in paths})
    files = {**common(), "kernel.c": kernel.c() + EXACT, "arrays.c": arrays_c(component, kernel, tables)}
    flags = (FLAGS, SMALL, sorted(PLATFORMS.items()))
    content = (__version__, component, sorted(files.items()), sorted(resources.items()), flags, with_arrays)
    identity = hashlib.sha256(repr(content).encode()).hexdigest()[:32]
    found = variables(component, tables, shapes(kernel))
    found = found if with_arrays else found[: len(component.ports) + 1]  # those of FMI 2.0, and the time
    parts = Parts(
        component=component,
        given=values,
        guid=f"{{{UUID(identity)}}}",
        variables=found,
        files=files,
        resources=resources,
        folder=folder,
    )
    model = source(component, kernel, parts.guid, identity)  # which knows the identity of all others
    return parts._replace(files={**files, "model.c": model})


def shipped_columns(component: Component, paths: Mapping[str, Path]) -> dict[str, list[list[float]]]:
    """Columns of the tables that travel with the component, by parameter."""
    named = {port.name: (paths[port.start], tuple(heads(port.columns))) for port in component.ports if port.columns}
    return {name: read_table(path, columns) for name, (path, columns) in named.items()}


def common() -> dict[str, str]:
    """C sources and headers that are the same for all components."""
    paths = (*SOURCES.glob("*.[ch]"), *fmi_headers().glob("fmi[23]*.h"))
    files = {path.name: path.read_text(encoding="utf-8") for path in sorted(paths)}
    return {**files, "sentences.h": headers.sentences(), "life.h": headers.life()}


# `model.c`: what a component is, as the data that `model.h` declares.


def source(component: Component, kernel: Kernel, guid: str, build: str) -> str:
    """Text of `model.c`."""
    identity = {"name": component.name, "guid": guid, "build": build}
    memory = [field.size for field in fields(kernel.module.State).values() if field.kind == "memory"]
    items = {
        "rising": component.rising,
        "limits": component.limits,
        "resources": component.resources,
        "memory_sizes": memory,
        "wholes": kernel.wholes,
    }
    return MODEL.format(
        description=component.description,
        kernel=kernel.name,
        content="resource_content" if component.resources else "NULL",
        arrays="\n".join(filter(None, _arrays(component, kernel, memory))),
        **{key: literal(text) for key, text in identity.items()},
        **{name: name if found else "NULL" for name, found in items.items()},
        **_counts(component, kernel, len(memory)),
    )


def _counts(component: Component, kernel: Kernel, memory_count: int) -> dict[str, int]:
    module, inputs, outputs = kernel.module, component.of("input"), component.of("output")
    sample_times = [k for k, port in enumerate(component.ports) if port.name == "sample_time"]
    tables = _tables(kernel)
    return {
        "inputs": len(inputs),
        "signals": len(inputs) + len(outputs),
        "port_count": len(component.ports),
        "rising_count": len(component.rising),
        "limit_count": len(component.limits),
        "resource_count": len(component.resources),
        "survives": int(component.survives),
        "clock": sum(name in fields(module.Inputs) for name in ("time", "dt")),
        "sample_time": sample_times[0] if sample_times else -1,
        "par_count": len(names(module.Parameters)) - len(tables),
        "state_count": len(names(module.State)) - memory_count,
        "table_count": len(tables),
        "memory_count": memory_count,
        "whole_count": len(kernel.wholes),
        "constant_count": kernel.constant_count,
    }


def _tables(kernel: Kernel) -> list[str]:
    return [name for name, field in fields(kernel.module.Parameters).items() if field.kind == "table"]


def _arrays(component: Component, kernel: Kernel, memory: list[int]) -> list[str]:
    ports, tables = component.ports, _tables(kernel)
    scalars = [name for name in names(kernel.module.Parameters) if name not in tables]
    places = {name: k for own in (scalars, tables) for k, name in enumerate(own)}
    return [
        *(text for k, port in enumerate(ports) for text in _of_port(k, port, places)),
        _array("Port", "ports", (_port(k, port, places) for k, port in enumerate(ports))),
        *_rules(component, {port.name: k for k, port in enumerate(ports)}),
        _array("char *const", "resources", map(literal, component.resources)),
        _array("int", "memory_sizes", map(str, memory)),
        _array("Wholes", "wholes", _wholes(kernel)),
    ]


def _wholes(kernel: Kernel) -> Iterator[str]:
    """Those among the numbers of the state, then memory by memory."""
    layout = fields(kernel.module.State)
    memory = [name for name, field in layout.items() if field.kind == "memory"]
    entries = names(kernel.module.State)
    numbers = [name for name in entries if name not in memory]
    for entry, first, every, least, most in kernel.wholes:
        name = entries[entry]
        place = (memory.index(name), first, every) if name in memory else (-1, numbers.index(name), 0)
        yield f"{{{', '.join(map(str, place))}, {_number(least)}, {_number(most)}}}"


def _number(value: Any) -> str:
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    return repr(float(value))


def _of_port(k: int, port: Port, places: dict[str, int]) -> list[str]:
    """Arrays that the entry of a port points to."""
    if port.choices:
        return [_array("char *const", f"choices_{k}", map(literal, port.choices))]
    if not port.columns:
        return []
    parts = [_parts(column) for column in port.columns]
    wanted = heads(port.columns)
    known = [_parts(head)[1] for head in wanted]
    rising = {name for kind, name, _ in parts if kind == "rising"}
    made = [
        f"{{{COLUMN_KINDS.get(kind, 'PLAIN')}, {known.index(name)}, {places[f'{port.field}_{column_name(column)}']}}}"
        for column, (kind, name, _) in zip(port.columns, parts)
    ]
    shown = _array("Head", f"heads_{k}", (_head(head, rising) for head in wanted))
    return [shown, _array("Column", f"columns_{k}", made)]


def _head(text: str, rising: set[str]) -> str:
    _, name, unit = _parts(text)
    return f"{{{literal(name)}, {literal(unit)}, {literal(text)}, {int(name in rising)}}}"


def _port(k: int, port: Port, places: dict[str, int]) -> str:
    is_text = port.kind == "String"
    low, high = -math.inf if port.min is None else port.min, math.inf if port.max is None else port.max
    entry = {
        "name": literal(port.name),
        "unit": literal("" if port.unit == "1" else f" {port.unit}"),
        "causality": port.causality.upper(),
        "kind": port.kind.upper(),
        "is_tunable": int(port.causality == "parameter" and port.variability == "tunable"),
        "place": places.get(port.field, -1) if port.causality == "parameter" else -1,
        "start": _number(0.0 if is_text else port.start or 0.0),
        "low": _number(low),
        "high": _number(high),
        "text": literal(port.start) if is_text else "NULL",
    }
    if port.choices:
        entry |= {"choices": f"choices_{k}", "choice_count": len(port.choices)}
    if port.columns:
        counts = {"head_count": len(heads(port.columns)), "column_count": len(port.columns)}
        entry |= {"heads": f"heads_{k}", "columns": f"columns_{k}", "fewest_rows": fewest_rows(port.columns), **counts}
    return f"{{{', '.join(f'.{key} = {value}' for key, value in entry.items())}}}"


def _rules(component: Component, index: dict[str, int]) -> Sequence[str]:
    factors = [
        _array("Factor", f"factors_{k}", (f"{{{index[name]}, {power}}}" for name, power in limit.powers))
        for k, limit in enumerate(component.limits)
    ]
    limits = (
        f"{{factors_{k}, {len(at.powers)}, {_number(at.below)}, {literal(at.text())}, {literal(at.reason)}}}"
        for k, at in enumerate(component.limits)
    )
    rising = (f"{{{index[lower]}, {index[upper]}}}" for lower, upper in component.rising)
    return [*factors, _array("Limit", "limits", limits), _array("Rising", "rising", rising)]
