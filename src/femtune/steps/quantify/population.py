"""The population of [quantify] with its uncertainty: samples as a record."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from femtune.document.numbers import short
from femtune.steps.quantify.record import PopulationCorrelation, PopulationParameter, PopulationResults
from femtune.uncertainty import MIXED_POPULATION, PopulationRules, QuadraticModel, sample_population, second_derivatives
from femtune.uncertainty.outputs import Counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from femtune.arrays import Reals
    from femtune.parameters import ParameterSet
    from femtune.study.progress import Progress
    from femtune.uncertainty import PopulationSamples, StochasticResult
    from femtune.uncertainty.outputs import Outputs

_STEP = 1e-3
"""Step of the differences of slopes, relative to half of the width between the bounds."""
_ENDS = (0.025, 0.5, 0.975)
_CHANCE = 0.01
"""Probability of a sum of squares above which structures that fit are said not to."""
_WIDE = 0.5
"""Upper over lower end of the interval of a standard deviation, as its logarithm, from which it is called vague."""


def population_of(
    outputs: Outputs, updated: StochasticResult, rows: Reals, parameters: ParameterSet, seed: int,
    arrays: dict[str, NDArray], progress: Progress,
) -> PopulationResults:  # fmt: skip
    """Samples of the population of repeats (p, m), with the quadratic model about the updated means.

    Raises
    ------
    FemtuneError : ``quantify.population``
    """
    free = parameters.free
    scale = 0.5 * np.array([p.upper - p.lower for p in free])
    model = QuadraticModel(updated.mean, *second_derivatives(Counted(outputs), updated.mean, _STEP * scale))
    noise = updated.measured.noise
    assert noise is not None

    def tell(done: int, of: int) -> None:
        progress.step("samples of the population", done, of)

    found = sample_population(rows, noise, model, scale, PopulationRules(seed=seed), tell)
    names = tuple(p.name for p in free)
    keys = {name: f"quantify/population/{name}" for name in ("individual", "samples")}
    arrays[keys["individual"]] = np.stack([np.median(found.individual, axis=0), found.individual.std(axis=0)])
    arrays[keys["samples"]] = np.stack([found.mean, found.sd, found.new])
    records = tuple(_parameters(names, found))
    return PopulationResults(
        parameters=records, correlations=tuple(_correlations(names, found)), repeats=len(rows), r_hat=found.r_hat,
        misfit=found.misfit, degrees=found.degrees,
        ok=found.r_hat <= MIXED_POPULATION and not _misfits(found), sentences=tuple(_sentences(records, found)),
        individual_key=keys["individual"], samples_key=keys["samples"],
    )  # fmt: skip


def _parameters(names: tuple[str, ...], found: PopulationSamples) -> Iterator[PopulationParameter]:
    for i, name in enumerate(names):
        mean, sd, new = (np.quantile(v[:, i], _ENDS).tolist() for v in (found.mean, found.sd, found.new))
        yield PopulationParameter(
            parameter=name, mean=mean[1], mean_interval_95=(mean[0], mean[2]), sd=sd[1],
            sd_interval_95=(sd[0], sd[2]), new_interval_95=(new[0], new[2]),
        )  # fmt: skip


def _correlations(names: tuple[str, ...], found: PopulationSamples) -> Iterator[PopulationCorrelation]:
    for i, j in combinations(range(len(names)), 2):
        low, middle, high = np.quantile(found.correlation[:, i, j], _ENDS).tolist()
        yield PopulationCorrelation(first=names[i], second=names[j], correlation=middle, interval_95=(low, high))


def _sentences(records: tuple[PopulationParameter, ...], found: PopulationSamples) -> Iterator[str]:
    vague = [p.parameter for p in records if np.log(p.sd_interval_95[1] / p.sd_interval_95[0]) > 2.0 * _WIDE]
    for p in records[:3]:
        yield (
            f"Standard deviation of {p.parameter} over the population: {p.sd:.3g} ({p.sd_interval_95[0]:.3g} to "
            f"{p.sd_interval_95[1]:.3g}); a further structure has {p.new_interval_95[0]:.4g} to "
            f"{p.new_interval_95[1]:.4g}."
        )
    if vague:
        yield (
            f"The repeats hardly tell the standard deviation of {', '.join(vague)}: the ends of its interval are more "
            f"than a factor of {np.exp(2.0 * _WIDE):.1f} apart. Measurement errors, or few repeats, leave it open."
        )
    if found.r_hat > MIXED_POPULATION:
        yield f"The chains did not settle (R-hat {found.r_hat:.2f}): no interval of the population is reliable."
    if _misfits(found):
        yield (
            f"The structures do not fit within the stated measurement errors (sum of squares {short(found.misfit)}, "
            f"about {short(found.degrees)} expected): other parameters vary, or noise_sd is too small. The intervals "
            "of the population do not hold."
        )


def _misfits(found: PopulationSamples) -> bool:
    return found.degrees > 0.0 and found.misfit > float(chdtri(found.degrees, _CHANCE))
