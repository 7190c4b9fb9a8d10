"""The file: everything in it, nothing fetched, and a policy that lets the browser run nothing else.

What its parts look like is in `templates/`; every text is escaped there.
"""

from __future__ import annotations

import math
import re
from base64 import b64encode
from collections.abc import Sequence
from functools import cache
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gapsense._os.files import write_atomically
from gapsense.problems import InputError
from gapsense.report.html import style
from gapsense.report.html.many import Many
from gapsense.report.html.subject import Shown, read_all
from gapsense.report.table import quantity

if TYPE_CHECKING:
    from gapsense.report.html.figures import Chapter

DRAWN = "Reports are drawn"
MISSING = "{} by bokeh, which is not installed. Install it with `pip install 'gapsense[report]'`."
POLICY = "default-src 'none'; img-src data: blob:; font-src data:; style-src 'unsafe-inline'; script-src {}"


def write_report(results: Sequence[str | Path], to: str | Path) -> Path:
    """Write one HTML file on saved results, complete or not at all; its folder is made if there is none.

    The results are CSV files, as `Result.save` writes them, those of sweeps, and folders of campaigns. An InputError
    has all that is wrong with them, or tells that bokeh is missing.
    """
    content, to = report(list(map(Path, results))), Path(to)
    write_atomically(to, lambda file: print(content, end="", file=file))
    return to


def report(results: Sequence[Path]) -> str:
    """The page on some results, as HTML."""
    if not results:
        raise InputError(["there is nothing to report on. Name CSV files of results."])
    shown = read_all(results)
    refuse_without_bokeh(DRAWN)
    return page([chapter_of(one, f"r{k}") for k, one in enumerate(shown, 1)])


def refuse_without_bokeh(drawn: str) -> None:
    """Raise an InputError that names what cannot be drawn if bokeh, which is optional and brings jinja2, is missing."""
    try:
        import bokeh  # noqa: F401
    except ImportError:
        raise InputError([MISSING.format(drawn)]) from None


def chapter_of(shown: Shown | Many, key: str) -> Chapter:
    """Everything about one of the results."""
    if isinstance(shown, Many):
        from gapsense.report.html.many_chapter import chapter_of_many

        return chapter_of_many(shown, key)
    from gapsense.report.html.run import chapter_of_run

    return chapter_of_run(shown, key)


def page(chapters: Sequence[Chapter]) -> str:
    """The file of some chapters."""
    from bokeh.resources import Resources
    from markupsafe import Markup

    from gapsense.report.html.figures import embed_figures

    library = "\n".join(Resources(mode="inline", components=["bokeh"]).js_raw)
    scripts = [escape_script(text) for text in (library, read("page.js"))]
    return str(
        template("page.html").render(
            title=chapters[0].title if len(chapters) == 1 else f"{len(chapters)} results",
            policy=Markup(POLICY.format(" ".join(map(digest, scripts)))),
            style=Markup(style.variables() + read("page.css")),
            colours=style.DARK,
            figures=embed_figures([drawn for chapter in chapters for drawn in chapter.figures]),
            scripts=[*map(Markup, scripts)],
            chapters=chapters,
        )
    )


def template(name: str, package: str = "gapsense.report.html") -> Any:
    """A template of the folder `templates` in a package; a name that it does not know is an error."""
    return templates(package).get_template(name)


@cache  # which keeps them compiled: that takes longer than to fill them in
def templates(package: str) -> Any:
    """The templates of a package."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    options: dict[str, Any] = {"trim_blocks": True, "lstrip_blocks": True, "keep_trailing_newline": True}
    made = Environment(loader=PackageLoader(package), autoescape=True, undefined=StrictUndefined, **options)
    made.filters |= {
        "quantity": lambda value, unit: quantity(float(value), unit),
        "variable": style.variable,
        "words": words,
    }
    made.tests["finite"] = math.isfinite
    made.policies["json.dumps_kwargs"] = {"separators": (",", ":")}  # not sorted: Bokeh reads references in order
    return made


def words(text: str) -> Any:
    """A sentence with what stands in back-ticks as code."""
    from markupsafe import Markup, escape

    return Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def read(name: str, package: str = "gapsense.report.html") -> str:
    """A file of a package."""
    return files(package).joinpath(name).read_text(encoding="utf-8")


def escape_script(script: str) -> str:
    """Escape what would end the element of a script early."""
    return script.replace("</script", "<\\/script").replace("<!--", "<\\!--")


def digest(script: str) -> str:
    """Hash of a script, as the content security policy names it."""
    return f"'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'"
