"""Docstrings are plain words: marks that reStructuredText would take for markup are escaped outside ``literals``.

What stands behind a name, after a colon, is its description: it is put on a line of its own, because numpydoc expects a
type in its place. Codes of errors become links to the pages that explain them.
"""

from __future__ import annotations

import re
from pathlib import Path

from sphinx.application import Sphinx

_LITERAL = re.compile(r"(``.*?``|`[^`\n]+`_{0,2})")
_MARK = re.compile(r"(?<!\\)([*|]|\b_\B|_\b)")
_NAMED = re.compile(r"^(\w[\w., ]*?) : (.+)$")
"""A name, or several, with a description on the same line."""
_DESCRIBED = ("Parameters", "Raises", "Attributes")
"""Sections whose entries are names with descriptions."""
_CODE = re.compile(r"``([a-z]+)\.([a-z0-9*-]+)(/[a-z0-9-]+)?``")
_AREAS = {path.stem for path in (Path(__file__).parents[2] / "src" / "femtune" / "messages").glob("*.toml")}


def _escaped(line: str) -> str:
    parts = _LITERAL.split(line)
    return "".join(part if i % 2 else _MARK.sub(r"\\\1", part) for i, part in enumerate(parts))


def _linked(line: str, root: str) -> str:
    """Codes of messages as links to their pages; `root` leads to the folder of the documentation."""

    def link(found: re.Match[str]) -> str:
        area, name, variant = found.groups()
        return f"`{area}.{name}{variant or ''} <{root}errors/{area}.html>`__" if area in _AREAS else found[0]

    return _CODE.sub(link, line)


def with_descriptions(lines: list[str], root: str = "../") -> list[str]:
    """The lines of a docstring with the description of each name below it.

    Each of several names has a place of its own, and so a type; what they are stands at the first.
    """
    section, out, others = "", [], []
    for i, line in enumerate(lines):
        if others and not line.startswith(" "):
            out += [text for name in others[1:] for text in (name, f"    see ``{others[0]}``")]
            others = []
        if i + 1 < len(lines) and lines[i + 1] and not lines[i + 1].strip("-"):
            section = line
        text = _linked(line, root) if section == "Raises" else line
        named = _NAMED.match(text) if section in _DESCRIBED else None
        if named is None:
            out.append(text)
        else:
            others = named[1].split(", ")
            out += [others[0], f"    {named[2]}"]
    return out + [text for name in others[1:] for text in (name, f"    see ``{others[0]}``")]


def _escape(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    root = "../" * app.env.docname.count("/")
    lines[:] = [_escaped(line) for line in with_descriptions(lines, root)]


def setup(app: Sphinx) -> dict[str, bool]:
    """Escape before other extensions read the docstring."""
    app.connect("autodoc-process-docstring", _escape, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
