"""Take the pictures of the page on reports: `python tests/report/make_picture.py RESULT docs/report.png`.

RESULT is the CSV file of the scenario `pot_magnet`, variant `off`; or, for docs/report_many.png, the folder of the
campaign scenarios/semera_valve/tolerances.toml.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from playwright.sync_api import sync_playwright

from gapsense.report.html.page import write_report

SHOWN = ("position", "error of the position", "innovation", "modes")
OF_ONE = """(shown) => {
  for (const part of document.querySelectorAll('section'))
    if (!/wiring|signals/.test(part.getAttribute('aria-labelledby'))) part.remove();
  for (const panel of document.querySelectorAll('.panel'))
    if (!shown.some((text) => panel.innerText.startsWith(text))) panel.remove();
  for (const row of document.querySelectorAll('tr'))
    if (/velocity/.test(row.innerText)) row.remove();
  const view = [...Bokeh.index.roots].find((v) => v.model.x_range);
  view.model.x_range.setv({ start: 512, end: 530 });
}"""
OF_MANY = """() => {
  for (const part of document.querySelectorAll('section'))
    if (!/plots/.test(part.getAttribute('aria-labelledby'))) part.remove();
  const heads = [...document.querySelectorAll('h4')];
  for (const head of heads.slice(1)) { head.nextElementSibling.remove(); head.remove(); }
}"""


def main(result: str, picture: str) -> None:
    """Write the picture: the head of a report, and some of its plots; of a run when the magnet moves."""
    is_many = Path(result).is_dir()
    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        file = write_report([result], Path(folder, "report.html"))
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1000, "height": 500 if is_many else 800})
        page.set_default_timeout(300_000)  # ms
        page.goto(file.as_uri())
        page.wait_for_selector("html[data-drawn]")
        page.evaluate(OF_MANY if is_many else OF_ONE, SHOWN)
        page.wait_for_timeout(500)
        page.screenshot(path=picture, full_page=True)
        browser.close()


if __name__ == "__main__":
    main(*sys.argv[1:3])
