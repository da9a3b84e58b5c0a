"""The terms of a configured model on a basis V: small, dense, and as exact in the parameters as the model itself.

VᵀK(p)V = Σ a_i(p) VᵀK_iV: no expansion in the parameters is made, so values and derivatives are those of the full
model within the span of V.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.fem.fields import MatrixKind
from femtune.model.configuration import Configuration
from femtune.model.configured import ConfiguredModel, ModelPoint
from femtune.model.products import projections

KINDS: tuple[MatrixKind, ...] = get_args(MatrixKind)

MOST_BYTES = 2 * 1024**3
"""Memory of the dense terms beyond which a reduced model saves nothing."""


@dataclass(frozen=True, eq=False)
class ReducedModel:
    """K(p) = Σ a_i(p) VᵀK_iV and M(p), C(p), H(p) likewise, of order r.

    Parameters
    ----------
    configured : the full model
    order : r
    terms : (n_columns, r, r) by the position of the term in `configured.projected`
    rows : (s, r) C V, what is seen of the modes at chosen DOFs or sensors
    shift : σ < 0 of the size of the lowest elastic eigenvalues; K − σM is positive definite
    """

    configured: ConfiguredModel
    order: int
    terms: dict[int, Reals] = field(repr=False)
    rows: Reals = field(repr=False)
    shift: float

    @property
    def configuration(self) -> Configuration:
        """The state of the structure that the model describes."""
        return self.configured.configuration

    @property
    def n_free(self) -> int:
        """Its number of degrees of freedom, the order."""
        return self.order

    def at(self, x: NDArray) -> ReducedPoint:
        """The reduced model at one normalised parameter vector, real or complex."""
        return ReducedPoint(self, np.asarray(x))


@dataclass(frozen=True, eq=False)
class ReducedPoint:
    """Dense matrices (r, r) and their exact derivatives at one x."""

    model: ReducedModel
    x: NDArray

    @cached_property
    def full(self) -> ModelPoint:
        """The full model at the same parameters."""
        return self.model.configured.at(self.x)

    @property
    def n_parameters(self) -> int:
        """Number of free parameters."""
        return self.full.n_parameters

    def _matrices(self, kind: MatrixKind, parts: Sequence[tuple[int, ...]]) -> NDArray:
        """(m, r, r) VᵀKV of a kind, or its derivatives, by the parameters of each of m parts."""
        r = self.model.order
        out = np.zeros((len(parts), r * r), dtype=complex if np.iscomplexobj(self.x) else float)
        for i, values in self.model.terms.items():
            if self.model.configured.projected[i].term.matrix == kind:
                some = np.array([self.full.weights(i, part) for part in parts])
                if some.any():
                    out += _weighed(some, values.reshape(len(values), r * r))
        return out.reshape(len(parts), r, r)

    def _value(self, kind: MatrixKind) -> NDArray:
        return np.asarray(self._matrices(kind, [()])[0])

    def _first(self, kind: MatrixKind) -> tuple[NDArray, ...]:
        return tuple(self._matrices(kind, [(i,) for i in range(self.n_parameters)]))

    def second_derivative(self, kind: MatrixKind, i: int, j: int) -> NDArray:
        """∂²/∂x_i∂x_j of K, M, C, or of the part of H that materials and elements make."""
        return np.asarray(self._matrices(kind, [(i, j)])[0])

    @cached_property
    def stiffness(self) -> NDArray:
        """VᵀKV."""
        return self._value("stiffness")

    @cached_property
    def mass(self) -> NDArray:
        """VᵀMV."""
        return self._value("mass")

    @cached_property
    def viscous(self) -> NDArray:
        """VᵀCV of dashpots."""
        return self._value("viscous")

    @cached_property
    def hysteretic(self) -> NDArray:
        """VᵀHV: loss factors of materials, elements and the whole structure."""
        of_terms, eta = self._value("hysteretic"), self.full.loss_factor
        return of_terms if eta is None else of_terms + eta.value * self.stiffness

    @cached_property
    def stiffness_derivatives(self) -> tuple[NDArray, ...]:
        """Vᵀ(∂K/∂x_i)V of every free parameter."""
        return self._first("stiffness")

    @cached_property
    def mass_derivatives(self) -> tuple[NDArray, ...]:
        """Vᵀ(∂M/∂x_i)V of every free parameter."""
        return self._first("mass")

    @cached_property
    def viscous_derivatives(self) -> tuple[NDArray, ...]:
        """Vᵀ(∂C/∂x_i)V of every free parameter."""
        return self._first("viscous")

    @cached_property
    def hysteretic_derivatives(self) -> tuple[NDArray, ...]:
        """Vᵀ(∂H/∂x_i)V of every free parameter."""
        of_terms, eta = self._first("hysteretic"), self.full.loss_factor
        if eta is None:
            return of_terms
        pairs = zip(of_terms, self.stiffness_derivatives, eta.grad)
        return tuple(h + eta.value * k + d * self.stiffness for h, k, d in pairs)

    def hysteretic_second_derivative(self, i: int, j: int) -> NDArray:
        """∂²H/∂x_i∂x_j with the loss factor of the whole structure."""
        of_terms, eta = self.second_derivative("hysteretic", i, j), self.full.loss_factor
        if eta is None:
            return of_terms
        k, second = self.stiffness_derivatives, self.second_derivative("stiffness", i, j)
        return of_terms + eta.value * second + eta.grad[i] * k[j] + eta.grad[j] * k[i] + eta.hess[i, j] * self.stiffness


def _weighed(weights: NDArray, columns: Reals) -> NDArray:
    """weights (m, n), which may be complex, times real columns (n, r²), without a complex copy of these."""
    if not np.iscomplexobj(weights):
        return np.asarray(weights @ columns)
    return np.asarray(weights.real @ columns + 1j * (weights.imag @ columns))


def reduce_model(
    configured: ConfiguredModel, basis: Reals, rows: NDArray | None = None, shift: float | None = None
) -> ReducedModel:
    """The terms of a model on a basis.

    Parameters
    ----------
    basis : V (n_free, r)
    rows : C (s, n_free), dense or sparse: the combinations of DOFs at which modes are wanted; none without it
    shift : that of an `EigenSolution`; from the size of the nominal matrices without it

    Raises
    ------
    FemtuneError : ``reduce.too-many-terms``, ``model.memory``
    """
    check_size(configured, basis.shape[1])
    terms: dict[int, Reals] = {}
    for kind in KINDS:
        terms |= projections(configured, kind, basis, basis)
    seen = np.zeros((0, basis.shape[1])) if rows is None else np.asarray(rows @ basis)
    model = ReducedModel(configured, basis.shape[1], terms, seen, -1.0 if shift is None else shift)
    return model if shift is not None else replace(model, shift=_shift(model))


_SHIFT_TO_MEAN = 1e-3
"""Shift over the mean ratio of stiffness to mass, if no solution of the full model gives one."""


def _shift(model: ReducedModel) -> float:
    """Minus a thousandth of the mean ratio of stiffness to mass.

    A shift much nearer to zero would leave the lowest modes dominated by rounding errors.
    """
    nominal = model.at(np.zeros(len(model.configured.model.parameters.free)))
    return -_SHIFT_TO_MEAN * float(np.trace(nominal.stiffness) / np.trace(nominal.mass))


def enlarge(model: ReducedModel, basis: Reals, rows: NDArray | None = None) -> ReducedModel:
    """The reduced model on a basis whose first columns are those of `model`: only new products are made.

    Raises
    ------
    FemtuneError : ``reduce.too-many-terms``, ``model.memory``
    """
    check_size(model.configured, basis.shape[1])
    new = basis[:, model.order :]
    terms: dict[int, Reals] = {}
    for kind in KINDS:
        products = projections(model.configured, kind, basis, new)
        terms |= {i: _bordered(model.terms[i], columns) for i, columns in products.items()}
    seen = np.zeros((0, basis.shape[1])) if rows is None else np.hstack([model.rows, np.asarray(rows @ new)])
    return ReducedModel(model.configured, basis.shape[1], terms, seen, model.shift)


def leading(model: ReducedModel, order: int) -> ReducedModel:
    """The reduced model on the first `order` vectors of its basis."""
    terms = {i: np.ascontiguousarray(values[:, :order, :order]) for i, values in model.terms.items()}
    return replace(model, order=min(order, model.order), terms=terms, rows=model.rows[:, :order])


def _bordered(old: Reals, columns: Reals) -> Reals:
    """(n, r, r) symmetric from its leading (n, q, q) block and its last columns (n, r, r − q)."""
    n, r, _ = columns.shape
    q = old.shape[1]
    out = np.empty((n, r, r))
    out[:, :q, :q] = old
    out[:, :, q:] = columns
    out[:, q:, :q] = np.swapaxes(columns[:, :q], 1, 2)
    return out


def check_size(configured: ConfiguredModel, order: int) -> None:
    """Refuse dense terms that would take too much memory (error ``reduce.too-many-terms``)."""
    columns = sum(p.term.n_columns for p in configured.projected)
    if 8 * columns * order**2 > MOST_BYTES:
        preload = configured.model.structure.preload
        raise FemtuneError(
            "reduce.too-many-terms" if preload is None else "reduce.too-many-terms/preload",
            values={"memory (GiB)": f"{8 * columns * order**2 / 1024**3:.1f}"},
            configuration=configured.configuration.name,
            functions=columns,
            order=order,
            request="" if preload is None else preload.request,
        )
