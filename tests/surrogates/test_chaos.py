"""Polynomial chaos: against polynomials that are known, least squares, closed forms of Sobol's indices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from math import pi

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.experiments import latin_hypercube, sobol_indices
from femtune.surrogates import (
    ChaosRules,
    Surrogate,
    chaos_indices,
    explained_variances,
    fit_surrogate,
    term_counts,
)
from femtune.surrogates.chaos import LegendreProducts, folds, products_up_to

_RNG = np.random.default_rng(4)
_X = _RNG.random((40, 3))
_NEW = _RNG.random((7, 3))
_UNIT = (np.zeros(3), np.ones(3))
_RULES = ChaosRules(4)


def _function(x: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(3.0 * x[:, 0]) + x[:, 1] * x[:, 2] + 2.0, np.exp(x[:, 0] - x[:, 1]) + 1.0], axis=1)


@cache
def _fitted() -> Surrogate:
    return fit_surrogate(_X, _function(_X), _RULES, _UNIT)


def _ishigami(x: np.ndarray, a: float = 7.0, b: float = 0.1) -> np.ndarray:
    """Of the unit cube; a and b as Ishigami and Homma 1990."""
    z = pi * (2.0 * x - 1.0)
    return np.asarray(np.sin(z[:, 0]) + a * np.sin(z[:, 1]) ** 2 + b * z[:, 2] ** 4 * np.sin(z[:, 0]))[:, None]


def _ishigami_indices(a: float = 7.0, b: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """First and total indices in closed form."""
    one, two = 0.5 * (1.0 + b * pi**4 / 5.0) ** 2, a**2 / 8.0
    both = b**2 * pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    whole = one + two + both
    return np.array([one, two, 0.0]) / whole, np.array([one + both, two, both]) / whole


def test_the_polynomials_are_orthonormal() -> None:
    nodes, weights = np.polynomial.legendre.leggauss(8)
    grid = np.stack([a.ravel() for a in np.meshgrid(*[0.5 * (nodes + 1.0)] * 2)], axis=1)
    weight = np.outer(weights, weights).ravel() / 4.0
    values = LegendreProducts(products_up_to(2, 5)).value(grid)
    np.testing.assert_allclose(values.T @ (weight[:, None] * values), np.eye(21), atol=1e-12)


@pytest.mark.slow
def test_a_sparse_polynomial_is_found_exactly() -> None:
    """Four of 84 products, from fewer runs than there are products."""
    x = latin_hypercube(3, 50, 1).points
    y = 1.0 + x[:, 0] ** 2 - 3.0 * x[:, 1] * x[:, 2]
    y = (y + (2.0 * x[:, 0] - 1.0) ** 6)[:, None]
    surrogate = fit_surrogate(x, y, ChaosRules(degree=6), _UNIT)
    expected = 1.0 + _NEW[:, 0] ** 2 - 3.0 * _NEW[:, 1] * _NEW[:, 2] + (2.0 * _NEW[:, 0] - 1.0) ** 6
    np.testing.assert_allclose(surrogate.predict(_NEW)[:, 0], expected, rtol=1e-9)


def test_the_coefficients_are_those_of_least_squares() -> None:
    surrogate = _fitted()
    y = (surrogate.y - surrogate.centre) / surrogate.scale
    for fit, column in zip(surrogate.fits, y.T, strict=True):
        values = LegendreProducts(fit.degrees).value(_X)
        np.testing.assert_allclose(fit.coefficients, np.linalg.lstsq(values, column, rcond=None)[0], atol=1e-9)


@pytest.mark.slow
def test_runs_that_are_left_out_are_predicted_by_a_fit_without_them() -> None:
    """Which chooses its terms again, so that they differ."""
    surrogate = _fitted()
    counts = []
    for left_out in folds(40)[:2]:
        kept = np.setdiff1d(np.arange(40), left_out)
        without = fit_surrogate(_X[kept], surrogate.y[kept], _RULES, _UNIT)
        counts.append(term_counts(without))
        np.testing.assert_allclose(surrogate.left_out[left_out], without.predict(_X[left_out]), rtol=1e-7)
        # with the variance of the whole, in the units of each
        fits = tuple(
            replace(new, variance=old.variance * ratio**2)
            for new, old, ratio in zip(without.fits, surrogate.fits, surrogate.scale / without.scale, strict=True)
        )
        errors = (surrogate.y - surrogate.left_out)[left_out]
        expected = errors / replace(without, fits=fits).predict_sd(_X[left_out])
        np.testing.assert_allclose(surrogate.left_out_ratio[left_out], expected, rtol=1e-4)
    assert set(counts) != {term_counts(surrogate)}


def test_the_variance_is_that_of_cross_validation() -> None:
    """Errors over their standard deviations have unit mean square; those of new runs do not change it."""
    surrogate = _fitted()
    np.testing.assert_allclose(np.mean(surrogate.left_out_ratio**2, axis=0), 1.0, rtol=1e-12)
    again = surrogate.with_runs(np.vstack([_X, _NEW]), np.vstack([surrogate.y, surrogate.predict(_NEW)]))
    np.testing.assert_allclose(again.predict(_X), surrogate.predict(_X), rtol=1e-9)
    assert np.all(again.predict_sd(_NEW) < surrogate.predict_sd(_NEW))
    assert np.all(again.predict_sd(_NEW) > 0.3 * surrogate.predict_sd(_NEW))


def test_leaving_out_one_run_with_unchanged_terms() -> None:
    surrogate = _fitted().with_runs(_X, _function(_X))
    for i in (0, 7, 24):
        kept = np.arange(40) != i
        without = surrogate.with_runs(surrogate.x[kept], surrogate.y[kept])
        np.testing.assert_allclose(surrogate.left_out[i], without.predict(_X[i])[0], rtol=1e-6)
        error = (surrogate.y[i] - surrogate.left_out[i]) / surrogate.left_out_ratio[i]
        np.testing.assert_allclose(np.abs(error), without.predict_sd(_X[i])[0], rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("logarithms", [False, True])
def test_the_gradient_of_a_prediction_by_complex_step(logarithms: bool) -> None:
    x, new = _X + 0.5, _NEW + 0.5
    surrogate = fit_surrogate(x, _function(_X), ChaosRules(4, logarithms))
    gradient = surrogate.gradient(new)
    for i, direction in enumerate(np.eye(3)):
        moved = surrogate.predict(new + 1e-30j * direction).imag / 1e-30
        np.testing.assert_allclose(gradient[:, :, i], moved, rtol=1e-9, atol=1e-9 * np.abs(gradient).max())


def test_second_derivatives_by_complex_step_of_the_first() -> None:
    fit = _fitted().fits[0]
    curved = fit.curvatures(_NEW)
    for i, direction in enumerate(np.eye(3)):
        moved = fit.slopes(_NEW + 1e-30j * direction).imag / 1e-30
        np.testing.assert_allclose(curved[:, i], moved, rtol=1e-9, atol=1e-9 * np.abs(curved).max())


def _waves(x: np.ndarray) -> np.ndarray:
    """A smooth random function of five variables: twelve cosines."""
    rng = np.random.default_rng(3)
    waves, phases = 0.8 * rng.normal(size=(5, 12)), 2.0 * pi * rng.random(12)
    return np.asarray(np.cos(x @ waves + phases) @ rng.normal(size=12))[:, None]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("function", "parameters", "runs", "degree"),
    [
        (_function, 3, 60, 3),
        (_ishigami, 3, 200, 12),
        (_waves, 5, 150, 6),
    ],
)
@pytest.mark.parametrize("tables", [2, pytest.param(4, marks=pytest.mark.long)])
def test_errors_and_intervals_are_those_of_fresh_runs(
    function: Callable[[np.ndarray], np.ndarray], parameters: int, runs: int, degree: int, tables: int
) -> None:
    """Of 90 % intervals, and of the root mean square of the errors of runs that are left out."""
    rng = np.random.default_rng(6)
    box = np.zeros(parameters), np.ones(parameters)
    inside, ratio = [], []
    for seed in range(tables):
        x, new = latin_hypercube(parameters, runs, seed).points, rng.random((500, parameters))
        surrogate, truth = fit_surrogate(x, function(x), ChaosRules(degree), box), function(new)
        low, high = surrogate.interval(new, 0.9)
        inside.append(np.mean((truth > low) & (truth < high)))
        fresh = np.sqrt(np.mean((truth - surrogate.predict(new)) ** 2, axis=0))
        ratio.append(np.sqrt(np.mean((surrogate.y - surrogate.left_out) ** 2, axis=0)) / fresh)
    assert 0.85 < np.mean(inside) < 0.97
    assert 0.7 < np.exp(np.mean(np.log(ratio))) < 2.0


@pytest.mark.slow
def test_the_indices_of_ishigami_are_those_of_the_closed_form() -> None:
    x = latin_hypercube(3, 300, 1).points
    surrogate = fit_surrogate(x, _ishigami(x), ChaosRules(degree=10), _UNIT)
    found, (first, total) = chaos_indices(surrogate), _ishigami_indices()
    np.testing.assert_allclose(found.first[:, 0], first, atol=2e-3)
    np.testing.assert_allclose(found.total[:, 0], total, atol=2e-3)
    sampled = sobol_indices(surrogate.predict, 3, 4096)
    np.testing.assert_allclose(found.total, sampled.total, atol=0.02)


@pytest.mark.slow
def test_indices_of_several_responses_do_not_depend_on_their_directions() -> None:
    x = latin_hypercube(3, 60, 1).points
    y = np.stack([x[:, 0] + 2.0 * x[:, 1], x[:, 1] * x[:, 2]], axis=1)
    angle = np.array([[0.6, -0.8], [0.8, 0.6]])
    one, other = (
        explained_variances(fit_surrogate(x, values, ChaosRules(degree=2), _UNIT)) for values in (y, y @ angle)
    )
    # variances: 1/12, 4/12; 1/48, 1/48, and 1/144 of both
    whole = 5.0 / 12.0 + 7.0 / 144.0
    alone = np.array([1.0 / 12.0, 1.0 / 3.0 + 1.0 / 48.0, 1.0 / 48.0]) / whole
    with_others = alone + np.array([0.0, 1.0, 1.0]) / 144.0 / whole
    for found in (one, other):
        np.testing.assert_allclose(found.first[:, 0], alone, atol=1e-9)
        np.testing.assert_allclose(found.total[:, 0], with_others, atol=1e-9)


def test_a_response_that_does_not_vary() -> None:
    surrogate = fit_surrogate(_X, np.full((40, 1), 4.0), ChaosRules())
    np.testing.assert_allclose(surrogate.predict(_NEW), 4.0)
    np.testing.assert_array_equal(chaos_indices(surrogate).total, 0.0)


def test_too_few_runs() -> None:
    with pytest.raises(FemtuneError) as caught:
        fit_surrogate(_X[:5], _function(_X)[:5], ChaosRules())
    check_shown("surrogate.too-few-runs, chaos", caught.value)
