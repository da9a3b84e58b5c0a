"""The document as one self-contained HTML file: nothing from the network, every text escaped.

Only the style and the scripts of the package have an effect: the page names their hashes, so that a browser refuses any
other. Without scripts the page shows its text and still pictures.
"""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jinja2
from markupsafe import Markup

from femtune.document.document import Figure, FigureRow, flat
from femtune.errors import FemtuneError, Where, printable
from femtune.files.whole_file import check_writable, write_whole
from femtune.study.progress import silent

if TYPE_CHECKING:
    from femtune.document.document import Document
    from femtune.study.progress import Progress


def write_html(document: Document, path: Path | str, progress: Progress = silent) -> Path:
    """Write the document to `path`; `progress` receives every picture that is drawn.

    Raises
    ------
    FemtuneError : ``run.unwritable``
    """
    path = Path(path)
    _draw(document, progress)
    content = html_text(document).encode()
    try:
        write_whole(path, content)
    except (OSError, ValueError) as error:
        raise _unwritable(path, error) from error
    return path


def _draw(document: Document, progress: Progress) -> None:
    """Draw all pictures, which a document keeps."""
    blocks = [block for section in document.sections for block in flat(section.blocks)]
    rows = [block.figures if isinstance(block, FigureRow) else (block,) for block in blocks]
    figures = [figure for row in rows for figure in row if isinstance(figure, Figure)]
    for i, figure in enumerate(figures):
        progress.step("drawing the pictures of the page", i, len(figures))
        _ = figure.svg


_GENERATOR = b'<meta name="generator" content="femtune">'
_HEAD_BYTES = 4096
"""Bytes of a page in which the element above stands: it is before the title, within the first thousand."""


def check_page(path: Path | str) -> None:
    """Check that a page can be written to `path` before the work begins.

    Raises
    ------
    FemtuneError : ``run.unwritable``, also where another file than a page would be lost
    """
    path = Path(path)
    try:
        check_writable(path)
        other = path.is_file() and not _is_page(path)
    except (OSError, ValueError) as error:
        raise _unwritable(path, error) from error
    if other:
        raise FemtuneError("run.unwritable/other-file", where=Where(str(path)))


def _is_page(path: Path) -> bool:
    """Whether a file may be replaced by a page: it is one that femtune wrote, or empty."""
    with path.open("rb") as file:
        start = file.read(_HEAD_BYTES)
    return not start.strip() or _GENERATOR in start


def _unwritable(path: Path, error: OSError | ValueError) -> FemtuneError:
    """ValueError: a name that no file can have."""
    return FemtuneError(
        "run.unwritable/report", where=Where(str(path)), reason=getattr(error, "strerror", None) or error
    )


def html_text(document: Document) -> str:
    """The document as HTML."""
    view = None if document.view is None or document.view.empty else document.view
    scripts = [_package_text("bundle/page.js")]
    if view is not None and view.scenes:
        scripts.append(_package_text("bundle/viewer.js"))
    live = view is not None and view.live is not None
    if live:
        # after the viewer, which it asks for a window
        scripts.append(_package_text("bundle/live.js"))
    return (
        _environment()
        .get_template("report.html")
        .render(
            document=document,
            style=Markup(_package_text("templates/report.css")),
            scripts=[Markup(script) for script in scripts],
            live=live,
            view=None if view is None else Markup(view.json()),
        )
    )


@cache
def _package_text(name: str) -> str:
    """A file of the package: style, or a script of the bundle that `web/` is the source of."""
    return files("femtune.reporting").joinpath(name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    """Source expression of an inline script or style in a content security policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


@cache
def _environment() -> jinja2.Environment:
    """Templates of the package; undefined names are errors, control characters are spelled out."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("femtune.reporting", "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_final,
    )
    environment.filters |= {"data_uri": _data_uri, "csp_hash": _hash}
    return environment


def _final(value: Any) -> Any:
    """Texts without control characters; what a template marks as safe (its own macros) stays as it is."""
    return printable(value.expandtabs()) if type(value) is str else value


def _data_uri(svg: str) -> str:
    """A separate image: nothing inside an image can run or load anything."""
    return "data:image/svg+xml;base64," + base64.b64encode(svg.encode()).decode()
