"""Tables of a study that can also be made in Python, with the keys and checks of the file."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from pathlib import Path
from reprlib import repr as shortened
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ValidationError

from femtune.errors import ErrorCollector, FemtuneError
from femtune.files.study_file.keys import keys_of
from femtune.files.study_file.kinds import TomlTable
from femtune.files.study_file.problems import problems
from femtune.files.study_file.source import StudyLines


def plain(value: Any) -> Any:
    """A value as in a TOML file: lists as tuples, numpy numbers as numbers, paths as text."""
    if isinstance(value, BaseModel):
        kind = {"kind": value.kind} if hasattr(value, "kind") else {}
        return plain({**kind, **{name: getattr(value, name) for name in value.model_fields_set}})
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if hasattr(value, "tolist"):  # an array or a number of numpy, which is not imported for this
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return tuple(map(plain, value))
    return str(value) if isinstance(value, Path) else value


class _Documented:
    """The docstring of a table for users: its text, and the keys as parameters; it is composed when it is read."""

    def __init__(self, text: str) -> None:
        self.text = inspect.cleandoc(text)

    def __get__(self, instance: object, owner: type[BaseModel]) -> str:
        keys = (f"{name} : {key.without_links}" for name, key in keys_of(owner).items() if name != "kind")
        before, heading, after = self.text.partition("Raises\n------\n")
        return "\n".join((f"{before}Parameters\n----------", *keys, "", heading + after))


def unnamed_arguments(table: type[BaseModel], before: tuple[str, ...], unnamed: tuple[Any, ...]) -> FemtuneError:
    """The error ``call.signature`` that values were given without the names of their keys, with what to write."""
    known = table.model_fields
    own = [name for name in table.__annotations__ if name in known and name not in ("kind", *before)]
    if not before:
        # of a residual, the key that is most often meant comes first
        own.sort(key=lambda name: name != "sd")
    first = [*before, *(f"{key}={shortened(value)}" for key, value in zip(own, unnamed))]
    hint = f"write for example {table.__name__}({', '.join(first)}); see help(femtune.{table.__name__})"
    reason = "values need the names of their keys"
    return FemtuneError("call.signature", function=table.__name__, reason=reason, hint=hint)


class PythonTable(TomlTable):
    """A table whose class users call: what is wrong with its keys is a FemtuneError.

    The keys and values are checked when it is created; references to the model are checked when the study is assembled.
    """

    if not TYPE_CHECKING:

        def __init__(self, *unnamed: Any, **words: Any) -> None:
            if unnamed:
                raise unnamed_arguments(type(self), (), unnamed)
            given = {name: plain(value) for name, value in words.items() if value is not None}
            try:
                super().__init__(**given)
            except ValidationError as findings:
                errors = problems(findings, StudyLines(type(self).__name__, whole=type(self).__name__), type(self))
                ErrorCollector(errors).raise_if_any()
                raise

        # tables of a file do not use this constructor; their errors are collected with those of the file
        __init__.__pydantic_base_init__ = True

    def __init_subclass__(cls, **words: Any) -> None:
        super().__init_subclass__(**words)
        if "Raises\n" in (cls.__doc__ or ""):
            cls.__doc__ = _Documented(cls.__doc__ or "")  # type: ignore[assignment]

    def __repr_args__(self) -> Iterator[tuple[str | None, Any]]:
        return ((name, getattr(self, name)) for name in type(self).model_fields if name in self.model_fields_set)
