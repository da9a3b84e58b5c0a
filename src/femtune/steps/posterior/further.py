"""What further tests would teach: configurations of the study that have no test yet.

The parameters are distributed as their samples x, and the model gives the frequencies f of such a configuration at
each. With the covariance C of y = log f over the samples, and errors of standard deviation σ, a test of all these
frequencies is expected to bring ½ log₂|I + C/σ²| bits, and leaves the parameters the variance Var(x) − cov(x, y)
(C + σ²I)⁻¹ cov(y, x), as if samples and frequencies were normal together.

Source: D. V. Lindley, On a measure of the information provided by an experiment, Annals of Mathematical Statistics 27,
1956.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import FemtuneError
from femtune.steps.posterior.problem import completed
from femtune.steps.posterior.record import FurtherParameter, FurtherTest
from femtune.study.executor import executor_of
from femtune.study.model_runs import FrequencyRuns, followed_modes, runs_at

if TYPE_CHECKING:
    from collections.abc import Iterator

    from femtune.arrays import Integers, Reals
    from femtune.parameters import ParameterSet
    from femtune.sampling import PosteriorSamples
    from femtune.study.cases import StudyCase
    from femtune.study.progress import Progress
    from femtune.study.study import Study

_SAMPLES = 200
"""Samples at which the frequencies are solved: a standard deviation is then known to a twentieth."""
MOST_DOFS = 20_000
"""Free DOFs up to which these solutions are made without being asked for: minutes."""
LEAST_SOLVED = 0.5
"""Part of the samples at which the model must have a solution."""
LEAST_MAC = 0.5
"""MAC with the shape at the result below which a mode is not followed: a test could not tell which one it is."""


def further_tests(
    study: Study, samples: PosteriorSamples, x: Reals, moving: Integers, sd: float, progress: Progress
) -> tuple[tuple[FurtherTest, ...], tuple[str, ...]]:
    """Each configuration without a test, the one that would tell most first; and those left out, in sentences.

    Parameters
    ----------
    x : (n,) normalised parameters at the result
    moving : positions of those that are sampled
    sd : standard deviation of the errors of a frequency, relative
    """
    every = [case for case in study.cases if case.entry.test is None]
    cases = [case for case in every if case.configured.n_free <= MOST_DOFS]
    large = [case.name for case in every if case not in cases]
    remarks = (
        f"What a test of {', '.join(large)} would teach was not computed: with more than {MOST_DOFS:,} free DOFs "
        f"{_SAMPLES} solutions take too long.",
    ) * bool(large)
    if not cases:
        return (), remarks
    rng = np.random.default_rng(0)
    chosen = rng.choice(len(samples.x), _SAMPLES, p=samples.weights.values)
    points = completed(x, samples.x[chosen], moving)
    values = np.asarray(study.parameters.denormalise(completed(x, samples.x, moving)))[:, moving]
    w = samples.weights.values
    now = np.sqrt(w @ (values - w @ values) ** 2)
    found = {case.name: _of(study, case, x, points, moving, sd, now, progress) for case in cases}
    failed = [f"{name} ({why})" for name, why in found.items() if isinstance(why, str)]
    if failed:
        remarks = (*remarks, f"What a further test would teach could not be computed: {'; '.join(failed)}.")
    return tuple(sorted((f for f in found.values() if not isinstance(f, str)), key=lambda f: -f.bits)), remarks


def _of(
    study: Study, case: StudyCase, x: Reals, points: Reals, moving: Integers, sd: float, now: Reals, progress: Progress
) -> FurtherTest | str:  # fmt: skip
    """Why not, where the model has no elastic modes, or cannot be solved at the samples."""
    try:
        followed = followed_modes(study, case, x)
    except FemtuneError as error:
        return error.what
    every, where = np.unique(points, axis=0, return_inverse=True)
    runs = runs_at(
        FrequencyRuns((followed,)), list(every), executor_of(study), progress, f"posterior: modes of {case.name}"
    )
    good = np.array([not run.problem for run in runs])[where]
    if good.mean() < LEAST_SOLVED:
        return f"the model could not be solved at {np.sum(~good)} of {_SAMPLES} samples"
    hz = np.array([run.values for run in runs])[where][good]
    kept = np.array([run.mac for run in runs])[where][good].min(axis=0) >= LEAST_MAC
    if not kept.any():
        return "no mode could be followed through the samples"
    y = np.log(hz[:, kept])
    y -= y.mean(axis=0)
    C = y.T @ y / len(y) + sd**2 * np.eye(y.shape[1])
    bits = 0.5 * (np.linalg.slogdet(C)[1] / np.log(2.0) - 2.0 * y.shape[1] * np.log2(sd))
    return FurtherTest(
        configuration=case.name, modes=tuple(followed.numbers[kept].tolist()), bits=max(float(bits), 0.0),
        parameters=tuple(_parameters(study.parameters, points[good], moving, now, y, C)),
    )  # fmt: skip


def _parameters(
    parameters: ParameterSet, x: Reals, moving: Integers, now: Reals, y: Reals, C: Reals
) -> Iterator[FurtherParameter]:
    values = np.asarray(parameters.denormalise(x))[:, moving]
    off = values - values.mean(axis=0)
    cross = off.T @ y / len(y)
    before = np.mean(off**2, axis=0)
    taught = np.einsum("ij,ij->i", cross, np.linalg.solve(C, cross.T).T)
    for i, j in enumerate(moving):
        left = np.sqrt(max(1.0 - taught[i] / before[i], 0.0)) if before[i] > 0.0 else 1.0
        yield FurtherParameter(
            parameter=parameters.free[j].name, sd=float(now[i]), sd_after=float(now[i] * left)
        )  # fmt: skip
