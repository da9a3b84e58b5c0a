"""Do 95 % intervals hold the truth as often as they say? Counts are held against the binomial distribution."""

from __future__ import annotations

import pytest
from scipy.stats import binom

from femtune.updating import update
from structures.coverage import CoverageProblem, run_coverage, spring_chain, stepped_cantilever

_ONCE_IN_A_THOUSAND = 5e-4


@pytest.mark.long
def test_student_intervals_hold_where_the_scatter_is_estimated():
    found = run_coverage(stepped_cantilever(), range(40))
    assert (found.coverage * 40 >= binom.ppf(_ONCE_IN_A_THOUSAND, 40, 0.95)).all()
    # ±1.96 σ would not do, with two degrees of freedom
    assert found.normal_coverage.mean() < 0.9
    one = update(stepped_cantilever().problem(0)).covariance
    assert one.coverage_factor() == pytest.approx(4.3027, rel=1e-4)


@pytest.mark.slow
def test_what_the_model_lacks_is_seen_in_every_test():
    assert run_coverage(spring_chain(0.15), range(8)).suspected.all()


@pytest.mark.long
@pytest.mark.parametrize("problem", [spring_chain(), stepped_cantilever()], ids=lambda p: p.name)
def test_intervals_hold_the_truth_in_95_of_100_tests(problem: CoverageProblem):
    tests = 1000
    found = run_coverage(problem, range(tests))
    least, most = binom.ppf([_ONCE_IN_A_THOUSAND, 1.0 - _ONCE_IN_A_THOUSAND], tests, 0.95)
    assert ((least <= found.coverage * tests) & (found.coverage * tests <= most)).all()


@pytest.mark.long
def test_a_right_model_is_seldom_suspected():
    tests = 400
    suspected = run_coverage(spring_chain(), range(2000, 2000 + tests)).suspected.sum()
    # two kinds of residual, each at one per cent
    assert suspected <= binom.ppf(1.0 - _ONCE_IN_A_THOUSAND, tests, 0.02)
