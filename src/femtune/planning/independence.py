"""Effective independence: sensors by their share in the Fisher information of the modal coordinates.

With the target modes Φ at the placed sensors the information is Q = ΦᵀΦ, and E = diag(ΦQ⁻¹Φᵀ) is the share of each
sensor in the rank of Φ. A sensor of d directions with rows Φ_s changes det Q by the factor det(1 ± Φ_sQ⁻¹Φ_sᵀ): this
is what elimination loses and expansion gains. Only matrices of the size of the modes are inverted.

Sources: Kammer 1991 (elimination), Kammer and Tinker 2004 (triaxial sensors), Kammer 2005 (expansion of a set).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Flags, Integers, Reals
from femtune.errors import FemtuneError
from femtune.planning.redundancy import unlike

_FRESH = 64
"""Downdates after which the shares are computed again: rounding would add up."""
_START = 1e-8
"""Information on every mode with which an empty set begins, relative to that of all candidates."""
_LOST = 1e-9
"""Part of the determinant below which a sensor cannot be removed: a target mode would be lost with it."""
_SINGULAR = 1e-10
"""Eigenvalue of the scaled information relative to the largest, at or below which target modes are dependent."""
_STILL = 1e-6
"""Relative singular value of the target modes at all candidates below which they are dependent."""
_LEAST_IMPROVEMENT = 1e-9
"""Score by which an exchange must be better, so that rounding does not exchange sensors for ever."""
_MOST_ROUNDS = 20
"""Rounds of exchanges at most; they end with the first that changes nothing."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Sensors that could be placed, all of d directions: 1 uniaxial, 3 triaxial.

    Parameters
    ----------
    shapes : (s, d, m) rows of the target modes along the directions of each sensor
    weights : (s,) factors on the rows of each where they count as information; None for plain effective independence
    names : (m,) what errors call the modes; their numbers from 1 by default
    """

    shapes: Reals
    weights: Reals | None = None
    names: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.shapes)

    @property
    def rows(self) -> Reals:
        """(s, d, m) weighted rows."""
        return self.shapes if self.weights is None else np.asarray(self.shapes * self.weights[:, None, None])


@dataclass(frozen=True, eq=False)
class Placed:
    """Sensors that are there already, of one number of directions: unweighted rows (p, d, m), and weighted ones."""

    shapes: Reals
    rows: Reals


@dataclass(frozen=True, eq=False)
class ChosenSensors:
    """Sensors that were chosen.

    Parameters
    ----------
    chosen : (n,) candidates in the order of their placement, or of their importance where others were removed
    rejected : number of candidates that were left out because a placed sensor gives the same information
    exchanges : number of sensors that were exchanged for better ones after all had been placed
    """

    chosen: Integers
    rejected: int = 0
    exchanges: int = 0


def information_of(*rows: Reals) -> Reals:
    """Q = Σ ΦᵀΦ (m, m) of rows (…, m) of sensors."""
    return np.asarray(sum(r.reshape(-1, r.shape[-1]).T @ r.reshape(-1, r.shape[-1]) for r in rows))


def log_det(information: Reals) -> float:
    """log det of an information matrix, −inf where it is singular."""
    sign, value = np.linalg.slogdet(information)
    return float(value) if sign > 0 else -np.inf


def check_independent(candidates: Candidates, fixed: Reals) -> None:
    """The target modes must be linearly independent at all candidates together.

    Raises
    ------
    FemtuneError : ``plan.dependent``, naming the modes that cannot be told apart, or that do not move there
    """
    Q = information_of(candidates.rows) + fixed
    names = candidates.names or tuple(str(j + 1) for j in range(len(Q)))
    still = np.flatnonzero(np.diag(Q) <= _STILL**2 * np.max(np.diag(Q)))
    if len(still):
        raise FemtuneError("plan.dependent/still", modes=", ".join(names[j] for j in still))
    scale = np.sqrt(np.maximum(np.diag(Q), 1e-300))
    values, vectors = np.linalg.eigh(Q / np.outer(scale, scale))
    if values[0] <= _SINGULAR * values[-1]:
        involved = np.flatnonzero(np.abs(vectors[:, 0]) > 0.1)
        raise FemtuneError("plan.dependent", modes=", ".join(names[j] for j in involved))


def set_independence(rows: Reals, information: Reals) -> Reals:
    """(s,) share of each sensor, rows (s, d, m), in the information of a set that it is part of.

    E = 1 − det(1 − Φ_sQ⁻¹Φ_sᵀ): the part of det Q that is lost without it; for one direction that is φQ⁻¹φᵀ.
    """
    return np.asarray(1.0 - _determinants(np.eye(rows.shape[1]) - _shares(rows, information)))


def eliminate(
    candidates: Candidates, count: int, placed: tuple[Placed, ...] = (), threshold: float = 0.0
) -> ChosenSensors:
    """Remove the candidate with the least share until `count` are left.

    The shares are updated after each removal by a matrix of rank d, so that a removal costs as much as one product of
    all rows with d vectors. Candidates that repeat the output of a placed sensor, or of another candidate with a larger
    share, are left out before.

    Parameters
    ----------
    placed : sensors that are there already, which stay
    threshold : as for `expand`

    Raises
    ------
    FemtuneError : ``plan.dependent``, and ``plan.dependent/elimination`` where no sensor could be removed without the
        loss of a target mode
    """
    fixed = _fixed(candidates, placed)
    check_independent(candidates, fixed)
    rows, left = candidates.rows, _distinct(candidates, fixed, placed, threshold)
    rejected = len(candidates) - len(left)
    while len(left) > count:
        left = left[_pruned(rows[left], count, fixed)]
    order = np.argsort(-set_independence(rows[left], information_of(rows[left]) + fixed), kind="stable")
    return ChosenSensors(left[order], rejected)


def _fixed(candidates: Candidates, placed: tuple[Placed, ...]) -> Reals:
    return information_of(np.zeros((1, candidates.shapes.shape[-1])), *(p.rows for p in placed))


def _distinct(candidates: Candidates, fixed: Reals, placed: tuple[Placed, ...], threshold: float) -> Integers:
    """Candidates of which none repeats the output of another one, those with the largest shares first."""
    if threshold <= 0.0:
        return np.arange(len(candidates))
    size = np.sqrt(np.maximum(np.diag(information_of(candidates.shapes)), 1e-300))
    shapes = candidates.shapes / size
    open_ = np.ones(len(candidates), bool)
    for sensors in placed:
        for sensor in sensors.shapes:
            open_ &= unlike(shapes, sensor / size) >= threshold
    share = set_independence(candidates.rows, information_of(candidates.rows) + fixed)
    kept: list[int] = []
    while open_.any():
        best = int(np.argmax(np.where(open_, share, -np.inf)))
        kept.append(best)
        open_ &= unlike(shapes, shapes[best]) >= threshold
        open_[best] = False
    return np.array(sorted(kept), np.int64)


def _pruned(own: Reals, count: int, fixed: Reals) -> Flags:
    """Up to `_FRESH` removals from the candidates that are left, rows (s, d, m); True for those that stay."""
    s, d, m = own.shape
    inverse = _inverse(information_of(own) + fixed)
    flat = own.reshape(-1, m)
    B = _shares_by(own, inverse)
    kept = np.ones(s, bool)
    for _ in range(min(_FRESH, s - count)):
        rest = np.where(kept, _determinants(np.eye(d) - B), -1.0)
        worst = int(np.argmax(rest))
        if rest[worst] <= _LOST:
            raise FemtuneError("plan.dependent/elimination", left=int(kept.sum()), count=count)
        kept[worst] = False
        X = inverse @ own[worst].T
        half = X @ np.linalg.cholesky(np.linalg.inv(np.eye(d) - B[worst]))
        inverse = inverse + half @ half.T
        seen = (flat @ half).reshape(s, d, d)
        B = B + _outer(seen)
    return kept


def _outer(seen: Reals) -> Reals:
    """(s, d, d) products of each matrix with its transpose."""
    return np.asarray(seen * seen if seen.shape[1] == 1 else np.einsum("sik,sjk->sij", seen, seen))


def expand(
    candidates: Candidates,
    count: int,
    placed: tuple[Placed, ...] = (),
    threshold: float = 0.0,
    *,
    exchange: bool = True,
    objective: Objective | None = None,
) -> ChosenSensors:
    """Add `count` candidates one by one, each the one that increases det Q most.

    After each placement the candidates are left out whose output Gramian repeats that of the new sensor, see
    `unlike`. Fewer than `count` are placed where none is left. At the end placed sensors are exchanged for other
    candidates as long as that increases det Q (Fedorov's exchange).

    Parameters
    ----------
    placed : sensors that are there already, which also reject candidates
    threshold : T_s, least part of the output of a candidate that no single placed sensor reproduces; 0 rejects none
    exchange : False for the plain expansion of a set
    objective : another one in place of det Q

    Raises
    ------
    FemtuneError : ``plan.dependent``
    """
    fixed = _fixed(candidates, placed)
    check_independent(candidates, fixed)
    search = _Search(candidates, objective or _Independence(candidates, fixed), placed, threshold)
    while len(search.chosen) < count and search.open.any():
        search.add()
    exchanges = search.exchange() if exchange else 0
    rejected = int((search.blocked > 0).sum()) - len(search.chosen)
    return ChosenSensors(np.array(search.chosen, np.int64), rejected, exchanges)


def best_of(objective: Objective, candidates: int, count: int) -> Integers:
    """(count,) candidates with the largest score: added one by one, then exchanged one by one, in increasing order.

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.planning import SumObjective, best_of
    >>> one, two = np.diag([9.0, 0.0]), np.diag([0.0, 4.0])
    >>> best_of(SumObjective([np.array([one, one, two])], [np.zeros((2, 2))]), 3, 2)
    array([0, 2])
    """
    # candidates of which none repeats another
    search = _Search(Candidates(np.ones((candidates, 1, 1))), objective, (), 0.0)
    while len(search.chosen) < min(count, candidates):
        search.add()
    search.exchange()
    return np.array(sorted(search.chosen), np.int64)


class Objective(Protocol):
    """Objective for which a set of sensors is chosen."""

    def scores(self, chosen: Sequence[int]) -> Reals:
        """(s,) score of the chosen candidates with each candidate added, on a logarithmic or another fixed scale."""
        ...


class _Independence:
    """log det Q."""

    def __init__(self, candidates: Candidates, fixed: Reals) -> None:
        # modes of any scale count alike while the set does not determine them all
        scale = np.sqrt(np.maximum(np.diag(fixed + information_of(candidates.rows)), 1e-300))
        self._rows = candidates.rows / scale
        self._fixed = fixed / np.outer(scale, scale) + _START * np.eye(len(scale))

    def scores(self, chosen: Sequence[int]) -> Reals:
        Q = self._fixed + information_of(self._rows[list(chosen)])
        gains = _determinants(np.eye(self._rows.shape[1]) + _shares(self._rows, Q))
        return np.asarray(log_det(Q) + np.log(np.maximum(gains, 1e-300)))


class _Search:
    """A set that grows; `blocked` counts for each candidate the placed sensors that exclude it."""

    def __init__(
        self, candidates: Candidates, objective: Objective, placed: tuple[Placed, ...], threshold: float
    ) -> None:
        self._objective, self._threshold = objective, threshold
        size = np.sqrt(np.maximum(np.diag(information_of(candidates.shapes)), 1e-300))
        self._shapes = candidates.shapes / size
        self.chosen: list[int] = []
        self.blocked = np.zeros(len(candidates), np.int64)
        for sensors in placed:
            for sensor in sensors.shapes:
                self.blocked += self._alike(sensor / size)

    @property
    def open(self) -> Flags:
        """Candidates that may be placed."""
        return np.asarray(self.blocked == 0)

    def _alike(self, sensor: Reals) -> Flags:
        if self._threshold <= 0.0:
            return np.zeros(len(self._shapes), bool)
        return unlike(self._shapes, sensor) < self._threshold

    def _excluded_by(self, i: int) -> NDArray[np.int64]:
        out = self._alike(self._shapes[i])
        out[i] = True
        return out.astype(np.int64)

    def add(self) -> None:
        """Place the best candidate."""
        best = int(np.argmax(np.where(self.open, self._objective.scores(self.chosen), -np.inf)))
        self.chosen.append(best)
        self.blocked += self._excluded_by(best)

    def exchange(self) -> int:
        """Exchange sensors one by one while the score grows; the number of exchanges."""
        exchanges = 0
        for _ in range(_MOST_ROUNDS):
            done = sum(self._exchange_one(place) for place in range(len(self.chosen)))
            exchanges += done
            if not done:
                break
        return exchanges

    def _exchange_one(self, place: int) -> bool:
        old = self.chosen[place]
        blocked = self.blocked - self._excluded_by(old)
        scores = self._objective.scores(self.chosen[:place] + self.chosen[place + 1 :])
        best = int(np.argmax(np.where(blocked == 0, scores, -np.inf)))
        if best == old or scores[best] <= scores[old] + _LEAST_IMPROVEMENT:
            return False
        self.chosen[place] = best
        self.blocked = blocked + self._excluded_by(best)
        return True


# ----------------------------------------------------------------------------------------------------
# Small matrices, one a sensor.


def _inverse(Q: Reals) -> Reals:
    """Q⁻¹ by its Cholesky factor, with modes brought to one scale."""
    scale = 1.0 / np.sqrt(np.diag(Q))
    half = np.linalg.inv(np.linalg.cholesky(Q * np.outer(scale, scale))) * scale
    return np.asarray(half.T @ half)


def _shares(rows: Reals, Q: Reals) -> Reals:
    return _shares_by(rows, _inverse(Q))


def _shares_by(rows: Reals, inverse: Reals) -> Reals:
    """(s, d, d) Φ_sQ⁻¹Φ_sᵀ."""
    s, d, m = rows.shape
    turned = (rows.reshape(-1, m) @ inverse).reshape(s, d, m)
    return np.asarray(np.einsum("sim,sjm->sij", turned, rows))


def _determinants(A: Reals) -> Reals:
    """(s,) determinants of symmetric matrices (s, d, d)."""
    if A.shape[1] == 1:
        return np.asarray(A[:, 0, 0])
    if A.shape[1] != 3:
        return np.asarray(np.linalg.det(A))
    a, b, c, d, e, f = (A[:, i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)))
    return np.asarray(a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f))
