"""FRFs of the identified modes of a test, beside its measured FRFs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.dofs import DofSet
from femtune.modal import FrfSet, ModeSet
from femtune.modal.frf_set import KINDS
from femtune.steps.respond.identified_frfs import identified_frfs

HZ, ZETA = np.array([12.0, 30.0, 31.0]), np.array([0.01, 0.02, 0.005])
SHAPES = np.array([[1.0, 0.4, -0.3], [0.7, -0.9, 0.8]])
LINES = np.arange(0.0, 60.0, 0.1)
DOFS = DofSet.parse(["1Z+", "2Z+"])
MODES = ModeSet(HZ, SHAPES, DOFS, damping_ratio=ZETA)


def _frfs(kind: str) -> FrfSet:
    """Σ φφᵀ/(ω_r² − ω² + 2iζω_rω), with a rigid-body motion and a static term for the modes outside."""
    omega, of_mode = 2.0 * np.pi * LINES, 2.0 * np.pi * HZ
    with np.errstate(divide="ignore", invalid="ignore"):
        own = 1.0 / (of_mode[:, None] ** 2 - omega**2 + 2j * ZETA[:, None] * of_mode[:, None] * omega)
        values = np.einsum("ir,jr,rk->ijk", SHAPES, SHAPES, own) - 1e-2 / omega**2 + 1e-7
        values = values * (1j * omega) ** KINDS.index(kind)
    return FrfSet(LINES, np.where(omega > 0.0, values, np.nan), DOFS, DOFS, kind)


@pytest.mark.parametrize("kind", KINDS)
def test_they_are_the_measured_ones_where_the_modes_are_those_of_the_structure(kind: str) -> None:
    measured = _frfs(kind)
    found = identified_frfs(measured, MODES)
    assert found is not None
    lines, values = found
    assert (lines[0], lines[-1]) == pytest.approx((10.8, 34.1))
    own = measured.values[:, :, np.isin(LINES, lines)]
    np.testing.assert_allclose(values, own, rtol=1e-8)
    # with another frequency of a mode they are not, at the same lines
    wrong = identified_frfs(measured, replace(MODES, freq_hz=HZ * [1.0, 1.01, 1.0]))
    assert wrong is not None
    at = lines <= wrong[0][-1]
    assert np.abs(wrong[1] - own[:, :, at]).max() > 0.01 * np.abs(own).max()


def test_a_function_with_gaps_is_left_out_and_without_damping_there_is_none() -> None:
    measured = _frfs("accelerance")
    values = measured.values.copy()
    values[1, 0, 200] = np.nan
    found = identified_frfs(replace(measured, values=values), MODES)
    assert found is not None
    assert np.isnan(found[1]).all(axis=2).tolist() == [[False, False], [True, False]]
    assert identified_frfs(measured, None) is None
    assert identified_frfs(measured, replace(MODES, damping_ratio=None)) is None
    assert identified_frfs(measured, replace(MODES, damping_ratio=np.full(3, np.nan))) is None
    few = replace(measured, freq_hz=LINES[::100], values=measured.values[:, :, ::100])
    assert identified_frfs(few, MODES) is None
