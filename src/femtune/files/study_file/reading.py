"""Read a study file: TOML, then types and rules, then the files that it names; all errors together."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from femtune.errors import ErrorCollector, FemtuneError, Where
from femtune.files.nastran.recognition import is_input
from femtune.files.study_file.choices import StudyChoices, check_inputs, parsed_choices, with_choices
from femtune.files.study_file.kinds import SCHEMA_VERSION
from femtune.files.study_file.named_files import files_named
from femtune.files.study_file.problems import problems
from femtune.files.study_file.rules import rules
from femtune.files.study_file.source import StudyLines, line_numbers
from femtune.files.study_file.study import Given, StudyFile

_LARGEST_FILE = 10_000_000
"""Bytes of a study file: a larger file is something else, such as a deck or a test."""
_DECK_SUFFIXES = (".bdf", ".dat", ".nas", ".fem", ".bulk", ".pch", ".inc", ".blk")
"""Suffixes of paths that are decks rather than studies."""
_OTHER_SUFFIXES = (".toml", ".f06", ".op2", ".op4", ".uff", ".unv", ".csv", ".json")
"""Suffixes of files that are not decks, although a listing repeats its deck."""
_DECIMAL_COMMA = re.compile(r"=\s*([-+]?\d+,\d+(?:[eE][-+]?\d+)?)\s*(?:#.*)?$")
"""A number with a decimal comma, a common error of syntax."""
_BACKSLASH = re.compile(r'"([^"]*\\[^"]*)"')
"""A Windows path in double quotes, another one."""
_PLACE = re.compile(r" \(at (?:line (\d+), column \d+|end of document)\)$")
"""Line in a message of tomllib."""


def is_deck(path: str | Path) -> bool:
    """True for a path that names a deck rather than a study, by its suffix, or else by its content."""
    suffix = Path(path).suffix.lower()
    return suffix in _DECK_SUFFIXES or (suffix not in _OTHER_SUFFIXES and is_input(path))


def read_study_file(path: str | Path) -> StudyFile:
    """The study in a TOML file.

    Raises
    ------
    FemtuneError : ``study.missing-file`` (the study itself, or a deck or test that it names), ``study.syntax``,
        ``study.version``
    FemtuneErrors : all errors in its content together: ``study.unknown-key``, ``study.missing-key``,
        ``study.type``, ``study.number``, ``study.value``, ``parameter.bounds`` and others of docs/errors
    """
    file = Path(path)
    return study_from_text(toml_text(file), file)


def study_from_text(text: str, path: str | Path) -> StudyFile:
    """As `read_study_file`, from the text of a file at `path` that need not exist."""
    file = Path(path)
    return study_from_data(toml_data(text, file), file, StudyLines(str(file), line_numbers(text)))


def study_from_data(data: dict[str, Any], file: Path, source: StudyLines, given: Given | None = None) -> StudyFile:
    """As `read_study_file`, from the data of a file; files that are `given` as objects need not exist."""
    check_version(data, source)
    given = given or Given()
    data = _chosen(data, source, file.parent)
    errors: list[FemtuneError] = [*rules(data, source), *missing_files(StudyFile, data, source, file.parent, given)]
    try:
        study = StudyFile.model_validate(data)
    except ValidationError as findings:
        errors = [*problems(findings, source, StudyFile), *errors]
    _raise_in_order(errors)
    study._path, study._source, study._given = file, source, given
    return study


def _chosen(data: dict[str, Any], source: StudyLines, folder: Path) -> dict[str, Any]:
    """The data with the choices of the file that [study] names; a file that is not there is told by its key."""
    table = data.get("study")
    name = table.get("choices") if isinstance(table, dict) else None
    if not isinstance(name, str) or not is_file(folder / name):
        return data
    choices, where = read_study_choices(folder / name), source.where(("study", "choices"))
    check_inputs(choices, where, folder, [k for k in files_named(StudyFile, data) if k.kind.what in _OF_CHOICES])
    return with_choices(data, choices, where)


_OF_CHOICES = ("deck", "test file")
"""Files that choices are made of, beside those that these name in turn."""


def read_study_choices(path: Path) -> StudyChoices:
    """The choices in a file (errors ``study.*``)."""
    text = toml_text(path)
    data = toml_data(text, path)
    check_version(data, StudyLines(str(path), line_numbers(text)))
    return parsed_choices(path, data, text)


def check_version(data: dict[str, Any], source: StudyLines) -> None:
    """Refuse a file for a later femtune before its keys are checked (error ``study.version``)."""
    version = data.get("schema_version")
    if isinstance(version, str) and version.strip().isdecimal():
        raise source.error(
            ("schema_version",), "study.version/text", {"schema_version": version}, number=version.strip()
        )
    if isinstance(version, int) and version > SCHEMA_VERSION:
        values = {"schema_version": version}
        raise source.error(("schema_version",), "study.version", values, supported=SCHEMA_VERSION)


def toml_text(file: Path) -> str:
    """The text of a TOML file (errors ``study.missing-file``, ``study.syntax``)."""
    where = Where(str(file))
    try:
        # a folder that must not be looked into raises an error
        if not file.is_file():
            raise FemtuneError("study.missing-file/study", where=where)
        content = file.read_bytes()
    except OSError as error:
        raise FemtuneError("study.missing-file/unreadable", where=where, reason=error.strerror) from error
    if len(content) > _LARGEST_FILE:
        raise FemtuneError("study.syntax/too-large", where=where, megabytes=len(content) // 1000000)
    try:
        return content.decode("utf-8").removeprefix("\ufeff").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        where = Where(str(file), line)
        raise FemtuneError("study.syntax/encoding", where=where) from error


def toml_data(text: str, file: Path) -> dict[str, Any]:
    """The content of a TOML text, with lists as tuples (error ``study.syntax``)."""
    return {key: frozen(value) for key, value in _parsed(text, file).items()}


def _parsed(text: str, file: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        message = "brackets are nested too deeply" if isinstance(error, RecursionError) else str(error)
        match = _PLACE.search(message)
        line = int(match[1]) if match and match[1] else text.count("\n") + 1 if match else None
        written = text.split("\n")[line - 1] if line and line <= text.count("\n") + 1 else ""
        where = Where(str(file), line)
        if comma := _DECIMAL_COMMA.search(written):
            fixed = comma[1].replace(",", ".")
            raise FemtuneError("study.syntax/decimal-comma", where=where, written=comma[1], fixed=fixed) from error
        if path := _BACKSLASH.search(written):
            fixed = path[1].replace("\\", "/")
            raise FemtuneError("study.syntax/backslash", where=where, fixed=fixed) from error
        raise FemtuneError("study.syntax/not-toml", where=where, reason=_PLACE.sub("", message)) from error


def frozen(value: Any) -> Any:
    """Lists become tuples: a study is frozen."""
    if isinstance(value, dict):
        return {key: frozen(entry) for key, entry in value.items()}
    return tuple(map(frozen, value)) if isinstance(value, list | tuple) else value


def missing_files(
    model: type[BaseModel],
    data: dict[str, Any],
    source: StudyLines,
    folder: Path,
    given: Given | None = None,
    *,
    absent: bool = True,
) -> Iterator[FemtuneError]:
    """An error for each named file that does not exist, or is a folder, a pipe or a device.

    Parameters
    ----------
    model, data : of `files_named`
    source, folder : of the file that names them
    given : objects that take the place of files
    absent : also for files that are not there
    """
    given = given or Given()
    for key in files_named(model, data):
        of_model = given.model is not None and key.place[0] in ("study", "matrix", "runs")
        if not key.kind.needed or of_model or key.name in given.names or is_file(folder / key.name):
            continue
        values = {str(key.place[-1]): key.name, "looked for": os.path.abspath(folder / key.name)}
        there = exists(folder / key.name)
        if not there and not absent:
            continue
        code = "study.missing-file/not-a-file" if there else "study.missing-file/named"
        # "C:\temp" contains a tab in TOML
        code = "study.missing-file/escaped" if any(c in key.name for c in "\t\n\r\b\f\x1b") else code
        yield source.error(key.place, code, values, file_kind=key.kind.what)


def is_file(path: Path) -> bool:
    """False also for a name that no file can have."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def exists(path: Path) -> bool:
    """False also for a name that no file can have."""
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def _raise_in_order(errors: list[FemtuneError]) -> None:
    """Raise all, sorted by line."""
    ordered = sorted(errors, key=lambda error: (error.where and error.where.line) or 0)
    ErrorCollector(ordered).raise_if_any()
