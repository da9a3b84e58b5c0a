"""Objectives with places that are hard for a search: narrow canyons, and curvature that the linear model lacks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest

from femtune.arrays import Reals
from femtune.residuals import CaseState, Residual, ResidualBlock, UpdateProblem, case_without_modes
from femtune.status import Status
from femtune.updating import SensitivityMethod, update
from structures.springs import factor_model, spring_structure

MINIMUM = SensitivityMethod(smallest_change=0.0)


@dataclass(frozen=True)
class Formula(Residual):
    """Residuals and Jacobian as functions of x."""

    values: Callable[[Reals], Reals] = field(repr=False)
    slopes: Callable[[Reals], Reals] = field(repr=False)
    label = "formula"

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        x = state.full.x
        r = self.values(x)
        return [self.block(state.case.name, "f", r, self.slopes(x) if derivatives else np.zeros((len(r), 0)), 1.0)]


def problem_of(k: int, values: Callable[[Reals], Reals], slopes: Callable[[Reals], Reals]) -> UpdateProblem:
    """Parameters 1 + x between 0.05 and 3."""
    springs = [(-1, i, 100.0) for i in range(k)]
    names = {f"p{i}": [i + 1] for i in range(k)}
    model = factor_model(spring_structure(springs, [1.0] * k), names, (0.05, 3.0))
    return UpdateProblem((case_without_modes(model, (Formula(values, slopes),)),), model.model.parameters)


WIDTH, DEPTH = 1e-6, 0.3
WIDTHS = np.array([1e-6, 2e-6, 4e-6])


def canyon_values(x: Reals) -> Reals:
    """A bowl about (1, 0.5) of height zero, above which the objective is ½·.3² but for a canyon along x₀ = x₁²."""
    return np.array([x[0] - 1.0, x[1] - 0.5, DEPTH * np.tanh((x[0] - x[1] ** 2) / WIDTH)])


def canyon_slopes(x: Reals) -> Reals:
    steep = DEPTH / WIDTH / np.cosh(min(abs(x[0] - x[1] ** 2) / WIDTH, 300.0)) ** 2
    return np.array([[1.0, 0.0], [0.0, 1.0], [steep, -2.0 * x[1] * steep]])


def test_a_narrow_canyon_is_left_by_one_long_step():
    """The start lies in the canyon, as a model does whose modes cross there: only tiny steps reduce the objective."""
    result = update(problem_of(2, canyon_values, canyon_slopes), MINIMUM)
    assert result.status is Status.CONVERGED
    np.testing.assert_allclose(result.x, [1.0, 0.5], atol=1e-6)
    assert result.objective == pytest.approx(0.5 * DEPTH**2)
    assert [i.long_step for i in result.history].count(True) == 1
    assert result.certificate is not None
    assert result.certificate.predicted_decrease < 1e-8


def test_three_canyons_that_cross_are_left_together():
    """A long step that leaves out fewer of them goes on in the others, and hardly reduces the objective."""
    centre = np.array([1.0, 1.0, 1.0, 0.5])

    def values(x: Reals) -> Reals:
        return np.concatenate([x - centre, DEPTH * np.tanh((x[:3] - x[3] ** 2) / WIDTHS)])

    def slopes(x: Reals) -> Reals:
        steep = DEPTH / WIDTHS / np.cosh(np.minimum(np.abs(x[:3] - x[3] ** 2) / WIDTHS, 300.0)) ** 2
        return np.vstack([np.eye(4), np.column_stack([np.diag(steep), -2.0 * x[3] * steep])])

    result = update(problem_of(4, values, slopes), MINIMUM)
    assert result.status is Status.CONVERGED
    np.testing.assert_allclose(result.x, centre, atol=1e-6)
    assert [i.long_step for i in result.history].count(True) == 3


def test_the_last_part_of_a_curved_valley_is_not_followed_to_its_end():
    """A residual of 10 cannot be reduced; along the valley x₁ = x₀²/2 a part of 2.5e-7 of the objective can."""

    def values(x: Reals) -> Reals:
        return np.array([10.0, 1e3 * (x[1] - 0.5 * x[0] ** 2), 5e-3 * (x[0] - 1.0)])

    def slopes(x: Reals) -> Reals:
        return np.array([[0.0, 0.0], [-1e3 * x[0], 1e3], [5e-3, 0.0]])

    result = update(problem_of(2, values, slopes), MINIMUM)
    assert result.status is Status.UNDETERMINED
    assert len(result.history) <= 60
    assert result.objective < 50.0 * (1.0 + 1e-7)


def test_a_place_that_cannot_be_left_is_not_called_a_minimum():
    """The bowl is only a hundredth as deep as the canyon."""

    def values(x: Reals) -> Reals:
        return canyon_values(x) * [0.02, 0.02, 1.0]

    def slopes(x: Reals) -> Reals:
        return canyon_slopes(x) * np.array([[0.02], [0.02], [1.0]])

    result = update(problem_of(2, values, slopes), MINIMUM)
    assert result.status is Status.STALLED
    assert result.objective == result.history[0].objective
    assert result.certificate is not None
    assert result.certificate.predicted_decrease > 1e-3


def test_steps_are_lengthened_where_the_curvature_is_less_than_the_linear_model_has():
    """A second residual is large and bends towards zero, so that the true curvature is a tenth of the linear one."""

    def values(x: Reals) -> Reals:
        return np.array([x[0] - 0.2, 10.0 - 0.045 * (x[0] - 0.2) ** 2])

    def slopes(x: Reals) -> Reals:
        return np.array([[1.0], [-0.09 * (x[0] - 0.2)]])

    result = update(problem_of(1, values, slopes), MINIMUM)
    np.testing.assert_allclose(result.x, [0.2], atol=1e-3)
    assert len(result.history) <= 12


@pytest.mark.quick(0)
@pytest.mark.parametrize("seed", range(8))
def test_a_minimum_with_as_many_residuals_as_parameters_is_no_stall(seed: int):
    """Jᵀr = 0 with r ≠ 0 makes a square Jacobian singular: rounding decides what its linear model still predicts."""
    k, rng = 3, np.random.default_rng(seed)
    mixed, turned = (np.linalg.qr(rng.normal(size=(k, k)))[0] for _ in range(2))
    centre, height, bend = rng.uniform(-0.4, 0.4, k), 10.0 ** rng.uniform(-3, 0), 10.0 ** rng.uniform(-2, 1)
    steepness = 10.0 ** rng.uniform(-1, 1, k - 1)

    def values(x: Reals) -> Reals:
        y = turned @ (x - centre)
        return mixed @ np.array([*((steepness + 0.1 * y[-1]) * y[:-1]), height + bend * y[-1] ** 2])

    def slopes(x: Reals) -> Reals:
        y = turned @ (x - centre)
        by_y = np.diag([*(steepness + 0.1 * y[-1]), 2.0 * bend * y[-1]])
        by_y[:-1, -1] = 0.1 * y[:-1]
        return mixed @ by_y @ turned

    result = update(problem_of(k, values, slopes), MINIMUM)
    assert result.status is Status.UNDETERMINED
    np.testing.assert_allclose(result.x, centre, atol=1e-5)
    assert result.objective == pytest.approx(0.5 * height**2, rel=1e-9)
