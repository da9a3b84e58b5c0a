"""ConfiguredModel: the terms of a parametric model on the free DOFs of one configuration."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.dofs import Dof
from femtune.fem.contribution import MatrixKind
from femtune.fem.values import TableJet
from femtune.model.configuration import Configuration
from femtune.model.digest import Part, digest
from femtune.model.identity import Identity, identity
from femtune.model.parametric import ParametricModel
from femtune.model.projection import ProjectedTerm
from femtune.model.symmetric import BothTriangles, SymmetricMatrix
from femtune.parameters.jet import Jet


@dataclass(frozen=True)
class ConfiguredModel:
    """K_c(p) = TᵀK(p)T and M_c(p) on the free DOFs of a configuration.

    Parameters
    ----------
    transformation : T, csr (g-set, free)
    free : (n_free,) the g-set DOF that each column of T carries
    held_singular : DOFs without stiffness that were held
    indptr, indices : pattern of the upper triangle of all matrices, with its whole diagonal
    """

    model: ParametricModel
    configuration: Configuration
    transformation: sp.csr_array
    free: NDArray[np.int64]
    held_singular: tuple[Dof, ...]
    indptr: NDArray[np.int32]
    indices: NDArray[np.int32]
    projected: tuple[ProjectedTerm, ...] = field(repr=False)

    @property
    def n_free(self) -> int:
        """Number of free DOFs."""
        return int(self.transformation.shape[1])

    def free_dof(self, i: int) -> Dof:
        """Node and direction of a free DOF."""
        return self.model.structure.nodes.describe(int(self.free[i]))

    @cached_property
    def rows(self) -> NDArray[np.int32]:
        """(nnz,) row of each entry of the pattern."""
        return np.repeat(np.arange(self.n_free, dtype=np.int32), np.diff(self.indptr))

    @cached_property
    def both_triangles(self) -> BothTriangles:
        """The pattern of both triangles, made when a consumer asks for a full matrix."""
        return BothTriangles.of(self.indptr, self.indices)

    def at(self, x: NDArray) -> ModelPoint:
        """The model at one normalised parameter vector."""
        return ModelPoint(self, np.asarray(x))

    @cached_property
    def identity(self) -> Identity:
        """What the matrices are made of, but for the values in the table."""
        return identity(self.model.structure, self.configuration, self.transformation)

    @cached_property
    def terms_digest(self) -> str:
        """Digest of the pattern and of every term on it; of a coefficient counts here only whether it is there."""
        parts: list[Part] = [self.n_free, self.indptr, self.indices]
        for p in self.projected:
            parts += [p.term.matrix, p.term.coefficient is None, p.spread.indptr, p.spread.indices, p.spread.data]
        return digest(*parts)


@dataclass(frozen=True, eq=False)
class ModelPoint:
    """Matrices and their derivatives at one x (real, or complex for checks by complex step)."""

    configured: ConfiguredModel
    x: NDArray

    @cached_property
    def _table(self) -> TableJet:
        return self.configured.model.table(self.x)

    @cached_property
    def coefficients(self) -> list[Jet | None]:
        """Coefficients of each projected term; None for the constant 1."""
        table = self._table
        terms = (p.term for p in self.configured.projected)
        return [t.coefficient(table) if t.coefficient else None for t in terms]

    @cached_property
    def _values(self) -> list[NDArray | None]:
        """Values of the coefficients, without their derivatives."""
        table = self._table.without_derivatives()
        terms = (p.term for p in self.configured.projected)
        return [t.coefficient(table).value if t.coefficient else None for t in terms]

    def _upper(self, kind: MatrixKind, part: tuple[int, ...] = ()) -> SymmetricMatrix:
        """A matrix, or its derivative by the parameters `part`."""
        model = self.configured
        data = np.zeros(len(model.indices), dtype=self.x.dtype if np.iscomplexobj(self.x) else float)
        for i, projected in enumerate(model.projected):
            if projected.term.matrix == kind:
                c = self._weights(i, part)
                if c.any():
                    data += projected.spread @ c
        return SymmetricMatrix(data, model.indices, model.indptr)

    def _weights(self, i: int, part: tuple[int, ...]) -> NDArray:
        """(n_columns,) coefficients of a projected term, or their derivatives."""
        if not part:
            values = self._values[i]
            return np.ones(1) if values is None else values
        c = self.coefficients[i]
        if c is None:
            return np.zeros(1)
        return np.asarray(c.grad[:, part[0]] if len(part) == 1 else c.hess[:, part[0], part[1]])

    def _matrix(self, kind: MatrixKind, part: tuple[int, ...] = ()) -> sp.csr_array:
        return self.configured.both_triangles.matrix(self._upper(kind, part).data)

    def upper(self, kind: MatrixKind) -> SymmetricMatrix:
        """K, M, C, or H of materials and elements, as its upper triangle."""
        if kind in ("stiffness", "mass"):
            return self.symmetric_stiffness if kind == "stiffness" else self.symmetric_mass
        return self._upper(kind)

    @cached_property
    def stiffness(self) -> sp.csr_array:
        """K."""
        return self.configured.both_triangles.matrix(self.symmetric_stiffness.data)

    @cached_property
    def mass(self) -> sp.csr_array:
        """M."""
        return self.configured.both_triangles.matrix(self.symmetric_mass.data)

    @cached_property
    def viscous(self) -> sp.csr_array:
        """C of dashpots; real."""
        return self._matrix("viscous")

    @cached_property
    def hysteretic(self) -> sp.csr_array:
        """H of K + iH: stiffness times loss factors of materials, elements and the whole structure; real."""
        eta = self.loss_factor
        own = self.element_hysteretic
        return own if eta is None else sp.csr_array(own + eta.value * self.stiffness)

    @cached_property
    def element_hysteretic(self) -> sp.csr_array:
        """The part of H that loss factors of materials and elements make."""
        return self._matrix("hysteretic")

    @cached_property
    def element_hysteretic_derivatives(self) -> tuple[sp.csr_array, ...]:
        """Derivatives of that part by every free parameter."""
        return tuple(self._matrix("hysteretic", (i,)) for i in range(self.n_parameters))

    @cached_property
    def viscous_derivatives(self) -> tuple[sp.csr_array, ...]:
        """∂C/∂x_i of every free parameter."""
        return tuple(self._matrix("viscous", (i,)) for i in range(self.n_parameters))

    @cached_property
    def hysteretic_derivatives(self) -> tuple[sp.csr_array, ...]:
        """∂H/∂x_i of every free parameter."""
        own = self.element_hysteretic_derivatives
        eta = self.loss_factor
        if eta is None:
            return own
        pairs = zip(own, self.stiffness_derivatives, eta.grad)
        return tuple(sp.csr_array(h + eta.value * k + d * self.stiffness) for h, k, d in pairs)

    @property
    def loss_factor(self) -> Jet | None:
        """Loss factor of all stiffness."""
        index = self.configured.model.structure.damping.loss_factor
        return None if index is None else self._table[index]

    @cached_property
    def mode_ratios(self) -> dict[int, Jet]:
        """Damping ratios of modes that are values of the model, by number of the mode; see `OverallDamping`."""
        table = self._table
        return {n: table[i] for n, i in self.configured.model.structure.damping.mode_ratios.items()}

    @cached_property
    def stiffness_derivatives(self) -> tuple[sp.csr_array, ...]:
        """∂K/∂x_i of every free parameter."""
        return tuple(self._matrix("stiffness", (i,)) for i in range(self.n_parameters))

    @cached_property
    def mass_derivatives(self) -> tuple[sp.csr_array, ...]:
        """∂M/∂x_i of every free parameter."""
        return tuple(self._matrix("mass", (i,)) for i in range(self.n_parameters))

    def stiffness_second_derivative(self, i: int, j: int) -> sp.csr_array:
        """∂²K/∂x_i∂x_j."""
        return self._matrix("stiffness", (i, j))

    def mass_second_derivative(self, i: int, j: int) -> sp.csr_array:
        """∂²M/∂x_i∂x_j."""
        return self._matrix("mass", (i, j))

    def viscous_second_derivative(self, i: int, j: int) -> sp.csr_array:
        """∂²C/∂x_i∂x_j."""
        return self._matrix("viscous", (i, j))

    def hysteretic_second_derivative(self, i: int, j: int) -> sp.csr_array:
        """∂²H/∂x_i∂x_j."""
        own, eta = self._matrix("hysteretic", (i, j)), self.loss_factor
        if eta is None:
            return own
        k, second = self.stiffness_derivatives, self.stiffness_second_derivative(i, j)
        overall = eta.value * second + eta.grad[i] * k[j] + eta.grad[j] * k[i] + eta.hess[i, j] * self.stiffness
        return sp.csr_array(own + overall)

    @cached_property
    def symmetric_stiffness(self) -> SymmetricMatrix:
        """K as its upper triangle."""
        return self._upper("stiffness")

    @cached_property
    def symmetric_mass(self) -> SymmetricMatrix:
        """M as its upper triangle, on the pattern of K."""
        return self._upper("mass")

    @property
    def table(self) -> NDArray:
        """(n,) value table at the point."""
        return self._table.value

    @property
    def n_parameters(self) -> int:
        """Number of free parameters."""
        return len(self.configured.model.parameters.free)
