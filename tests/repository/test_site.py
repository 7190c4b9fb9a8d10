"""The site is built without a warning, has every page, and takes nothing from elsewhere."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from sources import ROOT

pytestmark = pytest.mark.slow
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("mkdocs")
    out = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(out)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT / "src"), "NO_MKDOCS_2_WARNING": "1"},
    )
    assert done.returncode == 0, done.stderr
    return out


def test_every_page_is_in_the_site_and_in_its_navigation(site):
    front = (site / "index.html").read_text(encoding="utf-8")
    pages = [page.stem for page in (ROOT / "docs").glob("*.md")]
    components = [f"components/{page.stem}" for page in (site / "components").glob("*.html")]
    assert len(pages) > 20 and len(components) == len(list((ROOT / "fmus").glob("*/page.md")))
    for name in [*pages, *components]:
        assert (site / f"{name}.html").is_file() and f'href="{name}.html"' in front, name


def test_pages_load_nothing_from_elsewhere(site):
    wrong = []
    for page in site.rglob("*.html"):
        tags = re.findall(r"<(?:script|link|img|iframe|source)\b[^>]*>", page.read_text(encoding="utf-8"))
        wrong += [(page.name, tag) for tag in tags if re.search(r"(?:src|href)=\"?(?:https?:)?//", tag)]
    assert wrong == []


def test_lists_and_tables_of_the_pages_are_lists_and_tables(site):
    """Markdown of this site wants an empty line before them, others do not."""
    for page in site.rglob("*.html"):
        text = re.sub(r"<pre.*?</pre>", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        assert not re.search(r"<p>(?:[^<]|<(?!/p>))*?\n(?:- |\d\. |\| )", text), page.name


@pytest.mark.skipif(BROWSER is None, reason="no Chromium to open a page in")
@pytest.mark.parametrize("name", ["index", "report", "components/Ekf"])
def test_page_opens_in_a_browser_without_errors_and_without_a_network(site, name):
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        page, fetched, complaints = browser.new_page(viewport={"width": 420, "height": 900}), [], []
        page.on("request", lambda request: fetched.append(request.url))
        page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto((site / f"{name}.html").as_uri())
        page.wait_for_timeout(500)
        assert complaints == [] and all(url.startswith(("file:", "data:")) for url in fetched)
        assert page.evaluate("() => document.documentElement.scrollWidth") <= 420
        browser.close()
