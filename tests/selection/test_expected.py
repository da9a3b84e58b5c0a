"""Expected standard deviations of the parameters: closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.residuals import Evaluation, ResidualBlock
from femtune.selection.expected import expected_knowledge

PRIOR = np.array([0.1, 0.2, 0.3])
NAMES = ("a", "b", "c")


def at(jacobian: np.ndarray) -> Evaluation:
    block = ResidualBlock("frf", "free", "all", np.zeros(len(jacobian)), jacobian, 1.0)
    return Evaluation(np.zeros(jacobian.shape[1]), (), (block,))


def test_inverse_of_the_information() -> None:
    J = 50.0 * np.random.default_rng(1).standard_normal((40, 3))
    found = expected_knowledge(at(J), PRIOR, NAMES, 2.0)
    covariance = 4.0 * np.linalg.inv(J.T @ J)
    np.testing.assert_allclose(found.together, np.sqrt(np.diag(covariance)))
    np.testing.assert_allclose(found.alone, 2.0 / np.linalg.norm(J, axis=0))
    sd = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(found.correlation, covariance / np.outer(sd, sd), atol=1e-12)
    assert found.known.all()
    assert found.groups == ()
    assert found.sentences(np.array([1.0, 2.0, 3.0])) == [
        "From the data alone, a (±1 %), b (±2 %) and c (±3 %) can be known."
    ]


def test_parameters_that_are_known_together_only() -> None:
    rng = np.random.default_rng(2)
    one, other = rng.standard_normal((2, 200, 1))
    # b and c do nearly the same
    J = 10.0 * np.hstack([other, one, one + 0.01 * rng.standard_normal((200, 1))])
    found = expected_knowledge(at(J), PRIOR, NAMES)
    assert found.known.tolist() == [True, False, False]
    assert found.groups == (("b", "c"),)
    assert "b and c are correlated by more than 0.9: a combination of them is known much better than each." in (
        found.sentences(np.ones(3))
    )


def test_combinations_without_effect() -> None:
    one, other = np.random.default_rng(3).standard_normal((2, 30, 1))
    # a change of b is undone by a change of c
    found = expected_knowledge(at(100.0 * np.hstack([other, one, one])), PRIOR, NAMES)
    assert np.isfinite(found.together).tolist() == [True, False, False]
    assert found.open == (("b", "c"),)
    assert found.sentences(np.ones(3))[-1] == "A joint change of b and c has no effect on the data."
    # nor is one of them known if the other is not: alone it is
    assert found.alone[1] == pytest.approx(0.01 / np.linalg.norm(one))
    fixed = expected_knowledge(at(100.0 * np.hstack([other, one, one])), PRIOR * [1, 1, 0], NAMES)
    some = fixed.select(np.array([True, True, False]))
    assert some.names == ("a", "b")
    assert some.open == ()
    assert np.isfinite(some.together).all()
    assert some.known.all()
