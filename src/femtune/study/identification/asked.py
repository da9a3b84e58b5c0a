"""What is asked for: an identification file, or a measured file with options."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from femtune.errors import FemtuneError, Where
from femtune.files.identify_file import IdentifyFile, read_identify_file
from femtune.files.study_file.problems import problems
from femtune.files.study_file.source import Source
from femtune.files.uff.function_records import read_header
from femtune.files.uff.scan import scan_uff

_FUNCTIONS = (".uff", ".unv")
_TIME_RESPONSE = 1


def asked_of(path: Path | str, options: Mapping[str, Any]) -> IdentifyFile:
    """An identification file, or one made for a measured file; `options` are keys of [identify] that take precedence.

    Raises
    ------
    FemtuneError : ``study.*`` and ``identify.*`` of the file; ``record.missing``
    """
    path = Path(path)
    given = {key: value for key, value in options.items() if value is not None}
    if path.suffix.lower() == ".toml":
        file = read_identify_file(path)
        table = {**file.identify.model_dump(exclude_none=True), **given}
        changed = _checked({**file.model_dump(exclude_none=True), "identify": table}, path)
        changed._path, changed._source = file._path, file._source
        return changed
    if not path.is_file():
        where = Where(str(path))
        what = "this is a folder, no file" if path.is_dir() else "there is no such file"
        raise FemtuneError("record.missing", what, where=where, hint="name the record, the functions or a .toml file")
    made = _checked({"identify": {_kind_of(path): path.name, **given}}, path)
    made._path, made._source = path, Source(str(path))
    return made


def _checked(data: dict[str, Any], path: Path) -> IdentifyFile:
    try:
        return IdentifyFile.model_validate(data)
    except ValidationError as findings:
        raise problems(findings, Source(str(path), {}, "docs/identify-file.md"), IdentifyFile)[0] from findings


def _kind_of(path: Path) -> str:
    """ "frfs" for a Universal File, unless its functions are records in time."""
    if path.suffix.lower() not in _FUNCTIONS:
        return "record"
    types = [read_header(one).function_type for one in scan_uff(path) if one.number == 58]
    return "record" if types and all(t == _TIME_RESPONSE for t in types) else "frfs"
