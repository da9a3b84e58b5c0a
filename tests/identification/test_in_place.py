"""Poles that leave their clusters in the fit to the functions are no modes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.identification.conftest import Known

from femtune.identification.choice import Candidate
from femtune.identification.in_place import fit_in_place
from femtune.identification.modal_solve import OUT_OF_BAND
from femtune.identification.pole_table import PoleTable
from femtune.modal import freq_and_damping, pole_of

_LINES = np.linspace(8.0, 25.0, 250)


def _table(known: Any, freq: float, ratio: float, at: int) -> tuple[PoleTable, tuple[Candidate, ...]]:
    """The poles of the modes and a further one at a position, each a chosen cluster of one pole."""
    hz, ratios = np.insert(known.freq_hz, at, freq), np.insert(known.damping_ratio, at, ratio)
    shapes = np.insert(known.shapes, at, 1.0, axis=1).astype(complex)
    n = len(hz)
    table = PoleTable(pole_of(hz, ratios), shapes, np.full(n, 8), ("N4SID",) * n, known.dofs)
    candidates = tuple(
        Candidate(f, z, 0.0, 0.0, {"N4SID": 1.0}, 1.0, 0.0, np.array([i]), i, True, "stable")
        for i, (f, z) in enumerate(zip(hz.tolist(), ratios.tolist()))
    )
    return table, candidates


@pytest.mark.slow
@pytest.mark.parametrize("hz", [8.6, 16.5])
def test_every_mode_is_where_its_cluster_is_and_no_true_one_is_lost(three_modes: Any, hz: float) -> None:
    at = int(np.searchsorted(three_modes.freq_hz, hz))
    rejected = 0
    for seed in range(6):
        table, candidates = _table(three_modes, hz, 0.02, at)
        frfs = three_modes.frfs(_LINES, 0.02, seed)
        fit, after, told, remarks = fit_in_place(frfs, candidates, table, [False] * 4, None, OUT_OF_BAND)
        kept = [c for c in after if c.chosen]
        assert {i for i in range(4) if not after[i].chosen} <= {at}
        assert sorted(fit.begun_at[~fit.outside]) == list(range(len(kept)))
        freq = freq_and_damping(fit.poles[~fit.outside])[0]
        np.testing.assert_allclose(freq, [kept[i].freq_hz for i in fit.begun_at[~fit.outside]], rtol=0.05)
        assert [n.code for n in told] == ["identify.left-cluster"] * (4 - len(kept))
        assert not remarks
        rejected += 4 - len(kept)
    assert rejected


def test_a_pole_that_was_selected_manually_is_held_and_doubtful(three_modes: Any) -> None:
    # the third mode is taken out of the functions: its pole has nothing to fit
    two = Known(three_modes.freq_hz[:2], three_modes.damping_ratio[:2], three_modes.shapes[:, :2])
    table, candidates = _table(two, 24.8, 0.01, 2)
    frfs = two.frfs(_LINES, 0.02, 0)
    free = fit_in_place(frfs, candidates, table, [False] * 3, None, OUT_OF_BAND)
    fit, after, told, remarks = fit_in_place(frfs, candidates, table, [False, False, True], None, OUT_OF_BAND)
    assert [c.chosen for c in free[1]] == [True, True, False]
    assert all(c.chosen for c in after)
    assert not told
    assert fit.poles[fit.begun_at == 2] == table.poles[2]
    (remark,) = remarks
    assert remark.doubtful
    assert remark.mode == 2
