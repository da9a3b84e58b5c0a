"""What a user reads when a test file cannot be used: the place, the values and the fix."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.files.uff import read_uff, write_uff_modes
from femtune.modal import ModeSet
from femtune.testdata import ModalTest, check_modes, place
from femtune.units import SI, UnitSystem, unit_system

_MODES = ModeSet(np.array([5.0]), np.array([[1.0], [2.0]]), DofSet.parse(["1X+", "2X+"]))


def _file(folder: Path) -> str:
    write_uff_modes(folder / "test.uff", ModalTest("BC", SI, modes=_MODES))
    return (folder / "test.uff").read_text()


def _message(folder: Path, text: str, *, stated: UnitSystem | None = SI, records: str | None = None) -> str:
    (folder / "test.uff").write_text(text)
    with pytest.raises(FemtuneError) as caught:
        read_uff(folder / "test.uff", units=SI, file_units=stated, records=records)
    return str(caught.value).replace(f"{folder}/", "")


def test_cut_in_a_record(tmp_path: Path) -> None:
    text = _file(tmp_path)
    assert _message(tmp_path, text[:-30]) == (
        "[uff.truncated] the file ends inside data set 55, which began at line 7: its closing delimiter is missing\n"
        "  at test.uff:20 (data set 55)\n"
        "  expected = '    -1'\n"
        "  found = end of file\n\n"
        "hint: the file was cut: export or copy it again"
    )


def test_a_line_is_lost(tmp_path: Path) -> None:
    lines = _file(tmp_path).splitlines(keepends=True)
    assert _message(tmp_path, "".join(lines[:17] + lines[18:])) == (
        "[uff.truncated] data set 55 does not hold the numbers of a record that it declares\n"
        "  at test.uff:18 (data set 55)\n"
        "  expected = 3\n"
        "  found = 1\n\n"
        "hint: the file was cut or edited: export or copy it again"
    )


def test_no_units(tmp_path: Path) -> None:
    lines = _file(tmp_path).splitlines(keepends=True)
    assert _message(tmp_path, "".join(lines[6:]), stated=None) == (
        "[uff.no-units] the file does not say in which units its numbers are (it has no data set 164)\n"
        "  at test.uff\n\n"
        'hint: say it: file_units = "m-kg-s" (or "mm-t-s", "in-slinch-s", …)'
    )


def test_other_units(tmp_path: Path) -> None:
    assert _message(tmp_path, _file(tmp_path), stated=unit_system("mm-t-s")) == (
        "[uff.units-contradict] the units of data set 164 contradict the study, which says mm-t-s\n"
        "  at test.uff:1 (data set 164)\n"
        "  length in data set 164 = 1 m\n"
        "  length otherwise = 0.001 m\n"
        "  force in data set 164 = 1 N\n"
        "  force otherwise = 1 N\n\n"
        "hint: leave the units of the test out of the study if the file is right, or correct data set 164"
    )


def test_no_such_configuration(tmp_path: Path) -> None:
    assert _message(tmp_path, _file(tmp_path), records="SC") == (
        "[uff.no-record] no mode of the file has the word 'SC' in its ID lines\n"
        "  at test.uff:7 (data set 55)\n"
        "  ID lines of the file = BC\n\n"
        "hint: choose a word of these lines, or leave records out to read all modes"
    )


def test_a_value_that_is_no_number(tmp_path: Path) -> None:
    text = _file(tmp_path).replace("  1.00000E+00  0.00000E+00", "          NaN  0.00000E+00")
    assert _message(tmp_path, text) == (
        "[uff.value] 'NaN' is not a finite number\n"
        "  at test.uff:18 (data set 55)\n\n"
        "hint: a measured value must be a number; export it again"
    )


def test_nan_in_the_modes_of_a_test() -> None:
    with pytest.raises(FemtuneError) as caught:
        check_modes(replace(_MODES, shapes=np.array([[1.0], [np.nan]])))
    assert str(caught.value) == (
        "[test.nan] 1 entries of the mode shapes are not numbers (NaN)\n"
        "  first = mode 1 at 2X+\n\n"
        "hint: correct them, or say that missing entries are allowed: they count as not measured"
    )


def test_mirrored_frame() -> None:
    with pytest.raises(FemtuneError) as caught:
        place(ModalTest("BC", SI), np.diag([1.0, -1.0, 1.0]), np.zeros(3))
    assert str(caught.value) == (
        "[test.mirrored] the rotation mirrors: it turns a right-handed frame into a left-handed one\n"
        "  rotation = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]\n\n"
        "hint: change the sign of one row, or say that a mirrored frame is meant"
    )
