"""The page docs/results-schema.md, made from the records themselves."""

from __future__ import annotations

import inspect
import re
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

from femtune.docstrings import attribute_docstrings
from femtune.steps.results import SCHEMA_VERSION, record_types

if TYPE_CHECKING:
    from femtune.study.record import Record


def schema_page() -> str:
    """The text of docs/results-schema.md: every record and field with type and description, as Markdown."""
    return "\n".join([_PAGE_HEAD, *(_record_section(record) for record in record_types())])


_PAGE_HEAD = f"""# results.json

The run folder holds `results.json` with its arrays beside it in `arrays.npz`, the updated deck and `report.html`.
This page is schema version {SCHEMA_VERSION}; the number rises when a program that reads the file must change.
femtune also reads files of earlier versions, and sets what they do not contain to `null`, or to the default of the
field; it refuses later versions.
Numbers are in the units that the study declares unless the name ends in a unit (`freq_hz`). What is not known is
`null`, with its reason beside it; an absent number is never zero. A field that ends in `_key` names an array.
`femtune.steps.results.json_schema()` returns the same as a JSON schema, `femtune.steps.run_folder.read_results(folder)`
reads a folder. The page is written by `python -m femtune.steps.schema_page`.
"""


def _record_section(record: type[Record]) -> str:
    texts = attribute_docstrings(record)
    rows = [
        f"| `{name}` | {_type_text(field.annotation)} | {_in_json_words(texts.get(name, ''))} |"
        for name, field in record.model_fields.items()
    ]
    meaning = _in_json_words(inspect.getdoc(record) or "")
    head = [f"## {record.__name__}", "", meaning, "", "| field | type | meaning |", "| --- | --- | --- |"]
    return "\n".join([*head, *rows, ""])


def _in_json_words(text: str) -> str:
    """One line, with Python's None under its name in JSON."""
    return re.sub(r"\bNone\b", "null", " ".join(text.replace("``", "`").split()))


def _type_text(annotation: Any) -> str:
    """A type in words that need no Python: "list of PairedMode", "number or null"."""
    if get_origin(annotation) is Literal:
        return " or ".join(f'"{value}"' for value in get_args(annotation))
    if get_origin(annotation) is tuple:
        inner = get_args(annotation)
        count = "list" if inner[-1] is Ellipsis else str(len(inner))
        return f"{count} of {_type_text(inner[0])}"
    if isinstance(annotation, UnionType):
        return " or ".join(_type_text(part) for part in get_args(annotation))
    return _TYPE_WORDS.get(annotation) or annotation.__name__


_TYPE_WORDS = {str: "text", float: "number", int: "integer", bool: "true or false", NoneType: "null"}


if __name__ == "__main__":
    print(schema_page(), end="")
