"""Parameters chosen in pure noise, whatever the number of candidates; real effects are still chosen."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from femtune.arrays import Reals
from femtune.selection import Subset, collinearity, fisher_information, forward_selection, stepwise_selection
from femtune.selection.information import measure_sentences

SELECTIONS = (forward_selection, stepwise_selection)
COUNTS = (1, 4, 8, 20, 40)

Selection = Callable[..., Subset]


def _names(count: int) -> tuple[str, ...]:
    return tuple(f"p{i}" for i in range(count))


def _columns(rows: int, count: int, correlation: float = 0.0) -> Reals:
    """Candidates of very different lengths, each pair with about this cosine."""
    rng = np.random.default_rng(5)
    common, own = rng.standard_normal((rows, 1)), rng.standard_normal((rows, count))
    return (np.sqrt(1.0 - correlation) * own + np.sqrt(correlation) * common) * 10.0 ** rng.uniform(-3.0, 3.0, count)


def _rate(select: Selection, S: Reals, draws: int) -> float:
    """Part of pure noise in which any parameter is chosen, in %."""
    rng = np.random.default_rng(1)
    names = _names(S.shape[1])
    return 100.0 * np.mean([bool(select(S, rng.standard_normal(len(S)), names).chosen) for _ in range(draws)])


@pytest.mark.parametrize("select", SELECTIONS)
@pytest.mark.slow
def test_noise_chooses_one_of_eight_in_five_percent(select: Selection) -> None:
    """Three standard deviations of 300 draws are 3.8 %; the F test of one candidate chooses in 30 %."""
    assert _rate(select, _columns(40, 8, 0.5), 300) == pytest.approx(5.0, abs=3.8)


@pytest.mark.long
@pytest.mark.parametrize(
    ("select", "correlation", "count"),
    [
        *((forward_selection, 0.0, count) for count in COUNTS),
        *((stepwise_selection, 0.0, count) for count in (4, 40)),
        (forward_selection, 0.99, 20),
        (stepwise_selection, 0.99, 20),
    ],
)
def test_noise_chooses_in_five_percent(select: Selection, correlation: float, count: int) -> None:
    assert 3.0 <= _rate(select, _columns(60, count, correlation), 1000) <= 7.0


@pytest.mark.long
@pytest.mark.parametrize("count", COUNTS)
def test_noise_of_stated_variance_chooses_in_five_percent(count: int) -> None:
    """As many columns as residuals leave no degree of freedom."""
    assert 3.0 <= _rate(forward_selection, _columns(count, count, 0.5), 1000) <= 7.0


@pytest.mark.long
@pytest.mark.parametrize("select", SELECTIONS)
def test_a_real_effect_makes_no_other_significant(select: Selection) -> None:
    """The second step is a test of 19 candidates in what the first leaves."""
    S, rng = _columns(60, 20), np.random.default_rng(2)
    effect = 30.0 * S[:, 3] / np.linalg.norm(S[:, 3])
    found = [select(S, effect + rng.standard_normal(60), _names(20)).chosen for _ in range(1000)]
    assert all(chosen[0] == "p3" for chosen in found)
    assert 3.0 <= 100.0 * np.mean([len(chosen) > 1 for chosen in found]) <= 7.0


@pytest.mark.parametrize("select", SELECTIONS)
@pytest.mark.slow
def test_an_effect_of_six_standard_deviations_is_chosen_among_twenty(select: Selection) -> None:
    """The limit of F is 10.2, that of the effect 3.2 standard deviations: 99.7 % of draws exceed it."""
    S, rng = _columns(60, 20), np.random.default_rng(2)
    effect = 6.0 * S[:, 3] / np.linalg.norm(S[:, 3])
    found = [select(S, effect + rng.standard_normal(60), _names(20)).chosen for _ in range(50)]
    assert sum("p3" in chosen for chosen in found) >= 47


@pytest.mark.parametrize("select", SELECTIONS)
@pytest.mark.parametrize("amount", [0.0, 0.3, 0.6])
def test_one_candidate_is_tested_by_f(select: Selection, amount: float) -> None:
    S = _columns(12, 1)
    r = np.random.default_rng(4).standard_normal(12) + amount * S[:, 0] / np.abs(S).max()
    left = r - S[:, 0] * (S[:, 0] @ r) / (S[:, 0] @ S[:, 0])
    f = (r @ r - left @ left) / (left @ left / 11)
    p = stats.f.sf(f, 1, 11)
    found = select(S, r, ("p0",))
    assert bool(found.chosen) == (p < 0.05)
    if found.steps:
        assert found.steps[0].f_value == pytest.approx(f)
        assert found.steps[0].p_value == pytest.approx(p, rel=1e-9)
        assert found.steps[0].candidates == 1


SENSORS = 3


def _of_unit_norm(shapes: int, count: int) -> tuple[Reals, Reals]:
    """Projection that takes from residuals of shapes what unit norm takes from them, and columns of such residuals."""
    v = np.random.default_rng(8).standard_normal((shapes, SENSORS))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    blocks = [np.eye(SENSORS) - np.outer(w, w) for w in v]
    P = np.zeros((shapes * SENSORS, shapes * SENSORS))
    for i, block in enumerate(blocks):
        P[i * SENSORS : (i + 1) * SENSORS, i * SENSORS : (i + 1) * SENSORS] = block
    return P, P @ _columns(shapes * SENSORS, count)


@pytest.mark.parametrize("select", SELECTIONS)
@pytest.mark.slow
def test_shapes_of_unit_norm_count_their_independent_residuals(select: Selection) -> None:
    """Six shapes at three sensors, eight candidates: 4 degrees of freedom, not 10, with which noise chooses in 40 %."""
    P, S = _of_unit_norm(6, 8)
    rng, names = np.random.default_rng(9), _names(8)
    found = [select(S, P @ rng.standard_normal(len(S)), names, lost=6).chosen for _ in range(300)]
    assert 100.0 * np.mean([bool(chosen) for chosen in found]) == pytest.approx(5.0, abs=3.8)


def test_relative_weights_without_freedom_choose_nothing() -> None:
    """As many candidates as independent residuals: only stated deviations tell noise from effects."""
    P, S = _of_unit_norm(2, 4)
    r = P @ np.array([40.0, 1.0, 30.0, 2.0, 5.0, 20.0])
    assert forward_selection(S, r, _names(4), lost=2).chosen
    found = forward_selection(S, r, _names(4), lost=2, variance_stated=False)
    assert found.chosen == ()
    assert len(found.steps) == 4
    assert np.isnan([s.p_value for s in found.steps]).all()
    (said,) = measure_sentences(collinearity(S, _names(4)), fisher_information(S, _names(4)), found)[:1]
    assert "Not tested" in said


def test_one_candidate_without_freedom_is_tested_by_the_normal_distribution() -> None:
    (step,) = forward_selection(np.array([[2.0]]), np.array([1.7]), ("a",)).steps
    assert step.p_value == pytest.approx(2.0 * stats.norm.sf(1.7), rel=1e-9)


@pytest.mark.parametrize("count", [2, 8, 30])
def test_orthogonal_candidates_of_stated_variance_are_independent(count: int) -> None:
    """The largest of as many independent squares; 10,000 directions leave an error of 0.2 %."""
    r = np.zeros(count)
    r[0] = 2.8
    p = forward_selection(np.eye(count), r, _names(count)).steps[0].p_value
    assert p == pytest.approx(1.0 - stats.chi2.cdf(2.8**2, 1) ** count, abs=5e-3)


def test_orthogonal_candidates_of_estimated_variance() -> None:
    """The distribution of the largest F value is an integral over the estimated variance."""
    r = np.array([3.0, *np.zeros(5), *np.full(9, 1.1)])
    step = forward_selection(np.eye(15)[:, :6], r, _names(6)).steps[0]
    f = 9.0 / 1.21
    share = stats.chi2(9)
    p = share.expect(lambda s: 1.0 - stats.chi2.cdf(f * s / 9.0, 1) ** 6)
    assert step.f_value == pytest.approx(f)
    assert step.p_value == pytest.approx(p, abs=2e-3)


@pytest.mark.parametrize("select", SELECTIONS)
def test_candidates_with_the_same_effect_are_one_candidate(select: Selection) -> None:
    """The bound of Bonferroni would be twenty times as large."""
    s, rng = _columns(30, 1)[:, 0], np.random.default_rng(6)
    r = rng.standard_normal(30) + 3.0 * s / np.linalg.norm(s)
    alone = select(s[:, None], r, ("a",)).steps[0]
    same = select(np.outer(s, np.arange(1.0, 21.0)), r, _names(20)).steps[0]
    assert same.candidates == 20
    assert same.p_value == pytest.approx(alone.p_value, rel=1e-6)


@pytest.mark.parametrize("select", SELECTIONS)
def test_units_of_the_parameters_do_not_matter(select: Selection) -> None:
    S, rng = _columns(30, 6, 0.8), np.random.default_rng(7)
    r = rng.standard_normal(30) + 6.0 * S[:, 2] / np.linalg.norm(S[:, 2])
    one = select(S, r, _names(6))
    other = select(S * [1e6, -1.0, -1e-5, 3.0, 1e9, -7.0], r, _names(6))
    assert one.chosen
    assert one.chosen == other.chosen
    assert one.order == other.order
    np.testing.assert_allclose([s.p_value for s in one.steps], [s.p_value for s in other.steps], rtol=1e-6)


def test_steps_after_the_first_insignificant_one_are_not_tested() -> None:
    r = np.array([9.0, 0.5, 0.4, *np.full(9, 1.0)])
    steps = forward_selection(np.eye(12)[:, :3], r, ("a", "b", "c")).steps
    assert [s.name for s in steps] == ["a", "b", "c"]
    assert [s.candidates for s in steps] == [3, 2, 1]
    assert steps[0].p_value < 1e-4
    assert steps[1].p_value > 0.05
    assert np.isnan(steps[2].p_value)


def test_residuals_of_zero_choose_nothing() -> None:
    assert forward_selection(_columns(9, 3), np.zeros(9), _names(3)).chosen == ()
    assert stepwise_selection(_columns(9, 3), np.zeros(9), _names(3)).chosen == ()
