"""JSON Schemas of the study file and of the identification file, from the classes that read them; for editors."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from femtune.files.identification_file import IdentifyFile
from femtune.files.study_file.keys import keys_of, summary
from femtune.files.study_file.kinds import tables_in
from femtune.files.study_file.study import StudyFile

SCHEMAS: dict[str, tuple[type[BaseModel], str]] = {
    "study": (StudyFile, "study.toml of femtune"),
    "identify": (IdentifyFile, "identify.toml of femtune"),
}
"""Files that have a schema: their class and title."""


def file_schema(kind: str) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a kind of file: "study" or "identify".

    Rules between several keys, and whether files, fields and grid points exist, are checked by `femtune check`.

    Examples
    --------
    >>> from femtune.files.study_file.json_schema import file_schema
    >>> sorted(file_schema("study")["required"])
    ['study']
    """
    model, title = SCHEMAS[kind]
    schema: dict[str, Any] = _of_toml(model.model_json_schema())
    schema["title"] = title
    for table in tables_of(model):
        _describe(schema if table is model else schema["$defs"][table.__name__], table)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def schema_text(kind: str) -> str:
    """The same as text."""
    return json.dumps(file_schema(kind), indent=1) + "\n"


def tables_of(table: type[BaseModel]) -> tuple[type[BaseModel], ...]:
    """A table and all that are in it, each once."""

    def walk(one: type[BaseModel]) -> Iterator[type[BaseModel]]:
        yield one
        for field in one.model_fields.values():
            for inner in tables_in(field.annotation):
                yield from walk(inner)

    return tuple(dict.fromkeys(walk(table)))


def _describe(schema: dict[str, Any], table: type[BaseModel]) -> None:
    """Meaning and example of each key, and the kind of a table as a key that the file must have."""
    schema["description"] = summary(table)
    for name, key in keys_of(table).items():
        property_ = schema["properties"][name]
        property_["description"] = key.without_links
        if "const" in property_:
            property_.pop("default", None)
            schema["required"] = list(dict.fromkeys((name, *schema.get("required", ()))))
        elif key.example:
            property_["examples"] = [tomllib.loads(f"value = {key.example}")["value"]]


_NULL = {"type": "null"}
"""JSON Schema of null."""


def _of_toml(value: Any, names: bool = False) -> Any:
    """Without null, which TOML does not have, and without titles that only repeat a key; `names` are those of keys."""
    if isinstance(value, list):
        return [_of_toml(entry) for entry in value if entry != _NULL]
    if not isinstance(value, dict):
        return value
    kept = {
        key: _of_toml(entry, key in ("properties", "$defs") and not names)
        for key, entry in value.items()
        if names or not (key == "title" or (key == "default" and entry is None))
    }
    choices = kept.get("anyOf")
    if not names and isinstance(choices, list) and len(choices) == 1:
        rest = {key: entry for key, entry in kept.items() if key != "anyOf"}
        return {**choices[0], **rest}
    return kept
