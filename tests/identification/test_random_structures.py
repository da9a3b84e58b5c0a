"""Functions without noise of random structures: all modes of the band and no other, in one identification."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.identification import InputKnown, identify_frfs

from .random_structures import simulated


@pytest.mark.quick(0, gate=3)
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["beam", "frame", "plate"])
def test_no_false_mode_and_no_lost_mode(kind: str, seed: int) -> None:
    case = simulated(kind, seed)
    found, known = identify_frfs(case.frfs, InputKnown()).modes, case.modes
    np.testing.assert_allclose(found.freq_hz, known.freq_hz, rtol=1e-3)
    assert found.damping_ratio is not None
    np.testing.assert_allclose(found.damping_ratio, known.damping_ratio, rtol=0.05)
