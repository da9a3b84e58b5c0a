"""Error estimates of the eigenvalues of a reduced model at any p, without a solution of the full model.

The Ritz pairs (λ, x = Vy) leave residuals r = K(p)x − λM(p)x. With the factors of the nominal A0 = K0 − σM0 the
vectors d = A0⁻¹r are nearly the errors of the shapes; one Rayleigh-Ritz step on [X, D] gives λ⁺ between the true
eigenvalue and λ. So λ − λ⁺ never exceeds the true error, and is smaller where A0 differs from A(p), for which the
estimate is multiplied by SAFETY. A mode of which the basis contains nothing can remain undetected: only a full solution
with its Sturm count certifies the error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import cast

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from femtune.arrays import Reals
from femtune.model.eigen.pencil import pieces
from femtune.model.linear.dense_products import in_any_order
from femtune.model.linear.sparse_products import LIBRARY_FROM, Product, column_major, product, row_major
from femtune.model.linear.symmetric import SymmetricMatrix
from femtune.model.reduce.function_estimate import FunctionsWanted, enlarged_modes, function_error, inertia_residual
from femtune.model.reduce.modes_in_basis import MASSLESS, elastic, reduced_modes
from femtune.model.reduce.reduced_model import ReducedModel
from femtune.model.solvers.factorise import factorise
from femtune.model.solvers.interface import Factor

ABOVE = 0.25
"""Ritz vectors above the wanted ones, as a fraction of their number: one whose improved eigenvalue falls among the
wanted ones shows a mode that the basis misses."""
SAFETY = 2.0
"""Factor of the estimate: the step with the nominal factors finds only a part of the error."""
AS_FREQUENCY = 0.02
"""Relative frequency error that an error of 1 in the logarithm of FRFs counts as."""
_DEPENDENT = 1e-10
"""Eigenvalue of the mass of unit corrections, relative to the largest, below which they are linearly dependent."""
_ROUNDING = 1e-12
"""Norm of a correction relative to that of the largest Ritz vector below which it is rounding."""


@dataclass(frozen=True, eq=False)
class ErrorEstimate:
    """Estimated errors at one point.

    Parameters
    ----------
    eigenvalues : (m,) of the reduced model
    improved : (m,) λ⁺, upper bounds of the true ones
    frequency_error : (m,) estimated relative errors of the frequencies; 0 for rigid-body modes
    function_error : estimated root mean square of |ln(H/H_reduced)| of the wanted FRFs; 0 where none are wanted
    """

    x: Reals
    eigenvalues: Reals
    improved: Reals
    frequency_error: Reals
    function_error: float = 0.0

    @property
    def worst(self) -> float:
        """The largest of the estimated relative frequency errors, and what the error of FRFs counts as one."""
        return max(float(self.frequency_error.max(initial=0.0)), AS_FREQUENCY * self.function_error)


@dataclass(frozen=True, eq=False)
class ErrorEstimator:
    """Error estimates of the `count` lowest modes, and of FRFs where some are wanted.

    Parameters
    ----------
    metric : A0 = K0 − σM0 of the nominal model
    known : its factors, if they exist already; otherwise they are computed when they are needed
    """

    metric: SymmetricMatrix = field(repr=False)
    count: int
    functions: tuple[FunctionsWanted, ...] = ()
    known: Factor | None = field(default=None, repr=False)

    @cached_property
    def factor(self) -> Factor:
        """Factors of A0."""
        return self.known or factorise(self.metric)

    def at(self, model: ReducedModel, basis: Reals, x: Reals) -> ErrorEstimate:
        """The estimate at one parameter vector; costs one block solve and two products with K and M."""
        if self.functions:
            return self._with_functions(model, basis, x)
        modes = reduced_modes(model.at(x), self.count)
        number = min(int((1.0 + ABOVE) * self.count), model.order)
        values, X = modes.eigenvalues[:number], basis @ modes.shapes[:, :number]
        point = model.configured.at(x)
        # the full matrix times rows is fastest for a few products; M has far fewer entries that are not zero
        K, M = point.stiffness, product(point.symmetric_mass)
        MX = M @ X
        D = row_major(self.factor.solve(column_major(K @ X - MX * values)))
        improved = _ritz(K, M, model.shift, values, X, MX, D)[: modes.wanted]
        eigenvalues = values[: modes.wanted]
        return ErrorEstimate(
            np.asarray(x, float), eigenvalues, improved, SAFETY * frequency_error(eigenvalues, improved)
        )

    def _with_functions(self, model: ReducedModel, basis: Reals, x: Reals) -> ErrorEstimate:
        """From the modes and FRFs on the basis and on its corrections together."""
        modes, point = reduced_modes(model.at(x), self.count), model.configured.at(x)
        number = min(int((1.0 + ABOVE) * self.count), len(modes.eigenvalues))
        X = basis @ modes.shapes[:, :number]
        inertia = point.mass @ X
        left = [point.stiffness @ X - inertia * modes.eigenvalues[:number]]
        left += [inertia_residual(point, modes, basis, X, inertia, one) for one in self.functions]
        forces, moved = np.hstack(left), [modes.shapes[:, :number], *(one.on(basis).inputs for one in self.functions)]
        sizes = np.linalg.norm(np.hstack(moved), axis=0)
        corrections = self.factor.solve(column_major(forces))
        better, more = enlarged_modes(model, basis, x, corrections, forces, sizes, self.count)
        whole = np.hstack([basis, more])
        error = max(function_error(one, modes, one.on(basis), better, one.on(whole)) for one in self.functions)
        eigenvalues, improved = modes.eigenvalues[: modes.wanted], better.eigenvalues[: modes.wanted]
        errors = SAFETY * frequency_error(eigenvalues, improved)
        return ErrorEstimate(np.asarray(x, float), eigenvalues, improved, errors, SAFETY * error)


def frequency_error(eigenvalues: Reals, better: Reals) -> Reals:
    """(m,) relative errors √(λ/λ⁺) − 1 of frequencies in sorted order; 0 for rigid-body modes."""
    flexible = elastic(better)
    error = np.zeros(len(eigenvalues))
    error[flexible] = np.sqrt(np.maximum(eigenvalues[flexible], 0.0) / better[flexible]) - 1.0
    return error


def certified_error(model: ReducedModel, x: Reals, eigenvalues: Reals) -> Reals:
    """(m,) relative frequency errors at a point where the full model was solved; `eigenvalues` (m,) are its own."""
    reduced = reduced_modes(model.at(x), len(eigenvalues)).eigenvalues[: len(eigenvalues)]
    return np.abs(frequency_error(reduced, eigenvalues[: len(reduced)]))


def _ritz(K: sp.csr_array, M: Product, shift: float, values: Reals, X: Reals, MX: Reals, D: Reals) -> Reals:
    """Eigenvalues on [X, D] of Ritz pairs (λ, X); D is freed of X, of rounding, and of what is linearly dependent.

    They are those of θ = 1/(λ − σ), with the mass as a quotient of the positive definite K − σM: the corrections may
    be motions without mass, whose θ is zero.
    """
    D -= X @ (MX.T @ D)
    size = np.sqrt(np.einsum("ij,ij->j", D, D))
    # on a basis of all motions the corrections are rounding only, and would be parallel to X once they are scaled
    some = size > _ROUNDING * np.sqrt(np.einsum("ij,ij->j", X, X)).max(initial=0.0)
    D = D[:, some] / size[some]
    KD, MD = K @ D, M @ D
    coupling = X.T @ KD, X.T @ MD
    dd = D.T @ KD, D.T @ MD
    energy = dd[0] - shift * dd[1]
    scale = 1.0 / np.sqrt(np.maximum(energy.diagonal(), np.finfo(float).tiny))
    dependence, Q = la.eigh(0.5 * scale[:, None] * (energy + energy.T) * scale)
    Q = scale[:, None] * Q[:, dependence > _DEPENDENT * dependence.max(initial=0.0)]
    corner = np.diag(values), np.eye(len(values))
    k, m = (np.block([[a, b @ Q], [(b @ Q).T, Q.T @ c @ Q]]) for a, b, c in zip(corner, coupling, dd))
    inverse = k - shift * m
    theta = la.eigvalsh(0.5 * (m + m.T), 0.5 * (inverse + inverse.T))[::-1]
    return np.asarray(shift + 1.0 / theta[theta > MASSLESS * theta[0]])


# ----------------------------------------------------------------------------------------------------
# Bases of reduced models: vectors made orthonormal in the energy of the nominal model, without negligible ones.


NEGLIGIBLE = 2e-3
"""Singular value below which a direction is left out: the part of a unit vector that the basis misses, in energy.

The relative error of an eigenvalue is of the size of its square.
"""
DEPENDENT = 1e-9
"""Singular value of unit vectors below which they are linearly dependent: rounding of their products is some 1e-16, and
a singular value is the root of it."""


def extend(
    basis: Reals,
    vectors: Reals,
    metric: SymmetricMatrix,
    negligible: float = NEGLIGIBLE,
    energy: Reals | None = None,
) -> Reals:
    """The basis with the directions of `vectors` that it misses.

    Each vector is given unit energy vᵀAv = 1 first; what is left of them outside the basis is orthonormalised by its
    singular values, those below `negligible` dropped. Columns of the basis are not touched.

    Parameters
    ----------
    basis : (n, r), BᵀAB = 1
    vectors : (n, m)
    metric : A, positive definite, of the nominal model: K − σM with σ below the spectrum
    energy : (m,) energies of the motions of which the vectors are parts, to which they are scaled; their own without it
    """
    return extend_by(basis, [(vectors, negligible, energy)], metric)


def extend_by(basis: Reals, groups: Sequence[tuple[Reals, float, Reals | None]], metric: SymmetricMatrix) -> Reals:
    """As `extend`, by several groups of vectors, each with its limit and energies; one new array is made."""
    times = product(metric) if len(metric.indices) >= LIBRARY_FROM else metric
    parts = [basis]
    for vectors, negligible, given in groups:
        energy = _energies(vectors, times) if given is None and vectors.shape[1] else given
        some = np.zeros(0, bool) if energy is None else energy > 0.0
        if not some.any():
            continue
        W = vectors[:, some] / np.sqrt(cast(Reals, energy)[some])
        # the second pass removes what rounding left of the first; orthonormal to rounding in the end
        for limit in (negligible, 0.5):
            for part in pieces(0, W.shape[1]):
                driven = times @ W[:, part]
                for block in parts:
                    W[:, part] -= in_any_order(block, in_any_order(block.T, driven))
            W = _orthonormal(W, times, limit)
        parts.append(W)
    return np.ascontiguousarray(np.hstack(parts)) if sum(p.shape[1] for p in parts[1:]) else basis


def _energies(vectors: Reals, metric: SymmetricMatrix | Product) -> Reals:
    """(m,) vᵀAv, some columns at a time."""
    parts = (vectors[:, part] for part in pieces(0, vectors.shape[1]))
    return np.concatenate([np.einsum("ij,ij->j", some, metric @ some) for some in parts])


def orthonormal(vectors: Reals, metric: SymmetricMatrix) -> Reals:
    """An orthonormal basis of all that `vectors` span, only linear dependence left out."""
    return extend(np.zeros((len(vectors), 0)), vectors, metric, DEPENDENT)


def _orthonormal(W: Reals, metric: SymmetricMatrix | Product, limit: float) -> Reals:
    gram = np.empty((W.shape[1], W.shape[1]))
    for part in pieces(0, len(gram)):
        gram[:, part] = in_any_order(W.T, metric @ W[:, part])
    values, Q = la.eigh(0.5 * (gram + gram.T))
    keep = values > max(limit, DEPENDENT) ** 2
    # largest first, so that a basis that is cut has the best of them
    return in_any_order(W, np.ascontiguousarray((Q[:, keep] / np.sqrt(values[keep]))[:, ::-1]))
