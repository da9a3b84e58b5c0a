"""Kriging: against definitions computed directly, closed forms, functions that are known, and the rack's tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.surrogates import KrigingRules, Surrogate, fit_surrogate
from femtune.surrogates.kinds import CORRELATIONS, TRENDS
from femtune.surrogates.kriging import RestrictedLikelihood
from femtune.surrogates.trend import term_slopes, terms
from structures import rack_tables

_RNG = np.random.default_rng(4)
_X = _RNG.random((25, 3))
_NEW = _RNG.random((7, 3))


def _function(x: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(3.0 * x[:, 0]) + x[:, 1] * x[:, 2] + 2.0, np.exp(x[:, 0] - x[:, 1]) + 1.0], axis=1)


def _fitted(**rules: object) -> Surrogate:
    return fit_surrogate(_X, _function(_X), KrigingRules(starts=1, **rules))  # type: ignore[arg-type]


def _plug_in(surrogate: Surrogate) -> Surrogate:
    """As if lengths and noise were known."""
    return replace(surrogate, fits=tuple(replace(fit, others=(), widened=1.0) for fit in surrogate.fits))


def _refitted(surrogate: Surrogate, kept: np.ndarray) -> Surrogate:
    """On some of the runs, at the same lengths, noise and variance."""
    fitted = surrogate.with_runs(surrogate.x[kept], surrogate.y[kept])
    pairs = zip(fitted.fits, surrogate.fits, strict=True)
    return replace(fitted, fits=tuple(replace(new, variance=old.variance) for new, old in pairs))


@pytest.mark.parametrize("correlation", [c for c in CORRELATIONS if c != "none"])
@pytest.mark.parametrize("trend", TRENDS)
def test_the_gradient_of_the_likelihood(correlation: str, trend: str) -> None:
    y = _function(_X)[:, 0]
    likelihood = RestrictedLikelihood.of(
        _X, (y - y.mean()) / y.std(), KrigingRules(trend=trend, correlation=correlation)
    )
    log = np.array([0.3, -0.2, 0.6, -5.0])
    _, slope = likelihood.negative(log)
    step = 1e-5
    for i, direction in enumerate(np.eye(4)):
        change = likelihood.negative(log + step * direction)[0] - likelihood.negative(log - step * direction)[0]
        assert slope[i] == pytest.approx(change / (2.0 * step), rel=1e-5, abs=1e-7)


def test_the_restricted_likelihood_is_that_of_contrasts() -> None:
    """Its value differs from the density of any set of contrasts by a constant (Harville 1974)."""
    y = _function(_X)[:, 0]
    rules = KrigingRules(trend="linear")
    likelihood = RestrictedLikelihood.of(_X, y, rules)
    F = terms(_X, "linear")
    contrasts = np.linalg.svd(F)[0][:, F.shape[1] :].T
    constants = []
    for log in (np.array([0.0, 0.0, 0.0, -4.0]), np.array([0.5, -0.5, 0.2, -6.0])):
        fit = likelihood.solved(log)[0]
        R = CORRELATIONS["gaussian"].load().value(np.sum(((_X[:, None] - _X) / fit.lengths) ** 2, axis=2))
        covariance = fit.variance * contrasts @ (R + fit.noise * np.eye(len(_X))) @ contrasts.T
        density = stats.multivariate_normal(cov=covariance, allow_singular=False).logpdf(contrasts @ y)
        constants.append(density - fit.log_likelihood)
    assert constants[0] == pytest.approx(constants[1], abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("rules", [{}, {"correlation": "none", "trend": "quadratic"}, {"trend": "linear"}])
def test_leaving_out_one_run_is_fitting_without_it(rules: dict[str, str]) -> None:
    surrogate = _plug_in(_fitted(**rules))
    for i in (0, 7, 24):
        without = _refitted(surrogate, np.arange(25) != i)
        np.testing.assert_allclose(surrogate.left_out[i], without.predict(_X[i])[0], rtol=1e-6)
        error = (surrogate.y[i] - surrogate.left_out[i]) / surrogate.left_out_ratio[i]
        np.testing.assert_allclose(np.abs(error), without.predict_sd(_X[i])[0], rtol=1e-4)


def test_prediction_and_its_variance_are_those_of_the_conditional_normal() -> None:
    """A trend with a very wide prior is a part of the covariance; the rest is textbook conditioning."""
    surrogate = _plug_in(_fitted(trend="linear"))
    fit = surrogate.fits[0]
    y = (surrogate.y[:, 0] - surrogate.centre[0]) / surrogate.scale[0]
    every = surrogate.in_unit_cube(np.vstack([_X, _NEW]))
    kernel = CORRELATIONS["gaussian"].load().value(np.sum(((every[:, None] - every) / fit.lengths) ** 2, axis=2))
    F = terms(every, "linear")
    covariance = fit.variance * (kernel + fit.noise * np.eye(len(every))) + 1e5 * F @ F.T
    old, new = slice(0, 25), slice(25, 32)
    gain = np.linalg.solve(covariance[old, old], covariance[old, new]).T
    mean = gain @ y
    variance = np.diag(covariance[new, new] - gain @ covariance[old, new])
    found = (surrogate.predict(_NEW)[:, 0] - surrogate.centre[0]) / surrogate.scale[0]
    np.testing.assert_allclose(found, mean, atol=1e-4)
    np.testing.assert_allclose(surrogate.predict_sd(_NEW)[:, 0] / surrogate.scale[0], np.sqrt(variance), atol=2e-4)


def test_a_response_surface_is_ordinary_least_squares() -> None:
    surrogate = _fitted(correlation="none", trend="quadratic")
    F, new = terms(_X, "quadratic"), terms(_NEW, "quadratic")
    y = _function(_X)
    beta, squares, *_ = np.linalg.lstsq(F, y, rcond=None)
    np.testing.assert_allclose(surrogate.predict(_NEW), new @ beta, rtol=1e-9)
    leverage = np.sum(new @ np.linalg.inv(F.T @ F) * new, axis=1)
    sd = np.sqrt(np.outer(1.0 + leverage, squares / (25 - 10)))
    np.testing.assert_allclose(surrogate.predict_sd(_NEW), sd, rtol=1e-8)
    low, high = surrogate.interval(_NEW, 0.9)
    np.testing.assert_allclose(high - low, 2.0 * stats.t.ppf(0.95, 15) * sd, rtol=1e-8)


@pytest.mark.quick(0)
@pytest.mark.parametrize("logarithms", [False, True])
@pytest.mark.parametrize("correlation", [*CORRELATIONS])
def test_the_gradient_of_a_prediction_by_complex_step(correlation: str, logarithms: bool) -> None:
    x = _X + 0.5
    surrogate = fit_surrogate(
        x, _function(_X), KrigingRules(trend="quadratic", correlation=correlation, logarithms=logarithms, starts=1)
    )
    gradient = surrogate.gradient(_NEW + 0.5)
    for i, direction in enumerate(np.eye(3)):
        moved = surrogate.predict(_NEW + 0.5 + 1e-30j * direction).imag / 1e-30
        np.testing.assert_allclose(gradient[:, :, i], moved, rtol=1e-9, atol=1e-9 * np.abs(gradient).max())


def test_the_slopes_of_the_trend() -> None:
    slopes = term_slopes(_NEW, "quadratic")
    for i, direction in enumerate(np.eye(3)):
        np.testing.assert_allclose(slopes[:, :, i], terms(_NEW + 1e-30j * direction, "quadratic").imag / 1e-30)


def test_without_noise_it_passes_through_the_runs() -> None:
    surrogate = _fitted(noise="none", trend="linear")
    np.testing.assert_allclose(surrogate.predict(_X), _function(_X), rtol=1e-4)
    assert np.all(surrogate.predict_sd(_X) < 3e-3 * surrogate.scale)
    assert np.all(surrogate.predict_sd(_NEW) > 1e-6 * surrogate.scale)


def test_a_trend_is_found_exactly() -> None:
    x = np.random.default_rng(3).random((20, 2)) * [2.0, 5.0]
    y = (1.0 + 2.0 * x[:, 0] - x[:, 1] + 0.5 * x[:, 0] * x[:, 1])[:, None]
    surrogate = fit_surrogate(x, y, KrigingRules(trend="quadratic", correlation="none"))
    new = np.array([[3.0, -1.0]])
    assert surrogate.predict(new)[0, 0] == pytest.approx(1.0 + 6.0 + 1.0 - 1.5)


def test_power_laws_are_linear_in_logarithms() -> None:
    x = 0.5 + np.random.default_rng(3).random((12, 2))
    y = (3.0 * x[:, 0] ** 0.5 / x[:, 1])[:, None]
    rules = KrigingRules(trend="linear", correlation="none", logarithms=True)
    assert fit_surrogate(x, y, rules).predict(np.array([[4.0, 0.1]]))[0, 0] == pytest.approx(60.0)


def test_a_response_that_does_not_vary() -> None:
    surrogate = fit_surrogate(_X, np.full((25, 1), 4.0))
    np.testing.assert_allclose(surrogate.predict(_NEW), 4.0)
    np.testing.assert_allclose(surrogate.gradient(_NEW), 0.0)


def test_the_variance_contains_that_lengths_and_noise_are_estimated() -> None:
    """Along each axis of the likelihood: mean change of the variance, and mean square change of the prediction."""
    surrogate = _fitted(trend="linear")
    u = surrogate.in_unit_cube(_NEW)
    for fit in surrogate.fits:
        assert len(fit.others) == 4
        alone = replace(fit, others=(), widened=1.0)
        total = alone.spread(u) ** 2
        for one, other in fit.others:
            # both on their side, where the likelihood is smaller by a half, or as far as they may be
            assert max(one.log_likelihood, other.log_likelihood) <= fit.log_likelihood
            for side in (one, other):
                total += 0.5 * (side.spread(u) ** 2 - alone.spread(u) ** 2 + (side.value(u) - fit.value(u)) ** 2)
        assert (fit.spread(u) / fit.widened) ** 2 == pytest.approx(np.maximum(total, 0.5 * alone.spread(u) ** 2))
        assert 0.5 < fit.widened < 2.0
    # what was found of the hyperparameters stays where other runs are fitted
    again = surrogate.with_runs(surrogate.x[:20], surrogate.y[:20])
    assert [fit.widened for fit in again.fits] == [fit.widened for fit in surrogate.fits]
    assert all(len(fit.others) == 4 for fit in again.fits)


@pytest.mark.long
@pytest.mark.parametrize("correlation", ["gaussian", "matern-5/2"])
def test_intervals_cover_responses_that_are_what_kriging_assumes(correlation: str) -> None:
    """90 % intervals of draws from the process itself."""
    rng = np.random.default_rng(8)
    kind, inside = CORRELATIONS[correlation].load(), []
    for _ in range(60):
        x = rng.random((55, 2))
        R = kind.value(np.sum(((x[:, None] - x) / [0.4, 0.8]) ** 2, axis=2)) + 1e-4 * np.eye(55)
        y = np.linalg.cholesky(R) @ rng.standard_normal((55, 2))
        surrogate = fit_surrogate(x[:35], y[:35], KrigingRules(correlation=correlation))
        low, high = surrogate.interval(x[35:], 0.9)
        inside.append(np.mean((y[35:] > low) & (y[35:] < high)))
    assert 0.87 < np.mean(inside) < 0.93


@pytest.mark.slow
def test_runs_of_the_array_alone_predict_the_others_of_the_rack() -> None:
    """Constant trend, Gaussian correlation, estimated noise, logarithms: within 1.2 % (the source: 0.5 %, 150 runs)."""
    surrogate = fit_surrogate(rack_tables.RUNS, rack_tables.FREQUENCIES, KrigingRules(logarithms=True))
    fresh = np.abs(surrogate.predict(rack_tables.FRESH_RUNS) / rack_tables.FRESH_FREQUENCIES - 1.0)
    assert fresh.max() < 0.012
    sample = np.abs(surrogate.predict(rack_tables.SAMPLE_RUNS) / rack_tables.SAMPLE_FREQUENCIES - 1.0)
    assert sample.max() < 0.012


_Y = _function(_X)


@pytest.mark.parametrize(
    ("name", "x", "y", "rules"),
    [
        ("surrogate.not-finite", _X, np.where(np.arange(25)[:, None] == 3, np.inf, _Y), KrigingRules()),
        ("surrogate.still", _X * [1.0, 0.0, 1.0], _Y, KrigingRules()),
        ("surrogate.too-few-runs", _X[:8], _Y[:8], KrigingRules(trend="quadratic")),
        ("surrogate.not-positive", _X - 0.5, _Y, KrigingRules(logarithms=True)),
    ],
)
def test_errors(name: str, x: np.ndarray, y: np.ndarray, rules: KrigingRules) -> None:
    with pytest.raises(FemtuneError) as caught:
        fit_surrogate(x, y, rules)
    check_shown(name, caught.value)
