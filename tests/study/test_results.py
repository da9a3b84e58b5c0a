"""The schema: every field is documented, the page and the JSON schema follow the records."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import ValidationError

from femtune.docstrings import attribute_docstrings
from femtune.steps.results import SCHEMA_VERSION, Results, json_schema, record_types
from femtune.steps.schema_page import schema_page
from femtune.steps.validate.record.frf_validation import PredictedCurves
from femtune.steps.validate.record.validation import ValidationResults
from femtune.study.record import Alert, Record

_PAGE = Path(__file__).resolve().parents[2] / "docs" / "results-schema.md"


@pytest.mark.quick(40)
@pytest.mark.parametrize("record", record_types(), ids=lambda r: r.__name__)
def test_each_field_is_on_the_page_with_its_meaning(record: type[Record]) -> None:
    section = _PAGE.read_text("utf-8").split(f"\n## {record.__name__}\n")[1].split("\n## ")[0]
    texts = attribute_docstrings(record)
    for name in record.model_fields:
        assert texts[name], name
        assert f"| `{name}` |" in section


def test_the_page_is_up_to_date() -> None:
    assert _PAGE.read_text("utf-8") == schema_page()


def test_the_json_schema_knows_every_record() -> None:
    schema = json_schema()
    assert schema["properties"]["schema_version"]["const"] == SCHEMA_VERSION
    assert {r.__name__ for r in record_types()} - {"Results"} == set(schema["$defs"])


@pytest.mark.slow
def test_every_property_of_the_json_schema_is_described() -> None:
    schema = json_schema()
    for definition in (schema, *schema["$defs"].values()):
        assert [name for name, entry in definition["properties"].items() if not entry.get("description")] == []


def test_records_are_frozen_and_strict_about_keys() -> None:
    alert = Alert(level="info", code="a.b", sentence="c")
    with pytest.raises(ValidationError):
        alert.code = "x"  # type: ignore[misc]
    with pytest.raises(ValidationError):
        Alert.model_validate({"level": "info", "code": "a.b", "sentence": "c", "colour": "red"})
    with pytest.raises(ValidationError):
        Alert.model_validate({"level": "loud", "code": "a.b", "sentence": "c"})


def test_array_keys_are_those_of_all_records() -> None:
    """Keys of records within records too: without them a run folder with missing arrays would not be noticed."""
    keys = ("after/1/unused_frf_hz", "after/1/unused_frf_values", "after/1/unused_frf_test_values")
    curves = PredictedCurves(
        configuration="c", data="unused FRFs", kind="mobility", outputs=("1X+",), inputs=("1X+",), freq_key=keys[0],
        values_key=keys[1], test_values_key=keys[2],
    )  # fmt: skip
    given = ValidationResults(predictions=(), not_tested=(), curves=(curves,))
    assert Results.model_construct(validation=given).array_keys() == keys
