"""JSON Schemas of the study file and of the identification file, from the classes that read them; for editors."""

from __future__ import annotations

import json
from typing import Any

from pydantic import BaseModel

from femtune.files.identification_file import IdentifyFile
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
    found: dict[str, Any] = _of_toml(model.model_json_schema())
    found["title"] = title
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **found}


def schema_text(kind: str) -> str:
    """The same as text."""
    return json.dumps(file_schema(kind), indent=1) + "\n"


_NULL = {"type": "null"}


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
