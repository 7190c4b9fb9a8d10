"""A scenario as an object: the content of a scenario file, and its FMUs once they are loaded."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from gapsense.cosim.prepare import check, prepare
from gapsense.cosim.result.result import Measure, Result
from gapsense.cosim.run.master import Master, Progress
from gapsense.cosim.run.run import run, run_once
from gapsense.cosim.scenario.content import Content, plain
from gapsense.cosim.show import scenario_html
from gapsense.cosim.sweep import sweep
from gapsense.cosim.sweep_table import Sweep

Self = TypeVar("Self", bound="Scenario")


class Scenario(Content):
    """A co-simulation that a program puts together, runs, changes and runs again.

    What is wrong is told when it is checked or run, all at once and in the words for a file.
    """

    master: Master | None = None
    end: Callable[[], object] | None = None

    def check(self, variant: str | None = None) -> list[str]:
        """Problems of the scenario, found without running it, one sentence each."""
        return check(self.document, variant, self.fmus)

    def run(self, variant: str | None = None, seed_shift: int = 0, progress: Progress | None = None) -> Result:
        """Run it. FMUs are loaded for the first run, and again only if components or connections have changed.

        Parameters
        ----------
        variant, seed_shift, progress
            As for `cosim.run`.

        Returns
        -------
        Result
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
        """Run every combination of values, with several seeds, and collect the metrics.

        Parameters
        ----------
        grid : mapping, optional
            Values by parameter; it becomes the scenario's `[sweep]`.
        seeds, workers, out, measure, progress
            As for `cosim.sweep`.

        Returns
        -------
        Sweep
        """
        if grid is not None:
            self.data["sweep"] = {name: [plain(value) for value in values] for name, values in grid.items()}
        options = {"out": out, "fmus": self.fmus, "measure": measure, "progress": progress}
        return sweep(self.document, seeds, workers=workers, **options)  # type: ignore[arg-type]

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

    def _repr_html_(self) -> str:
        return scenario_html(self.data, repr(self))
