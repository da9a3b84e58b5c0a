"""Orthogonal arrays: balance and orthogonality of every array, by counting."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.experiments import array_names, hadamard, orthogonal_array, smallest_array
from femtune.experiments.arrays import columns_for

# runs, and levels ^ factors, as the arrays are listed by their usual names
_USUAL = {
    "L4": "2^3",
    "L8": "2^7",
    "L9": "3^4",
    "L12": "2^11",
    "L16": "2^15",
    "L16 4^5": "4^5",
    "L18": "2^1 3^7",
    "L25": "5^6",
    "L27": "3^13",
    "L32": "2^31",
    "L32 2^4 4^9": "2^4 4^9",
    "L36": "2^11 3^12",
    "L36 2^3 3^13": "2^3 3^13",
}


@pytest.mark.parametrize("name", array_names())
def test_every_pair_of_factors_has_every_pair_of_levels_equally_often(name: str) -> None:
    levels = orthogonal_array(name).levels
    counts = levels.max(axis=0) + 1
    for column, count in zip(levels.T, counts, strict=True):
        assert np.all(np.bincount(column) == len(levels) / count)
    for i, j in combinations(range(len(counts)), 2):
        pairs = [np.sum((levels[:, i] == a) & (levels[:, j] == b)) for a, b in product(*map(range, counts[[i, j]]))]
        assert set(pairs) == {len(levels) / len(pairs)}


@pytest.mark.parametrize("name", _USUAL)
def test_arrays_have_their_usual_factors(name: str) -> None:
    array = orthogonal_array(name)
    assert array.structure == _USUAL[name]
    assert len(array.levels) == int(name[1:].partition(" ")[0])


@pytest.mark.parametrize("name", array_names())
def test_no_array_has_more_degrees_of_freedom_than_runs(name: str) -> None:
    array = orthogonal_array(name)
    assert np.sum(array.counts - 1) <= len(array.levels) - 1


@pytest.mark.parametrize("order", [1, 2, *range(4, 52, 4), 60, 64, 76])
def test_hadamard_matrices_are_orthogonal(order: int) -> None:
    matrix = hadamard(order)
    assert set(matrix.ravel().tolist()) <= {-1, 1}
    np.testing.assert_array_equal(matrix.T @ matrix, order * np.eye(order))
    np.testing.assert_array_equal(matrix[:, 0], 1)


@pytest.mark.parametrize(
    ("counts", "name"),
    [
        ([2, 2], "L4"),
        ([2, 2, 2], "L8"),
        ([3, 3], "L9"),
        ([2, 3, 3], "L18"),
        ([3] * 5, "L18"),
        ([4, 4, 2], "L16 2^9 4^2"),
        ([5, 5], "L25"),
        ([6, 3], "L18 3^6 6^1"),
        ([2] * 10, "L12"),
        ([3] * 8, "L27"),
        ([2] * 8 + [3] * 8, "L36"),
    ],
)
def test_the_smallest_array_leaves_degrees_of_freedom_for_the_error(counts: list[int], name: str) -> None:
    array, columns = smallest_array(counts)
    assert array.name == name
    assert array.counts[columns].tolist() == counts
    assert len(set(columns)) == len(columns)
    assert len(array.levels) > 1 + sum(c - 1 for c in counts)


def test_columns_that_are_not_there() -> None:
    assert columns_for(orthogonal_array("L18"), [2, 2]) is None


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("design.unknown-array", lambda: orthogonal_array("L17")),
        ("design.no-array", lambda: smallest_array([7, 3])),
        ("design.runs", lambda: hadamard(52)),
    ],
)
def test_errors(name: str, call: object) -> None:
    with pytest.raises(FemtuneError) as caught:
        call()  # type: ignore[operator]
    check_shown(name, caught.value)
