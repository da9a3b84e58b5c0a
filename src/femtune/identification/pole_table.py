"""PoleTable: every pole that any method found at any model order, with its shape."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal import freq_and_damping
from femtune.modal.mode_set import read_only


@dataclass(frozen=True, eq=False)
class PoleTable:
    """Poles in the upper half plane, of several model orders and methods; its arrays are read-only.

    Parameters
    ----------
    poles : (p,) in rad/s, with positive imaginary parts; poles that grow (negative damping) are kept and marked
        by it
    shapes : (n, p) complex shapes at the responses
    order : (p,) model order that each was found at
    method : (p,) names of the methods
    dofs : the n DOFs of the shapes

    Raises
    ------
    FemtuneError : ``poles.shape`` where the sizes disagree
    """

    poles: NDArray[np.complex128]
    shapes: NDArray[np.complex128]
    order: NDArray[np.int64]
    method: tuple[str, ...]
    dofs: DofSet

    def __post_init__(self) -> None:
        object.__setattr__(self, "poles", read_only(self.poles, complex))
        object.__setattr__(self, "shapes", read_only(self.shapes, complex))
        object.__setattr__(self, "order", read_only(self.order, int))
        p = len(self.poles)
        sizes = {"shapes": self.shapes.shape, "order": self.order.shape, "method": (len(self.method),)}
        if sizes != {"shapes": (len(self.dofs), p), "order": (p,), "method": (p,)}:
            raise FemtuneError("poles.shape/sizes", values=sizes, n_poles=p)

    def __len__(self) -> int:
        return len(self.poles)

    @property
    def freq_hz(self) -> Reals:
        """(p,) natural frequencies."""
        return freq_and_damping(self.poles)[0]

    @property
    def damping_ratio(self) -> Reals:
        """(p,) fractions of critical; negative where a pole grows."""
        return freq_and_damping(self.poles)[1]

    def select(self, keep: Iterable[int] | NDArray) -> PoleTable:
        """The poles at the given positions, in that order, or where a mask is true."""
        at = np.asarray(list(keep))
        at = np.flatnonzero(at) if at.dtype == bool else at.astype(int)
        names = tuple(self.method[i] for i in at)
        return PoleTable(self.poles[at], self.shapes[:, at], self.order[at], names, self.dofs)


def join_tables(tables: Sequence[PoleTable]) -> PoleTable:
    """One table of all poles.

    Raises
    ------
    FemtuneError : ``poles.shape`` where the tables have other DOFs
    """
    if any(table.dofs != tables[0].dofs for table in tables):
        raise FemtuneError("poles.shape")
    return PoleTable(
        np.concatenate([t.poles for t in tables]),
        np.hstack([t.shapes for t in tables]),
        np.concatenate([t.order for t in tables]),
        tuple(name for t in tables for name in t.method),
        tables[0].dofs,
    )


def table_of(
    poles: Sequence[NDArray], shapes: Sequence[NDArray], orders: Sequence[int], method: str, dofs: DofSet
) -> PoleTable:
    """A table of one method's poles (upper half plane only) at each of its orders.

    Parameters
    ----------
    poles, shapes : for each order (p_i,) and (n, p_i), conjugates included
    """
    up = [np.flatnonzero((p.imag > 0.0) & np.isfinite(p)) for p in poles]
    count = [len(i) for i in up]
    empty = np.zeros((len(dofs), 0), complex)
    return PoleTable(
        np.concatenate([np.zeros(0, complex), *(p[i] for p, i in zip(poles, up))]),
        np.hstack([empty, *(s[:, i] for s, i in zip(shapes, up))]),
        np.repeat(np.asarray(list(orders), dtype=int), count),
        (method,) * sum(count),
        dofs,
    )
