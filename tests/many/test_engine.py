"""A campaign gives the same table however it is done, and no run is done twice."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from studies_of_ramps import NOISE, STUDY, rows

from gapsense import campaign, read_campaign
from gapsense.cosim import run, sweep
from gapsense.cosim.scenario.read import CAMPAIGN_FILE
from gapsense.problems import InputError

KEPT = '[trajectories]\nsignals = ["noise.y", "source.*"]\ndecimation = 4\n'


def test_table_does_not_depend_on_the_workers_and_has_the_numbers_of_single_runs(write, fmus, tmp_path):
    study = write(STUDY + KEPT)
    one, two = (campaign(study, n, tmp_path / str(n), fmus) for n in (1, 2))
    assert rows(one) == rows(two)
    assert (one.rows, one.runs, one.computed, one.failed) == (12, 12, 12, 0)
    assert repr(one) == "<Campaign: 12 runs, 2 metrics>"
    scenario = tmp_path / "demo" / "scenario.toml"
    scenario.write_text(NOISE + '[sweep]\n"source.slope" = [1.0, 2.0, 3.0]\n"source.inverted" = [false, true]\n')
    for index in (0, 7):
        alone = run(scenario, fmus=fmus, seed_shift=index, point=index % 6)
        assert one.table()["spread"][index] == alone.metrics["spread"].value
        assert one.table()["end"][index] == alone.metrics["end"].value
        kept = two.trajectory(index)
        assert sorted(kept) == ["noise.y", "source.steps", "source.y", "time"]
        assert kept["time"].tolist() == alone.times[::4].tolist()
        assert kept["noise.y"].tolist() == alone["noise.y"][::4].tolist()


def test_sweep_is_a_campaign_that_names_its_scenario_only(write, fmus, tmp_path):
    scenario = NOISE + '[sweep]\n"source.slope" = [1.0, 2.0]\n"noise.sample_time" = [0.1, 0.2]\n'
    study = write('title = "as it is"\nscenario = "demo"\nseeds = 3\n', scenario)
    result, swept = campaign(study, 1, tmp_path / "out", fmus), sweep(tmp_path / "demo", 3, fmus=fmus)
    assert result.column("run").tolist() == [*swept.indices]
    for name, values in {**swept.metrics, **swept.grid}.items():
        assert result.column(name).tolist() == list(values), name
    assert result.quantiles() == swept.quantiles()
    assert {name: result.units[name] for name in swept.units} == swept.units


def test_same_call_does_nothing_again_and_more_seeds_keep_the_runs(write, fmus, tmp_path):
    old = campaign(write(), 1, tmp_path / "out", fmus)
    first = rows(old)
    assert campaign(write(), 1, tmp_path / "out", fmus).computed == 0
    more = campaign(write(STUDY.replace("seeds = 2", "seeds = 3")), 1, tmp_path / "out", fmus)
    assert (more.computed, more.rows) == (6, 18)
    assert {name: column[:12] for name, column in rows(more).items()} == first
    assert rows(old) == first  # as it was read
    with pytest.raises(InputError, match="it has changed since it was read"):
        replace(old).table()
    assert (tmp_path / "out" / "study.toml").read_text() == STUDY.replace("seeds = 2", "seeds = 3")


CHANGES = {
    "the values": (STUDY.replace("3.0]", "4.0]"), NOISE),
    "the scenario": (STUDY, NOISE.replace("stop = 10.0", "stop = 20.0")),
    "the scenario and the trajectories": (STUDY + KEPT, NOISE),
}


@pytest.mark.parametrize("what", CHANGES)
def test_folder_of_another_campaign_is_refused_and_left_alone(write, fmus, tmp_path, what):
    campaign(write(), 1, tmp_path / "out", fmus)
    before = (tmp_path / "out" / CAMPAIGN_FILE).read_bytes()
    with pytest.raises(InputError, match=f"it belongs to another campaign, {what} changed since. Name another folder"):
        campaign(write(*CHANGES[what]), 1, tmp_path / "out", fmus)
    assert (tmp_path / "out" / CAMPAIGN_FILE).read_bytes() == before


def test_folder_with_other_things_is_refused_and_left_alone(write, fmus, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    with pytest.raises(InputError, match="holds something other than a campaign"):
        campaign(write(), 1, tmp_path / "mine", fmus)
    assert [file.name for file in (tmp_path / "mine").iterdir()] == ["thesis.tex"]


def test_words_of_study_and_scenario_may_change(write, fmus, tmp_path):
    campaign(write(), 1, tmp_path / "out", fmus)
    other = write(STUDY.replace("Ramps", "Ramps and more"), NOISE.replace("Noise on", "Much noise on"))
    assert campaign(other, 1, tmp_path / "out", fmus).computed == 0
    assert read_campaign(tmp_path / "out").about["title"] == "Ramps and more"


DRAWN = """
title = "Drawn"
scenario = "demo"
[sample]
count = 4
method = "sobol"
[[sample.factors]]
parameter = "source.seed"
distribution = "integer"
low = 1
high = 9
[[sample.factors]]
parameter = "source.shape"
distribution = "choice"
values = ["up", "down"]
[[sample.factors]]
parameter = "source.slope"
distribution = "lognormal"
median = 2.0
sigma = 0.5
"""


def test_drawn_values_are_columns_of_their_types_and_again_the_same(write, fmus, tmp_path):
    first, again = (campaign(write(DRAWN), 1, tmp_path / name, fmus) for name in ("one", "two"))
    assert rows(first) == rows(again)
    assert [str(first.column(name).dtype) for name in first.factors] == ["int64", "object", "float64"]
    assert first.column("end") == pytest.approx(1.0 + 10.0 * first.column("source.slope"))
    assert set(first.column("source.shape")) <= {"up", "down"}


COMMON = 'title = "x"\nscenario = "demo"\nseeds = 2\nnoise = "common"\n[grid]\n"source.slope" = [1.0, 2.0]\n'


def test_common_noise_is_the_same_at_every_point(write, fmus, tmp_path):
    result = campaign(write(COMMON), 1, tmp_path / "out", fmus)
    spread = result.column("spread")
    assert result.column("seed").tolist() == [0, 0, 1, 1]
    assert spread[0] == spread[1] != spread[2] == spread[3]


def test_number_that_does_not_exist_is_missing_and_no_failure(write, fmus, tmp_path):
    rare = NOISE.replace('kind = "std"', 'kind = "std"\nwhere = "source.y"').replace(
        'fmu = "Source"', 'fmu = "Source"\nset = { level = 0.0 }'
    )
    result = campaign(write(COMMON.replace("2.0]", "0.0]"), rare), 1, tmp_path / "out", fmus)
    assert result.failed == 0
    assert np.isnan(result.column("spread")).tolist() == [False, True, False, True]
    assert np.isfinite(result.quantiles()["spread"]).all()


def test_result_can_be_read_while_it_grows(write, fmus, tmp_path):
    seen = []
    out = tmp_path / "out"
    campaign(write(), 1, out, fmus, progress=lambda done, total: seen.append((done, read_campaign(out).rows)))
    assert len(seen) > 2 and all(done <= there for done, there in seen)
    assert sorted(file.name for file in out.iterdir()) == [CAMPAIGN_FILE, "study.toml"]


def test_pandas_has_the_runs_and_their_units(write, fmus, tmp_path):
    pytest.importorskip("pandas")
    frame = campaign(write(), 1, tmp_path / "out", fmus).to_pandas()
    assert frame.loc[5, "source.slope"] == 3.0 and frame.attrs["units"]["source.slope"] == "V/s"
