"""Modes are called rigid-body motions where they strain nothing, whatever is stiff elsewhere in the model."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.model import Configuration, EigenSolution, configure, parametric_model, solve_modes
from femtune.model.response.rigid import is_rigid
from femtune.parameters import ParameterSet
from femtune.steps.info.facts import model_modes
from structures.frames import make_structure, scalars
from structures.springs import spring_structure

GROUND = -1


def solution(springs: list[tuple[int, int, float]], n: int, count: int) -> EigenSolution:
    structure = spring_structure(springs, [1.0] * n)
    return solve_modes(
        configure(parametric_model(structure, ParameterSet(()), ()), Configuration("c")).at(np.zeros(0)), count
    )


def rigid(found: EigenSolution) -> int:
    number = model_modes("c", "before", found).rigid_body_modes
    assert number == is_rigid(found)[: found.wanted].sum()
    return number


@pytest.mark.parametrize("stiff", [1e2, 1e6, 1e9, 1e10])
def test_one_stiff_spring_makes_no_mode_rigid(stiff: float) -> None:
    """Two masses tied by a stiff spring beside a third: with the tie rigid, 2λ² − (4 + 2)λ … has the roots below."""
    held = solution([(0, GROUND, 1.0), (0, 1, stiff), (1, 2, 1.0), (2, GROUND, 1.0)], 3, 3)
    assert rigid(held) == 0
    # masses 2 and 1, stiffness [[2, −1], [−1, 2]]: 2λ² − 6λ + 3 = 0
    exact = (3.0 + np.array([-1.0, 1.0]) * np.sqrt(3.0)) / 2.0
    np.testing.assert_allclose(held.eigenvalues[:2], exact, rtol=max(2.0 / stiff, 1e-6))
    free = solution([(0, 1, stiff), (1, 2, 1.0)], 3, 3)
    assert rigid(free) == 1


@pytest.mark.parametrize("n", [4, 13])
def test_modes_twelve_decades_apart_are_all_elastic(n: int) -> None:
    stiffness = 10.0 ** np.linspace(0.0, 12.0, n)
    found = solution([(i, GROUND, float(k)) for i, k in enumerate(stiffness)], n, n)
    assert rigid(found) == 0
    np.testing.assert_allclose(found.eigenvalues, stiffness, rtol=1e-6)


def test_free_masses_are_rigid_beside_one_that_is_held() -> None:
    found = solution([(0, 1, 3.0), (2, 3, 1e10), (4, GROUND, 1.0)], 5, 5)
    assert rigid(found) == 2


@pytest.mark.parametrize("stiff", [1e14, 1e17, 1e19, 1e21])
def test_directions_beside_a_very_stiff_spring_are_not_held(stiff: float) -> None:
    """Four points on springs of 4e10, 5e10 and 6e10, the first two tied in x: each direction has its own modes."""
    at = [(p, d) for p in range(4) for d in range(3)]
    springs = [[6 * p + d, GROUND] for p, d in at] + [[0, 6]]
    structure = make_structure(
        np.arange(12.0).reshape(4, 3),
        [
            scalars("spring", springs, "K", [1e10 * (4 + d) for _, d in at] + [stiff]),
            scalars("scalar-mass", [[6 * p + d, GROUND] for p, d in at], "M", [10.0] * 12),
        ],
    )
    point = configure(parametric_model(structure, ParameterSet(()), ()), Configuration("c")).at(np.zeros(0))
    found = solve_modes(point, 11)
    np.testing.assert_allclose(found.eigenvalues[:11], np.repeat([4e9, 5e9, 6e9], [3, 4, 4]), rtol=1e-4)
    assert rigid(found) == 0
