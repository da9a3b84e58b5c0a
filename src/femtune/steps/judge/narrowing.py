"""Intervals that estimated errors make narrower, where a test of the fit fails."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.steps.judge.facts.parts import parts_results
from femtune.steps.judge.record.missing import MissingResults
from femtune.steps.judge.record.parts import LEAST_SHARE, RESERVED, PartsResults
from femtune.updating import not_narrowed

if TYPE_CHECKING:
    from femtune.steps.judge.run import JudgedTopics
    from femtune.study.study import Study
    from femtune.updating import UpdateResult


def with_honest_intervals(study: Study, result: UpdateResult, judged: JudgedTopics | None) -> UpdateResult:
    """The result; where a test of the fit fails, with intervals that are not narrower than the stated deviations make.

    Of a wrong model the errors that the residuals show are those that its parameters left: they are too small for the
    kinds in which a wrong parameter can hide.

    Parameters
    ----------
    judged : the tests of the fit, the search for missing fields among them; None before it, so that the tests of parts
        and neighbours alone decide
    """
    if not result.covariance.narrowed:
        return result
    records = {} if judged is None else judged.records
    parts, missing = records.get("parts") or parts_results(study, result), records.get("missing")
    assert parts is None or isinstance(parts, PartsResults)
    assert missing is None or isinstance(missing, MissingResults)
    least = [] if parts is None else [p.p_family_wise for p in parts.parts]
    least += [] if parts is None else [n.p_family_wise for n in parts.neighbours if n.share >= LEAST_SHARE]
    least += [] if missing is None or missing.p_value is None else [missing.p_value]
    return not_narrowed(result) if min(least, default=1.0) < RESERVED else result
