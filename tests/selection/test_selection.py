"""Collinearity, subset selection, information and the output covariance, against closed forms and a published truss."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.selection import collinearity, cosine_distances, fisher_information, forward_selection, stepwise_selection

from . import truss

NAMES = tuple("abcd")


def _random(n=8, k=4, seed=0):
    return np.random.default_rng(seed).standard_normal((n, k))


def test_orthogonal_columns_are_not_collinear():
    found = collinearity(np.diag([3.0, 2.0, 1.0, 0.5]), NAMES)
    np.testing.assert_allclose(found.cosine, np.eye(4))
    np.testing.assert_allclose(found.condition_index, 1.0)
    np.testing.assert_allclose(found.effect, [3.0, 2.0, 1.0, 0.5])
    assert found.index == pytest.approx(1.0)
    assert not found.pairs
    assert not found.dependences


def test_two_columns_at_an_angle():
    """Of unit columns with cosine c the singular values are √(1 ± c)."""
    c = 0.999
    S = np.array([[1.0, 5.0 * c], [0.0, 5.0 * np.sqrt(1.0 - c**2)], [0.0, 0.0]])
    found = collinearity(S, NAMES[:2])
    assert found.cosine[0, 1] == pytest.approx(c)
    assert found.condition_index[1] == pytest.approx(np.sqrt((1 + c) / (1 - c)))
    assert found.index == pytest.approx(1.0 / np.sqrt(1 - c))
    np.testing.assert_allclose(found.variance_share.sum(axis=0), 1.0)
    assert found.pairs == (("a", "b", pytest.approx(c)),)
    assert found.dependences == ((pytest.approx(np.sqrt((1 + c) / (1 - c))), ("a", "b")),)


def test_a_dependence_and_a_column_without_effect():
    S = _random(8, 2)
    found = collinearity(np.column_stack([S, S[:, 0] - 2.0 * S[:, 1], np.zeros(8)]), NAMES)
    assert np.isinf(found.index)
    assert np.isinf(found.condition_index[2])
    assert found.dependences[0][1] == ("a", "b", "c")
    assert (found.cosine[3] == 0.0).all()


@pytest.mark.parametrize("select", [forward_selection, stepwise_selection])
def test_the_parameters_that_are_wrong_are_chosen(select):
    rng = np.random.default_rng(3)
    S = rng.standard_normal((30, 8))
    r = -S[:, [2, 5]] @ [1.0, -0.8] + 0.05 * rng.standard_normal(30)
    found = select(S, r, tuple("abcdefgh"))
    assert set(found.chosen) == {"c", "f"}
    assert found.steps[1].left == pytest.approx(0.05 / np.sqrt(1.64), rel=0.4)


def test_forward_selection_is_least_squares_at_every_step():
    S, r = _random(9, 4, 1), _random(9, 1, 2)[:, 0]
    found = forward_selection(S, r, NAMES)
    assert sorted(found.order) == list(NAMES)
    for i, step in enumerate(found.steps, start=1):
        columns = S[:, [NAMES.index(n) for n in found.order[:i]]]
        left = r - columns @ np.linalg.lstsq(columns, r, rcond=None)[0]
        assert step.left == pytest.approx(np.linalg.norm(left) / np.linalg.norm(r))


def test_steps_are_judged_by_the_mean_square_of_all_columns():
    """Two unit columns leave 3 with 3 degrees of freedom; the table of F has 10.13 for 1 and 3 of them at 95 %."""
    found = forward_selection(np.eye(5)[:, :2], np.array([3.0, 4.0, 1.0, 1.0, 1.0]), ("a", "b"))
    assert [s.f_value for s in found.steps] == pytest.approx([16.0, 9.0])
    assert found.order == ("b", "a")
    assert found.chosen == ("b",)


def test_two_wrong_parameters_are_no_chance_for_each_other():
    """With three residuals the first step alone leaves too much to be significant by itself."""
    S = np.array([[1.0, 0.2], [0.5, 0.9], [0.4, 0.7]])
    found = forward_selection(S, -S @ [1.0, -1.2] + 1e-3, ("a", "b"))
    assert set(found.chosen) == {"a", "b"}


def test_without_freedom_the_stated_scatter_decides():
    S = np.eye(2)
    assert forward_selection(S, np.array([5.0, 1.0]), ("a", "b")).chosen == ("a",)
    assert forward_selection(S, np.array([1.0, 1.5]), ("a", "b")).chosen == ()


def test_stepwise_drops_what_others_replace():
    """The column nearest to the residual is a mixture of two that together leave nothing of it."""
    rng = np.random.default_rng(0)
    a, b = np.linalg.qr(rng.standard_normal((40, 2)))[0].T
    mixture = a + b + 0.02 * rng.standard_normal(40)
    S = np.column_stack([mixture, a, b])
    r = 3.0 * a + 2.0 * b + 0.01 * rng.standard_normal(40)
    found = stepwise_selection(S, r, ("mixture", "a", "b"))
    assert set(found.chosen) == {"a", "b"}
    assert [s.name for s in found.steps if not s.taken] == ["mixture"]


def test_dependent_columns_are_taken_once():
    S = _random(6, 2)
    found = forward_selection(np.column_stack([S, S[:, :1], np.zeros(6)]), _random(6, 1, 4)[:, 0], NAMES)
    assert len(found.order) == 2


def test_information_is_the_inverse_of_the_covariance():
    S = _random(9, 4, 5)
    found = fisher_information(S, NAMES)
    np.testing.assert_allclose(found.together, np.sqrt(np.diag(np.linalg.inv(S.T @ S))))
    np.testing.assert_allclose(found.alone, 1.0 / np.linalg.norm(S, axis=0))
    assert (found.together >= found.alone).all()
    np.testing.assert_allclose(1.0 / np.prod(found.d_gain) ** 2, np.linalg.det(S.T @ S))
    assert found.a_sum[-1] == pytest.approx(np.sqrt(np.trace(np.linalg.inv(S.T @ S))))


def test_each_step_of_a_design_is_the_best_one():
    S = _random(9, 4, 6)
    found = fisher_information(S, NAMES)
    for order, worth in (
        (found.d_order, lambda c: -np.linalg.det(c.T @ c)),
        (found.a_order, lambda c: np.trace(np.linalg.inv(c.T @ c))),
    ):
        for i in range(1, 4):
            others = [[*order[:i], j] for j in range(4) if j not in order[:i]]
            assert min(others, key=lambda at: worth(S[:, at])) == list(order[: i + 1])


def test_what_depends_on_others_is_not_known():
    S = _random(6, 3)
    found = fisher_information(np.column_stack([100.0 * S, 100.0 * (S[:, 0] + S[:, 1])]), NAMES)
    assert np.isinf(found.together[[0, 1, 3]]).all()
    assert found.known == ("c",)


@pytest.mark.parametrize(("count", "least"), [(10, 0.028), (15, 0.030), (20, 0.21)])
def test_the_truss_of_the_chapter_with_its_linear_covariance(count, least):
    values, slopes = truss.sensitivities(count)
    scaled = slopes / values[:, None]
    true = [b - 1 for b in truss.TRUE]
    C = 0.04 * scaled[:, true] @ scaled[:, true].T * np.outer(values, values)
    names = tuple(str(b) for b in truss.bars())
    found = cosine_distances(C, values, slopes, np.ones(21), names)
    assert found.rank == 5
    assert found.scatters == tuple(str(b) for b in truss.TRUE)
    assert found.clear
    assert found.distance[true].max() < 1e-13
    others = [i for i in range(1, 21) if i not in true]
    assert found.distance[others].min() == pytest.approx(least, abs=2e-3)
    assert np.flatnonzero(found.insensitive).tolist() == [0]
    assert "No output depends on 1" in found.sentences[1]


def test_the_best_set_is_the_only_one_of_its_size():
    """All sets of two candidates of five, by the angle between spaces."""
    S = _random(7, 5, 8)
    C = S[:, [1, 3]] @ np.diag([1.0, 4.0]) @ S[:, [1, 3]].T
    found = cosine_distances(C, np.ones(7), S, np.ones(5), tuple("abcde"))
    assert found.scatters == ("b", "d")
    space = np.linalg.eigh(C)[1][:, -2:]
    angles = {
        at: np.linalg.svd(space.T @ np.linalg.qr(S[:, at])[0], compute_uv=False).min()
        for at in combinations(range(5), 2)
    }
    assert max(angles, key=angles.get) == (1, 3)


def test_scatter_that_no_candidate_explains():
    S = _random(9, 3, 1)
    C = np.cov(np.random.default_rng(2).standard_normal((9, 200)))
    found = cosine_distances(C + 1e-3 * S @ S.T, np.ones(9), S, np.ones(3), ("a", "b", "c"), rank=2)
    assert not found.clear
    assert "does not clearly identify a set" in found.sentences[0]


def test_a_covariance_without_scatter_is_refused():
    with pytest.raises(FemtuneError, match="is zero") as error:
        cosine_distances(np.zeros((2, 2)), np.ones(2), np.eye(2), np.ones(2), ("a", "b"))
    assert error.value.code == "select.covariance"


def _two_of_five() -> tuple[np.ndarray, np.ndarray]:
    """Sensitivities of nine outputs to five parameters, and a covariance that only b and d cause."""
    S = _random(9, 5, 8)
    return S, S[:, [1, 3]] @ np.diag([1.0, 4.0]) @ S[:, [1, 3]].T


@pytest.mark.parametrize("zero", [[4], [0, 1, 2], list(range(9))])
def test_outputs_with_a_mean_of_zero_are_scaled_by_their_standard_deviation(zero):
    S, C = _two_of_five()
    mean = np.full(9, 40.0)
    mean[zero] = 0.0
    found = cosine_distances(C, mean, S, np.ones(5), tuple("abcde"))
    assert found.scatters == ("b", "d")
    assert found.clear
    assert found.distance[[1, 3]].max() < 1e-10
    assert found.distance[[0, 2, 4]].min() > 0.01
    assert np.isfinite(found.eigenvalues).all()


def test_the_unit_of_an_output_with_a_mean_of_zero_does_not_matter():
    S, C = _two_of_five()
    mean, unit = np.full(9, 40.0), np.ones(9)
    mean[4], unit[4] = 0.0, 1e6
    one = cosine_distances(C, mean, S, np.ones(5), tuple("abcde"))
    other = cosine_distances(C * np.outer(unit, unit), mean, S * unit[:, None], np.ones(5), tuple("abcde"))
    np.testing.assert_allclose(one.distance, other.distance, atol=1e-12)
    np.testing.assert_allclose(one.eigenvalues[:2], other.eigenvalues[:2])


def test_a_parameter_whose_value_is_zero_has_a_distance():
    """An offset, say; in whatever unit."""
    S, C = _two_of_five()
    one = cosine_distances(C, np.full(9, 40.0), S, np.ones(5), tuple("abcde"))
    scale = np.array([1.0, 1e13, 1e-13, 1.0, 1.0])
    zero = cosine_distances(C, np.full(9, 40.0), S * scale, np.array([1.0, 0.0, 0.0, 1.0, 1.0]), tuple("abcde"))
    np.testing.assert_allclose(one.distance, zero.distance, atol=1e-12)
    assert not zero.insensitive.any()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mean": np.array([0.0, 1.0]), "covariance": np.diag([0.0, 1.0])}, "output 1"),
        ({"mean": np.array([np.nan, 1.0])}, "a value that is not finite"),
        ({"covariance": np.array([[1.0, np.nan], [np.nan, 1.0]])}, "a value that is not finite"),
        ({"jacobian": np.array([[1.0, np.inf], [0.0, 1.0]])}, "a value that is not finite"),
        ({"jacobian": np.zeros((2, 2))}, "no output depends on any of the parameters"),
        ({"values": np.zeros(2), "jacobian": np.zeros((2, 2))}, "no output depends on any of the parameters"),
    ],
)
def test_moments_without_distances_are_refused(change, words):
    given = {"covariance": np.eye(2), "mean": np.ones(2), "jacobian": np.eye(2), "values": np.ones(2)} | change
    with pytest.raises(FemtuneError, match=words) as error:
        cosine_distances(**given, names=("a", "b"))
    assert error.value.code == "select.covariance"
