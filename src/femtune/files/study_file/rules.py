"""Rules that concern several keys of a study file.

They look at the plain data and not at the checked models, so that a misspelt key elsewhere does not hide them;
values of the wrong type are left to the types.
"""

from __future__ import annotations

from collections.abc import Sequence

from femtune.errors import did_you_mean
from femtune.files.study_file.candidates import candidate_rules
from femtune.files.study_file.component import component_rules
from femtune.files.study_file.derived import derived_rules
from femtune.files.study_file.distribution import distribution_rules
from femtune.files.study_file.equalise import equalise_rules
from femtune.files.study_file.intervals import interval_rules
from femtune.files.study_file.matrices import generic_rules, matrix_rules
from femtune.files.study_file.modes import modes_rules
from femtune.files.study_file.over_frequency import frequency_table_rules
from femtune.files.study_file.parameter import parameter_rules
from femtune.files.study_file.plan import plan_rules
from femtune.files.study_file.residual import residual_rules
from femtune.files.study_file.respond import response_rules
from femtune.files.study_file.runs import configuration_rules, runs_rules
from femtune.files.study_file.screen import screen_rules
from femtune.files.study_file.search import search_rules
from femtune.files.study_file.solver import solver_rules
from femtune.files.study_file.source import Data, Place, Problems, StudyLines, named_twice, table, tables, texts
from femtune.files.study_file.specimens import specimen_rules
from femtune.files.study_file.stage import stage_rules
from femtune.files.study_file.update import update_rules
from femtune.files.study_file.validate import validation_rules
from femtune.files.study_file.vibration import vibration_rules

_KEYS_OF_TEST = (
    "records", "test_units", "mode_labels", "rotation", "origin", "left_handed", "coordinate_factor", "leave_out",
    "pairs", "never_pairs", "sensors_off",
)  # fmt: skip
"""Keys of a configuration that have no meaning without a test."""


def rules(data: Data, source: StudyLines) -> Problems:
    """All violated rules between keys."""
    yield from matrix_rules(data, source)
    yield from runs_rules(data, source)
    yield from configuration_rules(data, source)
    yield from solver_rules(data, source)
    yield from modes_rules(data, source)
    yield from _configurations(data, source)
    yield from component_rules(data, source)
    yield from _sensors(data, source)
    yield from parameter_rules(data, source)
    yield from candidate_rules(data, source)
    yield from specimen_rules(data, source)
    yield from screen_rules(data, source)
    yield from interval_rules(data, source)
    yield from search_rules(data, source)
    yield from vibration_rules(data, source)
    yield from generic_rules(data, source)
    yield from distribution_rules(data, source)
    yield from derived_rules(data, source)
    yield from frequency_table_rules(data, source)
    yield from residual_rules(data, source)
    yield from update_rules(data, source)
    yield from equalise_rules(data, source)
    yield from plan_rules(data, source)
    yield from response_rules(data, source)
    yield from stage_rules(data, source)
    yield from validation_rules(data, source)


def _configurations(data: Data, source: StudyLines) -> Problems:
    entries = list(tables(data, "configuration"))
    yield from named_twice(entries, "study.duplicate-name/earlier", source)
    test = table(data, "test")
    if test and ("file" in test) == ("freq_hz" in test):
        yield source.error(("test",), "study.test-source", {})
    hz, deviations = test.get("freq_hz", ()), test.get("freq_sd_hz", ())
    if isinstance(hz, Sequence) and isinstance(deviations, Sequence) and deviations and len(deviations) != len(hz):
        yield source.error(("test", "freq_sd_hz"), "study.test-source/deviations", {})
    if entries and "test" in data:
        yield source.error(("test",), "study.test-unused", {})
    for place, entry in entries:
        yield from _without_test(place, entry, source)
    for place, entry in (*entries, (("test",), test)):
        yield from _test_modes(place, entry, source)
        yield from _mirrored(place, entry, source)


def _without_test(place: Place, entry: Data, source: StudyLines) -> Problems:
    for key in _KEYS_OF_TEST:
        if key in entry and "test" not in entry:
            yield source.error((*place, key), "study.no-test/key", {}, key=key)


def _mirrored(place: Place, entry: Data, source: StudyLines) -> Problems:
    """A rotation that mirrors needs left-handed axes, and these need such a rotation."""
    rows = entry.get("rotation")
    if rows is None and not entry.get("left_handed"):
        return
    try:
        a, b, c = ([float(x) for x in row] for row in rows or ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
        volume = sum(a[i] * (b[i - 2] * c[i - 1] - b[i - 1] * c[i - 2]) for i in range(3))
    except (TypeError, ValueError, IndexError):
        return  # told by the type of the key
    if (volume < 0.0) != (entry.get("left_handed") is True):
        code = "test.mirrored/right-handed" if volume > 0.0 else "test.mirrored"
        yield source.error((*place, "rotation" if rows else "left_handed"), code, {"rotation": rows})


def _test_modes(place: Place, entry: Data, source: StudyLines) -> Problems:
    labels = texts(entry.get("mode_labels"))
    for label in sorted({label for label in labels if labels.count(label) > 1}):
        yield source.error((*place, "mode_labels"), "study.duplicate-name", {}, label=label)
    for at, left in tables(entry, "leave_out"):
        if ("mode" in left) == ("hz" in left):
            yield source.error((*place, *at), "study.leave-out", {"leave_out": left})
        yield from _known_label((*place, *at, "mode"), left.get("mode"), labels, source)
    for at, pair in tables(entry, "pairs"):
        yield from _known_label((*place, *at, "test"), pair.get("test"), labels, source)


def _known_label(place: Place, label: object, labels: list[str], source: StudyLines) -> Problems:
    if labels and isinstance(label, str) and label not in labels:
        yield source.error(place, "study.unknown-mode/mode-labels", {}, hint=did_you_mean(label, labels), label=label)


def _sensors(data: Data, source: StudyLines) -> Problems:
    yield from named_twice(list(tables(data, "sensor")), "study.duplicate-name/earlier", source)
