"""Docstrings of the names for users: arguments, shapes of arrays, units, errors, the source of a method, an example."""

from __future__ import annotations

import inspect
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import femtune as ft
from femtune import citations

_PROJECT = Path(__file__).resolve().parents[2]
_NAMES: dict[str, Any] = {
    **{name: getattr(ft, name) for name in ft.__all__ if not isinstance(getattr(ft, name), ModuleType)},
    **{f"plot.{name}": getattr(ft.plot, name) for name in ft.plot.__all__},
}
# what a step returns is shown by the example of the step
_RESULTS = {name for name in _NAMES if name.endswith("Result")}
# these have no input that could be wrong, or are the error itself
_WITHOUT_ERRORS = _RESULTS | {"FemtuneError", "Status", "Model"}
_METHODS = {
    "mac", "correlate", "compare", "identify", "plan", "select", "update", "quantify", "bootstrap",
    "posterior", "screen", "search", "candidates", "FrequencyResidual", "ComplexEigenvalueResidual", "DampingResidual",
    "ShapeResidual", "MacResidual", "FlexibilityResidual", "DynamicResidual", "FrfResidual",
}  # fmt: skip
_ARRAY = re.compile(r"NDArray|Reals|Complexes|Flags")
_NUMBER = re.compile(r"\bfloat\b|NDArray\[np\.(float64|complex128)\]")
_SHAPE = re.compile(r"\([\w ×·*+-]+,[\w ,×·*+-]*\)")
# units in the name, or in words: what a number without one is measured by
_UNIT = re.compile(r"_(hz|s|deg|percent|mb|ratio)\b|^(ratio|sd|covariance|nominal|lower|upper)s?$")
_MEASURED = re.compile(
    r"\b(Hz|rad|%|in units?|units? of|unit modal mass|in mass|length|relative|fractions?|factors?|ratios?|degrees|"
    r"mass-normalised|standard deviations? of|dimensionless|seconds|as for|0 … 1|decibels|s)\b"
)


def _sections(text: str) -> dict[str, str]:
    """Text by heading; "" has what stands before the first."""
    parts = re.split(r"^(\w+)\n-+\n", text, flags=re.M)
    return dict(zip(["", *parts[1::2]], parts[::2]))


def _described(section: str) -> dict[str, str]:
    """Description by argument."""
    found: dict[str, str] = {}
    for names, words in re.findall(r"^([\w*, ]+) : (.*(?:\n {4}.*)*)", section, flags=re.M):
        found |= dict.fromkeys((n.strip(" *") for n in names.split(",")), words)
    return found


def _arguments(value: Any) -> dict[str, str]:
    """Annotations of the arguments; of a table of a study its keys."""
    fields = getattr(value, "model_fields", None)
    if fields is not None:
        kept = {name: str(field.annotation) for name, field in fields.items() if name != "kind"}
        return {name: "float" if "float" in kind else "" for name, kind in kept.items()}
    if inspect.isclass(value) and issubclass(value, Exception | ft.Status):
        return {}
    return {n: str(p.annotation) for n, p in inspect.signature(value).parameters.items() if not n.startswith("_")}


def missing(name: str, value: Any, text: str) -> Iterator[str]:
    """What a docstring does not state."""
    sections = _sections(text)
    described, quoted = _described(sections.get("Parameters", "")), set(re.findall(r"`(\w+)`", sections[""]))
    for argument, kind in _arguments(value).items():
        words = described.get(argument, described.get("words", "") if re.search(rf"\b{argument}\b", text) else "")
        if not words and argument not in quoted:
            yield f"{argument} is not described"
        if name in _RESULTS:
            continue
        if _ARRAY.search(kind) and not _SHAPE.search(words):
            yield f"{argument} has no shape"
        if words and _NUMBER.search(kind) and not _UNIT.search(argument) and not _MEASURED.search(words):
            yield f"{argument} has no unit"
    if inspect.isfunction(value) and _ARRAY.search(str(inspect.signature(value).return_annotation)):
        yield from [] if _SHAPE.search(sections.get("Returns", "")) else ["what is returned has no shape"]
    if name not in _WITHOUT_ERRORS and "FemtuneError : " not in sections.get("Raises", ""):
        yield "no errors"
    yield from (f"no such error: {code}" for code in _codes(sections.get("Raises", "")) if not _is_error(code))
    if name in _METHODS:
        sources = re.findall(r"^Sources?: (.*(?:\n.+)*)", text, flags=re.M)
        yield from [] if sources else ["no source"]
        yield from (
            f"unknown source: {who} ({year})" for s in sources for who, year in _cited(s) if not _is_known(who, year)
        )
    if name not in _RESULTS and ">>> " not in sections.get("Examples", ""):
        yield "no example"


def _codes(section: str) -> list[str]:
    return re.findall(r"``([a-z]+\.[a-z*/-]+)``", section)


_MUTANTS = {
    ("mac", "(n, p) and (n, q)", "matrices,"): "a has no shape",
    ("mac", "(p, q) in 0 … 1", "values in 0 … 1"): "what is returned has no shape",
    ("mac", "weight : (n, n)", "weights : (n, n)"): "weight is not described",
    ("mac", "modal.zero-shape", "modal.zero-shapes"): "no such error: modal.zero-shapes",
    ("mac", "Raises\n------", "Errors\n------"): "no errors",
    ("mac", "Source: Allemang and Brown (1982).", ""): "no source",
    ("mac", "Brown (1982)", "Brown (1983)"): "unknown source: Allemang (1983)",
    ("mac", ">>> ", ""): "no example",
    ("FrfSet", "in 0 … 1, or None", "or None"): "coherence has no unit",
    ("compare", ", in the unit of length of the decks", ""): "tolerance has no unit",
    ("FrfResidual", "leave_out_modes_hz", "left_out_modes_hz"): "leave_out_modes_hz is not described",
}


@pytest.mark.parametrize("mutant", _MUTANTS, ids=_MUTANTS.values())
def test_what_a_docstring_lacks_is_found(mutant: tuple[str, str, str]) -> None:
    name, stated, instead = mutant
    text = inspect.getdoc(_NAMES[name]) or ""
    assert stated in text
    assert _MUTANTS[mutant] in missing(name, _NAMES[name], text.replace(stated, instead))


_AREAS = {
    p.stem: tomllib.loads(p.read_text(encoding="utf-8")) for p in (Path(ft.__file__).parent / "messages").glob("*.toml")
}
_CODES = {f"{area}.{code}" for area, table in _AREAS.items() for code in table}


def _is_error(code: str) -> bool:
    head = code.split("/", maxsplit=1)[0]
    return head in _CODES or (head.endswith(".*") and any(c.startswith(head[:-1]) for c in _CODES))


def _cited(source: str) -> list[tuple[str, str]]:
    """First author and year of each publication."""
    return re.findall(r"(?:^|; |, and |: )([\w'’-]+)[^;()]* \((\d{4})\)", source.replace("\n", " "))


def _is_known(who: str, year: str) -> bool:
    registered = any(c.key.endswith(year) and who in c.text for c in citations.PUBLICATIONS.values())
    pages = (_PROJECT / "docs" / "theory").glob("*.md")
    return registered or any(re.search(rf"{who}(.|\n){{0,250}}{year}", p.read_text(encoding="utf-8")) for p in pages)


@pytest.mark.parametrize("name", _NAMES)
def test_a_docstring_states_what_a_user_needs(name: str) -> None:
    assert list(missing(name, _NAMES[name], inspect.getdoc(_NAMES[name]) or "")) == []


@pytest.mark.parametrize("name", sorted(_RESULTS))
def test_a_result_is_shown_by_the_example_of_its_step(name: str) -> None:
    made = [v for v in _NAMES.values() if inspect.isfunction(v) and inspect.signature(v).return_annotation == name]
    assert any(">>> " in (inspect.getdoc(v) or "") for v in made)
