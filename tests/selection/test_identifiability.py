"""What data determine: closed forms, known null spaces, Bayes by sampling, and the words."""

from __future__ import annotations

import numpy as np
import pytest

import femtune.selection
from femtune.selection import combination_text, determined, estimated_size, identifiability, sentences, verdict
from femtune.selection.combinations import sparse_basis

NAMES = tuple("abcdef")


@pytest.fixture
def rng() -> np.random.Generator:
    """Of each test anew: what a test draws must not depend on which tests ran before."""
    return np.random.default_rng(11)


def test_public_names_exist():
    assert all(hasattr(femtune.selection, name) for name in femtune.selection.__all__)


def test_orthogonal_columns_by_hand():
    """S = diag(3, 0.5): posterior/prior = 1/√(1 + d²), no correlation."""
    found = identifiability(np.diag([30.0, 0.25]), np.array([0.1, 2.0]), NAMES[:2])
    np.testing.assert_allclose(found.singular_values, [3.0, 0.5])
    np.testing.assert_allclose(found.reduction, [1 / np.sqrt(10.0), 1 / np.sqrt(1.25)])
    np.testing.assert_allclose(found.correlation, np.eye(2), atol=1e-15)
    np.testing.assert_allclose(found.sensitivity, [3.0, 0.5])
    assert found.rank == 2
    assert [c.reduction for c in found.weak] == pytest.approx([1 / np.sqrt(1.25)])


def test_smaller_residuals_narrow_every_combination():
    """Of half the stated standard deviation: d = 2 × (3, 0.5); what is undetermined is not changed by the size."""
    J, spread = np.diag([30.0, 0.25, 1e-5]), np.array([0.1, 2.0, 1.0])
    found = identifiability(J, spread, NAMES[:3], size=0.5)
    np.testing.assert_allclose(found.reduction[:2], [1 / np.sqrt(37.0), 1 / np.sqrt(2.0)])
    assert found.rank == identifiability(J, spread, NAMES[:3], size=1e-6).rank == 2


def test_size_of_residuals_from_what_no_parameter_changes():
    """One column along the first of five residuals, one combination lost: (1 + 4 + 4)/3 degrees of freedom."""
    column = np.array([[2.0], [0.0], [0.0], [0.0], [0.0]])
    r = np.array([7.0, 1.0, 2.0, -2.0, 0.0])
    assert estimated_size(column, r, lost=1) == pytest.approx(np.sqrt(3.0))
    assert estimated_size(column, r, lost=4) == 1.0
    assert 0.0 < estimated_size(column, np.array([7.0, 0.0, 0.0, 0.0, 0.0]), lost=0) < 1e-7


def test_two_parameters_that_act_alike():
    """Both add up in one datum: the difference is open, ρ = −d²/(1 + d²) with d² = s² each."""
    s = 7.0
    found = identifiability(np.array([[s, s]]), np.ones(2), ("a", "b"))
    assert found.rank == 1
    (open_,) = found.undetermined
    np.testing.assert_allclose(np.abs(open_.coefficients), np.sqrt(0.5))
    assert open_.coefficients[0] * open_.coefficients[1] < 0
    assert open_.reduction == pytest.approx(1.0)
    assert found.correlation[0, 1] == pytest.approx(-(s**2) / (1 + s**2))
    np.testing.assert_allclose(found.reduction**2, (1 + s**2) / (1 + 2 * s**2))


def test_the_posterior_is_that_of_bayes(rng: np.random.Generator):
    """Prior samples weighted by the likelihood of the data, brute force."""
    J, sd = np.array([[1.0, 0.5], [0.2, -0.3]]), np.array([0.8, 1.5])
    x = rng.standard_normal((400_000, 2)) * sd
    weight = np.exp(-0.5 * np.sum((x @ J.T) ** 2, axis=1))
    covariance = np.cov(x.T, aweights=weight)
    found = identifiability(J, sd, ("a", "b"))
    np.testing.assert_allclose(found.reduction, np.sqrt(np.diag(covariance)) / sd, rtol=0.01)
    rho = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    assert found.correlation[0, 1] == pytest.approx(rho, abs=0.01)


@pytest.mark.parametrize("seed", range(5))
def test_disjoint_null_vectors_are_recovered(seed: int):
    """Whatever basis the decomposition returns, the readable one is found."""
    rng = np.random.default_rng(seed)
    truth = np.zeros((3, 8))
    truth[0, [0, 5]], truth[1, [1, 2, 6]], truth[2, 3] = [0.8, -0.6], [0.6, 0.64, -0.48], 1.0
    mixed = np.linalg.qr(rng.standard_normal((3, 3)))[0] @ truth
    found = sparse_basis(mixed)
    overlap = np.abs(found @ truth.T)
    np.testing.assert_allclose(np.sort(overlap.max(axis=0)), 1.0, atol=1e-6)
    assert ((np.abs(found) > 0) == (np.abs(truth[overlap.argmax(axis=1)]) > 0)).all()


def test_the_saddle_is_left():
    """(1, 1) and (1, −1) span two single parameters."""
    found = sparse_basis(np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0]]) / np.sqrt(2.0))
    np.testing.assert_allclose(np.sort(np.abs(found), axis=1), [[0, 0, 1], [0, 0, 1]], atol=1e-6)


def test_undetermined_combinations_of_a_product():
    """Data see a·b and c only: in logarithms a + b is known, a − b is not, d is nowhere."""
    J = np.array([[20.0, 20.0, 0.0, 0.0], [0.0, 0.0, 15.0, 0.0]])
    found = identifiability(J, np.full(4, 0.5), ("a", "b", "c", "d"))
    texts = sorted(combination_text(found.names, c) for c in found.undetermined)
    assert texts in (["+0.71 a −0.71 b", "+1.00 d"], ["+0.71 b −0.71 a", "+1.00 d"])
    assert found.rank == 2


def test_what_counts_as_determined():
    # above a tenth of a standard deviation, or above a thousandth of the best
    assert determined(np.array([200.0, 0.15, 0.05])).tolist() == [True, True, False]
    assert determined(np.array([0.02, 1e-3, 1e-5])).tolist() == [True, True, False]
    assert determined(np.zeros(2)).tolist() == [False, False]


@pytest.mark.parametrize("n", [0, 1, 9])
def test_any_number_of_residuals(rng: np.random.Generator, n: int):
    found = identifiability(rng.standard_normal((n, 3)), np.ones(3), NAMES[:3])
    assert found.rank == min(n, 3)
    assert len(found.undetermined) == 3 - found.rank


def test_no_parameters():
    found = identifiability(np.zeros((4, 0)), np.zeros(0), ())
    assert sentences(found) == ["There is no free parameter."]


def test_sentences():
    J = np.array([[20.0, 20.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    text = sentences(identifiability(J, np.full(4, 0.5), ("a", "b", "c", "d")))
    assert text[0] == "The data leave 2 combinations of the 4 free parameters undetermined."
    assert any(t.startswith("d has no effect on the measured quantities") for t in text)
    assert any(t.startswith("A joint change of a and b") for t in text)
    assert "The combination +1.00 c is weakly determined: its standard deviation is still 89 % of the prior's." in text
    good = sentences(identifiability(100.0 * np.eye(2), np.ones(2), ("a", "b")))
    assert good == ["The data determine all 2 free parameters, some better than others."]
    assert sentences(identifiability(np.array([[9.0, 9.0]]), np.ones(2), ("a", "b")))[0].startswith(
        "The data leave one combination of the 2"
    )


def test_verdicts():
    assert [verdict(r).split(":")[0] for r in (0.1, 0.5, 0.9)] == [
        "determined by the data", "partly determined", "weakly determined",
    ]  # fmt: skip


def test_rounding_alone_determines_nothing():
    """Parameters without any effect leave Jacobians of 1e-14; none of these is larger than another by right."""
    assert not determined(np.array([4e-14, 1e-14])).any()
    assert determined(np.array([1e-3, 1e-14])).tolist() == [True, False]
