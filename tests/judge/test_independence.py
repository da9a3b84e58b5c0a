"""Copies of a test are found, repeated measurements are not."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from femtune.dofs import DofSet
from femtune.judge.independence import shared_functions, shared_modes
from femtune.modal import FrfSet, ModeSet

_HZ = np.array([8.152, 12.895, 50.517, 79.744, 140.11])
_DOFS = DofSet.parse([f"{i}Z+" for i in range(1, 9)])


def _test(rng: np.random.Generator, frequency_sd: float = 0.0, shape_sd: float = 0.0) -> ModeSet:
    """A test of one structure, with the scatter of a measurement."""
    shapes = np.random.default_rng(5).normal(size=(8, 5))
    shapes = shapes / np.abs(shapes).max(axis=0)
    hz = _HZ * (1.0 + frequency_sd * rng.normal(size=5))
    return ModeSet(hz, shapes + shape_sd * rng.normal(size=shapes.shape), _DOFS)


def _rounded(values: np.ndarray, digits: int) -> np.ndarray:
    return np.vectorize(lambda v: float(f"{v:.{digits - 1}e}"))(values)


@pytest.mark.parametrize("digits", [5, 6, 13])
def test_a_copy_is_found_with_other_digits_scale_signs_and_order(digits: int) -> None:
    first = _test(np.random.default_rng(1), 1e-3, 1e-2)
    order = [3, 0, 2]
    turned = DofSet.parse([f"{i}Z-" for i in range(8, 2, -1)])
    shapes = -_rounded(25.4 * first.shapes[7:1:-1][:, order], digits)
    copy = ModeSet(_rounded(first.freq_hz[order], digits), shapes, turned)
    found = shared_modes(first, copy)
    assert found.by_shape
    assert sorted(found.pairs) == [(0, 1), (2, 2), (3, 0)]


def test_repeated_measurements_are_not_copies() -> None:
    # of 400 pairs of quiet repeats, each with five modes, none is taken for a copy
    rng = np.random.default_rng(2)
    repeats = [_test(rng, 1e-4, 2e-3) for _ in range(401)]
    assert [shared_modes(a, b).pairs for a, b in pairwise(repeats)] == [()] * 400


def test_other_channels_of_a_test_are_told_by_its_frequencies() -> None:
    first = _test(np.random.default_rng(3), 1e-3, 1e-2)
    upper, lower = (first.select_dofs(_DOFS.select(range(*part))) for part in ((0, 4), (4, 8)))
    found = shared_modes(upper, lower)
    assert not found.by_shape
    assert found.pairs == tuple((i, i) for i in range(5))
    again = _test(np.random.default_rng(4), 1e-3, 1e-2).select_dofs(_DOFS.select(range(4, 8)))
    assert shared_modes(upper, again).pairs == ()


def test_a_shape_that_was_not_measured_is_no_copy() -> None:
    first = _test(np.random.default_rng(3))
    assert shared_modes(first, replace(first, shapes=np.full((8, 5), np.nan))).pairs == tuple((i, i) for i in range(5))
    other = replace(first, shapes=np.random.default_rng(6).normal(size=(8, 5)))
    assert shared_modes(first, other).pairs == ()


def test_frfs_are_compared_line_by_line() -> None:
    rng = np.random.default_rng(8)
    hz, dofs = np.linspace(1.0, 40.0, 40), DofSet.parse(["1Z+", "2Z+"])
    values = rng.normal(size=(2, 2, 40)) + 1j * rng.normal(size=(2, 2, 40))
    first = FrfSet(hz, values, dofs, dofs, "accelerance")
    copy = FrfSet(hz[::2], -np.complex64(values[1:, :, ::2]), DofSet.parse(["2Z-"]), dofs, "accelerance")
    assert shared_functions(first, copy) == ((0, 0), (0, 1))
    assert shared_functions(first, replace(copy, kind="mobility")) == ()
    noisy = replace(copy, values=copy.values * (1.0 + 1e-3 * rng.normal(size=copy.values.shape)))
    assert shared_functions(first, noisy) == ()
    held = values.copy()
    held[1, 0] = np.nan
    assert shared_functions(replace(first, values=held), copy) == ((0, 1),)
