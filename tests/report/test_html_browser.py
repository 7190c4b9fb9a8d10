"""A report in a browser: it draws, its plots move together, curves can be switched, it prints, it fetches nothing."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from html_many import made_campaign, made_sweep
from html_results import made
from pypdfium2 import PdfDocument

from gapsense.report import distributions
from gapsense.report.html.page import write_report

BAND = " \N{PLUS-MINUS SIGN}2\N{GREEK SMALL LETTER SIGMA}"
BAND_ON_PAPER, CURRENT, MODE = (214, 232, 242), (213, 94, 0), (145, 98, 0)  # colours of the first report's curves
VIEWS = "[...Bokeh.index.roots].filter((v) => v.model.x_range)"
RANGES = f"() => {VIEWS}.map((v) => [v.model.x_range.start, v.model.x_range.end])"
INKED = """(canvas) => {  // pixels of a canvas that have something on them, by colour
  const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  const found = {};
  for (let k = 0; k < data.length; k += 4)
    if (data[k + 3] > 200) {
      const colour = data.slice(k, k + 3).join();
      found[colour] = (found[colour] || 0) + 1;
    }
  return found;
}"""
ALL_INKED = f"() => [...document.querySelectorAll('.paper')].map({INKED})"

pytestmark = pytest.mark.slow  # a browser is started


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    return write_report([made().save(folder / "made.csv")], folder / "made.html")


class Opened:
    """A page, what it fetched, and what the browser complained about."""

    def __init__(
        self, browser: Any, file: Path, scheme: str = "light", width: int = 1200, is_touched: bool = False
    ) -> None:
        touch = {"has_touch": is_touched, "is_mobile": is_touched}
        self.page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme, **touch)
        self.fetched: list[str] = []
        self.complaints: list[str] = []
        self.page.on("request", lambda request: self.fetched.append(request.url))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", lambda m: self.complaints.append(m.text) if m.type in ("error", "warning") else None)
        self.page.goto(file.as_uri())
        self.page.wait_for_selector("html[data-drawn]", timeout=60_000)
        self.settle()

    def settle(self) -> None:
        """Wait until all that is to be drawn is drawn."""
        self.page.evaluate("() => new Promise((done) => setTimeout(() => requestAnimationFrame(done), 150))")

    def ranges(self) -> list[list[float]]:
        return self.page.evaluate(RANGES)


@pytest.fixture(scope="module")
def one(browser: Any, file: Path) -> Iterator[Opened]:
    found = Opened(browser, file)
    yield found
    found.page.close()


@pytest.fixture
def opened(one: Opened) -> Iterator[Opened]:
    one.page.locator("[data-move=reset]").click()
    yield one
    assert not one.complaints and len(one.fetched) == 1  # whatever the test did


def test_page_loads_without_errors_and_fetches_nothing_but_itself(opened, file):
    assert opened.fetched == [file.as_uri()] and opened.complaints == []
    assert opened.page.evaluate(f"() => {VIEWS}.length") == opened.page.locator(".plot").count() == 5
    assert opened.page.title() == "Made by hand - Gapsense"


def test_policy_of_the_page_stops_other_scripts(browser, file, tmp_path):
    other = tmp_path / "other.html"
    text = file.read_text(encoding="utf-8").replace("<main>", "<main><script>window.evil = 1</script>")
    other.write_text(text, encoding="utf-8")
    found = Opened(browser, other)
    assert found.page.evaluate("() => window.evil === undefined")
    assert any("Content Security Policy" in text for text in found.complaints)
    found.page.close()


def test_every_plot_has_ink_in_the_colours_of_its_legend(opened):
    opened.page.evaluate("() => dispatchEvent(new Event('beforeprint'))")
    colours = opened.page.evaluate(ALL_INKED)
    assert len(colours) == 5 and all(sum(found.values()) > 500 for found in colours)
    assert colours[0].get("0,114,178", 0) > 100  # the estimate, in the first colour
    assert colours[0].get("27,31,36", 0) > 30  # texts, and the truth where it is seen behind the estimate
    opened.page.evaluate("() => dispatchEvent(new Event('afterprint'))")
    assert opened.page.locator(".paper").count() == 0


def test_buttons_move_all_plots_together_and_stay_inside_the_record(opened):
    press = {name: opened.page.locator(f"[data-move={name}]").click for name in ("in", "out", "left", "right", "reset")}
    whole = [0.0, 40.0]
    assert opened.ranges() == [whole] * 5
    press["in"]()
    assert opened.ranges() == [[10.0, 30.0]] * 5
    press["right"]()
    assert opened.ranges() == [[20.0, 40.0]] * 5
    press["right"]()
    assert opened.ranges() == [[20.0, 40.0]] * 5
    press["in"](), press["left"](), press["left"]()
    assert opened.ranges() == [[15.0, 25.0]] * 5
    press["out"](), press["out"](), press["out"]()
    assert opened.ranges() == [whole] * 5
    press["in"](), press["reset"]()
    assert opened.ranges() == [whole] * 5


def test_dragging_in_one_plot_zooms_all(opened):
    opened.page.locator(".plot").nth(1).scroll_into_view_if_needed()
    box = opened.page.locator(".plot").nth(1).bounding_box()
    y = box["y"] + box["height"] / 2
    opened.page.mouse.move(box["x"] + 300, y)
    opened.page.mouse.down()
    opened.page.mouse.move(box["x"] + 600, y, steps=5)
    opened.page.mouse.up()
    opened.settle()
    ranges = opened.ranges()
    assert len({tuple(r) for r in ranges}) == 1 and 0.0 < ranges[0][0] < ranges[0][1] < 40.0


def test_curve_can_be_switched_off_and_on_with_its_band(opened):
    chip = opened.page.locator("button.chip", has_text=f"filter.position{BAND}").first
    visible = "(key) => [...Bokeh.documents[0].all_models].filter((m) => m.name === key).map((m) => m.visible)"
    key = chip.get_attribute("data-curve")
    assert opened.page.evaluate(visible, key) == [True, True]  # the line and its band
    chip.click()
    assert chip.get_attribute("aria-pressed") == "false" and opened.page.evaluate(visible, key) == [False, False]
    opened.settle()
    chip.focus()
    opened.page.keyboard.press("Enter")
    assert chip.get_attribute("aria-pressed") == "true" and opened.page.evaluate(visible, key) == [True, True]


def test_values_at_the_cursor_are_those_of_the_record(opened):
    """A cursor on the time of a row, in all legends of the result."""
    result = made()
    view = opened.page.evaluate_handle(f"() => {VIEWS}[0]")
    x, y = view.evaluate(
        "(v) => [v.frame.x_scale.compute(12.35) + v.el.getBoundingClientRect().x, v.el.getBoundingClientRect().y + 60]"
    )
    opened.page.mouse.move(x, y)
    at = 10.0 * view.evaluate("(v, x) => v.frame.x_scale.invert(Math.round(x - v.el.getBoundingClientRect().x))", x)
    opened.settle()
    for name in ("plant.position", "filter.position", "plant.current"):
        chip = opened.page.locator("button.chip", has_text=name).first
        factor = 1e3 if "position" in name else 1.0
        assert float(chip.locator("output").inner_text()) == pytest.approx(factor * result[name][int(at)], rel=2e-4)


def test_dark_ground_has_light_ink_and_the_other_way_round(browser, file):
    ink = "() => [...Bokeh.documents[0].all_models].find((m) => m.type === 'LinearAxis').major_label_text_color"
    ground = "() => getComputedStyle(document.body).backgroundColor"
    found = {}
    for scheme in ("light", "dark"):
        opened = Opened(browser, file, scheme)
        assert opened.complaints == []
        found[scheme] = opened.page.evaluate(ink), opened.page.evaluate(ground)
        other = {"light": "dark", "dark": "light"}[scheme]
        opened.page.emulate_media(color_scheme=other)  # changed while it is open
        opened.settle()
        found[f"{scheme}, then {other}"] = opened.page.evaluate(ink), opened.page.evaluate(ground)
        opened.page.close()
    assert found["light"] == found["dark, then light"] == ("#1b1f24", "rgb(255, 255, 255)")
    assert found["dark"] == found["light, then dark"] == ("#e8ebef", "rgb(21, 25, 30)")


@pytest.mark.parametrize("width", [400, 800, 1600])
def test_page_is_as_wide_as_the_window(browser, file, width):
    opened = Opened(browser, file, width=width)
    assert opened.page.evaluate("() => document.documentElement.scrollWidth") == width
    widths = [box["width"] for box in (p.bounding_box() for p in opened.page.locator(".plot").all())]
    assert (len(set(widths)) == 1 and 0.85 * width < widths[0] <= width) or (width == 1600 and widths[0] > 1300)
    opened.page.close()


def test_finger_scrolls_the_page_and_zooms_by_the_buttons(browser, file):
    action = "(e) => getComputedStyle(e.shadowRoot.querySelector('.bk-events')).touchAction"
    plots = f"() => {VIEWS}[0].canvas.el"
    for is_touched, expected in ((False, "pinch-zoom"), (True, "auto")):
        opened = Opened(browser, file, width=400, is_touched=is_touched)
        assert opened.page.evaluate_handle(plots).evaluate(action) == expected
        opened.page.locator("[data-move=in]").click()
        assert opened.ranges() == [[10.0, 30.0]] * 5 and opened.complaints == []
        opened.page.close()


def test_print_has_everything_in_light_colours_also_from_a_dark_screen(browser, file, tmp_path):
    opened = Opened(browser, file, "dark")
    opened.page.evaluate("() => dispatchEvent(new Event('beforeprint'))")
    assert opened.page.locator("details:not([open])").count() == 0
    for colours in opened.page.evaluate(ALL_INKED):
        assert sum(colours.values()) > 500
        assert "232,235,239" not in colours  # light ink
    opened.page.emulate_media(media="print")
    assert not opened.page.locator(".controls").first.is_visible()
    assert opened.page.locator(".paper").first.is_visible()
    opened.page.emulate_media(media="null")
    opened.page.evaluate("() => dispatchEvent(new Event('afterprint'))")
    assert opened.page.locator("details[open]").count() == 0
    opened.page.pdf(path=tmp_path / "report.pdf", format="A4")
    assert opened.complaints == []
    opened.page.close()
    paper = np.concatenate([page.render(scale=2).to_numpy() for page in PdfDocument(tmp_path / "report.pdf")])
    paper = paper.astype(int)[:, :, ::-1]
    for ink, least in ((BAND_ON_PAPER, 100_000), (CURRENT, 300), (MODE, 2_000)):  # as pictures or as vectors
        assert np.sum(np.all(np.abs(paper - np.array(ink)) < 12, axis=2)) > least, ink
    assert np.mean(np.all(paper > 200, axis=2)) > 0.95


def test_contrast_of_texts_is_enough_on_both_grounds(browser, file):
    """4.5 to 1, as WCAG 2.2 asks for."""
    colours = """() => ['verdict', 'chip', 'controls', 'facts'].flatMap((c) => [...document.querySelectorAll('.' + c)])
      .concat([...document.querySelectorAll('small, thead th, summary, strong, dt, a')])
      .map((e) => getComputedStyle(e).color)"""
    for scheme, ground in (("light", (246, 248, 250)), ("dark", (30, 36, 43))):  # the raised one, the worse
        opened = Opened(browser, file, scheme)
        found = {tuple(int(v) for v in text[4:-1].split(",")) for text in opened.page.evaluate(colours)}
        assert len(found) >= 4
        assert min(contrast(colour, ground) for colour in found) >= 4.5, (scheme, found)
        opened.page.close()


def contrast(a: tuple[int, ...], b: tuple[int, ...]) -> float:
    """Ratio of the relative luminances."""

    def luminance(colour: tuple[int, ...]) -> float:
        s = np.array(colour) / 255.0
        return float(np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722])

    low, high = sorted((luminance(a), luminance(b)))
    return (high + 0.05) / (low + 0.05)


# Many runs ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report on a sweep whose runs are points, and on a campaign whose runs are counted."""
    folder = tmp_path_factory.mktemp("many")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(distributions, "POINTS", 100)
        patch.setattr("gapsense.many.summary.MOST_LEVELS", 5)  # the resistance has 7
        return write_report([made_sweep(folder / "swept"), made_campaign(folder / "ran", 150)], folder / "many.html")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_plots_of_many_runs_are_drawn_and_printed_without_complaint(browser, many, scheme):
    opened = Opened(browser, many, scheme)
    assert opened.complaints == [] and opened.fetched == [many.as_uri()]
    assert opened.page.locator(".plot").count() == 2 * 2 * 5 == opened.page.evaluate(f"() => {VIEWS}.length")
    opened.page.evaluate("() => dispatchEvent(new Event('beforeprint'))")
    colours = opened.page.evaluate(ALL_INKED)
    assert len(colours) == 20 and all(sum(found.values()) > 300 for found in colours)
    assert all("232,235,239" not in found for found in colours)  # light ink, on paper
    opened.page.evaluate("() => dispatchEvent(new Event('afterprint'))")
    assert opened.complaints == []
    opened.page.close()


RUNS = "[...Bokeh.documents[0].all_models].filter((m) => m.type === 'ColumnDataSource' && m.data.run)"
USERS = f"() => {VIEWS}.filter((v) => v.model.renderers.some((r) => {RUNS}.includes(r.data_source))).length"
BOX = "toolbar.tools.find((t) => t.type === 'BoxSelectTool')"
PLACE = "(v) => (({x, y, width, height}) => [x, y, width, height])(v.el.getBoundingClientRect())"


def test_runs_that_are_chosen_in_one_plot_are_marked_in_all(browser, many):
    opened = Opened(browser, many)
    chosen = f"() => {RUNS}.map((m) => m.selected.indices.length)"
    assert opened.page.evaluate(chosen) == [0]  # one for all plots of the sweep; none of what is counted
    assert opened.page.evaluate(USERS) == 2
    view = opened.page.evaluate_handle(f"() => {VIEWS}.find((v) => v.model.{BOX})")
    view.evaluate(f"(v) => {{ v.model.{BOX}.active = true; v.el.scrollIntoView({{block: 'center'}}); }}")
    opened.settle()
    x, y, width, height = view.evaluate(PLACE)
    opened.page.mouse.move(x + 0.55 * width, y + 40)
    opened.page.mouse.down()
    opened.page.mouse.move(x + 0.95 * width, y + height - 60, steps=5)
    opened.page.mouse.up()
    opened.settle()
    (count,) = opened.page.evaluate(chosen)
    assert 0 < count < 29 and opened.complaints == []
    opened.page.close()


@pytest.mark.parametrize("width", [400, 800, 1600])
def test_plots_of_many_runs_fit_any_window(browser, many, width):
    opened = Opened(browser, many, width=width)
    assert opened.page.evaluate("() => document.documentElement.scrollWidth") == width
    boxes = [plot.bounding_box() for plot in opened.page.locator(".plot").all()]
    assert all(box["width"] >= 300 and box["x"] >= 0.0 and box["x"] + box["width"] <= width for box in boxes)
    opened.page.close()


def test_time_at_the_cursor_stands_in_the_controls_and_every_plot_has_its_axis(opened):
    page, plot = opened.page, opened.page.locator(".stack .plot").nth(1)
    labels = page.evaluate(f"() => {VIEWS}.map((v) => v.model.below[0].axis_label)")
    assert len(labels) > 3 and all(label.startswith("time / ") for label in labels)
    box = plot.bounding_box()
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 60)
    opened.settle()
    text = page.locator("[data-at]").first.text_content()
    (start, end), unit = opened.ranges()[1], labels[1].removeprefix("time / ")
    assert text.endswith(f" {unit}") and start < float(text.split()[1]) < end
    page.mouse.move(2, 2)
    opened.settle()
    assert page.locator("[data-at]").first.text_content() == ""
