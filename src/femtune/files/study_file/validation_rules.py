"""Rules between the keys of [validate] and [[hold_out]]."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from femtune.errors import FemtuneError, did_you_mean
from femtune.files.study_file.lines import Place
from femtune.files.study_file.plain import table, tables
from femtune.files.study_file.source import Source
from femtune.files.study_file.validation import OWN_LIMITS

Data = dict[str, Any]
Problems = Iterator[FemtuneError]

_WHAT = ("modes", "above_hz", "below_hz", "sensors")


def validation_rules(data: Data, source: Source) -> Problems:
    """Own criteria have numbers; what is held out exists and belongs to the update."""
    validate = table(data, "validate")
    if validate.get("profile") == "own" and not any(key in validate for key in OWN_LIMITS):
        what = 'profile = "own" without a number of its own'
        hint = "give one or more of frequency_error, mac, cross_orthogonality, off_diagonal, shape_error"
        yield source.error(("validate", "profile"), "study.no-criteria", what, {}, hint)
    configurations = {e["name"]: e for _, e in tables(data, "configuration") if isinstance(e.get("name"), str)}
    for place, entry in tables(data, "hold_out"):
        if not any(entry.get(key) for key in _WHAT):
            what = "[[hold_out]] names nothing that is held out"
            hint = "name modes, above_hz, below_hz or sensors"
            yield source.error(place, "study.hold-out", what, {}, hint)
        yield from _configuration(place, entry, configurations, source)


def _configuration(place: Place, entry: Data, known: dict[str, Data], source: Source) -> Problems:
    name = entry.get("configuration")
    if not isinstance(name, str):
        return
    if name not in known:
        what = f"[[hold_out]] names '{name}', which is no configuration"
        hint = did_you_mean(name, known) or "remove the key: the study has one configuration only"
        yield source.error((*place, "configuration"), "study.hold-out", what, {}, hint)
    elif "test" not in known[name]:
        what = f"configuration {name} has no test, so that there is nothing to hold out"
        yield source.error((*place, "configuration"), "study.hold-out", what, {}, 'give it test = "file.uff"')
    elif known[name].get("use") == "validation":
        what = f"configuration {name} is kept for validation as a whole, so that nothing is left to hold out"
        hint = 'remove this [[hold_out]], or use = "validation"'
        yield source.error((*place, "configuration"), "study.hold-out", what, {}, hint)
