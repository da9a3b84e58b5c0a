"""The end of an update in the runs of its model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune.steps.judge.record.coverage import CoverageResults, OutsideRuns

if TYPE_CHECKING:
    from femtune.steps.judge.finished_update import FinishedUpdate


def runs_coverage(fit: FinishedUpdate) -> CoverageResults | None:
    """Range of the runs, and deviation of their surrogates, at the end; None for other models.

    Runs of a solver are made where the update needs them, so that their range follows the update.
    """
    study, runs = fit.study, fit.study.file.runs
    if runs is None or not study.built.coverage:
        return None
    values = {ref.name: value for ref, value in study.model.field_values(fit.result.x).items()}
    outside, deviations = dict[str, OutsideRuns](), list[np.ndarray]()
    for part in study.built.coverage:
        for name, low, high in part.outside(values):
            outside[name] = OutsideRuns(parameter=name, value=values[name], low=low, high=high)
        deviation = part.frequency_sd(values)
        # beyond the modes are directions that are no modes
        known = None if deviation is None else deviation[: study.built.mode_count]
        deviations += [] if known is None or np.isnan(known).all() else [known]
    sd, mode = max(((float(np.nanmax(d)), int(np.nanargmax(d)) + 1) for d in deviations), default=(None, None))
    percent = None if sd is None else 100.0 * sd
    return CoverageResults(
        outside=tuple(outside.values()), frequency_sd_percent=percent, mode=mode, limit_percent=100.0 * runs.tolerance
    )
