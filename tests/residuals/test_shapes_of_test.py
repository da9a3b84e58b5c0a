"""Shape residuals with the standard deviations of the test's entries."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.residuals import ComparedCase, ShapeResidual, UpdateProblem
from femtune.residuals.kinds import ShapeScaling
from femtune.testing import check_residual
from structures.springs import factor_model, simulated_case, spring_structure

CHAIN = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0)]
TRUTH = (0.25, -0.3, 0.15)
SCALINGS: tuple[ShapeScaling, ...] = ("unit-norm", "largest-entry", "scale-factor", "mass")


def case_of(sd: np.ndarray | float | None, seed: int | None = None) -> ComparedCase:
    """A chain whose test shapes have these deviations, with noise of that size if a seed is given."""
    model = factor_model(spring_structure(CHAIN, [1.0, 2.0, 1.5, 1.0]), {"a": [1, 2], "b": [3], "m": [1002]})
    case = simulated_case(model, TRUTH, range(4), 3)
    shapes = case.test.shapes
    spread = None if sd is None else np.broadcast_to(sd, shapes.shape).copy()
    if seed is not None and spread is not None:
        shapes = shapes + spread * np.random.default_rng(seed).standard_normal(shapes.shape)
    return replace(case, test=replace(case.test, shapes=shapes, shapes_sd=spread, normalisation="mass"))


def problem(case: ComparedCase, residual: ShapeResidual) -> UpdateProblem:
    return UpdateProblem((case,), case.configured.model.parameters, (residual,))


SD = 0.01 * np.array([[1.0, 2.0, 1.0], [3.0, 1.0, 0.5], [0.5, 1.0, 2.0], [2.0, 1.5, 1.0]])


@pytest.mark.quick(0)
@pytest.mark.parametrize("scaling", SCALINGS)
def test_jacobian(scaling: ShapeScaling) -> None:
    check_residual(problem(case_of(SD), ShapeResidual("test", scaling)), np.array([0.02, 0.1, -0.1]))


@pytest.mark.parametrize("scaling", ["unit-norm", "scale-factor", "mass"])
def test_equal_deviations_are_one_number(scaling: ShapeScaling) -> None:
    """Of shapes of one norm; residuals may be turned, their squares are the same."""
    case = case_of(0.02)
    norm = np.linalg.norm(case.test.shapes, axis=0)
    case = replace(case, test=replace(case.test, shapes_sd=0.02 * np.broadcast_to(norm, (4, 3))))
    x = np.array([0.05, -0.1, 0.1])
    one = problem(case, ShapeResidual("test", scaling)).start(x)
    other = problem(case, ShapeResidual(0.02, scaling)).start(x)
    assert one.objective == pytest.approx(other.objective, rel=1e-9)
    np.testing.assert_allclose(one.jacobian.T @ one.jacobian, other.jacobian.T @ other.jacobian, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("scaling", SCALINGS)
@pytest.mark.slow
def test_residuals_of_the_true_model_have_unit_variance(scaling: ShapeScaling) -> None:
    squares, free = [], 0
    for seed in range(40):
        case = case_of(SD, seed)
        at = problem(case, ShapeResidual("test", scaling)).start(np.array(TRUTH))
        squares.append(2.0 * at.objective)
        free = len(at.residuals) - sum(b.lost for b in at.blocks)
    assert free == (12 if scaling == "mass" else 9)
    # the mean of χ² with `free` degrees of freedom, within four standard errors
    assert np.mean(squares) == pytest.approx(free, abs=4.0 * np.sqrt(2.0 * free / 40))


def test_the_entry_to_which_the_test_scales_gets_the_mean_square_of_the_others() -> None:
    sd = SD.copy()
    sd[0] = 0.0
    filled = sd.copy()
    filled[0] = np.sqrt(np.mean(sd[1:] ** 2, axis=0))
    x = np.zeros(3)
    one, other = (problem(case_of(s), ShapeResidual("test")).start(x) for s in (sd, filled))
    np.testing.assert_allclose(one.residuals, other.residuals)


@pytest.mark.parametrize(("sd", "name"), [(None, "shape"), (np.nan, "entries"), (0.0, "entries")])
def test_shapes_without_deviations_are_refused(sd: float | None, name: str) -> None:
    with pytest.raises(FemtuneError) as error:
        problem(case_of(sd), ShapeResidual("test")).start(np.zeros(3))
    assert error.value.code == "residual.no-scatter"
    if sd is None or np.isnan(sd):
        check_shown(f"residual.no-scatter, {name}", error.value)
