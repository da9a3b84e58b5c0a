"""Choices that a reader made on the page of a report (choices.toml), and the study with them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, ValidationError

from femtune.errors import ErrorCollector, FemtuneError, Where, did_you_mean
from femtune.files.study_file.kinds import DofLabel, FieldText, Hertz, Positive, SchemaVersion, Text, TomlTable
from femtune.files.study_file.problems import problems
from femtune.files.study_file.source import Data, StudyLines, line_numbers
from femtune.files.whole_file import digest_of
from femtune.model.kinds import BASELINE

if TYPE_CHECKING:
    from femtune.files.study_file.named_files import FileKey


class ChosenInput(TomlTable):
    """[[input]]: a file that was read, as it was when the choices were made."""

    path: Text
    """Name of the file; in a report relative to the study."""
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    """SHA-256 of its bytes."""


class _OfConfiguration(TomlTable):
    configuration: Text = BASELINE
    """Name of the configuration. Default: that of a study with one test."""


class ChosenPair(_OfConfiguration):
    """[[pair]] and [[never_pair]]: a test mode and a model mode that are, or are not, a pair."""

    test: Text
    """Label of the test mode."""
    model: Annotated[int, Field(ge=1)]
    """Number of the model mode at the initial values, from 1."""
    model_hz: Hertz | None = None
    """Its frequency there, Hz, by which a mode that has another number by now is noticed."""

    @property
    def entry(self) -> dict[str, Any]:
        """As `pairs` and `never_pairs` of a study have it."""
        return self.model_dump(exclude={"configuration"}, exclude_none=True)

    def is_of(self, pair: Data) -> bool:
        """Whether a pair of a study is of the same two modes."""
        return (pair.get("test"), pair.get("model")) == (self.test, self.model)


class ChosenOmission(_OfConfiguration):
    """[[leave_out]]: a test mode that is not compared."""

    mode: Text
    """Label of the test mode."""
    reason: Text
    """The reason; listed in the report."""


class ChosenSensor(_OfConfiguration):
    """[[sensor_off]]: a degree of freedom of the test modes that is not compared."""

    sensor: DofLabel
    """Its label."""


class ChosenParameter(TomlTable):
    """[[parameter]]: a field of the deck, or several with one factor, that become a parameter."""

    name: Text
    """Name of the parameter."""
    field: FieldText
    """Field of the deck."""
    further_fields: tuple[FieldText, ...] = ()
    """Fields that have the same factor."""
    lower: Positive
    """Lower bound of the factor on it."""
    upper: Positive
    """Upper bound of the factor on it."""

    @property
    def fields(self) -> tuple[str, ...]:
        """All its fields."""
        return (self.field, *self.further_fields)


class StudyChoices(TomlTable):
    """The whole file."""

    schema_version: SchemaVersion = 1
    """Version of the file."""
    input: Annotated[tuple[ChosenInput, ...], Field(min_length=1)]
    pair: tuple[ChosenPair, ...] = ()
    never_pair: tuple[ChosenPair, ...] = ()
    leave_out: tuple[ChosenOmission, ...] = ()
    sensor_off: tuple[ChosenSensor, ...] = ()
    parameter: tuple[ChosenParameter, ...] = ()


def parsed_choices(path: Path, data: Data, text: str) -> StudyChoices:
    """The content of a file of choices (errors ``study.*`` with its lines; ``study.choices/poles``)."""
    if "mode" in data and "pair" not in data:
        raise FemtuneError("study.choices/poles", where=Where(str(path)))
    source = StudyLines(str(path), line_numbers(text), "docs/guide/report.md", "the file of choices")
    try:
        return StudyChoices.model_validate(data)
    except ValidationError as findings:
        raise problems(findings, source, StudyChoices)[0] from findings


def _digest_now(path: Path) -> str:
    """SHA-256 of a file; "" where there is none."""
    try:
        return digest_of(path)
    except (OSError, ValueError):
        return ""


def _listed(names: Iterable[str]) -> str:
    """ "a, b and c"."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


_SHOWN_DIGITS = 12
"""Digits of a digest in a message: enough to compare by eye."""


def check_inputs(choices: StudyChoices, where: Where, folder: Path, named: Iterable[FileKey]) -> None:
    """Refuse choices that were made of other files than those of the study.

    Parameters
    ----------
    folder : of the study, to which the names of the files are relative
    named : deck and tests of the study

    Raises
    ------
    FemtuneError : ``study.choices`` for files that have changed or are gone, ``study.choices/other-input`` for a deck
        or a test of the study that the choices were not made of
    """
    changed = {}
    for one in choices.input:
        now = _digest_now(folder / one.path)
        if now != one.sha256:
            then = f"SHA-256 {one.sha256[:_SHOWN_DIGITS]}… then"
            changed[one.path] = f"{then}, {now[:_SHOWN_DIGITS]}… now" if now else f"{then}, the file is not there now"
    if changed:
        raise FemtuneError("study.choices", where=where, values=changed, files=_listed(changed))
    known = {os.path.realpath(folder / one.path) for one in choices.input}
    for key in named:
        path = folder / key.name
        if path.is_file() and os.path.realpath(path) not in known:
            values = {"chosen from": ", ".join(one.path for one in choices.input)}
            raise FemtuneError("study.choices/other-input", where=where, values=values, file=key.name)


def check_contents(choices: StudyChoices, where: Where, files: Iterable[Path]) -> None:
    """As `check_inputs`, by the contents of files alone, wherever they are (error ``study.choices/other-input``)."""
    known = {one.sha256 for one in choices.input}
    for path in files:
        now = _digest_now(path)
        if now not in known:
            values = {one.path: f"SHA-256 {one.sha256[:_SHOWN_DIGITS]}… then" for one in choices.input}
            values[path.name] = f"{now[:_SHOWN_DIGITS]}… now"
            raise FemtuneError("study.choices/other-input", where=where, values=values, file=path.name)


def with_choices(data: Data, choices: StudyChoices, where: Where) -> dict[str, Any]:
    """The data of a study with choices: an entry of the same test mode, sensor or field is replaced.

    Raises
    ------
    FemtuneErrors : ``study.choices/configuration`` for a configuration that the study does not have,
        ``study.choices/parameter`` for a name that another parameter has
    """
    merged = dict(data)
    entries = {str(e.get("name")): dict(e) for e in merged.get("configuration", ()) if isinstance(e, dict)}
    if not entries and isinstance(merged.get("test"), dict):
        entries = {BASELINE: dict(merged["test"])}
    errors = ErrorCollector()
    for one in (*choices.pair, *choices.never_pair, *choices.leave_out, *choices.sensor_off):
        if one.configuration not in entries:
            with errors.catch():
                hint = did_you_mean(one.configuration, entries) or "make the choices again on the page of a new report"
                raise FemtuneError("study.choices/configuration", where=where, hint=hint, name=one.configuration)
    errors.raise_if_any()
    _with_modes(choices, entries)
    if "configuration" in merged:
        merged["configuration"] = tuple(
            entries.get(str(e.get("name")), e) if isinstance(e, dict) else e for e in merged["configuration"]
        )
    elif entries:
        merged["test"] = entries[BASELINE]
    known = tuple(merged.get("parameter", ()))
    merged["parameter"] = (*known, *_new_parameters(choices, known, where))
    if not merged["parameter"]:
        del merged["parameter"]
    return merged


def _with_modes(choices: StudyChoices, entries: dict[str, dict[str, Any]]) -> None:
    """Set pairs, omissions and sensors in place."""
    for pair in choices.pair:
        entry, test, model = entries[pair.configuration], pair.test, pair.model
        _keep(entry, "pairs", lambda p, test=test, model=model: p.get("test") != test and p.get("model") != model)
        _keep(entry, "leave_out", lambda one, test=test: one.get("mode") != test)
        _keep(entry, "never_pairs", lambda p, pair=pair: not pair.is_of(p))
        _add(entry, "pairs", pair.entry)
    for pair in choices.never_pair:
        entry = entries[pair.configuration]
        for key in ("pairs", "never_pairs"):
            _keep(entry, key, lambda p, pair=pair: not pair.is_of(p))
        _add(entry, "never_pairs", pair.entry)
    for omission in choices.leave_out:
        entry, mode = entries[omission.configuration], omission.mode
        _keep(entry, "pairs", lambda p, mode=mode: p.get("test") != mode)
        _keep(entry, "leave_out", lambda one, mode=mode: one.get("mode") != mode)
        _add(entry, "leave_out", {"mode": mode, "reason": omission.reason})
    for off in choices.sensor_off:
        entry, sensor = entries[off.configuration], off.sensor
        _keep(entry, "sensors_off", lambda label, sensor=sensor: label != sensor)
        _add(entry, "sensors_off", sensor)


def _keep(entry: dict[str, Any], key: str, kept: Callable[..., bool]) -> None:
    """Only the entries of a list for which `kept` holds; what is no list of tables is left to the types."""
    known = entry.get(key, ())
    if isinstance(known, tuple | list):
        entry[key] = tuple(one for one in known if not isinstance(one, dict | str) or kept(one))
        if not entry[key]:
            del entry[key]


def _add(entry: dict[str, Any], key: str, value: object) -> None:
    entry[key] = (*entry.get(key, ()), value)


def _new_parameters(choices: StudyChoices, known: tuple[Any, ...], where: Where) -> Iterator[dict[str, Any]]:
    """Tables of the fields that are no parameters of the study yet."""
    of_study = [p for p in known if isinstance(p, dict)]
    fields = {" ".join(str(f).split()) for p in of_study for f in p.get("fields", ())}
    names = {p.get("name") for p in of_study}
    for one in choices.parameter:
        if {" ".join(field.split()) for field in one.fields} <= fields:
            continue
        if one.name in names:
            raise FemtuneError("study.choices/parameter", where=where, name=one.name, field=one.field)
        yield {"name": one.name, "fields": one.fields, "lower": one.lower, "upper": one.upper}
