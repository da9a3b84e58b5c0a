"""Tables of file formats in the guide, from the list of formats of the package.

A page has the table between the comments ``<!-- formats: matrices -->`` and ``<!-- end of formats -->``.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from femtune.files.formats import MATRIX_FORMATS, MODES_FORMATS, RECORD_FORMATS, FileFormat, Formats

_LISTS: dict[str, tuple[Formats[Any], str]] = {
    "matrices": (MATRIX_FORMATS, "DOFs of the rows are given by"),
    "modes": (MODES_FORMATS, "what is read"),
    "records": (RECORD_FORMATS, "what is read"),
}
PAGES = ("guide/matrices.md", "guide/external-solvers.md", "guide/identify.md")
_MARKED = re.compile(r"(<!-- formats: (\w+) -->\n).*?(<!-- end of formats -->)", re.DOTALL)


def write_format_tables(docs: Path) -> None:
    """Write the tables of all pages that have one."""
    for name in PAGES:
        page = docs / name
        text = page.read_text(encoding="utf-8")
        if (new := with_tables(text)) != text:
            page.write_text(new, encoding="utf-8")


def with_tables(text: str) -> str:
    """The text of a page with its tables as they are now."""
    return _MARKED.sub(lambda mark: mark[1] + _table(*_LISTS[mark[2]]) + mark[3], text)


def _table(formats: Formats[Any], content: str) -> str:
    columns = ["`format`", *(["extensions"] if formats.suffixes else []), "written by", content]
    rows = [columns, ["---"] * len(columns), *(_row(one, bool(formats.suffixes)) for one in formats)]
    return "\n" + "".join(f"| {' | '.join(row)} |\n" for row in rows) + "\n"


def _row(one: FileFormat, with_extensions: bool) -> list[str]:
    extensions = [", ".join(f"`{suffix}`" for suffix in one.suffixes)] if with_extensions else []
    extra = f' (needs `pip install "femtune[{one.extra}]"`)' if one.extra else ""
    return [f"`{one.key}`", *extensions, one.written_by + extra, one.content]
