"""Right models whose standard deviations are stated three times too small or too large: the tests keep their level."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from femtune.judge.missing import score_test
from femtune.judge.parts import parts
from femtune.judge.whitened import Whitened, whitened
from femtune.steps.judge.facts.parts import scaled_by_residuals
from femtune.steps.judge.record.parts import SHARE_OF_MISSING, SHARE_OF_PARTS
from femtune.updating import update
from structures.coverage import spring_chain

_TESTS = 40
_KINDS = ("frequency", "shape")


@pytest.fixture(scope="module")
def record() -> Whitened:
    """Five frequencies, which four parameters nearly fit, and five shapes."""
    found = whitened(update(spring_chain().problem(0)))
    assert found is not None
    return found


def drawn(record: Whitened, times: dict[str, float], rng: np.random.Generator) -> Whitened:
    """The record of a linear right model whose errors are some times the stated deviations."""
    e = rng.standard_normal(len(record.r))
    e = np.array([times[kind] for kind in record.kinds]) * (e - record.lost @ (record.lost.T @ e))
    return replace(record, r=e - record.J @ np.linalg.lstsq(record.J, e)[0])


@pytest.mark.slow
@pytest.mark.parametrize("shape", [1 / 3, 1.0, 3.0])
@pytest.mark.parametrize("frequency", [1 / 3, 1.0, 3.0])
def test_level(record: Whitened, frequency: float, shape: float) -> None:
    """Of the search for missing fields, and of the parts where the deviations are assumptions; at 5 % each."""
    rng = np.random.default_rng(3)
    columns = 50.0 * rng.standard_normal((len(record.r), 6))
    columns -= record.lost @ (record.lost.T @ columns)
    found = np.zeros(2, int)
    for _ in range(_TESTS):
        one = drawn(record, {"frequency": frequency, "shape": shape}, rng)
        score = score_test(one, columns, np.full((6, 2), 0.2), draws=80)
        assert score is not None
        tested = parts(*_scaled_parts(one))
        least = (float(score.p.min()), min((p.p_family_wise for p in tested), default=1.0))
        shares = (SHARE_OF_MISSING, SHARE_OF_PARTS)
        found += np.array([p / share < 0.05 for p, share in zip(least, shares)])
    assert (found <= binom.isf(1e-3, _TESTS, 0.05)).all()


def _scaled_parts(one: Whitened) -> tuple[Whitened, bool, frozenset[str]]:
    scaled, estimated = scaled_by_residuals(one, frozenset(_KINDS))
    return scaled, False, estimated
