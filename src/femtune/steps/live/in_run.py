"""The live model in `femtune run`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune.steps.live.record import LiveResults
from femtune.steps.live.region import Sampled
from femtune.steps.live.run import live_results
from femtune.steps.posterior.record import PosteriorResults
from femtune.steps.run.outcomes import Made, Outcomes, Updated

if TYPE_CHECKING:
    from femtune.steps.run.run import Run


def make_live(run: Run, outcomes: Outcomes, made: Made) -> LiveResults | None:
    """The live model at the end of the update; None where the study wants none."""
    updated = outcomes.of(Updated)
    study, posterior = updated.study(run.study), outcomes.find(PosteriorResults)
    sampled = None
    if posterior is not None:
        values = outcomes.arrays[posterior.samples_key]
        parameters = updated.parameters.result.parameters
        x = np.tile(updated.parameters.result.x, (len(values), 1))
        for name, column in zip(posterior.free, values.T):
            i = parameters.index(name)
            x[:, i] = (column - parameters.nominal[i]) / parameters.scale[i]
        sampled = Sampled(x, outcomes.arrays[posterior.weights_key])
    return live_results(study, updated.parameters, made.arrays, run.progress, sampled)
