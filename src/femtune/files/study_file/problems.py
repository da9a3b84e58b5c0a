"""Errors with file, line, key, value and fix from the findings of pydantic."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from femtune.errors import FemtuneError, did_you_mean
from femtune.files.study_file.kinds import tables_by_kind
from femtune.files.study_file.source import Place, StudyLines, spelled

_WANTED = {
    "string_type": ("text", "put it in quotes"),
    "bool_type": ("true or false", "write true or false, without quotes"),
    "int_type": ("a whole number", "write it without quotes and decimal point"),
    "int_from_float": ("a whole number", "write it without decimal point"),
    "float_type": ("a number", "write it without quotes"),
    "tuple_type": ("a list", "put it in brackets: [ … ]"),
    "dict_type": ("a table", "write { key = value }"),
    "model_type": ("a table", "write [name] on a line of its own, or { key = value }"),
    "model_attributes_type": ("a table", "write [name] on a line of its own, or { key = value }"),
}
"""What a finding of pydantic expects, and how to write it."""


def problems(findings: ValidationError, source: StudyLines, model: type[BaseModel]) -> list[FemtuneError]:
    """One error for each finding, in the order of the file; `model` is what the file was checked against."""
    errors = _of_unions(findings.errors(include_url=False))
    return [_error(finding, source, model) for finding in errors if not _follows(finding, errors)]


def _of_unions(errors: Sequence[ErrorDetails]) -> list[ErrorDetails]:
    """For values of several possible types: the findings for the type that the value has, or one of its type."""
    kept: list[ErrorDetails] = []
    for finding in errors:
        at = next((i for i, part in enumerate(finding["loc"]) if _names_type(part)), None)
        if at is None:
            kept.append(finding)
            continue
        value = finding["loc"][:at]
        others = [f for f in errors if f["loc"][:at] == value and f["loc"][at : at + 1] != finding["loc"][at : at + 1]]
        of_type = len(finding["loc"]) == at + 1 and finding["type"] in _WANTED
        if not (of_type and others and (any(f["type"] not in _WANTED for f in others) or others[0] in kept)):
            kept.append(finding)
    return kept


def _names_type(part: str | int) -> bool:
    """True for the mark that pydantic appends to the place of a value of several types."""
    return isinstance(part, str) and part.startswith(("constrained-", "tuple[", "dict["))


def _follows(finding: ErrorDetails, errors: Sequence[ErrorDetails]) -> bool:
    """True for a list that is too short only because its entries are wrong themselves."""
    place = finding["loc"]
    inside = any(other["loc"][: len(place)] == place and other is not finding for other in errors)
    return finding["type"] == "too_short" and inside


def _error(finding: ErrorDetails, source: StudyLines, model: type[BaseModel]) -> FemtuneError:
    place = _place(finding, model)
    if finding["type"].startswith("union_tag"):
        return _kind(finding, place, source, model)
    if finding["type"] == "extra_forbidden":
        return _unknown_key(finding, place, source, model)
    if finding["type"] == "missing":
        return _missing_key(place, source, _list_of_tables(place, model))
    if finding["type"] == "femtune":
        return _own(finding["ctx"]["error"], place, finding["input"], source)
    if finding["type"] == "tuple_type" and isinstance(finding["input"], Mapping):
        return _table_for_list(place, finding, source, model)
    code, facts = _judgement(finding)
    return source.error(place, code, {_key(place): finding["input"]}, key=_name(place), **facts)


def _table_for_list(place: Place, finding: ErrorDetails, source: StudyLines, model: type[BaseModel]) -> FemtuneError:
    """A table instead of a list of tables; a table of a similar name is suggested."""
    key = str(place[-1])
    plural = f"{key}s"
    known = _keys(place[:-1], finding, model)
    hint = f"write [[{key}]], or [{plural}] if the keys are those of this table" if plural in known else None
    name = f"[[{key}]]" if len(place) == 1 else f"{key} = [{{ … }}]"
    return source.error(place, "study.type/list-of-tables", {}, hint=hint, key=key, name=name)


def _place(finding: ErrorDetails, model: type[BaseModel]) -> Place:
    """The place without the marks of pydantic for keys, types and kinds of tables."""
    place: Place = tuple(part for part in finding["loc"] if part != "[key]" and not _names_type(part))
    return place[:2] + place[3:] if len(place) > 2 and place[2] in _kinds(place, model) else place


def _kinds(place: Place, model: type[BaseModel]) -> Mapping[str, type[BaseModel]]:
    """The tables by kind, for a list of tables whose kind is a key."""
    field = _fields(model).get(str(place[0])) if isinstance(place[1], int) else None
    return tables_by_kind(field.annotation) if field else {}


def _kind(finding: ErrorDetails, place: Place, source: StudyLines, model: type[BaseModel]) -> FemtuneError:
    """A table whose kind is missing or unknown."""
    if finding["type"] == "union_tag_not_found":
        return _missing_key((*place, "kind"), source)
    given = finding["ctx"].get("tag")
    if not isinstance(finding["input"].get("kind"), str):
        facts = {"key": "'kind'", "wanted": "text", "hint": 'write for example kind = "frequency"'}
        return source.error((*place, "kind"), "study.type", {"kind": finding["input"].get("kind")}, **facts)
    hint = did_you_mean(str(given), _kinds(place, model))
    return source.error((*place, "kind"), "study.value/kind", {}, hint=hint, given=given)


def _name(place: Place) -> str:
    """The name of the value in messages: a key, or an entry of a list."""
    last = place[-1] if place else "the file"
    return f"entry {last + 1} of {_name(place[:-1])}" if isinstance(last, int) and len(place) > 1 else f"'{last}'"


def _unknown_key(finding: ErrorDetails, place: Place, source: StudyLines, model: type[BaseModel]) -> FemtuneError:
    known = _keys(place[:-1], finding, model)
    return source.error(
        place,
        "study.unknown-key",
        {},
        hint=_place_of_test_key(place, model) or _of_choices(place, model) or did_you_mean(str(place[-1]), known),
        key=place[-1],
        table=_table(place[:-1], source),
    )


_OF_TEST = ("pairs", "never_pairs", "leave_out", "sensors_off")
"""Keys that pages and remarks offer as lines, and that belong to the table of a test."""


def _place_of_test_key(place: Place, model: type[BaseModel]) -> str:
    """Where a line belongs that was written under another heading; "" for other keys and files."""
    if place[-1] not in _OF_TEST or model.__name__ != "StudyFile":
        return ""
    return f"move the line below [test], or the [[configuration]] of the test: '{place[-1]}' is a key of these tables"


_OF_CHOICES = ("pair", "never_pair", "sensor_off")
"""Tables of a file of choices, which a page saves, that are none of a study."""


def _of_choices(place: Place, model: type[BaseModel]) -> str:
    """What to do with tables of a file of choices that were pasted into a study; "" for other keys and files."""
    if len(place) != 1 or place[0] not in _OF_CHOICES or model.__name__ != "StudyFile":
        return ""
    return f"[[{place[0]}]] belongs to a file of choices: save it as choices.toml and give --choices choices.toml"


def _list_of_tables(place: Place, model: type[BaseModel]) -> bool:
    """True for a key of the whole file whose value is a list of tables."""
    field = _fields(model).get(str(place[0])) if len(place) == 1 else None
    kind = None if field is None else field.annotation
    return get_origin(kind) is tuple and model_in(kind) is not None


def _missing_key(place: Place, source: StudyLines, tables: bool = False) -> FemtuneError:
    if isinstance(place[-1], int):
        hint = f"{source.page} has an example"
        return source.error(place, "study.value/missing-entry", {}, hint=hint, name=_name(place[:-1]))
    key, table = str(place[-1]), _table(place[:-1], source)
    table_lacks = len(place) == 1 and source.whole == StudyLines.whole
    value = (
        '"m-kg-s"  (or "mm-t-s", "in-slinch-s" and others' if key == "units" else f"…  ({source.page} has an example"
    )
    hint = f"add the table [{key}]" if table_lacks else f"add the line  {key} = {value})"
    hint = f"add a table [[{key}]]" if tables else hint
    return source.error(place, "study.missing-key", {}, hint=hint, table=table, key=key)


def _table(place: Place, source: StudyLines) -> str:
    names = [part for part in place if isinstance(part, str)]
    if not names:
        return source.whole
    return f"[[{names[0]}]]" if len(place) == 2 and isinstance(place[1], int) else f"[{'.'.join(names)}]"


def _own(error: FemtuneError, place: Place, value: object, source: StudyLines) -> FemtuneError:
    """An error of a validator, with its place and the wrong value."""
    values = {str(_key(place)): spelled(value), **{k: v for k, v in error.values.items() if k != "rotation"}}
    what = f"{_name(place)}: {error.what}"
    return FemtuneError(error.code, what, where=source.where(place), values=values, hint=error.hint)


def _key(place: Place) -> str:
    return next((part for part in reversed(place) if isinstance(part, str)), "")


def _judgement(finding: ErrorDetails) -> tuple[str, dict[str, Any]]:
    """Code and facts, by the type of the finding."""
    kind, context = finding["type"], finding.get("ctx", {})
    if kind in _WANTED:
        wanted, fix = _WANTED[kind]
        return "study.type", {"wanted": wanted, "hint": fix}
    if kind == "finite_number":
        return "study.number", {}
    if kind == "literal_error":
        return _not_among(finding)
    if kind in ("too_short", "string_too_short"):
        return _too_short(finding, context)
    if kind == "too_long":
        return "study.value/too-long", {"most": context["max_length"], "given": context["actual_length"]}
    if kind == "string_pattern_mismatch":
        return "study.value/characters", {"pattern": _PATTERNS.get(context["pattern"], context["pattern"])}
    return _out_of_range(finding, context)


_PATTERNS = {
    "^[A-Z][A-Z0-9]{0,15}$": 'capitals and digits, beginning with a capital, at most 16 characters: "K1"',
    "^1?2?3?4?5?6?$": 'digits from 1 to 6 in rising order, each at most once: "126"',
    "^[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}$": 'letters, digits, _ . and -, without a folder: "model.bdf"',
}
"""Regular expressions of the tables in words."""


def _too_short(finding: ErrorDetails, context: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    if finding["input"]:
        return "study.value/too-short", {"least": context["min_length"]}
    return "study.value/empty", {}


def _not_among(finding: ErrorDetails) -> tuple[str, dict[str, Any]]:
    expected = finding["ctx"]["expected"]
    words = [word.strip("' ") for word in expected.replace(" or ", ", ").split(", ")]
    close = did_you_mean(finding["input"], words) if isinstance(finding["input"], str) else ""
    return "study.value/choice", {"choices": expected, "hint": close if close.startswith("did") else None}


def _out_of_range(finding: ErrorDetails, context: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    message = finding["msg"].removeprefix("Input ")
    limit = next((words.format(context[key]) for key, words in _LIMITS.items() if key in context), None)
    facts = {"rule": message[:1].lower() + message[1:], "limit": limit or "another value"}
    return "study.value/range", facts


_LIMITS = {"ge": "{} or more", "gt": "more than {}", "le": "{} or less", "lt": "less than {}"}
"""Names of limits in pydantic, and what they allow."""


def _keys(place: Place, finding: ErrorDetails, top: type[BaseModel]) -> tuple[str, ...]:
    """Keys of the table at `place`, from the classes of the tables."""
    tag = finding["loc"][2] if len(finding["loc"]) > 2 else None
    if len(place) == 2 and (kinds := _kinds(place, top)):
        return tuple(kinds[str(tag)].model_fields)
    model: type[BaseModel] | None = top
    for part in place:
        if model is not None and isinstance(part, str):
            field = _fields(model).get(part)
            model = model_in(field.annotation) if field else None
    return tuple(_fields(model)) if model else ()


def _fields(model: type[BaseModel]) -> dict[str, FieldInfo]:
    """Fields by their keys in the file, which may differ from their names in Python."""
    return {field.alias or name: field for name, field in model.model_fields.items()}


def model_in(annotation: object) -> type[BaseModel] | None:
    """The table that is the value of a key, or of the entries of its list."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((model for model in map(model_in, get_args(annotation)) if model), None)
