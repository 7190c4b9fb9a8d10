"""The page in an FMU: its tables, its headings, its picture."""

from __future__ import annotations

import csv
import re
import shutil
from xml.etree import ElementTree

import pytest
from drivers import ROOT

from gapsense.fmi import page, picture
from gapsense.fmi.components import find_components, load_component

FOLDERS = find_components(ROOT / "fmus")


@pytest.fixture(params=FOLDERS, ids=lambda folder: folder.name)
def folder(request):
    return request.param


@pytest.fixture
def html(folder) -> str:
    component, text = load_component(folder), (folder / "page.md").read_text("utf-8")
    return page.html(component, text, "1.2.3", picture.figure(component, folder))


def test_no_heading_comes_twice(html):
    headings = re.findall(r"<h2 id=\".*?\">(.*?)</h2>", html)
    assert len(set(headings)) == len(headings) and {"Inputs", "Outputs", "Parameters", "How to run"} <= set(headings)


def test_nothing_that_the_page_says_is_lost(folder, html):
    said = page.MarkdownIt("commonmark").enable("table").render((folder / "page.md").read_text("utf-8"))
    words = re.findall(r"\w+", re.sub(r"<.*?>", " ", said))
    found = set(re.findall(r"\w+", re.sub(r"<.*?>", " ", html)))
    assert set(words) <= found


def test_tables_scroll_in_a_box_and_numbers_do_not_break(html):
    assert html.count("<table>") == html.count('<div class="wide"><table>') == html.count("</table></div>") > 0
    assert re.search(r"\.wide\{overflow-x:auto", html) and re.search(r"\.number[^{]*\{white-space:nowrap\}", html)
    cells = re.findall(r"<td([^>]*)>(-?[\d.]+(?:e[-+]\d+)?)</td>", html)
    of_ports = [(attribute, number) for attribute, number in cells if "<td>" not in f"<td{attribute}>"]
    assert not [number for attribute, number in cells if "e-" in number and 'class="number"' not in attribute]
    assert of_ports


def test_page_follows_the_colours_of_the_reader(html):
    assert "color-scheme:light dark" in html and "@media(prefers-color-scheme:dark)" in html
    outside = html.partition("</style>")[2]
    assert not re.search(r"#[0-9a-f]{3,6}\b", outside)  # colours are named in the style only
    named = set(re.findall(r"var\((--\w+)\)", html))
    light, dark = re.findall(r":root\{([^}]*)\}", html)
    assert all(f"{name}:" in light and f"{name}:" in dark for name in named)


def test_picture_shows_the_signals_of_its_file_within_its_frame(folder, html):
    drawing = ElementTree.fromstring(re.search(r"<svg.*?</svg>", html, re.DOTALL).group())
    width, height = map(float, drawing.attrib["viewBox"].split()[2:])
    names = [port.name for panel in picture.signals_by_panel(load_component(folder)) for port in panel]
    assert [t.text for t in drawing.iter("text") if t.get("class", "").startswith("c")] == names
    lines = [line.attrib["points"].split() for line in drawing.iter("polyline")]
    assert len(lines) == len(names) and min(map(len, lines)) > 50
    for x, y in (map(float, point.split(",")) for line in lines for point in line):
        assert 0.0 <= x <= width and 0.0 <= y <= height
    assert drawing.attrib["aria-label"] and "A typical run" in html


def test_file_of_the_picture_has_its_signals_with_units(folder):
    comment, header, *rows = (folder / picture.FILE).read_text("utf-8").splitlines()
    ports = [port for panel in picture.signals_by_panel(load_component(folder)) for port in panel]
    assert comment.startswith("# A typical run: `")
    assert header.split(",") == ["time [s]", *(f"{port.name} [{port.unit}]" for port in ports)]
    times = [float(row[0]) for row in csv.reader(rows)]
    assert times == sorted(set(times)) and len(times) > 50


def test_component_without_that_file_has_no_picture(tmp_path):
    copy = shutil.copytree(ROOT / "fmus" / "sensor", tmp_path / "sensor")
    (copy / picture.FILE).unlink()
    assert picture.figure(load_component(copy), copy) == ""


@pytest.mark.parametrize(
    ("low", "high", "found"),
    [
        (0.0, 30.0, [0, 10, 20, 30]),
        (-1.2, 0.6, [-1, -0.5, 0, 0.5]),
        (75.7, 76.4, [75.8, 76, 76.2, 76.4]),
        (-3e-9, -1e-9, [-3e-9, -2e-9, -1e-9]),
    ],
)
def test_marks_are_round_numbers_within_the_range(low, high, found):
    marks = picture.marks(low, high, 4)
    assert marks == pytest.approx(found)


def test_page_says_what_becomes_of_inputs_that_cannot_be_right(folder, html):
    component = load_component(folder)
    words = "counts as lost" if component.survives else "is refused"
    after_inputs = html.partition(">Inputs</h2>")[2].partition(">Outputs</h2>")[0]
    assert words in after_inputs.rpartition("</table>")[2]
