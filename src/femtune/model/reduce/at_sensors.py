"""Test-analysis models: mass and stiffness at the sensors of a test, by named reductions.

Sensors may be combinations of DOFs, q = C u. Where each row of C is one DOF the static and the improved reduction are
those of `guyan` and `irs`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.model.configured import ModelPoint
from femtune.model.eigen.solution import solve_modes
from femtune.model.solvers.factorise import factorise
from femtune.model.solvers.interface import SingularMatrixError

Method = Literal["guyan", "irs", "serep"]

_DEPENDENT = 1e-12
"""Eigenvalue of the flexibility at the sensors, scaled to unit diagonal and relative to the largest, below which a
sensor is a combination of others."""
_LOST = 1e-4
"""Relative residual of a solve for a random load above which the factors are lost to rounding: a motion is not held."""
_UNSEEN = 1e-8
"""Singular value of the shapes at the sensors, relative to the largest, below which modes cannot be told apart."""


@dataclass(frozen=True, eq=False)
class SensorModel:
    """A model of the sensors' motions q: u = T q.

    Parameters
    ----------
    method : how it was reduced
    transformation : T (n_free, s), with C T = 1 (for SEREP on the modes that it keeps)
    stiffness, mass : (s, s)
    """

    method: Method
    transformation: Reals
    stiffness: Reals
    mass: Reals

    def orthogonality(self, shapes: NDArray) -> NDArray:
        """(m, m) ψᴴM_sψ of shapes (s, m) scaled to unit diagonal: the unit matrix for true normal modes."""
        return self.cross_orthogonality(shapes, shapes)

    def cross_orthogonality(self, test: NDArray, model: NDArray) -> NDArray:
        """(a, b) ψᴴM_sφ of shapes (s, a) and (s, b), each scaled to unit mass."""
        return _unit(test, self.mass).conj().T @ self.mass @ _unit(model, self.mass)


def _unit(shapes: NDArray, mass: Reals) -> NDArray:
    size = np.sqrt(np.einsum("ij,ik,kj->j", shapes.conj(), mass, shapes, optimize=True).real)
    if not (size > 0.0).all():
        raise FemtuneError("reduce.shape-without-mass")
    return np.asarray(shapes / size)


def sensor_model(
    point: ModelPoint, rows: sp.sparray | Reals, method: Method = "guyan", modes: int | None = None
) -> SensorModel:
    """Mass and stiffness at the sensors.

    Parameters
    ----------
    rows : C (s, n_free), from the free DOFs to the sensors: `SensorMap.matrix @ configured.transformation`
    method : "guyan" static, "irs" with the inertia of what is condensed, "serep" by modes
    modes : number that SEREP keeps; by default the number of sensors

    Raises
    ------
    FemtuneError : ``reduce.sensors-dependent``, ``reduce.slaves-loose``, ``reduce.modes-unseen``
    """
    C = sp.csr_array(rows)
    T = _by_modes(point, C, modes or C.shape[0]) if method == "serep" else _static(point, C, method == "irs")
    k, m = T.T @ (point.symmetric_stiffness @ T), T.T @ (point.symmetric_mass @ T)
    return SensorModel(method, T, 0.5 * (k + k.T), 0.5 * (m + m.T))


def _by_modes(point: ModelPoint, C: sp.csr_array, count: int) -> Reals:
    shapes = solve_modes(point, count).shapes[:, :count]
    seen = np.asarray(C @ shapes)
    singular = la.svdvals(seen)
    if shapes.shape[1] > C.shape[0] or singular[-1] <= _UNSEEN * singular[0]:
        raise FemtuneError("reduce.modes-unseen/at-sensors", modes=shapes.shape[1], sensors=C.shape[0])
    return np.asarray(shapes @ la.pinv(seen))


def _static(point: ModelPoint, C: sp.csr_array, improved: bool) -> Reals:
    """T = A⁻¹Cᵀ(CA⁻¹Cᵀ)⁻¹ with A = K + αCᵀC: α drops out, since Cu is prescribed, and holds a free structure."""
    K, right = point.stiffness, np.asfortranarray(C.T.toarray())
    alpha = K.diagonal().mean() / max(float((C.data**2).mean()), 1e-300)
    A = sp.csr_array(K + alpha * (C.T @ C))
    try:
        factor = factorise(A)
        X = factor.solve(right)
    except SingularMatrixError as error:
        raise _loose() from error
    # a pivot that is zero except for rounding shows in the residual of a solve
    probe = np.random.default_rng(5).standard_normal(A.shape[0])
    if not np.linalg.norm(A @ factor.solve(probe) - probe) <= _LOST * np.linalg.norm(probe):
        raise _loose()
    F = np.asarray(C @ X)
    T = X @ _inverse(F)
    if not improved:
        return np.asarray(T)
    k, m = T.T @ (K @ T), T.T @ (point.mass @ T)
    inertia = point.mass @ (T @ la.solve(m, k))
    U = factor.solve(np.asfortranarray(inertia))
    return np.asarray(T + U - T @ (C @ U))


def _inverse(F: Reals) -> Reals:
    scale = 1.0 / np.sqrt(np.diag(F))
    values, Q = la.eigh(0.5 * (F + F.T) * np.outer(scale, scale))
    if values[0] <= _DEPENDENT * values[-1]:
        raise FemtuneError("reduce.sensors-dependent", values={"sensors": len(F)})
    half = scale[:, None] * Q
    return np.asarray((half / values) @ half.T)


def _loose() -> FemtuneError:
    return FemtuneError("reduce.slaves-loose/at-sensors")
