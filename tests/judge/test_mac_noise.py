"""MACs beside the noise of the shapes: level and power by simulation, and where they stand in a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from femtune.judge.mac_noise import mac_parts, mac_test
from femtune.residuals import FrequencyResidual, UpdateProblem
from femtune.residuals.mac import MacResidual
from femtune.updating import update
from structures.coverage import spring_chain


def test_a_right_model_is_refused_as_often_as_the_level_says() -> None:
    """Entries of different deviations, and a model shape that three uncertain parameters move."""
    rng = np.random.default_rng(0)
    shape, sd = rng.standard_normal(20), 0.02 * rng.uniform(0.5, 2.0, 20)
    gradient, root = rng.standard_normal((20, 3)), 0.004 * rng.standard_normal((3, 3))
    noise, covariance = np.diag(sd**2), root @ root.T
    found = []
    for _ in range(1000):
        test = 3.0 * (shape + gradient @ root @ rng.standard_normal(3)) + sd * rng.standard_normal(20)
        tested = mac_test(test, shape, noise, gradient, covariance)
        assert tested is not None
        found.append(tested[2])
    # the distribution is approximate; at the levels that count it is that of the simulation
    for level in (0.01, 0.05):
        count = int(np.sum(np.array(found) < level))
        assert binom.ppf(1e-3, len(found), level) <= count <= binom.isf(1e-3, len(found), level)


def test_another_shape_is_no_noise() -> None:
    rng = np.random.default_rng(1)
    shape, other = rng.standard_normal(20), rng.standard_normal(20)
    for share, refused in ((0.0, False), (0.1, True)):
        test = shape + share * other + 0.01 * rng.standard_normal(20)
        tested = mac_test(test, shape, 1e-4 * np.eye(20), np.zeros((20, 0)), np.zeros((0, 0)))
        assert tested is not None
        assert (tested[2] < 1e-4) is refused


@pytest.mark.slow
def test_macs_of_an_update_are_tested_where_the_shapes_have_deviations() -> None:
    """The spring chain by frequencies and MACs: a spring to the ground that the model lacks shows in the MACs."""
    least = []
    for unmodelled in (0.0, 0.5):
        problem = spring_chain(unmodelled).problem(3)
        (case,) = problem.cases
        residuals = (FrequencyResidual(0.004), MacResidual(0.01))
        without = update(UpdateProblem((case,), problem.parameters, residuals))
        assert mac_parts(without) == ()
        known = replace(case, test=replace(case.test, shapes_sd=np.full(case.test.shapes.shape, 0.02)))
        found = mac_parts(update(UpdateProblem((known,), problem.parameters, residuals)))
        assert [(p.family, p.kind) for p in found] == [("modes", "MAC")] * 5
        least.append(5.0 * min(p.p_large for p in found))
    assert least[0] > 0.05
    assert least[1] < 1e-3
