"""Choices of poles that a person saved on the page of an identification (choices.toml)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pydantic import Field, ValidationError

from femtune.errors import FemtuneError, Where
from femtune.files.identification_file import PAGE
from femtune.files.study_file.choices import ChosenInput
from femtune.files.study_file.kinds import Positive, SchemaVersion, TomlTable
from femtune.files.study_file.problems import problems
from femtune.files.study_file.reading import check_version, toml_data, toml_text
from femtune.files.study_file.source import StudyLines, line_numbers
from femtune.files.whole_file import digest_of
from femtune.identification.choice import PickedPole
from femtune.identification.kinds import MethodWord

if TYPE_CHECKING:
    from femtune.files.identification_file import IdentifyFile


class ChosenMode(TomlTable):
    """[[mode]]: a pole of the stabilisation diagram."""

    name: str = ""
    """Name of the mode. Default: its number."""
    method: MethodWord
    """Method that found the pole."""
    order: Annotated[int, Field(ge=1, le=1000)]
    """Model order at which it was found."""
    freq_hz: Positive
    """Its frequency, Hz."""
    damping_ratio: Annotated[float, Field(ge=-1.0, le=1.0)]
    """Its damping ratio."""
    fit_only: bool = False
    """True for a pole that the fit of the functions starts with, which is no mode."""


class ChoicesFile(TomlTable):
    """The whole file."""

    schema_version: SchemaVersion = 1
    """Version of the file."""
    input: Annotated[tuple[ChosenInput, ...], Field(min_length=1)]
    mode: Annotated[tuple[ChosenMode, ...], Field(min_length=1)]


def read_choices(path: Path, measured: Sequence[Path]) -> tuple[PickedPole, ...]:
    """The picked poles, for the measured files that they were picked from.

    Raises
    ------
    FemtuneError : ``study.*`` for a file that cannot be read; ``identify.choices`` where the measured files are not
        those of the choice, or have changed; ``identify.choices/names`` for two modes of one name
    """
    text = toml_text(path)
    data, source = toml_data(text, path), StudyLines(str(path), line_numbers(text), PAGE, "the choices file")
    check_version(data, source)
    try:
        choices = ChoicesFile.model_validate(data)
    except ValidationError as findings:
        raise problems(findings, source, ChoicesFile)[0] from findings
    where = Where(str(path))
    then = [one.sha256 for one in choices.input]
    changed = [file.name for i, file in enumerate(measured) if then[i : i + 1] != [digest_of(file)]]
    if changed or len(then) > len(measured):
        shown = {"chosen from": ", ".join(one.path for one in choices.input), "changed": ", ".join(changed)}
        raise FemtuneError("identify.choices", where=where, values=shown)
    names = [one.name for one in choices.mode if one.name]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise FemtuneError("identify.choices/names", where=where, name=twice)
    return tuple(PickedPole(**one.model_dump()) for one in choices.mode)


def picked_poles(file: IdentifyFile) -> tuple[PickedPole, ...]:
    """Those of the file that `choices` names; () without it (errors of `read_choices`, ``identify.choices``)."""
    if file.choices_path is None:
        return ()
    table = file.identify
    others = [
        key for key, used in (("take_hz", table.take_hz), ("drop_hz", table.drop_hz), ("setup", file.setup)) if used
    ]
    others += ["fragments"] * (table.fragments > 1)
    if others:
        where = file.where("identify", "choices")
        raise FemtuneError("identify.choices/with-others", where=where, values={"keys": ", ".join(others)})
    return read_choices(file.choices_path, file.measured_paths)
