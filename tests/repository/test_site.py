"""The site is built without a warning, has every page, and takes nothing from elsewhere."""

from __future__ import annotations

import functools
import http.server
import os
import re
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from sources import ROOT

pytestmark = pytest.mark.slow
INSIDE = ("file:", "data:", "blob:")  # addresses that need no network; a live page starts its worker from a blob


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


@pytest.mark.parametrize("name", ["index", "report", "components/Ekf", "gallery", "api", "examples/which_estimator"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_page_opens_in_a_browser_without_errors_and_without_a_network(site, browser, name, scheme):
    page, fetched, complaints = browser.new_page(viewport={"width": 390, "height": 844}, color_scheme=scheme), [], []
    page.on("request", lambda request: fetched.append(request.url))
    page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto((site / f"{name}.html").as_uri())
    page.wait_for_timeout(500)
    assert complaints == [] and all(url.startswith(INSIDE) for url in fetched)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= 390


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (390, 844)])
def test_first_command_is_on_the_first_screen(site, browser, width, height):
    page = browser.new_page(viewport={"width": width, "height": height})
    page.goto((site / "index.html").as_uri())
    box = page.locator("pre").first.bounding_box()
    assert "gapsense new" in page.locator("pre").first.text_content() and box["y"] + box["height"] < height


@pytest.mark.parametrize(("words", "page_of"), [("semicolon", "identification"), ("which estimator", "estimators")])
def test_search_finds(site, browser, words, page_of):
    handler = functools.partial(QuietHandler, directory=str(site))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(f"http://127.0.0.1:{server.server_address[1]}/index.html")
        page.locator("[data-md-component=search-query]").first.fill(words)
        links = page.locator(".md-search-result__link")
        links.first.wait_for(timeout=20_000)
        found = [link.get_attribute("href") for link in links.all()[:5]]
        server.shutdown()
    assert any(page_of in link for link in found), found


def test_gallery_has_a_picture_for_every_scenario_and_tells_its_command(site):
    text = (site / "gallery.html").read_text(encoding="utf-8")
    for folder in (path.parent for path in (ROOT / "scenarios").glob("*/scenario.toml")):
        assert f"gapsense figure {folder.name}<" in text and (site / "gallery" / f"{folder.name}.png").is_file()
    assert len(re.findall(r"gapsense study ", text)) >= 9 and len([*(site / "gallery" / "studies").iterdir()]) >= 9


@pytest.mark.parametrize("name", ["index", "run-to-run", "page", "components/Semera"])
def test_scenario_runs_in_a_page_of_the_site(site, browser, name):
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto((site / f"{name}.html").as_uri())
    page.locator("iframe.live").scroll_into_view_if_needed()
    page.frame_locator("iframe.live").locator("html[data-runs]").wait_for(state="attached", timeout=60_000)
    place = page.locator("iframe.live").get_attribute("src")
    assert (site / name).parent.joinpath(place).resolve().stat().st_size < 400_000


def test_examples_can_be_downloaded(site):
    for script in (ROOT / "docs" / "examples").glob("*.py"):
        text = (site / "examples" / f"{script.stem}.html").read_text(encoding="utf-8")
        assert f'href="{script.stem}.ipynb"' in text and f'href="{script.stem}.py"' in text and "<img" in text
        assert (site / "examples" / f"{script.stem}.ipynb").is_file() and (site / "examples" / script.name).is_file()


class QuietHandler(http.server.SimpleHTTPRequestHandler):
    """Offers the site, and says nothing of it."""

    def log_message(self, *_: object) -> None:
        """Nothing."""
