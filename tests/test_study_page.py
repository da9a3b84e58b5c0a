"""The pages about the study file: their examples are studies, and every key is explained."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel

from femtune.files.identify_file.tables import IdentifyFile
from femtune.files.study_file.reading import study_from_text
from femtune.files.study_file.study import StudyFile

_ROOT = Path(__file__).resolve().parents[1]
_PAGE = (_ROOT / "docs" / "study-file.md").read_text(encoding="utf-8")
_IDENTIFY_PAGE = (_ROOT / "docs" / "identify-file.md").read_text(encoding="utf-8")
_README = (_ROOT / "README.md").read_text(encoding="utf-8")


def _tables_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _tables_in(part)


def _keys(table: type[BaseModel]) -> set[str]:
    keys = {field.alias or name for name, field in table.model_fields.items()}
    for field in table.model_fields.values():
        for inner in _tables_in(field.annotation):
            keys |= _keys(inner)
    return keys


@pytest.mark.parametrize("text", [_PAGE, _README], ids=["study-file.md", "README.md"])
def test_the_example_is_a_study(text: str, tmp_path: Path) -> None:
    examples = re.findall(r"```toml\n(.*?)```", text, re.S)
    assert examples
    for name in ("building.bdf", "building.uff"):
        (tmp_path / name).touch()
    study = study_from_text(examples[0], tmp_path / "study.toml")
    assert [p.name for p in study.parameter] == ["Ibx1", "Ibx2"]


@pytest.mark.parametrize("key", sorted(_keys(StudyFile)))
def test_every_key_is_explained(key: str) -> None:
    assert re.search(rf"`(\[\[?)?{key}(\]\]?)?( = [^`]*)?`|\{{ {key} =|\b{key} = ", _PAGE)


def _rows(page: str) -> list[tuple[str, str]]:
    """Keys of the page's tables with what it says of their defaults."""
    found = re.findall(r"^\| ((?:`\w+`(?:, )?)+) \| ([^|]*) \|", page, re.M)
    return [(key, default.strip()) for keys, default in found for key in re.findall(r"`(\w+)`", keys)]


def test_no_table_explains_a_key_that_is_not_there() -> None:
    explained = {key for key, _ in _rows(_PAGE)}
    assert len(explained) > 30
    assert explained <= _keys(StudyFile)


def test_every_key_of_an_identification_is_explained_and_no_other() -> None:
    tables = _keys(IdentifyFile) - set(IdentifyFile.model_fields)
    assert {key for key, _ in _rows(_IDENTIFY_PAGE)} == tables


def _defaults(table: type[BaseModel]) -> Iterator[tuple[str, str]]:
    """Keys with their defaults in the words of the page."""
    for name, field in table.model_fields.items():
        value = None if field.is_required() else field.get_default(call_default_factory=True)
        if field.is_required():
            yield field.alias or name, "*required*"
        elif value is None:
            yield field.alias or name, "*none*"
        elif not isinstance(value, BaseModel):
            yield field.alias or name, repr(_plain(value))
        for inner in _tables_in(field.annotation):
            yield from _defaults(inner)


def _plain(value: Any) -> Any:
    return [_plain(v) for v in value] if isinstance(value, tuple | list) else value


def test_defaults_are_those_of_the_tables() -> None:
    known = set(_defaults(StudyFile))
    told = {
        (key, repr(tomllib.loads(f"x = {text.strip('`')}")["x"]) if text.startswith("`") else text)
        for key, text in _rows(_PAGE)
    }
    assert told - known == set()
