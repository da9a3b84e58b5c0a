"""The live model: K(p) and M(p) of low order as deviations from the updated point, as a page stores and solves them.

In coordinates that diagonalise both at the updated point, K − σM = 1 + Σ f_j(p) K_j − σ Σ g_j(p) M_j and
M = Θ + Σ g_j(p) M_j with θ = 1/(λ − σ), which is zero for motions without mass. Functions f, g are Chebyshev
polynomials of one or two parameters, zero at the updated point. M_j is stored relative to √(θ_a θ_b), so that an entry
of 16 bits is as accurate for a high mode as for the first one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.fem.fields import MatrixKind
from femtune.model.live.chebyshev import ChebyshevFunctions, Separated
from femtune.model.reduce import ReducedModel
from femtune.model.reduce.modes_in_basis import MASSLESS

_STEPS = 32767
"""Steps of 16 bits on each side of zero."""
EXACT_BYTES = 1_400_000
"""Bytes of all matrices up to which they are stored in single precision: a page with 12 parameters stays below 8 MB.
The rounding to 16 bits has a relative error of frequencies of 0.01 to 0.3 %, however high the order."""
STILL = 1e-4
"""λ over |σ| below which a mode has no frequency: matrices in single precision leave it no digits. The updated point
has as many of these as it has rigid-body modes; elsewhere more of them are a mechanism."""
_STILL_WITH_MASS = 1e-6
"""The same with an added mass, which may be many times that of the structure."""
_SAME = 1e-11
"""Singular value of the functions of one group, each times the size of its matrix, relative to the largest one, below
which a combination of them is left out."""


@dataclass(frozen=True, eq=False)
class LiveTerm:
    """One matrix and what multiplies it.

    Parameters
    ----------
    kind : "stiffness" or "mass"
    function : one polynomial
    triangle : (q(q + 1)/2,) upper triangle by rows, int16 or float32
    scale : what its entries are multiplied by
    """

    kind: MatrixKind
    function: ChebyshevFunctions
    triangle: NDArray
    scale: float


_LEAST_MASS = 1e-6
"""θ relative to the largest one below which entries of masses are no more accurate."""


def mass_sizes(theta: Reals) -> Reals:
    """(q,) what rows and columns of the stored masses are relative to."""
    return np.sqrt(np.maximum(theta, _LEAST_MASS * theta.max()))


@dataclass(frozen=True, eq=False)
class LiveModes:
    """Modes of a live model at one point.

    Parameters
    ----------
    eigenvalues : (m,) λ ascending
    shapes : (q, m) in the coordinates of the model, yᵀMy = 1
    mass : (q, q) M, for tracking
    """

    eigenvalues: Reals
    shapes: Reals = field(repr=False)
    mass: Reals = field(repr=False)

    @property
    def freq_hz(self) -> Reals:
        """Natural frequencies."""
        return np.sqrt(np.maximum(self.eigenvalues, 0.0)) / (2.0 * np.pi)


@dataclass(frozen=True, eq=False)
class LiveModel:
    """K(p) and M(p) of order q.

    Parameters
    ----------
    at, lower, upper : (k,) updated point and bounds of the normalised parameters
    theta : (q,) 1/(λ − σ) of the updated point, descending; about 0 for motions without mass
    shift : σ < 0
    count : modes that are shown, the lowest ones
    """

    at: Reals
    lower: Reals
    upper: Reals
    theta: Reals
    shift: float
    count: int
    terms: tuple[LiveTerm, ...] = field(repr=False)

    @property
    def order(self) -> int:
        """q."""
        return len(self.theta)

    @cached_property
    def _triangle(self) -> tuple[NDArray, NDArray]:
        return np.triu_indices(self.order)

    @cached_property
    def _packed(self) -> Mapping[str, Reals]:
        """(m, q(q + 1)/2) of each kind in double precision."""
        out: dict[str, Reals] = {}
        for kind in ("stiffness", "mass"):
            some = [t.scale * t.triangle.astype(float) for t in self.terms if t.kind == kind]
            out[kind] = np.array(some).reshape(len(some), len(self._triangle[0]))
        return out

    def _deviation(self, kind: MatrixKind, x: NDArray) -> Reals:
        values = [t.function.at(x, self.lower, self.upper)[0] for t in self.terms if t.kind == kind]
        upper = np.zeros((self.order, self.order))
        upper[self._triangle] = np.array(values) @ self._packed[kind] if values else 0.0
        return upper + upper.T - np.diag(np.diag(upper))

    def matrices(self, x: NDArray, added: Reals | None = None) -> tuple[Reals, Reals]:
        """K − σM and M, each (q, q).

        Parameters
        ----------
        added : (d, q) rows that see the motion of an added mass, each times the root of the mass; none without it
        """
        size = mass_sizes(self.theta)
        moved = self._deviation("mass", x) * np.outer(size, size)
        if added is not None:
            moved = moved + added.T @ added
        A = np.eye(self.order) + self._deviation("stiffness", x) - self.shift * moved
        return A, np.diag(self.theta) + moved

    def modes(self, x: NDArray, added: Reals | None = None, count: int | None = None) -> LiveModes:
        """The lowest modes, as the page computes them.

        Parameters
        ----------
        added : as in `matrices`
        count : their number; None takes those that are shown

        Raises
        ------
        scipy.linalg.LinAlgError : where K − σM is not positive definite, or a motion has lost its stiffness
        """
        A, M = self.matrices(x, added)
        count = min(count or self.count, self.order)
        theta, z = la.eigh(M, A, subset_by_index=[self.order - count, self.order - 1])
        theta, z = theta[::-1], z[:, ::-1]
        finite = theta > MASSLESS * theta[0]
        theta, z = theta[finite], z[:, finite]
        values = self.shift + 1.0 / theta
        # a mass lowers eigenvalues without any loss of stiffness
        if self.still(values, STILL if added is None else _STILL_WITH_MASS) > self.rigid:
            raise la.LinAlgError("a motion has no stiffness")
        return LiveModes(values, z / np.sqrt(theta), M)

    def still(self, eigenvalues: Reals, size: float = STILL) -> int:
        """Number of eigenvalues that are zero to rounding: below `size` · |σ|."""
        return int(np.sum(eigenvalues < size * abs(self.shift)))

    @cached_property
    def rigid(self) -> int:
        """Rigid-body modes of the updated point."""
        return self.still(self.shift + 1.0 / self.theta[self.theta > MASSLESS * self.theta[0]])


def live_model(
    model: ReducedModel,
    basis: Reals,
    groups: Sequence[Separated],
    at: Reals,
    count: int,
    exact_bytes: int = EXACT_BYTES,
    box: tuple[Reals, Reals] | None = None,
) -> LiveModel:
    """The terms of a reduced model on a second basis, as deviations from the updated point.

    Parameters
    ----------
    basis : (r, q) in the coordinates of the model, which diagonalise K and M at `at`, yᵀ(K − σM)y = 1
    groups : the coefficients of stiffness and mass as polynomials
    exact_bytes : bytes of all matrices up to which they are stored in single precision, beyond that in 16 bits
    box : lower and upper ends (k,) of the domain of the polynomials; the bounds where None
    """
    theta = np.einsum("ri,ri->i", basis, model.at(at).mass @ basis)
    lower, upper = box or model.configured.model.parameters.bounds
    size, triangle = mass_sizes(theta), np.triu_indices(basis.shape[1])
    raw: list[tuple[MatrixKind, ChebyshevFunctions, Reals]] = []
    projected: dict[int, Reals] = {}
    for group in groups:
        scale = np.outer(size, size)[triangle] if group.kind == "mass" else 1.0
        rows = []
        for term, column in group.columns:
            if int(term) not in projected:
                projected[int(term)] = np.asarray(basis.T @ model.terms[int(term)] @ basis)
            rows.append(projected[int(term)][column][triangle] / scale)
        raw += [(group.kind, f, m) for f, m in _combined(group.functions, np.array(rows))]
    single = 4 * sum(len(m) for _, _, m in raw) <= exact_bytes
    terms = tuple(LiveTerm(kind, f, *_stored(m, single)) for kind, f, m in raw)
    return LiveModel(np.asarray(at), lower, upper, theta, model.shift, count, terms)


def _combined(functions: ChebyshevFunctions, rows: Reals) -> list[tuple[ChebyshevFunctions, Reals]]:
    """The fewest functions with their matrices: Σ f_j A_j by a singular value decomposition."""
    size = np.linalg.norm(rows, axis=1)
    kept = size > 0.0
    if not kept.any():
        return []
    rows, size = rows[kept] / size[kept, None], size[kept]
    shape = functions.coefficients.shape[1:]
    F = (functions.coefficients[kept].reshape(len(size), -1) * size[:, None]).T
    left, s, right = la.svd(F, full_matrices=False)
    some = s > _SAME * s.max(initial=0.0)
    combined, matrices = left[:, some] * s[some], right[some] @ rows
    return [
        (ChebyshevFunctions(functions.parameters, np.ascontiguousarray(f.reshape(1, *shape))), m)
        for f, m in zip(combined.T, matrices)
    ]


def _stored(matrix: Reals, single: bool) -> tuple[NDArray, float]:
    if single:
        return matrix.astype(np.float32), 1.0
    scale = float(np.abs(matrix).max()) / _STEPS or 1.0
    return np.round(matrix / scale).astype(np.int16), scale


def solved(model: LiveModel, x: NDArray) -> LiveModes | None:
    """The modes; None where they cannot be computed."""
    try:
        return model.modes(x)
    except (la.LinAlgError, FemtuneError):
        return None
