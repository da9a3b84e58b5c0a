"""Rules that concern several keys of a study file.

They look at the plain data and not at the checked models, so that a misspelt key elsewhere does not hide them;
what has the wrong type is left to the models.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from femtune.errors import FemtuneError, did_you_mean
from femtune.files.study_file.derived import derived_rules
from femtune.files.study_file.generic import generic_rules
from femtune.files.study_file.lines import Place
from femtune.files.study_file.matrices import matrix_rules
from femtune.files.study_file.parameter_rules import parameter_rules
from femtune.files.study_file.plain import named_twice, table, tables, texts
from femtune.files.study_file.residual_rules import residual_rules
from femtune.files.study_file.response_rules import response_rules
from femtune.files.study_file.source import Source
from femtune.files.study_file.stage_rules import stage_rules
from femtune.files.study_file.update_rules import update_rules
from femtune.files.study_file.validation_rules import validation_rules

Data = dict[str, Any]
Problems = Iterator[FemtuneError]

_ABOUT_THE_TEST = ("records", "test_units", "mode_labels", "rotation", "origin", "leave_out", "pairs")


def rules(data: Data, source: Source) -> Problems:
    """All breaches of rules between keys."""
    yield from matrix_rules(data, source)
    yield from _modes(data, source)
    yield from _configurations(data, source)
    yield from _sensors(data, source)
    yield from parameter_rules(data, source)
    yield from generic_rules(data, source)
    yield from derived_rules(data, source)
    yield from residual_rules(data, source)
    yield from update_rules(data, source)
    yield from response_rules(data, source)
    yield from stage_rules(data, source)
    yield from validation_rules(data, source)


def _modes(data: Data, source: Source) -> Problems:
    modes = table(data, "modes")
    if "count" in modes and "max_hz" in modes:
        hint = "keep count (that many modes) or max_hz (all modes up to it)"
        yield source.error(("modes", "max_hz"), "study.modes", "[modes] has both count and max_hz", modes, hint)


def _configurations(data: Data, source: Source) -> Problems:
    entries = list(tables(data, "configuration"))
    yield from named_twice(entries, "study.duplicate-name", source)
    if entries and "test" in data:
        hint = "write test = … into each [[configuration]], and remove [test]"
        what = "[test] is for studies without [[configuration]]"
        yield source.error(("test",), "study.test-unused", what, {}, hint)
    for place, entry in entries:
        yield from _without_test(place, entry, source)
        yield from _test_modes(place, entry, source)
    yield from _test_modes(("test",), table(data, "test"), source)


def _without_test(place: Place, entry: Data, source: Source) -> Problems:
    for key in _ABOUT_THE_TEST:
        if key in entry and "test" not in entry:
            what = f"'{key}' speaks of a test, but this configuration has none"
            yield source.error((*place, key), "study.no-test", what, {}, 'add test = "…", or remove the key')


def _test_modes(place: Place, entry: Data, source: Source) -> Problems:
    labels = texts(entry.get("mode_labels"))
    for label in sorted({label for label in labels if labels.count(label) > 1}):
        yield source.error(
            (*place, "mode_labels"), "study.duplicate-name", f"two modes are called '{label}'", {}, "rename one"
        )
    for at, left in tables(entry, "leave_out"):
        if ("mode" in left) == ("hz" in left):
            what = "a mode is left out by its label (mode) or by its frequency (hz), one of the two"
            yield source.error((*place, *at), "study.leave-out", what, {"leave_out": left}, 'write mode = "…"')
        yield from _known_label((*place, *at, "mode"), left.get("mode"), labels, source)
    for at, pair in tables(entry, "pairs"):
        yield from _known_label((*place, *at, "test"), pair.get("test"), labels, source)


def _known_label(place: Place, label: object, labels: list[str], source: Source) -> Problems:
    if labels and isinstance(label, str) and label not in labels:
        what = f"'{label}' is not in mode_labels"
        yield source.error(place, "study.unknown-mode", what, {}, did_you_mean(label, labels))


def _sensors(data: Data, source: Source) -> Problems:
    yield from named_twice(list(tables(data, "sensor")), "study.duplicate-name", source)
