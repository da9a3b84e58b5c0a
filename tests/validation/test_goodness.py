"""Goodness of fit: p-values are uniform where the residuals are noise, and small where they are not."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.stats import chi2, kstest, norm

from femtune.residuals import ResidualBlock
from femtune.validation import Outcome, goodness_of_fit
from femtune.validation.goodness import Finding, fewest_runs


def _blocks(r: np.ndarray, J: np.ndarray, kind: str = "frequency") -> list[ResidualBlock]:
    return [ResidualBlock(kind, "free", str(i + 1), r[[i]], J[[i]], 0.01, of_mode=True) for i in range(len(r))]


def _jacobian(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(14, 3)) * np.array([1.0, 100.0, 1e-3])


def _fitted(J: np.ndarray, e: np.ndarray, weight: float) -> np.ndarray:
    """Residuals of a least-squares fit, with a pull of the parameters to zero."""
    return e - J @ np.linalg.solve(J.T @ J + weight * np.diag(np.diag(J.T @ J)), J.T @ e)


@pytest.mark.slow
@pytest.mark.parametrize("weight", [0.0, 0.5], ids=["plain", "regularised"])
def test_p_values_of_noise_are_uniform(weight: float) -> None:
    rng, J = np.random.default_rng(1), _jacobian()
    p = [goodness_of_fit(_blocks(_fitted(J, rng.normal(size=14), weight), J)).p_value for _ in range(1500)]
    assert kstest(np.array(p, float), "uniform").pvalue > 0.01


def test_the_number_is_the_textbooks() -> None:
    J, e = _jacobian(), np.random.default_rng(2).normal(size=14)
    r = _fitted(J, e, 0.0)
    found = goodness_of_fit(_blocks(r, J))
    assert found.chi_square == pytest.approx(r @ r)
    assert found.degrees_of_freedom == 11
    assert found.p_value == pytest.approx(chi2.sf(r @ r, 11))
    assert found.outcome is Outcome.PASS
    assert "may be noise" in found.sentence


def test_an_unmodelled_part_is_found_and_named() -> None:
    J, e = _jacobian(), np.random.default_rng(3).normal(size=14)
    e[6] += 9.0
    found = goodness_of_fit(_blocks(_fitted(J, e, 0.0), J))
    assert found.outcome is Outcome.FAIL
    assert found.p_value is not None
    assert found.p_value < 1e-4
    assert found.largest_label == "free mode 7 frequency"
    assert "larger than noise" in found.sentence


def test_signs_that_come_in_runs_are_no_noise() -> None:
    """Residuals that drift: their size alone is that of the stated noise."""
    r = np.concatenate([np.full(10, 0.9), np.full(10, -0.9)])
    found = goodness_of_fit(_blocks(r, np.zeros((20, 1))))
    assert (found.runs, found.finding, found.outcome) == (2, Finding.SYSTEMATIC, Outcome.FAIL)
    assert found.sentence.startswith("the residuals have the stated size, but they are not random: chi-square 16.2")
    assert "the residuals change sign less often than random errors do" in found.sentence


def _drifting(size: float) -> np.ndarray:
    return size * np.repeat([1.0, -1.0], 134)


def _random(size: float) -> np.ndarray:
    return size * np.random.default_rng(3).choice([1.0, -1.0], 268)


@pytest.mark.parametrize(
    ("r", "finding", "outcome"),
    [
        (_random(1.0), Finding.NOISE, Outcome.PASS),
        (_random(0.075), Finding.SMALL, Outcome.NOT_TESTED),
        (_drifting(0.075), Finding.SMALL_SYSTEMATIC, Outcome.NOT_TESTED),
        (_drifting(1.0), Finding.SYSTEMATIC, Outcome.FAIL),
        (_random(1.5), Finding.LARGE, Outcome.FAIL),
        (_drifting(1.5), Finding.LARGE_SYSTEMATIC, Outcome.FAIL),
        (np.ones(4), Finding.NOISE, Outcome.PASS),
        (0.01 * np.ones(4), Finding.SMALL, Outcome.NOT_TESTED),
        (9.0 * np.ones(4), Finding.LARGE, Outcome.FAIL),
        (np.ones(0), Finding.NOT_TESTED, Outcome.NOT_TESTED),
    ],
)
def test_every_combination_of_size_and_order(r: np.ndarray, finding: Finding, outcome: Outcome) -> None:
    """Chi-square of 1.5 on 268 degrees is never called noise larger than stated; four residuals have no runs test."""
    found = goodness_of_fit(_blocks(r, np.zeros((len(r), 1))))
    assert (found.finding, found.outcome) == (finding, outcome)
    assert found.sentence.startswith(finding.value)
    assert ("change sign less often" in found.sentence) == finding.name.endswith("SYSTEMATIC")
    assert ("larger than" in found.sentence) == finding.larger
    assert ("too large" in found.sentence) == finding.name.startswith("SMALL")
    assert ("; the largest is" in found.sentence) == finding.larger
    assert "p = 1" not in found.sentence


@pytest.mark.parametrize(("held", "finding"), [(2.0, Finding.NOISE), (5.0, Finding.BOUNDED)])
def test_what_bounds_keep_is_tested(held: float, finding: Finding) -> None:
    """Residuals in the range of two columns have a chi-square of 4 or 25 on two degrees of freedom."""
    J = np.eye(16)[:, :2]
    r = np.concatenate([[held, 0.0], np.random.default_rng(3).choice([1.0, -1.0], 14)])
    found = goodness_of_fit(_blocks(r, J), bounded=True)
    assert found.held == pytest.approx(held**2)
    assert found.held_p_value == pytest.approx(np.exp(-0.5 * held**2))
    assert found.finding is finding
    assert ("of 25 if they were not bounded, p = 3.7e-06; without it, chi-square 14 on 14" in found.sentence) == (
        finding is Finding.BOUNDED
    )
    assert goodness_of_fit(_blocks(r, J)).finding is Finding.NOISE
    large = goodness_of_fit(_blocks(np.concatenate([[held, 0.0], 9.0 * r[2:]]), J), bounded=True)
    assert large.finding.larger
    assert ("bounds keep more" in large.sentence) == (finding is Finding.BOUNDED)


def test_bounds_are_tested_where_no_degrees_of_freedom_are_left() -> None:
    found = goodness_of_fit(_blocks(np.array([6.0, 0.0]), np.eye(2)), bounded=True)
    assert (found.finding, found.outcome, found.p_value) == (Finding.BOUNDED, Outcome.FAIL, None)
    assert "a chi-square of 36" in found.sentence
    macs = [replace(b, not_normal="a MAC is not normal") for b in _blocks(np.ones(2), np.eye(2), "MAC")]
    assert goodness_of_fit([*_blocks(np.array([6.0, 0.0]), np.eye(2)), *macs], bounded=True).held is None


@pytest.mark.slow
@pytest.mark.parametrize("draws", [500, pytest.param(2000, marks=pytest.mark.long)])
def test_true_values_within_bounds_are_rarely_contradicted(draws: int) -> None:
    """The least squares within bounds of a true value on a corner: held below the level in at most 1 % of the draws.

    Three standard deviations of a rate of 1 % are 0.7 % of 2,000 draws, and 1.3 % of 500.
    """
    rng, J = np.random.default_rng(6), np.random.default_rng(7).standard_normal((12, 3))
    low = 0
    for _ in range(draws):
        e = rng.standard_normal(12)
        x = lsq_linear(J, -e, (np.zeros(3), np.full(3, np.inf))).x
        found = goodness_of_fit(_blocks(e + J @ x, J), bounded=True)
        low += found.bounds_contradict
    assert low / draws <= 0.01 + 3.0 * np.sqrt(0.01 * 0.99 / draws)


def test_values_and_rank_count_kinds_that_are_not_tested_too() -> None:
    J = np.eye(5)[:, :2]
    macs = [replace(b, not_normal="a MAC is not normal") for b in _blocks(np.ones(5), J, "MAC")]
    found = goodness_of_fit([*_blocks(np.ones(2), J[:2]), *macs])
    assert (found.finding, found.values, found.rank) == (Finding.NOT_TESTED, 7, 2)


def test_scatter_that_is_stated_too_large_is_told() -> None:
    J, e = _jacobian(), 0.1 * np.random.default_rng(4).normal(size=14)
    found = goodness_of_fit(_blocks(_fitted(J, e, 0.0), J))
    assert found.outcome is Outcome.NOT_TESTED
    assert "better than the stated standard deviations predict" in found.sentence


def test_as_many_parameters_as_data_leave_nothing_to_test() -> None:
    found = goodness_of_fit(_blocks(np.zeros(3), np.eye(3)))
    assert found.outcome is Outcome.NOT_TESTED
    assert found.sentence.startswith("not tested: there are no more residuals than parameters")
    assert goodness_of_fit([]).outcome is Outcome.NOT_TESTED


def test_what_a_prior_holds_is_a_misfit_of_both() -> None:
    """Values 11 σ off, held there by a prior: the data alone leave nothing but their mean, the prior is met."""
    J = 0.05 * np.ones((5, 1))
    prior = ResidualBlock("prior", "", "E", np.zeros(1), np.ones((1, 1)), 1.0)
    assert goodness_of_fit(_blocks(np.full(5, 11.0), J)).finding is Finding.SMALL
    found = goodness_of_fit(_blocks(np.full(5, 11.0), J), prior=[prior])
    assert (found.finding, found.degrees_of_freedom) == (Finding.LARGE, 5)
    assert (found.values, found.rank) == (5, 1)
    assert "smaller" not in found.sentence


@pytest.mark.slow
def test_shapes_of_unit_norm_have_a_degree_less() -> None:
    """Noise along a shape disappears in its norm: p-values stay uniform only where that is counted."""
    rng, p = np.random.default_rng(6), []
    shape = np.array([1.0, 2.0, -1.0, 0.5, 1.5]) / np.linalg.norm([1.0, 2.0, -1.0, 0.5, 1.5])
    for _ in range(1200):
        noisy = shape + 0.002 * rng.normal(size=5)
        r = (shape - noisy / np.linalg.norm(noisy)) / 0.002
        block = ResidualBlock("shape", "free", "1", r, np.zeros((5, 1)), 0.002, lost=1)
        p.append(goodness_of_fit([block]).p_value)
    assert kstest(np.array(p, float), "uniform").pvalue > 0.01


def test_kinds_that_are_not_normal_are_left_out_with_their_reason() -> None:
    J, e = _jacobian(), np.random.default_rng(7).normal(size=14)
    macs = [replace(b, not_normal="a MAC is not normal") for b in _blocks(np.full(14, 50.0), J, "MAC")]
    found = goodness_of_fit([*_blocks(e, J), *macs])
    assert found.degrees_of_freedom == 11
    assert found.untested == (("MAC", "a MAC is not normal"),)
    assert [kind for kind, *_ in found.by_kind] == ["frequency"]
    assert goodness_of_fit(macs).sentence == "not tested: MAC residuals: a MAC is not normal"
    none = goodness_of_fit(_blocks(e, J), untested="they are estimated")
    assert none.sentence == "not tested: frequency residuals: they are estimated"


@pytest.mark.slow
def test_values_that_are_correlated_are_whitened() -> None:
    """Values that share an error: their sum of squares alone is too large too often."""
    rng, covariance = np.random.default_rng(8), np.eye(5) + 4.0
    r = np.linalg.cholesky(covariance) @ rng.normal(size=(5, 1500))
    blocks = [ResidualBlock("shape", "free", "1", x, np.zeros((5, 0)), 0.01, covariance=covariance) for x in r.T]
    p = [goodness_of_fit([block]).p_value for block in blocks]
    assert kstest(np.array(p, float), "uniform").pvalue > 0.01
    found = goodness_of_fit(blocks[:1])
    assert found.degrees_of_freedom == 5
    assert found.chi_square == pytest.approx(r[:, 0] @ np.linalg.solve(covariance, r[:, 0]))


@pytest.mark.parametrize(("first", "second"), [(3, 3), (2, 5), (4, 2)])
def test_chance_of_few_runs_by_counting_all_orders(first: int, second: int) -> None:
    orders = set(permutations([1] * first + [0] * second))
    runs = np.array([1 + np.count_nonzero(np.diff(o)) for o in orders])
    for r in range(1, first + second + 1):
        assert fewest_runs(r, first, second) == pytest.approx(np.mean(runs <= r))


@pytest.mark.parametrize("distance", [-2.0, 0.0, 1.5])
def test_chance_of_few_runs_of_many_residuals_is_that_of_the_normal_distribution(distance: float) -> None:
    first, second = 31_000, 29_000
    mean = 1.0 + 2.0 * first * second / (first + second)
    sd = np.sqrt((mean - 1.0) * (mean - 2.0) / (first + second - 1))
    runs = round(mean + distance * sd)
    assert fewest_runs(runs, first, second) == pytest.approx(norm.cdf((runs + 0.5 - mean) / sd), abs=1e-3)


def test_one_sign_only_says_nothing() -> None:
    assert fewest_runs(1, 5, 0) == 1.0
