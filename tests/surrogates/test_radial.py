"""Radial basis functions: against SciPy's, definitions computed directly, and derivatives by complex step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.surrogates import RadialRules, Surrogate, fit_surrogate
from femtune.surrogates.kinds import KERNELS
from femtune.surrogates.trend import terms

_RNG = np.random.default_rng(4)
_X = _RNG.random((25, 3))
_NEW = _RNG.random((7, 3))
_UNIT = (np.zeros(3), np.ones(3))
_SCIPY = {"cubic": ("cubic", 1), "quintic": ("quintic", 2), "thin-plate": ("thin_plate_spline", 1)}


def _function(x: np.ndarray) -> np.ndarray:
    return np.stack([np.sin(3.0 * x[:, 0]) + x[:, 1] * x[:, 2] + 2.0, np.exp(x[:, 0] - x[:, 1]) + 1.0], axis=1)


def _fitted(kernel: str, noise: str = "estimate") -> Surrogate:
    return fit_surrogate(_X, _function(_X), RadialRules(kernel, noise), _UNIT)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("noise", ["none", "estimate"])
def test_predictions_are_those_of_scipy(kernel: str, noise: str) -> None:
    surrogate = _fitted(kernel, noise)
    name, degree = _SCIPY[kernel]
    for j, fit in enumerate(surrogate.fits):
        other = RBFInterpolator(_X, surrogate.y[:, j], kernel=name, degree=degree, smoothing=fit.noise)
        np.testing.assert_allclose(surrogate.predict(_NEW)[:, j], other(_NEW), rtol=1e-7)


@pytest.mark.parametrize("kernel", KERNELS)
def test_leaving_out_one_run_is_fitting_without_it(kernel: str) -> None:
    surrogate = _fitted(kernel)
    for i in (0, 7, 24):
        kept = np.arange(25) != i
        without = surrogate.with_runs(surrogate.x[kept], surrogate.y[kept])
        pairs = zip(without.fits, surrogate.fits, strict=True)
        without = replace(without, fits=tuple(replace(new, variance=old.variance) for new, old in pairs))
        np.testing.assert_allclose(surrogate.left_out[i], without.predict(_X[i])[0], rtol=1e-6)
        error = (surrogate.y[i] - surrogate.left_out[i]) / surrogate.left_out_ratio[i]
        np.testing.assert_allclose(np.abs(error), without.predict_sd(_X[i])[0], rtol=1e-4)


@pytest.mark.parametrize("kernel", KERNELS)
def test_the_variance_is_that_of_kriging_with_the_covariance_of_increments(kernel: str) -> None:
    """The equations of universal Kriging, solved as one system."""
    surrogate = _fitted(kernel)
    function, trend = KERNELS[kernel].load().function, KERNELS[kernel].load().trend
    F, f = terms(_X, trend), terms(_NEW, trend)
    q = F.shape[1]
    Phi, phi = (function.value(np.sum((a[:, None] - _X) ** 2, axis=2)) for a in (_X, _NEW))
    for j, fit in enumerate(surrogate.fits):
        system = np.block([[Phi + fit.noise * np.eye(25), F], [F.T, np.zeros((q, q))]])
        right = np.hstack([phi, f])
        quadratic = np.sum(right * np.linalg.solve(system, right.T).T, axis=1)
        sd = surrogate.scale[j] * np.sqrt(fit.variance * (fit.noise - quadratic))
        np.testing.assert_allclose(surrogate.predict_sd(_NEW)[:, j], sd, rtol=1e-6)


@pytest.mark.parametrize("kernel", KERNELS)
def test_the_smoothing_maximises_the_likelihood_of_contrasts(kernel: str) -> None:
    rng = np.random.default_rng(5)
    x = rng.random((60, 2))
    y = np.sin(6.0 * x[:, :1]) + x[:, 1:] + 0.1 * rng.standard_normal((60, 1))
    surrogate = fit_surrogate(x, y, RadialRules(kernel), (np.zeros(2), np.ones(2)))
    F = terms(x, KERNELS[kernel].load().trend)
    contrasts = np.linalg.svd(F)[0][:, F.shape[1] :].T
    Phi = KERNELS[kernel].load().function.value(np.sum((x[:, None] - x) ** 2, axis=2))

    def likelihood(noise: float) -> float:
        covariance = contrasts @ (Phi + noise * np.eye(60)) @ contrasts.T
        z = contrasts @ y[:, 0]
        variance = z @ np.linalg.solve(covariance, z) / len(z)
        return float(-0.5 * len(z) * np.log(variance) - 0.5 * np.linalg.slogdet(covariance)[1])

    found = surrogate.fits[0].noise
    assert likelihood(found) >= max(likelihood(found * factor) for factor in (0.5, 0.9, 1.1, 2.0))


@pytest.mark.parametrize("logarithms", [False, True])
@pytest.mark.parametrize("kernel", KERNELS)
def test_the_gradient_of_a_prediction_by_complex_step(kernel: str, logarithms: bool) -> None:
    x, new = _X + 0.5, _NEW + 0.5
    surrogate = fit_surrogate(x, _function(_X), RadialRules(kernel, logarithms=logarithms))
    gradient = surrogate.gradient(new)
    for i, direction in enumerate(np.eye(3)):
        moved = surrogate.predict(new + 1e-30j * direction).imag / 1e-30
        np.testing.assert_allclose(gradient[:, :, i], moved, rtol=1e-9, atol=1e-9 * np.abs(gradient).max())


@pytest.mark.parametrize("kernel", ["cubic", "quintic"])
def test_second_derivatives_at_a_run(kernel: str) -> None:
    """At a run the distance is zero, where fractional powers of it need their limits."""
    fit = _fitted(kernel).fits[0]
    curved, step = fit.curvatures(_X[:1]), 1e-5
    for i, direction in enumerate(np.eye(3)):
        change = (fit.slopes(_X[:1] + step * direction) - fit.slopes(_X[:1] - step * direction)) / (2.0 * step)
        np.testing.assert_allclose(curved[0, i], change[0], rtol=1e-4, atol=1e-4 * np.abs(curved).max())


def test_without_noise_it_passes_through_the_runs() -> None:
    surrogate = _fitted("cubic", "none")
    np.testing.assert_allclose(surrogate.predict(_X), _function(_X), rtol=1e-8)
    assert np.all(surrogate.predict_sd(_X) < 1e-4 * surrogate.scale)


def test_a_response_that_does_not_vary() -> None:
    surrogate = fit_surrogate(_X, np.full((25, 1), 4.0), RadialRules())
    np.testing.assert_allclose(surrogate.predict(_NEW), 4.0)
    np.testing.assert_allclose(surrogate.gradient(_NEW), 0.0, atol=1e-12)


def test_intervals_cover_fresh_runs_of_a_smooth_function() -> None:
    """Cubic functions are not as smooth as the function: the intervals are too long rather than too short."""
    rng = np.random.default_rng(6)
    x, new = rng.random((60, 3)), rng.random((400, 3))
    low, high = fit_surrogate(x, _function(x), RadialRules(), _UNIT).interval(new, 0.9)
    assert np.mean((_function(new) > low) & (_function(new) < high)) > 0.88


def test_too_few_runs() -> None:
    with pytest.raises(FemtuneError) as caught:
        fit_surrogate(_X[:11], _function(_X)[:11], RadialRules("quintic"))
    check_shown("surrogate.too-few-runs, radial", caught.value)
