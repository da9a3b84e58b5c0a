"""FRFs that a reduced model is trained for: static shapes that its basis needs, and an estimate of their error.

The basis V gets, at every point where the full model is solved, what its modes miss of the response to the forces, and
the response to the inertia forces of that on the side of the FRFs with fewer forces. With static responses alone the
higher modes respond to lines ω with relative errors of (ω/ω_h)⁴; one more power series term on one side leaves
(ω/ω_h)⁶, which is below the noise of a test where the modes reach twice the highest line. The
estimate at any other point is the difference to the FRFs on V with the corrections A0⁻¹r, of the residuals r of the
modes and of the response of the other motions to the inputs: they are what a larger basis would add first.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from femtune.arrays import Complexes, Reals
from femtune.model.configured import ModelPoint
from femtune.model.eigen.solution import EigenSolution
from femtune.model.linear.dense_products import in_any_order
from femtune.model.reduce.functions_in_basis import BasisPorts, reduced_functions
from femtune.model.reduce.modes_in_basis import ReducedModes, reduced_modes
from femtune.model.reduce.reduced_model import ReducedModel, ReducedPoint
from femtune.model.response.modal_damping import DampingRatios
from femtune.model.response.ports import Ports

_INDEPENDENT = 1e-10
"""Energy of a combination of unit corrections, relative to the largest, above which they are independent."""
_ROUNDING = 1e-8
"""Root of the energy of a correction, relative to the motion that it corrects, below which it is rounding."""
_MOST_LINES = 200
"""Lines at which the error of FRFs is estimated; the mean over all lines is close to that over these."""
_COLUMNS_OF_A_SOLVE = 16
"""Right-hand sides solved together: few enough that they take no memory beside the factors."""


@dataclass(frozen=True, eq=False)
class FunctionsWanted:
    """FRFs between ports at some lines.

    Parameters
    ----------
    freq_hz : (k,) lines above 0 Hz
    damped : number of modes that modal damping acts on
    damping : modal damping besides that of the model
    decay : σ in rad/s of s = σ + iω
    """

    ports: Ports
    freq_hz: Reals
    damped: int
    damping: DampingRatios | None = None
    decay: float = 0.0

    @cached_property
    def forces(self) -> sp.csc_array:
        """(n_free, f) the inputs, and unit forces at the outputs."""
        return sp.csc_array(sp.hstack([self.ports.inputs, self.ports.outputs.T], format="csc"))

    @cached_property
    def s(self) -> Complexes:
        """σ + iω of lines spread over all of them."""
        count = len(self.freq_hz)
        at = np.unique(np.linspace(0, count - 1, min(count, _MOST_LINES)).round().astype(int))
        return np.asarray(self.decay + 2j * np.pi * self.freq_hz[at])

    @cached_property
    def fewer(self) -> slice:
        """The columns of `forces` of the inputs, or of the outputs where these are fewer."""
        inputs, outputs = self.ports.inputs.shape[1], self.ports.outputs.shape[0]
        return slice(inputs) if inputs <= outputs else slice(inputs, inputs + outputs)

    def on(self, basis: Reals) -> BasisPorts:
        """The ports on a basis (n_free, r)."""
        return BasisPorts(np.asarray(self.ports.inputs.T @ basis).T, np.asarray(self.ports.outputs @ basis))


def missed_responses(solution: EigenSolution, forces: sp.csc_array, further: slice = slice(0)) -> Reals:
    """(n_free, f + g) what the known modes miss of the response to the forces.

    These are R, which is (K − σM)⁻¹ F without the part of the modes, for all f forces, and (K − σM)⁻¹ M R for g of
    them. They are solved some columns at a time, because factors fill the memory.

    Parameters
    ----------
    further : the g columns of the forces
    """
    phi, count, fewer = solution.shapes, forces.shape[1], range(forces.shape[1])[further]
    out = np.empty((len(phi), count + len(fewer)))
    seen = np.asarray(forces.T @ phi).T / (solution.eigenvalues - solution.shift)[:, None]
    for first in range(0, count, _COLUMNS_OF_A_SOLVE):
        part = slice(first, min(first + _COLUMNS_OF_A_SOLVE, count))
        out[:, part] = solution.factor.solve(forces[:, part].toarray(order="F"))
        out[:, part] -= in_any_order(phi, np.ascontiguousarray(seen[:, part]))
    for first in range(0, len(fewer), _COLUMNS_OF_A_SOLVE):
        some = fewer[first : first + _COLUMNS_OF_A_SOLVE]
        inertia = solution.point.symmetric_mass @ np.ascontiguousarray(out[:, some.start : some.stop])
        out[:, count + first : count + first + len(some)] = solution.factor.solve(np.asfortranarray(inertia))
    return out


def inertia_residual(
    point: ModelPoint, modes: ReducedModes, basis: Reals, low: Reals, inertia: Reals, wanted: FunctionsWanted
) -> Reals:
    """(n_free, b) residual forces of the response to the inputs of all motions but the lowest modes.

    Parameters
    ----------
    low, inertia : X (n_free, m) the lowest modes of the reduced model, and MX
    """
    number, B = low.shape[1], wanted.ports.inputs.toarray()
    # in the middle of the lines, where the other modes respond almost statically
    square = 0.5 * float(np.abs(wanted.s[-1])) ** 2
    theta, shift = modes.theta[number:], modes.point.model.shift
    higher = modes.vectors[:, number:]
    pushed = wanted.on(basis).inputs
    response = basis @ (higher @ ((higher.T @ pushed) / (1.0 + (shift - square) * theta)[:, None]))
    return np.asarray(B - inertia @ (low.T @ B) - point.stiffness @ response + square * (point.mass @ response))


@dataclass(frozen=True, eq=False)
class _Enlarged:
    """A reduced point on more vectors, without derivatives; it answers all that FRFs ask of a `ReducedPoint`."""

    model: ReducedModel
    full: ModelPoint
    stiffness: Reals
    mass: Reals
    viscous: Reals
    hysteretic: Reals
    n_parameters: int = 0


def enlarged_modes(
    model: ReducedModel, basis: Reals, x: Reals, corrections: Reals, forces: Reals, sizes: Reals, count: int
) -> tuple[ReducedModes, Reals]:
    """Modes on the basis and on the corrections D = A0⁻¹R to it; D made orthonormal.

    Parameters
    ----------
    corrections, forces : D and R (n_free, d); VᵀR = 0, so that VᵀA0D = 0
    sizes : (d,) square roots of the energies of the motions that are corrected; corrections that are rounding beside
        them are left out
    """
    energy = np.einsum("ij,ij->j", corrections, forces)
    some = energy > (_ROUNDING * sizes) ** 2
    D, scale = corrections[:, some], 1.0 / np.sqrt(energy[some])
    gram = D.T @ forces[:, some]
    values, turn = la.eigh(0.5 * scale[:, None] * (gram + gram.T) * scale)
    kept = values > _INDEPENDENT * values.max(initial=0.0)
    D = D @ (scale[:, None] * turn[:, kept] / np.sqrt(values[kept]))
    small, point = model.at(x), model.configured.at(x)
    stiffness, mass = _bordered(small.stiffness, point.stiffness, basis, D), _bordered(small.mass, point.mass, basis, D)
    viscous = _bordered(small.viscous, point.viscous, basis, D)
    hysteretic = _bordered(small.hysteretic, point.hysteretic, basis, D)
    enlarged = _Enlarged(model, point, stiffness, mass, viscous, hysteretic)
    return reduced_modes(cast(ReducedPoint, enlarged), count), D


def _bordered(reduced: Reals, matrix: sp.csr_array, basis: Reals, more: Reals) -> Reals:
    if not np.any(matrix.data):
        return np.zeros((len(reduced) + more.shape[1],) * 2)
    driven = matrix @ more
    side, corner = basis.T @ driven, more.T @ driven
    return np.block([[reduced, side], [side.T, 0.5 * (corner + corner.T)]])


def function_error(wanted: FunctionsWanted, modes: ReducedModes, ports: BasisPorts, better: ReducedModes,
                   better_ports: BasisPorts) -> float:  # fmt: skip
    """Root mean square of |ln(H⁺/H)| over lines and functions; those that are zero are left out."""
    values = (
        reduced_functions(m, p, wanted.s, wanted.damped, wanted.damping, derivatives=False).values
        for m, p in ((modes, ports), (better, better_ports))
    )
    return log_difference(*values)


def log_difference(values: Complexes, better: Complexes) -> float:
    """Root mean square of |ln(H⁺/H)| of functions that are not zero."""
    some = (values != 0.0) & (better != 0.0) & np.isfinite(values) & np.isfinite(better)
    logs = np.log(better[some] / values[some])
    return float(np.sqrt(np.mean(np.abs(logs) ** 2))) if logs.size else 0.0
