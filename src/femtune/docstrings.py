"""Docstrings of attributes: the texts under the fields of a class, which Python itself forgets."""

from __future__ import annotations

import ast
import inspect
import itertools
import textwrap
from functools import cache


def attribute_docstrings(owner: type) -> dict[str, str]:
    """Text under each field of a class and of its bases, by name of the field; a class overrides its bases.

    It is read from the source, which takes time: for schemas and documentation only.

    Examples
    --------
    >>> from femtune.docstrings import attribute_docstrings
    >>> from femtune.files.study_file import WriteTable
    >>> list(attribute_docstrings(WriteTable))
    ['wide', 'split']
    """
    house = [c for c in owner.__mro__ if c.__module__.partition(".")[0] == __name__.partition(".")[0]]
    return {name: text for c in reversed(house) for name, text in _own(c)}


@cache
def _own(owner: type) -> tuple[tuple[str, str], ...]:
    lines = []
    (definition,) = ast.parse(textwrap.dedent(inspect.getsource(owner))).body
    assert isinstance(definition, ast.ClassDef)
    for field, text in itertools.pairwise(definition.body):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name) and isinstance(text, ast.Expr):
            assert isinstance(text.value, ast.Constant)
            lines.append((field.target.id, inspect.cleandoc(str(text.value.value))))
    return tuple(lines)
