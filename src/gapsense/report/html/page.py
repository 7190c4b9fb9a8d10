"""The file: everything in it, nothing fetched, and a policy that lets the browser run nothing else."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Sequence
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from gapsense._os.files import write_atomically
from gapsense.problems import InputError
from gapsense.report.html.elements import Markup, element, joined
from gapsense.report.html.many import Many
from gapsense.report.html.subject import Shown, read_all

if TYPE_CHECKING:
    from gapsense.report.html.chapters import Chapter
    from gapsense.report.html.plots import Plots

MISSING = "Reports are drawn by bokeh, which is not installed. Install it with `pip install 'gapsense[report]'`."
POLICY = "default-src 'none'; img-src data: blob:; font-src data:; style-src 'unsafe-inline'; script-src {}"


def write_report(results: Sequence[str | Path], to: str | Path) -> Path:
    """Write one HTML file on saved results, complete or not at all.

    Parameters
    ----------
    results : sequence of str or Path
        CSV files, as `Result.save` writes them, those of sweeps, and folders of campaigns.
    to : str or Path
        The file; its folder is made if there is none.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        With what is wrong with the results, of all at once, or if bokeh is missing.
    """
    content, to = report(list(map(Path, results))), Path(to)
    to.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(to, lambda file: print(content, end="", file=file))
    return to


def report(results: Sequence[Path]) -> str:
    """The page on some results, as HTML."""
    if not results:
        raise InputError(["there is nothing to report on. Name the CSV files of some results."])
    shown = read_all(results)
    try:
        import bokeh  # noqa: F401  # which is optional
    except ImportError:
        raise InputError([MISSING]) from None
    from gapsense.report.html.chapters import summary
    from gapsense.report.html.plots import Plots, embedded

    plots = Plots()
    chapters = [chapter_of(one, plots, f"r{k}") for k, one in enumerate(shown, 1)]
    script, places = embedded(plots)
    body = joined([*summary(chapters), *(c.content for c in chapters)])
    for key, place in places.items():
        body = Markup(body.replace(f"<!--plot {key}-->", place))
    title = chapters[0].title if len(chapters) == 1 else f"{len(chapters)} results"
    return page(f"{title} - Gapsense", body, script)


def chapter_of(shown: Shown | Many, plots: Plots, key: str) -> Chapter:
    """Everything about one of the results."""
    if isinstance(shown, Many):  # which alone needs pyarrow
        from gapsense.report.html.many_chapter import chapter_of_many

        return chapter_of_many(shown, plots, key)
    from gapsense.report.html.chapters import chapter

    return chapter(shown, plots, key)


def page(title: str, body: Markup, script: str) -> str:
    """Frame of the page; `script` draws the plots."""
    from bokeh.resources import Resources

    from gapsense.report.html import style

    own = read("page.js")
    library = "\n".join(Resources(mode="inline", components=["bokeh"]).js_raw)
    scripts = [closed(text) for text in (library, script, own)]
    policy = POLICY.format(" ".join(map(digest, scripts)))
    css = style.variables() + read("page.css")
    colours = json.dumps(style.DARK)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta name="color-scheme" content="light dark">\n{element("title", title)}\n<style>{css}</style>\n</head>\n'
        f'<body>\n<main>\n{body}\n</main>\n<script type="application/json" id="colours">{colours}</script>\n'
        f"{''.join(f'<script>{text}</script>{chr(10)}' for text in scripts)}</body>\n</html>\n"
    )


def read(name: str) -> str:
    """A file beside this one."""
    return files("gapsense.report.html").joinpath(name).read_text(encoding="utf-8")


def closed(script: str) -> str:
    """A script in which no text ends its element early."""
    return script.replace("</script", "<\\/script").replace("<!--", "<\\!--")


def digest(script: str) -> str:
    """Hash of a script, as the content security policy names it."""
    return f"'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'"
