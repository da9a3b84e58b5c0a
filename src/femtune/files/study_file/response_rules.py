"""Rules between the keys of [response] and [[load]]."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from femtune.errors import FemtuneError
from femtune.files.study_file.plain import named_twice, number, table, tables
from femtune.files.study_file.response import MOST_LINES
from femtune.files.study_file.source import Source

Data = dict[str, Any]
Problems = Iterator[FemtuneError]

_LINES = ("from_hz", "to_hz", "step_hz", "lines")


def response_rules(data: Data, source: Source) -> Problems:
    """All breaches."""
    response = table(data, "response")
    yield from _frequencies(response, source)
    yield from _alternatives(response, source)
    yield from named_twice(list(tables(data, "load")), "study.duplicate-name", source)


def _frequencies(response: Data, source: Source) -> Problems:
    problem = _problem(response)
    if problem:
        key, what, hint = problem
        shown = {k: response[k] for k in _LINES if k in response}
        yield source.error(("response", key), "study.response-lines", what, shown, hint)


def _problem(response: Data) -> tuple[str, str, str] | None:
    """Key, what is wrong, and the fix."""
    low, high, step = (number(response, key) for key in _LINES[:3])
    if "step_hz" in response and "lines" in response:
        return "lines", "the frequency lines have both a step and a number", "keep step_hz or lines"
    for key in ("step_hz", "lines"):
        missing = [k for k in ("from_hz", "to_hz") if k not in response]
        if key in response and missing:
            return key, f"'{key}' needs from_hz and to_hz", f"add {' and '.join(missing)}"
    if low is None or high is None:
        return None
    if low > high or (low == high and response.get("lines") != 1):
        return "to_hz", "the frequencies do not rise from from_hz to to_hz", "let to_hz be the larger one"
    if step is not None and step > 0.0 and (high - low) / step > MOST_LINES:
        return "step_hz", f"these are more than {MOST_LINES} lines", "take a larger step"
    return None


def _alternatives(response: Data, source: Source) -> Problems:
    if "modes" in response and "max_hz" in response:
        shown = {key: response[key] for key in ("modes", "max_hz")}
        hint = "keep modes (that many) or max_hz (all modes up to it)"
        what = "[response] has both modes and max_hz"
        yield source.error(("response", "max_hz"), "study.modes", what, shown, hint)
    if "ratio" in response and "ratios" in response:
        shown = {key: response[key] for key in ("ratio", "ratios")}
        hint = "keep ratio (the same for all modes) or ratios (one for each)"
        what = "[response] has both ratio and ratios"
        yield source.error(("response", "ratios"), "study.response-ratios", what, shown, hint)
