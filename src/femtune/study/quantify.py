"""The step quantify: variability of the parameters from repeated tests."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.assembly.error_places import errors_at
from femtune.assembly.repeats import read_repeats
from femtune.errors import FemtuneError
from femtune.residuals import UpdateProblem
from femtune.results.quantify import QuantifiedOutput, QuantifiedParameter, QuantifyResults
from femtune.results.update import citations
from femtune.selection import cosine_distances
from femtune.uncertainty import (
    CloudRules,
    StochasticRules,
    forward_check,
    frequency_outputs,
    stochastic_update,
)

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.assembly.progress import Progress
    from femtune.assembly.repeats import Repeats
    from femtune.assembly.study import Study
    from femtune.files.study_file import QuantifyTable
    from femtune.selection import CosineDistances
    from femtune.uncertainty import (
        ForwardCheck,
        FrequencyOutputs,
        OutputStatistics,
        StochasticResult,
    )

Arrays = dict[str, NDArray]

_CLOUDS = ("cross-covariance", "output-difference")
_FEWEST = 4
_NO_REPEAT = "the repeats do not have it"


def repeats_of(study: Study) -> Repeats | None:
    """The repeats of the study; None without [quantify]. Errors as of `read_repeats`."""
    return None if study.file.quantify is None else read_repeats(study, study.file.quantify)


def quantify_at(study: Study, repeats: Repeats, x: Reals, arrays: Arrays, progress: Progress) -> QuantifyResults:
    """Mean and covariance of the free parameters from a normalised start x, with a forward check.

    Raises
    ------
    FemtuneError : ``quantify.*``, ``correlate.no-pairs``, and what an eigen-solution raises
    """
    table = study.file.quantify
    assert table is not None
    progress.step("mean and covariance of the parameters", 0, None)
    start = np.asarray(study.parameters.denormalise(x))
    with errors_at(study.file.where("quantify")), in_words_of_the_study(table):
        outputs = _outputs(study, repeats, start)
        found = _updated(study, table, outputs, repeats, start)
        progress.step(f"forward check with {table.samples} samples", 0, None)
        check = forward_check(outputs, found, table.samples, table.seed)
    return _record(study, table, repeats, found, check, arrays)


@contextmanager
def in_words_of_the_study(table: QuantifyTable) -> Iterator[None]:
    """What the user can do is a key of [quantify]."""
    try:
        yield
    except FemtuneError as error:
        if error.code in ("quantify.not-positive", "quantify.singular") and table.missing == "pairwise":
            error.hint = 'covariances that are estimated pair by pair need not be consistent; use missing = "em"'
        elif error.code.startswith("eigen.") and table.method in _CLOUDS:
            error.hint = 'the model cannot be solved for some of the samples; use method = "second-order"'
        raise


def _outputs(study: Study, repeats: Repeats, start: Reals) -> FrequencyOutputs:
    """Frequencies of the modes that the update may use, that are paired at the start and that the repeats have."""
    case = repeats.case.used or repeats.case.compared
    assert case is not None
    gone = {i: _NO_REPEAT for i in range(len(case.test)) if i not in repeats.measured}
    some = replace(case, left_out={**gone, **case.left_out}, fixed=tuple(p for p in case.fixed if p[0] not in gone))
    return frequency_outputs(UpdateProblem((some,), study.parameters), start)


def _updated(
    study: Study, table: QuantifyTable, outputs: FrequencyOutputs, repeats: Repeats, start: Reals
) -> StochasticResult:
    measured = repeats.statistics(outputs.modes, table.missing)
    names, sd = tuple(p.name for p in study.parameters.free), np.array([p.sd for p in study.parameters.free])
    rules = StochasticRules(
        table.method, table.weighting, table.regularisation, cloud=CloudRules(table.samples, table.seed)
    )
    if table.method not in _CLOUDS:
        return stochastic_update(outputs, measured, names, start, sd, rules)
    # a prior's width makes a cloud that says little: the cloud starts where (39) ends
    first = stochastic_update(outputs, measured, names, start, sd, replace(rules, method="perturbation"))
    if not first.sd.all():
        raise FemtuneError(
            "quantify.start-sd/updated", values={"parameters": ", ".join(n for n, s in zip(names, first.sd) if not s)}
        )
    found = stochastic_update(outputs, measured, names, first.mean, first.sd, rules)
    return replace(found, start=start, solutions=found.solutions + first.solutions)


def _record(
    study: Study, table: QuantifyTable, repeats: Repeats, found: StochasticResult, check: ForwardCheck, arrays: Arrays
) -> QuantifyResults:
    measured, status = found.measured, found.status
    keys = {name: f"quantify/{name}" for name in ("repeats", "covariance", "cloud", "parameter_covariance")}
    values = (measured.repeats, measured.covariance, check.z, found.covariance)
    arrays |= dict(zip(keys.values(), values))
    near = _distances(found)
    parameters = _parameters(study, found, near)
    return QuantifyResults(
        configuration=repeats.case.name,
        method=table.method,
        status=status.name,
        message=status.value,
        ok=status.ok,
        estimate=measured.estimate,
        repeats=len(measured.repeats),
        solutions=found.solutions,
        samples=table.samples,
        covariance_error_percent=100.0 * check.covariance_error,
        chance_error_percent=100.0 * check.chance_error,
        unexplained_percent=100.0 * found.unexplained,
        agrees=check.agrees,
        parameters=parameters,
        outputs=_output_records(check),
        sentences=(*check.sentences, *_remarks(found, parameters), *_of_distances(near)),
        repeats_key=keys["repeats"],
        covariance_key=keys["covariance"],
        cloud_key=keys["cloud"],
        parameter_covariance_key=keys["parameter_covariance"],
        citations=citations(found.citations),
    )


def _distances(found: StochasticResult) -> CosineDistances | None:
    return _from_covariance(found.measured, found.G, found.mean, found.names)


def _from_covariance(
    measured: OutputStatistics, G: Reals, theta: Reals, names: tuple[str, ...]
) -> CosineDistances | None:
    """Distances of the parameters from the covariance; None where there are too few frequencies to say anything."""
    if len(measured.mean) < _FEWEST or not G.any():
        return None
    return cosine_distances(measured.covariance, measured.mean, G, theta, names)


def distances_at(study: Study, x: Reals) -> CosineDistances | str:
    """Distances of the free parameters from the covariance of the repeats, at normalised parameters; or why not.

    Without [quantify] there are no repeats, which is for the caller to see. Nothing is updated.
    """
    table = study.file.quantify
    assert table is not None
    theta = np.asarray(study.parameters.denormalise(x))
    try:
        repeats = read_repeats(study, table)
        outputs = _outputs(study, repeats, theta)
        measured = repeats.statistics(outputs.modes, table.missing)
        G = outputs.linearised(theta)[1]
        near = _from_covariance(measured, G, theta, tuple(p.name for p in study.parameters.free))
    except FemtuneError as error:
        return f"The parameters were not compared with the covariance of the repeated tests: {error.what}."
    return near or (
        "The parameters were not compared with the covariance of the repeated tests: this requires "
        f"{_FEWEST} frequencies that depend on them; the repeats have {len(measured.mean)} compared frequencies."
    )


def _parameters(study: Study, found: StochasticResult, near: CosineDistances | None) -> tuple[QuantifiedParameter, ...]:
    return tuple(
        QuantifiedParameter(
            parameter=p.name,
            start=float(found.start[i]),
            mean=float(found.mean[i]),
            sd=float(found.sd[i]),
            correlation=tuple(float(c) for c in found.correlation[i]),
            cosine_distance=None if near is None or near.insensitive[i] else float(near.distance[i]),
            outside_bounds=not p.lower <= found.mean[i] <= p.upper,
        )
        for i, p in enumerate(study.parameters.free)
    )


def _of_distances(near: CosineDistances | None) -> list[str]:
    """The verdict of the distances where it is a clear one: those of few parameters seldom are."""
    return [near.sentences[0]] if near is not None and near.clear else []


def _output_records(check: ForwardCheck) -> tuple[QuantifiedOutput, ...]:
    measured = check.measured
    counts = np.isfinite(measured.repeats).sum(axis=0)
    return tuple(
        QuantifiedOutput(
            label=label.removeprefix("mode "),
            repeats=int(counts[i]),
            measured_mean_hz=float(measured.mean[i]),
            measured_sd_hz=float(measured.sd[i]),
            model_mean_hz=float(check.mean[i]),
            model_sd_hz=float(check.sd[i]),
        )
        for i, label in enumerate(measured.labels)
    )


def _sentence(words: str) -> str:
    return f"{words[:1].upper()}{words[1:]}."


def _remarks(found: StochasticResult, parameters: tuple[QuantifiedParameter, ...]) -> list[str]:
    out = [_sentence(found.status.value)] if found.status.name != "CONVERGED" else []
    if len(found.names) >= len(found.measured.mean):
        out.append(
            f"{len(found.names)} parameters can reproduce the covariance of {len(found.measured.mean)} frequencies "
            "even if other parameters vary. Use more frequencies than parameters."
        )
    outside = [p.parameter for p in parameters if p.outside_bounds]
    if outside:
        out.append(f"The mean of {', '.join(outside)} lies outside the bounds; this step does not enforce bounds.")
    return [*out, *(_sentence(n.what) for n in found.measured.notices)]
