"""Regularisation: rows, linear in x, that are added to the residuals; determined at the first iteration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Protocol

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError, did_you_mean
from femtune.parameters import ParameterSet
from femtune.updating.kinds import WeightRule

# ----------------------------------------------------------------------------------------------------
# What the choice of a weight is: the path of the parameters, the rule, and how it ended; `weight` makes it.


Weight = float | WeightRule
"""A number, or the rule that determines it at the first iteration."""


@dataclass(frozen=True, eq=False)
class RegularisationPath:
    """Solutions of min |r + J d|² + μ²|R(x + d) − c|² for m weights, without bounds.

    Parameters
    ----------
    weights : (m,) μ, rising
    changes : (m, k) d of the parameters that move, zero for the others
    residual_norms, constraint_norms : (m,) |r + J d| and |R(x + d) − c|
    curvature : (m,) of the L-curve, log constraint norm over log residual norm; NaN where it is not defined
    cross_validation : (m,) |r + J d|²/(n − trace of the influence matrix)², the generalised cross-validation
    """

    weights: Reals
    changes: Reals
    residual_norms: Reals
    constraint_norms: Reals
    curvature: Reals
    cross_validation: Reals


class WeightStatus(Enum):
    """Outcome of the choice of the weight; without a weight the update runs without the constraint."""

    CORNER = "the weight was chosen at the corner of the L-curve, its point of largest curvature"
    NO_CORNER = (
        "the L-curve has no distinct corner that would balance data and constraint; the update ran without the "
        'constraint. Set weight to a number, or use weight = "gcv"'
    )
    MONOTONE = (
        "the curvature of the L-curve increases towards one of its ends, so that it has no corner; the update ran "
        'without the constraint. Set weight to a number, or use weight = "gcv"'
    )
    STANDS_STILL = (
        "data and constraint do not conflict, so that the result does not depend on the weight; the update ran without "
        "the constraint"
    )
    LEAST = "the weight minimises the generalised cross-validation function"
    AT_END = (
        "the generalised cross-validation function has no minimum inside the range of weights; the update ran without "
        "the constraint. Set weight to a number"
    )
    NO_SPARE = (
        "generalised cross-validation needs more residuals than parameters; the update ran without the constraint. "
        "Set weight to a number, or add measurements"
    )

    @property
    def found(self) -> bool:
        """True if a weight was determined."""
        return self in (WeightStatus.CORNER, WeightStatus.LEAST)


@dataclass(frozen=True, eq=False)
class WeightChoice:
    """The choice of the weight, with the complete path.

    Parameters
    ----------
    rule : "l-curve" or "gcv"
    position : of the weight in the path; None if none was found
    """

    rule: WeightRule
    status: WeightStatus
    position: int | None
    path: RegularisationPath

    @property
    def weight(self) -> float:
        """μ, zero if none was found."""
        return 0.0 if self.position is None else float(self.path.weights[self.position])


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Residuals and Jacobian at the point where an update starts.

    Parameters
    ----------
    x : (k,) normalised parameters
    residuals, jacobian : (n,), (n, k), in units of the residuals' standard deviations
    moving : (k,) parameters that the update moves
    """

    parameters: ParameterSet
    x: Reals
    residuals: Reals
    jacobian: Reals
    moving: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class SideConstraint:
    """A settled regularisation: rows μ(R x − c), and combinations of parameters that hold still.

    Parameters
    ----------
    word : as a study calls it
    matrix, target : R (m, k) and c (m,)
    weight : μ; the objective gains μ²|R x − c|²/2
    informative : True for rows in units of a known standard deviation (a prior), which narrow the standard deviations
        of the result; those of other constraints are an opinion and do not; (m,) where rows differ
    choice : how the weight was found, where a rule found it
    held : (h, k) combinations v of which vᵀx may not change
    renewed : for rows that act on the change of one iteration: the rows at the point where the next one starts
    """

    word: str
    matrix: Reals
    target: Reals = field(default_factory=lambda: np.zeros(0))
    weight: float = 1.0
    informative: bool | NDArray[np.bool_] = False
    choice: WeightChoice | None = None
    held: Reals = field(default_factory=lambda: np.zeros(0))
    renewed: Callable[[LinearModel], SideConstraint] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "held", self.held.reshape(-1, self.matrix.shape[1]))

    def settle(self, at: LinearModel) -> SideConstraint:
        """The constraint itself; of one that acts on the change of each iteration the rows there, in its weight."""
        return self if self.renewed is None else replace(self.renewed(at), weight=self.weight, choice=self.choice)

    def rows(self, x: Reals) -> tuple[Reals, Reals]:
        """Values (m,) and Jacobian (m, k)."""
        return self.weight * (self.matrix @ x - self.target), self.weight * self.matrix

    @property
    def prior_rows(self) -> Reals:
        """(m, k) rows that represent prior information."""
        return self.weight * self.matrix[np.broadcast_to(self.informative, len(self.target))]


class Regularisation(Protocol):
    """A side constraint; parts that depend on the first Jacobian are determined with it and kept."""

    def settle(self, at: LinearModel) -> SideConstraint:
        """The rows for an update that starts there."""
        ...


# ----------------------------------------------------------------------------------------------------
# No side constraint.


@dataclass(frozen=True)
class NoRegularisation:
    """The data alone."""

    def settle(self, at: LinearModel) -> SideConstraint:
        """No rows."""
        return self.side(len(at.x))

    def side(self, k: int) -> SideConstraint:
        """The constraint of k parameters."""
        return SideConstraint("none", np.zeros((0, k)))


# ----------------------------------------------------------------------------------------------------
# The path of the parameters over the weight μ of a side constraint, on the linear model of the first iteration.


POINTS = 301
"""Weights along an L-curve. Over ten decades two neighbours differ by 8 %, far less than a corner is wide; each costs
one pass over the singular values."""
_RANGE_FACTOR = 30.0
"""Weights reach this factor below the smallest and above the largest generalised singular value: filter factors there
are within 0.2 % of 0 or 1, so that both branches of the curve are seen."""
_LEAST_FELT = 1e-9
"""Singular value, relative to the largest, and spare degrees of freedom, below which they are rounding."""


def regularisation_path(side: SideConstraint, at: LinearModel, weights: Reals | None = None) -> RegularisationPath:
    """The path for given weights (m,), or for some that span all that the singular values tell apart.

    Source: Hansen (1992), Golub, Heath and Wahba (1979).
    """
    J, R = at.jacobian[:, at.moving], side.matrix[:, at.moving]
    offset = side.matrix @ at.x - side.target
    mu = _weights(J, R) if weights is None else np.asarray(weights, dtype=float)
    basis, triangle = np.linalg.qr(J)
    inside = basis.T @ at.residuals
    outside = float(np.linalg.norm(at.residuals - basis @ inside))
    points = [_point(triangle, R, inside, offset, m) for m in mu]
    d = np.array([p[0] for p in points]).reshape(len(mu), -1)
    rho = np.hypot(np.linalg.norm(inside + d @ triangle.T, axis=1), outside)
    eta = np.linalg.norm(offset + d @ R.T, axis=1)
    spare = len(at.residuals) - np.array([p[1] for p in points])
    changes = np.zeros((len(mu), len(at.x)))
    changes[:, at.moving] = d
    with np.errstate(divide="ignore"):
        crossed = np.where(spare > _LEAST_FELT, rho**2 / np.maximum(spare, _LEAST_FELT) ** 2, np.inf)
    return RegularisationPath(mu, changes, rho, eta, curvature(mu, rho, eta), crossed)


def _weights(J: Reals, R: Reals) -> Reals:
    """Weights from below the least to above the largest singular value of the data in units of the constraint."""
    s = np.linalg.svd(J @ np.linalg.pinv(R), compute_uv=False) if R.size else np.zeros(0)
    felt = s[s > _LEAST_FELT * s.max(initial=0.0)]
    least, most = (felt.min(), felt.max()) if felt.size else (1.0, 1.0)
    return np.geomspace(least / _RANGE_FACTOR, most * _RANGE_FACTOR, POINTS)


def _point(triangle: Reals, R: Reals, inside: Reals, offset: Reals, mu: float) -> tuple[Reals, float]:
    """d and the trace of the influence matrix."""
    rows = np.vstack([triangle, mu * R])
    inverse = la.pinv(rows, rtol=1e-14)
    d = -inverse @ np.concatenate([inside, mu * offset])
    return d, float(np.trace(triangle @ inverse[:, : len(triangle)]))


def curvature(mu: Reals, rho: Reals, eta: Reals) -> Reals:
    """Curvature of (log ρ, log η), positive where the curve turns like the corner of an L as μ rises."""
    if not (rho > 0.0).all() or not (eta > 0.0).all() or len(mu) < 5:
        return np.full(len(mu), np.nan)
    t = np.log(mu)
    x, y = np.log(rho), np.log(eta)
    dx, dy = np.gradient(x, t), np.gradient(y, t)
    speed = np.hypot(dx, dy)
    turn = dx * np.gradient(dy, t) - dy * np.gradient(dx, t)
    moving = speed > 1e-3 * speed.max()
    return np.where(moving, turn / np.where(moving, speed, 1.0) ** 3, np.nan)


# ----------------------------------------------------------------------------------------------------
# How the weight μ of a side constraint is found: given, by the corner of the L-curve, or by cross-validation.


SHARP = 1.0
"""Curvature from which a bend is a corner: a radius of less than a factor e in both norms."""


def weighed(side: SideConstraint, weight: Weight, at: LinearModel) -> SideConstraint:
    """The side constraint with its weight, found at this point where a rule is given."""
    if not isinstance(weight, str):
        return replace(side, weight=float(weight))
    choice = choose_weight(side, weight, at)
    return replace(side, weight=choice.weight, choice=choice)


def reweighed(side: SideConstraint, at: LinearModel) -> SideConstraint:
    """The same constraint with the weight that its rule finds at another point; the old one where none is found."""
    if side.choice is None:
        return side
    fresh = choose_weight(side, side.choice.rule, at)
    return replace(side, weight=fresh.weight, choice=fresh) if fresh.status.found else side


def choose_weight(side: SideConstraint, rule: WeightRule, at: LinearModel) -> WeightChoice:
    """The weight by a rule, on the linear model at a point."""
    path = regularisation_path(side, at)
    status, position = (corner_of if rule == "l-curve" else _least)(path, len(at.residuals) - int(at.moving.sum()))
    return WeightChoice(rule, status, position if status.found else None, path)


def corner_of(path: RegularisationPath, spare: int) -> tuple[WeightStatus, int]:
    """Whether the L-curve has a corner, and the position of its largest curvature."""
    known = np.flatnonzero(np.isfinite(path.curvature))
    if len(known) < 5:
        return WeightStatus.STANDS_STILL, 0
    top = int(known[np.argmax(path.curvature[known])])
    if path.curvature[top] < SHARP:
        return WeightStatus.NO_CORNER, top
    return (WeightStatus.MONOTONE if top in (known[0], known[-1]) else WeightStatus.CORNER), top


def _least(path: RegularisationPath, spare: int) -> tuple[WeightStatus, int]:
    if spare <= 0:
        return WeightStatus.NO_SPARE, 0
    values = path.cross_validation
    least = int(np.argmin(values))
    inside = 0 < least < len(values) - 1 and values[least] < (1.0 - 1e-6) * min(values[0], values[-1])
    return (WeightStatus.LEAST if inside else WeightStatus.AT_END), least


# ----------------------------------------------------------------------------------------------------
# Minimum change of the parameters from their nominal values.


@dataclass(frozen=True)
class MinimumChange:
    """Rows μ·x: normalised parameters are zero at their nominal values, so that relative changes are kept small.

    The objective gains μ²|x|²/2, μ being `weight`. Source: Mottershead, Link and Friswell (2011), Eq. (18) with
    W_θ = I, of the whole change, not of one iteration's, so that the end does not depend on how many there were.
    """

    weight: Weight

    def settle(self, at: LinearModel) -> SideConstraint:
        """Rows of the parameters that move."""
        matrix = np.eye(len(at.x))[at.moving]
        return weighed(SideConstraint("minimum-change", matrix, np.zeros(len(matrix))), self.weight, at)


# ----------------------------------------------------------------------------------------------------
# Distance from the values at which an update starts.


@dataclass(frozen=True)
class Distance:
    """Rows μ(x − x0)/s: x0 is where the update starts, s the prior standard deviation of each parameter.

    A parameter that may vary widely is held less than one that is known well. Source: Mottershead, Link and
    Friswell (2011), after Eq. (21).
    """

    weight: Weight

    def settle(self, at: LinearModel) -> SideConstraint:
        """Rows of the parameters that move."""
        matrix = np.diag(1.0 / at.parameters.prior[1])[at.moving]
        return weighed(SideConstraint("distance", matrix, matrix @ at.x), self.weight, at)


# ----------------------------------------------------------------------------------------------------
# Free parameters by name.


def position(parameters: ParameterSet, name: str) -> int:
    """Position of a free parameter in x.

    Raises
    ------
    FemtuneError : ``update.unknown-parameter``
    """
    names = tuple(p.name for p in parameters.free)
    if name in names:
        return names.index(name)
    values = {"free parameters": ", ".join(names) or "none"}
    if name in parameters.names:
        raise FemtuneError("update.unknown-parameter/tied", values=values, parameter=name)
    raise FemtuneError("update.unknown-parameter", values=values, hint=did_you_mean(name, names), parameter=name)


# ----------------------------------------------------------------------------------------------------
# Nominally identical parameters: their differences are kept small.


@dataclass(frozen=True)
class Identical:
    """Rows μ(P_i − mean P)/|scale| over each group of parameters, the side constraint Cθ = 0.

    The sum of their squares is that of all differences within a group over its number of parameters. 1/`weight` is the
    assumed relative standard deviation of the parameters. Source: Ahmadian, Mottershead and Friswell (1998);
    Mottershead, Link and Friswell (2011), after Eq. (21).

    Parameters
    ----------
    groups : names of free parameters, two or more a group
    """

    groups: tuple[tuple[str, ...], ...]
    weight: Weight

    def settle(self, at: LinearModel) -> SideConstraint:
        """Rows of all groups.

        Raises
        ------
        FemtuneError : ``update.unknown-parameter``
        """
        parts = [_differences(at.parameters, group) for group in self.groups]
        matrix = np.vstack([np.zeros((0, len(at.x))), *(rows for rows, _ in parts)])
        target = np.concatenate([np.zeros(0), *(values for _, values in parts)])
        return weighed(SideConstraint("identical", matrix, target), self.weight, at)


def _differences(parameters: ParameterSet, group: tuple[str, ...]) -> tuple[Reals, Reals]:
    """Deviations from the group's mean in units of its mean scale: matrix by x, and what it is at x = 0, negative."""
    at = [position(parameters, name) for name in group]
    deviation = np.eye(len(at)) - 1.0 / len(at)
    unit = parameters.scale[at].mean()
    matrix = np.zeros((len(at), len(parameters.free)))
    matrix[:, at] = deviation * (parameters.scale[at] / unit)
    return matrix, -deviation @ parameters.nominal[at] / unit


# ----------------------------------------------------------------------------------------------------
# Link's weighting: a parameter is held the more, the less the data feel it.


_LEAST_SENSITIVITY = 1e-12
"""Smallest diagonal entry of GᵀWG relative to the largest: a sensitivity of 1e-6, so that weights stay finite."""


def link_weights(jacobian: Reals) -> Reals:
    """(k,) diagonal of W_θ = mean(Γ)/mean(Γ⁻¹)·Γ⁻¹ with Γ = diag(GᵀW_ε G).

    A parameter without any effect would have an infinite weight: Γ is kept above 1e-12 of its largest entry.
    """
    felt = np.einsum("ij,ij->j", jacobian, jacobian)
    top = felt.max(initial=0.0)
    if not top > 0.0:
        return np.ones(len(felt))
    gamma = np.maximum(felt, _LEAST_SENSITIVITY * top)
    return np.asarray(gamma.mean() / (1.0 / gamma).mean() / gamma)


@dataclass(frozen=True)
class Link:
    """Rows μ·√W_θ·x with the weights of the first Jacobian; the objective gains μ²xᵀW_θx/2.

    Source: Mottershead, Link and Friswell (2011), Eqs. (19) to (21).
    """

    weight: Weight

    def settle(self, at: LinearModel) -> SideConstraint:
        """Rows of the parameters that move."""
        matrix = np.zeros((int(at.moving.sum()), len(at.x)))
        matrix[:, at.moving] = np.diag(np.sqrt(link_weights(at.jacobian[:, at.moving])))
        return weighed(SideConstraint("link", matrix, np.zeros(len(matrix))), self.weight, at)


# ----------------------------------------------------------------------------------------------------
# A side constraint on the change of each iteration, as the textbook prints it.


@dataclass(frozen=True)
class EachStep:
    """Rows μR(x − x_i) with x_i where iteration i starts: Δθ = (GᵀW_εG + μ²W_θ)⁻¹GᵀW_ε ε, W_θ = RᵀR.

    Nothing pulls back to the initial values: the rows vanish where an iteration ends, so that the constraint shortens
    and turns the steps, and the end of an update that converges is that of the data alone. Where it stops earlier, the
    result depends on the number of iterations. Link's weights are those of each iteration's Jacobian; a weight that a
    rule determines is kept from the first iteration. Source: Mottershead, Link and Friswell, Eqs. (19) to (22).
    """

    constraint: MinimumChange | Distance | Link

    def settle(self, at: LinearModel) -> SideConstraint:
        """The rows of the first iteration."""
        return weighed(self._rows(at), self.constraint.weight, at)

    def _rows(self, at: LinearModel) -> SideConstraint:
        whole = replace(self.constraint, weight=1.0).settle(at)
        word = f"{whole.word} (change of each iteration)"
        return replace(whole, word=word, target=whole.matrix @ at.x, renewed=self._rows)


# ----------------------------------------------------------------------------------------------------
# Truncated singular values: combinations that the data hardly feel hold still.


@dataclass(frozen=True)
class Truncated:
    """Every step leaves out the combinations whose singular value is below `threshold` times the largest.

    Singular values are those of the first Jacobian by parameters in units of their prior standard deviations. The
    combinations found there are kept: otherwise they would turn as the iteration goes on, and steps that are each
    truncated could together go anywhere.
    """

    threshold: float

    def settle(self, at: LinearModel) -> SideConstraint:
        """No rows, but the combinations that are fixed."""
        spread = at.parameters.prior[1][at.moving]
        scaled = at.jacobian[:, at.moving] * spread
        _, s, vt = np.linalg.svd(scaled, full_matrices=len(scaled) < scaled.shape[1])
        s = np.concatenate([s, np.zeros(len(vt) - len(s))])
        small = vt[s <= self.threshold * s.max(initial=0.0)] / spread
        held = np.zeros((len(small), len(at.x)))
        held[:, at.moving] = small / np.linalg.norm(small, axis=1, keepdims=True)
        return SideConstraint("truncated", np.zeros((0, len(at.x))), held=held)


# ----------------------------------------------------------------------------------------------------
# Several side constraints at once.


@dataclass(frozen=True)
class Together:
    """The rows of all parts: a prior and nominally identical parameters, for one.

    Only the rows of priors contribute to the standard deviations of the result.
    """

    parts: tuple[Regularisation, ...]

    def settle(self, at: LinearModel) -> SideConstraint:
        """All rows in their weights; errors of the parts."""
        sides = [part.settle(at) for part in self.parts]
        none = np.zeros((0, len(at.x)))
        rows = np.vstack([none, *(s.weight * s.matrix for s in sides)])
        target = np.concatenate([np.zeros(0), *(s.weight * s.target for s in sides)])
        held = np.vstack([none, *(s.held for s in sides)])
        known = np.concatenate([np.zeros(0, bool), *(np.full(len(s.target), s.informative) for s in sides)])
        word = " and ".join(s.word for s in sides) or "none"
        return SideConstraint(word, rows, target, informative=known, held=held)
