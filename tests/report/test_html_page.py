"""The file of a report: whole, safe, small, or refused with what to do."""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
import webbrowser
from base64 import b64encode
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

import numpy as np
import pytest
from html_many import made_campaign, made_sweep
from html_results import made
from typer.testing import CliRunner

from gapsense._os.files import SEAL, seal
from gapsense.cli import app
from gapsense.cosim import read_result
from gapsense.cosim.result.result import Timing
from gapsense.problems import InputError
from gapsense.report.html import many_chapter
from gapsense.report.html.page import words, write_report

EVIL = '<script>alert("x")</script><img src=x onerror=alert(1)> & "co\' `</title>'


class Page(HTMLParser):
    """Elements of a page with their attributes, and the text of scripts, cells and headings."""

    def __init__(self, file: Path) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict]] = []
        self.texts: dict[str, list[str]] = {}
        self.inside: list[str] = []
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        self.texts.setdefault(tag, []).append("")
        if tag not in ("meta", "img"):
            self.inside.append(tag)

    def handle_endtag(self, tag):
        assert self.inside.pop() == tag

    def handle_data(self, data):
        for tag in set(self.inside):
            self.texts[tag][-1] += data


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Page:
    """A report on a result that fails."""
    folder = tmp_path_factory.mktemp("page")
    return Page(write_report([made().save(folder / "made.csv")], folder / "made.html"))


def test_texts_of_scenarios_are_texts_and_nothing_else(tmp_path, page):
    harmless = page
    result = made(title=EVIL, scenario=EVIL, variant=EVIL, seeds={EVIL: 1}, versions={EVIL: EVIL}, files={EVIL: EVIL})
    metrics = {name: replace(m, table=EVIL, label=EVIL, description=EVIL) for name, m in result.metrics.items()}
    facts = {name: {**fact, "fmu": EVIL, "guid": EVIL} for name, fact in result.run.components.items()}
    result = replace(
        result,
        metrics=metrics,
        failure=EVIL,
        messages=(("plant", 1, EVIL),),
        parameters={EVIL: EVIL},
        run=replace(result.run, components=facts, wires=(f"drive.{EVIL} -> plant.{EVIL}",)),
    )
    sidecar = result.save(tmp_path / "evil.csv").with_suffix(".json")
    data = json.loads(sidecar.read_text(encoding="utf-8"))
    data["events"] = [{"name": EVIL, "target": EVIL, "action": EVIL, "begin": 0.0, "end": 0.01}]
    del data[SEAL]
    sidecar.write_text(json.dumps(seal(data)), encoding="utf-8")
    page = Page(write_report([tmp_path / "evil.csv"], tmp_path / "evil.html"))
    count = [sum(tag in ("script", "img", "iframe", "link") for tag, _ in p.elements) for p in (page, harmless)]
    assert count[0] == count[1] == 4  # scripts: colours, figures, library, ours
    assert not [a for _, a in page.elements for name in a if name.startswith("on")]
    assert page.texts["h2"] == [f"{EVIL}: {EVIL}"] and page.texts["title"][0] == f"{EVIL}: {EVIL} - Gapsense"
    cells = page.texts["td"] + page.texts["th"]
    assert sum(EVIL in text for text in cells) >= 8


def test_policy_lets_only_the_scripts_of_the_page_run_and_nothing_be_fetched(page):
    (policy,) = [a["content"] for tag, a in page.elements if a.get("http-equiv") == "Content-Security-Policy"]
    kinds = [a.get("type") for tag, a in page.elements if tag == "script"]
    scripts = [text for kind, text in zip(kinds, page.texts["script"]) if kind is None]
    digests = [b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts]
    assert re.findall(r"'sha256-(.*?)'", policy) == digests and len(digests) == 2
    assert "default-src 'none'" in policy and "unsafe-eval" not in policy
    assert not [a for tag, a in page.elements if {"src", "srcset"} & {*a} or a.get("href", "#")[0] != "#"]


@pytest.mark.slow
def test_same_results_give_the_same_bytes_without_the_packages_of_other_extras(tmp_path, monkeypatch):
    """In another process, which has made another page, and in which sets have another order."""
    monkeypatch.chdir(tmp_path)  # commands that repeat a run are those of the working folder
    monkeypatch.setattr(many_chapter, "PANELS", 2)
    files = [made().save(tmp_path / "made.csv"), made_sweep(tmp_path / "swept"), made_campaign(tmp_path / "ran")]
    first = write_report(files, tmp_path / "first.html").read_bytes()
    code = f"""
import sys
sys.modules.update(dict.fromkeys(("pyarrow", "distributed", "dask", "pandas")))  # they never were there
from gapsense.report.html import many_chapter
from gapsense.report.html.page import write_report
many_chapter.PANELS, files = 2, {[*map(str, files)]!r}
write_report(files[:1], "before.html")
write_report(files, "other.html")
"""
    environment = {**os.environ, "PYTHONHASHSEED": "7"}
    subprocess.run([sys.executable, "-c", code], env=environment, check=True)
    assert first == (tmp_path / "other.html").read_bytes() and len(first) > 10**6


def test_page_is_accessible_as_far_as_a_program_can_see(page):
    tables = [k for k, (tag, _) in enumerate(page.elements) if tag == "table"]
    assert tables and len(page.texts["caption"]) == len(tables) and all(page.texts["caption"])
    assert all(a.get("scope") in ("col", "row") for tag, a in page.elements if tag == "th")
    assert all(a.get("aria-label") for _, a in page.elements if a.get("role") in ("img", "group"))
    levels = [int(tag[1]) for tag, _ in page.elements if re.fullmatch("h[1-6]", tag)]
    assert all(b <= a + 1 for a, b in zip(levels, levels[1:]))
    ids = [a["id"] for _, a in page.elements if "id" in a]
    assert len(ids) == len(set(ids))
    assert ("html", {"lang": "en"}) in page.elements


def test_page_tells_what_ran_and_what_came_out(page):
    text = "\n".join(page.texts["main"])
    assert "failed 1 of 2 metrics are outside of their bounds." in text
    for found in ("ab" * 32, "cd" * 32, "{0}", "Some.fmu", "0 s to 40 ms", "100 us", "76.0", "outside"):
        assert found in text, found
    assert "delayed: the value of one step before" in text and "with direct feedthrough" in text
    assert page.texts["h3"] == ["Wiring", "Metrics", "Signals", "Baseline", "Timing", "What ran"]


def test_timing_has_mean_median_and_longest_step_where_the_result_tells_them(tmp_path):
    old, new = made(), made()
    old = replace(old, timing={name: Timing(t.seconds, t.calls) for name, t in old.timing.items()})
    shown = []
    for name, result in (("new", new), ("old", old)):
        page = Page(write_report([result.save(tmp_path / f"{name}.csv")], tmp_path / f"{name}.html"))
        (row,) = (text for text in page.texts["tr"] if text.startswith("filter400"))
        shown.append(row)
    assert shown[0] == "filter4007.506.007503.0030 %" and shown[1] == "filter4007.50--3.0030 %"
    assert read_result(tmp_path / "old.csv").timing == old.timing


def test_several_results_have_a_table_of_all_that_leads_to_each(tmp_path):
    files = [made(title=name, scenario=name).save(tmp_path / f"{name}.csv") for name in ("one", "two")]
    page = Page(write_report(files, tmp_path / "both.html"))
    assert page.texts["h1"] == ["2 results, 2 failed"] and page.texts["h2"] == ["one", "two"]
    ids = {a["id"] for _, a in page.elements if "id" in a}
    links = [a["href"] for tag, a in page.elements if tag == "a"]
    assert len(links) == 2 and {link[1:] for link in links} <= ids


@pytest.mark.parametrize("rows", [0, 1, 2])
def test_runs_that_hardly_began_have_a_report(tmp_path, rows):
    empty = {name: np.zeros(rows) for name in ("plant.position", "filter.position")}
    result = replace(made(), times=1e-4 * np.arange(rows), signals=empty, metrics={}, failure="plant: it broke.")
    result = replace(result, about={name: made().about[name] for name in empty})
    page = Page(write_report([result.save(tmp_path / "x.csv")], tmp_path / "x.html"))
    assert "it broke" in page.texts["p"][0] + page.texts["main"][0]


def test_result_of_anybodys_fmus_has_a_report(tmp_path):
    """Without units, without wires, with names that no rule of ours knows."""
    times = np.linspace(0.0, 1.0, 50)
    result = made(50, {"plant.x[1].y": times**2, "filter.der(x)": times}, wires=(), direct=(), delayed=())
    page = Page(write_report([result.save(tmp_path / "x.csv")], tmp_path / "x.html"))
    assert "No connections are known" in "".join(page.texts["p"])
    assert {"plant.x[1].y", "filter.der(x)"} <= {text.strip() for text in page.texts["button"]}


@pytest.mark.slow
def test_long_records_make_no_large_file_and_the_numbers_stay_those_of_the_record(tmp_path):
    times = 1e-4 * np.arange(60_000)
    signals = {f"plant.x_{k}": np.random.default_rng(k).normal(size=times.size) for k in range(12)}
    file = write_report([made(times.size, signals).save(tmp_path / "long.csv")], tmp_path / "long.html")
    assert file.stat().st_size < 6e6
    page = Page(file)
    shown = [(int(a), int(b)) for a, b in re.findall(r"(\d+) of (\d+) points", "".join(page.texts["figcaption"]))]
    assert shown and all(few <= 4096 and rows == 60_000 for few, rows in shown)
    assert f"{signals['plant.x_3'].max():.6g}" in page.texts["td"]


def test_all_that_is_wrong_is_told_at_once_and_nothing_is_written(tmp_path):
    good = made().save(tmp_path / "good.csv")
    edited = made().save(tmp_path / "edited.csv")
    edited.write_text(edited.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    (tmp_path / "alone.csv").write_text("time\n0\n", encoding="utf-8")
    (tmp_path / "x_sweep.csv").write_text('"run"\n0.0\n', encoding="utf-8")  # of an older version
    (tmp_path / "x_sweep.sqlite").touch()
    names = ("edited.csv", "alone.csv", "none.csv", "x_sweep.csv", "x_sweep.sqlite", "good.json")
    with pytest.raises(InputError) as error:
        write_report([good, tmp_path, *(tmp_path / name for name in names)], tmp_path / "new" / "x.html")
    told = "\n".join(error.value.problems)
    assert len(error.value.problems) == 7 and not (tmp_path / "new").exists()
    found = (
        "`x_sweep.json` beside it is missing, or incomplete. Sweep again",
        "what a sweep continues from",
        "it is not a result. Name",
    )
    for word in (*found, "SHA-256", "missing, damaged or not a side-car", "it is the side-car"):
        assert word in told, word
    with pytest.raises(InputError, match="nothing to report on"):
        write_report([], tmp_path / "x.html")


def test_words_in_back_ticks_are_code_and_nothing_else_of_a_text_is_html():
    assert words("`a --b` & <i> `c") == "<code>a --b</code> &amp; &lt;i&gt; `c"


def test_without_bokeh_the_extra_to_install_is_told_and_the_old_file_stays(tmp_path, monkeypatch):
    file = made().save(tmp_path / "made.csv")
    (tmp_path / "made.html").write_text("old", encoding="utf-8")
    monkeypatch.setitem(sys.modules, "bokeh", None)
    with pytest.raises(InputError, match=r"pip install 'gapsense\[report\]'"):
        write_report([file], tmp_path / "made.html")
    assert (tmp_path / "made.html").read_text(encoding="utf-8") == "old"


def test_command_writes_beside_the_result_or_where_it_is_told(tmp_path):
    file = made().save(tmp_path / "made.csv")
    runner = CliRunner()
    done = runner.invoke(app, ["report", str(file)])
    assert done.exit_code == 0 and (tmp_path / "made.html").is_file(), done.output
    done = runner.invoke(app, ["report", str(file), "--out", str(tmp_path / "a" / "b.html")])
    assert done.exit_code == 0 and (tmp_path / "a" / "b.html").is_file(), done.output
    done = runner.invoke(app, ["report", str(tmp_path / "none.csv")])
    assert done.exit_code == 2 and "gapsense run" in " ".join(done.output.split())
    before = file.read_bytes()
    done = runner.invoke(app, ["report", str(file), "--out", str(file)])
    assert done.exit_code == 2 and "ends in `.html`" in " ".join(done.output.split())
    assert file.read_bytes() == before


@pytest.mark.parametrize("is_there", [True, False])
def test_open_shows_the_file_in_the_browser_or_says_that_there_is_none(tmp_path, monkeypatch, is_there):
    """By a relative path, in a folder whose name is not ASCII and has blanks."""
    folder, opened = tmp_path / "Prüfstand 3 # alt", []
    made().save(folder / "made.csv")
    monkeypatch.chdir(folder)
    monkeypatch.setattr(webbrowser, "open", lambda url: opened.append(url) or is_there)
    done = CliRunner().invoke(app, ["report", "made.csv", "--out", "mit Öl.html", "--open"])
    assert done.exit_code == 0 and "mit Öl.html written." in done.output, done.output
    (url,) = opened
    assert url.isascii() and " " not in url and "#" not in url and urlsplit(url).scheme == "file"
    assert Path(url2pathname(urlsplit(url).path)).samefile(folder / "mit Öl.html")
    assert ("no browser was found" in " ".join(done.output.split())) is not is_there


def test_report_opens_no_browser_unless_asked(tmp_path, monkeypatch):
    monkeypatch.setattr(webbrowser, "open", lambda url: pytest.fail(url))
    assert CliRunner().invoke(app, ["report", str(made().save(tmp_path / "made.csv"))]).exit_code == 0
