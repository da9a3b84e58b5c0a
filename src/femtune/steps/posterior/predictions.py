"""What the model predicts over the samples: natural frequencies of all configurations, and FRFs.

A sample of the parameters x is predicted with a draw of the unknown changes q of the model from their distribution
there, given the data; changes that the data do not see have the standard deviation of their class. The full model is
solved at (x, q), not linearised.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune import __version__
from femtune.errors import FemtuneError
from femtune.journal.finished import FinishedRuns
from femtune.journal.run_files import PREDICTIONS_FILE
from femtune.judge.widened import widened
from femtune.model import configure, digest, matrices_digest
from femtune.model.full_model import direct
from femtune.model.response import frf_with_error
from femtune.steps.correlate.facts import correlate_case
from femtune.steps.posterior.further import LEAST_MAC, LEAST_SOLVED, MOST_DOFS
from femtune.steps.posterior.kept import KeptSolutions, as_text, from_text
from femtune.steps.posterior.model_errors import SUPPORTS
from femtune.steps.posterior.problem import completed
from femtune.steps.posterior.record import PosteriorFrequency, PosteriorFunctions
from femtune.steps.validate.facts import scatter_of_test
from femtune.study.model_runs import followed_from
from femtune.study.response import parts_of_frfs, response_request
from femtune.study.solved import solve

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from femtune.arrays import Integers, Reals
    from femtune.executor import Executor
    from femtune.files.study_file import PosteriorTable
    from femtune.modal.kinds import FrfKind
    from femtune.model import EigenSolution, ModalDamping
    from femtune.model.kinds import FrfMethod
    from femtune.model.response import Ports
    from femtune.sampling import Likelihood, PosteriorSamples
    from femtune.steps.posterior.model_errors import ModelErrors, UnknownChanges
    from femtune.study.cases import StudyCase
    from femtune.study.model_runs import FollowedModes
    from femtune.study.progress import Progress
    from femtune.study.response import ResponseRequest
    from femtune.study.study import Study

_MOST_LOST = 0.05
"""Part of the samples at which a mode may not be followed: with more the ends of its interval are not known."""
MOST_VALUES = 100_000
"""Values of the FRFs of a configuration at a sample: 80 MB for 200 samples in single precision."""
_LEAST_COMMON = 0.5
"""Part of the lines that the test has too, below which measured values are not counted."""
_SAME_LINE = 1e-6
"""Relative distance of two lines that are one but for the rounding of a file."""
_LEAST_OF_COVARIANCE = 5
"""Samples for each value and one more, from which a covariance is estimated."""
_ENDS = np.array([0.025, 0.5, 0.975])


@dataclass(frozen=True, eq=False)
class SampledPredictions:
    """What the model predicts.

    Parameters
    ----------
    asked, failed : number of samples, and of those without a solution
    chance : that measured frequencies which were not used are together as far from what is predicted (`joint_chance`)
    remarks : what is not predicted, and why
    """

    frequencies: tuple[PosteriorFrequency, ...] = ()
    functions: tuple[PosteriorFunctions, ...] = ()
    asked: int = 0
    failed: int = 0
    chance: float | None = None
    remarks: tuple[str, ...] = ()


# ----------------------------------------------------------------------------------------------------
# The model at a draw.


@dataclass(frozen=True, eq=False)
class _Functions:
    """FRFs of a configuration, with all that can be sent to another process."""

    ports: Ports
    freq_hz: Reals
    kind: FrfKind
    method: FrfMethod
    damping: ModalDamping | None
    residual_vectors: bool
    add_vectors: bool
    needs_modes: bool
    modes: tuple[int | None, float | None]

    @staticmethod
    def of(request: ResponseRequest) -> _Functions:
        """Those of a request."""
        table = request.table
        return _Functions(
            request.ports, request.freq_hz, table.kind, request.method, request.damping, table.residual_vectors,
            not request.limit, request.needs_modes, request.modes,
        )  # fmt: skip

    @property
    def shape(self) -> tuple[int, int, int]:
        """Outputs, inputs and lines."""
        return self.ports.outputs.shape[0], self.ports.inputs.shape[1], len(self.freq_hz)

    def sizes(self, solution: EigenSolution) -> Reals:
        """|H| (outputs, inputs, lines)."""
        point, (count, _) = solution.point, self.modes
        solved = solution if count is None else direct.modes(point, count, None)
        return np.abs(
            frf_with_error(
                solved if self.needs_modes else point, self.ports, self.freq_hz, self.kind, self.method,
                damping=self.damping, residual_vectors=self.residual_vectors, add_vectors=self.add_vectors,
            ).frfs.values
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Predicted:
    """What is predicted of a configuration."""

    followed: FollowedModes
    functions: _Functions | None

    @property
    def values(self) -> int:
        """Number of values of FRFs."""
        return 0 if self.functions is None else int(np.prod(self.functions.shape))

    def at(self, x: Reals) -> tuple[Reals, Reals, Reals]:
        """Frequencies, MAC with the shapes at the result, and |H|."""
        top = None if self.functions is None else self.functions.modes[1]
        solution = self.followed.solver.modes(self.followed.configured.at(x), self.followed.count, top)
        hz, mac = self.followed.among(solution)
        return hz, mac, np.zeros(0) if self.functions is None else self.functions.sizes(solution).ravel()


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
    return {**{name: as_text(getattr(solved, name)) for name in ("hz", "mac", "sizes")}, "problem": solved.problem}


def _of_line(modes: int, values: int, line: Mapping[str, Any]) -> _Solved | None:
    """A solution with so many modes and values of FRFs; None for what is none, and is solved again."""
    try:
        problem = str(line["problem"])
        modes, values = (0, 0) if problem else (modes, values)
        hz, mac = from_text(line["hz"], modes), from_text(line["mac"], modes)
        return _Solved(hz, mac, from_text(line["sizes"], values, "<f4"), problem)
    except (ValueError, KeyError, TypeError):
        return None


# ----------------------------------------------------------------------------------------------------
# All draws.


@dataclass(frozen=True, eq=False)
class _Case:
    """A configuration, its modes at the result of the update, the request of its FRFs, and what is predicted of it."""

    case: StudyCase
    solution: EigenSolution
    request: ResponseRequest | None
    predicted: _Predicted


@dataclass(frozen=True, eq=False)
class _Frequency:
    """A record, the frequency at the samples (n,), NaN where the mode is lost, and the relative error of its test."""

    record: PosteriorFrequency
    hz: Reals
    sd: float


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
        solved, told = self._solved(cases, self.drawn(samples, likelihood, moving), folder)
        remarks += told
        good = [one for one in solved if not one.problem]
        failed = len(solved) - len(good)
        if len(good) < LEAST_SOLVED * len(solved):
            first = next(one.problem for one in solved if one.problem)
            remarks.append(
                f"Nothing is predicted: the model could not be solved at {failed} of {len(solved)} samples ({first})."
            )
            return SampledPredictions(asked=len(solved), failed=failed, remarks=tuple(remarks))
        if any(c.name == SUPPORTS for c in self.errors.classes):
            remarks.append("The predictions use the supports of the deck; their possible compliance is not included.")
        found, functions, lost = self._records(cases, good, arrays)
        frequencies = tuple(one.record for one in found)
        chance = self._chance([one for one in found if one.record.measured_hz is not None and not one.record.used])
        remarks += lost
        return SampledPredictions(frequencies, tuple(functions), len(solved), failed, chance, tuple(remarks))

    @property
    def table(self) -> PosteriorTable:
        """[posterior]."""
        table = self.study.file.posterior
        assert table is not None
        return table

    def _cases(self) -> tuple[list[_Case], list[str]]:
        """Configurations that are predicted, and why others are not."""
        cases, remarks = list[_Case](), list[str]()
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
            request, why = self._request(case)
            remarks += [why] * bool(why)
            functions = None if request is None else _Functions.of(request)
            cases.append(_Case(case, solution, request, _Predicted(self._widened(followed, case), functions)))
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

    def _request(self, case: StudyCase) -> tuple[ResponseRequest | None, str]:
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
        return request, ""

    def _solved(self, cases: Sequence[_Case], points: Reals, folder: Path) -> tuple[list[_Solved], tuple[str, ...]]:
        """The model at the points, from the journal of an earlier run as far as it has them; and remarks."""
        depends = [__version__, digest(points)]
        for one in cases:
            point = one.predicted.followed.configured.at(points[0])
            of_frfs = () if one.request is None else parts_of_frfs(one.request, point)
            depends += [digest(matrices_digest(point), one.predicted.followed.shapes, *of_frfs)]
        file = FinishedRuns(folder / PREDICTIONS_FILE, digest(*depends))
        model = _Model(tuple(one.predicted for one in cases))
        size = sum(len(p.followed.numbers) for p in model.predicted), sum(p.values for p in model.predicted)
        kept = KeptSolutions(self.executor, file, self.progress, _line, partial(_of_line, *size))
        kept.begin(self.study.file.study.journal)
        # samples are drawn by their weights, and some more than once
        every, where = np.unique(points, axis=0, return_inverse=True)
        keys = [digest(np.ascontiguousarray(x)) for x in every]
        solved = kept.solved(model, list(every), keys, "posterior: predictions", "prediction")
        return [solved[i] for i in where.ravel()], tuple(n.what for n in kept.remarks)

    def _records(
        self, cases: Sequence[_Case], good: Sequence[_Solved], arrays: dict[str, NDArray[Any]]
    ) -> tuple[list[_Frequency], list[PosteriorFunctions], list[str]]:
        hz, mac, sizes = (np.array([getattr(one, name) for one in good]) for name in ("hz", "mac", "sizes"))
        found, functions, lost = list[_Frequency](), list[PosteriorFunctions](), list[str]()
        at, first = 0, 0
        for number, one in enumerate(cases, start=1):
            numbers = one.predicted.followed.numbers
            mine, at = slice(at, at + len(numbers)), at + len(numbers)
            known = mac[:, mine] >= LEAST_MAC
            followed = known.mean(axis=0) >= 1.0 - _MOST_LOST
            found += self._frequencies(one, np.where(known, hz[:, mine], np.nan), followed)
            if not followed.all():
                modes = ", ".join(map(str, numbers[~followed]))
                lost.append(
                    f"Modes of {one.case.name} that could not be followed through the samples have no interval: "
                    f"{modes}."
                )
            if one.predicted.functions is not None and one.request is not None:
                mine, first = slice(first, first + one.predicted.values), first + one.predicted.values
                values = sizes[:, mine].reshape(-1, *one.predicted.functions.shape)
                functions.append(_band(one.request, number, values, arrays))
        return found, functions, lost

    def _frequencies(self, one: _Case, hz: Reals, followed: NDArray[np.bool_]) -> Iterator[_Frequency]:
        """The followed modes; hz (n, m) is NaN at samples at which a mode is lost."""
        case, modes, tests = one.case, one.predicted.followed, dict[int, int]()
        if case.modal is not None:
            rigid = one.solution.wanted - len(modes.numbers)
            tests = {p.model: p.test for p in correlate_case(case.modal, one.solution, rigid).pairing.pairs}
        rng = np.random.default_rng([self.table.seed, 2])
        for j, mode in enumerate(modes.numbers.tolist()):
            if not followed[j]:
                continue
            values = hz[np.isfinite(hz[:, j]), j]
            low, median, high = map(float, np.quantile(values, _ENDS))
            found = PosteriorFrequency(
                configuration=case.name, mode=mode, value_hz=float(modes.freq_hz[j]), median_hz=median,
                interval_95=(low, high),
            )  # fmt: skip
            test = tests.get(mode - 1)
            sd = 0.0 if test is None else scatter_of_test(self.study, case, test) or 0.0
            if test is not None:
                found = found.model_copy(update=_measured(case, test, with_noise(values, sd, rng)))
            yield _Frequency(found, hz[:, j], sd)

    def _chance(self, unused: Sequence[_Frequency]) -> float | None:
        if not unused or not all(one.sd > 0.0 for one in unused):
            return None
        y = np.array([one.hz for one in unused]).T
        measured = np.array([one.record.measured_hz for one in unused], float)
        rng = np.random.default_rng([self.table.seed, 3])
        sd = np.array([one.sd for one in unused])
        return joint_chance(with_noise(y[np.isfinite(y).all(axis=1)], sd, rng), measured)


def with_noise(hz: Reals, sd: Reals | float, rng: np.random.Generator) -> Reals:
    """Frequencies as a test with relative errors of standard deviation sd would give them."""
    return np.asarray(hz * (1.0 + sd * rng.standard_normal(hz.shape)))


def joint_chance(simulated: Reals, measured: Reals) -> float | None:
    """Part of simulated measurements (n, m) that are as far from the others as the measured values (m,).

    The distance is that of Mahalanobis, so that what the values have in common counts once; each simulated one is held
    against the others. None where these are too few for a covariance.

    Examples
    --------
    >>> import numpy as np
    >>> simulated = np.random.default_rng(0).standard_normal((200, 2))
    >>> joint_chance(simulated, np.array([5.0, 0.0])) < 0.01 < 0.3 < joint_chance(simulated, np.array([0.5, 0.5]))
    True
    """
    n, m = simulated.shape
    if n < _LEAST_OF_COVARIANCE * (m + 1):
        return None

    centre = simulated.mean(axis=0)
    off = simulated - centre
    scatter = off.T @ off
    # of each from the mean and the covariance of the others: one left out changes both by a term of rank one
    h = np.einsum("ij,ij->i", off, np.linalg.solve(scatter, off.T).T)
    distances = (n / (n - 1)) ** 2 * (n - 2) * h / (1.0 - n / (n - 1) * h)
    own = (n - 1) * float((measured - centre) @ np.linalg.solve(scatter, measured - centre))
    return float(1 + np.sum(distances >= own)) / (1 + n)


def _measured(case: StudyCase, test: int, simulated: Reals) -> dict[str, object]:
    """Of a test mode, and of simulated measurements of its frequency."""
    assert case.modal is not None
    modes = case.modal.test
    low, _, high = np.quantile(simulated, _ENDS)
    measured = float(modes.freq_hz[test])
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
