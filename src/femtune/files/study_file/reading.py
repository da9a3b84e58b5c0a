"""Read a study file: TOML, then models and rules, then the files that it names; all problems at once."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from femtune.errors import ErrorCollector, FemtuneError, Where
from femtune.files.study_file.kinds import SCHEMA_VERSION
from femtune.files.study_file.problems import problems
from femtune.files.study_file.rules import rules
from femtune.files.study_file.source import Place, StudyLines, line_numbers, table, tables
from femtune.files.study_file.study import Given, StudyFile

_LARGEST = 10_000_000
_DECK_SUFFIXES = (".bdf", ".dat", ".nas", ".fem", ".bulk", ".pch", ".inc", ".blk")
_DECIMAL_COMMA = re.compile(r"=\s*([-+]?\d+,\d+(?:[eE][-+]?\d+)?)\s*(?:#.*)?$")
_BACKSLASH = re.compile(r'"([^"]*\\[^"]*)"')
_PLACE = re.compile(r" \(at (?:line (\d+), column \d+|end of document)\)$")


def is_deck(path: str | Path) -> bool:
    """True for a path that names a deck rather than a study."""
    return Path(path).suffix.lower() in _DECK_SUFFIXES


def read_study_file(path: str | Path) -> StudyFile:
    """The study in a TOML file.

    Raises
    ------
    FemtuneError : ``study.missing-file`` (the study itself, or a deck or test that it names), ``study.syntax``,
        ``study.version``
    FemtuneErrors : all that is wrong with its content at once: ``study.unknown-key``, ``study.missing-key``,
        ``study.type``, ``study.number``, ``study.value``, ``parameter.bounds`` and others of docs/errors
    """
    file = Path(path)
    return study_from_text(toml_text(file), file)


def study_from_text(text: str, path: str | Path) -> StudyFile:
    """As `read_study_file`, from the text of a file at `path` that need not exist."""
    file = Path(path)
    return study_from_data(toml_data(text, file), file, StudyLines(str(file), line_numbers(text)))


def study_from_data(data: dict[str, Any], file: Path, source: StudyLines, given: Given | None = None) -> StudyFile:
    """As `read_study_file`, from the data of a file; what is `given` as objects need not exist as files."""
    check_version(data, source)
    given = given or Given()
    errors: list[FemtuneError] = [*rules(data, source), *_missing_files(data, source, file.parent, given)]
    try:
        study = StudyFile.model_validate(data)
    except ValidationError as findings:
        errors = [*problems(findings, source, StudyFile), *errors]
    _raise_in_order(errors)
    study._path, study._source, study._given = file, source, given
    return study


def check_version(data: dict[str, Any], source: StudyLines) -> None:
    """Refuse a file for a later femtune before its keys are judged (error ``study.version``)."""
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
    if not file.is_file():
        raise FemtuneError("study.missing-file/study", where=where)
    try:
        content = file.read_bytes()
    except OSError as error:
        raise FemtuneError("study.missing-file/unreadable", where=where, reason=error.strerror) from error
    if len(content) > _LARGEST:
        raise FemtuneError("study.syntax/too-large", where=where, megabytes=len(content) // 1000000)
    try:
        return content.decode("utf-8").removeprefix("\ufeff").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        where = Where(str(file), line)
        raise FemtuneError("study.syntax/encoding", where=where) from error


def toml_data(text: str, file: Path) -> dict[str, Any]:
    """What a TOML text holds, lists as tuples (error ``study.syntax``)."""
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


def _each(names: object) -> tuple[object, ...]:
    return names if isinstance(names, tuple) else (names,)


def _named_files(data: dict[str, Any]) -> Iterator[tuple[Place, object, str]]:
    yield ("study", "deck"), table(data, "study").get("deck"), "deck"
    for name in _each(table(data, "test").get("file")):
        yield ("test", "file"), name, "test file"
    for key, what in (("grid", "file of grid points"), ("dofs", "list of DOFs"), ("listing", "list of modes")):
        yield ("model", key), table(data, "model").get(key), what
    names = table(data, "quantify").get("repeats")
    for name in _each(names):
        yield ("quantify", "repeats"), name, "file of repeats"
    for place, entry in tables(data, "matrix"):
        yield (*place, "file"), entry.get("file"), "file of a matrix"
    for place, entry in tables(data, "configuration"):
        for name in _each(entry.get("test")):
            yield (*place, "test"), name, "test file"
        yield (*place, "masses_file"), entry.get("masses_file"), "table of masses"
    for place, entry in tables(data, "parameter"):
        yield (*place, "prior"), entry.get("prior"), "catalogue of damping"


def _missing_files(data: dict[str, Any], source: StudyLines, folder: Path, given: Given) -> Iterator[FemtuneError]:
    for place, name, what in _named_files(data):
        of_model = given.model is not None and place[0] in ("study", "matrix")
        if of_model or (isinstance(name, str) and name in given.tests):
            continue
        if isinstance(name, str) and name and not _is_file(folder / name):
            values = {str(place[-1]): name, "looked for": os.path.abspath(folder / name)}
            there = os.path.exists(folder / name)
            code = "study.missing-file/not-a-file" if there else "study.missing-file/named"
            # "C:\temp" has a tabulator in TOML
            code = "study.missing-file/escaped" if any(c in name for c in "\t\n\r\b\f\x1b") else code
            yield source.error(place, code, values, file_kind=what)


def _is_file(path: Path) -> bool:
    """False also for a name that no file can have."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _raise_in_order(errors: list[FemtuneError]) -> None:
    """Raise all, sorted by line."""
    ordered = sorted(errors, key=lambda error: (error.where and error.where.line) or 0)
    ErrorCollector(ordered).raise_if_any()
