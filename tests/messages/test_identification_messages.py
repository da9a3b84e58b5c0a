"""What is said of spectra, of added masses, and of records over which modes are followed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.dofs import DofSet, parse_dof
from femtune.errors import FemtuneError
from femtune.identification.mass_change import scale_by_masses
from femtune.identification.tracking import track_modes
from femtune.modal import ModeSet
from femtune.modal.spectrum_set import spectrum_set

_MODES = ModeSet(np.array([5.0]), np.array([[1.0], [0.5]]), DofSet.parse(["1Z+", "2Z+"]))
_LINES, _ONES = np.array([1.0, 2.0]), np.ones(2, complex)
_A, _B, _C = (parse_dof(name) for name in ("1Z+", "2Z+", "3Z+"))


@pytest.mark.parametrize(
    ("name", "refused"),
    [
        ("identify.spectra", lambda: spectrum_set(_LINES, {(_A, _A): _ONES, (_A, _B): _ONES, (_B, _C): _ONES})),
        ("identify.spectra, autos", lambda: spectrum_set(_LINES, {(_A, _A): _ONES, (_B, _B): _ONES})),
        ("identify.added-mass", lambda: scale_by_masses(_MODES, _MODES, {_A: -0.1, _C: 0.2})),
        ("identify.added-mass, none", lambda: scale_by_masses(_MODES, _MODES, {_A: 0.1})),
        ("identify.tracking", lambda: track_modes(_MODES, [_MODES, _MODES], [20.0])),
    ],
)
def test_what_is_refused(name: str, refused: Callable[[], object]) -> None:
    with pytest.raises(FemtuneError) as caught:
        refused()
    check_shown(name, caught.value)
