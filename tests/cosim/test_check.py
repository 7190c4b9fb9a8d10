"""A scenario that does not fit its FMUs is refused before anything is loaded, with all problems at once."""

from dataclasses import replace

import pytest

from gapsense.cosim import ScenarioError, check, prepare, run
from gapsense.cosim.check import check_scenario, limits
from gapsense.cosim.fmu.descriptions import describe

SECOND = '[[connections]]\nfrom = "lag.y"\nto = "gain.u"\n'
SHORT = '[connect]\n"gain.u" = "lag.y"\n'


def test_good_scenario_has_no_problems(write, chain, fmus):
    assert check(write(chain), fmus=fmus) == []


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('fmu = "Lag"', 'fmu = "Lga"', ["components.lag.fmu", "Did you mean `Lag`?", "gapsense build"]),
        ('fmu = "Lag"', 'fmu = "parts/Lag.fmu"', ["there is no FMU", "That folder has no FMU"]),
        ('fmu = "Lag"', 'fmu = "scenario.toml.fmu"', ["cannot be used", "not a readable FMU"]),
        ("slope = 2.0", "slop = 2.0", ["unknown parameter `slop`", "Did you mean `slope`?"]),
        ("slope = 2.0", 'slope = "x"', ["`slope` is", "type Real is expected"]),
        ("slope = 2.0", "seed = 1.5", ["`seed` is `1.5`", "type Integer"]),
        ("slope = 2.0", "inverted = 1", ["`inverted` is `1`", "type Boolean"]),
        ("slope = 2.0", "shape = 1", ["`shape` is `1`", "type String"]),
        ("slope = 2.0", "seed = 9999999999", ["`seed` is 9999999999", "2147483647 expected"]),
        ('fmu = "Lag"', 'fmu = "Lag"\nset = { u = 0 }', ["`lag.u` is driven 2 times", "components.lag.set. Keep one"]),
        ("slope = 2.0", "y = 1.0", ["`y` is not a parameter", "`output`"]),
        ('fmu = "Lag"', 'fmu = "Lag"\nset = { "time.constant" = 0 }', ["is 0, 0.001 to 1000 s expected"]),
        ('fmu = "Lag"', 'fmu = "Lag"\nset = { u = true }', ["`u` is `true`, a value of type Real"]),
        ('fmu = "Lag"', 'fmu = "Lag"\noffset = 10', ["its first step ends after 11 base steps"]),
        ('from = "lag.y"', 'from = "lag.yy"', ["connections[1].from", "unknown variable `yy`", "Did you mean `y`?"]),
        ('from = "lag.y"', 'from = "lag.u"', ["`lag.u` is an input, an output is expected"]),
        ('to = "lag.u"', 'to = "lag.u"\nfactor = true', ["connections[0].factor: `true` found"]),
        ('from = "lag.y"', 'from = "leg.y"', ["there is no component `leg`", "Did you mean `lag`?"]),
        ('from = "lag.y"', 'from = "gain.y"', ["gain.y [A] -> gain.u [V]: units differ", "`factor`"]),
        ('to = "gain.u"', 'to = "lag.u"', ["`lag.u` is driven 2 times, by connections[0], connections[1]"]),
        (SECOND, SHORT.replace("lag.y", "lag.yy"), ["connect.gain.u: unknown variable `yy`", "Did you mean `y`?"]),
        (SECOND, SHORT.replace("gain.u", "gain.v"), ["connect.gain.v: unknown variable `v`", "nothing drives"]),
        (SECOND, SHORT.replace("lag.y", "leg.y"), ["connect.gain.u: there is no component `leg`", "`lag`?"]),
        (SECOND, SHORT.replace("lag.y", "gain.y"), ["connect.gain.u: gain.y [A] -> gain.u [V]: units differ"]),
        (SECOND, SECOND + SHORT, ["`gain.u` is driven 2 times, by connect.gain.u, connections[1]. Keep one."]),
        (SECOND, SHORT + "[inputs]\ngain.u = 1\n", ["`gain.u` is driven 2 times, by connect.gain.u, inputs.gain.u"]),
        (SECOND, "", ["nothing drives `gain.u`", "its start value is 0.0"]),
        (SECOND, '[inputs]\n"gain.u" = 2000\n', ["inputs.gain.u", "-1000 to 1000 V expected"]),
        (SECOND, SECOND + '[inputs]\n"gain.u" = 1\n', ["`gain.u` is driven 2 times", "inputs"]),
        (SECOND, SECOND + '[inputs]\n"gain.y" = 1\n', ["`gain.y` is an output, an input is expected"]),
        (SECOND, SECOND + "[seeds]\nlag = 1\n", ["seeds.lag", "no Integer parameter `seed`"]),
        (SECOND, SECOND + "[seeds]\nsurce = 1\n", ["seeds.surce", "Did you mean `source`?"]),
        (SECOND, SECOND + '[record]\nsignals = ["lag.x*"]\n', ["record.signals", "`lag.x*` matches no"]),
        (SECOND, SECOND + '[record]\nsignals = ["lag.time.constant"]\n', ["matches no input or output"]),
        (SECOND, SECOND + '[baseline]\nsignals = ["lagg.y"]\n', ["baseline.signals", "Did you mean `lag.y`?"]),
        (SECOND, SECOND + "[baseline.tolerances.lagg]\nrtol=1\n", ["baseline.tolerances", "`lagg`"]),
    ],
)
def test_what_does_not_fit_is_named(write, chain, fmus, old, new, expected):
    assert old in chain
    path = write(chain.replace(old, new, 1))
    (path.parent / "scenario.toml.fmu").write_text("no archive")
    text = "\n".join(check(path, fmus=fmus))
    for part in expected:
        assert part in text


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ('signal = "gain.z"', "unknown signal `gain.z`"),
        ('signal = "source.y"', "`source.y` is not recorded. Add it to `record.signals`"),
        ('signal = "lag.y"\nreference = "gain.y"', "lag.y [V] is compared with gain.y [A]: units differ"),
        ('signal = "lag.y"\nreference = "source.shape"', "unknown signal `source.shape`"),
        ('signal = "lag.y"\nreference = "source.level"', ""),
        ('signal = "lag.y"\nreference = 2', ""),
        ('signal = "lag.y"\nkind = "loop_area"\nreference = "gain.y"', ""),
        ('signal = "lag.y"\nkind = "loop_area"\nreference = "source.level"', "unknown signal `source.level`"),
    ],
)
def test_metric_uses_what_is_recorded(write, chain, fmus, lines, expected):
    lines = lines if "kind" in lines else f'kind = "max_abs"\n{lines}'
    text = chain + f'[record]\nsignals = ["lag.*", "gain.*"]\n[metrics.m]\n{lines}\n'
    found = check(write(text), fmus=fmus)
    assert (expected in found[0]) if expected else found == []


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ('"source.slope" = [1.0, 2]\nsource.inverted = [true, false]', []),
        ('"source.slop" = [1.0]', ["sweep.source.slop: unknown parameter `slop`. Did you mean `slope`?"]),
        ('"surce.slope" = [1.0]', ["sweep.surce.slope: there is no component `surce`. Did you mean `source`?"]),
        ('"source.slope" = [1.0, "x"]', ['`slope` is `"x"`, a value of type Real']),
        ('"lag.time.constant" = [0.1, 0.0, -1.0]', ["is 0.0, 0.001 to 1000 s", "is -1.0, 0.001 to 1000 s"]),
        ('"lag.u" = [1.0]', ["`lag.u` is driven 2 times, by connections[0], sweep.lag.u"]),
        ('"source.slope" = 1.0', ["`1.0` found, a list of finite numbers, truth values or texts expected"]),
        ('"source.slope" = []', ["`[]` found, a list of finite numbers"]),
        ('"source.slope" = [[1.0]]', ["`[1.0]` found in the list, a finite number"]),
        ('"source.slope" = [1.0, 2.0, 1]', ["sweep.source.slope: the same value is given twice"]),
        ('"source.slope" = [1.0]\nsource.slope = [2.0]', ["given twice, once as a dotted key and once in a table"]),
        ("slope = [1.0]", ["`slope` found, `component.variable` expected"]),
        ('"source.table.file" = ["none.csv"]', ["there is no file"]),
        ('"source.seed" = [1, 2]', ["sweep.source.seed: the seed is also given in `seeds.source`"]),
    ],
)
def test_grid_of_a_sweep_is_checked(write, chain, fmus, lines, expected):
    found = check(write(f"{chain}[seeds]\nsource = 1\n[sweep]\n{lines}\n"), fmus=fmus)
    assert len(found) == len(expected)
    for problem, part in zip(found, expected):
        assert "sweep" in problem
        assert part in problem


def test_sample_times_of_a_sweep_fit_the_step(write, chain, fmus):
    noise = '[components.noise]\nfmu = "Noise"\n[sweep]\n"noise.sample_time" = [0.1, 0.05, 0.07]\n'
    found = check(write(chain + noise), fmus=fmus)
    assert len(found) == 1
    assert "`sample_time` is 0.07 s" in found[0]


def test_seed_given_twice_is_refused(write, chain, fmus):
    text = chain.replace("slope = 2.0", "seed = 1") + "[seeds]\nsource = 1\n"
    assert "`seed` is also given in scenario.toml, components.source.set" in check(write(text), fmus=fmus)[0]


def test_different_units_are_joined_by_a_stated_conversion(write, chain, fmus):
    loop = chain.replace('from = "source.y"', 'from = "gain.y"')
    assert any("units differ" in problem for problem in check(write(loop), fmus=fmus))
    assert check(write(loop.replace('to = "lag.u"', 'to = "lag.u"\nfactor = 2.0\nunit = "V"')), fmus=fmus) == []
    wrong = loop.replace('to = "lag.u"', 'to = "lag.u"\nfactor = 2.0\nunit = "A"')
    assert "after conversion to [A]" in check(write(wrong), fmus=fmus)[0]


def test_feedthrough_cycle_is_refused_with_its_variables(write, chain, fmus):
    text = chain.replace('from = "lag.y"', 'from = "gain.y"\nfactor = 1.0')
    for method in ("gauss-seidel", "jacobi"):
        found = check(write(text.replace("stop", f'method = "{method}"\nstop')), fmus=fmus)
        assert "algebraic loop through gain.y -> gain.u" in "\n".join(found)


@pytest.mark.parametrize(("step", "sample_time", "fits"), [(1, 0.1, 1), (3, 0.1, 1), (1, 0.3, 1), (2, 0.3, 0)])
def test_step_must_fit_the_sample_time(write, chain, fmus, step, sample_time, fits):
    noise = f'[components.noise]\nfmu = "Noise"\nstep = {step}\nset = {{ sample_time = {sample_time} }}\n'
    found = check(write(chain + noise), fmus=fmus)
    assert len(found) == 1 - fits
    assert fits or "whole multiple" in found[0]


def test_problems_of_file_and_fmus_come_together(write, chain, fmus):
    text = chain.replace("stop = 1.0", "stop = 1.05").replace("slope", "slop").replace("lag.u", "lag.v")
    with pytest.raises(ScenarioError) as caught:
        run(write(text), fmus=fmus)
    text = str(caught.value)
    assert all(part in text for part in ("whole number", "`slop`", "unknown variable `v`", "nothing drives `lag.u`"))


def test_check_covers_the_variants(write, chain, fmus):
    found = check(write(chain + "[variants.bad]\ncomponents.source.set.slop = 1\n"), fmus=fmus)
    assert len(found) == 1
    assert found[0].startswith("variant bad: ")


def test_misspelt_component_of_a_variant_is_no_missing_file(write, chain, fmus):
    found = check(write(chain + "[variants.bad]\ncomponents.soruce.set.slope = 1\n"), fmus=fmus)
    assert [text.partition(".toml, ")[2] for text in found] == [
        "components.soruce: there is nothing of it but this. Did you mean `source`?",
        "components.soruce.fmu: missing; a text is expected. Add it.",
    ]


def test_limit_on_one_side_is_told_without_infinity(fmus):
    u = describe(fmus / "Lag.fmu").variables["u"]
    ends = [(0.5, None), (None, 2.0), (0.5, 2.0)]
    told = [limits(replace(u, min=low, max=high)) for low, high in ends]
    assert told == ["at least 0.5 V", "at most 2 V", "0.5 to 2 V"]


APART = 'isolation = "process"'


def test_second_instance_of_a_single_fmu_is_refused(write, chain, fmus):
    text = chain.replace('fmu = "Lag"', 'fmu = "Gain"').replace("lag.y", "source.y")
    scenario, descriptions = prepare(write(text), None, fmus)
    single = {name: replace(description, is_single=True) for name, description in descriptions.items()}
    assert check_scenario(scenario, single) == [
        "scenario.toml, components.gain.fmu: `lag` uses it too, and a process can hold only one. "
        'Give `components.gain` a process of its own: `isolation = "process"`.'
    ]
    apart = write(text.replace("[components.gain]", "[components.gain]\n" + APART))
    scenario, descriptions = prepare(apart, None, fmus)
    assert check_scenario(scenario, single) == []


def shared(chain: str, set_: str = "", source: str = '["one.toml"]') -> str:
    text = chain.replace('fmu = "Source"\nset = { slope = 2.0 }', f'fmu = "Source"\nparameters = {source}')
    return text.replace('fmu = "Lag"', f'fmu = "Lag"\nparameters = ["one.toml"]\nset = {{ {set_} }}')


DEVICE = '[values]\nslope = 4.0\n"time.constant" = 0.5\n'


def test_each_component_takes_of_a_parameter_set_what_it_has(write, chain, fmus):
    path = write(shared(chain), one=DEVICE)
    assert check(path, fmus=fmus) == []
    components = prepare(path, None, fmus)[0].components
    assert components["source"].values == {"slope": 4.0}
    assert components["lag"].values == {"time.constant": 0.5}
    assert {n: v for n, v in run(path, fmus=fmus).parameters.items() if n in ("source.slope", "lag.time.constant")} == {
        "source.slope": 4.0,
        "lag.time.constant": 0.5,
    }


@pytest.mark.parametrize("name", ["slope", "fault"])
def test_name_of_a_parameter_set_that_another_fmu_has_is_left_to_it(write, chain, fmus, name):
    path = write(shared(chain, "", "[]"), one=f"{DEVICE}{name} = 3\n" if name not in DEVICE else DEVICE)
    assert check(path, fmus=fmus) == []  # `source` of the scenario has a slope, only an FMU beside it the other
    assert prepare(path, None, fmus)[0].components["lag"].values == {"time.constant": 0.5}


@pytest.mark.parametrize(
    ("source", "inline", "one", "two", "expected"),
    [
        ("[]", "", f"{DEVICE}incline = 1.0\n", "", "one.toml (given to `lag`): unknown parameter `incline`. Known: "),
        (
            '["two.toml"]',
            "",
            f"{DEVICE}incline = 1.0\n",
            f"{DEVICE}mass = 1.0\n",
            "one.toml (given to `lag`): unknown parameter `incline`. ",
        ),
        (
            '["one.toml"]',
            "",
            f"{DEVICE}slop = 1.0\n",
            "",
            "one.toml (given to `source`, `lag`): unknown parameter `slop`. ",
        ),
        (
            '["one.toml"]',
            "",
            f"{DEVICE}u = 1.0\n",
            "",
            "`u` is not a parameter but has the causality `input`. Give its value in",
        ),
        (
            '["one.toml"]',
            "",
            DEVICE.replace("0.5", "0.0"),
            "",
            "components.lag (from one.toml): `time.constant` is 0.0",
        ),
        (
            '["one.toml"]',
            "slope = 1.0",
            DEVICE,
            "",
            "(from scenario.toml, components.lag.set): unknown parameter `slope`",
        ),
    ],
)
def test_name_that_nobody_has_is_refused(write, chain, fmus, source, inline, one, two, expected):
    found = check(write(shared(chain, inline, source), one=one, two=two or "[values]\n"), fmus=fmus)
    wanted = [problem for problem in found if problem.startswith("scenario.toml, ") and expected in problem]
    assert len(wanted) == 1
    assert len(found) == (2 if two else 1)  # both files, each with a name that no FMU has
    assert "slop`. Did" not in wanted[0] or "Did you mean `slope`?" in wanted[0]


def test_names_are_not_judged_before_every_component_given_them_is_known(write, chain, fmus):
    found = check(write(shared(chain).replace('"Source"', '"Sorce"'), one=DEVICE), fmus=fmus)
    assert len(found) == 1
    assert "there is no FMU" in found[0]


def test_native_fmus_that_are_not_built_are_built_with_their_option(write, chain, tmp_path):
    for folder, command in (("native", "`gapsense build --native`"), ("fmus", "`gapsense build`")):
        assert command in check(write(chain), fmus=tmp_path / "build" / folder)[0]
