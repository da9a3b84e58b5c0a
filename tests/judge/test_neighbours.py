"""Shapes beside their neighbours: F is F of noise of any size, and a mixture of modes is found and measured."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import f as f_distribution
from scipy.stats import kstest

from femtune.judge.neighbours import neighbour_tests, project
from femtune.updating import update
from structures.judged import cantilever

SHAPES = np.sin(np.outer(np.arange(1, 13), np.arange(1, 9)) * np.pi / 13)


@pytest.mark.slow
@pytest.mark.parametrize("turned", [0, 1])
@pytest.mark.parametrize("size", [1e-3, 0.1])
def test_chances_of_noise_are_uniform(size: float, turned: int) -> None:
    """400 draws, Kolmogorov-Smirnov at one in a thousand; a turned shape has lost a direction of the rest."""
    rng, p = np.random.default_rng(3), []
    own, others = SHAPES[:, 2], SHAPES[:, [1, 3, 4, 0, 5]]
    away = SHAPES[:, 7] / np.linalg.norm(SHAPES[:, 7])
    for _ in range(400):
        e = rng.standard_normal(12)
        e -= away * (away @ e) * turned
        found = project(own + size * e, own, others, turned)
        assert found is not None
        assert found.degrees == (4, 12 - 1 - turned - 4)
        p.append(f_distribution.sf(found.F, *found.degrees))
    assert kstest(p, "uniform").pvalue > 1e-3


def test_a_mixture_is_measured() -> None:
    noise = 0.005 * np.random.default_rng(1).standard_normal(12)
    mixed = SHAPES[:, 2] + 0.07 * SHAPES[:, 4] + noise
    found = project(mixed, SHAPES[:, 2], SHAPES[:, [1, 3, 4, 0, 5]])
    assert found is not None
    assert found.other == 2
    assert found.share == pytest.approx(0.07, abs=0.01)
    # the rest is the noise, although the model is wrong
    assert found.scatter == pytest.approx(0.005, rel=0.5)


def test_few_sensors_have_fewer_neighbours_or_no_test() -> None:
    for sensors, degrees in ((6, (2, 3)), (5, (1, 3)), (4, None)):
        found = project(SHAPES[:sensors, 0] + 0.01, SHAPES[:sensors, 0], SHAPES[:sensors, 1:6])
        assert (None if found is None else found.degrees) == degrees
    # neighbours that look alike at the sensors count once
    twice = np.column_stack([SHAPES[:, 1], SHAPES[:, 1], SHAPES[:, 3], SHAPES[:, 4]])
    found = project(SHAPES[:, 0] + 0.01, SHAPES[:, 0], twice)
    assert found is not None
    assert found.degrees == (3, 12 - 1 - 3)


@pytest.mark.slow
@pytest.mark.parametrize("stated", [1.0 / 3.0, 1.0, 5.0])
def test_a_fault_of_a_beam_is_found_whatever_is_stated(stated: float) -> None:
    """A bar of half the stiffness, which no parameter can follow; the right model is quiet, with the same noise."""
    beam = cantilever()
    wrong = neighbour_tests(update(beam.problem(1, "crack", stated, stated)).after)
    right = neighbour_tests(update(beam.problem(1, "", stated, stated)).after)
    assert len(wrong) == len(right) == 6
    assert min(t.p_family_wise for t in wrong) < 0.01
    assert max(t.share for t in wrong) > 0.02
    assert min(t.p_family_wise for t in right) > 0.01
    # the noise of 2 % is seen although the model is wrong
    assert 0.01 < np.median([t.scatter for t in wrong]) < 0.03
