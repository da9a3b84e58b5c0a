"""Samples of posterior distributions against closed forms, numerical integration and simulation."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from scipy import stats

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.sampling import (
    ChainRules,
    Known,
    Likelihood,
    NoiseGroup,
    NormalBox,
    NuisanceClass,
    PosteriorSamples,
    Sampler,
    SamplingRules,
    Scaled,
    noise_groups,
    smoothed_weights,
    weighted_quantiles,
)
from femtune.sampling.surrogate import Monomials, PolynomialResiduals
from femtune.sampling.tmcmc import transitional
from femtune.sampling.weights import fitted_pareto

Function = Callable[[Reals], Reals]
SHORT = ChainRules(chains=24, windows=(10, 15, 25), kept=40, most=160, leaps=30)


def jacobian(function: Function, x: Reals) -> Reals:
    """Central differences."""
    step = 1e-6
    return np.array([(function(x + step * d) - function(x - step * d)) / (2 * step) for d in np.eye(len(x))]).T


def sampled(
    function: Function, start: Reals, ends: tuple[float, float], rule: str = "stated",
    rules: SamplingRules | None = None, kinds: Sequence[str] = (),
) -> PosteriorSamples:  # fmt: skip
    """The posterior of residuals that are a function of x, with P = 1 + x."""
    k, n = len(start), len(function(start))
    words = np.array(kinds or ["frequency"] * n)
    freedom = {name: float(np.sum(words == name)) - 0.5 * k for name in dict.fromkeys(words.tolist())}
    groups = noise_groups(words, np.zeros(n, bool), {}, rule, freedom, 3.0)
    likelihood = Likelihood(groups, (), np.zeros((n, 0)))

    def model(points: Sequence[Reals], derivatives: bool) -> list[Known | None]:
        return [Known(x, function(x), jacobian(function, x) if derivatives else None) for x in points]

    scaled = Scaled(np.ones(k), np.ones(k), np.ones(k, bool), np.zeros(k), np.ones(k))
    box = NormalBox(np.full(k, ends[0]), np.full(k, ends[1]))
    known = Known(start, function(start), jacobian(function, start))
    return Sampler(likelihood, box, known, scaled, model, rules or SamplingRules()).run()


@pytest.mark.slow
def test_a_linear_model_with_normal_errors_has_its_closed_form() -> None:
    rng = np.random.default_rng(3)
    k, n = 4, 20
    A = 30.0 * rng.normal(size=(n, k))
    y = A @ (0.05 * rng.normal(size=k)) + rng.normal(size=n)
    best = np.linalg.lstsq(A, y, rcond=None)[0]
    found = sampled(lambda x: A @ x - y, best, (-0.5, 1.0))
    H, r, w = A.T @ A, A @ best - y, found.weights.values
    sd = np.sqrt(np.diag(np.linalg.inv(H)))
    assert (found.route, found.gradients, found.plain) == ("linear", 0, 1000)
    assert found.weights.effective == pytest.approx(1000)
    np.testing.assert_allclose((w @ found.x - best) / sd, 0.0, atol=0.12)
    np.testing.assert_allclose(found.x.std(axis=0) / sd, 1.0, atol=0.1)
    exact = stats.multivariate_normal.logpdf(r, np.zeros(n)) + 0.5 * k * np.log(2 * np.pi)
    exact -= 0.5 * np.linalg.slogdet(H)[1] + k * np.log(1.5)
    assert abs(found.log_evidence - exact) < 4.0 * found.log_evidence_sd < 0.1


def curved(x: Reals) -> Reals:
    """Three residuals of two parameters whose product is known well, and whose sum hardly."""
    return np.array([np.log((1 + x[0]) * (1 + x[1])) / 0.05, (x[0] + x[1]) / 0.8, x[0] / 0.7])


@pytest.mark.slow
def test_a_curved_valley_is_that_of_numerical_integration() -> None:
    found = sampled(curved, np.zeros(2), (-0.9, 2.0), rules=SamplingRules(seed=1, chain=ChainRules(most=600)))
    # by the product t = log of it, which is narrow, and the first parameter, on a fine grid
    first, t = np.meshgrid(np.linspace(-0.9, 2.0, 3001)[1:-1], np.linspace(-0.3, 0.3, 601), indexing="ij")
    second = np.exp(t) / (1 + first) - 1
    density = np.exp(-0.5 * ((t / 0.05) ** 2 + ((first + second) / 0.8) ** 2 + (first / 0.7) ** 2))
    density *= (second > -0.9) & (second < 2.0)
    # dx₂ = (1 + x₂) dt
    mass = density * (1 + second)
    marginal = np.cumsum(mass.sum(axis=1)) / mass.sum()
    exact = np.interp([0.025, 0.5, 0.975], marginal, first[:, 0])
    ours = weighted_quantiles(found.x[:, 0], found.weights.values, np.array([0.025, 0.5, 0.975]))
    sd = found.x[:, 0].std()
    assert found.route == "surrogate"
    assert found.weights.effective > 500
    np.testing.assert_allclose(ours, exact, atol=0.25 * sd)
    cell = (first[1, 0] - first[0, 0]) * (t[0, 1] - t[0, 0])
    log_z = np.log(mass.sum() * cell / 2.9**2) - 1.5 * np.log(2 * np.pi)
    assert abs(found.log_evidence - log_z) < 4.0 * found.log_evidence_sd < 0.4
    # an interval along the tangent would be another one
    linear = np.quantile(found.linear[:, 0], [0.025, 0.975])
    assert abs(linear - exact[[0, 2]]).max() > 0.3 * sd


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 20, 24, 35])
def test_linearised_residuals_that_miss_a_part_of_a_valley_are_not_sampled_from(seed: int) -> None:
    """Hundreds of effective samples and a small k̂ do not tell: ends of intervals would be wrong by up to 1.8 sd."""
    rng = np.random.default_rng(seed)
    a = np.exp(rng.uniform(np.log(0.03), np.log(0.3)))
    b, c, rule = rng.uniform(0.3, 1.5), rng.uniform(0.3, 1.5), ["stated", "common"][seed % 2]
    extra = np.full(8, rng.uniform(0.3, 1.2))
    found = sampled(
        lambda x: np.concatenate([[np.log((1 + x[0]) * (1 + x[1])) / a, (x[0] + x[1]) / b, x[0] / c], extra]),
        np.zeros(2), (-0.9, 2.0), rule, SamplingRules(seed=seed),
    )  # fmt: skip
    first, t = np.meshgrid(np.linspace(-0.9, 2.0, 1201)[1:-1], np.linspace(-1.5, 1.5, 3001), indexing="ij")
    second = np.exp(t) / (1 + first) - 1
    squares = (t / a) ** 2 + ((first + second) / b) ** 2 + (first / c) ** 2
    # with a common size of the errors, integrated over its prior: a power of the sum of all squares
    log = -0.5 * squares if rule == "stated" else -5.5 * np.log(squares + extra @ extra)
    mass = np.exp(log - log.max()) * ((second > -0.9) & (second < 2.0)) * (1 + second)
    by_first = mass.sum(axis=1) / mass.sum()
    mean = by_first @ first[:, 0]
    sd = np.sqrt(by_first @ (first[:, 0] - mean) ** 2)
    ends = np.array([0.025, 0.5, 0.975])
    exact = np.interp(ends, np.cumsum(by_first), first[:, 0])
    ours = weighted_quantiles(found.x[:, 0], found.weights.values, ends)
    assert (found.error or 0.0) < 1.0
    np.testing.assert_allclose(ours, exact, atol=0.4 * sd)


@pytest.mark.slow
@pytest.mark.parametrize("rule", ["stated", "common"])
def test_transitional_chains_find_the_same_curved_valley(rule: str) -> None:
    """Beside weighted samples of the surrogate, with errors as stated and with a sampled size; and the evidence."""
    many = np.concatenate([curved(np.zeros(2)), np.full(9, 0.4)])

    def residuals(x: Reals) -> Reals:
        return np.concatenate([curved(x), many[3:]])

    rules = SamplingRules(draws=4000, seed=3, sampling="tmcmc")
    found = sampled(residuals, np.zeros(2), (-0.9, 2.0), rule, rules)
    other = sampled(residuals, np.zeros(2), (-0.9, 2.0), rule, SamplingRules(seed=1, chain=ChainRules(most=600)))
    assert (found.route, found.degree, found.r_hat, found.gradients) == ("tmcmc", 0, None, 0)
    assert found.stages > 3
    assert found.plain > 4 * 4000
    ends, equal = np.array([0.1, 0.5, 0.9]), np.full(4000, 1.0 / 4000)
    sd = other.x.std(axis=0)
    for j in range(2):
        ours = weighted_quantiles(found.x[:, j], equal, ends)
        theirs = weighted_quantiles(other.x[:, j], other.weights.values, ends)
        np.testing.assert_allclose(ours, theirs, atol=4.0 * sd[j] / np.sqrt(found.weights.effective))
    np.testing.assert_allclose([residuals(x) for x in found.x[:50]], found.residuals[:50])
    apart = abs(found.log_evidence - other.log_evidence)
    assert apart < 3.0 * np.hypot(found.log_evidence_sd, other.log_evidence_sd) < 1.5
    if rule == "common":
        size = [np.exp(np.average(s.theta[:, 0], weights=s.weights.values)) for s in (found, other)]
        assert size[0] == pytest.approx(size[1], rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("d", [1, 2, 3])
def test_the_stated_deviations_of_transitional_chains_hold(d: int) -> None:
    """Of ln Z over 30 seeds; and the effective number is not larger than that of the scatter of the means."""

    def log_likelihood(z: Reals) -> Reals:
        return np.asarray(-0.5 * np.sum((z - 0.5) ** 2, axis=1) / 0.05**2)

    def log_prior(z: Reals) -> Reals:
        return np.asarray(-0.5 * np.sum(z**2, axis=1))

    logs, sds, means, effective = [], [], [], []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        found = transitional(log_likelihood, log_prior, rng.standard_normal((500, d)), rng)
        assert found.ended
        logs.append(found.log_evidence)
        sds.append(found.log_evidence_sd)
        means.append(found.z.mean(axis=0))
        effective.append(found.effective)
    variance = 1.0 / (1.0 + 0.05**-2)
    exact = 0.5 * d * (np.log(variance) - 0.25 / (1.0 + 0.05**2))
    z = (np.array(logs) - exact) / np.array(sds)
    assert 0.5 < np.sqrt(np.mean(z**2)) < 1.5
    assert np.mean(effective) < 1.5 * variance / np.mean(np.var(means, axis=0))


@pytest.mark.slow
def test_too_few_transitional_samples_are_refused() -> None:
    rng = np.random.default_rng(0)
    A = 60.0 * rng.normal(size=(30, 12))
    with pytest.raises(FemtuneError) as caught:
        sampled(lambda x: A @ x, np.zeros(12), (-0.9, 2.0), rules=SamplingRules(draws=100, sampling="tmcmc"))
    assert caught.value.code == "posterior.not-sampled"
    assert "draws would do" in caught.value.what


@pytest.mark.slow
def test_what_nothing_determines_stays_as_it_was() -> None:
    found = sampled(lambda x: np.array([x[0] / 0.01, x[0] / 0.01]), np.zeros(2), (-0.5, 1.0))
    w = found.weights.values
    assert found.weights.effective > 900
    assert w @ found.x[:, 1] == pytest.approx(0.25, abs=0.06)
    assert found.x[:, 1].std() == pytest.approx(1.5 / np.sqrt(12), rel=0.07)


@pytest.mark.slow
def test_errors_that_are_smaller_than_stated_are_found() -> None:
    rng = np.random.default_rng(5)
    A = rng.normal(size=(60, 2)) * 20
    y = np.concatenate([0.25 * rng.normal(size=30), 2.0 * rng.normal(size=30)])
    kinds = ["frequency"] * 30 + ["shape"] * 30
    found = sampled(lambda x: A @ x - y, np.linalg.lstsq(A, y, rcond=None)[0], (-0.5, 1.0), "by-kind", kinds=kinds)
    size = np.exp(found.weights.values @ found.theta)
    np.testing.assert_allclose(size, [0.25, 2.0], rtol=0.3)


@pytest.mark.slow
def test_sixty_parameters_that_are_not_linear_are_refused_with_the_reason() -> None:
    scale = np.linspace(1.0, 2.0, 60)
    with pytest.raises(FemtuneError) as caught:
        sampled(
            lambda x: np.concatenate([30 * np.sin(3 * scale * x), 20 * x**2]), np.zeros(60), (-0.9, 2.0),
            rules=SamplingRules(chain=SHORT),
        )  # fmt: skip
    assert caught.value.code == "posterior.not-sampled"
    assert "60 parameters has 1891 coefficients" in caught.value.what


LIMITS = (2e-3, 1.0)


def test_the_likelihood_with_errors_of_the_model_is_that_of_the_whole_covariance() -> None:
    rng = np.random.default_rng(2)
    n, m = 25, 5
    B, r = rng.normal(size=(n, m)), rng.normal(size=(3, n))
    groups = (NoiseGroup("a", np.arange(10), 10.0, True), NoiseGroup("b", np.arange(10, n), 15.0, False))
    classes = (NuisanceClass("c", np.arange(2), LIMITS), NuisanceClass("d", np.arange(2, m), LIMITS))
    likelihood = Likelihood(groups, classes, B)
    theta = 0.4 * rng.normal(size=(3, 3))
    for one, sizes, log in zip(r, np.exp(2 * theta), likelihood.at(r, theta)):
        D = np.diag([*[sizes[0]] * 10, *[1.0] * 15])
        S = np.diag([*[sizes[1]] * 2, *[sizes[2]] * 3])
        assert log == pytest.approx(stats.multivariate_normal.logpdf(one, np.zeros(n), D + B @ S @ B.T))
    # the factors q of r + Bq = e, given r
    expected = -S @ B.T @ np.linalg.solve(D + B @ S @ B.T, r[-1])
    np.testing.assert_allclose(likelihood.factors(r, theta)[-1], expected)
    parts, of_B = tuple(r[:, g.rows] for g in groups), tuple(B[g.rows] for g in groups)
    _, by_parts, by_theta = likelihood.of(parts, of_B, theta)
    direction, turn, step = rng.normal(size=r.shape), rng.normal(size=theta.shape), 1e-6
    ends = [likelihood.at(r + s * direction, theta + s * turn) for s in (step, -step)]
    slope = np.sum(np.hstack(by_parts) * direction, axis=1) + np.sum(by_theta * turn, axis=1)
    np.testing.assert_allclose((ends[0] - ends[1]) / (2 * step), slope, rtol=1e-6)


def test_priors_of_sizes_have_a_unit_integral_and_their_gradient() -> None:
    groups = (NoiseGroup("a", np.arange(3), 3.0, False),)
    likelihood = Likelihood(groups, (NuisanceClass("c", np.arange(1), LIMITS),), np.ones((3, 1)))
    theta = np.linspace(np.log(1e-9), np.log(1e7), 20_001)[:, None]
    log, slope = likelihood.prior(theta)
    assert np.trapezoid(np.exp(log), theta[:, 0]) == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(np.gradient(log, theta[:, 0])[1:-1], slope[1:-1, 0], atol=1e-5)
    # all sizes between the limits alike
    assert log[np.abs(theta[:, 0] - np.log(0.05)) < 0.5].std() < 0.03


def test_a_surrogate_has_the_gradient_of_its_own_likelihood() -> None:
    rng = np.random.default_rng(4)
    k, n = 3, 12
    monomials = Monomials(k, 3)
    surrogate = PolynomialResiduals(Scaled.identity(k), monomials, rng.normal(size=(Monomials.number(k, 3), n)))
    likelihood = Likelihood((NoiseGroup("a", np.arange(n), 12.0, True),), (), np.zeros((n, 0)))
    x, theta, step = rng.normal(size=(6, k)), np.zeros((6, 1)), 1e-6
    reduced = surrogate.for_chains(likelihood, rng.normal(size=(60, k)), np.full(1, 1e-9))
    log, slope, _ = reduced.log_likelihood(x, theta)
    np.testing.assert_allclose(log, likelihood.at(surrogate.residuals(x), theta))
    d = rng.normal(size=x.shape)
    ends = [reduced.log_likelihood(x + s * d, theta)[0] for s in (step, -step)]
    np.testing.assert_allclose((ends[0] - ends[1]) / (2 * step), np.sum(slope * d, axis=1), rtol=1e-5)
    by = monomials.derivatives(x)
    values = [monomials.values(x + s * d) for s in (step, -step)]
    np.testing.assert_allclose(np.einsum("nkq,nk->nq", by, d), (values[0] - values[1]) / (2 * step), atol=1e-6)


def test_the_tail_of_weights_is_known_by_its_shape() -> None:
    rng = np.random.default_rng(0)
    for k in (0.2, 0.5, 0.9):
        excess = np.sort(stats.genpareto.rvs(k, scale=3.0, size=4000, random_state=rng))
        assert fitted_pareto(excess)[0] == pytest.approx(k, abs=0.06)
    # of weights p/q of two normal distributions, q that of half the variance: the tail has the shape one half
    z = np.sqrt(0.5) * rng.standard_normal(20_000)
    assert smoothed_weights(0.5 * z**2).k_hat == pytest.approx(0.5, abs=0.12)


@pytest.mark.slow
def test_the_truth_has_a_uniform_rank_among_the_samples() -> None:
    """Simulation-based calibration (Talts and others 2018); level of the test 0.1 %."""
    ranks = []
    for number in range(30):
        rng = np.random.default_rng([9, number])
        truth, A = rng.uniform(-0.6, 1.2, size=2), np.array([[1.0, 0.2], [0.3, 1.0], [0.7, 0.7], [0.2, 0.5]])
        noise = 0.05 * rng.standard_normal(4)

        def function(x: Reals, A: Reals = A, truth: Reals = truth, noise: Reals = noise) -> Reals:
            return (np.log1p(A @ (x - truth) / (1.5 + A @ truth)) + noise) / 0.05

        best = np.clip(truth, -0.6, 1.2)
        found = sampled(function, best, (-0.6, 1.2), rules=SamplingRules(300, number, chain=SHORT))
        ranks.append(found.weights.values @ (found.x < truth))
    for of_parameter in np.array(ranks).T:
        assert stats.kstest(of_parameter, "uniform").pvalue > 1e-3
