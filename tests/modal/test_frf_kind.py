"""FRFs of other kinds, and FRAC."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal import FrfSet, as_kind, frac
from femtune.modal.frf_set import KINDS

_DOF = DofSet.parse(["1Z+"])


def _oscillator(freq_hz: np.ndarray, kind: str) -> FrfSet:
    """Mass 2, stiffness 800, dashpot 3."""
    s = 2j * np.pi * freq_hz
    values = s ** KINDS.index(kind) / (800.0 + 3.0 * s + 2.0 * s**2)
    return FrfSet(freq_hz, values[None, None], _DOF, _DOF, kind)


@pytest.mark.parametrize("given", KINDS)
@pytest.mark.parametrize("wanted", KINDS)
def test_every_kind_from_every_other(given: str, wanted: str) -> None:
    lines = np.linspace(0.5, 9.0, 18)
    found = as_kind(_oscillator(lines, given), wanted)
    assert found.kind == wanted
    np.testing.assert_allclose(found.values, _oscillator(lines, wanted).values, rtol=1e-14)


def test_a_line_at_zero() -> None:
    lines = np.array([0.0, 2.0])
    assert as_kind(_oscillator(lines, "receptance"), "accelerance").values[0, 0, 0] == 0.0
    back = as_kind(_oscillator(lines, "accelerance"), "mobility").values[0, 0]
    assert np.isnan(back[0])
    assert back[1] == pytest.approx(_oscillator(lines, "mobility").values[0, 0, 1])
    same = _oscillator(lines, "receptance")
    np.testing.assert_array_equal(as_kind(same, "receptance").values, same.values)


def test_frac_ignores_factors_and_gaps_and_sees_shifts() -> None:
    lines = np.linspace(0.5, 9.0, 200)
    a = _oscillator(lines, "accelerance").values[0, 0]
    b = (2.0 - 3.0j) * a
    b[7] = np.nan
    assert frac(a, b) == pytest.approx(1.0, abs=1e-14)
    shifted = frac(a, _oscillator(1.1 * lines, "accelerance").values[0, 0])
    assert shifted is not None
    assert shifted < 0.9
    assert frac(a, np.zeros(200)) is None
    assert frac(1e-200 * a, a) == pytest.approx(1.0)


def test_an_unknown_kind() -> None:
    with pytest.raises(FemtuneError, match="kind of FRF"):
        as_kind(_oscillator(np.array([1.0]), "mobility"), "inertance")
