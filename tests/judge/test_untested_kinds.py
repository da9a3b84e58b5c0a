"""Kinds of residual whose size no test judges: the verdict says how large they are."""

from __future__ import annotations

import pytest

from femtune.steps.judge.reasons.parts import parts_reasons
from femtune.steps.judge.record.judgement import JudgementResults
from femtune.steps.judge.record.parts import PartsResults, UntestedKind
from femtune.steps.results import Results
from femtune.steps.update.record.update import ResidualCount, UpdateResults
from femtune.steps.validate.record.validation import GoodnessResults

WHY = "the errors of different lines are not independent"


@pytest.mark.parametrize(
    ("rms", "said"),
    [
        (0.8, "noise in the frf residuals not tested"),
        (5.1, "frf residuals 5.1 times their standard deviation (77 %)"),
        (None, "noise in the frf residuals not tested"),
    ],
)
def test_their_size_is_named_if_it_is_remarkable(rms: float | None, said: str) -> None:
    count = ResidualCount(
        kind="frf", count=4536, misfit=rms, rms_after=rms, error_after_percent=None if rms is None else 15.05 * rms
    )
    parts = PartsResults(parts=(), neighbours=(), kinds=(), untested=(UntestedKind(kind="frf", reason=WHY),))
    results = Results.model_construct(
        judgement=JudgementResults(verdict="accepted", line="", parts=parts),
        update=UpdateResults.model_construct(residual_counts=(count,), goodness=None),
    )
    (one,) = parts_reasons(results)
    assert (one.weight, one.brief) == ("reservation", said)
    assert one.sentence.endswith(WHY)


@pytest.mark.parametrize("p_value", [0.008, 0.0001])
def test_a_fit_that_fails_as_a_whole_is_a_reservation_where_no_part_fails(p_value: float) -> None:
    """The section of the fit says "fail" from 1 % on, and the verdict does not pass over it."""
    goodness = GoodnessResults.model_construct(
        p_value=p_value, verdict="fail", sentence="the residuals are larger than the stated standard deviations imply"
    )
    results = Results.model_construct(
        judgement=JudgementResults(
            verdict="accepted", line="", parts=PartsResults(parts=(), neighbours=(), kinds=(), untested=())
        ),
        update=UpdateResults.model_construct(residual_counts=(), goodness=goodness),
    )
    (one,) = parts_reasons(results)
    assert (one.weight, one.code) == ("reservation", "judge.misfit")
    assert "larger than the stated" in one.sentence
