"""A scenario of nine components over 100 ms, in 5000 steps each: that of soft landing with three more estimators."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MORE = """
[components.semera]
fmu = "Semera"
parameters = ["../estimators/parameters/semera.toml"]

[components.ekf]
fmu = "Ekf"
parameters = ["../estimators/parameters/reduced.toml"]

[components.ertss]
fmu = "Ertss"
parameters = ["../estimators/parameters/reduced.toml"]

[connect]
"semera.voltage" = "sensor.voltage_measured"
"semera.current" = "sensor.current_measured"
"ekf.voltage" = "sensor.voltage_measured"
"ekf.current" = "sensor.current_measured"
"ekf.mode" = "sensor.mode_measured"
"ertss.voltage" = "sensor.voltage_measured"
"ertss.current" = "sensor.current_measured"
"ertss.mode" = "sensor.mode_measured"
"""
INPUTS = '[inputs]\n"ekf.resistance" = 0.0\n"ertss.resistance" = 0.0\n'
SIGNALS = '"semera.resistance", "ekf.position", "ertss.position", '


def write(folder: Path) -> Path:
    """Write the scenario beside a copy of the parameter sets that it names."""
    text = (ROOT / "scenarios" / "run_to_run" / "scenario.toml").read_text(encoding="utf-8")
    text = text.partition("[metrics.")[0].partition("[baseline]")[0]
    text = text.replace("stop = 0.8", "stop = 0.1").replace("decimation = 5\nsignals = [", f"signals = [{SIGNALS}")
    own = MORE.partition("[connect]\n")
    text = text.replace("[connect]\n", f"{own[0]}[connect]\n{own[2]}")
    text = text.replace("[inputs]\n", INPUTS)
    for name in ("run_to_run", "estimators", "soft_landing"):
        text = text.replace(f"../{name}/", f"{ROOT}/scenarios/{name}/")
    text = text.replace('"parameters/', f'"{ROOT}/scenarios/run_to_run/parameters/')
    (folder / "nine").mkdir(parents=True, exist_ok=True)
    (folder / "nine" / "scenario.toml").write_text(text, encoding="utf-8")
    return folder / "nine"
