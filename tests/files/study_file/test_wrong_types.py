"""A wrong type or value for every key: no message speaks in the words of the library that checks types."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel, ValidationError

from femtune.errors import FemtuneError, FemtuneErrors
from femtune.files.identification_file import IdentifyFile
from femtune.files.study_file import frozen, study_from_data
from femtune.files.study_file.problems import model_in, problems
from femtune.files.study_file.residual import TABLES
from femtune.files.study_file.source import StudyLines
from femtune.files.study_file.study import StudyFile

_WRONG = ("x", "", -1, 1.5, True, [], ["a"], [1, 2, 3, 4, 5, 6, 7], [[1.0]], {}, {"a": 1}, float("nan"), 1e300, 0, [{}])
_FOREIGN = re.compile(
    r"constrained|pydantic|validation|pattern|tuple|Input|\bstr\b|\bint\b|\bdict\b|NoneType|function-"
)
_STUDY = {"title": "x", "deck": "d.bdf", "units": "m-kg-s"}
_IDENTIFY = {"record": "r.csv", "units": "m-kg-s"}


def _keys(model: type[BaseModel], before: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Places of all keys, of the first entry of each list."""
    for name, field in model.model_fields.items():
        place = (*before, field.alias or name)
        yield place
        inner, listed = model_in(field.annotation), "..." in str(field.annotation)
        if inner is not None and name != "residual" and len(before) < 3:
            yield from _keys(inner, (*place, 0) if listed else place)


def _data(place: tuple[Any, ...], value: Any) -> dict[str, Any]:
    data = value
    for part in reversed(place):
        data = [data] if isinstance(part, int) else {part: data}
    return data


def _messages(model: type[BaseModel], data: dict[str, Any]) -> tuple[FemtuneError, ...]:
    try:
        if model is StudyFile:
            study = data.get("study", {})
            whole = {**data, "study": {**_STUDY, **study} if isinstance(study, dict) else study}
            study_from_data(frozen(whole), Path("study.toml"), StudyLines("study.toml"))
        else:
            table = data.get("identify", {})
            whole = {**data, "identify": {**_IDENTIFY, **table} if isinstance(table, dict) else table}
            IdentifyFile.model_validate(frozen(whole))
    except ValidationError as found:
        return tuple(problems(found, StudyLines("identify.toml", {}, "docs/identify-file.md"), IdentifyFile))
    except FemtuneErrors as several:
        return several.errors
    except FemtuneError as error:
        return (error,)
    return ()


def _places() -> Iterator[tuple[type[BaseModel], tuple[Any, ...], dict[str, str]]]:
    yield from ((model, place, {}) for model in (StudyFile, IdentifyFile) for place in _keys(model))
    for kind, table in TABLES.items():
        yield from ((StudyFile, ("residual", 0, name), {"kind": kind}) for name in table.model_fields)


@pytest.mark.slow
def test_no_message_names_types_of_the_program() -> None:
    asked = 0
    for model, place, more in _places():
        for value in _WRONG:
            data = _data(place, value)
            if more and place[-1] != "kind":
                data["residual"][0] |= more
            for error in _messages(model, data):
                asked += 1
                text = f"{error.what} {error.hint} {error.where.record if error.where else ''}"
                assert not _FOREIGN.search(text.replace("validation", "", text.count("'validation'"))), (place, value)
                assert error.what, place
    assert asked > 5000


@pytest.mark.parametrize(
    ("data", "what", "hint"),
    [
        ({"residual": {"frequency_sd": 0.01}}, "'residual' is a list of tables", "[residuals] if the keys"),
        ({"residual": [{"kind": ["mac"]}]}, "'kind' should be text", 'kind = "frequency"'),
        ({"variable": [{"name": "k 1", "nominal": 1.0}]}, "'name' has characters", "capitals and digits"),
        ({"test": {"file": "t.uff", "rotation": [[1.0, 0, 0]] * 5}}, "has 5 entries, more than 3", "write 3 entries"),
        ({"validat": {}}, "'validat' is not a key", "did you mean 'validate'?"),
        ({"study": {"units": None}}, "'units' should be text", "quotes"),
        ({"schema_version": True}, "'schema_version' should be a whole number", ""),
        ({"schema_version": 1.0}, "'schema_version' should be a whole number", "decimal point"),
        ({"schema_version": 0}, "'schema_version' should be greater than or equal to 1", "write 1"),
    ],
)
def test_what_was_poor(data: dict[str, Any], what: str, hint: str) -> None:
    error = _messages(StudyFile, data)[0]
    assert what in error.what
    assert hint in error.hint
