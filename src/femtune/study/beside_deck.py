"""femtune's own model of a deck compared with an external solver mode by mode, and derivatives from this model.

With the eigenvalues Λ and shapes Φ of the solver at a point, of unit modal mass, and those of the own model, Λₒ and
Φₒ, the shapes are related by Φ ≈ Φₒ Q, where Q is the orthogonal polar factor of Φₒ⁺Φ. The exact derivatives of the
own model in its modes, Kᵢ = ΦₒᵀK′Φₒ and Mᵢ = ΦₒᵀM′Φₒ, and the parts Uᵢ of Φₒ′ outside these modes, give

    K(p) = Λ + Σ Cᵀ Kᵢ C (pᵢ − p₀ᵢ),   M(p) = 1 + Σ Qᵀ Mᵢ Q (pᵢ − p₀ᵢ),   C = Λₒ^(−½) Q Λ^½,

with modes whose shapes are seen as Φ + Σ Uᵢ Q (pᵢ − p₀ᵢ). At the point the modes are exactly those of the solver, and
the relative derivatives are those of the own model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from femtune.files.runs_table import RunsTable
from femtune.modal.assignment import linear_sum_assignment
from femtune.modal.beside import RIGID_FREQUENCY_RATIO, ModesBeside
from femtune.model.full_model import direct
from femtune.model.imported.from_runs import seen_modes

if TYPE_CHECKING:
    from femtune.arrays import Integers, Reals
    from femtune.dofs import DofSet
    from femtune.model import ConfiguredModel, EigenSolution

_FURTHER_MODES = 6
"""Modes of femtune's own model beyond those of the solver: partners of the last ones may have a higher number."""


@dataclass(frozen=True, eq=False)
class Beside:
    """The modes of a run of the solver beside those of the own model, for derivatives.

    Parameters
    ----------
    modes : m modes of the solver, without those that do not move at its DOFs; MAC at the DOFs that both models have
    shapes : (s, m) of the solver at `dofs`, of unit modal mass
    members : (m,) positions of the partners in `solution`
    common : (c,) rows of `dofs` that the own model has, and `rows` (c, n_free) of these
    """

    modes: ModesBeside
    shapes: Reals
    dofs: DofSet
    members: Integers
    solution: EigenSolution
    common: Integers
    rows: sp.csr_array


def modes_beside(configuration: str, configured: ConfiguredModel, x: Reals, table: RunsTable) -> Beside | None:
    """The first run of a table compared with femtune's model at x; None if they share fewer DOFs than there are modes.

    Raises
    ------
    FemtuneError : of the eigenvalue solution, ``runs.few-dofs/none``
    """
    if table.shapes is None:
        return None
    hz, shapes, _ = seen_modes(table.freq_hz[:1], table.shapes[:1])
    phi = shapes[0]
    common, rows = _common(configured, table.dofs)
    if len(common) < phi.shape[1]:
        return None
    count = min(phi.shape[1] + _FURTHER_MODES, configured.n_free)
    solution = direct.modes(configured.at(x), count, None)
    deck_shapes = np.asarray(rows @ solution.shapes[:, : solution.wanted])
    if deck_shapes.shape[1] < phi.shape[1]:
        return None
    mac = _mac(phi[common], deck_shapes)
    members = linear_sum_assignment(-mac)[1]
    modes = ModesBeside(configuration, hz[0], solution.freq_hz[members], mac[np.arange(len(members)), members])
    return Beside(modes, phi, table.dofs, members, solution, common, rows)


def _mac(one: Reals, other: Reals) -> Reals:
    sizes = np.outer((one**2).sum(axis=0), (other**2).sum(axis=0))
    return np.divide((one.T @ other) ** 2, sizes, out=np.zeros_like(sizes), where=sizes > 0.0)


def _common(configured: ConfiguredModel, dofs: DofSet) -> tuple[Integers, sp.csr_array]:
    """Positions of the DOFs that the model has, by node number and component, and what samples its free DOFs there."""
    nodes = configured.model.structure.nodes
    common = [i for i, dof in enumerate(dofs) if nodes.has_grid(dof.node) and 1 <= dof.component <= 6]
    at = [nodes.dof(dofs[i].node, dofs[i].component) for i in common]
    rows = sp.csr_array(configured.transformation.tocsr()[at])
    return np.array(common, np.int64), rows


@dataclass(frozen=True, eq=False)
class DeckDerivatives:
    """Modes near a point: those of the solver at the point, corrected by the exact derivatives of femtune's model.

    Parameters
    ----------
    stiffness, mass : (k, m, m) Cᵀ Kᵢ C and Qᵀ Mᵢ Q by values of the parameters
    outside : (k, s, m) Uᵢ Q
    """

    beside: Beside
    stiffness: Reals
    mass: Reals
    outside: Reals

    @classmethod
    def of(cls, beside: Beside, scales: Mapping[str, float], names: Sequence[str]) -> DeckDerivatives:
        """Derivatives by the parameters `names`, of which `scales` has the free ones of the own model in their order.

        Modes without a partner have none.

        Raises
        ------
        FemtuneError : ``derivative.*``
        """
        derivative = direct.derivative(beside.solution, list(map(int, beside.members)), beside.rows)
        phi = beside.shapes
        u, _, vt = la.svd(np.linalg.pinv(derivative.shapes) @ phi[beside.common])
        Q = u @ vt
        kept, freq_hz = beside.modes.paired, beside.modes.freq_hz
        omega = np.sqrt(np.maximum(derivative.eigenvalues, 0.0))
        rigid = omega <= 0.5 * RIGID_FREQUENCY_RATIO * omega.max(initial=0.0)
        root = np.where(kept, 2.0 * np.pi * freq_hz, 0.0)
        C = np.where(rigid, 0.0, 1.0 / np.where(rigid, 1.0, omega))[:, None] * Q * root
        k, m = len(names), phi.shape[1]
        stiffness, mass, outside = np.zeros((k, m, m)), np.zeros((k, m, m)), np.zeros((k, *phi.shape))
        at = {name: i for i, name in enumerate(scales)}
        both = np.outer(kept, kept)
        for i, name in enumerate(names):
            if name not in at:
                continue
            j, scale = at[name], scales[name]
            stiffness[i] = C.T @ derivative.stiffness[j] @ C / scale
            mass[i] = np.where(both, Q.T @ derivative.mass[j] @ Q, 0.0) / scale
            outside[i, beside.common] = (derivative.outside[:, :, j] @ Q) * kept / scale
        return cls(beside, stiffness, mass, outside)

    def at(self, change: Reals) -> tuple[Reals, Reals]:
        """Frequencies (m,) in Hz and shapes (s, m) after a small change of the parameters (k,)."""
        first = (2.0 * np.pi * self.beside.modes.freq_hz) ** 2
        K = np.diag(first) + np.tensordot(change, self.stiffness, 1)
        M = np.eye(len(first)) + np.tensordot(change, self.mass, 1)
        values, vectors = la.eigh(0.5 * (K + K.T), 0.5 * (M + M.T))
        shapes = (self.beside.shapes + np.tensordot(change, self.outside, 1)) @ vectors
        return np.sqrt(np.maximum(values, 0.0)) / (2.0 * np.pi), shapes

    def table(self, names: Sequence[str], points: Sequence[Reals]) -> RunsTable:
        """The run of the solver at the first point, and modes at the other points."""
        modes = [self.at(point - points[0]) for point in points[1:]]
        hz = np.array([self.beside.modes.freq_hz, *(f for f, _ in modes)])
        shapes = np.array([self.beside.shapes, *(s for _, s in modes)])
        columns = {name: np.array([p[i] for p in points]) for i, name in enumerate(names)}
        return RunsTable(columns, hz, shapes, self.beside.dofs)
