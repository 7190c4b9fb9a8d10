"""Pages in Chromium without a network: the bits of native FMUs, what is fetched and complained about, and their use."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import nine
import numpy as np
import pytest
from opened import METRICS, PATIENCE, Opened
from scenarios_of_ours import EVERY, read

from gapsense.cosim import changed, run
from gapsense.cosim.scenario.records import ITERATIVE
from gapsense.page.page import write_page

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("zig")]
ROOT = Path(__file__).resolve().parents[2]
FILES = sorted(f for f in ROOT.glob("scenarios/*/scenario.toml") if f.parent.name != "firmware")  # which is run_to_run
FIRST = [  # a page iterates no loops
    next((f.parent, v) for g, v in EVERY if g == f and read(f, v).experiment.method != ITERATIVE) for f in FILES
]
WITH_EVENTS = [  # variants that have events
    (file.parent, name)
    for file, name in EVERY
    if name and file in FILES and any(event.enabled for event in read(file, name).events.values())
]
LARGEST = 400_000  # bytes of a page
STOPWATCH = """
  window.times = { parts: 0 };
  window.Worker = class extends Worker {
    constructor(...of) {
      super(...of);
      this.addEventListener("message", ({ data }) => {  // before the page shows it
        times.parts += Boolean(data.isPart);
        const look = () => requestAnimationFrame(() => setTimeout(() => {  // when it is painted
          if (!document.querySelector("#plots canvas")) return look();
          times.drawn ??= performance.now();
          if (!data.isPart) times.whole ??= performance.now();
        }));
        look();
      });
    }
  };
"""


@pytest.fixture(scope="module")
def valve(tmp_path_factory: pytest.TempPathFactory, fmus: Path) -> Path:
    pytest.importorskip("bokeh")
    return write_page(ROOT / "scenarios" / "semera_valve", tmp_path_factory.mktemp("page") / "valve.html", fmus=fmus)


@pytest.fixture
def one(browser: Any, valve: Path) -> Iterator[Opened]:
    found = Opened(browser, valve)
    yield found
    found.close()


def assert_equal(opened: Opened, result: Any) -> None:
    """All recorded signals have the same bits."""
    signals = opened.signals()
    assert list(signals) == list(result.signals)
    wrong = [n for n, x in signals.items() if x.tobytes() != np.ascontiguousarray(result.signals[n]).tobytes()]
    assert wrong == []


@pytest.mark.parametrize(("folder", "variant"), FIRST, ids=lambda x: getattr(x, "name", x))
def test_page_has_the_bits_of_native_fmus_its_file_and_its_metrics(browser, tmp_path, fmus, natives, folder, variant):
    pytest.importorskip("bokeh")
    file = write_page(folder, tmp_path / f"{folder.name}.html", variant, fmus)
    result = run(folder, variant, fmus=natives)
    opened = Opened(browser, file)
    assert_equal(opened, result)
    with opened.page.expect_download() as download:
        opened.page.click("#csv")
    assert Path(download.value.path()).read_bytes() == result.save(tmp_path / "result.csv").read_bytes()
    measured = [math.nan if value is None else value for value in opened.page.evaluate(METRICS)]
    expected = [m.value for m in result.metrics.values()]
    np.testing.assert_allclose(measured, expected, rtol=1e-9, atol=1e-18)
    assert opened.page.locator("tr.bad").count() == sum(not m.passed for m in result.metrics.values())
    milliseconds = opened.again(5)
    print(f"{folder.name}: {file.stat().st_size} bytes, {min(milliseconds):.1f} ms; native {1e3 * result.wall:.1f} ms")
    assert opened.page.evaluate("gapsense.run.events") == spans(result)
    assert opened.complaints == [] and opened.problem() == ""
    assert all(url.startswith(("file:", "blob:", "data:")) for url in opened.fetched)
    assert file.stat().st_size < LARGEST
    opened.close()


@pytest.mark.parametrize(("folder", "variant"), WITH_EVENTS, ids=lambda x: getattr(x, "name", x))
def test_events_of_variants_have_the_bits_of_native_fmus(browser, tmp_path, fmus, natives, folder, variant):
    pytest.importorskip("bokeh")
    result = run(folder, variant, fmus=natives)
    opened = Opened(browser, write_page(folder, tmp_path / "x.html", variant, fmus))
    assert_equal(opened, result)
    assert opened.page.evaluate("gapsense.run.events") == spans(result) != []
    assert opened.page.locator("caption", has_text="Events, shaded in the plots").count() == 1
    assert opened.complaints == [] and opened.problem() == ""
    opened.close()


def test_events_meet_the_values_of_sliders(browser, tmp_path, fmus):
    event = '[events.hot]\ntarget = "valve.coil.resistance"\naction = "scale"\nvalue = 1.2\nover = 5e-3\nat = 9.95e-3\n'
    opened = Opened(browser, write_page(with_text(tmp_path, event), tmp_path / "x.html", None, fmus))
    opened.change(lambda: opened.type("valve.coil.resistance", "60"))
    assert_equal(opened, run(changed(tmp_path, ["valve.coil.resistance=60"]), fmus=fmus))
    opened.close()


def test_failure_that_an_event_causes_names_it(browser, tmp_path, fmus):
    less = '[events.less]\ntarget = "valve.coil.resistance"\naction = "bias"\nvalue = -40.0\nat = 9.95e-3\n'
    lost = '[events.lost]\ntarget = "valve.voltage"\naction = "dropout"\n'
    lost += 'when = { signal = "drive.voltage", above = 40.0 }\n'
    opened = Opened(browser, write_page(with_text(tmp_path, less + lost), tmp_path / "x.html", None, fmus))
    opened.type("valve.coil.resistance", "30")
    opened.page.wait_for_selector("#problem:not([hidden])")
    assert re.search(r"`coil.resistance`.*; event `less` sets `valve.coil.resistance` to -10\.$", opened.problem())
    opened.change(lambda: opened.type("valve.coil.resistance", "70"))
    opened.type("drive.square.amplitude", "50")
    opened.page.wait_for_selector("#problem:not([hidden])")
    assert "Event `lost` gives it NaN. If it does not accept NaN, use `stuck`." in opened.problem()
    assert opened.complaints == []
    opened.close()


def test_first_run_is_shown_while_it_goes_on(browser, tmp_path, fmus):
    file = write_page(ROOT / "scenarios" / "run_to_run_day", tmp_path / "day.html", fmus=fmus)
    first = viewed(browser, file)
    print(f"run_to_run_day: first curves after {first['drawn']:.0f} ms, all after {first['whole']:.0f} ms")
    assert first["parts"] > 0 and first["drawn"] < first["whole"]


def test_first_view_takes_less_than_a_second(browser, valve):
    first = min((viewed(browser, valve) for _ in range(8)), key=lambda times: times["drawn"])
    print(f"semera_valve: first curves after {first['drawn']:.0f} ms")
    assert first["drawn"] < 1000.0


def viewed(browser: Any, file: Path) -> dict[str, float]:
    """Milliseconds from the call of a page until its first curves and its whole run are painted; parts before that."""
    context = browser.new_context(offline=True)
    page = context.new_page()
    page.set_default_timeout(PATIENCE)
    page.add_init_script(STOPWATCH)
    page.goto(file.as_uri())
    page.wait_for_function("() => times.drawn && times.whole")
    found: dict[str, float] = page.evaluate("times")
    context.close()
    return found


def with_text(folder: Path, more: str) -> Path:
    """`semera_valve` with more in its file."""
    text = (ROOT / "scenarios" / "semera_valve" / "scenario.toml").read_text(encoding="utf-8")
    text = text.replace('"parameters/', f'"{ROOT}/scenarios/semera_valve/parameters/')
    (folder / "scenario.toml").write_text(f"{text}\n{more}", encoding="utf-8")
    return folder


def spans(result: Any) -> list[list[Any]]:
    """Events of a run, in base steps."""
    run = result.run
    index = lambda time: None if time is None else round((time - run.start) / run.base_step)  # noqa: E731
    return [[span.name, index(span.begin), index(span.end)] for span in result.events]


def test_played_signals_and_variants_have_the_bits_of_a_run(browser, tmp_path, fmus):
    text = (ROOT / "scenarios" / "semera_valve" / "scenario.toml").read_text(encoding="utf-8")
    ramp = "{ times = [-1.05e-3, 0.1], values = [0.0, 30.0] }"
    text = text.replace('"drive.reference" = 0.0', f'"drive.reference" = {ramp}').replace(
        '"parameters/', f'"{ROOT}/scenarios/semera_valve/parameters/'
    )
    text += '\n[variants.played.experiment]\nmethod = "jacobi"\n\n[variants.played.components.drive.set]\n'
    (tmp_path / "scenario.toml").write_text(text + 'waveform = "bridge"\n', encoding="utf-8")
    opened = Opened(browser, write_page(tmp_path, tmp_path / "x.html", "played", fmus))
    result = run(tmp_path, "played", fmus)
    assert np.ptp(result["drive.voltage"]) > 5.0
    assert_equal(opened, result)
    opened.close()


def test_slider_changes_the_curves_and_reset_brings_them_back(one, fmus):
    before = one.signals()["valve.current"]
    slider = one.page.get_by_label("valve.coil.resistance, slider")
    one.change(lambda: slider.press("ArrowRight"))
    changed = one.signals()["valve.current"]
    assert not np.array_equal(before, changed)
    one.change(lambda: one.page.click("#reset"))
    assert np.array_equal(one.signals()["valve.current"], before) and "#" not in one.page.url


def test_typed_value_gives_the_bits_of_a_run_with_it_and_goes_into_the_link(browser, valve, one, fmus):
    one.change(lambda: one.type("valve.coil.resistance", "79,05"))
    result = run(changed(ROOT / "scenarios" / "semera_valve", ["valve.coil.resistance=79.05"]), fmus=fmus)
    assert_equal(one, result)
    link = one.page.url.partition("#")[2]
    assert link == "valve.coil.resistance=79.05"
    other = Opened(browser, valve, link=f"#{link}")
    assert_equal(other, result)
    other.close()


def test_component_refuses_nonsense_in_its_own_words_and_the_curves_stay(one):
    before = one.signals()["valve.current"]
    one.type("valve.coil.resistance", "-5")
    one.page.wait_for_selector("#problem:not([hidden])")
    assert "`coil.resistance`" in one.problem() and "-5.0" in one.problem() and "SolenoidValve" in one.problem()
    assert np.array_equal(one.signals()["valve.current"], before)
    one.type("valve.coil.resistance", "seventy")
    one.page.wait_for_function("() => document.getElementById('problem').textContent.includes('a number is expected')")
    one.change(lambda: one.type("valve.coil.resistance", "76"))
    assert one.page.locator("#problem").is_hidden() and one.complaints == []


def test_play_stops_by_itself_or_when_asked(one):
    one.page.click("#play")
    assert "Stop" in one.page.locator("#play").text_content()
    one.page.click("#play")
    one.page.wait_for_function("() => document.getElementById('play').textContent.includes('Play')")
    assert one.complaints == []


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_page_fits_its_window_and_can_be_used_by_keyboard(browser, valve, scheme, width):
    opened = Opened(browser, valve, scheme, width)
    assert opened.page.evaluate("document.documentElement.scrollWidth") <= width
    ground = opened.page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (ground == "rgb(255, 255, 255)") == (scheme == "light")
    for _ in range(40):
        opened.page.keyboard.press("Tab")
        if opened.page.evaluate("document.activeElement.type") == "range":
            break
    opened.change(lambda: opened.page.keyboard.press("ArrowLeft"))
    assert "#" in opened.page.url and opened.complaints == []
    opened.close()


def test_nine_components_take_less_than_twice_the_time_of_native_fmus(browser, tmp_path, fmus, natives):
    pytest.importorskip("bokeh")
    folder = nine.write(tmp_path)
    opened = Opened(browser, write_page(folder, tmp_path / "nine.html", fmus=fmus))
    assert_equal(opened, run(folder, fmus=natives))
    opened.again(20)  # the browser compiles what takes long better meanwhile
    both = [
        (opened.again(1)[0], 1e3 * run(folder, fmus=natives).wall) for _ in range(20)
    ]  # in turn: others work here too
    page, native = map(min, zip(*both))
    print(f"nine components: {page:.1f} ms, native {native:.1f} ms")
    assert page < 2.0 * native
    opened.close()
