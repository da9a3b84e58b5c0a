"""Modal effective mass: closed forms of a cantilever, sums over all modes, free structures, parameters."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.deck_models import model_of

from femtune.model import Configuration, EigenSolution, solve_modes
from femtune.model.configuration import AddedMass
from femtune.model.response import effective_mass

Solve = Callable[..., EigenSolution]

_HEAD = "SOL 103\nCEND\nSPC = 1\nBEGIN BULK\nMAT1,1,2.1+11,,0.3,7850.\nPBAR,1,1,1.-3,2.-7,5.-7,4.-7\n"
_MASS = 7850.0 * 1e-3
"""Of a beam one metre long."""


def _beam(elements: int, supports: str = "SPC1,1,123456,1", more: str = "") -> str:
    grids = "".join(f"GRID,{i + 1},,{i / elements:.12f},0.,0.\n" for i in range(elements + 1))
    bars = "".join(f"CBAR,{i + 1},1,{i + 1},{i + 2},0.,1.,0.\n" for i in range(elements))
    return f"{_HEAD}{more}{grids}{bars}{supports}\nENDDATA\n"


@pytest.fixture
def solve(tmp_path: Path) -> Solve:
    """Modes of a deck."""

    def modes(text: str, count: int, configuration: Configuration | None = None) -> EigenSolution:
        path = tmp_path / "deck.bdf"
        path.write_text(text)
        return solve_modes(model_of(path, configuration).at(np.zeros(0)), count)

    return modes


def test_a_cantilever_has_the_parts_of_the_closed_form(solve: Solve) -> None:
    """Bernoulli beam: 4σ²/(βL)² for the bending modes, 8/((2n − 1)π)² for the axial ones, σ and βL of tables."""
    found = effective_mass(solve(_beam(60, more="PARAM,COUPMASS,1\n"), 12))
    assert found.total[:3] == pytest.approx([_MASS] * 3, rel=1e-9)
    bending = [4 * s**2 / b**2 for s, b in ((0.734095514, 1.875104069), (1.018467319, 4.694091133))]
    assert bending[0] == pytest.approx(0.613, abs=5e-4)
    for direction in (1, 2):
        carried = np.sort(found.fractions[:, direction])[::-1]
        np.testing.assert_allclose(carried[:2], bending, rtol=2e-3)
    axial = np.sort(found.fractions[:, 0])[::-1]
    assert axial[0] == pytest.approx(8 / np.pi**2, rel=1e-3)


@pytest.mark.parametrize("coupled", ["", "PARAM,COUPMASS,1\n"])
def test_all_modes_together_carry_all_mass_that_is_free(solve: Solve, coupled: str) -> None:
    """What sits on the support is not carried: half an element where mass is lumped."""
    found = effective_mass(solve(_beam(3, more=coupled), 100))
    carried = found.fractions.sum(axis=0)
    on_support = 1 / 6
    if not coupled:
        np.testing.assert_allclose(carried[:3], 1 - on_support, rtol=1e-9)
    else:
        assert (carried[:3] <= 1 + 1e-12).all()
        assert (carried[:3] > 1 - on_support).all()


def test_a_mass_on_a_spring_carries_everything(solve: Solve) -> None:
    deck = "SOL 103\nCEND\nBEGIN BULK\nGRID,1,,2.,3.,4.,,23456\nCONM2,1,1,,5.\nCELAS2,2,1.+4,1,1\nENDDATA\n"
    found = effective_mass(solve(deck, 1))
    assert found.total == pytest.approx([5, 5, 5, 0, 0, 0], abs=1e-12)
    assert found.fractions[0, :3] == pytest.approx([1, 0, 0], abs=1e-12)
    assert np.isnan(found.fractions[0, 3:]).all()
    assert found.about == pytest.approx([2, 3, 4])


def test_rigid_body_modes_of_a_free_structure_carry_all_and_the_others_nothing(solve: Solve) -> None:
    mass = "CONM2,99,2,,3.,.1,.2,.3,,+\n+,.5,,.6,,,.7\n"
    found = effective_mass(solve(_beam(4, supports="", more=mass).replace("SPC = 1\n", ""), 12))
    np.testing.assert_allclose(found.fractions[:6].sum(axis=0), 1.0, rtol=1e-7)
    assert np.abs(found.fractions[6:]).max() < 1e-9


def test_masses_of_the_configuration_and_elements_off_count(solve: Solve) -> None:
    configuration = Configuration(masses=(AddedMass(4, 100.0),), elements_off=frozenset({3}))
    found = effective_mass(solve(_beam(3), 100, configuration))
    assert found.total[0] == pytest.approx(100.0 + 2 / 3 * _MASS)


def test_scalar_points_have_no_direction(solve: Solve) -> None:
    deck = "SOL 103\nCEND\nBEGIN BULK\nSPOINT,1,2\nCELAS2,1,9.,1,0,2,0\nCMASS2,2,1.,1\nCMASS2,3,1.,2\nENDDATA\n"
    found = effective_mass(solve(deck, 2))
    assert not found.total.any()
    assert np.isnan(found.fractions).all()
