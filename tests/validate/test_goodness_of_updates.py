"""Goodness of fit over simulated tests of a chain of springs: uniform where the model is right, and never missed."""

from __future__ import annotations

import numpy as np
from scipy.stats import kstest

from femtune.residuals import ResidualBlock
from femtune.testing.coverage import CoverageProblem, spring_chain
from femtune.update import update
from femtune.validate import Outcome, goodness_of_fit


def _lost(block: ResidualBlock) -> int:
    return int(block.kind == "shape")


def _chances(problem: CoverageProblem, tests: int) -> list[float]:
    out = []
    for seed in range(tests):
        found = goodness_of_fit(update(problem.problem(seed)).after.blocks, lost=_lost)
        assert found.p_value is not None
        out.append(found.p_value)
    return out


def test_chances_are_uniform_where_the_model_is_right() -> None:
    assert kstest(_chances(spring_chain(), 80), "uniform").pvalue > 0.01


def test_a_spring_that_the_model_lacks_is_never_missed() -> None:
    assert max(_chances(spring_chain(0.15), 20)) < 0.01


def test_the_sentence_names_what_is_worst() -> None:
    found = goodness_of_fit(update(spring_chain(0.15).problem(0)).after.blocks, lost=_lost)
    assert found.outcome is Outcome.FAIL
    assert "the residuals are not noise: chi-square" in found.sentence
    assert np.abs(found.largest or 0.0) > 3.0
