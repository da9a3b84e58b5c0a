"""Tables over frequency that multiply values of the model: modulus and loss factor of rubber, springs, dashpots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from femtune.arrays import Reals
from femtune.errors import FemtuneError, Where
from femtune.fem.fields import FieldRef


@dataclass(frozen=True, eq=False)
class FrequencyTable:
    """A factor on fields, linear between its frequencies and constant outside.

    Parameters
    ----------
    fields : fields that it multiplies, whatever their region; with the number 0 those of all cards of the name
    freq_hz : (n,) ascending
    factor : (n,) positive; 1 is the value of the deck, or of the parameter that sets the field
    where : its place in a study

    Raises
    ------
    FemtuneError : ``table.values``

    Examples
    --------
    >>> from femtune.fem import FieldRef
    >>> table = frequency_table([FieldRef("MAT1", 2, "E")], [10.0, 100.0], [1.0, 1.6])
    >>> table.at(55.0)
    (1.3, 0.00666...)
    """

    fields: tuple[FieldRef, ...]
    freq_hz: Reals
    factor: Reals
    where: Where | None = None

    def __post_init__(self) -> None:
        problem = _problem(self.freq_hz, self.factor)
        if problem:
            raise FemtuneError("table.values", where=self.where, problem=problem)

    def at(self, freq_hz: float) -> tuple[float, float]:
        """The factor at a frequency, and its derivative in 1/Hz; at a frequency of the table the mean of both sides."""
        x, y = self.freq_hz, self.factor
        slopes = np.concatenate([[0.0], np.diff(y) / np.diff(x), [0.0]])
        sides = (np.searchsorted(x, freq_hz, side) for side in ("left", "right"))
        return float(np.interp(freq_hz, x, y)), float(np.mean([slopes[i] for i in sides]))

    def multiplies(self, ref: FieldRef) -> bool:
        """Whether it multiplies a field."""
        plain = replace(ref, region="")
        return plain in self.fields or replace(plain, id=0) in self.fields


def frequency_table(
    fields: Sequence[FieldRef], freq_hz: ArrayLike, factor: ArrayLike, where: Where | None = None
) -> FrequencyTable:
    """A table from lists; see `FrequencyTable`."""
    return FrequencyTable(tuple(fields), np.asarray(freq_hz, float), np.asarray(factor, float), where)


def _problem(x: Reals, y: Reals) -> str:
    if x.ndim != 1 or not x.size or x.shape != y.shape:
        return f"it has {x.size} frequencies and {y.size} factors"
    if not np.isfinite([*x, *y]).all():
        return "it contains values that are not finite"
    if (np.diff(x) <= 0.0).any() or x[0] < 0.0:
        return "its frequencies must be ascending and not negative"
    return "its factors must be positive" if (y <= 0.0).any() else ""
