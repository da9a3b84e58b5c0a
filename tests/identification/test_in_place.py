"""Poles that leave their clusters in the fit to the functions are no modes, and stay in the fit."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.identification import InputKnown, identify_frfs
from femtune.identification.choice import Candidate
from femtune.identification.in_place import in_place
from femtune.identification.modal_fit import ModalFit
from femtune.identification.near_band import fit_with_neighbours
from femtune.identification.pole_table import PoleTable
from femtune.modal import FrfSet, freq_and_damping, pole_of

from .conftest import Known

_BAND = (8.0, 25.0)
_LINES = np.linspace(*_BAND, 250)
_CHANGES: list[tuple[int, dict[str, Any], str]] = [
    (1, {"freq": 12.5}, "away"),
    (2, {"ratio": 0.13}, "away"),
    (2, {"turn": True}, "shape"),
]


def _table(known: Known, at: int, freq: float, ratio: float) -> tuple[PoleTable, tuple[Candidate, ...]]:
    """The poles of the modes and a further one at a position, each a chosen cluster of one pole."""
    hz, ratios = np.insert(known.freq_hz, at, freq), np.insert(known.damping_ratio, at, ratio)
    return _clusters(known, hz, ratios, np.insert(known.shapes, at, 1.0, axis=1))


def _clusters(known: Known, hz: Any, ratios: Any, shapes: Any) -> tuple[PoleTable, tuple[Candidate, ...]]:
    n = len(hz)
    table = PoleTable(pole_of(hz, ratios), shapes.astype(complex), np.full(n, 8), ("N4SID",) * n, known.dofs)
    candidates = tuple(
        Candidate(f, z, 0.0, 0.0, {"N4SID": 1.0}, 1.0, 0.0, np.array([i]), i, True, "stable")
        for i, (f, z) in enumerate(zip(hz.tolist(), ratios.tolist()))
    )
    return table, candidates


def _fit(frfs: FrfSet, table: PoleTable) -> ModalFit:
    return fit_with_neighbours(frfs, table.poles, None, ("lower", "upper"))


@pytest.mark.slow
@pytest.mark.parametrize("hz", [8.6, 16.5])
def test_a_pole_without_a_mode_is_not_reported_and_stays_in_the_fit(three_modes: Known, hz: float) -> None:
    at = int(np.searchsorted(three_modes.freq_hz, hz))
    left = 0
    for seed in range(4):
        table, candidates = _table(three_modes, at, hz, 0.02)
        fit = _fit(three_modes.frfs(_LINES, 0.02, seed), table)
        marked, after, told, remarks = in_place(fit, candidates, [False] * 4, table, _BAND)
        lost = [i for i in range(4) if not after[i].chosen]
        assert set(lost) <= {at}
        assert sorted(marked.begun_at[marked.left]) == lost
        assert [n.code for n in told] == ["identify.left-cluster"] * len(lost)
        np.testing.assert_array_equal(marked.poles, fit.poles)
        freq = freq_and_damping(marked.poles[marked.reported])[0]
        np.testing.assert_allclose(freq, [after[i].freq_hz for i in marked.begun_at[marked.reported]], rtol=0.05)
        assert not remarks
        left += len(lost)
    assert left


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "change", "why"), _CHANGES)
def test_the_end_is_compared_with_the_cluster(three_modes: Known, mode: int, change: dict[str, Any], why: str) -> None:
    hz, ratios, shapes = three_modes.freq_hz.copy(), three_modes.damping_ratio.copy(), three_modes.shapes.copy()
    fit = _fit(three_modes.frfs(_LINES, 0.001, 0), _clusters(three_modes, hz, ratios, shapes)[0])
    table, candidates = _clusters(three_modes, hz, ratios, shapes)
    assert not in_place(fit, candidates, [False] * 3, table, _BAND)[0].left.any()
    hz[mode], ratios[mode] = change.get("freq", hz[mode]), change.get("ratio", ratios[mode])
    if "turn" in change:
        shapes[:, mode] = [1.0, -1.0, 1.0]
    table, candidates = _clusters(three_modes, hz, ratios, shapes)
    marked, after, told, remarks = in_place(fit, candidates, [False] * 3, table, _BAND)
    lost = [i == mode and why != "shape" for i in range(3)]
    assert [not c.chosen for c in after] == lost
    assert marked.left.tolist() == lost
    notices = [*told, *(r.notice for r in remarks)]
    assert [n.code for n in notices] == ["identify.left-cluster"]
    assert ("another shape" in notices[0].what) == (why == "shape")
    by_hand = [i == mode for i in range(3)]
    if why == "away" and "freq" in change:
        check_shown("identify.left-cluster", told[0])
    marked, after, told, remarks = in_place(fit, candidates, by_hand, table, _BAND)
    assert not told
    assert not marked.left.any()
    (remark,) = remarks
    assert remark.mode == mode
    assert remark.doubtful


def test_a_mode_that_ends_outside_the_band_is_not_reported(three_modes: Known) -> None:
    table, candidates = _clusters(three_modes, three_modes.freq_hz, three_modes.damping_ratio, three_modes.shapes)
    fit = _fit(three_modes.frfs(_LINES, 0.001, 0), table)
    assert in_place(fit, candidates, [False] * 3, table, (8.0, 15.0))[0].left.tolist() == [False, False, True]
    with pytest.raises(FemtuneError, match=r"identify\.no-poles"):
        in_place(fit, candidates, [False] * 3, table, (12.0, 15.0))


@pytest.mark.slow
def test_of_two_poles_of_one_mode_the_one_from_nearer_is_reported() -> None:
    one = Known(np.array([10.0]), np.array([0.01]), np.array([[1.0]]))
    table, candidates = _clusters(one, np.array([9.9, 10.0]), np.array([0.01, 0.01]), np.ones((1, 2)))
    fit = _fit(one.frfs(_LINES, 0.001, 0), table)
    place = [int(np.flatnonzero(fit.begun_at == i)[0]) for i in range(2)]
    poles = fit.poles.copy()
    poles[place] = pole_of(np.array([9.9995, 10.0]), np.array([0.01, 0.01]))
    marked = in_place(replace(fit, poles=poles), candidates, [False] * 2, table, _BAND)[0]
    assert [bool(marked.left[i]) for i in place] == [True, False]


@pytest.mark.slow
def test_modes_of_an_identification_are_those_of_their_clusters(three_modes: Known) -> None:
    # leakage of a Hann window, and lines as far apart as half bandwidths
    lines = np.linspace(*_BAND, 60)
    for seed in range(3):
        frfs = three_modes.frfs(lines, 0.01, seed)
        values = frfs.values.copy()
        values[:, :, 1:-1] -= 0.5 * (frfs.values[:, :, 2:] + frfs.values[:, :, :-2])
        found = identify_frfs(
            FrfSet(lines, values, frfs.responses, frfs.references, frfs.kind), InputKnown(largest_order=16)
        )
        assert len(found.clusters) == len(found.modes)
        for hz, i in zip(found.modes.freq_hz, found.clusters):
            assert found.candidates[i].chosen
            assert abs(found.candidates[i].freq_hz - hz) < 0.06 * hz
