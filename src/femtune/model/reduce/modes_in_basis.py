"""Modes of a reduced model and their derivatives, exact within its basis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.model.derivatives.modes import SubspaceDerivative
from femtune.model.eigen.default_count import ELASTIC_MODES, MOST_MODES
from femtune.model.reduce.reduced_model import ReducedPoint

RIGID = 1e-6
"""λ below this fraction of the highest wanted one belong to rigid-body modes: a thousandth in frequency."""
_REPEATED = 1e-9
"""|1 − (λ_j − σ)θ| below which two modes cross exactly: their quotient would have no digits."""
MASSLESS = 1e-14
"""θ below this fraction of the largest are motions without mass: rounding of the largest is 1e-16."""
_RIGID_MOTIONS = 6
"""Rigid-body modes of a free structure."""


@dataclass(frozen=True, eq=False)
class ReducedModes:
    """All modes of a reduced model at one point.

    Parameters
    ----------
    eigenvalues : (f,) λ = ω² ascending, none below that of the full model in the same place
    shapes : (r, f) in the coordinates of the basis, yᵀMy = 1; V @ shapes are the shapes of the model
    wanted : number of modes that were requested
    theta, vectors : (r,) θ = 1/(λ − σ), and (r, r) vectors with zᵀ(K − σM)z = 1; motions without mass have θ = 0
    """

    point: ReducedPoint = field(repr=False)
    eigenvalues: Reals
    shapes: Reals = field(repr=False)
    wanted: int
    theta: Reals = field(repr=False)
    vectors: Reals = field(repr=False)

    @property
    def freq_hz(self) -> Reals:
        """Natural frequencies of the wanted modes."""
        return np.sqrt(np.maximum(self.eigenvalues[: self.wanted], 0.0)) / (2.0 * np.pi)

    @property
    def seen(self) -> Reals:
        """(s, wanted) shapes at the rows of the reduced model."""
        return self.point.model.rows @ self.shapes[:, : self.wanted]


def reduced_modes(point: ReducedPoint, count: int | None = None, max_hz: float | None = None) -> ReducedModes:
    """Modes by a dense solution: the `count` lowest or those up to `max_hz`.

    Their number without either, and with both, is that of `solve_modes`.

    Raises
    ------
    FemtuneError : ``reduce.indefinite``
    """
    shift = point.model.shift
    try:
        theta, vectors = la.eigh(point.mass, point.stiffness - shift * point.mass, driver="gvd")
    except la.LinAlgError as error:
        raise _indefinite(point) from error
    theta, vectors = theta[::-1], vectors[:, ::-1]
    finite = int(np.sum(theta > MASSLESS * theta[0]))
    values, shapes = shift + 1.0 / theta[:finite], vectors[:, :finite] / np.sqrt(theta[:finite])
    return ReducedModes(point, values, shapes, min(wanted_number(values, count, max_hz), finite), theta, vectors)


def wanted_number(values: Reals, count: int | None, max_hz: float | None) -> int:
    """The number of modes that are requested, of those with the eigenvalues (f,); see `reduced_modes`."""
    if max_hz is None and count is not None:
        return count
    below = 1 if max_hz is None else max(int(np.sum(values <= (2.0 * np.pi * max_hz) ** 2)), 1)
    if max_hz is not None and count is None:
        return below
    least = count or ELASTIC_MODES
    least += int((~elastic(values[: least + _RIGID_MOTIONS])).sum())
    return max(least, min(below, MOST_MODES))


def _indefinite(point: ReducedPoint) -> FemtuneError:
    return FemtuneError(
        "reduce.indefinite",
        values={"parameters x": ", ".join(f"{v.real:.4g}" for v in point.x)},
        configuration=point.model.configuration.name,
    )


def elastic(eigenvalues: Reals) -> NDArray[np.bool_]:
    """True for elastic modes, relative to the highest of the given eigenvalues."""
    return np.asarray(eigenvalues > RIGID * eigenvalues.max(initial=0.0))


def reduced_derivative(modes: ReducedModes, members: Sequence[int], rows: NDArray | None = None) -> SubspaceDerivative:
    """Derivatives of the subspace of some modes, by superposition of all modes of the basis (Fox and Kapoor 1968).

    Parameters
    ----------
    members : positions of the cluster's modes
    rows : (s, r) what is seen in the coordinates of the basis; those of the reduced model where None
    """
    members = list(members)
    point, Z, phi = modes.point, modes.vectors, modes.shapes[:, members]
    K, M = (
        np.array([d @ phi for d in of]).reshape(-1, *phi.shape)
        for of in (point.stiffness_derivatives, point.mass_derivatives)
    )
    values = modes.eigenvalues[members]
    parts = -(Z.T @ (K - values * M)) * _inverse_gap(modes, members)
    C = point.model.rows if rows is None else rows
    outside = np.einsum("sr,prc->scp", np.asarray(C @ Z), parts, optimize=True)
    return SubspaceDerivative(values, phi.T @ K, phi.T @ M, outside, np.asarray(C @ phi))


def _inverse_gap(modes: ReducedModes, members: list[int]) -> Reals:
    """(r, c) 1/zᵀ(K − λ_jM)z = 1/(1 − (λ_j − σ)θ), zero for members of the cluster and for exact crossings."""
    gap = 1.0 - np.outer(modes.theta, modes.eigenvalues[members] - modes.point.model.shift)
    apart = np.abs(gap) > _REPEATED
    apart[members] = False
    return np.divide(1.0, gap, out=np.zeros_like(gap), where=apart)
