"""Every key of study.toml and identify.toml has a meaning and an example; pages and schemas show them all."""

from __future__ import annotations

import importlib.util
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from pydantic import BaseModel

from femtune.files.study_file import frozen
from femtune.files.study_file.json_schema import SCHEMAS, file_schema, tables_of
from femtune.files.study_file.keys import Key, keys_of
from femtune.files.study_file.kinds import tables_by_kind, tables_in
from femtune.files.study_file.residual import TABLES
from femtune.steps import all_steps
from femtune.steps.step import Step

_DOCS = Path(__file__).resolve().parents[3] / "docs"
_PAGES = {"study": "study-file.md", "identify": "identify-file.md"}
_TABLES = [
    pytest.param(kind, table, id=f"{kind} {table.__name__}")
    for kind, (file, _) in SCHEMAS.items()
    for table in tables_of(file)
    if table is not file
]


@pytest.fixture(scope="module")
def key_tables() -> ModuleType:
    """The extension that puts the tables of keys into the pages."""
    spec = importlib.util.spec_from_file_location("key_tables", _DOCS / "_ext" / "key_tables.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _value(example: str) -> Any:
    return tomllib.loads(f"value = {example}")["value"]


def _places(table: type[BaseModel], before: tuple[str, ...] = ()) -> Iterator[tuple[str, type[BaseModel]]]:
    """The places of the tables in a file, and of the tables in those."""
    for name, field in table.model_fields.items():
        place = (*before, field.alias or name)
        kinds = tables_by_kind(field.annotation)
        if kinds:
            yield ".".join(place), next(iter(kinds.values()))
        for kind, inner in (kinds or dict.fromkeys(("",), next(tables_in(field.annotation), None))).items():
            if inner is not None:
                yield ".".join((*place, kind) if kind else place), inner
                yield from _places(inner, place)


@cache
def _schema(kind: str) -> dict[str, Any]:
    return file_schema(kind)


@pytest.mark.parametrize(("kind", "table"), _TABLES)
def test_every_key_has_a_meaning_and_an_example_that_the_table_takes(kind: str, table: type[BaseModel]) -> None:
    for name, key in keys_of(table).items():
        assert re.fullmatch(r"[A-Z`\[].*[.)]", key.meaning), name
        assert "Example:" not in key.meaning, name
        assert not re.search(r"\b(None|True|False|tuple|dict|str)\b|``", key.meaning), name
        property_ = _schema(kind)["$defs"][table.__name__]["properties"][name]
        if "const" in property_:
            continue
        examples = {n: frozen(_value(k.example)) for n, k in keys_of(table).items() if n == name or _needed(table, n)}
        table.__pydantic_validator__.validate_python(examples)
        Draft202012Validator({**property_, "$defs": _schema(kind)["$defs"]}).validate(_value(key.example))


def _needed(table: type[BaseModel], name: str) -> bool:
    return name in table.model_fields and table.model_fields[name].is_required()


@pytest.mark.parametrize("kind", SCHEMAS)
def test_no_property_of_a_schema_lacks_a_description(kind: str) -> None:
    schema = _schema(kind)
    for table in (schema, *schema["$defs"].values()):
        for name, said in table["properties"].items():
            assert said["description"], name
            assert not re.search(r"\]\([^)]*\)", said["description"]), name
            assert said.keys() - {"description", "default", "examples"}, f"{name} has no type"


def test_the_kind_of_a_residual_must_be_given() -> None:
    schema = _schema("study")
    for kind, table in TABLES.items():
        definition = schema["$defs"][table.__name__]
        assert "kind" in definition["required"]
        assert definition["properties"]["kind"]["const"] == kind


@pytest.mark.parametrize("kind", SCHEMAS)
def test_every_table_has_its_place_on_the_page_and_no_other(kind: str, key_tables: ModuleType) -> None:
    page = (_DOCS / _PAGES[kind]).read_text(encoding="utf-8")
    marked = [place for file, place in key_tables.MARKER.findall(page) if file == kind]
    assert len(set(marked)) == len(marked) == page.count("```{keys}")
    assert "| key |" not in page
    places = dict(_places(SCHEMAS[kind][0]))
    assert set(marked) <= set(places)
    assert {places[place] for place in marked} == set(places.values())
    assert [place for place in places if "." not in place and place not in marked] == []


@pytest.mark.parametrize("kind", SCHEMAS)
def test_a_section_has_the_keys_of_its_table(kind: str, key_tables: ModuleType) -> None:
    page = (_DOCS / _PAGES[kind]).read_text(encoding="utf-8")
    places = dict(_places(SCHEMAS[kind][0]))
    for heading, place in re.findall(r"^##+ `\[*([\w-]+)\]*`[^#]*?^```\{keys\} \w+ (\S+)$", page, re.M | re.S):
        assert place.split(".")[-1] == heading
    for _, place in key_tables.MARKER.findall(page):
        rows = {row[0].strip("`"): row for row in key_tables.key_rows(kind, place)}
        shared = {"kind", "configuration", "modes"}
        if place == "residual":
            assert set(rows) == shared
            assert set(re.findall(r'"([\w-]+)"', rows["kind"][1])) == set(TABLES)
            continue
        keys = keys_of(places[place])
        assert set(keys) - set(rows) <= (shared if place.startswith("residual.") else set())
        for name, (_, type_, default, meaning, example) in rows.items():
            key: Key = keys[name]
            assert (meaning, example) == (key.meaning, f"`{key.example}`")
            assert type_
            field = next(f for n, f in places[place].model_fields.items() if (f.alias or n) == name)
            assert field.is_required() == (default == "*required*")
            if default not in ("*required*", "—"):
                assert frozen(_value(default.strip("`"))) == field.get_default(call_default_factory=True)


def test_a_table_has_the_options_of_one_step_or_describes_structure_and_tests() -> None:
    owned = [table for step in all_steps() for table in step.tables]
    assert len(set(owned)) == len(owned)
    of_the_study = set(dict(_places(SCHEMAS["study"][0]))) - set(owned)
    # what is tested and compared, and how a study is run
    assert {place for place in of_the_study if "." not in place} == {
        *("study", "model", "matrix", "variable", "runs", "solver", "configuration", "component", "test", "sensors"),
        *("sensor", "rigid_floor", "parameter", "generic", "distribution", "frequency_table", "derived"),
        *("residuals", "residual", "parallel", "output"),
    }


@pytest.mark.parametrize("step", [step for step in all_steps() if step.tables], ids=lambda step: step.name)
def test_tables_of_a_step_are_in_the_module_of_its_name(step: Step) -> None:
    places = dict(_places(SCHEMAS["study"][0]))
    for table in step.tables:
        assert places[table].__module__.rpartition(".")[2] in (step.name, table)


def test_no_module_has_tables_of_two_steps() -> None:
    places, steps = dict(_places(SCHEMAS["study"][0])), dict[str, set[str]]()
    for step in all_steps():
        for table in step.tables:
            steps.setdefault(places[table].__module__, set()).add(step.name)
    assert len(steps) > 10
    assert [module for module, names in steps.items() if len(names) > 1] == []


def test_the_page_has_the_tables_of_the_steps_in_their_order(key_tables: ModuleType) -> None:
    page = (_DOCS / _PAGES["study"]).read_text(encoding="utf-8")
    marked = [place for _, place in key_tables.MARKER.findall(page) if "." not in place]
    owned = [table for step in all_steps() for table in step.tables]
    assert [place for place in marked if place in owned] == owned
    rows = key_tables.tables_of_steps().splitlines()
    assert "| `femtune validate` | [`[validate]`](#validate), [`[[hold_out]]`](#hold_out) |" in rows
    assert key_tables.STEPS_MARKER in page
    assert key_tables.STEPS_MARKER not in key_tables.with_tables(page)


def test_rows_of_the_page_show_types_in_words(key_tables: ModuleType) -> None:
    """Written out for some keys of each kind of type."""
    shown = {
        (place, row[0].strip("`")): row[1:3]
        for place in ("modes", "correlate", "parameter", "residual.shape", "sensors", "solver", "plan", "response")
        for row in key_tables.key_rows("study", place)
    }
    expected = {
        ("modes", "count"): ("integer at least 1 and at most 100,000", "—"),
        ("correlate", "frequency_gate"): ("number above 0 and at most 1", "`0.3`"),
        ("correlate", "expand"): ('`"none"`, `"serep"`, `"dynamic"`, `"mdre"`', '`"none"`'),
        ("parameter", "name"): ("text", "*required*"),
        ("parameter", "fields"): ("list of text", "`[]`"),
        ("parameter", "elements"): ("text or list of integers at least 1", "—"),
        ("parameter", "region"): ("table", "—"),
        ("parameter", "absolute"): ("`true` or `false`", "`false`"),
        ("residual.shape", "sd"): ('number at least 0 or `"test"`', "—"),
        ("residual.shape", "covariance"): ('list of lists of numbers or `"test"`', "—"),
        ("sensors", "position_sd"): ("number at least 0 or table of numbers at least 0", "`0.0`"),
        ("solver", "environment"): ("table of text", "`{}`"),
        ("plan", "directions"): ('`"normal"` or list of `"X"`, `"Y"`, `"Z"`', '`"normal"`'),
        ("plan", "suspension"): ("list of tables", "`[]`"),
        ("response", "step_hz"): ("number above 0", "—"),
    }
    assert {place: shown[place] for place in expected} == expected
