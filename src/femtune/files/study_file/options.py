"""[response], [plan], [screen], [search], [modes] and [correlate] with keys replaced by options of a call."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from femtune.errors import ErrorCollector, FemtuneError, Where
from femtune.files.study_file.experiments import experiment_rules
from femtune.files.study_file.plan import plan_rules
from femtune.files.study_file.problems import problems
from femtune.files.study_file.python_table import plain
from femtune.files.study_file.response import response_rules
from femtune.files.study_file.source import Place, StudyLines
from femtune.files.study_file.study import StudyFile

_OPTIONS = "option or argument"
"""What errors name in place of a file."""
_EXCLUSIVE = (("step_hz", "lines"), ("modes", "max_hz"), ("ratio", "ratios"))
"""Pairs of keys that exclude each other: an option replaces the other key of its pair, too."""


def with_response(file: StudyFile, options: Mapping[str, Any]) -> StudyFile:
    """The study with keys of [response] replaced by `options`; those that are None stay as they are.

    Raises
    ------
    FemtuneError : as for a file, with the place "option or argument"
    """
    given = {key: plain(value) for key, value in options.items() if value is not None}
    if not given:
        return file
    known = {} if file.response is None else file.response.model_dump(exclude_unset=True)
    for one, other in _EXCLUSIVE:
        for key, rival in ((one, other), (other, one)):
            if key in given and rival not in given:
                known.pop(rival, None)
    copy = file.model_copy(update={"response": _checked(file, {**known, **given})})
    # messages about an option must not point to the replaced line of the study
    lines = {place: line for place, line in file._source.lines.items() if not _replaced(place, given)}
    copy._source = StudyLines(file._source.file, lines)
    return copy


def with_modes(file: StudyFile, count: int | None, max_hz: float | None) -> StudyFile:
    """The study with another number of modes, or another upper frequency, instead of its [modes].

    Raises
    ------
    FemtuneError : ``study.*`` as for a file, with the place "option or argument"; ``study.modes-both``
    """
    given = {key: plain(value) for key, value in (("count", count), ("max_hz", max_hz)) if value is not None}
    if not given:
        return file
    if len(given) > 1:
        raise FemtuneError("study.modes-both", where=Where(_OPTIONS), values=given)  # fmt: skip
    study = file.study.model_dump(exclude_unset=True)
    try:
        modes = StudyFile.model_validate({"study": study, "modes": given}).modes
    except ValidationError as findings:
        errors = problems(findings, StudyLines(_OPTIONS), StudyFile)
        ErrorCollector(list(errors)).raise_if_any()
        raise
    return file.model_copy(update={"modes": modes})


def with_expansion(file: StudyFile, method: str | None) -> StudyFile:
    """The study with another expansion of the test shapes instead of that of its [correlate].

    Raises
    ------
    FemtuneError : ``study.value`` with the place "option or argument"
    """
    if method is None:
        return file
    study, known = file.study.model_dump(exclude_unset=True), file.correlate.model_dump(exclude_unset=True)
    try:
        checked = StudyFile.model_validate({"study": study, "correlate": {**known, "expand": method}})
    except ValidationError as findings:
        ErrorCollector(list(problems(findings, StudyLines(_OPTIONS), StudyFile))).raise_if_any()
        raise
    return file.model_copy(update={"correlate": checked.correlate})


def with_plan(file: StudyFile, options: Mapping[str, Any]) -> StudyFile:
    """The study with keys of [plan] replaced by `options`; those that are None stay as they are.

    Raises
    ------
    FemtuneError : as for a file, with the place "option or argument"
    """
    given = {key: plain(value) for key, value in options.items() if value is not None}
    known = {} if file.plan is None else plain(file.plan)
    for one, other in (("modes", "band_hz"), ("band_hz", "modes")):
        if one in given and other not in given:
            known.pop(other, None)
    source = StudyLines(_OPTIONS)
    plan = {**known, **given}
    errors: list[FemtuneError] = list(plan_rules({"plan": plan}, source))
    try:
        checked = StudyFile.model_validate({"study": file.study.model_dump(exclude_unset=True), "plan": plan})
    except ValidationError as findings:
        errors = [*problems(findings, source, StudyFile), *errors]
    ErrorCollector(errors).raise_if_any()
    copy = file.model_copy(update={"plan": checked.plan})
    lines = {place: line for place, line in file._source.lines.items() if not _replaced(place, given, "plan")}
    copy._source = StudyLines(file._source.file, lines)
    return copy


def with_screen(file: StudyFile, options: Mapping[str, Any]) -> StudyFile:
    """The study with keys of [screen] replaced by `options`; with an empty table if it has none (errors as for a file).

    A design that is given without levels has its own default.
    """
    known = {} if file.screen is None else plain(file.screen)
    if options.get("design") is not None:
        known = {key: value for key, value in known.items() if key == "configuration"}
    return _with_experiment(file, "screen", known, options)


def with_search(file: StudyFile, options: Mapping[str, Any]) -> StudyFile:
    """The study with keys of [search] replaced by `options`; an empty table if it has none (errors as for a file)."""
    return _with_experiment(file, "search", {} if file.search is None else plain(file.search), options)


def _with_experiment(file: StudyFile, name: str, known: dict[str, Any], options: Mapping[str, Any]) -> StudyFile:
    given = {**known, **{key: plain(value) for key, value in options.items() if value is not None}}
    source = StudyLines(_OPTIONS)
    errors: list[FemtuneError] = list(experiment_rules({name: given}, source))
    try:
        checked = StudyFile.model_validate({"study": file.study.model_dump(exclude_unset=True), name: given})
    except ValidationError as findings:
        errors = [*problems(findings, source, StudyFile), *errors]
    ErrorCollector(errors).raise_if_any()
    return file.model_copy(update={name: getattr(checked, name)})


def _replaced(place: Place, given: Mapping[str, Any], name: str = "response") -> bool:
    return place[:1] == (name,) and len(place) > 1 and place[1] in given


def _checked(file: StudyFile, response: dict[str, Any]) -> Any:
    source = StudyLines(_OPTIONS)
    errors: list[FemtuneError] = list(response_rules({"response": response}, source))
    study = file.study.model_dump(exclude_unset=True)
    try:
        checked = StudyFile.model_validate({"study": study, "response": response})
    except ValidationError as findings:
        errors = [*problems(findings, source, StudyFile), *errors]
    ErrorCollector(errors).raise_if_any()
    return checked.response
