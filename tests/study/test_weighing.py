"""Measured mass, centre of gravity and moments of inertia of a configuration beside those of the model."""

from __future__ import annotations

from pathlib import Path

import pytest

from femtune.steps.check.run import check_study
from femtune.steps.info.checks import CENTRE, INERTIA, MASS, mass_checks
from femtune.study.study import load_study

# four masses of 1 kg at (±1, 0, 0) and (0, ±2, 0): moments of inertia 8, 2 and 10 about the origin
CROSS = """SOL 103
CEND
BEGIN BULK
GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,0.,2.,0.
GRID,4,,-1.,0.,0.
GRID,5,,0.,-2.,0.
CBAR,1,1,1,2,0.,0.,1.
CBAR,2,1,1,3,0.,0.,1.
CBAR,3,1,1,4,0.,0.,1.
CBAR,4,1,1,5,0.,0.,1.
PBAR,1,1,1.-4,1.-9,1.-9,2.-9
MAT1,1,7.+10,,.3
CONM2,12,2,,1.
CONM2,13,3,,1.
CONM2,14,4,,1.
CONM2,15,5,,1.
ENDDATA
"""


def written(folder: Path, keys: str) -> Path:
    (folder / "cross.bdf").write_text(CROSS)
    study = folder / "study.toml"
    study.write_text(
        f'[study]\ntitle = "x"\ndeck = "cross.bdf"\nunits = "m-kg-s"\n[[configuration]]\nname = "free"\n{keys}\n'
    )
    return study


def test_what_is_not_given_is_not_compared(tmp_path: Path) -> None:
    (check,) = mass_checks(load_study(written(tmp_path, "")))
    assert (check.check, check.verdict) == (MASS, "not tested")


def test_mass_properties_that_agree(tmp_path: Path) -> None:
    keys = "weighed_mass = 4.0\nweighed_centre = [0.0, 0.02, 0.0]\nweighed_inertia = [8.1, 2.0, 9.9]"
    found = mass_checks(load_study(written(tmp_path, keys)))
    assert [(c.check, c.verdict) for c in found] == [(MASS, "pass"), (CENTRE, "pass"), (INERTIA, "pass")]
    # of the radius of gyration, √(20 / (2 · 4))
    assert found[1].measured == pytest.approx(100.0 * 0.02 / 2.5**0.5)
    assert found[2].measured == pytest.approx(100.0 * (8.0 / 8.1 - 1.0))


def test_mass_properties_that_differ_are_told(tmp_path: Path) -> None:
    keys = "weighed_centre = [0.1, 0.0, 0.0]\nweighed_inertia = [8.0, 2.5, 10.0]"
    found = [p for p in check_study(written(tmp_path, keys)).record.problems if p.code == "model.mass-differs"]
    assert [p.level for p in found] == ["warning", "warning"]
    assert "0.1 from the measured one (-0.1, +0, +0 along x, y, z), 6.3 % of the radius of gyration" in found[0].message
    assert "moment of inertia of the model about y differs by -20 %" in found[1].message
