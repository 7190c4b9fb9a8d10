"""What the site has beside the pages in this folder: CONTRIBUTING, components, gallery, live scenarios, examples."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

sys.path.insert(0, str(Path(__file__).parent))

import cells
import gallery
import live
from kept import ROOT

from gapsense.fmi.components import find_components, load_component
from gapsense.fmi.page import html
from gapsense.page.module import refuse_without_zig
from gapsense.version import __version__

ELSEWHERE = re.compile(r"\[([^\]]+)\]\(\.\./([^)]+)\)")  # a link to a file of the repository that the site has not
OF_COMPONENT = re.compile(r"\]\((?:\.\./)?fmus/(\w+)/page\.md\)")
HEADING = re.compile(r'<h2 id="[^"]*">(.*?)</h2>\n?')
CONTENTS = re.compile(r"<nav.*?</nav>\n?", re.DOTALL)
EVERY, EXAMPLES = "components/*.md", "examples/*.md"  # stand for the pages of all components, of all examples
PICTURES = "<!-- pictures: made by docs/gallery.py -->"
CLASSES = "<!-- classes: made by docs/site.py -->"
CLASS = "::: gapsense.components.{}\n    options:\n      members: false\n"


def components() -> dict[str, str]:
    """Page of each component, as Markdown, by its place in the site."""
    folders = {load_component(folder).name: folder for folder in find_components(ROOT / "fmus")}
    return {f"components/{name}.md": page(folders[name]) for name in sorted(folders)}


def page(folder: Path) -> str:
    """The page that is in the FMU too, its headings as those of the site, so that they are in its contents."""
    component = load_component(folder)
    whole = html(component, (folder / "page.md").read_text(encoding="utf-8"), __version__)
    body = CONTENTS.sub("", whole.partition("</h1>")[2].partition("</body>")[0])
    first, *parts = HEADING.split(body)
    chapters = (f"## {title}\n\n<div>{text}</div>\n" for title, text in zip(parts[::2], parts[1::2]))
    return "\n".join([f"# {component.name}\n\n<div>{first}</div>\n", *chapters, live.chapter(component.name)])


def scripts() -> dict[str, Path]:
    """Examples by the place of their page, in the order of the page on them."""
    listed = re.findall(r"\(examples/(\w+)\.py\)", (ROOT / "docs" / "examples.md").read_text(encoding="utf-8"))
    return {f"examples/{name}.md": ROOT / "docs" / "examples" / f"{name}.py" for name in listed}


def on_config(config: Any) -> Any:
    """Put the pages of all components and examples where the navigation has a place for them."""
    places = {EVERY: [*components()], EXAMPLES: [*scripts()]}
    for part in config["nav"]:
        for title, pages in part.items() if isinstance(part, dict) else ():
            if isinstance(pages, list):
                part[title] = [made for name in pages for made in places.get(name, [name])]
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that are made of files elsewhere, the pictures of the gallery, and the examples with theirs."""
    refuse_without_zig()  # at once, and not after the minutes that all the rest takes
    own = {"contributing.md": in_site(ROOT / "CONTRIBUTING.md"), **components()}
    for name, text in own.items():
        files.append(File.generated(config, name, content=text))
    for entry in gallery.entries():
        picture = gallery.made(entry).read_bytes()
        files.append(File.generated(config, entry.place, content=picture))
    for name in live.names():
        files.append(File.generated(config, live.place(name), content=live.made(name)))
    for place, script in scripts().items():
        done = cells.shown(script)
        files.append(File.generated(config, place, content=cells.page(script.stem, done)))
        files.append(
            File.generated(config, f"examples/{script.stem}.ipynb", content=cells.notebook([cell for cell, _ in done]))
        )
        for k, (_, ran) in enumerate(done):
            if ran.picture:
                files.append(File.generated(config, f"examples/{script.stem}_{k}.png", content=ran.picture))
    return files


def in_site(file: Path) -> str:
    """A page of the repository's root, with its links as they are in the site."""
    return file.read_text(encoding="utf-8").replace("](docs/", "](").replace("](CONTRIBUTING.md", "](contributing.md")


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Link to pages of components and examples; name the other files of the repository, which the site has not."""
    markdown = OF_COMPONENT.sub(
        lambda found: f"](components/{load_component(ROOT / 'fmus' / found[1]).name}.md)", markdown
    )
    markdown = re.sub(r"\]\(examples/(\w+)\.py\)", r"](examples/\1.md)", markdown)
    markdown = markdown.replace(PICTURES, gallery.page(gallery.entries()) if PICTURES in markdown else "")
    markdown = live.framed(markdown, "../" * page.url.count("/"))
    names = [load_component(folder).name for folder in find_components(ROOT / "fmus")]
    markdown = markdown.replace(CLASSES, "\n".join(map(CLASS.format, sorted(names))))
    return ELSEWHERE.sub(lambda link: link[0] if is_in_site(link[2]) else f"{link[1]} (`{link[2]}`)", markdown)


def is_in_site(target: str) -> bool:
    """True for a page in the folder above, to which an example links."""
    return (ROOT / "docs" / target).is_file()
