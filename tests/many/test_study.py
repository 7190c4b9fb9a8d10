"""What is wrong with a study is told before anything runs, all at once, with place and remedy."""

from __future__ import annotations

import pytest
from studies_of_ramps import NOISE, STUDY

from gapsense import campaign, check_study
from gapsense.cosim.scenario.keys import FILE
from gapsense.many.prepare import prepare
from gapsense.problems import ScenarioError
from gapsense.tables import Key

SAMPLE = '[sample]\ncount = 8\n[[sample.factors]]\nparameter = "noise.sample_time"\n'
RANGE = '[[ranges]]\nparameter = "noise.sample_time"\n'
WRONG = {
    'title = "Ramps"': {
        'titel = "Ramps"': ["title: missing", "titel: unknown key. Did you mean `title`?"],
        "title = 3": ["title: `3` found, a text expected"],
    },
    'scenario = "demo"': {
        "": ["scenario: missing"],
        'scenario = "dem"': ["dem: there is no such file"],
        'scenario = "demo"\nvariant = "cold"': ["there is no variant `cold`"],
        'scenario = "demo"\nnoise = "commn"': ["noise: `commn` found. Did you mean `common`?"],
        'scenario = "demo"\nrows = "none.csv"': ["none.csv: No such file or directory"],
    },
    "seeds = 2": {
        "seeds = 0": ["seeds: `0` found, a whole number of at least 1"],
        "seeds = 100_000_000": ["x 100000000 runs found, at most 10000000"],
    },
    '"source.slope" = [1.0, 2.0, 3.0]': {
        '"source.slop" = [1.0]': ["ramps.toml, grid.source.slop: unknown parameter `slop`. Did you mean `slope`?"],
        '"sorce.slope" = [1.0]': [
            "ramps.toml, grid.sorce.slope: there is no component `sorce`. Did you mean `source`?"
        ],
        '"slope" = [1.0]': ["grid.slope: `slope` found, `component.variable` expected"],
        '"source.slope" = [1.0, "steep"]': ['grid.source.slope: `slope` is `"steep"`, a value of type Real'],
        '"source.slope" = [1.0, 1.0]': ["grid.source.slope: the same value is given twice"],
        '"source.slope" = 1.0': ["grid.source.slope: `1.0` found, a list of finite numbers"],
        '"source.slope" = []': ["grid.source.slope: "],
        '"noise.seed" = [1]': ["grid.noise.seed: the seed is also given in `seeds.noise`"],
        '"source.y" = [1.0]': ["grid.source.y: `y` is not a parameter but has the causality `output`"],
        '"source.table.file" = ["none.csv"]': ["there is no file"],
        '"noise.sample_time" = [0.07]': ["its step is 0.1 s and `sample_time` is 0.07 s"],
        '"source.seed" = [1, 1.5]': ["grid.source.seed: `seed` is `1.5`, a value of type Integer"],
    },
    '"source.inverted" = [false, true]': {
        f"{RANGE}from = 0.1\nto = 0.1\ncount = 2": ["ranges[0]: 2 values from 0.1 to 0.1"],
        f"{RANGE}from = 0.1\nto = 0.2\ncount = 1": ["ranges[0]: 1 values from 0.1 to 0.2"],
        f'{RANGE}from = 0.0\nto = 0.2\ncount = 2\nspacing = "log"': ["even ratios from 0 to 0.2 do not exist"],
        f"{RANGE}from = 0.1\nto = 0.2": ["ranges[0].count: missing"],
        f"{RANGE}from = 0.1\nto = 0.2\ncount = 100_000_000": ["ranges[0].count: 100000000 found"],
        f"{RANGE}from = 0.1\nto = 0.2\ncount = 2\nscale = 1": ["ranges[0].scale: unknown key"],
        "[sample]\ncount = 8": ["sample.factors: missing"],
        "[sample]\ncount = 8\nfactors = []": ["sample.factors: there is none"],
        '[sample]\ncount = 8\nmethod = "sobl"\nfactors = []': ["Did you mean `sobol`?", "factors: there is none"],
        f'{SAMPLE}distribution = "uniform"\nlow = 1.0': ["sample.factors[0].high: missing; `uniform` needs it"],
        f'{SAMPLE}distribution = "uniform"\nlow = 1.0\nhigh = 0.5': ["`low` is 1 and `high` is 0.5"],
        f'{SAMPLE}distribution = "uniform"\nlow = 0.1\nhigh = 0.2\nmean = 0.1': ["factors[0].mean: `uniform` does not"],
        f'{SAMPLE}distribution = "gauss"': ["distribution: `gauss` found. Known: `choice`"],
        f'{SAMPLE}distribution = "normal"\nmean = 0.1\nstd = 0.0': ["std: `0.0` found, a positive number"],
        f'{SAMPLE}distribution = "normal"\nmean = 0.1\nstd = 0.1\nlow = 3.0': ["the limits leave less than 1e-09"],
        f'{SAMPLE}distribution = "loguniform"\nlow = 0.0\nhigh = 1.0': ["`low` is 0, a positive number is expected"],
        f'{SAMPLE}distribution = "lognormal"\nmedian = 1.0\nsigma = 0.1\nhigh = -1.0': ["`high` is -1, a positive"],
        f'{SAMPLE}distribution = "integer"\nlow = 1\nhigh = 2.5': ["`high` is 2.5, a whole number is expected"],
        f'{SAMPLE.replace("8", "12")}distribution = "uniform"\nlow = 0.1\nhigh = 0.2\n'.replace(
            "count", 'method = "sobol"\ncount'
        ): ["sample.count: 12 found, a power of 2 expected for Sobol: 8 or 16"],
        f'{SAMPLE.replace("8", "20_000_000")}distribution = "uniform"\nlow = 0.1\nhigh = 0.2': [
            "sample.count: 20000000 found, at most 10000000 are allowed"
        ],
        '[trajectories]\nsignals = ["noise.z"]': ["trajectories.signals: `noise.z` matches no input or output"],
        "[trajectories]": ["trajectories.signals: missing"],
        "[[sample]]\ncount = 3": ["sample: a list found, a table expected"],
    },
}
CASES = [(old, new, expected) for old, news in WRONG.items() for new, expected in news.items()]


@pytest.mark.parametrize(("old", "new", "expected"), CASES)
def test_wrong_studies_are_told(write, fmus, old, new, expected):
    assert STUDY.count(old) == 1
    problems = check_study(write(STUDY.replace(old, new)), fmus)
    for sentence in expected:
        assert sum(sentence in problem for problem in problems) == 1, problems
    assert len(problems) == len(expected), problems
    with pytest.raises(ScenarioError):
        campaign(write(STUDY.replace(old, new)), fmus=fmus, out="never")


def test_problems_of_study_scenario_and_fmus_come_together(write, fmus):
    study = STUDY.replace("seeds = 2", "seed = 2").replace("slope", "slop")
    problems = check_study(write(study, NOISE.replace('"noise.y"', '"noise.z"')), fmus)
    assert ["seed: unknown key" in problems[0], "noise.z" in problems[-1], len(problems)] == [True, True, 3]


def test_parameter_in_two_places_is_refused(write, fmus):
    again = STUDY + RANGE.replace("noise.sample_time", "source.slope") + "from = 1.0\nto = 2.0\ncount = 2\n"
    assert check_study(write(again), fmus) == [
        "ramps.toml, ranges[0].parameter: `source.slope` is given in `grid.source.slope` too. Keep one."
    ]
    swept = NOISE + '[sweep]\n"source.slope" = [4.0]\n'
    assert check_study(write(STUDY, swept), fmus) == [
        "ramps.toml, grid.source.slope: the scenario's `[sweep]` gives `source.slope` too. Keep one."
    ]


def test_many_wrong_values_are_few_sentences(write, fmus):
    factor = SAMPLE.replace("8", "400").replace("noise.sample_time", "source.seed")
    problems = check_study(write(STUDY + f'{factor}distribution = "uniform"\nlow = 0.0\nhigh = 1.0\n'), fmus)
    assert len(problems) == 4
    assert "sample.factors, `source.seed`: `seed` is" in problems[0]
    assert problems[-1] == "ramps.toml, sample.factors, `source.seed`: 397 more values are wrong."


def test_extremes_of_many_draws_are_held_against_the_limits(write, fmus):
    lag = NOISE + '[components.lag]\nfmu = "Lag"\n[connect]\n"lag.u" = "source.y"\n'
    factor = SAMPLE.replace("8", "5000").replace("noise.sample_time", "lag.time.constant")
    study = f'{STUDY}{factor}distribution = "normal"\nmean = 500.0\nstd = 130.0\n'
    problems = check_study(write(study, lag), fmus)
    assert problems and all("sample.factors, `lag.time.constant`" in problem for problem in problems)
    assert not check_study(write(f"{study}low = 1.0\nhigh = 1000.0\n", lag), fmus)


def test_same_noise_in_all_runs_and_nothing_to_keep_are_refused(write, fmus):
    silent = NOISE.replace("[seeds]\nnoise = 10\n", "")
    assert "2 runs of each point would be the same" in check_study(write(STUDY, silent), fmus)[0]
    bare = NOISE.partition("[metrics")[0]
    assert "would be kept. Add" in check_study(write(STUDY, bare), fmus)[0]
    named = NOISE.replace("[metrics.spread]", "[metrics.run]")
    assert "metrics.run: a result has a column of that name" in check_study(write(STUDY, named), fmus)[0]


def test_units_and_cells_of_rows_are_told_with_their_lines(write, fmus, tmp_path):
    study = write(STUDY.replace("seeds = 2", 'rows = "rows.csv"').replace('"source.slope" = [1.0, 2.0, 3.0]\n', ""))
    (tmp_path / "rows.csv").write_text("source.slope [mV/s]\n1.0\nsteep\n")
    problems = check_study(study, fmus)
    assert (
        "ramps.toml, rows, `source.slope` (rows.csv, line 1, column 1): it is in `mV/s`, `V/s` is expected"
        in problems[0]
    )
    assert '(rows.csv, line 3, column 1): `slope` is `"steep"`' in problems[1]


@pytest.mark.parametrize("place", [999, 1_000, 2_345])
@pytest.mark.parametrize(
    ("name", "good", "wrong", "told"),
    [
        ("source.inverted", "true", "upwards", '`inverted` is `"upwards"`, a value of type Boolean'),
        ("source.slope", "2.0", "steep", '`slope` is `"steep"`, a value of type Real'),
        ("source.seed", "3", "1.5", "`seed` is `1.5`, a value of type Integer"),
    ],
)
def test_wrong_cell_is_told_in_whichever_row(write, fmus, tmp_path, place, name, good, wrong, told):
    cells = [good] * 3_000
    cells[place] = wrong
    (tmp_path / "rows.csv").write_text("\n".join([name, *cells]))
    found = check_study(write('title = "x"\nscenario = "demo"\nrows = "rows.csv"\n'), fmus)
    assert len(found) == 1 and told in found[0] and f"rows.csv, line {place + 2}," in found[0], found


def test_wrong_sample_time_is_told_in_whichever_row(write, fmus, tmp_path):
    (tmp_path / "rows.csv").write_text("\n".join(["noise.sample_time", *["0.1", "0.05"] * 1_000, "0.07", "0.1"]))
    found = check_study(write('title = "x"\nscenario = "demo"\nrows = "rows.csv"\n'), fmus)
    assert len(found) == 1 and "`sample_time` is 0.07 s" in found[0], found


def test_input_that_the_scenario_holds_constant_can_be_varied(write, fmus):
    gain = '[components.gain]\nfmu = "Gain"\n[inputs]\n"gain.u" = 1.0\n'
    gain = NOISE + gain + '[metrics.out]\nkind = "final"\nsignal = "gain.y"\n'
    study = write('title = "x"\nscenario = "demo"\n[grid]\n"gain.u" = [1.0, 2.0, 3.0]\n', gain)
    values = campaign(study, fmus=fmus, workers=1, out=study.parent / "out").column("out")
    assert values == pytest.approx([values[0], 2.0 * values[0], 3.0 * values[0]]) and values[0] != 0.0


def test_keys_of_studies_are_written_as_those_of_scenarios():
    from gapsense.many.keys import STUDY as section

    assert all(isinstance(key, Key) and key.what for key in (*section.keys, *FILE.keys))


def test_plan_is_checked_with_the_sweep_of_the_scenario(write, fmus):
    swept = NOISE + '[sweep]\n"noise.sample_time" = [0.1, 0.2]\n'
    prepared = prepare(write(STUDY, swept), fmus)
    assert prepared.many.plan.points == 12
    assert [str(port) for port in prepared.many.plan.ports] == ["noise.sample_time", "source.slope", "source.inverted"]
