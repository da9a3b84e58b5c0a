"""The record that all tests of a fit read: what is lost, what parameters take away, and which row is what."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.judge.scales import scales
from femtune.judge.whitened import Whitened, prior_blocks, whitened, whitened_blocks
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import ResidualBlock
from femtune.updating import Prior, SensitivityMethod, update
from structures.coverage import spring_chain


def _parameters(k: int) -> ParameterSet:
    return ParameterSet(tuple(Parameter(f"k{i}", 1.0, 0.1, 3.0) for i in range(k)))


@pytest.mark.slow
def test_rows_of_an_update_are_labelled_and_lost_combinations_are_known() -> None:
    """Five frequencies and five shapes of unit norm at six sensors: 35 rows, of which 5 combinations are lost."""
    record = whitened(update(spring_chain().problem(0)))
    assert record is not None
    assert record.r.shape == (35,)
    assert record.names == ("ka", "kb", "kc", "kd")
    assert record.lost.shape == (35, 5)
    assert record.range.shape == (35, 4)
    assert record.degrees(np.arange(35)) == pytest.approx((26.0, 26.0))
    assert (record.shares == 1.0).all()
    assert len({s for s in record.sensors if s}) == 6
    assert record.kinds.count("frequency") == 5
    assert set(record.roles) == {"data"}
    # what is lost is zero to second order in the noise of 2 % (10 sensors)
    assert np.abs(record.lost.T @ record.r).max() < 0.1
    # at the minimum the parameters have taken all they can, but for what the iteration leaves
    np.testing.assert_allclose(record.left, record.r - record.lost @ (record.lost.T @ record.r), atol=1e-3)


def test_the_covariance_of_what_is_left_is_that_of_many_draws() -> None:
    """tr A and tr A² of a part beside the variances of 4,000 draws; r of noise and of any parameters."""
    rng = np.random.default_rng(5)
    J, shape = rng.normal(size=(12, 3)), np.ones(8) / np.sqrt(8.0)
    noise = rng.normal(size=(12, 4000))
    noise[4:] -= np.outer(shape, shape @ noise[4:])
    J[4:] -= np.outer(shape, shape @ J[4:])
    blocks = [
        ResidualBlock("frequency", "free", "1", np.zeros(4), J[:4], 0.01),
        ResidualBlock("shape", "free", "1", np.zeros(8), J[4:], 0.01, lost=1, scaled=shape),
    ]
    every = np.ones(3, bool)
    record = whitened_blocks(blocks, _parameters(3), every, ~every)
    left = record.across(noise + J @ rng.normal(size=(3, 4000)) * 100.0)
    for part in (np.arange(4), np.array([2]), np.arange(3, 9)):
        A = np.cov(left[part]).reshape(len(part), len(part))
        assert record.degrees(part)[0] == pytest.approx(np.trace(A), rel=0.06)
        assert record.degrees(part)[1] == pytest.approx(np.sum(A**2), rel=0.1)
    assert record.degrees(np.arange(12))[0] == pytest.approx(12 - 1 - 3)


def test_combinations_of_unknown_direction_are_counted() -> None:
    """A block that loses two of eight values, as a shape in a cluster of modes does."""
    block = ResidualBlock("shape", "free", "1", np.zeros(8), np.zeros((8, 1)), 0.01, lost=2)
    record = whitened_blocks([block], _parameters(1), np.ones(1, bool), np.zeros(1, bool))
    assert record.degrees(np.arange(8)) == pytest.approx((6.0, 6.0))


def test_a_bounded_parameter_leaves_the_columns() -> None:
    block = ResidualBlock("frequency", "free", "1", np.array([3.0, 1.0]), np.eye(2), 0.01)
    record = whitened_blocks([block], _parameters(2), np.array([False, True]), np.array([True, False]))
    assert record.names == ("k1",)
    assert record.left.tolist() == [3.0, 0.0]
    assert record.bounded[:, 0].tolist() == [_parameters(2).prior[1][0], 0.0]


@pytest.mark.slow
def test_rows_of_a_prior_are_named_by_their_parameter() -> None:
    result = update(spring_chain().problem(0), SensitivityMethod(regularisation=Prior()))
    record = whitened(result)
    assert record is not None
    assert [b.label for b in prior_blocks(result)] == ["prior of ka", "prior of kb", "prior of kc", "prior of kd"]
    assert record.rows(lambda kind, *_: kind == "prior").tolist() == [35, 36, 37, 38]
    assert record.degrees(np.arange(39))[0] == pytest.approx(30.0)


def test_kinds_without_a_known_distribution_are_left_out_with_the_reason() -> None:
    mac = ResidualBlock("MAC", "free", "1", np.ones(1), np.ones((1, 1)), 0.01, not_normal="a quadratic form")
    record = whitened_blocks([mac], _parameters(1), np.ones(1, bool), np.zeros(1, bool))
    assert (len(record.r), record.untested) == (0, {"MAC": "a quadratic form"})


def _record(r: np.ndarray, J: np.ndarray, kinds: tuple[str, ...]) -> Whitened:
    n = len(r)
    none: tuple[str, ...] = ("",) * n
    names = tuple(f"k{i}" for i in range(J.shape[1]))
    return Whitened(r, J, names, np.zeros((n, 0)), kinds, none, none, none, ("data",) * n, np.ones(n), np.zeros((n, 0)))


def test_factors_solve_the_equations_of_helmert() -> None:
    """Two kinds with errors of 0.3 and 4 times what is stated; the solution by its own equations, and on average."""
    rng, J = np.random.default_rng(2), np.random.default_rng(3).normal(size=(40, 4))
    kinds, true = ("frequency",) * 15 + ("shape",) * 25, np.repeat([0.3, 4.0], [15, 25])
    factors = []
    for _ in range(60):
        found = scales(_record(true * rng.normal(size=40), J, kinds))
        factors.append([k.factor for k in found.kinds])
    D = 1.0 / found.rows
    P = np.eye(40) - (Jd := D[:, None] * J) @ np.linalg.solve(Jd.T @ Jd, Jd.T)
    r = P @ found.weighted.r
    for kind, at in zip(found.kinds, (slice(0, 15), slice(15, 40)), strict=True):
        assert r[at] @ r[at] == pytest.approx(np.trace(P[at, at]), rel=1e-4)
        assert kind.degrees == pytest.approx(np.trace(P[at, at]), rel=1e-6)
    # squares are unbiased to first order: three standard errors of 60 draws on 11 to 25 degrees are below 17 %
    np.testing.assert_allclose(np.mean(np.array(factors) ** 2, axis=0), [0.09, 16.0], rtol=0.17)


def test_a_kind_of_few_degrees_keeps_its_stated_deviation() -> None:
    found = scales(
        _record(np.array([5.0, 5.0, 0.1, -0.1, 0.1, -0.1]), np.zeros((6, 0)), ("mass",) * 2 + ("shape",) * 4)
    )
    mass, shape = found.kinds
    assert (mass.factor, mass.estimated) == (1.0, False)
    assert (shape.factor, shape.degrees) == (pytest.approx(0.1), 4.0)
    assert shape.coverage_factor() == pytest.approx(2.776, abs=1e-3)
