"""Events on the command line: a run tells when they were on, the study of faults draws them side by side."""

import json
from pathlib import Path

import pytest

FAULTS = Path(__file__).resolve().parents[2] / "scenarios" / "faults"


def test_run_tells_and_saves_when_events_were_on(gapsense, fmus):
    done = gapsense("run", FAULTS, "--variant", "shorted", "--fmus", fmus, "--set", "events.short_seen.enabled=false")
    assert done.exit_code == 1, done.output  # the sensor does not see it, so Mhe is told a wrong voltage
    assert "short " in done.output and "44.99 ms" in done.output and "64.99 ms" in done.output
    (file,) = Path("results").glob("*.json")
    (event,) = json.loads(file.read_text("utf-8"))["events"]
    assert event["begin"] == pytest.approx(44.99e-3) and event["end"] == pytest.approx(64.99e-3)
    assert (event["name"], event["target"], event["action"]) == ("short", "actuator.voltage", "set")


@pytest.mark.slow
def test_study_of_faults_shows_all_variants_and_draws(gapsense, fmus):
    done = gapsense("study", "faults", "--fmus", fmus)
    assert done.exit_code == 0, done.output
    for name in ("none", "bias", "drift", "stuck", "dropout", "noise", "warming", "open", "shorted"):
        assert f"\n  {name} " in done.output
    assert done.output.count("never") >= 10
    assert Path("results", "faults.png").stat().st_size > 10_000
