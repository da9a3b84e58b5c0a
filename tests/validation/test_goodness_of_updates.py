"""Goodness of fit over simulated tests of a chain of springs: uniform where the model is right, and never missed."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
from scipy.stats import kstest

from femtune.updating import SensitivityMethod, update
from femtune.validation import Outcome, goodness_of_fit
from structures.coverage import CoverageProblem, spring_chain


def _chances(problem: CoverageProblem, seeds: Iterable[int]) -> list[float]:
    out = []
    for seed in seeds:
        found = goodness_of_fit(update(problem.problem(seed)).after.blocks)
        assert found.p_value is not None
        out.append(found.p_value)
    return out


@pytest.mark.long
def test_chances_are_uniform_where_the_model_is_right() -> None:
    """Kolmogorov-Smirnov at a level of one in a thousand.

    The noise is that of fixed seeds, but the eigen-solver chooses the signs of the shapes to which it is added. Another
    machine therefore draws another sample, and a right program fails on one machine in a thousand.
    """
    assert kstest(_chances(spring_chain(), range(200)), "uniform").pvalue > 0.001


@pytest.mark.slow
@pytest.mark.parametrize(
    "seeds",
    [
        range(2),
        pytest.param(range(2, 8), marks=pytest.mark.slow),
        pytest.param(range(8, 20), marks=pytest.mark.long),
    ],
    ids=["few", "more", "rest"],
)
def test_a_spring_that_the_model_lacks_is_never_missed(seeds: range) -> None:
    assert max(_chances(spring_chain(0.15), seeds)) < 0.01


@pytest.mark.slow
def test_the_sentence_names_what_is_worst() -> None:
    found = goodness_of_fit(update(spring_chain(0.15).problem(0)).after.blocks)
    assert found.outcome is Outcome.FAIL
    assert "larger than noise" in found.sentence
    assert np.abs(found.largest or 0.0) > 3.0


@pytest.mark.slow
def test_without_an_optimum_the_residuals_of_the_kept_values_are_tested() -> None:
    """The linear model at the first point promises small residuals, which the kept values do not have."""
    method = SensitivityMethod(max_iterations=0)
    result = update(spring_chain().problem(0), method)
    assert not result.status.ok
    r = result.after.residuals
    found = goodness_of_fit(result.after.blocks, optimum=False)
    assert found.chi_square == pytest.approx(float(r @ r), rel=1e-12)
    assert found.outcome is Outcome.FAIL
    assert "ended without an optimum" in found.sentence
    promised = goodness_of_fit(result.after.blocks)
    assert promised.chi_square < 0.2 * found.chi_square  # type: ignore[operator]
    # at an optimum both are the same, since the gradient vanishes
    good = update(spring_chain().problem(0)).after.blocks
    both = [goodness_of_fit(good, optimum=optimum).chi_square for optimum in (True, False)]
    assert both[0] == pytest.approx(both[1], rel=1e-6)
