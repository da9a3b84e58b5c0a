"""Mass and inertia residuals: measured mass, centre of gravity and moments of inertia."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.model.response import mass_response
from femtune.residuals.asked import Asked
from femtune.residuals.case import CaseState, Residual
from femtune.residuals.weights import ResidualBlock, Weights

_AXES = "xyz"


@dataclass(frozen=True, eq=False)
class MassResidual(Residual):
    """m(x) − m_e of all that is active in the configuration; `weights` in the unit of mass."""

    mass: float
    weights: Weights
    key = "mass"
    label = "mass"

    @classmethod
    def of_study(cls, asked: Asked) -> MassResidual:
        """See `Residual`."""
        return cls(asked.entry.mass, Weights(asked.entry.sd * asked.entry.mass))

    def __post_init__(self) -> None:
        if not (np.isfinite(self.mass) and self.mass > 0.0):
            raise _bad("the measured mass", self.mass, "above zero")

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """One value."""
        response = mass_response(state.full)
        errors, slopes = (
            np.array([response.properties.mass - self.mass]),
            _wanted(response.mass[None, :], derivatives),
        )
        return [self.weighted(state.case.name, "total", errors, slopes, self.weights, self.mass)]


@dataclass(frozen=True, eq=False)
class CentreResidual(Residual):
    """Centre of gravity, in the basic frame; NaN coordinates were not measured.

    `weights` are of the coordinates that were, in the unit of length.
    """

    centre: Reals
    weights: Weights
    key = "centre-of-gravity"
    label = "centre of gravity"

    @classmethod
    def of_study(cls, asked: Asked) -> CentreResidual:
        """See `Residual` (error ``residual.mass-data``)."""
        entry = asked.entry
        return cls(np.array(_numbers([entry.x, entry.y, entry.z])), Weights(entry.sd))

    def __post_init__(self) -> None:
        if np.shape(self.centre) != (3,) or np.isnan(self.centre).all() or np.isinf(self.centre).any():
            raise _bad(
                "the centre of gravity", self.centre, "a set of three coordinates of which at least one was measured"
            )
        self.weights.check_size(int(np.sum(~np.isnan(self.centre))), "coordinates of the centre of gravity")

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """One value per coordinate, its error relative to the size of the model."""
        response, known = mass_response(state.full), np.flatnonzero(~np.isnan(self.centre))
        errors = (response.properties.centre - self.centre)[known]
        xyz = state.full.configured.model.structure.nodes.xyz
        size = float(np.linalg.norm(np.ptp(xyz, axis=0))) if len(xyz) else 1.0
        label = ", ".join(_AXES[i] for i in known)
        slopes = _wanted(response.centre[known], derivatives)
        return [self.weighted(state.case.name, label, errors, slopes, self.weights, size)]


@dataclass(frozen=True, eq=False)
class InertiaResidual(Residual):
    """Entries of the inertia tensor about a point, basic frame; NaN entries were not measured.

    Parameters
    ----------
    inertia : (3, 3) symmetric
    about : (3,) the point
    weights : of the measured entries xx, xy, xz, yy, yz, zz, in the unit of inertia
    """

    inertia: Reals
    about: ArrayLike
    weights: Weights
    key = "inertia"
    label = "inertia"

    @classmethod
    def of_study(cls, asked: Asked) -> InertiaResidual:
        """See `Residual` (error ``residual.mass-data``)."""
        e = asked.entry
        rows = ([e.ixx, e.ixy, e.ixz], [e.ixy, e.iyy, e.iyz], [e.ixz, e.iyz, e.izz])
        matrix = np.array([_numbers(row) for row in rows])
        size = float(np.nanmax(np.abs(matrix), initial=0.0)) or 1.0
        return cls(matrix, e.about, Weights(e.sd * size))

    def __post_init__(self) -> None:
        values = np.asarray(self.inertia, dtype=float)
        if values.shape != (3, 3) or not np.array_equal(values, values.T, equal_nan=True) or np.isinf(values).any():
            raise _bad("the inertia tensor", values.tolist(), "a symmetric (3, 3) matrix")
        if not np.nan_to_num(values).any():
            raise _bad(
                "the inertia tensor", values.tolist(), "a matrix with at least one measured entry other than zero"
            )
        self.weights.check_size(len(self._known), "entries of the inertia tensor")

    @property
    def _known(self) -> list[tuple[int, int]]:
        return [(i, j) for i in range(3) for j in range(i, 3) if not np.isnan(self.inertia[i, j])]

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """One value per entry, its error relative to the largest measured entry."""
        response, known = mass_response(state.full, self.about), self._known
        rows, columns = (list(part) for part in zip(*known))
        errors = (response.properties.inertia - self.inertia)[rows, columns]
        label = ", ".join(f"I{_AXES[i]}{_AXES[j]}" for i, j in known)
        size = float(np.nanmax(np.abs(self.inertia)))
        slopes = _wanted(response.inertia[rows, columns], derivatives)
        return [self.weighted(state.case.name, label, errors, slopes, self.weights, size)]


def _wanted(slopes: Reals, derivatives: bool) -> Reals:
    return slopes if derivatives else np.zeros((len(slopes), 0))


def _numbers(values: Iterable[float | None]) -> list[float]:
    """NaN for what was not measured."""
    return [float("nan") if value is None else value for value in values]


def _bad(what: str, value: object, wanted: str) -> FemtuneError:
    return FemtuneError("residual.mass-data", values={"given": value}, quantity=what, requirement=wanted)
