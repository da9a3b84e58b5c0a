"""The certificate of a live model: its frequencies, MACs and χ² beside those of another model at some points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from femtune.errors import FemtuneError
from femtune.modal.assignment import linear_sum_assignment
from femtune.model import SubspaceDerivative
from femtune.model.live.matrices import solved
from femtune.model.reduce import reduced_modes
from femtune.residuals.aligned import align
from femtune.steps.live.record import LiveCertificate

if TYPE_CHECKING:
    from femtune.arrays import Integers, Reals
    from femtune.model import ConfiguredModel, EigenSolution
    from femtune.model.live import LiveModel, LiveModes
    from femtune.model.reduce import ReducedModel
    from femtune.residuals import CaseState
    from femtune.residuals.case import Group
    from femtune.steps.live.residuals import PagePart

ABOVE = 4
"""Modes above those of the page that the other model is solved for: one of them may be the partner of the last."""
_ELASTIC = 1e-6
"""Eigenvalue over the largest one from which a mode is elastic."""
_CLOSE = 1e-3
"""Relative difference of the frequencies of modes that are compared as one subspace."""
_UNSEEN = 1e-6
"""Part of a motion in a subspace below which it is another motion."""
MOST_ERROR = 1e9
"""What counts as the error, in %, where one of both models has modes that the other one has not."""


@dataclass(frozen=True, eq=False)
class OtherModes:
    """Modes of another model at a point.

    Parameters
    ----------
    eigenvalues : (m,) ascending
    seen : (s, m) motion of the sensors
    overlap : of live shapes (q, l): (m, l) φᵀMVy
    """

    eigenvalues: Reals
    seen: Reals = field(repr=False)
    overlap: Callable[[Reals], Reals] = field(repr=False)


@dataclass(frozen=True, eq=False)
class FirstModel:
    """The model that the live one is made of.

    Parameters
    ----------
    rows : (s, r) motion of the sensors in its coordinates
    vectors : (r, q) basis of the live model
    """

    kind: Literal["full model", "reduced model"]
    model: ReducedModel
    rows: Reals = field(repr=False)
    vectors: Reals = field(repr=False)

    @property
    def order(self) -> int:
        """Of its matrices."""
        return self.model.order

    def modes(self, x: Reals, count: int) -> OtherModes | None:
        """The lowest modes; None where it has none."""
        try:
            modes = reduced_modes(self.model.at(x), count)
        except FemtuneError:
            return None
        shapes = modes.shapes[:, :count]
        left = shapes.T @ modes.point.mass @ self.vectors
        return OtherModes(modes.eigenvalues[:count], self.rows @ shapes, lambda y: np.asarray(left @ y))


@dataclass(frozen=True, eq=False)
class FullModel:
    """The full model, solved at each point.

    Parameters
    ----------
    vectors : (n, q) basis of the live model
    told : called before each solution
    least : modes that are solved for at least
    also : called with the parameters and the solution at each point
    """

    state: CaseState
    configured: ConfiguredModel
    vectors: Reals = field(repr=False)
    told: Callable[[], None] = field(repr=False)
    least: int = 0
    also: Callable[[Reals, EigenSolution], None] | None = field(default=None, repr=False)
    kind: Literal["full model", "reduced model"] = "full model"

    @property
    def order(self) -> int:
        """Degrees of freedom."""
        return self.configured.n_free

    def modes(self, x: Reals, count: int) -> OtherModes | None:
        """The lowest modes; None where it has none."""
        self.told()
        case, point = self.state.case.on_full_model, self.configured.at(x)
        try:
            solution = case.solver.modes(point, max(count, self.least), None)
        except FemtuneError:
            return None
        if self.also is not None:
            self.also(x, solution)
        shapes, mass = solution.shapes, point.symmetric_mass
        return OtherModes(
            solution.eigenvalues, np.asarray(case.sensors @ shapes),
            lambda y: np.asarray(shapes.T @ (mass @ (self.vectors @ y))),
        )  # fmt: skip


def frequency_error(values: Reals, other: Reals) -> float:
    """Largest relative error of the frequencies of elastic modes; infinite where some of them are missing."""
    count = min(len(values), len(other))
    some = other[:count] > _ELASTIC * other[:count].max(initial=0.0)
    if len(values) < len(other):
        return np.inf
    ratio = np.sqrt(np.maximum(values[:count][some], 0.0) / other[:count][some])
    return float(np.abs(ratio - 1.0).max(initial=0.0))


def elastic_groups(state: CaseState, live: LiveModel) -> list[Group]:
    """Groups of paired modes without those of rigid-body modes, whose frequencies are rounding."""
    return [(tests, models) for tests, models in state.groups if min(models) >= live.rigid]


_Motions = dict[int, tuple[float, "Reals"]]
"""Eigenvalue and motion of the sensors by the position of a mode at the updated point."""


@dataclass(frozen=True, eq=False)
class CertifiedLive:
    """A live model that is held against others.

    Parameters
    ----------
    sensors : (s, q) motion of the sensors in its coordinates
    parts : residuals that the page computes
    """

    live: LiveModel
    sensors: Reals = field(repr=False)
    state: CaseState
    parts: Sequence[PagePart]

    def beside(
        self, other: FirstModel | FullModel, points: Reals, corners: int
    ) -> tuple[LiveCertificate | None, Reals]:
        """The certificate, None without points, and the errors of the frequencies (n,); −1 without modes in both.

        Parameters
        ----------
        points : (n, k)
        corners : how many of them are corners of the ranges of the parameters
        """
        found = [self._at(x, other.modes(x, self.live.count + ABOVE)) for x in points]
        known = [one for one in found if one is not None]
        errors = np.array([-1.0 if one is None else 100.0 * one.frequency for one in found])
        if not len(points):
            return None, errors
        macs = [m for one in known for m in one.macs]
        squares = [one.chi_square for one in known if one.chi_square is not None]
        return LiveCertificate(
            compared_with=other.kind, compared_order=other.order, points=len(points), corners=corners,
            without_modes=len(points) - len(known), frequency_percent=min(float(max(errors.max(), 0.0)), MOST_ERROR),
            mac=max(macs, default=None), mac_pairs=len(macs),
            chi_square_percent=min(100.0 * max(squares), MOST_ERROR) if squares else None,
        ), errors  # fmt: skip

    def _at(self, x: Reals, other: OtherModes | None) -> _Compared | None:
        modes, count = solved(self.live, x), self.live.count
        if other is None or self._mechanism(other.eigenvalues):
            # the page has none there either, or it shows something that does not exist
            return None if modes is None else _Compared(np.inf, [], None)
        if modes is None:
            return _Compared(np.inf, [], None)
        error = frequency_error(modes.eigenvalues, other.eigenvalues[:count])
        if not np.isfinite(error):
            return _Compared(error, [], None)
        become = self._become(modes)
        seen = self.sensors @ modes.shapes
        own = {old: (float(modes.eigenvalues[j]), seen[:, j]) for old, j in become.items()}
        partners = _counterparts(modes, other, become)
        return _Compared(error, self._mac_errors(own, partners), self._square_error(own, partners))

    def _mechanism(self, eigenvalues: Reals) -> bool:
        return self.live.still(eigenvalues) > self.live.rigid

    def _mac_errors(self, own: _Motions, other: _Motions) -> list[float]:
        """Difference of the MAC of every pair, of close modes that of the subspace."""
        if len(self.sensors) < 2:
            return []
        return [
            abs(_subspace_mac([own[j][1] for j in models], test) - _subspace_mac([other[j][1] for j in models], test))
            for tests, models in elastic_groups(self.state, self.live)
            for test in self.state.case.test.shapes[:, list(tests)].T
        ]

    def _square_error(self, own: _Motions, other: _Motions) -> float | None:
        if not self.parts:
            return None
        mine, right = self._squares(own), self._squares(other)
        return abs(mine - right) / max(right, 1.0)

    def _become(self, modes: LiveModes) -> dict[int, int]:
        """Positions of the modes that those of the update which are compared have become."""
        old = list(dict.fromkeys(j for _, models in elastic_groups(self.state, self.live) for j in models))
        if not old:
            return {}
        overlap = (modes.mass[old] @ modes.shapes) / np.sqrt(self.live.theta[old, None])
        return dict(zip(old, linear_sum_assignment(-(overlap**2))[1].tolist()))

    def chi_square(self, modes: LiveModes) -> float:
        """Sum of squares of the parts, without the error that all frequencies share."""
        seen = self.sensors @ modes.shapes
        return self._squares({o: (float(modes.eigenvalues[j]), seen[:, j]) for o, j in self._become(modes).items()})

    def _squares(self, motions: _Motions) -> float:
        test, total = self.state.case.test, 0.0
        paired: _Motions = {}
        for tests, models in elastic_groups(self.state, self.live):
            values, shapes = np.array([motions[j][0] for j in models]), np.column_stack([motions[j][1] for j in models])
            none = np.zeros((0, len(models), len(models)))
            subspace = SubspaceDerivative(values, none, none, np.zeros((*shapes.shape, 0)), shapes, 0.0)
            aligned = align(subspace, test.shapes[:, list(tests)])
            paired |= {i: (float(aligned.eigenvalues[k]), aligned.shapes[:, k]) for k, i in enumerate(tests)}
        for part in self.parts:
            eigenvalue, shape = paired[part.test]
            values = part.values(eigenvalue, shape, float(test.freq_hz[part.test]), test.shapes[:, part.test])
            total += float(values @ values)
        return total


@dataclass(frozen=True, eq=False)
class _Compared:
    """Errors at one point."""

    frequency: float
    macs: list[float]
    chi_square: float | None


def _counterparts(modes: LiveModes, other: OtherModes, become: dict[int, int]) -> _Motions:
    """What the other model has of the live modes: the mode that overlaps most, of close modes their subspace."""
    overlap = other.overlap(modes.shapes)
    partner: Integers = np.asarray(linear_sum_assignment(-(overlap.T**2))[1])
    roots = np.sqrt(np.maximum(other.eigenvalues, 0.0))
    out: _Motions = {}
    for old, j in become.items():
        close = np.abs(roots - roots[partner[j]]) <= _CLOSE * roots[partner[j]]
        part = np.where(close, overlap[:, j], 0.0)
        if np.linalg.norm(part) < _UNSEEN:
            part = np.eye(len(roots))[partner[j]]
        part = part / np.linalg.norm(part)
        out[old] = float(part**2 @ other.eigenvalues), other.seen @ part
    return out


def _subspace_mac(shapes: Sequence[Reals], test: Reals) -> float:
    """Part of a test shape in the span of some model shapes, over the entries that the test has."""
    known = ~np.isnan(test)
    A, b = np.column_stack(shapes)[known], test[known]
    size = np.linalg.norm(A, axis=0)
    if not b.any() or not size.all():
        return 0.0
    unit = A / size
    inside = unit @ np.linalg.lstsq(unit, b, rcond=1e-9)[0]
    return float(inside @ inside / (b @ b))
