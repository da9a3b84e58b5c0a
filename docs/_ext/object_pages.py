"""A page for each name of `femtune`, and the tables that list them.

The reference has a marker in place of each table, with a name on each line:

    ```{objects}
    read_deck
    read_test
    ```
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import TYPE_CHECKING

import femtune

if TYPE_CHECKING:
    from sphinx.application import Sphinx

MARKER = re.compile(r"^```\{objects\}\n((?:\w+\n)+)```$", re.MULTILINE)


def objects_of(page: str) -> list[str]:
    """The names in the markers of a page, in their order."""
    return [name for marker in MARKER.finditer(page) for name in marker[1].split()]


def with_objects(page: str) -> str:
    """The text of the reference with a table in place of each marker."""
    return MARKER.sub(lambda marker: _table(marker[1].split()), page)


def _table(names: list[str]) -> str:
    rows = (f"| [`{name}`](objects/{name}.md) | {_summary(name)} |" for name in names)
    return "\n".join(("| name | what it is |", "| --- | --- |", *rows))


def _summary(name: str) -> str:
    """The first sentence of its docstring, in Markdown."""
    text = inspect.getdoc(getattr(femtune, name)) or ""
    first = " ".join(text.partition("\n\n")[0].split())
    sentence = re.split(r"(?<=\.) (?=[A-Z])", first)[0]
    return sentence.replace("``", "`").replace("|", "\\|").replace("[[", "\\[[")


def write_object_pages(folder: Path) -> set[str]:
    """Write the page of each object of the reference into ``objects`` of its folder; returns the names.

    The pages are in no list of contents, so that the side bar of every page stays short.
    """
    names = objects_of((folder / "index.md").read_text(encoding="utf-8"))
    folder = folder / "objects"
    folder.mkdir(exist_ok=True)
    for stale in folder.glob("*.md"):
        if stale.stem not in names:
            stale.unlink()
    for name in names:
        directive = "autoclass" if inspect.isclass(getattr(femtune, name)) else "autofunction"
        head = f"---\norphan: true\n---\n\n# {name}\n\n[Python reference](../index.md)\n\n"
        text = f"{head}```{{eval-rst}}\n.. {directive}:: femtune.{name}\n```\n"
        page = folder / f"{name}.md"
        # a page that is written again is built again
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")
    return set(names)


def _put_in(app: Sphinx, document: str, source: list[str]) -> None:
    if document == "api/index":
        source[0] = with_objects(source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Put the tables in before the page is parsed."""
    app.connect("source-read", _put_in)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
