"""The tables of keys of study.toml and identify.toml, from the classes that read the files.

A page has a marker where the keys of a table are put in: the kind of file and the place of the table in it.

    ```{keys} study parameter.region
    ```

For a table whose kind is chosen by a key, ``study residual`` stands for the keys of all kinds, and
``study residual.mac`` for the other keys of one kind.

A marker ``{tables-of-steps}`` stands for the list of the steps with their tables.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING, Any, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from femtune.files.study_file.json_schema import SCHEMAS, file_schema
from femtune.files.study_file.keys import keys_of
from femtune.files.study_file.kinds import tables_by_kind, tables_in
from femtune.files.study_file.source import spelled
from femtune.steps import all_steps

if TYPE_CHECKING:
    from sphinx.application import Sphinx

    from femtune.steps.step import Step

PAGES = ("study-file", "identify-file")
MARKER = re.compile(r"^```\{keys\} (\w+) ([\w.-]+)\n```$", re.MULTILINE)
STEPS_MARKER = "```{tables-of-steps}\n```\n"
_REQUIRED = "*required*"
_OF_ALL_KINDS = ("kind", "configuration", "modes")
"""Keys that the section of a list of tables explains for all kinds."""
_LARGEST_SHOWN = 1e9
"""Bounds beyond this are there for slips of the pen; the schema has them."""


def with_tables(page: str) -> str:
    """The text of a page with a table of keys in place of each marker."""
    page = page.replace(STEPS_MARKER, tables_of_steps())
    return MARKER.sub(lambda marker: key_table(marker[1], marker[2]), page)


def tables_of_steps() -> str:
    """Each step that has options, with links to its tables, in Markdown."""
    rows = (
        f"| {_step_words(step)} | {', '.join(map(_table_link, step.tables))} |\n" for step in all_steps() if step.tables
    )
    return "".join(("| step | tables |\n| --- | --- |\n", *rows))


def _step_words(step: Step) -> str:
    return f"`femtune {step.name}`" if step.command is not None else f"{step.name}, in `femtune run`"


def _table_link(name: str) -> str:
    repeated = get_origin(_field(SCHEMAS["study"][0], name).annotation) is tuple
    return f"[`[[{name}]]`](#{name})" if repeated else f"[`[{name}]`](#{name})"


def key_table(kind: str, place: str) -> str:
    """The keys of a table in Markdown (KeyError for a place that the file does not have)."""
    head = ("| key | type | default | meaning | example |", "| --- | --- | --- | --- | --- |")
    return "\n".join((*head, *(f"| {' | '.join(cells)} |" for cells in key_rows(kind, place))))


def key_rows(kind: str, place: str) -> Iterator[tuple[str, str, str, str, str]]:
    """Key, type, default, meaning and example of each key of a table."""
    file, (name, *inner) = SCHEMAS[kind][0], place.split(".")
    kinds = tables_by_kind(_field(file, name).annotation)
    if not kinds:
        table = file
        for part in place.split("."):
            table = next(tables_in(_field(table, part).annotation))
        yield from (_row(kind, table, key) for key in keys_of(table))
        return
    first = next(iter(kinds.values()))
    of_all = {key: said for key, said in keys_of(first).items() if key in _OF_ALL_KINDS}
    if inner:
        table = kinds[inner[0]]
        own = (key for key, said in keys_of(table).items() if key != "kind" and said != of_all.get(key))
        yield from (_row(kind, table, key) for key in own)
    else:
        _, _, _, *said = _row(kind, first, "kind")
        yield "`kind`", _choices(kinds), _REQUIRED, said[0], said[1]
        yield from (_row(kind, first, key) for key in of_all if key != "kind")


def _row(kind: str, table: type[BaseModel], key: str) -> tuple[str, str, str, str, str]:
    said, field = keys_of(table)[key], _field(table, key)
    default = _REQUIRED if field.is_required() else _default(field.get_default(call_default_factory=True))
    type_ = _type_words(_schema(kind)["$defs"][table.__name__]["properties"][key])
    return f"`{key}`", type_, default, said.meaning.replace("|", r"\|"), f"`{said.example}`"


@cache
def _schema(kind: str) -> dict[str, Any]:
    return file_schema(kind)


def _field(table: type[BaseModel], key: str) -> FieldInfo:
    return next(field for name, field in table.model_fields.items() if (field.alias or name) == key)


def _default(value: Any) -> str:
    if value is None:
        return "—"
    return f"`{spelled(value) if value != {} else '{}'}`"


def _choices(words: Any) -> str:
    return ", ".join(f"`{spelled(word)}`" for word in words)


def _type_words(schema: dict[str, Any]) -> str:
    """A type of the JSON Schema in words: "number above 0", "list of text"."""
    if "anyOf" in schema:
        return " or ".join(_type_words(one) for one in schema["anyOf"])
    if "enum" in schema or "const" in schema:
        return _choices(schema.get("enum", (schema.get("const"),)))
    if "$ref" in schema:
        return "table"
    kind = schema["type"]
    if kind == "array":
        return _list_words(schema)
    if kind == "object":
        return f"table of {_plural(_type_words(schema['additionalProperties']))}"
    return {"string": "text", "boolean": "`true` or `false`"}.get(kind) or f"{kind}{_range(schema)}"


def _list_words(schema: dict[str, Any]) -> str:
    entries = schema.get("prefixItems") or [schema["items"]] * schema.get("minItems", 0)
    if entries and schema.get("minItems") == schema.get("maxItems"):
        return f"list of {len(entries)} {_plural(_type_words(entries[0]))}"
    return f"list of {_plural(_type_words(schema['items']))}"


def _plural(words: str) -> str:
    """ "list of 3 numbers" -> "lists of 3 numbers"; texts of choices stay."""
    return re.sub(r"^(number|integer|list|table)\b", r"\1s", words)


def _range(schema: dict[str, Any]) -> str:
    words = {"exclusiveMinimum": "above", "minimum": "at least", "exclusiveMaximum": "below", "maximum": "at most"}
    bounds = {word: schema[key] for key, word in words.items() if abs(schema.get(key, 1e18)) < _LARGEST_SHOWN}
    return " and".join(f" {word} {bound:,.12g}" for word, bound in bounds.items())


def _put_in(app: Sphinx, page: str, text: list[str]) -> None:
    if page in PAGES:
        text[0] = with_tables(text[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Put the tables in when a page is read; the pages are read at every build, for the classes may have changed."""
    app.connect("source-read", _put_in)
    app.connect("env-get-outdated", lambda *_: list(PAGES))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
