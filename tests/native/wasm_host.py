"""A host of components by the draft FMI-LS-WASM, over wasmtime: what `native3.Instance` calls, and nothing of WASI."""

from __future__ import annotations

import atexit
import re
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

from fmpy.fmi1 import FMICallException
from native3 import Fmu, Instance
from wasmtime import Engine, Store
from wasmtime.component import Component, Linker

ENGINE = Engine()
atexit.register(ENGINE.close)  # later, what it needs is no longer there
PACKAGE, VERSION = "fmi:fmi3", "3.0.0"
STATUS = ("ok", "warning", "discard", "error", "fatal")
CALLBACKS, RESOURCES = (f"{PACKAGE}/{name}@{VERSION}" for name in ("callbacks", "resource-dir-callbacks"))


def binary(folder: Path, name: str) -> bytes:
    """The component in an extracted FMU."""
    return (folder / "binaries" / "wasm32-wasip2" / f"{name}.wasm").read_bytes()


@cache
def compiled(folder: Path, name: str) -> Component:
    component = Component(ENGINE, binary(folder, name))
    atexit.register(component.close)
    return component


class Hosted:
    """A component, instantiated in a store of its own, and one resource of it."""

    def __init__(self, fmu: Fmu, log: Callable[..., None], read: Callable[[str], bytes] | None = None) -> None:
        component = compiled(fmu.folder, fmu.component.name)
        self.store, linker = Store(ENGINE), Linker(ENGINE)
        with linker.root() as root:
            with root.add_instance(CALLBACKS) as callbacks:
                callbacks.add_func(
                    "log-message", lambda _, name, status, *texts: log(name, STATUS.index(status), *texts)
                )
            if read:
                with root.add_instance(RESOURCES) as resources:
                    resources.add_func("read-file", lambda _, path: read(path))
        linker.define_unknown_imports_as_traps(component)  # the draft's other callbacks, which ours never call
        self.instance = linker.instantiate(self.store, component)
        self.resource: Any = None

    def call(self, interface: str, name: str, *arguments: Any) -> Any:
        """Call a function, and let it free what it answered."""
        place = self.instance.get_export_index(self.store, f"{PACKAGE}/{interface}@{VERSION}")
        index = self.instance.get_export_index(self.store, name, place)
        assert index, name
        function = self.instance.get_func(self.store, index)
        assert function
        return function(self.store, *arguments)

    def method(self, name: str, *arguments: Any) -> Any:
        """Call a method of the resource; a status other than ok raises, as it does in fmpy."""
        answer = self.call("co-simulation", f"[method]co-simulation-instance.{name}", self.resource, *arguments)
        if isinstance(answer, str) and answer != "ok":
            raise FMICallException(function=name, status=STATUS.index(answer))
        return answer

    # Names and arguments as those of fmpy's FMU3Slave.

    def instantiate(self, name: str, token: str, *, event_mode: bool = False) -> None:
        arguments = (name, token, False, True, event_mode, False, [])
        self.resource = self.call("co-simulation", f"[static]{RESOURCE}.instantiate-co-simulation", *arguments)

    def enterInitializationMode(self, startTime: float = 0.0) -> None:
        self.method("enter-initialization-mode", None, startTime, None)

    def doStep(self, time: float, step: float) -> Any:
        return self.method("do-step", time, step, False)

    def freeInstance(self) -> None:
        self.resource.drop(self.store)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if (kind := name[:3]) in ("get", "set") and name[3:] not in ("FMUState",):
            function = f"{kind}-{name[3:].lower()}"
            return lambda references, values=None: self.method(
                function, list(references), *([list(values)] if kind == "set" else [])
            )
        return partial(self.method, re.sub("(?<=[a-z])(?=[A-Z])", "-", name.replace("FMU", "Fmu")).lower())


RESOURCE = "co-simulation-instance"


class WasmInstance(Instance):
    """One instance, with the messages that it gave, and the files of its FMU that it read."""

    def __init__(self, fmu: Fmu, name: str = "one", resources: Path | None = None, token: str = "", **how: Any) -> None:
        self.fmu, self.log, self.files = fmu, [], []
        self.folder = resources or fmu.folder / "resources"
        has_resources = (fmu.folder / "resources").is_dir()
        self.slave = Hosted(fmu, self._told, self._read if has_resources else None)
        self.slave.instantiate(name, token or fmu.description.guid, **how)
        self.inputs, self.outputs = fmu.references("input"), fmu.references("output")

    def _told(self, name: str, status: int, category: str, text: str) -> None:
        self.log.append((status, category, text))

    def _read(self, path: str) -> bytes | str:
        self.files.append(path)
        file = self.folder / path
        return file.read_bytes() if file.is_file() else f"no file {path}"
