"""The distribution of the parameters within their bounds, and what an update reports of it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.stats import norm

from femtune.parameters import DerivedQuantity, Parameter, ParameterSet, parse_expression, tied
from femtune.updating import Box, BoxPosterior, ParameterCovariance, parameter_covariance, posterior_of_covariance

NONE = np.zeros((0, 2))


def solved(
    J: np.ndarray, z: np.ndarray, low: float, high: float, scatter: str = "stated", prior: np.ndarray | None = None
) -> tuple[np.ndarray, ParameterCovariance]:
    """The bounded least-squares solution of J x ≈ z and its covariance."""
    k = J.shape[1]
    extra = np.zeros((0, k)) if prior is None else prior
    rows, data = np.vstack([J, extra]), np.concatenate([z, np.zeros(len(extra))])
    x = lsq_linear(rows, data, bounds=(low, high), method="bvls", tol=1e-14).x
    at_bound = (x <= low + 1e-9) | (x >= high - 1e-9)
    box = Box(x, np.full(k, low), np.full(k, high), extra @ x, np.zeros(k))
    sd = np.full(k, (high - low) / np.sqrt(12.0))
    kinds = ["frequency"] * len(z)
    return x, parameter_covariance(J @ x - z, J, kinds, extra, at_bound, sd, scatter=scatter, box=box)  # type: ignore[arg-type]


def of(found: ParameterCovariance, i: int):  # type: ignore[no-untyped-def]
    assert found.posterior is not None
    names = [f"p{j}" for j in range(len(found.posterior.at))]
    parameters = ParameterSet(tuple(Parameter(n, 1.0, 0.0, 2.0) for n in names))
    jets = parameters.jets(found.posterior.at)
    return found.posterior.of(jets[names[i]], lambda x: 1.0 + x[:, i])


@pytest.mark.parametrize("scatter", ["stated", "estimated"])
def test_without_bounds_near_the_interval_is_that_of_the_linear_estimate(scatter: str) -> None:
    rng = np.random.default_rng(0)
    J = 500.0 * rng.standard_normal((40, 2))
    x, found = solved(J, J @ [0.1, -0.2] + rng.standard_normal(40), -1.0, 1.0, scatter)
    assert found.posterior is not None
    assert not found.posterior.truncated
    half = found.coverage_factor() * found.sd
    for i in range(2):
        m = of(found, i)
        assert m.interval == pytest.approx((1.0 + x[i] - half[i], 1.0 + x[i] + half[i]), rel=1e-9)
        assert (m.mean, m.median, m.sd) == pytest.approx((1.0 + x[i], 1.0 + x[i], found.sd[i]))
        assert m.kind == ("normal" if scatter == "stated" else "Student's t")


@pytest.mark.slow
def test_beside_an_active_bound_intervals_are_those_of_integration() -> None:
    """Two parameters, correlation −0.9, the first optimum 0.5 standard deviations beyond its bound."""
    C = np.array([[1.0, -0.9], [-0.9, 1.0]]) * 0.04
    J = np.linalg.cholesky(np.linalg.inv(C)).T
    x, found = solved(J, J @ [-0.6, 0.2], -0.5, 0.5)
    assert x[0] == -0.5
    assert found.reasons == {0: "at bound, σ not given"}
    n = 2001
    a = -0.5 + (np.arange(n) + 0.5) / n
    density = np.exp(-0.5 * np.sum((J @ (np.array(np.meshgrid(a, a, indexing="ij")).reshape(2, -1)
                                         - np.array([[-0.6], [0.2]]))) ** 2, axis=0)).reshape(n, n)  # fmt: skip
    for i in range(2):
        weight = density.sum(axis=1 - i)
        total = np.cumsum(weight) / weight.sum()
        # of the parameter on its lower bound the interval is one-sided
        expected = np.interp([0.0, 0.95] if i == 0 else [0.025, 0.975], total, 1.0 + a)
        m = of(found, i)
        assert m.kind == "truncated"
        np.testing.assert_allclose(m.interval, expected, atol=0.15 * m.sd)
        assert m.mean == pytest.approx(1.0 + weight @ a / weight.sum(), abs=0.05 * m.sd)
    # the deviation of the second parameter is no longer that with the first one known
    assert found.sd[1] > 1.4 * np.sqrt(found.without_bounds[1, 1])
    assert found.sd[1] == pytest.approx(of(found, 1).sd, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_the_interval_contains_the_estimate_and_keeps_its_probability(seed: int) -> None:
    """Random problems whose optimum lies on bounds, or beside them: each interval contains the estimate."""
    rng = np.random.default_rng(seed)
    J = rng.standard_normal((5, 3)) @ np.diag([3.0, 3.0, 0.5])
    x, found = solved(J, J @ rng.uniform(-0.9, 0.9, 3), -0.5, 0.5)
    posterior = found.posterior
    assert posterior is not None
    for i in range(3):
        m = of(found, i)
        assert m.interval[0] <= 1.0 + x[i] <= m.interval[1]
        inside = (posterior.samples[:, i] >= m.interval[0] - 1.0) & (posterior.samples[:, i] <= m.interval[1] - 1.0)
        assert np.mean(inside) == pytest.approx(0.95, abs=2e-3)
        if abs(x[i]) == 0.5:
            # one-sided: the whole tail is on the other side
            assert 1.0 + x[i] in m.interval


@pytest.mark.slow
def test_profile_likelihood_confirms_the_interval_beside_a_bound() -> None:
    """The profile interval 2Δ < 3.84 of the bounded problem and the equal-tailed one have about the same far end."""
    C = np.array([[1.0, -0.9], [-0.9, 1.0]]) * 0.04
    J = np.linalg.cholesky(np.linalg.inv(C)).T
    z = J @ [-0.52, 0.02]
    x, found = solved(J, z, -0.5, 0.5)
    least = np.sum((J @ x - z) ** 2)
    grid = np.linspace(-0.5, 0.5, 401)
    best = [
        np.sum((J[:, :1] @ lsq_linear(J[:, :1], z - J[:, 1] * b, (-0.5, 0.5)).x + J[:, 1] * b - z) ** 2) for b in grid
    ]
    inside = grid[np.array(best) - least < norm.ppf(0.975) ** 2]
    m = of(found, 1)
    assert m.interval[0] - 1.0 == pytest.approx(inside[0], abs=0.25 * m.sd)
    fixed = x[1] - 1.96 * np.sqrt(found.without_bounds[1, 1])
    assert abs(fixed - inside[0]) > 2.0 * abs(m.interval[0] - 1.0 - inside[0])


def test_an_undetermined_combination_has_the_interval_of_its_bounds() -> None:
    """Only the sum of two parameters is measured, and it hardly limits them."""
    _, found = solved(np.array([[2.0, 2.0]]), np.array([0.1]), -0.5, 0.5)
    assert np.isnan(found.sd).all()
    for i in range(2):
        m = of(found, i)
        assert m.kind == "bounds"
        np.testing.assert_allclose(m.interval, (0.525, 1.475), atol=0.03)


def test_a_prior_narrows_what_the_data_do_not_determine() -> None:
    _, found = solved(np.array([[50.0, 50.0]]), np.array([0.0]), -0.5, 0.5, prior=np.eye(2) / 0.05)
    m = of(found, 0)
    assert m.kind == "normal"
    assert m.sd == pytest.approx(np.sqrt(np.linalg.inv(np.eye(2) / 0.0025 + 2500.0)[0, 0]))


def test_no_variance_without_spare_residuals() -> None:
    assert solved(np.eye(2), np.array([0.1, 0.2]), -1.0, 1.0, "estimated")[1].posterior is None


def test_an_estimated_variance_beside_a_bound_is_that_of_the_fit_without_bounds() -> None:
    """Its degrees of freedom count all parameters, those on a bound too; the scale is that of the free fit."""
    rng = np.random.default_rng(1)
    J = 10.0 * rng.standard_normal((30, 2))
    z = J @ [-0.51, 0.0] + rng.standard_normal(30)
    x, found = solved(J, z, -0.5, 0.5, "estimated")
    assert x[0] == -0.5
    assert found.posterior is not None
    assert found.posterior.degrees == pytest.approx(28.0)
    best, squares, *_ = np.linalg.lstsq(J, z, rcond=None)
    y = found.posterior.rows @ (best - x) + found.posterior.offset
    np.testing.assert_allclose(y, 0.0, atol=1e-9)
    expected = J.T @ J / (squares[0] / 28.0)
    np.testing.assert_allclose(found.posterior.rows.T @ found.posterior.rows, expected, rtol=1e-9)


def test_tied_and_derived_quantities_stay_in_the_range_of_their_expression() -> None:
    """Intervals of the cube root of a second moment, of which the linear interval is partly negative."""
    parameters = ParameterSet((Parameter("I", 1.0, 0.0, 4.0), tied("twice", "2*I")))
    posterior = posterior_of_covariance(np.array([-0.5]), np.array([[0.64]]), np.array([True]), parameters.limits)
    thickness = DerivedQuantity("t", parse_expression("sqrt(I)"))
    jet = thickness.at(parameters, posterior.at)
    found = posterior.of(jet, lambda x: thickness.at_samples(parameters, x))
    assert found is not None
    low, high = 0.5 - 1.96 * 0.8, 4.0
    assert low < 0.0
    share = norm.cdf([(0.0 - 0.5) / 0.8, (high - 0.5) / 0.8])
    expected = np.sqrt(0.5 + 0.8 * norm.ppf(share[0] + np.array([0.025, 0.975]) * np.ptp(share)))
    np.testing.assert_allclose(found.interval, expected, rtol=0.05)
    twice = posterior.of(parameters.jets(posterior.at)["twice"], lambda x: parameters.at_samples(x)["twice"])
    assert twice is not None
    np.testing.assert_allclose(twice.interval, 2.0 * expected**2, rtol=0.1)


def test_an_expression_that_is_not_finite_has_no_interval() -> None:
    parameters = ParameterSet((Parameter("a", 1.0, 0.0, 4.0),))
    posterior = posterior_of_covariance(np.zeros(1), np.array([[1.0]]), np.array([True]), parameters.limits)
    quantity = DerivedQuantity("q", parse_expression("log(a - 0.5)"))
    assert posterior.of(quantity.at(parameters, np.zeros(1)), lambda x: quantity.at_samples(parameters, x)) is None


def test_quantities_that_cannot_be_negative_have_intervals_from_zero() -> None:
    parameters = ParameterSet(
        (Parameter("E", 1.0, -2.0, 2.0, positive=True), Parameter("z", 1.0, -2.0, 2.0), Parameter("m", 2.0, 1.0, 3.0))
    )
    low, high = parameters.denormalise(parameters.limits[0]), parameters.denormalise(parameters.limits[1])
    np.testing.assert_allclose(low, [0.0, -2.0, 1.0])
    np.testing.assert_allclose(high, [2.0, 2.0, 3.0])


def test_fixed_parameters_have_no_distribution() -> None:
    parameters = ParameterSet((Parameter("a", 1.0, 0.5, 1.5), Parameter("b", 1.0, 0.5, 1.5)))
    posterior = posterior_of_covariance(np.zeros(2), 0.01 * np.eye(2), np.array([True, False]), parameters.limits)
    jets = parameters.jets(posterior.at)
    assert posterior.of(jets["b"], lambda x: x[:, 1]) is None
    assert isinstance(posterior, BoxPosterior)
    assert (posterior.samples[:, 1] == 0.0).all()
