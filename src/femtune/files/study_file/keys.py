"""The docstrings of the keys of all tables, from which schemas, pages and docstrings of classes are made."""

from __future__ import annotations

import inspect
import re
from dataclasses import dataclass

from pydantic import BaseModel

from femtune.docstrings import attribute_docstrings
from femtune.files.study_file.kinds import tables_in

_LINK = re.compile(r"\[((?:`[^`]*`|[^\]`])*)\]\([^)]*\)")
"""A link in Markdown; its text."""


@dataclass(frozen=True)
class Key:
    """The docstring of a key.

    Parameters
    ----------
    meaning : Markdown, with links relative to the documentation
    example : a value in TOML; "" for a table
    """

    meaning: str
    example: str

    @property
    def without_links(self) -> str:
        """The meaning for readers outside of the documentation."""
        return _LINK.sub(r"\1", self.meaning)


def keys_of(table: type[BaseModel]) -> dict[str, Key]:
    """Every key of a table under its name in the file. A key that is a table has the meaning of that table.

    Examples
    --------
    >>> from femtune.files.study_file import ModesTable
    >>> keys_of(ModesTable)["max_hz"].example
    '200.0'
    """
    said, keys = attribute_docstrings(table), {}
    for name, field in table.model_fields.items():
        inner = next(tables_in(field.annotation), None)
        text = said.get(name) or (summary(inner) if inner else "")
        meaning, _, example = " ".join(text.split()).partition(" Example: ")
        keys[field.alias or name] = Key(meaning, example.removeprefix("`").removesuffix("`"))
    return keys


def summary(table: type[BaseModel]) -> str:
    """The first paragraph of the docstring of a table, on one line."""
    return " ".join((inspect.getdoc(table) or "").partition("\n\n")[0].replace("``", "`").split())
