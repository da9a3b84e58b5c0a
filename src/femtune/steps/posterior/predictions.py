"""What the model predicts over the samples: natural frequencies of all configurations, and FRFs.

A sample of the parameters x is predicted with a draw of the unknown changes q of the model from their distribution
there, given the data; changes that the data do not see have the standard deviation of their class. The full model is
solved at (x, q), not linearised.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune.errors import FemtuneError
from femtune.journal.finished import FinishedRuns
from femtune.journal.run_files import PREDICTIONS_FILE
from femtune.judge.widened import widened
from femtune.model import configure, digest, matrices_digest
from femtune.model.full_model import direct
from femtune.model.response import frf_with_error
from femtune.steps.correlate.facts import correlate_case
from femtune.steps.posterior.kept import KeptSolutions
from femtune.steps.posterior.model_errors import SUPPORTS
from femtune.steps.posterior.problem import completed
from femtune.steps.posterior.record import PosteriorFrequency, PosteriorFunctions
from femtune.steps.validate.facts import scatter_of_test
from femtune.study.model_runs import followed_from
from femtune.study.response import response_request
from femtune.study.solved import solve

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from femtune.arrays import Integers, Reals
    from femtune.executor import Executor
    from femtune.files.study_file import PosteriorTable
    from femtune.model import ConfiguredModel, EigenSolution
    from femtune.model.digests import Part
    from femtune.sampling import Likelihood, PosteriorSamples
    from femtune.steps.posterior.model_errors import ModelErrors, UnknownChanges
    from femtune.study.cases import StudyCase
    from femtune.study.model_runs import FollowedModes
    from femtune.study.progress import Progress
    from femtune.study.response import ResponseRequest
    from femtune.study.study import Study

MOST_DOFS = 20_000
"""Free DOFs up to which these solutions are made without being asked for: minutes."""
_LEAST_MAC = 0.5
"""MAC with the shape at the result below which a mode is not followed."""
_MOST_LOST = 0.05
"""Part of the samples at which a mode may not be followed: with more the ends of its interval are not known."""
_LEAST_SOLVED = 0.5
"""Part of the samples at which the model must have a solution."""
MOST_VALUES = 100_000
"""Values of the FRFs of a configuration at a sample: 80 MB for 200 samples in single precision."""
_LEAST_COMMON = 0.5
"""Part of the lines that the test has too, below which measured values are not counted."""
_SAME_LINE = 1e-6
"""Relative distance of two lines that are one but for the rounding of a file."""
_ENDS = np.array([0.025, 0.5, 0.975])


@dataclass(frozen=True, eq=False)
class SampledPredictions:
    """Records of what the model predicts, the number of samples and of those without a solution, and remarks."""

    frequencies: tuple[PosteriorFrequency, ...] = ()
    functions: tuple[PosteriorFunctions, ...] = ()
    asked: int = 0
    failed: int = 0
    remarks: tuple[str, ...] = ()


# ----------------------------------------------------------------------------------------------------
# The model at a draw.


@dataclass(frozen=True, eq=False)
class _Functions:
    """FRFs that are predicted: the request without its study."""

    request: ResponseRequest

    def __getstate__(self) -> dict[str, Any]:
        return {"request": replace(self.request, case=None, measured=None)}  # type: ignore[arg-type]

    def sizes(self, configured: ConfiguredModel, x: Reals, solution: EigenSolution) -> Reals:
        """|H| (outputs, inputs, lines)."""
        r, (count, _) = self.request, self.request.modes
        if not r.needs_modes:
            model: Any = configured.at(x)
        else:
            model = solution if count is None else direct.modes(configured.at(x), count, None)
        solved = frf_with_error(
            model, r.ports, r.freq_hz, r.table.kind, r.method, damping=r.damping,
            residual_vectors=r.table.residual_vectors, add_vectors=not r.limit,
        )  # fmt: skip
        return np.abs(solved.frfs.values)


@dataclass(frozen=True, eq=False)
class _Predicted:
    """What is predicted of a configuration."""

    followed: FollowedModes
    functions: _Functions | None

    @property
    def of_functions(self) -> tuple[Part, ...]:
        """What |H| depends on beside the matrices."""
        if self.functions is None:
            return ()
        r = self.functions.request
        return (r.ports.inputs, r.ports.outputs, r.freq_hz, r.table.model_dump_json())

    def at(self, x: Reals) -> tuple[Reals, Reals, Reals]:
        """Frequencies, MAC with the shapes at the result, and |H|."""
        top = None if self.functions is None else self.functions.request.modes[1]
        solution = self.followed.solver.modes(self.followed.configured.at(x), self.followed.count, top)
        hz, mac = self.followed.among(solution)
        if self.functions is None:
            return hz, mac, np.zeros(0)
        return hz, mac, self.functions.sizes(self.followed.configured, x, solution).ravel()


@dataclass(frozen=True, eq=False)
class _Solved:
    """The model at a draw: frequencies and MAC (m,), |H| in single precision, and why there are none."""

    hz: Reals
    mac: Reals
    sizes: NDArray[np.float32]
    problem: str = ""


@dataclass(frozen=True, eq=False)
class _Model:
    """All configurations at a draw."""

    predicted: tuple[_Predicted, ...]

    def __call__(self, x: Reals) -> _Solved:
        try:
            parts = [p.at(x) for p in self.predicted]
        except FemtuneError as error:
            return _Solved(np.zeros(0), np.zeros(0), np.zeros(0, np.float32), error.what)
        hz, mac, sizes = (np.concatenate(part) for part in zip(*parts))
        return _Solved(hz, mac, sizes.astype(np.float32))


def _line(solved: _Solved) -> Mapping[str, object]:
    parts = {name: _text(getattr(solved, name)) for name in ("hz", "mac", "sizes")}
    return {**parts, "problem": solved.problem}


def _text(values: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(values, f"<f{values.itemsize}").tobytes()).decode()


def _of_line(line: Mapping[str, Any]) -> _Solved | None:
    try:
        hz, mac = (np.frombuffer(base64.b64decode(line[name]), "<f8").astype(float) for name in ("hz", "mac"))
        return _Solved(hz, mac, np.frombuffer(base64.b64decode(line["sizes"]), "<f4"), str(line["problem"]))
    except (ValueError, KeyError, TypeError):
        return None


# ----------------------------------------------------------------------------------------------------
# All draws.


@dataclass(frozen=True, eq=False)
class Predicting:
    """Predicts over samples; see the module.

    Parameters
    ----------
    x : (k,) normalised parameters at the result of the update
    changes : unknown changes of the model, None without
    """

    study: Study
    x: Reals
    changes: UnknownChanges | None
    errors: ModelErrors
    executor: Executor
    progress: Progress

    def run(
        self, samples: PosteriorSamples, likelihood: Likelihood, moving: Integers, folder: Path,
        arrays: dict[str, NDArray[Any]],
    ) -> SampledPredictions:  # fmt: skip
        """The predictions; arrays of bands are put into `arrays`.

        Parameters
        ----------
        moving : positions of the sampled parameters
        folder : the run folder, with the journal

        Raises
        ------
        FemtuneError : ``run.unwritable``, ``executor.*``
        """
        cases, remarks = self._cases()
        if not cases:
            return SampledPredictions(remarks=tuple(remarks))
        points = self.drawn(samples, likelihood, moving)
        model = _Model(tuple(p for *_, p in cases))
        solved, kept = self._solved(model, points, folder)
        good = [one for one in solved if not one.problem]
        failed = len(solved) - len(good)
        if len(good) < _LEAST_SOLVED * len(solved):
            first = next(one.problem for one in solved if one.problem)
            remarks.append(
                f"Nothing is predicted: the model could not be solved at {failed} of {len(solved)} samples ({first})."
            )
            return SampledPredictions(asked=len(solved), failed=failed, remarks=tuple(remarks))
        if any(c.name == SUPPORTS for c in self.errors.classes):
            remarks.append("In the predictions the supports are those of the deck; that some give way is not in them.")
        found, functions, lost = self._records(cases, good, arrays)
        remarks += [n.what for n in kept.remarks] + lost
        return SampledPredictions(tuple(found), tuple(functions), len(solved), failed, tuple(remarks))

    @property
    def table(self) -> PosteriorTable:
        """[posterior]."""
        table = self.study.file.posterior
        assert table is not None
        return table

    def _cases(self) -> tuple[list[tuple[StudyCase, EigenSolution, _Predicted]], list[str]]:
        """Configurations that are predicted, and why others are not."""
        cases: list[tuple[StudyCase, EigenSolution, _Predicted]] = []
        remarks: list[str] = []
        if not self.table.predictions:
            return cases, remarks
        for case in self.study.cases:
            if case.configured.n_free > MOST_DOFS and "predictions" not in self.table.model_fields_set:
                remarks.append(
                    f"Nothing is predicted of {case.name}: with more than {MOST_DOFS:,} free DOFs the solutions take "
                    f"long; predictions = {self.table.predictions} in [posterior] asks for them."
                )
                continue
            try:
                solution = solve(self.study, case, self.x)
                followed = followed_from(self.study, case, solution)
            except FemtuneError as error:
                remarks.append(f"Nothing is predicted of {case.name}: {error.what}.")
                continue
            functions, why = self._functions(case)
            remarks += [why] * bool(why)
            cases.append((case, solution, _Predicted(self._widened(followed, case), functions)))
        return cases, remarks

    def drawn(self, samples: PosteriorSamples, likelihood: Likelihood, moving: Integers) -> Reals:
        """(n, k + changes) samples by their weights, each with its own changes of the model."""
        rng = np.random.default_rng([self.table.seed, 1])
        chosen = rng.choice(len(samples.x), self.table.predictions, p=samples.weights.values)
        points, changes = completed(self.x, samples.x[chosen], moving), self.changes
        if changes is None:
            return points
        # compliances of supports are the last ones, and act in derivatives alone
        raw = np.zeros((len(chosen), changes.n_raw - changes.supports))
        for row, i in zip(raw, chosen if self.errors.classes else ()):
            q = likelihood.drawn_factors(samples.residuals[i], samples.theta[i], rng)
            _, s = likelihood.sizes(samples.theta[i])
            row[:] = changes.within(self.errors.drawn(q, s, rng))[: len(row)]
        return np.hstack([points, raw])

    def _widened(self, followed: FollowedModes, case: StudyCase) -> FollowedModes:
        if self.changes is None:
            return replace(followed, solver=direct)
        wide = widened(self.study.model, self.changes.factors, self.changes.masses)
        return replace(followed, configured=configure(wide, case.configured.configuration), solver=direct)

    def _functions(self, case: StudyCase) -> tuple[_Functions | None, str]:
        """The FRFs of [response], and why there are none although it is there."""
        table = self.study.file.response
        if table is None:
            return None, ""
        try:
            request = response_request(self.study, case, table)
        except FemtuneError as error:
            return None, f"No FRFs are predicted of {case.name}: {error.what}."
        count = len(request.outputs.labels) * len(request.inputs.labels) * len(request.freq_hz)
        if count > MOST_VALUES:
            return None, (
                f"No FRFs are predicted of {case.name}: [response] asks for {count:,} values, and {MOST_VALUES:,} can "
                "be kept of each sample; name fewer outputs, inputs or lines."
            )
        return _Functions(request), ""

    def _solved(self, model: _Model, points: Reals, folder: Path) -> tuple[list[_Solved], KeptSolutions[_Solved]]:
        of_case = [
            part
            for p in model.predicted
            for part in (matrices_digest(p.followed.configured.at(points[0])), p.followed.shapes, *p.of_functions)
        ]
        file = FinishedRuns(folder / PREDICTIONS_FILE, digest(points, *of_case))
        kept = KeptSolutions(self.executor, file, self.progress, _line, _of_line)
        kept.begin(self.study.file.study.journal)
        # samples are drawn by their weights, and some more than once
        every, where = np.unique(points, axis=0, return_inverse=True)
        keys = [digest(np.ascontiguousarray(x)) for x in every]
        solved = kept.solved(model, list(every), keys, "posterior: predictions", "prediction")
        return [solved[i] for i in where.ravel()], kept

    def _records(
        self, cases: Sequence[tuple[StudyCase, EigenSolution, _Predicted]], good: Sequence[_Solved],
        arrays: dict[str, NDArray[Any]],
    ) -> tuple[list[PosteriorFrequency], list[PosteriorFunctions], list[str]]:  # fmt: skip
        hz, mac, sizes = (np.array([getattr(one, name) for one in good]) for name in ("hz", "mac", "sizes"))
        found, functions, lost = list[PosteriorFrequency](), list[PosteriorFunctions](), list[str]()
        at, first = 0, 0
        for number, (case, solution, predicted) in enumerate(cases, start=1):
            count = len(predicted.followed.numbers)
            mine = slice(at, at + count)
            known = mac[:, mine] >= _LEAST_MAC
            followed = known.mean(axis=0) >= 1.0 - _MOST_LOST
            found += self._frequencies(case, solution, predicted.followed, hz[:, mine], known, followed)
            if not followed.all():
                modes = ", ".join(map(str, predicted.followed.numbers[~followed]))
                lost.append(
                    f"Modes of {case.name} that could not be followed through the samples have no interval: {modes}."
                )
            at += count
            if predicted.functions is not None:
                request = predicted.functions.request
                shape = (len(request.outputs.labels), len(request.inputs.labels), len(request.freq_hz))
                last = first + int(np.prod(shape))
                functions.append(_band(request, number, sizes[:, first:last].reshape(-1, *shape), arrays))
                first = last
        return found, functions, lost

    def _frequencies(
        self, case: StudyCase, solution: EigenSolution, followed: FollowedModes, hz: Reals, known: NDArray[np.bool_],
        enough: NDArray[np.bool_],
    ) -> Iterator[PosteriorFrequency]:  # fmt: skip
        tests = dict[int, int]()
        if case.modal is not None:
            rigid = solution.wanted - len(followed.numbers)
            tests = {p.model: p.test for p in correlate_case(case.modal, solution, rigid).pairing.pairs}
        rng = np.random.default_rng([self.table.seed, 2])
        for j, mode in enumerate(followed.numbers.tolist()):
            if not enough[j]:
                continue
            values = hz[known[:, j], j]
            low, median, high = map(float, np.quantile(values, _ENDS))
            one = PosteriorFrequency(
                configuration=case.name, mode=mode, value_hz=float(followed.freq_hz[j]), median_hz=median,
                interval_95=(low, high),
            )  # fmt: skip
            test = tests.get(mode - 1)
            yield one if test is None else one.model_copy(update=self._measured(case, test, values, rng))

    def _measured(self, case: StudyCase, test: int, values: Reals, rng: np.random.Generator) -> dict[str, object]:
        assert case.modal is not None
        modes = case.modal.test
        measured, sd = float(modes.freq_hz[test]), scatter_of_test(self.study, case, test) or 0.0
        low, _, high = np.quantile(values * (1.0 + sd * rng.standard_normal(len(values))), _ENDS)
        used = case.used is not None and test not in case.held.modes and test not in case.used.left_out
        return {
            "test_mode": modes.labels[test], "measured_hz": measured, "used": used,
            "measured_inside": bool(low <= measured <= high),
        }  # fmt: skip


def _band(
    request: ResponseRequest, number: int, sizes: NDArray[np.float32], arrays: dict[str, NDArray[Any]]
) -> PosteriorFunctions:
    """The record of |H| (n, outputs, inputs, lines) over the samples."""
    head = f"posterior/functions/{number}"
    keys = {name: f"{head}/{name}" for name in ("hz", "band", "test_hz", "test")}
    band = np.quantile(sizes.astype(float), _ENDS, axis=0)
    arrays[keys["hz"]], arrays[keys["band"]] = request.freq_hz, band
    inside = test = None
    if request.measured is not None and np.isfinite(request.measured.values).any():
        hz = request.measured.freq_hz
        there = (hz >= request.freq_hz[0]) & (hz <= request.freq_hz[-1])
        arrays[keys["test_hz"]], arrays[keys["test"]] = hz[there], request.measured.values[:, :, there]
        test = (keys["test_hz"], keys["test"]) if there.any() else None
        # lines that both have: where they are few, they say nothing of the others
        nearest = np.abs(hz - request.freq_hz[:, None]).argmin(axis=1)
        ours = np.flatnonzero(np.abs(hz[nearest] - request.freq_hz) <= _SAME_LINE * request.freq_hz)
        size = np.abs(request.measured.values[:, :, nearest[ours]])
        known = np.isfinite(size)
        if len(ours) >= _LEAST_COMMON * len(request.freq_hz) and known.any():
            inside = 100.0 * float(((size >= band[0][..., ours]) & (size <= band[2][..., ours]))[known].mean())
    positive = band[0] > 0.0
    width = 20.0 * np.log10(band[2][positive] / band[0][positive])
    return PosteriorFunctions(
        configuration=request.case.name, kind=request.table.kind, outputs=tuple(request.outputs.labels.labels()),
        inputs=tuple(request.inputs.labels.labels()), freq_key=keys["hz"], band_key=keys["band"],
        test_freq_key=None if test is None else test[0], test_values_key=None if test is None else test[1],
        width_db=float(np.median(width)) if width.size else 0.0, measured_inside_percent=inside,
    )  # fmt: skip
