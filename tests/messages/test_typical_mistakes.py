"""Typical mistakes of a first study, one each, as a newcomer sees them: what is wrong, where, and how to mend it.

The texts are in `mistakes.txt`; FEMTUNE_SHOWN=write writes them again.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import click
import numpy as np
import pytest
from click.testing import CliRunner
from tests.messages.shown import check_shown

import femtune as ft
from femtune.cli import main
from femtune.testing import example_deck, example_test

_SHOWN = Path(__file__).parent / "mistakes.txt"
_MARK = "=== "
_STUDY = """[study]
title = "Cantilever"
deck = "cantilever.bdf"
units = "m-kg-s"

[test]
file = "cantilever.uff"

[[parameter]]
name = "root"
fields = ["PBAR 1 I1"]
lower = 0.5
upper = 2.0

[residuals]
frequency_sd = 0.01
"""


@dataclass(frozen=True)
class Case:
    """A mistake in a file: the text that is replaced, and by what; or a change of the folder."""

    old: str = ""
    new: str = ""
    file: str = "study.toml"
    change: Callable[[Path], None] | None = None
    command: str = "check"
    code: int = 2


def _test_written(folder: Path, **changed: object) -> None:
    """The test again without units, with other coordinates."""
    from dataclasses import replace  # noqa: PLC0415

    test = ft.read_test(folder / "cantilever.uff")
    places = np.array(changed["places"](test.geometry.coordinates))  # type: ignore[operator]
    geometry = replace(test.geometry, coordinates=places)
    ft.write_test(replace(test, geometry=geometry), folder / "changed.uff").replace(folder / "cantilever.uff")


def _in_millimetres(folder: Path) -> None:
    _test_written(folder, places=lambda xyz: 1000.0 * xyz)


def _other_axes(folder: Path) -> None:
    _test_written(folder, places=lambda xyz: xyz[:, [2, 0, 1]])


def _without_coordinates(folder: Path) -> None:
    _test_written(folder, places=lambda xyz: 0.0 * xyz)


CASES = {
    "the deck is not there": Case('"cantilever.bdf"', '"cantilver.bdf"'),
    "the test is not there": Case('"cantilever.uff"', '"cantilever.unv"'),
    "deck and test exchanged": Case('deck = "cantilever.bdf"', 'deck = "cantilever.uff"'),
    "a deck in place of the test": Case('file = "cantilever.uff"', 'file = "cantilever.bdf"'),
    "no units": Case('units = "m-kg-s"\n', ""),
    "units that are no system": Case("m-kg-s", "SI"),
    "units of another deck": Case(
        "MAT1    1       2.1+11          0.3     7850.", "MAT1    1       2.1+5           0.3     7.85-9",
        "cantilever.bdf", code=0,
    ),
    "a misspelt key": Case("lower", "lowr"),
    "a misspelt table": Case("[residuals]", "[residual]"),
    "a decimal comma": Case("lower = 0.5", "lower = 0,5"),
    "a path of Windows": Case('"cantilever.bdf"', '"C:\\Users\\me\\cantilever.bdf"'),
    "text in place of a number": Case("upper = 2.0", 'upper = "2.0"'),
    "bounds that are values": Case("lower = 0.5\nupper = 2.0", "lower = 1.0e-7\nupper = 4.0e-7", code=2),
    "bounds exchanged": Case("lower = 0.5\nupper = 2.0", "lower = 2.0\nupper = 0.5"),
    "per cent in place of a fraction": Case("frequency_sd = 0.01", "frequency_sd = 1", code=0),
    "a property that is not in the deck": Case("PBAR 1 I1", "PBAR 11 I1"),
    "a field that no card has": Case("PBAR 1 I1", "PBAR 1 IY"),
    "two parameters of one name": Case(
        "[residuals]", '[[parameter]]\nname = "root"\nfields = ["PBAR 2 I1"]\nlower = 0.5\nupper = 2.0\n\n[residuals]'
    ),
    "a card that refers to nothing": Case("CBAR    1       1 ", "CBAR    1       7 ", "cantilever.bdf"),
    "a test in millimetres": Case(change=_in_millimetres),
    "a test with other axes": Case(change=_other_axes),
    "a test without coordinates": Case(change=_without_coordinates),
    "a mode that the test does not have": Case(
        'file = "cantilever.uff"', 'file = "cantilever.uff"\nleave_out = [{ mode = "9", reason = "weak" }]'
    ),
    "a study without test": Case('[test]\nfile = "cantilever.uff"\n', "", command="run"),
    "no parameters": Case(
        '[[parameter]]\nname = "root"\nfields = ["PBAR 1 I1"]\nlower = 0.5\nupper = 2.0\n', "", command="run"
    ),
}  # fmt: skip


def _texts() -> dict[str, str]:
    text = _SHOWN.read_text(encoding="utf-8") if _SHOWN.exists() else ""
    parts = (part.partition("\n") for part in f"\n{text}".split(f"\n{_MARK}")[1:])
    return {name: shown.strip("\n") for name, _, shown in parts}


def said(folder: Path, case: Case) -> str:
    """What the command prints on standard error."""
    example_deck(folder)
    example_test(folder)
    (folder / "study.toml").write_text(_STUDY)
    if case.old:
        file = folder / case.file
        text = file.read_text()
        assert case.old in text
        file.write_text(text.replace(case.old, case.new, 1))
    if case.change is not None:
        case.change(folder)
    # progress is shown after two seconds, which a busy machine may need
    with mock.patch("femtune.cli.display.QUIET_S", 600.0):
        result = CliRunner().invoke(main, [case.command, str(folder / "study.toml")])
    assert "Traceback" not in result.output
    assert result.exit_code == case.code, result.output
    return click.unstyle(result.stderr).replace(f"{folder}{os.sep}", "").strip("\n")


@pytest.mark.quick(4)
@pytest.mark.parametrize("name", CASES)
def test_what_a_newcomer_is_told(tmp_path: Path, name: str) -> None:
    shown = said(tmp_path, CASES[name])
    if os.environ.get("FEMTUNE_SHOWN") == "write":
        texts = {**_texts(), name: shown}
        _SHOWN.write_text("\n\n".join(f"{_MARK}{n}\n{texts[n]}" for n in CASES if n in texts) + "\n", encoding="utf-8")
    assert _texts()[name] == shown
    if name in _OF_PAGES:
        check_shown(_OF_PAGES[name], shown)


_OF_PAGES = {"deck and test exchanged": "deck.universal-file", "per cent in place of a fraction": "study.large-sd"}
"""Messages that the error pages show too."""


def test_every_message_says_where_and_how_to_mend() -> None:
    """A place with its line, and a hint or a key to write."""
    texts = _texts()
    assert list(texts) == list(CASES)
    for name, text in texts.items():
        assert "study.toml" in text or "cantilever." in text, name
        assert "hint: " in text or "write " in text, name
        assert "constrained-int" not in text
        assert "pydantic" not in text
