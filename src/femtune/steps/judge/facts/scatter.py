"""Frequency errors after the update beside the repeatability that the test or the study states."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from femtune.steps.correlate.criteria import criteria_profile
from femtune.steps.judge.record.scatter import FrequencyScatter
from femtune.validation.criteria import FREQUENCY

if TYPE_CHECKING:
    from femtune.steps.judge.finished_update import FinishedUpdate
    from femtune.study.cases import StudyCase


def frequency_scatter(fit: FinishedUpdate) -> FrequencyScatter | None:
    """Of the pairs of the update; None if the standard deviation of no frequency is stated.

    The standard deviation of a residual is no repeatability: it may stand for errors of the model too.
    """
    pairs = list(_pairs(fit))
    if not pairs:
        return None
    errors, sds = np.array(pairs).T
    limits = [c.limit for c in criteria_profile(fit.study).criteria if c.quantity == FREQUENCY]
    return FrequencyScatter(
        pairs=len(pairs),
        error_percent=float(np.sqrt(np.mean(errors**2))),
        test_percent=float(np.sqrt(np.mean(sds**2))),
        limit_percent=100.0 * max(limits) if limits else None,
    )


def _pairs(fit: FinishedUpdate) -> Iterable[tuple[float, float]]:
    """Frequency error and standard deviation of the test in %, of each pair with a known one."""
    stages = [c.stage for c in fit.results.correlations]
    last = {c.configuration: c for c in fit.results.correlations if c.stage == stages[-1]}
    for case in fit.study.cases:
        if case.used is None or case.modal is None or case.name not in last:
            continue
        sd = {label: _sd_percent(fit, case, i) for i, label in enumerate(case.modal.test.labels)}
        for pair in last[case.name].pairs:
            known = sd.get(pair.test_label)
            if known is not None:
                yield pair.freq_error_percent, known


def _sd_percent(fit: FinishedUpdate, case: StudyCase, i: int) -> float | None:
    stated = fit.study.file.validation.frequency_sd
    if stated is not None:
        return 100.0 * stated
    assert case.modal is not None
    known = case.modal.test.freq_sd_hz
    return None if known is None or not known[i] > 0.0 else float(100.0 * known[i] / case.modal.test.freq_hz[i])
