"""What a report says of sweeps and campaigns is what their rows say, and the commands in it repeat their runs."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest
from html_many import FACTORS, made_campaign, made_sweep, metrics, values
from html_results import made
from hypothesis import given
from hypothesis import strategies as st
from test_html_page import EVIL, Page
from typer.testing import CliRunner

from gapsense import read_campaign
from gapsense._os.files import SEAL, seal
from gapsense.cli import app
from gapsense.cosim import read_result
from gapsense.cosim.scenario.read import changed
from gapsense.many.columns import kind
from gapsense.many.result import KEY
from gapsense.many.store import Store
from gapsense.many.summary import distance, extremes, rows, spread
from gapsense.problems import InputError
from gapsense.report import distributions
from gapsense.report.html import many_chapter
from gapsense.report.html.many import read_many
from gapsense.report.html.many_chapter import goes_with, make_command
from gapsense.report.html.page import write_report

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
MAKERS = pytest.mark.parametrize("make", [made_sweep, made_campaign])


def page_of(*files: Path) -> Page:
    """The report on some results."""
    return Page(write_report(files, files[0].parent / "report.html"))


def cells(page: Page, first: str) -> list[str]:
    """Texts of the row of a table that begins with a text."""
    rows = [text.strip() for text in page.texts["tr"]]
    return [row for row in rows if row.startswith(first)]


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> dict:
    """The reports on a sweep and on a campaign of the same runs."""
    folder = tmp_path_factory.mktemp("pages")
    return {make: page_of(make(folder / make.__name__)) for make in (made_sweep, made_campaign)}


@pytest.fixture
def few(monkeypatch):
    """Few figures, for tests of what stands around them."""
    monkeypatch.setattr(many_chapter, "METRICS", 2)
    monkeypatch.setattr(many_chapter, "PANELS", 2)


@MAKERS
def test_page_tells_what_ran_what_failed_and_what_has_no_value(pages, make):
    page = pages[make]
    text = "\n".join(page.texts["main"])
    for found in (
        "Nobody ran it.",
        "demo[cold]",
        "30 of 30, 1 failed, 0 missing",
        "sensor 5",
        "ab" * 32,
        "valve: stuck.",
    ):
        assert found in text, found
    assert "✗ incomplete 1 run failed. 2 metrics with bounds, 1 outside of them in some runs." in text
    assert "2 metrics without a value in some runs that did not fail." in text
    heads = ["Failed runs", "Metrics", "Worst runs", "Distributions", "What was varied", "What ran"]
    assert page.texts["h3"] == heads and page.texts["h4"] == ["position error", "noise"]  # nothing is drawn of `never`
    (error,) = (row for row in cells(page, "position error") if "valve.r" in row)
    kept = np.delete(metrics(30)["miss"], [3, 4])
    assert f"{(kept > 2e-3).sum()} of 28" in error and "0 m to 2 mm" in error and error.endswith("2")
    assert "valve.mode1, fast" in cells(page, "valve.mode") and "valve.onFalse, True" in cells(page, "valve.on")


def test_sweep_and_campaign_of_the_same_runs_say_the_same(pages):
    same = [[row for row in page.texts["tr"] if "gapsense run" not in row] for page in pages.values()]
    assert same[0] == same[1] and len(same[0]) > 15


@MAKERS
def test_worst_runs_are_those_farthest_outside_or_farthest_from_the_median(tmp_path, make):
    many = read_many(make(tmp_path / "out"))
    own = metrics(30)
    error, noise = (np.where(np.isin(np.arange(30), [4]), np.nan, own[name]) for name in ("miss", "noise"))
    assert [one.run for one in many.extremes["miss"].worst] == np.argsort(-np.nan_to_num(error))[:3].tolist()
    assert many.extremes["miss"].worst[0].beyond == pytest.approx(np.nanmax(error) - 2e-3)
    assert many.extremes["noise"].worst[0].value == np.nanmax(noise)  # nearest to its upper bound, inside
    assert many.extremes["never"].worst == () and many.extremes["never"].outside == 0


@given(st.lists(st.floats(-9.0, 9.0) | st.just(float("nan")), max_size=40), st.none() | st.just((-1.0, 2.0)))
def test_distance_is_beyond_the_bounds_or_from_the_median(found, bounds):
    beyond = distance(np.array(found), 0.5, bounds)
    for one, by in zip(found, beyond):
        expected = abs(one - 0.5) if bounds is None else max(bounds[0] - one, one - bounds[1])
        assert by == (expected if one == one else -np.inf)


def test_extremes_and_rows_of_runs_in_many_batches_are_those_of_all(tmp_path, monkeypatch):
    monkeypatch.setattr("gapsense.many.store.GROUP", 7)
    monkeypatch.setattr("gapsense.many.result.ROOM", 0)  # as if they were too many for memory
    of = read_campaign(made_campaign(tmp_path / "out", 60))
    assert len(list(of.batches("run"))) > 5
    found = extremes(of, spread(of, "noise"), None, 4)
    noise = np.where(np.arange(60) == 4, np.nan, metrics(60)["noise"])
    order = np.argsort(-np.nan_to_num(np.abs(noise - np.nanmedian(noise))))
    assert [one.run for one in found.worst] == order[:4].tolist() and found.outside == 0
    assert rows(of, [5, 59, 5]) == {run: {"run": run, "seed": run, **values(run)} for run in (5, 59)}


@pytest.mark.parametrize("make", [made_sweep, made_campaign])
def test_command_gives_back_every_value_with_its_type(tmp_path, make, monkeypatch):
    monkeypatch.chdir(tmp_path)
    many = read_many(make(Path("out"), settings={"valve.damping": 0.5}))
    run = many.extremes["miss"].worst[0].run
    words = shlex.split(make_command(many, run))
    assert words[:5] == ["gapsense", "run", "out/demo/scenario.toml", "--variant", "cold"]
    Path("s.toml").write_text("", encoding="utf-8")
    given = changed("s.toml", words[6::2]).changes
    assert set(words[5::2]) == {"--set"}
    assert given == {"valve.damping": 0.5, "sensor.seed": 5 + run, **values(run)}
    assert [type(given[name]) for name in FACTORS] == [float, int, str, bool]


@pytest.mark.parametrize("make", [made_sweep, made_campaign])
def test_run_that_no_option_describes_is_repeated_in_python(tmp_path, make, monkeypatch):
    monkeypatch.chdir(tmp_path)
    many = read_many(make(Path("out"), has_random_events=True, seeds={}, points=10))
    end = make_command(many, many.extremes["miss"].worst[0].run)
    run = many.extremes["miss"].worst[0].run
    assert end.startswith("run(") and f"'cold', seed_shift={run}" in end
    assert (f"point={run % 10}" in end) is (make is made_sweep)
    assert ("'valve.n=" in end) is (make is made_campaign)
    nowhere = read_many(make(Path("nowhere"), source=""))
    assert make_command(nowhere, run) == f"the scenario has no file: run it with seed_shift={run}"


STUDY = """
title = "Two valves"
scenario = "semera_valve"
[grid]
"valve.coil.resistance" = [75.0, 77.0]
"""


@pytest.mark.parametrize("word", [pytest.param("sweep", marks=pytest.mark.slow), "campaign"])
def test_command_of_the_report_repeats_the_run_with_the_same_bits(fmus, tmp_path, monkeypatch, few, word):
    shutil.copytree(SCENARIOS / "semera_valve", tmp_path / "semera_valve")
    monkeypatch.chdir(tmp_path)
    Path("study.toml").write_text(STUDY, encoding="utf-8")
    options = ["semera_valve", "--seeds", 2, "--set", "valve.damping=0.41"] if word == "sweep" else ["study.toml"]
    done = CliRunner().invoke(app, [word, *map(str, options), "--fmus", str(fmus), "--workers", "1"])
    assert done.exit_code == 0, done.output
    many = read_many(Path("results/semera_valve_sweep.csv" if word == "sweep" else "results/study"))
    commands = [text for text in page_of(many.file).texts["code"] if text.startswith("gapsense run")]
    (command,) = (text for text in commands if "sensor.seed=2" in text)  # that of run 1
    done = CliRunner().invoke(app, [*shlex.split(command)[1:], "--fmus", str(fmus), "--out", "again"])
    assert done.exit_code in (0, 1), done.output  # 1: a metric is outside of its bounds
    (file,) = Path("again").glob("semera_valve*.csv")  # with the values of the run in its name
    again = read_result(file)
    found = {name: many.campaign.column(name)[1] for name in many.campaign.metrics}
    assert found == {name: measured.value for name, measured in again.metrics.items()}
    assert len(found) == 18 and many.bounds("semera_resistance_after") is not None


def test_results_of_all_kinds_come_in_one_file(tmp_path, few):
    single = made().save(tmp_path / "made.csv")
    page = page_of(single, made_sweep(tmp_path / "swept"), made_campaign(tmp_path / "ran", failed=-1, missing=2))
    assert page.texts["h1"] == ["3 results, 3 failed"]
    assert page.texts["h2"] == ["Made by hand", "By hand: sweep", "By hand: campaign"]
    assert "2 of 32 runs are missing" in "".join(page.texts["p"])


def test_result_of_an_older_version_has_a_report_without_bounds_and_commands(tmp_path, few):
    folder = made_campaign(tmp_path / "out")
    later = "bounds seeds source variant has_random_events settings description"
    with Store(folder / "campaign.sqlite", KEY) as store:
        store.describe({name: value for name, value in store.about.items() if name not in later.split()})
    text = "".join(page_of(folder).texts["main"])
    assert "the scenario has no file" in text and "outside by" not in text and "from the median" in text


def test_campaign_that_has_hardly_begun_has_a_report(tmp_path, few):
    for count in (0, 1, 2):
        page = page_of(made_campaign(tmp_path / f"out{count}", count, missing=9) if count != 0 else empty(tmp_path))
        assert "runs are missing" in "".join(page.texts["p"])


def empty(folder: Path) -> Path:
    """A campaign without any run."""
    made_campaign(folder / "none", 5)
    with Store(folder / "none" / "campaign.sqlite", KEY) as store:
        store.forget(range(5))
    return folder / "none"


@MAKERS
def test_texts_of_others_are_texts_and_nothing_else(tmp_path, pages, make, monkeypatch):
    monkeypatch.setattr("html_many.values", lambda run: {**values(run), "valve.mode": EVIL})
    labels = {name: [EVIL, EVIL] for name in ("miss", "noise")}
    page = page_of(make(tmp_path / "evil", title=EVIL, scenario=EVIL, description=EVIL, labels=labels, source=EVIL))
    count = [sum(tag in ("script", "img", "iframe", "link") for tag, _ in p.elements) for p in (page, pages[make])]
    assert count[0] == count[1] == 4
    assert not [a for _, a in page.elements for name in a if name.startswith("on")]
    assert page.texts["title"][0].startswith(EVIL)


def test_many_runs_are_counted_and_many_chapter_are_chosen(tmp_path, monkeypatch):
    monkeypatch.setattr(distributions, "POINTS", 20)
    monkeypatch.setattr(many_chapter, "PANELS", 6)
    many = read_many(made_campaign(tmp_path / "out", 200))
    chosen, note = many_chapter.panels(many)
    assert chosen == {"miss": ["valve.mode", "valve.on"], "noise": ["valve.mode", "valve.on"]}
    assert note == "2 of 3 metrics are drawn, each over the 2 of 4 parameters that it depends on most. "
    monkeypatch.setattr(many_chapter, "METRICS", 1)
    monkeypatch.setattr("gapsense.many.summary.MOST_LEVELS", 5)
    (only,) = many_chapter.panels(many)[0]
    assert only == "miss"  # it leaves its bounds
    drawer = many_chapter.Drawer(read_many(many.file), {"miss": ["valve.r"]})
    (image,) = drawer.over("miss", "valve.r", "key").figure.renderers
    shown = image.data_source.data["image"][0].view(np.uint8).reshape(-1, 4)[:, 3]
    assert (shown > 0).sum() == (drawer.found.clouds["valve.r", "miss"].counts > 0).sum() > 4


def test_color_is_stronger_where_more_runs_lie():
    alpha = many_chapter.colour_counts(np.array([[0.0, 1.0], [10.0, 1000.0]])).view(np.uint8).reshape(2, 2, 4)[..., 3]
    assert alpha[0, 0] == 0 and many_chapter.FAINTEST <= alpha[0, 1] < alpha[1, 0] < alpha[1, 1] == 255


def test_all_that_is_wrong_is_told_at_once_and_nothing_is_written(tmp_path):
    good, edited, other = (made_sweep(tmp_path / name) for name in ("good", "edited", "other"))
    edited.write_text(edited.read_text(encoding="utf-8").replace("70.0", "71.0"), encoding="utf-8")
    data = json.loads(other.with_suffix(".json").read_text(encoding="utf-8"))
    del data["metrics"]["noise"], data[SEAL]
    other.with_suffix(".json").write_text(json.dumps(seal(data)), encoding="utf-8")
    broken = made_campaign(tmp_path / "broken")
    (broken / "campaign.sqlite").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError) as error:
        write_report([good, edited, other, broken, good.with_suffix(".json")], tmp_path / "new" / "x.html")
    told = error.value.problems
    assert len(told) == 4 and not (tmp_path / "new").exists()
    for words, sentence in zip(
        ("not the table that", "other columns", "it is damaged (file is not a database)", "side-car"), told
    ):
        assert words in sentence
    assert re.search("Sweep again", told[0])


@pytest.mark.parametrize("name", ["tolerances", "of v1.2"])
def test_command_writes_beside_the_folder_of_a_campaign(tmp_path, monkeypatch, few, name):
    folder = made_campaign(tmp_path / name)
    monkeypatch.chdir(folder)
    done = CliRunner().invoke(app, ["report", "."])
    assert done.exit_code == 0 and (tmp_path / f"{name}.html").is_file(), done.output


@pytest.mark.parametrize(
    ("found", "expected"),
    [([1, 2], "int64"), ([1, 2.0], "double"), ([True], "bool"), (["a"], "string"), ([1, "a"], "string")],
)
def test_type_of_a_column_is_that_of_all_its_values(found, expected):
    assert kind(found) == expected


def test_metric_that_goes_up_and_down_with_a_parameter_is_said_to(tmp_path, monkeypatch):
    own = {name: np.resize(column, 210) for name, column in metrics(210).items()}
    bent = {**own, "miss": 1e-3 * np.abs(np.arange(210) % 7 - 3.0)}
    monkeypatch.setattr("html_many.metrics", lambda count: bent)
    many = read_many(made_campaign(tmp_path / "out", 210))
    assert goes_with(many, "miss") == "valve.r, up and down" and "valve." in goes_with(many, "noise")
    assert goes_with(many, "never") == "-"
    assert many_chapter.order_factors(many, "miss", ["valve.n", "valve.r"]) == ["valve.r", "valve.n"]


def test_metric_whose_name_a_campaign_needs_itself_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("html_many.metrics", lambda count: {"error": np.ones(count)})
    with pytest.raises(InputError, match="a metric is called `error`"):
        read_many(made_sweep(tmp_path / "out"))
