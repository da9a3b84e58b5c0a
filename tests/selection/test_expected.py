"""Expected standard deviations of the parameters: closed forms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import pytest

from femtune.residuals import Evaluation, ResidualBlock
from femtune.residuals.weights import LineSamples
from femtune.selection.expected import expected_knowledge
from femtune.updating.covariance import Box, parameter_covariance

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
    assert found.sentences(np.array([1.0, 2.0, 3.0])) == ["The data alone determine a (±1 %), b (±2 %) and c (±3 %)."]


def test_parameters_that_are_known_together_only() -> None:
    rng = np.random.default_rng(2)
    one, other = rng.standard_normal((2, 200, 1))
    # b and c do nearly the same
    J = 10.0 * np.hstack([other, one, one + 0.01 * rng.standard_normal((200, 1))])
    found = expected_knowledge(at(J), PRIOR, NAMES)
    assert found.known.tolist() == [True, False, False]
    assert found.groups == (("b", "c"),)
    assert "b and c are correlated by more than 0.9: a combination of them is known much better than each of them." in (
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


@dataclass(frozen=True, eq=False)
class Noise:
    """An identified test whose functions are n values, with normal noise of one size."""

    n: int
    sd: float

    def draw(self, how: str, rng: np.random.Generator) -> np.ndarray:
        assert how == "noise"
        return self.sd * rng.standard_normal(self.n)

    def functions(self, change: np.ndarray) -> np.ndarray:
        return change


@dataclass(frozen=True, eq=False)
class Values:
    """They are the residuals."""

    test: Noise

    def change(self, functions: np.ndarray) -> np.ndarray:
        return functions


def identified(residuals: np.ndarray, jacobian: np.ndarray, sd: float) -> Evaluation:
    n = len(residuals)
    samples = LineSamples(np.zeros(n), np.arange(n), identified=cast("Any", Values(Noise(n, sd))))
    block = ResidualBlock("frf", "free", "all", residuals, jacobian, 1.0, samples=samples)
    return Evaluation(np.zeros(jacobian.shape[1]), (), (block,))


@pytest.mark.slow
def test_residuals_of_an_identified_test_larger_than_its_noise_increase_the_deviations() -> None:
    rng = np.random.default_rng(4)
    J = 50.0 * rng.standard_normal((4000, 3))
    outside = np.eye(4000) - J @ np.linalg.solve(J.T @ J, J.T)
    noise = outside @ rng.standard_normal(4000)
    sd = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    for size, misfit in ((0.2, 1.0), (0.6, 3.0)):
        at = identified(size * noise + 10.0 * J @ np.ones(3) / 50.0, J, 0.2)
        found = expected_knowledge(at, PRIOR, NAMES, updated=True)
        # 200 draws; what the parameters can do is no misfit
        assert found.misfit == pytest.approx(misfit, rel=0.05)
        np.testing.assert_allclose(found.together, 0.2 * misfit * sd, rtol=0.25)
        told = any("times as large as the noise" in s for s in found.sentences(np.ones(3)))
        assert told == (misfit > 1.0)
        assert expected_knowledge(at, PRIOR, NAMES).misfit == 1.0
        # one covariance serves the table of the update, too: that of Jᵀe gives the same standard deviations
        assert found.noise is not None
        moving, none = np.ones(3, bool), np.zeros((0, 3))
        table = parameter_covariance(
            at.residuals, J, at.kinds, none, ~moving, PRIOR, moving, "estimated", noise=found.noise
        )
        np.testing.assert_allclose(table.sd, found.together, rtol=1e-9)
        wide = Box(np.zeros(3), np.full(3, -9.0), np.full(3, 9.0), np.zeros(0), np.zeros(3))
        within = parameter_covariance(
            at.residuals, J, at.kinds, none, ~moving, PRIOR, moving, box=wide, noise=found.noise
        ).posterior
        assert within is not None
        # by samples
        np.testing.assert_allclose(np.sqrt(np.diag(within.covariance)), found.together, rtol=0.03)


@pytest.mark.slow
def test_residuals_as_large_as_the_noise_are_no_misfit() -> None:
    rng = np.random.default_rng(5)
    J = rng.standard_normal((500, 3))
    found = [
        expected_knowledge(identified(0.2 * rng.standard_normal(500), J, 0.2), PRIOR, NAMES, updated=True).misfit
        for _ in range(30)
    ]
    # at 1 %, three or more of 30 have a probability of 0.3 %
    assert sum(m > 1.0 for m in found) < 3
