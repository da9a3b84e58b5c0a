"""How far frequencies depend on the place of the mass of beams with an offset neutral axis, and who is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la
from scipy.optimize import linear_sum_assignment
from tests.messages.shown import check_shown

import femtune as ft
from femtune.fem.assemble import assemble, offset_mass
from femtune.files.nastran import build_structure, read_deck
from femtune.model import Configuration, configure, parametric_model, solve_modes
from femtune.model.neutral_axis import offset_mass_change
from femtune.parameters import ParameterSet

DECK = """SOL 103
CEND
METHOD = 1
SPC = 1
BEGIN BULK
PARAM,COUPMASS,1
EIGRL,1,,,8
{grids}
{beams}
PBEAM,1,1,4.-4,4.-8,2.-8,0.,2.-8,{nsm}
,YES,1.,{AB},4.-8,2.-8,0.,2.-8,{nsm}
,,
,0.,0.,,,,,,
,{M1},,,,{N1},{N2},{N1B},{N2B}
MAT1,1,7.+10,,.3,{rho}
SPC1,1,123456,1
CONM2,99,{last},,.2
ENDDATA
"""


def beam(folder: Path, name: str, beams: int = 10, **values: object) -> Path:
    """A cantilever of 1 m with a mass at its tip, its neutral axis beside the shear centre, by PBEAM."""
    grids = "\n".join(f"GRID,{i + 1},,{i / beams:.6f},0.,0." for i in range(beams + 1))
    cards = "\n".join(f"CBEAM,{i},1,{i},{i + 1},0.,1.,0." for i in range(1, beams + 1))
    usual = {"N1": 0.0, "N2": 0.02, "M1": 0.0, "rho": 2700.0, "nsm": 0.0, "AB": "3.9-4"}
    usual |= values
    usual |= {"N1B": usual["N1"], "N2B": usual["N2"]}
    path = folder / f"{name}.bdf"
    path.write_text(DECK.format(grids=grids, beams=cards, last=beams + 1, **usual))
    return path


def solution(path: Path, count: int = 8):  # type: ignore[no-untyped-def]
    structure = build_structure(read_deck(path)).structure
    model = parametric_model(structure, ParameterSet(()), ())
    return solve_modes(configure(model, Configuration(support_set=1)).at(np.zeros(0)), count)


@pytest.mark.slow
def test_the_part_is_that_of_the_offset(tmp_path: Path) -> None:
    """M less the part is the mass matrix of the beam whose N1, N2 are zero; elements that are off have none."""
    for values in ({}, {"N1": -0.03, "M1": 0.05, "nsm": 0.4}):
        own, straight = (
            build_structure(read_deck(beam(tmp_path, name, **(values | more)))).structure  # type: ignore[arg-type]
            for name, more in (("own", {}), ("straight", {"N1": 0.0, "N2": 0.0}))
        )
        part, count = offset_mass(own)
        expected = assemble(straight, "mass").toarray()
        found = (assemble(own, "mass") - part).toarray()
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
        assert count == 10
        assert offset_mass(straight)[1] == 0
        assert offset_mass(own, [1, 2, 3])[1] == 7


@pytest.mark.quick(0)
@pytest.mark.parametrize("offset", [0.002, 0.01, 0.03])
def test_the_changes_are_those_of_the_moved_mass(tmp_path: Path, offset: float) -> None:
    """The stiffness of N2 beside the mass of N2 = 0, solved densely; bending along the offset does not change."""
    own = solution(beam(tmp_path, "own", N2=offset))
    straight = solution(beam(tmp_path, "straight", N2=0.0))
    K, M = own.point.stiffness.toarray(), straight.point.mass.toarray()
    values, vectors = la.eigh(K, M)
    exact = np.sqrt(values) / (2.0 * np.pi)
    found = offset_mass_change(own)
    assert found is not None
    assert found.beams == 10
    shapes = own.shapes[:, :8]
    likeness = (shapes.T @ M @ vectors) ** 2 / np.einsum("ij,ij->j", shapes, M @ shapes)[:, None]
    compared = 0
    for k, j in zip(*linear_sum_assignment(likeness, maximize=True)):
        if likeness[k, j] > 0.6:
            true = exact[j] / own.freq_hz[k] - 1.0
            assert found.change[k] == pytest.approx(true, abs=max(1e-5, 0.02 * abs(true)))
            compared += 1
    assert compared >= 6
    assert np.nanmax(np.abs(found.change)) > 1e-4


@pytest.mark.slow
def test_modes_and_info_tell(tmp_path: Path) -> None:
    """A warning above 1 %, an info below; both name the modes with their changes."""
    path = beam(tmp_path, "beam")
    found = ft.modes(path)
    (told,) = found[0].alerts
    assert (told.code, told.level) == ("model.neutral-axis", "warning")
    check_shown("model.neutral-axis", f"[{told.code}] {told.sentence}")
    assert told.sentence in repr(found)
    assert told in found.results.alerts
    assert told in ft.info(path).notices
    (small,) = ft.modes(beam(tmp_path, "small", N2=0.002))[0].alerts
    assert small.level == "info"
    none = ft.modes(beam(tmp_path, "none", N2=0.0))
    assert none[0].alerts == ()
    # the stiffness alone is no matter of the mass
    assert ft.modes(beam(tmp_path, "light", rho=0.0, nsm=1.0))[0].alerts == ()


@pytest.mark.slow
def test_info_tells_without_modes(tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    deck = beam(tmp_path, "beam")
    study.write_text(f'[study]\ntitle = "beam"\ndeck = "{deck.name}"\nunits = "m-kg-s"\n[checks]\nrefinement = false\n')
    told = [n for n in ft.info(study).notices if n.code == "model.neutral-axis"]
    assert [n.level for n in told] == ["info"]
    check_shown("model.neutral-axis, not computed", f"[{told[0].code}] {told[0].sentence}")
