"""Digests: equal for equal matrices, different for whatever is different."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
import scipy.sparse as sp

from femtune.model import ModelPoint, derivatives_digest, digest, matrices_digest
from femtune.model.digests import Part
from structures.springs import factor_model, spring_structure

MATRIX = sp.csr_array(np.array([[1.0, 0.0], [2.0, 3.0]]))


@pytest.mark.quick(40)
@pytest.mark.parametrize(
    ("one", "other"),
    list(combinations([
        (), (None,), ("",), ("None",), (0,), (0.0,), (-0.0,), (False,), ("a", "b"), ("ab",), ("b", "a"), (1.0,),
        (np.nextafter(1.0, 2.0),), (np.zeros(2),), (np.zeros(3),), (np.zeros((3, 1)),), (np.zeros((0, 3)),),
        (np.zeros((3, 0)),), (np.zeros(3, int),), (np.zeros(3, np.float32),), (np.zeros(3), np.zeros(0)), (MATRIX,),
        (MATRIX.T.tocsr(),), (2.0 * MATRIX,), (MATRIX.toarray(),), (sp.csr_array((2, 2)),), (sp.csr_array((2, 3)),),
    ], 2)),
)  # fmt: skip
def test_what_differs_has_another_digest(one: tuple[Part, ...], other: tuple[Part, ...]) -> None:
    assert digest(*one) != digest(*other)


def test_how_equal_things_lie_in_memory_does_not_matter() -> None:
    array = np.arange(24.0).reshape(4, 6)
    assert digest(array) == digest(np.asfortranarray(array)) == digest(np.repeat(array, 2, axis=1)[:, ::2])
    assert digest(1.5) == digest(np.float64(1.5))
    assert digest(MATRIX) == digest(MATRIX.tocsc()) == digest(MATRIX.copy())


def test_a_digest_is_sha256() -> None:
    # by sha256sum, of the text [str 'a']
    assert digest("a") == "3a121631762659f416b7f9e542927c001bb2849db7d1c96a86dd53f2b8e0240c"


def at(x: list[float], stiffness: float = 100.0, mass: float = 1.0, **groups: list[int]) -> ModelPoint:
    structure = spring_structure([(-1, 0, stiffness), (0, 1, 200.0)], [1.0, mass])
    return factor_model(structure, groups).at(np.array(x))


def both(point: ModelPoint) -> tuple[str, str]:
    return matrices_digest(point, "stiffness", "mass"), derivatives_digest(point)


def test_equal_points_have_equal_digests() -> None:
    assert both(at([0.1], a=[1])) == both(at([0.1], a=[1])) == both(at([0.1], renamed=[1]))


def test_another_structure_or_value_is_another_model() -> None:
    points = [at([0.1], a=[1]), at([0.2], a=[1]), at([0.1], stiffness=101.0, a=[1]), at([0.1], mass=1.1, a=[1])]
    for kind in (0, 1):
        assert len({both(p)[kind] for p in points}) == len(points)


def test_the_same_matrices_may_have_other_derivatives() -> None:
    one, other, more = at([0.0], a=[1]), at([0.0], a=[2]), at([0.0, 0.0], a=[1], b=[2])
    assert both(one)[0] == both(other)[0] == both(more)[0]
    assert len({both(p)[1] for p in (one, other, more)}) == 3


def test_matrices_that_are_not_asked_for_do_not_matter() -> None:
    light, heavy = at([0.0], a=[1]), at([0.0], mass=3.0, a=[1])
    assert matrices_digest(light, "stiffness") == matrices_digest(heavy, "stiffness")
    assert matrices_digest(light, "mass") != matrices_digest(light, "stiffness")
