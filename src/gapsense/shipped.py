"""What comes with the package: components, FMUs, examples, records; in a checkout beside it, when installed inside."""

from __future__ import annotations

from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
INSTALLED = PACKAGE / "_shipped"  # which setup.py makes in the wheel, laid out like a checkout
ROOT = INSTALLED if INSTALLED.is_dir() else PACKAGE.parents[1]
FMU_FOLDER, NATIVE_FOLDER = Path("build", "fmus"), Path("build", "native")
COMPONENTS, FMUS, SCENARIOS, RECORDS = ROOT / "fmus", ROOT / FMU_FOLDER, ROOT / "scenarios", ROOT / "records"


def example(name: str | Path) -> Path | None:
    """Folder of the example scenario of that name, where there is one."""
    folder = SCENARIOS / name
    return folder if Path(name).name == str(name) and (folder / "scenario.toml").is_file() else None


def examples() -> list[str]:
    """Names of the example scenarios."""
    return sorted(file.parent.name for file in SCENARIOS.glob("*/scenario.toml"))


def record(file: str | Path) -> Path:
    """The file, or where there is none the sample of that name, a record or its parameter set."""
    path, sample = Path(file), RECORDS / Path(file).name
    is_sample = str(file) == path.name and sample.suffix in (".csv", ".toml") and sample.is_file()
    return sample if is_sample and not path.exists() else path


def is_installed(path: Path) -> bool:
    """True for what lies inside the installed package, which must stay as it is."""
    return path.resolve().is_relative_to(INSTALLED)
