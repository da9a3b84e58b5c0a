"""[response] and [[load]]: frequency responses and static displacements of the model."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from femtune.files.study_file.kinds import DofLabel, Hertz, HertzAboveZero, Labels, Positive, Ratio, Text, TomlTable
from femtune.files.study_file.source import Data, Problems, StudyLines, named_twice, number, table, tables
from femtune.modal.kinds import FrfKind
from femtune.model.kinds import FrfMethodWord

MOST_LINES = 1_000_000
"""Frequency lines of a response: more are a mistyped step or limit."""


class ResponseTable(TomlTable):
    """[response]: FRFs, frequency lines, method and damping."""

    kind: FrfKind = "accelerance"
    """`"receptance"`, `"mobility"` or `"accelerance"`: displacement, velocity or acceleration over force. Example:
    `"mobility"`"""
    outputs: Labels | None = None
    """Response DOFs. Default: those of the test's FRFs, otherwise its sensors; without a test the inputs. Example:
    `["12Z+", "13Z+"]`"""
    inputs: Labels | None = None
    """Reference DOFs. Default: those of the test's FRFs. Example: `["12Z+"]`"""
    from_hz: Hertz | None = None
    """First frequency line, Hz. Example: `1.0`"""
    to_hz: HertzAboveZero | None = None
    """Last frequency line, Hz. Example: `200.0`"""
    step_hz: Positive | None = None
    """Frequency resolution, Hz. Default, without `lines`: the frequency lines of the test. Example: `0.25`"""
    lines: Annotated[int, Field(ge=1, le=MOST_LINES)] | None = None
    """Number of frequency lines, instead of `step_hz`. Example: `800`"""
    method: FrfMethodWord = "real modes"
    """`"real modes"`, `"complex modes"`, or `"direct"` (a solution at each frequency line). Example: `"direct"`"""
    modes: Annotated[int, Field(ge=1, le=100_000)] | None = None
    """Number of modes that are superposed. Example: `40`"""
    max_hz: HertzAboveZero | None = None
    """Modes up to this frequency are superposed, Hz, instead of `modes`. Default, without both: up to twice the last
    frequency line. Example: `500.0`"""
    residual_vectors: bool = True
    """Add residual vectors (static responses to the inputs and to dashpots) to the modes. Example: `false`"""
    damping: Literal["deck", "modal"] = "deck"
    """`"deck"`: loss factors and dashpots of the deck are used; `"modal"`: they are ignored, and there is modal damping
    only. Example: `"modal"`"""
    ratio: Ratio | None = None
    """Damping ratio of all modes, instead of the damping table of the deck (SDAMPING). Example: `0.01`"""
    ratios: Annotated[tuple[Ratio, ...], Field(min_length=1)] | None = None
    """One value per mode, including rigid-body modes, instead of `ratio`. Example: `[0.01, 0.012, 0.02]`"""


class LoadEntry(TomlTable):
    """[[load]]: forces whose static displacements are computed."""

    name: Text
    """Name of the load case, unique. Example: `"tip"`"""
    forces: Annotated[dict[DofLabel, float], Field(min_length=1)]
    """DOFs with their forces (moments at rotations). Example: `{ "12Z+" = 100.0, "13Z+" = -100.0 }`"""
    outputs: Labels | None = None
    """DOFs whose displacements are listed. Default: outputs of `[response]`, otherwise the DOFs of the forces. Example:
    `["12Z+", "20Z+"]`"""


# ----------------------------------------------------------------------------------------------------
# Rules between the keys of [response] and [[load]].


_KEYS_OF_LINES = ("from_hz", "to_hz", "step_hz", "lines")
"""Keys of [response] that state the frequency lines."""


def response_rules(data: Data, source: StudyLines) -> Problems:
    """All violated rules."""
    response = table(data, "response")
    yield from _frequencies(response, source)
    yield from _alternatives(response, source)
    yield from named_twice(list(tables(data, "load")), "study.duplicate-name/earlier", source)


def _frequencies(response: Data, source: StudyLines) -> Problems:
    problem = _problem(response)
    if problem:
        key, code, facts = problem
        shown = {k: response[k] for k in _KEYS_OF_LINES if k in response}
        yield source.error(("response", key), code, shown, **facts)


def _problem(response: Data) -> tuple[str, str, dict[str, Any]] | None:
    """Key, code and facts of an error of the frequency lines."""
    low, high, step = (number(response, key) for key in _KEYS_OF_LINES[:3])
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
