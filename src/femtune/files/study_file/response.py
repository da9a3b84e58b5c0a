"""[response] and [[load]]: frequency responses and static displacements of the model."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Field

from femtune.errors import FemtuneError
from femtune.files.study_file.kinds import DofLabel, Positive, Text, TomlTable
from femtune.files.study_file.source import StudyLines, named_twice, number, table, tables
from femtune.residuals.kinds import FrfMethodWord

Labels = Annotated[tuple[DofLabel, ...], Field(min_length=1)]
Ratio = Annotated[float, Field(ge=0, lt=1)]
Hertz = Annotated[float, Field(ge=0, le=1e12)]
HertzAboveZero = Annotated[float, Field(gt=0, le=1e12)]

MOST_LINES = 1_000_000


class ResponseTable(TomlTable):
    """[response]: FRFs, frequency lines, method and damping."""

    kind: Literal["receptance", "mobility", "accelerance"] = "accelerance"
    outputs: Labels | None = None
    inputs: Labels | None = None
    from_hz: Hertz | None = None
    to_hz: HertzAboveZero | None = None
    step_hz: Positive | None = None
    lines: Annotated[int, Field(ge=1, le=MOST_LINES)] | None = None
    method: FrfMethodWord = "real modes"
    modes: Annotated[int, Field(ge=1, le=100_000)] | None = None
    max_hz: HertzAboveZero | None = None
    residual_vectors: bool = True
    damping: Literal["deck", "modal"] = "deck"
    ratio: Ratio | None = None
    ratios: Annotated[tuple[Ratio, ...], Field(min_length=1)] | None = None


class LoadEntry(TomlTable):
    """[[load]]: forces whose static displacements are computed."""

    name: Text
    forces: Annotated[dict[DofLabel, float], Field(min_length=1)]
    outputs: Labels | None = None


# ----------------------------------------------------------------------------------------------------
# Rules between the keys of [response] and [[load]].


Data = dict[str, Any]
Problems = Iterator[FemtuneError]

_LINES = ("from_hz", "to_hz", "step_hz", "lines")


def response_rules(data: Data, source: StudyLines) -> Problems:
    """All breaches."""
    response = table(data, "response")
    yield from _frequencies(response, source)
    yield from _alternatives(response, source)
    yield from named_twice(list(tables(data, "load")), "study.duplicate-name/earlier", source)


def _frequencies(response: Data, source: StudyLines) -> Problems:
    problem = _problem(response)
    if problem:
        key, code, facts = problem
        shown = {k: response[k] for k in _LINES if k in response}
        yield source.error(("response", key), code, shown, **facts)


def _problem(response: Data) -> tuple[str, str, dict[str, Any]] | None:
    """Key, code and facts of what is wrong."""
    low, high, step = (number(response, key) for key in _LINES[:3])
    if "step_hz" in response and "lines" in response:
        return "lines", "study.response-lines/step-and-number", {}
    for key in ("step_hz", "lines"):
        missing = [k for k in ("from_hz", "to_hz") if k not in response]
        if key in response and missing:
            return key, "study.response-lines/no-band", {"key": key, "missing": " and ".join(missing)}
    if low is None or high is None:
        return None
    if low > high or (low == high and response.get("lines") != 1):
        return "to_hz", "study.response-lines", {}
    if step is not None and step > 0.0 and (high - low) / step > MOST_LINES:
        return "step_hz", "study.response-lines/too-many", {"most": MOST_LINES}
    return None


def _alternatives(response: Data, source: StudyLines) -> Problems:
    if "modes" in response and "max_hz" in response:
        shown = {key: response[key] for key in ("modes", "max_hz")}
        yield source.error(("response", "max_hz"), "study.modes/response", shown)
    if "ratio" in response and "ratios" in response:
        shown = {key: response[key] for key in ("ratio", "ratios")}
        yield source.error(("response", "ratios"), "study.response-ratios", shown)
