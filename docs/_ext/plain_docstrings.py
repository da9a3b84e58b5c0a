"""Docstrings are plain words: marks that reStructuredText would take for markup are escaped outside ``literals``."""

from __future__ import annotations

import re

from sphinx.application import Sphinx

_LITERAL = re.compile(r"(``.*?``|`[^`\n]+`)")
_MARK = re.compile(r"(?<!\\)([*|]|\b_\B|_\b)")


def _escaped(line: str) -> str:
    parts = _LITERAL.split(line)
    return "".join(part if i % 2 else _MARK.sub(r"\\\1", part) for i, part in enumerate(parts))


def _escape(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    lines[:] = [_escaped(line) for line in lines]


def setup(app: Sphinx) -> dict[str, bool]:
    """Escape before other extensions read the docstring."""
    app.connect("autodoc-process-docstring", _escape, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
