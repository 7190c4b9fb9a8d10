"""What the site has beside the pages in this folder: README as front page, CONTRIBUTING, and a page per component."""

from __future__ import annotations

import re
from importlib.metadata import version
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

from gapsense.fmi.components import find_components, load_component
from gapsense.fmi.page import html

ROOT = Path(__file__).resolve().parents[1]
ELSEWHERE = re.compile(r"\[([^\]]+)\]\(\.\./([^)]+)\)")  # a link to a file of the repository that the site has not
OF_COMPONENT = re.compile(r"\]\((?:\.\./)?fmus/(\w+)/page\.md\)")
EVERY = "components/*.md"  # stands for the pages of all components


def components() -> dict[str, str]:
    """Page of each component, as Markdown, by its place in the site."""
    folders = {load_component(folder).name: folder for folder in find_components(ROOT / "fmus")}
    return {f"components/{name}.md": page(folders[name]) for name in sorted(folders)}


def page(folder: Path) -> str:
    """The page that is in the FMU too, under a heading for the table of contents."""
    component = load_component(folder)
    whole = html(component, (folder / "page.md").read_text(encoding="utf-8"), version("gapsense"))
    body = whole.partition("</h1>")[2].partition("</body>")[0]
    return f"# {component.name}\n\n<div>{body}</div>\n"


def on_config(config: Any) -> Any:
    """Put the pages of all components where the navigation has a place for them."""
    names = list(components())
    for part in config["nav"]:
        for title, pages in part.items() if isinstance(part, dict) else ():
            if isinstance(pages, list) and EVERY in pages:
                part[title] = [*(p for p in pages if p != EVERY), *names]
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that are made of files elsewhere."""
    own = {"index.md": in_site(ROOT / "README.md"), "contributing.md": in_site(ROOT / "CONTRIBUTING.md")}
    for name, text in {**own, **components()}.items():
        files.append(File.generated(config, name, content=text))
    return files


def in_site(file: Path) -> str:
    """A page of the repository's root, with its links as they are in the site."""
    return file.read_text(encoding="utf-8").replace("](docs/", "](").replace("](CONTRIBUTING.md", "](contributing.md")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Link to pages of components; name the other files of the repository, to which the site cannot link."""
    markdown = OF_COMPONENT.sub(
        lambda found: f"](components/{load_component(ROOT / 'fmus' / found[1]).name}.md)", markdown
    )
    return ELSEWHERE.sub(r"\1 (`\2`)", markdown)
