"""Reduced models that are trained on a box of the parameters: modes at points chosen greedily by the error estimate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Integers, Reals
from femtune.model.configured import ConfiguredModel, ModelPoint
from femtune.model.eigen.solution import EigenSolution, solve_modes
from femtune.model.linear.dense_products import in_any_order
from femtune.model.linear.symmetric import SymmetricMatrix
from femtune.model.reduce.components import ComponentBasis
from femtune.model.reduce.estimate import (
    ABOVE,
    NEGLIGIBLE,
    ErrorEstimator,
    certified_error,
    extend,
    extend_by,
    frequency_error,
    orthonormal,
)
from femtune.model.reduce.function_estimate import FunctionsWanted, missed_responses
from femtune.model.reduce.modes_in_basis import reduced_modes
from femtune.model.reduce.reduced_model import ReducedModel, enlarge, leading, reduce_model

# ----------------------------------------------------------------------------------------------------
# Options and result of the training of a reduced model.


class TrainingStatus(Enum):
    """How the training of a reduced model ended; the best model so far is kept."""

    CONVERGED = "the estimate is below the tolerance at all candidates"
    SOLUTIONS = "the limit of full solutions was reached; the estimate exceeds the tolerance at some candidates"
    ORDER = "the largest order was reached; the estimate exceeds the tolerance at some candidates"
    UNFINISHED = "the training is not finished"

    @property
    def ok(self) -> bool:
        """True where the tolerance was reached."""
        return self is TrainingStatus.CONVERGED


RESPONSES = 0.02
"""Part of the response to a force, in energy norm, that the basis may lack; its square is the error of FRFs."""


@dataclass(frozen=True)
class TrainingRules:
    """What a reduced model is trained to.

    Parameters
    ----------
    count : modes that matter, the lowest ones
    tolerance : relative frequency error, by the estimate
    full_solutions : how many times the full model may be solved
    order : largest order of the basis
    inner, corners : candidates inside the box and at corners of it
    negligible : see `extend`
    responses : the same of what modes miss of the responses to the forces of FRFs
    ranked : see `Trainer.train`
    """

    count: int
    tolerance: float = 1e-3
    full_solutions: int = 15
    order: int = 600
    inner: int = 48
    corners: int = 0
    negligible: float = NEGLIGIBLE
    responses: float = RESPONSES
    ranked: bool = False


@dataclass(frozen=True, eq=False)
class Certified:
    """A point where the full model was solved.

    Parameters
    ----------
    eigenvalues : (m,) of the full model
    estimate : worst estimated frequency error there before, NaN without an estimate
    error : worst true frequency error of the model before its basis had the modes of this point, NaN at the first one
    order : of the basis afterwards
    """

    x: Reals
    eigenvalues: Reals
    estimate: float
    error: float
    order: int


@dataclass(frozen=True, eq=False)
class Trained:
    """A reduced model with its basis and what is known of its errors.

    Parameters
    ----------
    model, basis : V (n_free, r), VᵀA0V = 1 with A0 = K0 − σM0 unless it is made of components
    certified : points where the full model was solved, in their order
    points, estimates : (c, k) candidates, and (c,) the last worst estimate made at each; infinite where none was
    status : state of the training
    components : the parts of the basis, where it is made of components
    """

    model: ReducedModel
    basis: Reals = field(repr=False)
    certified: tuple[Certified, ...]
    points: Reals = field(repr=False)
    estimates: Reals = field(repr=False)
    status: TrainingStatus
    estimator: ErrorEstimator = field(repr=False)
    metric: SymmetricMatrix = field(repr=False)
    components: ComponentBasis | None = field(default=None, repr=False)

    @property
    def worst_estimate(self) -> float:
        """The largest estimate at the candidates."""
        return float(self.estimates.max(initial=0.0))


# ----------------------------------------------------------------------------------------------------
# The arrays that a training needs to go on where it stopped.


@dataclass(frozen=True, eq=False)
class SavedBasis:
    """Plain arrays of a `Trained`.

    Parameters
    ----------
    shift : σ of the nominal model
    basis : V (n_free, r)
    x : (p, k) certified points
    eigenvalues : (p, m) there, NaN where a point has fewer
    known : (p, 3) estimate, true error and order of each
    points, estimates : (c, k) candidates and (c,) their estimates
    """

    shift: float
    basis: Reals
    x: Reals
    eigenvalues: Reals
    known: Reals
    points: Reals
    estimates: Reals

    @classmethod
    def of(cls, trained: Trained) -> SavedBasis:
        """The arrays of a training."""
        some = trained.certified
        values = np.full((len(some), max(len(c.eigenvalues) for c in some)), np.nan)
        for row, c in zip(values, some):
            row[: len(c.eigenvalues)] = c.eigenvalues
        known = np.array([(c.estimate, c.error, c.order) for c in some], float)
        x = np.array([c.x for c in some], float)
        return cls(trained.model.shift, trained.basis, x, values, known, trained.points, trained.estimates)

    def check(self) -> None:
        """Refuse shapes that do not belong together.

        Raises
        ------
        ValueError : in words
        """
        p, k = self.x.shape
        fits = self.basis.ndim == 2 and self.eigenvalues.shape[:1] == (p,) and self.known.shape == (p, 3)
        fits = fits and self.points.ndim == 2 and self.points.shape[1] == k
        fits = fits and self.estimates.shape == (len(self.points),)
        if not fits or p == 0 or not np.isfinite(self.basis).all() or not self.shift < 0.0:
            raise ValueError("its arrays do not fit together")

    def certified(self) -> tuple[Certified, ...]:
        """The points where the full model was solved."""
        rows = zip(self.x, self.eigenvalues, self.known)
        return tuple(Certified(x, v[np.isfinite(v)], float(e), float(t), int(n)) for x, v, (e, t, n) in rows)


# ----------------------------------------------------------------------------------------------------
# Points of the box of the parameters at which a reduced model is tried.


_SEED = 2026
"""Of the random shift of the candidates, so that a training is repeated exactly."""


def points_of(configured: ConfiguredModel, rules: TrainingRules, base: Reals, moving: NDArray[np.bool_]) -> Reals:
    """(c, k) candidates in the box of the parameters that move, the others at `base`; none where nothing moves."""
    lower, upper = configured.model.parameters.bounds
    if not moving.any():
        return np.zeros((0, len(base)))
    low, high = np.where(moving, lower, base), np.where(moving, upper, base)
    return candidates(low, high, rules.inner, rules.corners)


def candidates(lower: Reals, upper: Reals, count: int, corners: int = 0, seed: int = _SEED) -> Reals:
    """(count + corners, k) points: a Sobol sequence in the box, and corners of it that differ from one another.

    A corner where all parameters go the same way scales a structure without changing its shapes much; the corners
    taken are the signs of another Sobol sequence, in which half of the parameters go up and half down on the average.
    """
    k = len(lower)
    inner = lower + _sobol(k, count, seed) * (upper - lower)
    signs = _sobol(k, corners, seed + 1) > 0.5
    return np.vstack([inner, np.where(signs, upper, lower)])


def _sobol(k: int, count: int, seed: int) -> Reals:
    """Points of a Sobol sequence, turned by a random shift that is the same with every version of SciPy."""
    from scipy.stats import qmc  # noqa: PLC0415  half a second that nothing else here needs

    power = int(np.ceil(np.log2(max(count, 1))))
    points = qmc.Sobol(k, scramble=False).random_base2(power)[:count]
    return np.asarray((points + np.random.default_rng(seed).random(k)) % 1.0)


_HIGHER_LINES = 1.02
"""Factor by which lines may be higher than those that a basis was trained for."""
FIRST_MODES = 1.5
"""Modes of the nominal model that the basis starts from, as a multiple of the wanted ones: at other points higher
modes become some of these."""
TRIED = 8
"""Candidates at which the error is estimated before the worst of them is solved, as long as it is above the tolerance:
an estimate costs almost as much as a full solution, and the other candidates are estimated on the next basis."""

_LAST_SOLUTIONS = 2
"""Candidates at the head of rankings that are solved one after the other with small errors before a training ends."""

Solve = Callable[[ModelPoint, int, EigenSolution | None], EigenSolution]


@dataclass(frozen=True, eq=False)
class Trainer:
    """Trains reduced models of one configured model.

    Parameters
    ----------
    rows : (s, n_free) where the modes are wanted
    solve : the full solution of a model point and a number of modes, from modes nearby where they are given
    report : called after every full solution
    looking : called after every estimate, with the estimates so far and how many of them are of this basis
    base : (k,) where the basis begins; the nominal point without it
    moving : (k,) parameters that vary in the box, the others rest at `base`; all without it
    functions : FRFs that the model is trained for besides its modes
    """

    configured: ConfiguredModel
    rules: TrainingRules
    rows: NDArray | None = None
    solve: Solve = field(default=lambda point, count, start: solve_modes(point, count, start=start))
    report: Callable[[Trained], None] = field(default=lambda trained: None)
    looking: Callable[[Trained, int], None] = field(default=lambda trained, estimated: None)
    base: Reals | None = None
    moving: NDArray[np.bool_] | None = None
    functions: tuple[FunctionsWanted, ...] = ()

    def start(self, inputs: Reals | None = None) -> Trained:
        """The basis of the nominal modes, with the static shapes (K0 − σM0)⁻¹F of the inputs F (n_free, f)."""
        x, moving = base_and_moving(self.configured, self.base, self.moving)
        solution = self.solve(self.configured.at(x), int(FIRST_MODES * self.rules.count), None)
        metric = solution.point.symmetric_stiffness.plus(-solution.shift, solution.point.symmetric_mass)
        vectors = [solution.shapes]
        if inputs is not None and inputs.shape[1]:
            vectors.append(solution.factor.solve(np.asfortranarray(inputs)))
        basis = self._with_responses(orthonormal(np.hstack(vectors), metric), metric, solution)
        if self.rules.ranked and self.functions:
            # they are not needed any more, and would fill the memory beside a basis
            solution.forget_factors()
            solution.point.release()
        model = reduce_model(self.configured, basis, self.rows, solution.shift)
        first = Certified(x, solution.eigenvalues[: self.rules.count], np.nan, np.nan, basis.shape[1])
        points = points_of(self.configured, self.rules, x, moving)
        known = None if self.rules.ranked else solution.factor
        estimator = ErrorEstimator(metric, self.rules.count, self.functions, known)
        trained = Trained(
            model, basis, (first,), points, np.full(len(points), np.inf), TrainingStatus.UNFINISHED, estimator, metric
        )
        self.report(trained)
        return trained

    def again(self, begun: Trained) -> Trained:
        """What `start` gives, from a basis that a trainer of the same model, base, forces and count has begun."""
        x, moving = base_and_moving(self.configured, self.base, self.moving)
        points = points_of(self.configured, self.rules, x, moving)
        renewed = replace(begun, points=points, estimates=np.full(len(points), np.inf))
        self.report(renewed)
        return renewed

    def served_by(self, other: Trainer) -> bool:
        """Whether another trainer has the same matrices, points and forces, and at least as many modes and lines.

        The parameters of the one take the place of those of the other.
        """
        return (
            self.configured.projected is other.configured.projected
            and self.rules.count <= other.rules.count
            and replace(self.rules, count=other.rules.count) == other.rules
            and all(map(np.array_equal, self._own_points(), other._own_points()))
            and len(self.functions) == len(other.functions)
            and all(map(covered, self.functions, other.functions))
        )

    def taken_from(self, other: Trainer, trained: Trained) -> Trained:
        """What a trainer that this one is `served_by` has found, for this one."""
        rows = np.zeros((0, trained.model.order)) if self.rows is None else np.asarray(self.rows @ trained.basis)
        adapted = replace(
            trained,
            model=replace(trained.model, configured=self.configured, rows=rows),
            certified=tuple(replace(c, x=self._in_place_of(other, c.x[None])[0]) for c in trained.certified),
            points=self._in_place_of(other, trained.points),
            estimator=replace(trained.estimator, count=self.rules.count, functions=self.functions),
        )
        self.report(adapted)
        return adapted

    def _own_points(self) -> tuple[Reals, NDArray[np.bool_], Reals, Reals]:
        """Where the parameters that act here begin, which of them move, and their bounds."""
        base, moving = base_and_moving(self.configured, self.base, self.moving)
        lower, upper = self.configured.model.parameters.bounds
        at = acting_positions(self.configured)
        return base[at], moving[at], lower[at], upper[at]

    def _in_place_of(self, other: Trainer, points: Reals) -> Reals:
        """(c, k) points of another trainer as points of this one."""
        base, _ = base_and_moving(self.configured, self.base, self.moving)
        out = np.tile(base, (len(points), 1))
        out[:, acting_positions(self.configured)] = points[:, acting_positions(other.configured)]
        return out

    def _with_responses(self, basis: Reals, metric: SymmetricMatrix, solution: EigenSolution) -> Reals:
        """The basis with what the modes of a solution miss of the responses to the forces of FRFs."""
        for wanted in self.functions:
            basis = extend(basis, missed_responses(solution, wanted.forces, wanted.fewer), metric, self.rules.responses)
        return basis

    def resume(self, saved: SavedBasis) -> Trained:
        """Go on with a basis that was saved; the nominal matrices are factorised, nothing is solved."""
        point = self.configured.at(saved.x[0])
        metric = point.symmetric_stiffness.plus(-saved.shift, point.symmetric_mass)
        return Trained(
            reduce_model(self.configured, saved.basis, self.rows, saved.shift), saved.basis, saved.certified(),
            saved.points, saved.estimates, TrainingStatus.UNFINISHED,
            ErrorEstimator(metric, self.rules.count, self.functions), metric,
        )  # fmt: skip

    def train(self, trained: Trained) -> Trained:
        """Solve at the worst candidate and enrich until the estimate is below the tolerance or a limit is reached.

        With `ranked` the candidates are not estimated one by one, which costs as much as a solution each, but ranked by
        how far the frequencies of the reduced model differ from those on the basis before its last enrichment. The
        first of the ranking is solved next; once the true errors at the last two are below the tolerance, the training
        ends, and the larger of them is its estimate.
        """
        if self.rules.ranked:
            return self._train_ranked(trained)
        while True:
            used_up = limit_of(trained, self.rules)
            enough = TRIED if used_up is None else len(trained.points)
            trained, worst = estimated(trained, self.rules.tolerance, enough, self.looking)
            if trained.worst_estimate <= self.rules.tolerance:
                return replace(trained, status=TrainingStatus.CONVERGED)
            if used_up is not None:
                return replace(trained, status=used_up)
            trained = self._certified(trained, trained.points[worst], float(trained.estimates[worst]))

    def _train_ranked(self, trained: Trained) -> Trained:
        while True:
            used_up, order = limit_of(trained, self.rules), self._ranking(trained)
            last = [one.error for one in trained.certified[1:]][-_LAST_SOLUTIONS:]
            worst = max(last, default=np.inf) if len(last) == _LAST_SOLUTIONS or not len(order) else np.inf
            if not len(order) or used_up is not None or worst <= self.rules.tolerance:
                estimates = np.full(len(trained.points), worst if len(order) else 0.0)
                status = TrainingStatus.CONVERGED if worst <= self.rules.tolerance or not len(order) else used_up
                assert status is not None
                return replace(trained, status=status, estimates=estimates)
            trained = self._certified(trained, trained.points[order[0]], np.nan)

    def _ranking(self, trained: Trained) -> Integers:
        """Candidates that were not solved, those first whose frequencies the last enrichment has changed most."""
        count, known = self.rules.count, trained.certified
        orders = [known[-2].order if len(known) > 1 else len(known[0].eigenvalues), trained.model.order]
        small = [leading(trained.model, order) for order in orders]
        changes = np.full(len(trained.points), -np.inf)
        for i, x in enumerate(trained.points):
            if not any(np.array_equal(x, one.x) for one in known):
                before, after = (reduced_modes(m.at(x), count).eigenvalues[:count] for m in small)
                changes[i] = frequency_error(before[: len(after)], after[: len(before)]).max(initial=0.0)
        return np.asarray(np.argsort(-changes, kind="stable")[: int(np.isfinite(changes).sum())])

    def certify(self, trained: Trained, x: Reals) -> Trained:
        """Solve the full model at a point: its true error, and the basis enriched by what it misses there."""
        return self._certified(trained, x, estimate(trained, x))

    def enriched(self, trained: Trained, x: Reals, solution: EigenSolution) -> Trained:
        """As `certify`, with a solution of the full model at `x` that is there already."""
        return self._enriched(trained, x, solution, np.nan if self.rules.ranked else estimate(trained, x))

    def _certified(self, trained: Trained, x: Reals, before: float) -> Trained:
        point = self.configured.at(x)
        solution = self.solve(point, self.rules.count, modes_nearby(trained, point, self.rules.count))
        if self.rules.ranked:
            solution.forget_factors()
        # the responses to forces change less over the box than the modes: where a search ends they are added anyway
        return self._enriched(trained, x, solution, before, responses=not self.rules.ranked)

    def _enriched(
        self, trained: Trained, x: Reals, solution: EigenSolution, before: float, responses: bool = True
    ) -> Trained:
        """The basis with a solution at `x`, where the error was estimated as `before`."""
        values = solution.eigenvalues[: solution.wanted]
        error = float(certified_error(trained.model, x, values).max(initial=0.0))
        missed = [missed_responses(solution, wanted.forces, wanted.fewer) for wanted in self.functions if responses]
        if missed and self.rules.ranked:
            # as in `start`, and here there are two bases
            solution.forget_factors()
            solution.point.release()
        groups = [(solution.shapes, self.rules.negligible, None), *((m, self.rules.responses, None) for m in missed)]
        basis = extend_by(trained.basis, groups, trained.metric)
        del missed, groups
        point = Certified(np.asarray(x, float), values, before, error, basis.shape[1])
        at = (trained.points == x).all(axis=1)
        trained = replace(
            trained,
            model=enlarge(trained.model, basis, self.rows),
            basis=basis,
            certified=(*trained.certified, point),
            estimates=np.where(at, 0.0, trained.estimates),
        )
        self.report(trained)
        return trained


def acting_positions(configured: ConfiguredModel) -> NDArray[np.int64]:
    """Positions of the free parameters that have an effect on a model: none of other specimens."""
    model = configured.model
    return np.array([i for i, p in enumerate(model.parameters.free) if p.name not in model.foreign], np.int64)


def covered(one: FunctionsWanted, other: FunctionsWanted) -> bool:
    """Whether a basis for other FRFs serves these: the same forces, and lines that do not go far beyond."""
    return (
        one.freq_hz.max() <= _HIGHER_LINES * other.freq_hz.max()
        and one.damped == other.damped
        and one.decay == other.decay
        and one.forces.shape == other.forces.shape
        and not (one.forces != other.forces).nnz
    )


def limit_of(trained: Trained, rules: TrainingRules) -> TrainingStatus | None:
    """The limit that a training has reached."""
    if len(trained.certified) >= rules.full_solutions:
        return TrainingStatus.SOLUTIONS
    return TrainingStatus.ORDER if trained.model.order >= rules.order else None


def base_and_moving(
    configured: ConfiguredModel, base: Reals | None, moving: NDArray[np.bool_] | None
) -> tuple[Reals, NDArray[np.bool_]]:
    """The point where a basis begins and the parameters that move: the nominal one and all, where none are given."""
    k = len(configured.model.parameters.free)
    return np.zeros(k) if base is None else base, np.ones(k, bool) if moving is None else moving


def estimate(trained: Trained, x: Reals) -> float:
    """The worst estimated relative frequency error at a point."""
    return trained.estimator.at(trained.model, trained.basis, x).worst


def estimated(
    trained: Trained, tolerance: float, enough: int, looking: Callable[[Trained, int], None]
) -> tuple[Trained, int]:
    """The estimates at the candidates that may be the worst, and the worst of those tried.

    Errors fall as a basis grows, so that an estimate that is older than the basis counts as an upper bound. Once
    `enough` candidates are tried and one of them is above the tolerance, the others wait.
    """
    estimates, worst, tried = trained.estimates.copy(), 0, 0
    fresh = np.zeros(len(estimates), bool)
    while len(estimates):
        i = int(np.argmax(estimates))
        over = tried >= enough and estimates[worst] > tolerance
        if over or fresh[i] or estimates[i] <= tolerance:
            break
        estimates[i], fresh[i], tried = estimate(trained, trained.points[i]), True, tried + 1
        worst = int(np.argmax(np.where(fresh, estimates, -np.inf)))
        looking(replace(trained, estimates=estimates), tried)
    return replace(trained, estimates=estimates), worst


def modes_nearby(trained: Trained, point: ModelPoint, count: int) -> EigenSolution:
    """The lowest reduced modes at a point in the DOFs of the model, for a full solution to start from."""
    model = trained.model
    modes = reduced_modes(model.at(point.x), count)
    some = slice(0, int((1.0 + ABOVE) * count))
    shapes = in_any_order(trained.basis, np.ascontiguousarray(modes.shapes[:, some]))
    values, last = modes.eigenvalues[some], min(modes.wanted, shapes.shape[1]) - 1
    return EigenSolution(point, values, shapes, modes.wanted, model.shift, float(values[last]), -1)
