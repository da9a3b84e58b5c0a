"""Master DOFs of a condensation, and the blocks that they divide K and M into."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from femtune.errors import FemtuneError
from femtune.model.configured import ConfiguredModel

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]
Matrix: TypeAlias = NDArray[np.float64] | sp.sparray

_KEPT = ("ASET", "BSET", "CSET")


@dataclass(frozen=True, eq=False)
class Reduction:
    """A condensed model: u = T q.

    Parameters
    ----------
    transformation : T (n, r)
    stiffness, mass : (r, r) TᵀKT and TᵀMT
    masters : (m,) DOFs that the first m coordinates are; further ones are amplitudes of modes
    """

    transformation: Reals
    stiffness: Reals
    mass: Reals
    masters: Integers


@dataclass(frozen=True, eq=False)
class Partition:
    """K and M by masters (a) and slaves (o)."""

    K: sp.csr_array
    M: sp.csr_array
    masters: Integers

    @classmethod
    def of(cls, K: Matrix, M: Matrix, masters: ArrayLike) -> Partition:
        """From full symmetric matrices (n, n) and the positions of the masters.

        Raises
        ------
        FemtuneError : ``reduce.masters``
        """
        chosen = np.asarray(masters, dtype=np.int64).ravel()
        n = K.shape[0]
        if not chosen.size or len(set(chosen.tolist())) < chosen.size or chosen.min() < 0 or chosen.max() >= n:
            raise FemtuneError(
                "reduce.masters",
                "the masters are not a set of degrees of freedom of the model",
                values={"masters": int(chosen.size), "degrees of freedom": n},
                hint="give each free DOF that is kept once, by its position",
            )
        return cls(sp.csr_array(K), sp.csr_array(M), chosen)

    @cached_property
    def slaves(self) -> Integers:
        """(n − m,) DOFs that are condensed."""
        kept = np.zeros(self.K.shape[0], bool)
        kept[self.masters] = True
        return np.flatnonzero(~kept)

    def block(self, A: sp.csr_array, rows: Integers, columns: Integers) -> sp.csr_array:
        """Some rows and columns of a matrix."""
        return sp.csr_array(A[rows][:, columns])

    def transformation(self, of_slaves: Reals) -> Reals:
        """T (n, m) from the slaves' part (n − m, m): masters move as they are told."""
        T = np.zeros((self.K.shape[0], len(self.masters)))
        T[self.masters] = np.eye(len(self.masters))
        T[self.slaves] = of_slaves
        return T

    def reduced(self, T: Reals) -> Reduction:
        """K and M on T."""
        k, m = T.T @ (self.K @ T), T.T @ (self.M @ T)
        return Reduction(T, 0.5 * (k + k.T), 0.5 * (m + m.T), self.masters)


def deck_masters(configured: ConfiguredModel) -> Integers:
    """Positions of the free DOFs that the deck's sets keep: ASET, BSET and CSET, or all but OMIT.

    Raises
    ------
    FemtuneError : ``reduce.no-masters`` where the deck has no such set, or none of its DOFs is free
    """
    sets = configured.model.structure.dof_sets
    kept = _joined(sets[name] for name in _KEPT if name in sets)
    if kept.size:
        found = np.flatnonzero(np.isin(configured.free, kept))
    else:
        omitted = sets.get("OMIT", np.zeros(0, np.int64))
        found = np.flatnonzero(~np.isin(configured.free, omitted)) if omitted.size else omitted
    if not found.size:
        raise FemtuneError(
            "reduce.no-masters",
            f"configuration {configured.configuration.name}: no set of the deck keeps a free DOF",
            values={"sets": ", ".join(sets) or "none"},
            hint="add ASET cards, or give the masters by hand",
        )
    return found


def _joined(sets: Iterable[Integers]) -> Integers:
    return np.unique(np.concatenate([np.zeros(0, np.int64), *sets]))
