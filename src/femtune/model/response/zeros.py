"""Zeros of undamped FRFs, that is antiresonances, and their exact derivatives.

A zero of H = c(K − μM)⁻¹b at μ = ω² is an eigenvalue of the bordered problem [[K, b], [c, 0]] − μ[[M, 0], [0, 0]]; for
a point function (c = bᵀ) it is an eigenvalue of the structure held at that point. It is found on a small basis and
refined on the whole model by Newton's method, where x = (K − μM)⁻¹b and y = (K − μM)⁻¹cᵀ give dH/dμ = yᵀMx and
dμ = yᵀ(K′ − μM′)x / yᵀMx.

Source: F. Wahl, G. Schmidt, L. Forrai, On the significance of antiresonance frequencies in experimental structural
analysis, Journal of Sound and Vibration 219 (1999); J. E. Mottershead, Mechanical Systems and
Signal Processing 12 (1998).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.model.configured import ModelPoint
from femtune.model.eigen.solution import EigenSolution
from femtune.model.response.basis import ModalBasis, modal_basis
from femtune.model.response.dynamic_stiffness import NoSolutionError, sparse_solver
from femtune.model.response.frf_methods import check_ports
from femtune.model.response.ports import Ports

_REAL = 1e-6
"""|Im μ| relative to |μ| below which a zero of the basis is real, and μ relative to the highest one below which it is
0: zeros of the basis are refined afterwards, and need few digits."""
_MOST_STEPS = 12
"""Steps of Newton's method at most; it converges quadratically from a zero of the basis."""
_FARTHEST = 0.1
"""Relative change of μ beyond which Newton's method has left the zero: 5 % in frequency."""
_CONVERGED = 1e-9
"""Relative step after which μ is exact to rounding, since each step squares the error."""
_COUPLED = 1e-12
"""Contribution of a vector to the function, relative to the largest, below which it joins no input and output."""
_CANCELLED = 1e-9
"""Relative distance of a zero from a pole below which the two cancel except for rounding."""


@dataclass(frozen=True, eq=False)
class Zero:
    """A zero of one function.

    Parameters
    ----------
    eigenvalue : μ = ω² in rad²/s²
    gradient : (p,) dμ by the normalised free parameters; of no entries where it is not wanted
    motion : (n_free,) x, the response to the force at this frequency, which the output does not see
    """

    eigenvalue: float
    gradient: Reals
    motion: Reals

    @property
    def freq_hz(self) -> float:
        """Frequency."""
        return float(np.sqrt(self.eigenvalue) / (2.0 * np.pi))


@dataclass(frozen=True, eq=False)
class ZeroFinder:
    """Zeros of the functions between ports, from the modes of a model and residual vectors for every port."""

    modes: EigenSolution
    ports: Ports
    basis: ModalBasis

    def candidates(self, output: int, reference: int, max_hz: float) -> Reals:
        """μ of the real zeros of a function above 0 up to a frequency, on the basis, ascending."""
        top = (2.0 * np.pi * max_hz) ** 2
        b, c, k, m = self._coupled(output, reference, top)
        n = len(k)
        A, B = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
        A[np.arange(n), np.arange(n)], B[np.arange(n), np.arange(n)] = k, m
        # the border in the size of the rest, so that rounding treats both alike
        A[:n, n], A[n, :n] = top * b / _size(b), top * c / _size(c)
        values = la.eigvals(A, B)
        real = np.isfinite(values) & (np.abs(values.imag) <= _REAL * np.abs(values))
        zeros = np.sort(values[real].real)
        return self._off_poles(zeros[(zeros > _REAL * top) & (zeros <= top)])

    def _off_poles(self, zeros: Reals) -> Reals:
        """Without zeros that cancel a pole except for rounding, at which the motion does not couple."""
        heavy = self.basis.mass > 0.0
        poles = self.basis.stiffness[heavy] / self.basis.mass[heavy]
        gap = np.abs(zeros[:, None] - poles).min(axis=1, initial=np.inf)
        return np.asarray(zeros[gap > _CANCELLED * zeros])

    def _coupled(self, output: int, reference: int, top: float) -> tuple[Reals, Reals, Reals, Reals]:
        """Force, motion, stiffness and mass of the vectors that join input and output.

        The others would be zeros at their own poles.
        """
        q, k, m = self.basis.vectors, self.basis.stiffness, self.basis.mass
        b = np.asarray(self.ports.inputs[:, [reference]].T @ q).ravel()
        c = np.asarray(self.ports.outputs[[output]] @ q).ravel()
        part = np.abs(b * c) / (k + top * m)
        some = part > _COUPLED * part.max(initial=0.0)
        return b[some], c[some], k[some], m[some]

    def seen(self, reference: int, eigenvalue: float) -> Reals:
        """(outputs,) response of all outputs to a force at μ, on the basis."""
        q = self.basis.vectors
        force = (self.ports.inputs[:, [reference]].T @ q).ravel()
        motion = force / (self.basis.stiffness - eigenvalue * self.basis.mass)
        return np.asarray(self.ports.outputs @ (q @ motion))

    def refined(self, output: int, reference: int, eigenvalue: float, derivatives: bool = True) -> Zero:
        """The zero of the whole model near one of the basis.

        Raises
        ------
        FemtuneError : ``response.zero-lost`` where Newton's method does not end near it
        """
        point = self.modes.point
        forces = np.column_stack(
            [self.ports.inputs[:, [reference]].toarray(), self.ports.outputs[[output]].toarray().T]
        )
        mu = eigenvalue
        for _ in range(_MOST_STEPS):
            both = _solved(point, mu, forces)
            slope = float(both[:, 1] @ (point.mass @ both[:, 0]))
            step = -float(forces[:, 1] @ both[:, 0]) / slope
            mu += step
            if not abs(mu - eigenvalue) <= _FARTHEST * eigenvalue:
                break
            if abs(step) <= _CONVERGED * mu:
                count = point.n_parameters if derivatives else 0
                return Zero(mu, _gradient(point, mu, both[:, 0], both[:, 1], slope, count), both[:, 0])
        raise _lost(point, eigenvalue)


def zero_finder(modes: EigenSolution, ports: Ports) -> ZeroFinder:
    """Ready to find zeros; the modes should reach twice as high as these (error ``response.ports-differ``)."""
    check_ports(modes.point, ports)
    forces = np.hstack([ports.inputs.toarray(), ports.outputs.T.toarray()])
    return ZeroFinder(modes, ports, modal_basis(modes, forces))


def _size(x: NDArray) -> float:
    return float(np.linalg.norm(x)) or 1.0


def _solved(point: ModelPoint, mu: float, forces: Reals) -> Reals:
    try:
        return np.asarray(sparse_solver(sp.csr_array(point.stiffness - mu * point.mass))(forces))
    except NoSolutionError as error:
        raise _lost(point, mu) from error


def _gradient(point: ModelPoint, mu: float, x: Reals, y: Reals, slope: float, count: int) -> Reals:
    pairs = zip(point.stiffness_derivatives[:count], point.mass_derivatives[:count])
    return np.array([float(y @ (k @ x) - mu * (y @ (m @ x))) / slope for k, m in pairs])


def _lost(point: ModelPoint, mu: float) -> FemtuneError:
    return FemtuneError(
        "response.zero-lost", configuration=point.configured.configuration.name, freq_hz=np.sqrt(mu) / (2 * np.pi)
    )
