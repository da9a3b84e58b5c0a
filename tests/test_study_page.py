"""The pages about the study file: their examples are studies, and every key is explained."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel

from femtune.files.identification_file import IdentifyFile
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


def _explained(page: str) -> set[str]:
    rows = re.findall(r"^\| ((?:`\w+`(?:, )?)+) \|", page, re.M)
    return {key for row in rows for key in re.findall(r"`(\w+)`", row)}


def test_no_table_explains_a_key_that_is_not_there() -> None:
    assert len(_explained(_PAGE)) > 30
    assert _explained(_PAGE) <= _keys(StudyFile)


def test_every_key_of_an_identification_is_explained_and_no_other() -> None:
    assert _explained(_IDENTIFY_PAGE) == _keys(IdentifyFile) - set(IdentifyFile.model_fields)
