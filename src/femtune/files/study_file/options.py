"""[response], [plan], [screen], [search], [modes] and [correlate] with keys replaced by options of a call."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from pydantic import ValidationError

from femtune.errors import ErrorCollector, FemtuneError, Where
from femtune.files.study_file.plan import plan_rules
from femtune.files.study_file.problems import problems
from femtune.files.study_file.python_table import plain
from femtune.files.study_file.respond import response_rules
from femtune.files.study_file.screen import screen_rules
from femtune.files.study_file.search import search_rules
from femtune.files.study_file.source import Data, Problems, StudyLines
from femtune.files.study_file.study import StudyFile

_OPTIONS = "option or argument"
"""What errors name in place of a file."""
_EXCLUSIVE = {
    "response": (("step_hz", "lines"), ("modes", "max_hz"), ("ratio", "ratios")),
    "plan": (("modes", "band_hz"),),
}
"""Pairs of keys of a table that exclude each other: an option replaces the other key of its pair, too."""
_RULES: dict[str, Callable[[Data, StudyLines], Problems]] = {
    "response": response_rules,
    "plan": plan_rules,
    "screen": screen_rules,
    "search": search_rules,
}
"""Rules between the keys of a table."""


def with_response(file: StudyFile, options: Mapping[str, Any]) -> StudyFile:
    """The study with keys of [response] replaced by `options`; those that are None stay as they are.

    Raises
    ------
    FemtuneError : as for a file, with the place "option or argument"
    """
    if all(value is None for value in options.values()):
        return file
    known = {} if file.response is None else file.response.model_dump(exclude_unset=True)
    return _with_table(file, "response", known, options)


def with_modes(file: StudyFile, count: int | None, max_hz: float | None) -> StudyFile:
    """The study with another number of modes, or another upper frequency, instead of its [modes].

    Raises
    ------
    FemtuneError : ``study.*`` as for a file, with the place "option or argument"; ``study.modes-both``
    """
    if count is None and max_hz is None:
        return file
    if count is not None and max_hz is not None:
        values = {"count": plain(count), "max_hz": plain(max_hz)}
        raise FemtuneError("study.modes-both", where=Where(_OPTIONS), values=values)
    return _with_table(file, "modes", {}, {"count": count, "max_hz": max_hz})


def with_expansion(file: StudyFile, method: str | None) -> StudyFile:
    """The study with another expansion of the test shapes instead of that of its [correlate].

    Raises
    ------
    FemtuneError : ``study.value`` with the place "option or argument"
    """
    if method is None:
        return file
    return _with_table(file, "correlate", file.correlate.model_dump(exclude_unset=True), {"expand": method})


def with_plan(file: StudyFile, options: Mapping[str, Any]) -> StudyFile:
    """The study with keys of [plan] replaced by `options`; those that are None stay as they are.

    Raises
    ------
    FemtuneError : as for a file, with the place "option or argument"
    """
    return _with_table(file, "plan", {} if file.plan is None else plain(file.plan), options)


def with_screen(file: StudyFile, options: Mapping[str, Any]) -> StudyFile:
    """The study with keys of [screen] replaced by `options`; with an empty table if it has none (errors as for a file).

    A design that is given without levels has its own default.
    """
    known = {} if file.screen is None else plain(file.screen)
    if options.get("design") is not None:
        known = {key: value for key, value in known.items() if key == "configuration"}
    return _with_table(file, "screen", known, options)


def with_search(file: StudyFile, options: Mapping[str, Any]) -> StudyFile:
    """The study with keys of [search] replaced by `options`; an empty table if it has none (errors as for a file)."""
    return _with_table(file, "search", {} if file.search is None else plain(file.search), options)


def _with_table(file: StudyFile, name: str, known: dict[str, Any], options: Mapping[str, Any]) -> StudyFile:
    """The study with a table that has the `known` keys and those `options` that are not None, checked as in a file."""
    given = {key: plain(value) for key, value in options.items() if value is not None}
    for pair in _EXCLUSIVE.get(name, ()):
        for key, rival in (pair, pair[::-1]):
            if key in given and rival not in given:
                known.pop(rival, None)
    data, source = {name: {**known, **given}}, StudyLines(_OPTIONS)
    errors = list(_RULES[name](data, source)) if name in _RULES else []
    try:
        checked = StudyFile.model_validate({"study": file.study.model_dump(exclude_unset=True), **data})
    except ValidationError as findings:
        errors = [*problems(findings, source, StudyFile), *errors]
    ErrorCollector(errors).raise_if_any()
    copy = file.model_copy(update={name: getattr(checked, name)})
    # messages about an option must not point to the replaced line of the study
    lines = {
        place: line
        for place, line in file._source.lines.items()
        if not (place[:1] == (name,) and len(place) > 1 and place[1] in given)
    }
    copy._source = StudyLines(file._source.file, lines)
    return copy
