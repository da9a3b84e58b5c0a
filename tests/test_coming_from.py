"""docs/coming-from.md: the hand-over of modes runs on an object with the attributes of pyOMA2's results."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import femtune as ft
from femtune.dofs import DofSet

PAGE = Path(__file__).resolve().parents[1] / "docs" / "coming-from.md"
DECK = """SOL 103
CEND
SPC = 1
METHOD = 1
BEGIN BULK
EIGRL,1,,,4
GRID,10,,0.,0.,0.
GRID,11,,0.,0.,1.
GRID,12,,0.,0.,2.
MAT1,1,2.1+11,,.3,7850.
PBAR,1,1,1.-3,2.-7,5.-7,4.-7
CBAR,1,1,10,11,1.,0.,0.
CBAR,2,1,11,12,1.,0.,0.
SPC1,1,123456,10
ENDDATA
"""


def test_modes_of_pyoma2(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("model.bdf").write_text(DECK, encoding="utf-8")
    (solved,) = ft.modes("model.bdf", count=3).mode_sets.values()
    seen = solved.select_dofs(DofSet.parse(["11X+", "11Y+", "12X+", "12Y+"]))
    ssi = SimpleNamespace(Fn=1.01 * seen.freq_hz, Phi=seen.shapes + 0j, Xi=np.full(3, 0.01))
    code = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S)[0]
    names: dict[str, Any] = {"ssi": ssi}
    exec(code, names)
    (record,) = names["found"].records
    assert [pair.model_number for pair in record.pairs] == [1, 2, 3]
    np.testing.assert_allclose([pair.mac for pair in record.pairs], 1.0, atol=1e-9)
    read = ft.read_test("ambient.uff")
    np.testing.assert_allclose(read.modes.freq_hz, ssi.Fn, rtol=1e-5)
