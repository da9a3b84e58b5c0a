"""Pairing of frequencies without shapes by their order, and the doubt that a mode was missed."""

from __future__ import annotations

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.correlation.order import better_order, in_ascending_order
from femtune.correlation.pairing import Pairing, pair_modes
from femtune.dofs import DofSet
from femtune.modal import ModeSet

BEAM = np.array([1.875, 4.694, 7.855, 10.996, 14.137, 17.279, 20.420, 23.562]) ** 2
"""(kl)² of a clamped beam, proportional to its frequencies (Blevins 1979, table 8-1)."""

_ONE_BY_ONE = np.array([0.96, 0.95, 0.94, 0.955, 0.945, 0.95])
"""Test over model, with a common error of 5 % and errors of single modes of 1 %."""


def _modes(freq_hz: np.ndarray) -> ModeSet:
    return ModeSet(freq_hz, np.zeros((0, len(freq_hz))), DofSet(()))


def _paired(test: np.ndarray, model: np.ndarray, **options: object) -> tuple[dict[int, int], Pairing]:
    found = pair_modes(_modes(test), _modes(model), **options)  # type: ignore[arg-type]
    return dict(found.key), found


def _codes(found: Pairing) -> list[str]:
    return [notice.code for notice in found.notices]


def test_rigid_body_modes_are_passed_over_and_files_need_no_order() -> None:
    model = np.concatenate([np.zeros(6), BEAM])
    pairs, found = _paired(BEAM[[2, 0, 1]] * 1.02, model, rigid=6)
    assert pairs == {1: 6, 2: 7, 0: 8}
    assert _codes(found) == ["correlate.without-shapes"]
    assert all(np.isnan(pair.mac) for pair in found.pairs)


def test_a_pair_by_hand_moves_the_modes_above_it_and_left_out_modes_keep_their_place() -> None:
    test = BEAM[[0, 1, 3, 4, 5]]
    pairs, found = _paired(test, BEAM, fixed=[(2, 3)])
    assert pairs == {0: 0, 1: 1, 2: 3, 3: 4, 4: 5}
    assert _codes(found) == ["correlate.without-shapes"]
    pairs, found = _paired(test, BEAM, fixed=[(2, 3)], left_out={2: "held out"})
    assert pairs == {0: 0, 1: 1, 3: 4, 4: 5}
    assert [u.left_out for u in found.unpaired_test] == [True]
    _, found = _paired(test, BEAM, fixed=[(i, i + (i > 1)) for i in range(5)])
    check_shown("correlate.without-shapes, by hand", str(found.notices[0]))
    # a mode below a pair by hand has no partner above it
    assert in_ascending_order(np.array([1.0, 2.0, 3.0]), 5, fixed=[(2, 1)]) == {0: 0, 2: 1}


def test_a_missed_mode_is_named_with_the_pair_that_mends_it() -> None:
    test = _ONE_BY_ONE * np.delete(BEAM, 2)[:6]
    pairs, found = _paired(test, BEAM, frequency_gate=np.inf)
    assert pairs == {i: i for i in range(6)}
    assert _codes(found) == ["correlate.without-shapes", "correlate.order-doubtful"]
    check_shown("correlate.without-shapes", str(found.notices[0]))
    check_shown("correlate.order-doubtful", str(found.notices[1]))
    pairs, found = _paired(test, BEAM, fixed=[(2, 3)])
    assert pairs == {0: 0, 1: 1, 2: 3, 3: 4, 4: 5, 5: 6}
    assert _codes(found) == ["correlate.without-shapes"]


def test_modes_of_the_suspension_in_the_list_are_told() -> None:
    model = np.concatenate([np.zeros(6), BEAM])
    test = np.concatenate([[0.5, 0.6, 0.9], BEAM[:5] * _ONE_BY_ONE[:5]])
    _, found = _paired(test, model, rigid=6)
    assert _codes(found)[-1] == "correlate.order-doubtful"
    check_shown("correlate.order-doubtful, suspension", str(found.notices[-1]))
    left_out = dict.fromkeys(range(3), "suspension")
    pairs, found = _paired(test, model, rigid=6, fixed=[(3, 6)], left_out=left_out)
    assert pairs == {i: i + 3 for i in range(3, 8)}
    assert _codes(found) == ["correlate.without-shapes"]


def _spectrum(kind: int, rng: np.random.Generator) -> np.ndarray:
    """Frequencies of a beam, of a plate of random sides, and of a random structure."""
    if kind == 0:
        return ((np.arange(1, 19) - 0.5) * np.pi) ** 2
    if kind == 1:
        side = rng.uniform(0.3, 1.0)
        return np.sort([i * i + (j / side) ** 2 for i in range(1, 20) for j in range(1, 20)])[:18]
    return np.asarray(10.0 + np.cumsum(rng.exponential(5.0, 18)))


@pytest.mark.parametrize("kind", [0, 1, 2])
def test_level_and_power_of_the_doubt(kind: int) -> None:
    """Models with a common error of 5 % and 2 % one by one: of 50 lists a level of 1.5 % gives more than 5 with a
    probability of 1e-3; a power of 91 % gives fewer than 37 with the same."""
    rng = np.random.default_rng(7 + kind)
    wrong = found = 0
    for _ in range(50):
        model = _spectrum(kind, rng)
        true = np.sort(model * np.exp(0.05 * rng.standard_normal() + 0.02 * rng.standard_normal(len(model))))
        missed = int(rng.integers(0, 6))
        test = np.delete(true, missed)[:8]
        wrong += better_order(true[:8], model, in_ascending_order(true[:8], len(model))) is not None
        other = better_order(test, model, in_ascending_order(test, len(model)))
        found += other is not None and other.of_model
    assert wrong <= 5
    assert found >= 37
