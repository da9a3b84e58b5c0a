"""Does the chi-square test reject a right model in 5 % of all tests, for every kind of residual and scaling?"""

from __future__ import annotations

import pytest
from scipy.stats import binom

from femtune.residuals.kinds import kinds
from structures.chi_square import LEVEL, Trial, rejections, trials

DRAWS, _ONCE_IN_A_THOUSAND = 2000, 5e-4
TRIALS = list(trials())
QUICK = {("frequency", "frequency"), ("shape", "unit-norm"), ("shape", "largest-entry"), ("shape", "mass"),
         ("frf", "log-complex"), ("MAC", "root")}  # fmt: skip


def _cases(tested: bool) -> list[object]:
    chosen = [(seed, t) for seed, t in enumerate(TRIALS) if tested == (not any(b.not_normal for b in t.exact))]
    slow = pytest.mark.slow
    return [
        pytest.param(seed, t, id=f"{t.kind} {t.form}", marks=[] if (t.kind, t.form) in QUICK else [slow])
        for seed, t in chosen
    ]


@pytest.mark.parametrize(("seed", "trial"), _cases(tested=True))
@pytest.mark.quick(2, rest="long")
@pytest.mark.slow
def test_a_right_model_is_rejected_as_often_as_the_level_says(seed: int, trial: Trial) -> None:
    found = rejections(trial, DRAWS, seed)
    lower, upper = (binom.ppf(p, DRAWS, LEVEL) for p in (_ONCE_IN_A_THOUSAND, 1.0 - _ONCE_IN_A_THOUSAND))
    assert lower <= found.rate * DRAWS <= upper


@pytest.mark.parametrize(("seed", "trial"), _cases(tested=False))
@pytest.mark.slow
def test_kinds_that_are_not_tested_could_not_be(seed: int, trial: Trial) -> None:
    found = rejections(trial, DRAWS, seed)
    assert found.rate > 2.0 * LEVEL
    assert found.why_not


def test_every_kind_of_a_study_is_tried() -> None:
    assert {t.kind for t in TRIALS} == {kind.label for kind in kinds().values()}


def test_degrees_of_freedom_by_hand() -> None:
    """Four shapes at five sensors, three parameters; 15 equation errors, of which 3 modes at 3 or 5 sensors count."""
    freedom = {(t.kind, t.form): sum(len(b.values) - b.lost for b in t.exact) - 3 for t in TRIALS}
    assert freedom["shape", "unit-norm"] == freedom["shape", "scale-factor"] == 4 * 5 - 4 - 3
    assert freedom["shape", "largest-entry"] == 4 * 4 - 3
    assert freedom["shape", "mass"] == 4 * 5 - 3
    assert freedom["strain", "unit-norm"] == 4 * 5 - 4 - 3
    assert freedom["dynamic", "3 of 5 DOFs measured"] == 3 * 3 - 3
    assert freedom["dynamic", "5 of 5 DOFs measured"] == 3 * 5 - 3
    # six shapes at six sensors in a ring, two of the pairs repeated
    assert freedom["shape", "unit-norm, repeated modes"] == 6 * 6 - 6 - 2 - 3
