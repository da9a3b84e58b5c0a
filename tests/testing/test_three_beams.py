"""The benchmark of three beams, and mass along bars."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.fem.assemble import assemble
from femtune.model import configure, parametric_model, solve_modes
from femtune.parameters import ParameterSet
from structures.beams import CLAMPED, OFFSET_M, TRUE_HZ, three_beams
from structures.frames import bars, make_structure, rods

SECTION = {"E": 1.0, "G": 1.0, "A": 3.0, "J": 1.0, "rho": 2.0}
BENDING = {"I1": 1.0, "I2": 1.0}


@pytest.mark.parametrize("mass_offset", [None, OFFSET_M])
def test_the_published_frequencies(mass_offset: float | None) -> None:
    structure = three_beams(OFFSET_M, mass_offset)
    configured = configure(parametric_model(structure, ParameterSet(()), ()), CLAMPED)
    np.testing.assert_allclose(solve_modes(configured.at(np.zeros(0)), 5).freq_hz[:5], TRUE_HZ, atol=0.006)


@pytest.mark.parametrize("part", [bars([[0, 1]], {**SECTION, **BENDING}), rods([[0, 1]], SECTION)])
@pytest.mark.parametrize(("share", "ends"), [(0.0, (1 / 3, 1 / 6)), (0.5, (5 / 12, 1 / 12)), (1.0, (0.5, 0.0))])
def test_mass_along_a_bar(part, share: float, ends: tuple[float, float]) -> None:
    """Linear shape functions, Nastran's mean, and lumped."""
    structure = make_structure([[0, 0, 0], [0.5, 0, 0]], [part], consistent_mass=True, lumped_along=share)
    M = assemble(structure, "mass").toarray()
    np.testing.assert_allclose(M[np.ix_((0, 6), (0, 6))], 3.0 * np.array([ends, ends[::-1]]), rtol=1e-14)
