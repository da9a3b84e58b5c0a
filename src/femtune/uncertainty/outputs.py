"""Outputs z(θ) of a model and their derivatives, with a count of model solutions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.executor import Executor, finish
from femtune.executor.interface import nothing
from femtune.modal.assignment import linear_sum_assignment
from femtune.modal.subspace import clusters
from femtune.model import ConfiguredModel, EigenSolution, eigenvalue_derivatives, solve_modes, subspace_derivative
from femtune.residuals import CaseState, Evaluation, UpdateProblem
from femtune.residuals.case import Group
from femtune.residuals.frequency import FrequencyResidual
from femtune.residuals.shape import ShapeResidual, noise_of_scaling

if TYPE_CHECKING:
    from femtune.dofs import DofSet
    from femtune.residuals import ComparedCase
    from femtune.residuals.pair import PairResidual
    from femtune.residuals.weights import ResidualBlock


class Outputs(Protocol):
    """Predictions of a model for k parameters θ in their units: m outputs and their sensitivity matrix."""

    def values(self, theta: Reals) -> Reals:
        """z (m,)."""
        ...

    def linearised(self, theta: Reals) -> tuple[Reals, Reals]:
        """z (m,) and G = ∂z/∂θ (m, k), from one model solution."""
        ...


@dataclass
class Counted:
    """Outputs whose model solutions are counted; the last point is remembered, so that it is solved once.

    `solutions` is their number.
    """

    outputs: Outputs
    solutions: int = 0
    _last: tuple[Reals, Reals, Reals | None] | None = field(default=None, repr=False)

    def values(self, theta: Reals) -> Reals:
        """As of the outputs; ``quantify.not-finite`` if they are not finite."""
        if self._last is None or not np.array_equal(self._last[0], theta):
            self.solutions += 1
            self._last = (theta.copy(), _finite(self.outputs.values(theta), theta), None)
        return self._last[1]

    def at_points(
        self,
        theta: Reals,
        executor: Executor,
        known: Mapping[int, Reals] = MappingProxyType({}),
        finished: Callable[[int, Reals], None] = nothing,
    ) -> Reals:
        """(n, m) of points (n, k); ``quantify.not-finite`` if they are not finite.

        Parameters
        ----------
        known : outputs (m,) of points that are not solved again, by their position
        finished : is called with the position and the outputs of each other point when they are there
        """
        self.solutions += len(theta)
        outputs = finish(executor, self.outputs.values, list(theta), known, name="sample", finished=finished)
        return np.array([_finite(z, row) for z, row in zip(outputs, theta)])

    def linearised(self, theta: Reals) -> tuple[Reals, Reals]:
        """As of the outputs; ``quantify.not-finite`` if they are not finite."""
        known = self._last
        if known is not None and known[2] is not None and np.array_equal(known[0], theta):
            return known[1], known[2]
        self.solutions += 1
        z, G = self.outputs.linearised(theta)
        self._last = (theta.copy(), _finite(z, theta), _finite(G, theta))
        return z, G


def _finite(a: Reals, theta: Reals) -> Reals:
    if np.isfinite(a).all():
        return a
    raise FemtuneError("quantify.not-finite", values={"parameters": ", ".join(f"{t:.6g}" for t in theta)})


@dataclass(frozen=True)
class FunctionOutputs:
    """Outputs of two functions: z(θ) and G(θ)."""

    function: Callable[[Reals], Reals]
    jacobian: Callable[[Reals], Reals]

    def values(self, theta: Reals) -> Reals:
        """z (m,)."""
        return np.asarray(self.function(theta), float)

    def linearised(self, theta: Reals) -> tuple[Reals, Reals]:
        """z (m,) and G (m, k)."""
        return self.values(theta), np.asarray(self.jacobian(theta), float)


@dataclass(frozen=True)
class FrequencyOutputs:
    """Frequencies in Hz of the paired modes of an update problem, each motion followed from where it was paired.

    Modes of a close cluster are those of its subspace turned to the test's shapes, which are smooth where the modes
    cross.

    Parameters
    ----------
    problem : its residual rules do not matter, its pairing does
    paired : where the motions are followed from
    """

    problem: UpdateProblem
    paired: Evaluation

    @property
    def labels(self) -> tuple[str, ...]:
        """(m,) configuration and test mode."""
        alone = len(self.problem.cases) == 1
        return tuple(f"{'' if alone else b.configuration + ' '}mode {b.mode}" for b in _frequencies(self.paired))

    @property
    def modes(self) -> tuple[str, ...]:
        """(m,) labels of the test modes."""
        return tuple(b.mode for b in _frequencies(self.paired))

    @property
    def test_hz(self) -> Reals:
        """(m,) the test's own frequencies."""
        return np.array([_test_hz(self.paired, b.configuration, b.mode) for b in _frequencies(self.paired)])

    @property
    def test_sd_hz(self) -> Reals:
        """(m,) standard deviations of the test's own frequencies; NaN where it states none."""
        cases = {s.case.name: s.case.test for s in self.paired.states}
        return np.array([
            np.nan if test.freq_sd_hz is None else test.freq_sd_hz[test.labels.index(b.mode)]
            for b in _frequencies(self.paired) for test in [cases[b.configuration]]
        ])  # fmt: skip

    def values(self, theta: Reals) -> Reals:
        """(m,) Hz."""
        return self._hz(self._at(theta, derivatives=False))

    def linearised(self, theta: Reals) -> tuple[Reals, Reals]:
        """(m,) Hz and (m, k) Hz by the unit of each parameter."""
        at = self._at(theta, derivatives=True)
        slopes = np.concatenate([b.jacobian for b in _frequencies(at)])
        return self._hz(at), slopes * self.test_hz[:, None] / self.problem.parameters.scale

    def _at(self, theta: Reals, derivatives: bool) -> Evaluation:
        return self.problem.follow(self.problem.parameters.normalise(theta), self.paired, derivatives)

    def _hz(self, at: Evaluation) -> Reals:
        return np.asarray((np.concatenate([b.values for b in _frequencies(at)]) + 1.0) * self.test_hz)


@dataclass(frozen=True)
class ShapeOutputs:
    """Frequencies in Hz, then the entries of the shapes at the sensors, mode by mode, of paired modes.

    The measured entries of each shape have unit norm and the sign of the test shape, so that one combination of them
    does not vary.

    Parameters
    ----------
    frequencies : of the same modes; its problem has shape residuals besides
    kept : positions of the entries that are outputs, of all modes together; all where None
    """

    frequencies: FrequencyOutputs
    kept: tuple[int, ...] | None = None

    @property
    def labels(self) -> tuple[str, ...]:
        """(m,) of the frequencies, then mode and sensor of each entry."""
        entries = [f"mode {b.mode} at {dof}" for b, case, at in self._shapes() for dof in _picked(case.test.dofs, at)]
        return (*self.frequencies.labels, *(entries if self.kept is None else (entries[i] for i in self.kept)))

    def values(self, theta: Reals) -> Reals:
        """(m,) Hz, and entries without unit."""
        at = self.frequencies._at(theta, derivatives=False)
        return np.concatenate([self.frequencies._hz(at), self._entries(at)])

    def linearised(self, theta: Reals) -> tuple[Reals, Reals]:
        """Values, and their derivatives by the unit of each parameter."""
        at = self.frequencies._at(theta, derivatives=True)
        frequencies, scale = self.frequencies, self.frequencies.problem.parameters.scale
        slopes = np.concatenate([b.jacobian for b in _frequencies(at)]) * frequencies.test_hz[:, None]
        shapes = self._of_kept([b.jacobian for b in at.blocks if b.kind == ShapeResidual.label])
        return np.concatenate([frequencies._hz(at), self._entries(at)]), np.concatenate([slopes, shapes]) / scale

    @property
    def test_covariance(self) -> Reals:
        """(entries, entries) covariance from the standard deviations of the test's entries; NaN where it has none."""
        parts = []
        for b, case, at in self._shapes():
            column, unit = case.test.labels.index(b.mode), _unit(case, b.mode, at)
            sd = np.full(len(at), np.nan) if case.test.shapes_sd is None else case.test.shapes_sd[at, column]
            errors = noise_of_scaling(unit, "unit-norm") * sd / np.linalg.norm(np.real(case.test.shapes[at, column]))
            parts.append(errors @ errors.T)
        whole = la.block_diag(*parts)
        return np.asarray(whole if self.kept is None else whole[np.ix_(self.kept, self.kept)])

    def scaled(self, mode: str, shape: Reals) -> Reals:
        """Entries of a measured shape (sensors of the test,) as those of the outputs; NaN if one is missing."""
        case, at = next((case, at) for b, case, at in self._shapes() if b.mode == mode)
        known = shape[at]
        sign = np.sign(known @ _unit(case, mode, at)) or 1.0
        return np.asarray(known / (sign * np.linalg.norm(known)))

    def _shapes(self) -> list[tuple[ResidualBlock, ComparedCase, NDArray[np.int64]]]:
        """Blocks of the shapes with their cases, and the sensors that the test shape has."""
        cases = {s.case.name: s.case for s in self.frequencies.paired.states}
        blocks = [b for b in self.frequencies.paired.blocks if b.kind == ShapeResidual.label]
        return [(b, cases[b.configuration], _measured(cases[b.configuration], b.mode)) for b in blocks]

    def _entries(self, at: Evaluation) -> Reals:
        blocks = [b for b in at.blocks if b.kind == ShapeResidual.label]
        return self._of_kept(
            [b.values + _unit(case, b.mode, rows) for b, (_, case, rows) in zip(blocks, self._shapes())]
        )

    def _of_kept(self, parts: list[Reals]) -> Reals:
        rows = np.concatenate(parts)
        return rows if self.kept is None else rows[list(self.kept)]


def _measured(case: ComparedCase, mode: str) -> NDArray[np.int64]:
    return np.flatnonzero(~np.isnan(case.test.shapes[:, case.test.labels.index(mode)]))


def _unit(case: ComparedCase, mode: str, at: NDArray[np.int64]) -> Reals:
    shape = np.real(case.test.shapes[at, case.test.labels.index(mode)])
    return np.asarray(shape / np.linalg.norm(shape))


def _picked(dofs: DofSet, at: NDArray[np.int64]) -> list[str]:
    labels = [str(d) for d in dofs]
    return [labels[i] for i in at]


def shape_outputs(problem: UpdateProblem, theta: Reals | None = None) -> ShapeOutputs:
    """Frequencies and shapes of the modes that are paired at θ; errors as of `frequency_outputs`."""
    return ShapeOutputs(_outputs(problem, theta, (FrequencyResidual(1.0), ShapeResidual(1.0, "unit-norm"))))


def frequency_outputs(problem: UpdateProblem, theta: Reals | None = None) -> FrequencyOutputs:
    """Outputs of the modes that are paired at θ, the nominal values where none are given.

    Raises
    ------
    FemtuneError : ``correlate.no-pairs``, and what an eigen-solution raises
    """
    return _outputs(problem, theta, (FrequencyResidual(1.0),))


def _outputs(problem: UpdateProblem, theta: Reals | None, residuals: tuple[PairResidual, ...]) -> FrequencyOutputs:
    cases = tuple(replace(case, residuals=()) for case in problem.cases if len(case.test))
    plain = replace(problem, cases=cases, residuals=residuals)
    x = np.zeros(len(problem.parameters.free)) if theta is None else problem.parameters.normalise(theta)
    at = plain.start(x)
    return FrequencyOutputs(plain, plain.assess(at.x, [replace(s, groups=_close_together(s)) for s in at.states]))


def _close_together(state: CaseState) -> tuple[Group, ...]:
    """The groups of a state with those of close modes joined, however well each finds its partner here.

    Elsewhere in the cloud they may repeat, where only their subspace can be followed.
    """
    close = {j: n for n, c in enumerate(clusters(state.solution.freq_hz, state.case.rules.relative_gap)) for j in c}
    groups: dict[int, tuple[list[int], list[int]]] = {}
    for tests, models in state.groups:
        joined = groups.setdefault(close.get(models[0], -1 - models[0]), ([], []))
        joined[0].extend(tests)
        joined[1].extend(models)
    return tuple(sorted((tuple(sorted(t)), tuple(sorted(m))) for t, m in groups.values()))


def _frequencies(at: Evaluation) -> list:
    return [b for b in at.blocks if b.kind == FrequencyResidual.label]


def _test_hz(at: Evaluation, configuration: str, mode: str) -> float:
    case = next(s.case for s in at.states if s.case.name == configuration)
    return float(case.test.freq_hz[case.test.labels.index(mode)])


def second_derivatives(outputs: Counted, theta: Reals, step: Reals) -> tuple[Reals, Reals, Reals]:
    """z (m,), G (m, k) and H = ∂²z/∂θ∂θ (m, k, k), symmetric, by k differences of the sensitivity matrix.

    Parameters
    ----------
    step : (k,) step of each parameter
    """
    z, G = outputs.linearised(theta)
    columns = [(outputs.linearised(theta + h)[1] - G) / s for h, s in zip(np.diag(step), step)]
    H = np.stack(columns, axis=-1)
    return z, G, np.asarray(0.5 * (H + np.swapaxes(H, 1, 2)))


# ----------------------------------------------------------------------------------------------------
# Eigenvalues of a configured model as outputs, followed from a reference by their subspaces.


_LARGEST_DENSE = 2000
"""DOFs up to which eigenvalues of dense matrices are computed: 32 MB a matrix, and the time grows with the cube."""
_ZERO_EIGENVALUE = 1e-10
"""Eigenvalue relative to the largest magnitude that is rounding of zero."""


@dataclass(frozen=True)
class EigenvalueOutputs:
    """The `count` lowest eigenvalues in rad²/s² at θ, the parameters in their own units.

    Modes that are close at the reference (within `relative_gap` in frequency) are one subspace. Each subspace is
    followed by its overlap with the reference's, whatever modes cross it; inside it eigenvalues are in ascending
    order, which is continuous and, with definite matrices, monotone where single motions cross.

    Parameters
    ----------
    reference : (k,) θ of the reference
    more : modes solved for beyond `count`, in case others come down
    """

    configured: ConfiguredModel
    count: int
    reference: Reals
    relative_gap: float = 0.05
    more: int = 2

    def values(self, theta: Reals) -> Reals:
        """(count,) rad²/s²."""
        solution = self._solved(theta)
        return solution.eigenvalues[self._order(solution)]

    def linearised(self, theta: Reals) -> tuple[Reals, Reals]:
        """(count,) and (count, k), rad²/s² by the unit of each parameter.

        At a repeated eigenvalue the slopes are those of some vectors of its subspace: one of many that are as good.
        """
        solution = self._solved(theta)
        order = self._order(solution)
        slopes = eigenvalue_derivatives(solution)[order] / self.configured.model.parameters.scale
        return solution.eigenvalues[order], slopes

    @cached_property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """Positions of the modes of each subspace at the reference."""
        groups = clusters(self._reference.freq_hz[: self.count], self.relative_gap)
        return tuple(tuple(sorted(g)) for g in groups)

    def _solved(self, theta: Reals) -> EigenSolution:
        x = self.configured.model.parameters.normalise(theta)
        return solve_modes(self.configured.at(x), min(self.count + self.more, self.configured.n_free))

    @cached_property
    def _reference(self) -> EigenSolution:
        return self._solved(self.reference)

    def _order(self, solution: EigenSolution) -> list[int]:
        """Positions of the followed modes in a solution, subspace by subspace."""
        old, new = self._reference, solution
        overlap = (old.shapes[:, : self.count].T @ (old.point.mass @ new.shapes)) ** 2
        share = np.vstack([np.tile(overlap[list(g)].sum(axis=0), (len(g), 1)) for g in self.groups])
        assignment = linear_sum_assignment(-share)[1]
        out, at = [0] * self.count, 0
        for g in self.groups:
            for position, mode in zip(g, sorted(assignment[at : at + len(g)].tolist())):
                out[position] = int(mode)
            at += len(g)
        return out


@dataclass(frozen=True)
class ModeOutputs:
    """Eigenvalues in rad²/s², then the entries of the mode shapes, mode by mode, of modes that are followed.

    Each shape has unit norm over its entries, and the sign of that of the reference. Close modes are not distinguished
    by their subspace: their shapes change with the smallest change of the parameters.

    Parameters
    ----------
    eigenvalues : which modes, and from where they are followed
    entries : positions among the free DOFs; all where None
    """

    eigenvalues: EigenvalueOutputs
    entries: tuple[int, ...] | None = None

    def values(self, theta: Reals) -> Reals:
        """(count + count·entries,)."""
        solution, order = self._followed(theta)
        shapes = self._unit(solution, order)[0]
        return np.concatenate([solution.eigenvalues[order], shapes.T.ravel()])

    def linearised(self, theta: Reals) -> tuple[Reals, Reals]:
        """Values, and their derivatives by the unit of each parameter."""
        solution, order = self._followed(theta)
        shapes, norms = self._unit(solution, order)
        scale = self.eigenvalues.configured.model.parameters.scale
        slopes = [eigenvalue_derivatives(solution)[order]]
        for unit, norm, j in zip(shapes.T, norms, order):
            slope = subspace_derivative(solution, [j]).shape_gradient[self._rows(solution)] / norm
            slopes.append(slope - np.outer(unit, unit @ slope))
        return np.concatenate([solution.eigenvalues[order], shapes.T.ravel()]), np.concatenate(slopes) / scale

    def _followed(self, theta: Reals) -> tuple[EigenSolution, list[int]]:
        solution = self.eigenvalues._solved(theta)
        return solution, self.eigenvalues._order(solution)

    def _rows(self, solution: EigenSolution) -> NDArray[np.int64]:
        return np.arange(len(solution.shapes)) if self.entries is None else np.array(self.entries, dtype=np.int64)

    def _unit(self, solution: EigenSolution, order: list[int]) -> tuple[Reals, Reals]:
        """(entries, count) shapes of unit norm, and the signed norms (count,) that they were divided by."""
        reference, rows = self.eigenvalues._reference, self._rows(solution)
        overlap = reference.shapes[:, : self.eigenvalues.count] * (solution.point.mass @ solution.shapes[:, order])
        shapes = solution.shapes[rows][:, order]
        norms = np.where(overlap.sum(axis=0) < 0.0, -1.0, 1.0) * np.linalg.norm(shapes, axis=0)
        return np.asarray(shapes / norms), np.asarray(norms)


@dataclass(frozen=True)
class FrequenciesByOrder:
    """The `count` lowest frequencies in Hz at θ, regardless of the motion; not smooth where two cross.

    Parameters
    ----------
    first : number of still lower modes that are left out
    """

    configured: ConfiguredModel
    count: int
    first: int = 0

    def values(self, theta: Reals) -> Reals:
        """(count,) Hz."""
        return np.asarray(self._solved(theta).freq_hz[self._kept])

    def linearised(self, theta: Reals) -> tuple[Reals, Reals]:
        """(count,) Hz and (count, k) Hz by the unit of each parameter."""
        solution = self._solved(theta)
        hz = solution.freq_hz[self._kept]
        slopes = eigenvalue_derivatives(solution)[self._kept] / self.configured.model.parameters.scale
        return hz, slopes / (8.0 * np.pi**2 * hz[:, None])

    @property
    def _kept(self) -> slice:
        return slice(self.first, self.first + self.count)

    def _solved(self, theta: Reals) -> EigenSolution:
        x = self.configured.model.parameters.normalise(theta)
        return solve_modes(self.configured.at(x), self.first + self.count)


def definite_signs(configured: ConfiguredModel) -> Reals:
    """(k,) +1 where every eigenvalue grows with a free parameter, −1 where every one falls, 0 where nothing is known.

    A parameter without any effect, which changes no eigenvalue, has +1.

    A parameter that enters K linearly through a positive semidefinite matrix and not M lets no eigenvalue fall; one
    that enters M so lets none grow. Known for small models only (dense eigenvalues of the matrices).
    """
    k = len(configured.model.parameters.free)
    if configured.n_free > _LARGEST_DENSE:
        return np.zeros(k)
    point = configured.at(np.zeros(k))
    stiffness = [_sign(d.toarray()) for d in point.stiffness_derivatives]
    mass = [_sign(d.toarray()) for d in point.mass_derivatives]
    linear = np.array([_is_linear(configured, i) for i in range(k)])
    both = [s if m == 0.0 else -m if s == 0.0 else np.nan for s, m in zip(stiffness, mass)]
    none = [s == 0.0 == m for s, m in zip(stiffness, mass)]
    return np.where(linear & np.isfinite(both), np.where(none, 1.0, np.nan_to_num(both)), 0.0)


def _sign(matrix: Reals) -> float:
    """+1 or −1 for a semidefinite matrix, 0 for none at all, NaN for an indefinite one."""
    values = np.linalg.eigvalsh(matrix)
    size = np.abs(values).max(initial=0.0)
    if size == 0.0:
        return 0.0
    if values.min() >= -_ZERO_EIGENVALUE * size:
        return 1.0
    return -1.0 if values.max() <= _ZERO_EIGENVALUE * size else float("nan")


def _is_linear(configured: ConfiguredModel, i: int) -> bool:
    point = configured.at(np.zeros(len(configured.model.parameters.free)))
    second = [
        f(i, j)
        for f in (point.stiffness_second_derivative, point.mass_second_derivative)
        for j in range(point.n_parameters)
    ]
    return not any(np.abs(m.data).max(initial=0.0) > 0.0 for m in second)
