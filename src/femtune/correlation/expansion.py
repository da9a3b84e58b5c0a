"""Expansion of measured shapes to all degrees of freedom of the model: SEREP, dynamic, and minimum dynamic residual.

A measured shape ψ is known at the sensors only. With the sensor rows C and the dynamic stiffness Z = K − ω²M at the
measured frequency, its expansion φ is

- "serep": the combination of some model modes that fits the sensors in the least-squares sense, φ = Φ(CΦ)⁺ψ. It
  smooths noise, and cannot represent what the modes do not contain;
- "dynamic": the motion with Cφ = ψ that needs forces at the sensors only, Zφ = Cᵀμ. It repeats the measurement
  with its noise. For sensors at single DOFs it is φ_o = −Z_oo⁻¹Z_oa ψ;
- "mdre": minimum dynamic residual. The load Zφ that the shape needs is measured by the strain energy rᵀKr of the
  displacement Kr = Zφ that it causes; this energy is minimal among all φ with |ψ − Cφ| = ε|ψ|, ε the noise. With
  X = Z⁻¹Cᵀ and S = XᵀKX: r = Xf, φ = Z⁻¹Kr, Cφ = Sf, and the misfit ψ − Cφ = (I + γS)⁻¹ψ, so that one factorisation
  serves for any weight γ.

All three are linear combinations of a few vectors whose motion at the sensors is known, so that sensors can be left
out and predicted from the others without further factorisations. The error of this prediction is an estimate of the
error of the expansion where nothing was measured.

Sources: O'Callahan, Avitabile and Riemer (1989), SEREP; Kidder (1973), dynamic expansion; Chouaki, Ladevèze and
Proslier (1998) and Balmès (2000), minimum dynamic residual.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.optimize import brentq

from femtune.arrays import Reals
from femtune.correlation.kinds import EXPANSION_METHODS, ExpansionMethod
from femtune.dofs import DofSet
from femtune.modal import ModeSet
from femtune.model import EigenSolution
from femtune.model.solvers.factorise import factorise
from femtune.model.solvers.interface import SingularMatrixError

MOST_GROUPS = 10
"""Groups of sensors that are left out one after the other."""
FEWEST_NODES = 3
"""With fewer test nodes than this single sensors are left out: without a node too little would remain."""

_DEPENDENT = 1e-8
"""Singular value relative to the largest, below which modes cannot be told apart at the sensors: half of the digits of
a double."""
_OFF_RESONANCE = 1e-9
"""Relative distance of λ from an eigenvalue at or below which it is moved by ten times as much: K − λM is singular
there, and the expansion does not change in digits that count."""
_RIGID = 1e-8
"""Lowest eigenvalue relative to the largest solved one, at or below which the structure moves as a rigid body."""


@dataclass(frozen=True, eq=False)
class Expansion(ABC):
    """An expansion at one frequency.

    Parameters
    ----------
    vectors : (n_free, k) whose combinations are the expanded shapes
    at_sensors : (s, k) C times the vectors
    """

    vectors: Reals
    at_sensors: Reals

    @abstractmethod
    def coefficients(self, shape: Reals) -> Reals:
        """(k,) combination for a shape (s,) whose unknown entries are NaN; NaN where too few entries are known."""

    def shape(self, shape: Reals) -> Reals:
        """(n_free,) the expanded shape."""
        return np.asarray(self.vectors @ self.coefficients(shape))

    def predicted(self, shape: Reals) -> Reals:
        """(s,) the expanded shape at all sensors, also at those whose entry is NaN."""
        return np.asarray(self.at_sensors @ self.coefficients(shape))


class Serep(Expansion):
    """System equivalent reduction expansion: a least-squares combination of model modes."""

    def coefficients(self, shape: Reals) -> Reals:
        """NaN where the known entries do not determine all modes."""
        known = ~np.isnan(shape)
        seen = self.at_sensors[known]
        size = np.linalg.norm(seen, axis=0)
        if len(seen) < seen.shape[1] or not size.all():
            return np.full(seen.shape[1], np.nan)
        found, _, rank, _ = la.lstsq(seen / size, shape[known], cond=_DEPENDENT)
        return np.asarray(found / size) if rank == seen.shape[1] else np.full(seen.shape[1], np.nan)


@dataclass(frozen=True, eq=False)
class DynamicExpansion(Expansion):
    """Dynamic expansion; the vectors are A⁻¹Cᵀ with A = Z + αCᵀC.

    The term in α makes the matrix regular at a natural frequency of the model. It cancels: with φ = A⁻¹Cᵀg it is
    g = αCφ − μ, and μ = 0 at sensors whose entry is not known.
    """

    alpha: float

    def coefficients(self, shape: Reals) -> Reals:
        """g; dependent sensors are fitted in the least-squares sense."""
        known = ~np.isnan(shape)
        if not known.any():
            return np.full(len(shape), np.nan)
        F = self.alpha * self.at_sensors
        inner, right = F[np.ix_(known, known)], F[np.ix_(known, ~known)]
        # at unknown sensors g = αCφ = F g, which eliminates them
        others = la.solve(np.eye(right.shape[1]) - F[np.ix_(~known, ~known)], F[np.ix_(~known, known)])
        g = np.zeros(len(shape))
        g[known] = la.lstsq(inner + right @ others, self.alpha * shape[known], cond=_DEPENDENT**1.5)[0]
        g[~known] = others @ g[known]
        return g


@dataclass(frozen=True, eq=False)
class MinimumResidual(Expansion):
    """Minimum dynamic residual; the vectors are Z⁻¹KX, and `at_sensors` is S = XᵀKX.

    Parameters
    ----------
    static : (n_free, s) X = Z⁻¹Cᵀ: r = X f is the displacement that the residual load causes
    stiffness : K, or K − σM of a free structure
    noise : |ψ − Cφ|/|ψ|, above 0 and below 1
    """

    static: Reals
    stiffness: sp.csr_array
    noise: float

    def coefficients(self, shape: Reals) -> Reals:
        """f = γ(I + γS)⁻¹ψ with |(I + γS)⁻¹ψ| = noise·|ψ|; zero where the entry is not known."""
        known = ~np.isnan(shape)
        psi, f = shape[known], np.zeros(len(shape))
        if not psi.any():
            return np.full(len(shape), np.nan)
        values, vectors = np.linalg.eigh(self.at_sensors[np.ix_(known, known)])
        values = np.maximum(values, 0.0)
        inside = vectors.T @ (psi / np.linalg.norm(psi))

        def excess(log_weight: float) -> float:
            return float(np.linalg.norm(inside / (1.0 + np.exp(log_weight) * values))) - self.noise

        low, high = (np.log(1e-6 / values.max()), np.log(1e16 / values.max()))
        weight = np.exp(brentq(excess, low, high)) if excess(high) < 0.0 else np.exp(high)
        f[known] = vectors @ (weight * (vectors.T @ psi) / (1.0 + weight * values))
        return f


def serep(solution: EigenSolution, sensors: sp.csr_array, modes: Sequence[int]) -> Serep:
    """SEREP with some modes of the model, by position from 0."""
    vectors = solution.shapes[:, list(modes)]
    return Serep(vectors, np.asarray(sensors @ vectors))


def dynamic_expansion(solution: EigenSolution, sensors: sp.csr_array, freq_hz: float) -> DynamicExpansion:
    """Dynamic expansion at a frequency, with the stiffness of this frequency.

    Raises
    ------
    SingularMatrixError : with the sensors held, the rest of the structure resonates at this frequency
    """
    point, C = solution.point.at_frequency(freq_hz), sp.csr_array(sensors)
    alpha = float(point.stiffness.diagonal().mean()) / max(float((C.data**2).mean()) if C.nnz else 0.0, 1e-300)
    A = sp.csr_array(point.stiffness - (2.0 * np.pi * freq_hz) ** 2 * point.mass + alpha * (C.T @ C))
    vectors = factorise(A).solve(np.asfortranarray(C.T.toarray()))
    F = np.asarray(C @ vectors)
    return DynamicExpansion(vectors, 0.5 * (F + F.T), alpha)


def minimum_residual(
    solution: EigenSolution, sensors: sp.csr_array, freq_hz: float, noise: float = 0.01
) -> MinimumResidual:
    """Minimum dynamic residual at a frequency, with the stiffness of this frequency.

    Parameters
    ----------
    solution : of the model; its shift makes K positive definite where the structure is free
    noise : |ψ − Cφ|/|ψ| of the measurement, above 0 and below 1

    Raises
    ------
    SingularMatrixError : the dynamic stiffness is singular
    """
    point, values, C = solution.point.at_frequency(freq_hz), solution.eigenvalues, sp.csr_array(sensors)
    shift = 0.0 if values[0] > _RIGID * values.max() else min(solution.shift, 0.0)
    K = sp.csr_array(point.stiffness - shift * point.mass)
    eigenvalue = (2.0 * np.pi * freq_hz) ** 2
    near = np.abs(values - eigenvalue).min(initial=np.inf) <= _OFF_RESONANCE * eigenvalue
    factor = factorise(sp.csr_array(point.stiffness - eigenvalue * (1.0 + _OFF_RESONANCE * 10 * near) * point.mass))
    X = factor.solve(np.asfortranarray(C.T.toarray()))
    KX = K @ X
    S = np.asarray(X.T @ KX)
    return MinimumResidual(factor.solve(np.asfortranarray(KX)), 0.5 * (S + S.T), X, K, noise)


# ----------------------------------------------------------------------------------------------------
# All shapes of a test, with the error at sensors that are left out.


@dataclass(frozen=True, eq=False)
class ExpandedShapes:
    """The shapes of a test on all free DOFs of the model.

    Parameters
    ----------
    method : of the shapes
    shapes : (n_free, t) in the scale of the test's shapes; NaN where a shape could not be expanded
    misfit : (t,) |ψ − Cφ|/|ψ| at the sensors
    held_out : (t,) by method: |ψ − φ̂|/|ψ| with the entries φ̂ predicted from the other groups of sensors; NaN where
        the other sensors do not determine the shape
    groups : number of groups of sensors that were left out in turn
    basis : positions of the model modes of SEREP
    """

    method: ExpansionMethod
    shapes: Reals
    misfit: Reals
    held_out: dict[ExpansionMethod, Reals]
    groups: int
    basis: tuple[int, ...]


def held_out_groups(dofs: DofSet) -> list[NDArray[np.int64]]:
    """Positions of the sensors that are left out together, at most ten groups: all sensors of a test node, or single
    sensors where the test has few nodes."""
    nodes = np.array([dof.node for dof in dofs])
    few = len(set(nodes.tolist())) < FEWEST_NODES
    places = np.arange(len(nodes)) if few else nodes
    different = list(dict.fromkeys(places.tolist()))
    count = min(MOST_GROUPS, len(different))
    return [np.flatnonzero(np.isin(places, different[i::count])) for i in range(count)] if count > 1 else []


def held_out_error(expansion: Expansion, shape: Reals, groups: Sequence[NDArray[np.int64]]) -> float:
    """|ψ − φ̂|/|ψ| over the entries that each group leaves out; NaN where one of them cannot be predicted."""
    total = 0.0
    for group in groups:
        left = shape.copy()
        left[group] = np.nan
        missing = np.isnan(left) & ~np.isnan(shape)
        if not missing.any():
            continue
        if not np.nan_to_num(left).any():
            return np.nan
        total += float(np.sum((expansion.predicted(left) - shape)[missing] ** 2))
    size = float(np.nansum(shape**2))
    return float(np.sqrt(total / size)) if groups and size > 0.0 else np.nan


def expand_shapes(
    solution: EigenSolution,
    test: ModeSet,
    sensors: sp.csr_array,
    method: ExpansionMethod,
    *,
    basis: Sequence[int],
    noise: float = 0.01,
    compare: Sequence[ExpansionMethod] = get_args(ExpansionMethod),
) -> ExpandedShapes:
    """Expand all shapes of a test by one method, and test the methods at sensors that are left out.

    Parameters
    ----------
    test : real shapes at the sensors; NaN where not measured
    sensors : (s, n_free) rows that sample the free DOFs
    basis : positions of the model modes for SEREP, from 0; not more than there are sensors that tell them apart
    noise : relative misfit of "mdre"
    compare : methods whose error is estimated

    Returns
    -------
    ExpandedShapes; a shape without measured entries, one that SEREP's modes cannot represent uniquely and one at
    whose frequency the rest of the structure resonates have NaN entries

    Examples
    --------
    Of a study, by `femtune.correlate`:

    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> found = ft.correlate(model, test, expand="serep")
    >>> found.expansion.column("test_label")
    array(['1', '2', '3', '4'], dtype=object)
    """
    groups = held_out_groups(test.dofs)
    shapes, misfit = np.full((sensors.shape[1], len(test)), np.nan), np.full(len(test), np.nan)
    errors: dict[ExpansionMethod, Reals] = {name: np.full(len(test), np.nan) for name in compare}
    for j, freq in enumerate(test.freq_hz):
        psi = np.asarray(test.shapes[:, j], dtype=float)
        if not np.nan_to_num(psi).any():
            continue
        for name in dict.fromkeys((method, *compare)):
            expansion = _at(name, solution, sensors, float(freq), basis, noise)
            if expansion is None:
                continue
            if name in errors:
                errors[name][j] = held_out_error(expansion, psi, groups)
            if name == method:
                shapes[:, j] = expansion.shape(psi)
                gap = expansion.predicted(psi) - psi
                misfit[j] = np.sqrt(np.nansum(gap**2) / np.nansum(psi**2)) if np.isfinite(shapes[0, j]) else np.nan
    return ExpandedShapes(method, shapes, misfit, errors, len(groups), tuple(basis))


def _at(
    name: ExpansionMethod,
    solution: EigenSolution,
    sensors: sp.csr_array,
    freq_hz: float,
    basis: Sequence[int],
    noise: float,
) -> Expansion | None:
    at_frequency: Callable[..., Expansion | None] = EXPANSION_METHODS[name].load()
    try:
        return at_frequency(solution, sensors, freq_hz, basis, noise)
    except SingularMatrixError:
        return None


def serep_at(
    solution: EigenSolution, sensors: sp.csr_array, freq_hz: float, basis: Sequence[int], noise: float
) -> Expansion | None:
    """`serep`, the same at every frequency; None without modes in its basis."""
    return serep(solution, sensors, basis) if len(basis) else None


def dynamic_at(
    solution: EigenSolution, sensors: sp.csr_array, freq_hz: float, basis: Sequence[int], noise: float
) -> Expansion:
    """`dynamic_expansion`."""
    return dynamic_expansion(solution, sensors, freq_hz)


def minimum_residual_at(
    solution: EigenSolution, sensors: sp.csr_array, freq_hz: float, basis: Sequence[int], noise: float
) -> Expansion:
    """`minimum_residual`."""
    return minimum_residual(solution, sensors, freq_hz, noise)
