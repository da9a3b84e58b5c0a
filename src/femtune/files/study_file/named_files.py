"""Files that a study or an identification file names, found by the types of its keys at any depth."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel

from femtune.files.study_file.kinds import NamesFile
from femtune.files.study_file.source import Place


@dataclass(frozen=True)
class FileKey:
    """A file that a key names: the place of the key, the name as written, and what the file is."""

    place: Place
    name: str
    kind: NamesFile


def files_named(model: type[BaseModel], data: Mapping[str, Any] | BaseModel) -> tuple[FileKey, ...]:
    """All files that the data of a TOML file name, in the order of the keys of `model`.

    Parameters
    ----------
    model : what the data are meant to be; its types declare with `NamesFile` which keys name files
    data : plain data, which need not be right, or the model made of them
    """
    return tuple(dict.fromkeys(_of_table(model, data, ())))


def _of_table(model: type[BaseModel], data: object, place: Place) -> Iterator[FileKey]:
    for name, field in model.model_fields.items():
        key = field.alias or name
        if isinstance(data, BaseModel):
            value = getattr(data, name, None)
        else:
            value = data.get(key) if isinstance(data, Mapping) else None
        if value is not None:
            kind: Any = field.annotation
            # pydantic keeps annotations of the whole field separately
            for mark in field.metadata:
                kind = Annotated[kind, mark]
            yield from _of_value(kind, value, (*place, key))


def _of_value(kind: Any, value: object, place: Place) -> Iterator[FileKey]:
    origin = get_origin(kind)
    if origin is Annotated and (mark := next((m for m in kind.__metadata__ if isinstance(m, NamesFile)), None)):
        if isinstance(value, str) and value:
            yield FileKey(place[:-1] if isinstance(place[-1], int) else place, value, mark)
    elif origin is None:
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            yield from _of_table(kind, value, place)
    else:
        for part, entry, at in _parts(kind, value, place):
            yield from _of_value(part, entry, at)


def _parts(kind: Any, value: object, place: Place) -> Iterator[tuple[Any, object, Place]]:
    """Types and values inside a value of a composite type, each with its place."""
    origin, kinds = get_origin(kind), get_args(kind)
    if origin is Annotated:
        yield kinds[0], value, place
    elif origin in (Union, UnionType):
        yield from ((part, value, place) for part in kinds)
    elif origin is dict and isinstance(value, Mapping):
        yield from ((kinds[1], entry, (*place, name)) for name, entry in value.items())
    elif origin is tuple and isinstance(value, tuple | list):
        last = 0 if kinds[-1] is Ellipsis else len(kinds) - 1
        yield from ((kinds[min(i, last)], entry, (*place, i)) for i, entry in enumerate(value))
    elif origin is tuple:
        # a single name may be written without brackets
        yield kinds[0], value, place
