"""The step quantify: variability of the parameters from repeated tests."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.document.numbers import short
from femtune.errors import FemtuneError
from femtune.executor import Serial
from femtune.journal.finished import FinishedRuns
from femtune.journal.run_files import SAMPLES_FILE
from femtune.model import digest
from femtune.residuals import UpdateProblem
from femtune.selection import cosine_distances
from femtune.steps.quantify.parameter_intervals import parameter_intervals
from femtune.steps.quantify.population import population_of
from femtune.steps.quantify.record import (
    HELD_OUT,
    ORDER,
    OUTLIERS,
    QuantifiedEntry,
    QuantifiedOutput,
    QuantifiedParameter,
    QuantifyResults,
    RepeatCheck,
)
from femtune.steps.run_folder import unwritable
from femtune.steps.update.facts.update import citations
from femtune.study.error_places import errors_at
from femtune.study.executor import executor_of
from femtune.study.repeats import read_repeats
from femtune.uncertainty import (
    CloudRules,
    Fit,
    RobustMoments,
    ShapeOutputs,
    StochasticRules,
    check_held_out,
    check_repeats,
    forward_check,
    frequency_outputs,
    held_out_repeats,
    shape_outputs,
    statistics_of_repeats,
    stochastic_update,
)
from femtune.uncertainty.kinds import QUANTIFY_METHODS
from femtune.uncertainty.robust import LEVEL

if TYPE_CHECKING:
    from pathlib import Path

    from femtune.arrays import Reals
    from femtune.files.study_file import QuantifyTable
    from femtune.residuals import Evaluation
    from femtune.selection import CosineDistances
    from femtune.study.progress import Progress
    from femtune.study.repeats import Repeats
    from femtune.study.study import Study
    from femtune.uncertainty import (
        ForwardCheck,
        FrequencyOutputs,
        HeldOutCheck,
        OutputStatistics,
        RepeatChecks,
        StochasticResult,
    )
    from femtune.uncertainty.outputs import Counted

Arrays = dict[str, NDArray]


_LEAST_FREQUENCIES = 4
"""Frequencies from which cosine distances are computed: with fewer, directions are close to each other by chance."""
_NO_VARIABILITY = 1e-6
"""Standard deviation of a parameter, relative to the initial one, up to which it is zero.

What the iteration leaves of it.
"""
_LEAST_SHAPE_SD = 1e-6
"""Standard deviation of an entry of a shape up to which it is rounding, as at nodes of the shape."""
_NO_REPEAT = "the repeats do not have it"
_NO_OUTLIERS = {
    "few": "this test needs at least four more repeats without missing values than frequencies",
    "flat": "three quarters of the repeats have a singular covariance; the values may be rounded too much",
}


def repeats_of(study: Study) -> Repeats | None:
    """The repeats of the study; None without [quantify]. Errors as of `read_repeats`."""
    return None if study.file.quantify is None else read_repeats(study, study.file.quantify)


@dataclass(frozen=True, eq=False)
class _Prepared:
    """The outputs at a start, the rows (n, m) of all repeats, those held out, and the statistics of the others."""

    frequencies: FrequencyOutputs
    outputs: FrequencyOutputs | ShapeOutputs
    rows: Reals
    held: NDArray[np.bool_]
    measured: OutputStatistics


def check_quantify(study: Study, repeats: Repeats, x: Reals) -> None:
    """Check, before the update, that the repeats give a mean and a covariance of the compared outputs.

    Raises
    ------
    FemtuneError : ``quantify.*``; what else fails at this start may not fail at that of the step
    """
    table = study.file.quantify
    assert table is not None
    try:
        with errors_at(study.file.where("quantify")), in_words_of_the_study(table):
            _prepared(study, table, repeats, np.asarray(study.parameters.denormalise(x)))
    except FemtuneError as error:
        if error.code.startswith("quantify."):
            raise


def _prepared(study: Study, table: QuantifyTable, repeats: Repeats, start: Reals) -> _Prepared:
    if table.population and table.noise_sd is None:
        raise FemtuneError("quantify.population/noise")
    held = _held(table, len(repeats.hz))
    outputs = _outputs(study, repeats, start)
    used, rows = _compared_outputs(table, repeats, outputs, start)
    return _Prepared(outputs, used, rows, held, _with_noise(_statistics(rows[~held], used, table), used, table))


def _compared_outputs(
    table: QuantifyTable, repeats: Repeats, outputs: FrequencyOutputs, start: Reals
) -> tuple[FrequencyOutputs | ShapeOutputs, Reals]:
    """Frequencies, with the shapes if the study compares them, and their rows (n, m) of all repeats."""
    rows = repeats.of_modes(outputs.modes)
    if not table.shapes:
        return outputs, rows
    whole = shape_outputs(outputs.problem, start)
    entries = _shapes_of(repeats, whole)
    # entries at nodes of a shape and out of its plane are rounding errors
    kept = np.flatnonzero(np.nan_to_num(np.nanstd(entries, axis=0)) > _LEAST_SHAPE_SD)
    return replace(whole, kept=tuple(int(i) for i in kept)), np.hstack([rows, entries[:, kept]])


def quantify_at(
    study: Study, repeats: Repeats, x: Reals, arrays: Arrays, progress: Progress, folder: Path | None = None
) -> QuantifyResults:
    """Mean and covariance of the free parameters from a normalised start x, with a forward check.

    Parameters
    ----------
    folder : run folder, which keeps the samples that other processes solve; None where nothing is written

    Raises
    ------
    FemtuneError : ``quantify.*``, ``run.unwritable``, ``correlate.no-pairs``, and what an eigen-solution raises
    """
    table = study.file.quantify
    assert table is not None
    progress.step("mean and covariance of the parameters", 0, None)
    start = np.asarray(study.parameters.denormalise(x))
    with errors_at(study.file.where("quantify")), in_words_of_the_study(table):
        data = _prepared(study, table, repeats, start)
        outputs, used, rows, held = data.frequencies, data.outputs, data.rows, data.held
        updated = _updated(study, table, used, data.measured, start)
        progress.step(f"forward check with {table.samples} samples", 0, None)
        samples = _Samples(study, updated, data.frequencies.paired, folder)
        check = forward_check(used, updated, table.samples, table.seed, samples.solve)
        intervals = (
            parameter_intervals(outputs, updated, rows[~held, : len(outputs.modes)]) if table.intervals else None
        )
        tested = _tested(rows, len(outputs.modes), held, check, updated)
        population = None
        if table.population:
            population = population_of(used, updated, rows[~held], study.parameters, table.seed, arrays, progress)
    record = _record(study, table, repeats, check, tested, arrays)
    return record.model_copy(update={"intervals": intervals, "population": population})


@dataclass(frozen=True, eq=False)
class _Samples:
    """The samples of the forward check; those of other processes are on disk as soon as they have ended.

    The journal has the solutions of this process only.
    """

    study: Study
    found: StochasticResult
    paired: Evaluation
    folder: Path | None

    def solve(self, outputs: Counted, theta: Reals) -> Reals:
        """(n, m) outputs of samples (n, k) (errors ``executor.*``, ``quantify.not-finite``, ``run.unwritable``)."""
        executor = executor_of(self.study, reduced=True)
        if self.folder is None or isinstance(executor, Serial):
            return outputs.at_points(theta, executor)
        folder, at, measured = self.folder, self.paired, self.found.measured
        key = digest(theta, *measured.labels, self.found.G, at.x, at.residuals, at.jacobian)
        file = FinishedRuns(folder / SAMPLES_FILE, key)

        def keep(number: int, z: Reals) -> None:
            if np.isfinite(z).all():
                try:
                    file.add({"sample": number, "outputs": z.tolist()})
                except OSError as error:
                    raise unwritable(folder, error) from error

        try:
            known = _known(file.begin(self.study.file.study.journal), len(theta), len(measured.mean))
        except OSError as error:
            raise unwritable(folder, error) from error
        return outputs.at_points(theta, executor, known, keep)


def _known(lines: Sequence[Mapping[str, Any]], count: int, size: int) -> dict[int, Reals]:
    """Outputs by the number of the sample; what cannot be read is solved again."""
    samples = {}
    for line in lines:
        try:
            z, number = np.array(line["outputs"], float), int(line["sample"])
        except (ValueError, KeyError, TypeError):
            continue
        if z.shape == (size,) and np.isfinite(z).all() and 0 <= number < count:
            samples[number] = z
    return samples


def _shapes_of(repeats: Repeats, outputs: ShapeOutputs) -> Reals:
    """(n, entries) shapes of the repeats, scaled as those of the outputs."""
    assert repeats.shapes is not None
    labels = repeats.case.compared.test.labels if repeats.case.compared is not None else ()
    at = [(mode, labels.index(mode)) for mode in outputs.frequencies.modes]
    return np.array([np.concatenate([outputs.scaled(m, row[i]) for m, i in at]) for row in repeats.shapes])


def _statistics(rows: Reals, outputs: FrequencyOutputs | ShapeOutputs, table: QuantifyTable) -> OutputStatistics:
    """Statistics of the repeats of the fit; entries of shapes are relative to their unit norm."""
    statistics = statistics_of_repeats(rows, outputs.labels, table.missing, table.covariance, checked=False)
    if not isinstance(outputs, ShapeOutputs):
        return statistics
    count = len(outputs.frequencies.modes)
    return replace(statistics, scale=np.where(np.arange(len(statistics.mean)) < count, np.abs(statistics.mean), 1.0))


def _with_noise(
    measured: OutputStatistics, outputs: FrequencyOutputs | ShapeOutputs, table: QuantifyTable
) -> OutputStatistics:
    """The statistics with the measurement errors of a repeat that the study states, or that its test has."""
    asked = table.noise_sd
    if asked is None:
        return measured
    frequencies = outputs.frequencies if isinstance(outputs, ShapeOutputs) else outputs
    modes = frequencies.modes
    if isinstance(asked, dict) and (unknown := [m for m in modes if m not in asked]):
        raise FemtuneError("quantify.noise", values={"compared modes": ", ".join(modes)}, mode=unknown[0])
    noise = np.zeros((len(measured.mean), len(measured.mean)))
    rows = np.arange(len(modes))
    if asked == "test":
        sd = frequencies.test_sd_hz
        if (gone := np.flatnonzero(~np.isfinite(sd))).size:
            raise FemtuneError("quantify.noise/test", quantity="frequency", mode=modes[int(gone[0])])
        if isinstance(outputs, ShapeOutputs):
            noise[len(modes) :, len(modes) :] = outputs.test_covariance
            if (gone := np.flatnonzero(~np.isfinite(np.diag(noise)))).size:
                raise FemtuneError("quantify.noise/test", quantity="shape", mode=outputs.labels[int(gone[0])])
    else:
        shares = np.array([asked[m] if isinstance(asked, dict) else asked for m in modes])
        sd = shares * measured.mean[: len(modes)]
    noise[rows, rows] = sd**2
    return replace(measured, noise=noise)


@dataclass(frozen=True)
class _Tested:
    """All repeats (n, m), which of them the update did not use, and what was tested.

    The first `frequencies` columns are in Hz, the others entries of shapes.

    `prediction` is None if there are too few held-out repeats.
    """

    rows: Reals
    frequencies: int
    held: NDArray[np.bool_]
    checks: RepeatChecks
    prediction: HeldOutCheck | None
    found: StochasticResult


def _held(table: QuantifyTable, count: int) -> NDArray[np.bool_]:
    """(n,) True for the repeats that the update does not use."""
    if table.hold_out is None:
        return np.zeros(count, dtype=bool)
    return held_out_repeats(count, table.hold_out, table.seed)


def _tested(
    rows: Reals, frequencies: int, held: NDArray[np.bool_], check: ForwardCheck, result: StochasticResult
) -> _Tested:
    measured = result.measured
    fit = Fit(
        len(measured.repeats), check.mean, check.covariance, result.G @ result.T,
        np.zeros_like(measured.covariance) if measured.noise is None else measured.noise,
        np.arange(len(measured.mean)) < frequencies,
    )  # fmt: skip
    prediction = check_held_out(rows[held], fit) if held.any() else None
    checks = check_repeats(rows[:, :frequencies], measured.labels[:frequencies])
    return _Tested(rows, frequencies, held, checks, prediction, result)


@contextmanager
def in_words_of_the_study(table: QuantifyTable) -> Iterator[None]:
    """What the user can do is a key of [quantify]."""
    try:
        yield
    except FemtuneError as error:
        if error.code in ("quantify.not-positive", "quantify.singular") and table.missing == "pairwise":
            error.hint = 'covariances that are estimated pair by pair need not be consistent; use missing = "em"'
        elif error.code.startswith("eigen.") and QUANTIFY_METHODS[table.method].samples:
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
    study: Study,
    table: QuantifyTable,
    outputs: FrequencyOutputs | ShapeOutputs,
    measured: OutputStatistics,
    start: Reals,
) -> StochasticResult:
    names, sd = tuple(p.name for p in study.parameters.free), np.array([p.sd for p in study.parameters.free])
    rules = StochasticRules(
        table.method, table.weighting, table.regularisation, cloud=CloudRules(table.samples, table.seed)
    )
    if not QUANTIFY_METHODS[table.method].samples:
        return stochastic_update(outputs, measured, names, start, sd, rules)
    # a prior's width makes a cloud that says little: the cloud starts where (39) ends
    first = stochastic_update(outputs, measured, names, start, sd, replace(rules, method="perturbation"))
    if not first.sd.all():
        raise FemtuneError(
            "quantify.start-sd/updated", values={"parameters": ", ".join(n for n, s in zip(names, first.sd) if not s)}
        )
    updated = stochastic_update(outputs, measured, names, first.mean, first.sd, rules)
    return replace(updated, start=start, solutions=updated.solutions + first.solutions)


def _record(
    study: Study, table: QuantifyTable, repeats: Repeats, check: ForwardCheck, tested: _Tested, arrays: Arrays
) -> QuantifyResults:
    updated = tested.found
    measured, status = updated.measured, updated.status
    keys = {name: f"quantify/{name}" for name in ("repeats", "covariance", "cloud", "parameter_covariance")}
    frequencies = tested.frequencies
    cloud = check.with_noise(table.seed)[:, :frequencies]
    values = (
        measured.repeats[:, :frequencies],
        measured.covariance[:frequencies, :frequencies],
        cloud,
        updated.covariance,
    )
    arrays |= dict(zip(keys.values(), values))
    near = _distances(updated)
    parameters = _parameters(study, updated, near)
    return QuantifyResults(
        configuration=repeats.case.name,
        method=table.method,
        status=status.name,
        message=status.value,
        ok=status.ok,
        estimate=measured.estimate,
        repeats=len(measured.repeats),
        solutions=updated.solutions,
        samples=table.samples,
        covariance_error_percent=100.0 * check.covariance_error,
        chance_error_percent=100.0 * check.chance_error,
        unexplained_percent=100.0 * updated.unexplained,
        agrees=check.agrees,
        parameters=parameters,
        outputs=_output_records(check, tested.checks),
        entries=_entry_records(check, frequencies),
        output_covariance_key=_keep_covariance(measured, frequencies, arrays),
        sentences=(*check.sentences, *_remarks(updated, parameters), *_of_distances(near)),
        checks=_check_records(tested),
        noise_percent=_noise_percent(measured),
        outliers=tested.checks.outliers,
        held_out=tuple(int(i) + 1 for i in np.flatnonzero(tested.held)),
        robust_distance_key=_keep_distances(tested, arrays),
        repeats_key=keys["repeats"],
        covariance_key=keys["covariance"],
        cloud_key=keys["cloud"],
        parameter_covariance_key=keys["parameter_covariance"],
        citations=citations(updated.citations),
    )


def _distances(result: StochasticResult) -> CosineDistances | None:
    return _from_covariance(result.measured, result.G, result.mean, result.names)


def _from_covariance(
    measured: OutputStatistics, G: Reals, theta: Reals, names: tuple[str, ...]
) -> CosineDistances | None:
    """Distances of the parameters from the covariance; None where there are too few frequencies to say anything."""
    if len(measured.mean) < _LEAST_FREQUENCIES or not G.any():
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
        outputs, rows = _compared_outputs(table, repeats, _outputs(study, repeats, theta), theta)
        measured = _statistics(rows, outputs, table)
        G = outputs.linearised(theta)[1]
        near = _from_covariance(measured, G, theta, tuple(p.name for p in study.parameters.free))
    except FemtuneError as error:
        return f"The parameters were not compared with the covariance of the repeated tests: {error.what}."
    return near or (
        "The parameters were not compared with the covariance of the repeated tests: this requires "
        f"{_LEAST_FREQUENCIES} frequencies that depend on them; the repeats have {len(measured.mean)} compared "
        "frequencies."
    )


def _parameters(
    study: Study, result: StochasticResult, near: CosineDistances | None
) -> tuple[QuantifiedParameter, ...]:
    return tuple(
        QuantifiedParameter(
            parameter=p.name,
            start=float(result.start[i]),
            mean=float(result.mean[i]),
            sd=float(result.sd[i]),
            correlation=tuple(float(c) for c in result.correlation[i]),
            cosine_distance=None if near is None or near.insensitive[i] else float(near.distance[i]),
            outside_bounds=not p.lower <= result.mean[i] <= p.upper,
        )
        for i, p in enumerate(study.parameters.free)
    )


def _of_distances(near: CosineDistances | None) -> list[str]:
    """The verdict of the distances where it is a clear one: those of few parameters seldom are."""
    return [near.sentences[0]] if near is not None and near.clear else []


def _noise_percent(measured: OutputStatistics) -> float | None:
    """Share of the measured variance, outputs in units of their standard deviations."""
    if measured.noise is None:
        return None
    return 100.0 * float(np.mean(np.diag(measured.noise) / np.diag(measured.covariance)))


def _keep_distances(tested: _Tested, arrays: Arrays) -> str | None:
    """Key of the robust distances of all repeats, which are put into `arrays`."""
    robust = tested.checks.robust
    if isinstance(robust, str):
        return None
    key = "quantify/robust_distance"
    arrays[key] = np.full(len(tested.rows), np.nan)
    arrays[key][tested.checks.whole] = robust.distance
    return key


def _keep_covariance(measured: OutputStatistics, frequencies: int, arrays: Arrays) -> str | None:
    """Key of the covariance of frequencies and shapes, which is put into `arrays`; None without shapes."""
    if len(measured.mean) == frequencies:
        return None
    arrays["quantify/output_covariance"] = measured.covariance
    return "quantify/output_covariance"


def _entry_records(check: ForwardCheck, first: int) -> tuple[QuantifiedEntry, ...]:
    measured = check.measured
    return tuple(
        QuantifiedEntry(
            label=measured.labels[i],
            repeats=int(np.isfinite(measured.repeats[:, i]).sum()),
            measured_mean=float(measured.mean[i]),
            measured_sd=float(measured.sd[i]),
            model_mean=float(check.mean[i]),
            model_sd=float(check.sd[i]),
        )
        for i in range(first, len(measured.mean))
    )


def _check_records(tested: _Tested) -> tuple[RepeatCheck, ...]:
    return (_of_order(tested.checks), _of_outliers(tested.checks), _of_prediction(tested))


def _untested(check: str, why: str) -> RepeatCheck:
    return RepeatCheck(check=check, p_value=None, limit=LEVEL, verdict="not tested", sentence=_sentence(why))


def _of_order(checks: RepeatChecks) -> RepeatCheck:
    order = checks.order
    if order is None:
        return _untested(ORDER, "a test of the order needs at least eight repeats")
    p_values = ", ".join(f"{kind} {p:.2g}" for kind, p in order.p_values.items())
    said = checks.of_order()[0].what if order.kind else "No dependence on the order of the tests was found"
    return RepeatCheck(
        check=ORDER, p_value=order.p_value, limit=LEVEL, verdict="fail" if order.kind else "pass",
        sentence=_sentence(f"{said.rstrip('.')}. p-values of three tests: {p_values}"),
    )  # fmt: skip


def _of_outliers(checks: RepeatChecks) -> RepeatCheck:
    robust = checks.robust
    if not isinstance(robust, RobustMoments):
        return _untested(OUTLIERS, _NO_OUTLIERS[robust])
    outliers = checks.of_outliers()
    said = outliers[0].what if outliers else (
        f"No repeat is an outlier (largest robust distance {robust.distance.max():.3g}, limit {robust.limit:.3g})"
    )  # fmt: skip
    return RepeatCheck(
        check=OUTLIERS, p_value=robust.p_value, limit=LEVEL, verdict="fail" if outliers else "pass",
        sentence=_sentence(said),
    )  # fmt: skip


def _of_prediction(tested: _Tested) -> RepeatCheck:
    held, prediction = int(tested.held.sum()), tested.prediction
    if not held:
        return _untested(HELD_OUT, "all repeats were used by the update; hold_out keeps some of them for this test")
    if prediction is None:
        return _untested(
            HELD_OUT,
            "this test needs at least five held-out repeats without missing values, and frequencies that vary in the "
            "predicted distribution",
        )
    worst = int(np.nanargmax(np.abs(prediction.mean_difference)))
    widest = int(np.nanargmax(np.abs(np.log(np.maximum(prediction.sd_ratio, 1e-12)))))
    labels = tested.found.measured.labels
    still = ", ".join(labels[i] for i in np.flatnonzero(prediction.silent))
    rest = f" Not compared, because the parameters do not change them: {still}." if still else ""
    p_values = ", ".join(f"{part} {p:.2g}" for part, p in prediction.p_values.items())
    outcome = "agree with" if prediction.agrees else "differ from"
    return RepeatCheck(
        check=HELD_OUT, p_value=prediction.p_value, limit=LEVEL, verdict="pass" if prediction.agrees else "fail",
        sentence=(
            f"The {prediction.repeats} repeats that were held out {outcome} the predicted distribution (p-values: "
            f"{p_values}). Largest difference of the means: {labels[worst]}, "
            f"{prediction.mean_difference[worst]:+.2g} predicted standard deviations. "
            f"Largest difference of the standard deviations: {labels[widest]}, "
            f"{100 * prediction.sd_ratio[widest] - 100:+.0f} %.{rest}"
        ),
    )  # fmt: skip


def _output_records(check: ForwardCheck, checks: RepeatChecks) -> tuple[QuantifiedOutput, ...]:
    measured, robust, order = check.measured, checks.robust, checks.order
    robust_sd = np.sqrt(np.diag(robust.covariance)) if isinstance(robust, RobustMoments) else None
    change = order.change if order is not None and order.kind in ("drift", "jump") else None
    counts = np.isfinite(measured.repeats).sum(axis=0)
    return tuple(
        QuantifiedOutput(
            label=label.removeprefix("mode "),
            repeats=int(counts[i]),
            measured_mean_hz=float(measured.mean[i]),
            measured_sd_hz=float(measured.sd[i]),
            model_mean_hz=float(check.mean[i]),
            model_sd_hz=float(check.sd[i]),
            robust_sd_hz=None if robust_sd is None else float(robust_sd[i]),
            noise_sd_hz=None if measured.noise is None else float(np.sqrt(measured.noise[i, i])),
            change_hz=None if change is None else float(change[i]),
        )
        for i, label in enumerate(measured.labels[: len(checks.labels)])
    )


def _sentence(words: str) -> str:
    return f"{words[:1].upper()}{words[1:]}."


def _of_noise(result: StochasticResult) -> list[str]:
    """What of the measured variance the stated measurement errors are, and where they are all of it."""
    percent = _noise_percent(result.measured)
    if percent is None:
        return []
    out = [f"Measurement errors are {short(percent)} % of the measured variance, and were subtracted."]
    none = [n for n, sd, unit in zip(result.names, result.sd, result.start_sd) if sd <= _NO_VARIABILITY * unit]
    larger = np.flatnonzero(np.diag(result.measured.structural) <= 0.0)
    if larger.size:
        which = ", ".join(result.measured.labels[i] for i in larger)
        out.append(f"The stated measurement errors are larger than the measured standard deviations of {which}.")
    if none:
        out.append(f"The stated measurement errors explain all variability of {', '.join(none)}.")
    return out


def _remarks(result: StochasticResult, parameters: tuple[QuantifiedParameter, ...]) -> list[str]:
    out = [_sentence(result.status.value)] if result.status.name != "CONVERGED" else []
    out += _of_noise(result)
    if len(result.names) >= len(result.measured.mean):
        out.append(
            f"{len(result.names)} parameters can reproduce the covariance of {len(result.measured.mean)} frequencies "
            "even if other parameters vary. Use more frequencies than parameters."
        )
    outside = [p.parameter for p in parameters if p.outside_bounds]
    if outside:
        out.append(f"The mean of {', '.join(outside)} lies outside the bounds; this step does not enforce bounds.")
    return [*out, *(_sentence(n.what) for n in result.measured.notices)]
