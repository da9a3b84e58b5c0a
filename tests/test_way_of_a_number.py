"""docs/way-of-a-number.md names functions that exist, in the order in which a run calls them."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from pkgutil import resolve_name
from types import CodeType, FrameType

import pytest

import femtune as ft
from femtune.cli import main
from femtune.testing import example_deck, example_test

_PAGE = Path(__file__).resolve().parents[1] / "docs" / "way-of-a-number.md"
_STUDY = """[study]
title = "way"
deck = "cantilever.bdf"
units = "m-kg-s"

[test]
file = "{test}"

[[parameter]]
name = "E"
fields = ["MAT1 1 E"]
lower = 0.5
upper = 2.0

"""
_FREQUENCIES = "[residuals]\nfrequency_sd = 0.01\nshape_sd = 0.1\n"
_FRFS = """[[residual]]
kind = "frf"

[equalise]
damping = 0.02
band_hz = [5.0, 240.0]
largest_order = 12
"""


@cache
def _ways() -> dict[str, list[str]]:
    """The names of each section, in their order."""
    sections = re.split(r"^## ", _PAGE.read_text(encoding="utf-8"), flags=re.M)[1:]
    return {s.split(":")[0]: re.findall(r"`(femtune\.[\w.]+)`", re.split(r"^`", s, flags=re.M)[0]) for s in sections}


def test_every_name_of_the_page_exists() -> None:
    names = re.findall(r"`(femtune\.[\w.]+)`", _PAGE.read_text(encoding="utf-8"))
    assert len(names) > 60
    for name in names:
        resolve_name(name)


def _code(name: str) -> CodeType:
    """The code that is executed where a name is called or, for a property, read."""
    found = resolve_name(name)
    if isinstance(found, type):
        found = found.__init__
    found = getattr(found, "fget", None) or getattr(found, "func", None) or found
    found = getattr(found, "callback", None) or found
    while hasattr(found, "__wrapped__"):
        found = found.__wrapped__
    return found.__code__


@contextmanager
def _called(names: list[str]) -> Iterator[list[str]]:
    """The names that are called inside, in order."""
    of = {_code(name): name for name in names}
    calls: list[str] = []

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code in of:
            calls.append(of[frame.f_code])

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        yield calls
    finally:
        sys.setprofile(before)


def _update(folder: Path, test: str, tables: str) -> None:
    study = folder / "study.toml"
    study.write_text(_STUDY.format(test=test) + tables, encoding="utf-8")
    ft.update(study)


def _modes(folder: Path) -> None:
    _update(folder, example_test(folder).name, _FREQUENCIES)


def _frfs(folder: Path) -> None:
    lines = {"from_hz": 5.0, "to_hz": 240.0, "step_hz": 0.1, "ratio": 0.01, "scatter": 0.005}
    outputs = ["2Y+", "3Y+", "4Y+", "5Y+"]
    ft.respond(
        folder / "cantilever.bdf", inputs=["5Y+"], outputs=outputs, uff=folder / "frfs.uff", units="m-kg-s", **lines
    )
    _update(folder, "frfs.uff", _FRFS)


def _error(folder: Path) -> None:
    deck = folder / "cantilever.bdf"
    # of both PBAR
    deck.write_text(deck.read_text().replace("2.0-7", "2.O-7"))
    with pytest.raises(SystemExit) as end:
        main(["modes", str(deck)])
    assert end.value.code == 2


_RUNS: dict[str, Callable[[Path], None]] = {
    "A frequency": _modes, "Young's modulus": _modes, "A line of an FRF": _frfs, "An error": _error,
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("way", _RUNS)
@pytest.mark.filterwarnings("ignore")
def test_a_run_calls_them_in_this_order(way: str, tmp_path: Path) -> None:
    assert set(_ways()) == set(_RUNS)
    names = _ways()[way]
    example_deck(tmp_path)
    with _called(names) as calls:
        _RUNS[way](tmp_path)
    at = -1
    for name in names:
        assert name in calls[at + 1 :], (name, calls[at] if at >= 0 else "")
        at = calls.index(name, at + 1)
