"""The wheel holds what a checkout has beside the package (`gapsense.shipped`): components, their FMUs, examples."""

import shutil
import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parent


class WithShipped(build_py):
    """Copies the package, and unless a checkout is installed (`pip install -e`), what comes with it."""

    def run(self) -> None:
        """Copy into an empty folder, so that nothing of an earlier version gets into the wheel."""
        if self.editable_mode:
            return super().run()
        shutil.rmtree(self.build_lib, ignore_errors=True)
        super().run()
        ship(Path(self.build_lib, "gapsense", "_shipped"))


def ship(to: Path) -> None:
    """Lay out `to` like a checkout."""
    sys.path.insert(0, str(ROOT / "src"))
    from gapsense.fmi import package
    from gapsense.fmi.components import find_components

    for name in ("fmus", "scenarios", "records"):
        shutil.copytree(ROOT / name, to / name, ignore=shutil.ignore_patterns("__pycache__", "results", "build"))
    for folder in find_components(ROOT / "fmus"):
        package.build(folder, to / "build" / "fmus")


setup(cmdclass={"build_py": WithShipped})
