"""What a user reads when a test file cannot be used: the place, the values and the fix."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.files.uff import test_variants as variants
from tests.messages.shown import check_shown

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
    check_shown("uff.truncated, cut in a record", _message(tmp_path, text[:-30]))


def test_a_line_is_lost(tmp_path: Path) -> None:
    lines = _file(tmp_path).splitlines(keepends=True)
    check_shown("uff.truncated, a line is lost", _message(tmp_path, "".join(lines[:17] + lines[18:])))


def test_no_units(tmp_path: Path) -> None:
    lines = _file(tmp_path).splitlines(keepends=True)
    check_shown("uff.no-units", _message(tmp_path, "".join(lines[6:]), stated=None))


def test_other_units(tmp_path: Path) -> None:
    check_shown("uff.units-contradict", _message(tmp_path, _file(tmp_path), stated=unit_system("mm-t-s")))


def test_no_such_configuration(tmp_path: Path) -> None:
    check_shown("uff.no-record", _message(tmp_path, _file(tmp_path), records="SC"))


def test_a_value_that_is_no_number(tmp_path: Path) -> None:
    text = _file(tmp_path).replace("  1.00000E+00  0.00000E+00", "          NaN  0.00000E+00")
    check_shown("uff.value", _message(tmp_path, text))


def test_nan_in_the_modes_of_a_test() -> None:
    with pytest.raises(FemtuneError) as caught:
        check_modes(replace(_MODES, shapes=np.array([[1.0], [np.nan]])))
    check_shown("test.nan", str(caught.value))


def test_mirrored_frame() -> None:
    with pytest.raises(FemtuneError) as caught:
        place(ModalTest("BC", SI), np.diag([1.0, -1.0, 1.0]), np.zeros(3))
    check_shown("test.mirrored", str(caught.value))


_LABEL = ("Hz", "m/s", "N")
_BODY = variants.singles(*variants.pairs(variants.ACCELERANCE))
_REMARKS = {
    "uff.byte-order": variants.UNITS.encode() + variants.binary("<", 2),
    "uff.delimiter": variants.FILE.replace("    -1\n", "-1\n"),
    "uff.free-columns": variants.block("58", *variants.head(), *(" ".join(x.split()) for x in _BODY)),
    "uff.kind-contradicts, decided by the driving point": variants.frf(labels=_LABEL),
    "uff.mode-numbers": variants.mode(0, 4.0) + variants.mode(0, 6.0),
    "uff.modes-differ, a node is missing": variants.mode(1, 4.0) + variants.mode(2, 6.0, nodes=(3, 7)),
    "uff.not-closed": variants.FILE.removesuffix("    -1\n"),
    "uff.pole, conjugates": variants.pole(1, -0.5 - 20j, 1.0) + variants.pole(2, -0.5 + 40j, 1.0),
    "uff.remark": variants.FILE.replace("    -1\n    -1\n", "    -1\nmeasured in hall 7\n    -1\n", 1),
    "uff.undefined-at-zero": variants.frf(start=0.0).replace(
        variants.singles(variants.ACCELERANCE[0].real)[0], "          NaN", 1
    ),
    "uff.unit-label": variants.frf(labels=("Hz", "g/N", "N")),
    "uff.unit-label, of the frequency axis": variants.frf(labels=("rad/s", "m/s2", "N")),
    "uff.unit-label, unknown": variants.frf(labels=("Hz", "EU", "N")),
}


@pytest.mark.parametrize("name", _REMARKS)
def test_what_is_read_with_a_notice(tmp_path: Path, name: str) -> None:
    path, given = tmp_path / "test.uff", _REMARKS[name]
    path.write_bytes(given if isinstance(given, bytes) else given.encode())
    stated = None if b"   164" in path.read_bytes() else SI
    notices = read_uff(path, units=SI, file_units=stated).notices
    check_shown(name, next(str(n) for n in notices if n.code == name.partition(",")[0]).replace(f"{tmp_path}/", ""))


def test_a_kind_that_nothing_decides(tmp_path: Path) -> None:
    check_shown("uff.kind-contradicts", _message(tmp_path, variants.frf(labels=_LABEL, response=5)))
