"""How alike the effects of parameters are: cosines, condition indices, variance shares, collinearity index.

Sources: Belsley, Kuh and Welsch (1980) for condition indices and variance-decomposition proportions; Brun, Reichert
and Künsch (2001) for the collinearity index.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]

ALIKE = 0.95
"""Absolute cosine from which two parameters do nearly the same."""
STRONG = 30.0
"""Condition index from which Belsley calls a near dependence strong."""
_SHARE = 0.5


@dataclass(frozen=True)
class Collinearity:
    """Likeness of k columns of a sensitivity matrix; columns without effect are left out of all but `effect`.

    Parameters
    ----------
    effect : (k,) length of each column: its effect over one prior standard deviation, in residual ones
    cosine : (k, k) cosines between columns; zero beside a column without effect
    condition_index : (k,) largest singular value of the unit columns by each, ascending; inf for a dependence
    variance_share : (k, k) part of the variance of parameter j (column) that comes from the i-th index
    index : collinearity index of all columns with an effect, 1 for orthogonal ones, inf for dependent ones
    """

    names: tuple[str, ...]
    effect: Reals
    cosine: Reals
    condition_index: Reals
    variance_share: Reals
    index: float

    @property
    def pairs(self) -> tuple[tuple[str, str, float], ...]:
        """Pairs of parameters that do nearly the same, the most alike first."""
        i, j = np.triu_indices(len(self.names), 1)
        found = [(int(a), int(b)) for a, b in zip(i, j) if abs(self.cosine[a, b]) >= ALIKE]
        found.sort(key=lambda p: -abs(self.cosine[p]))
        return tuple((self.names[a], self.names[b], float(self.cosine[a, b])) for a, b in found)

    @property
    def dependences(self) -> tuple[tuple[float, tuple[str, ...]], ...]:
        """Near dependences: condition index, and the parameters more than half of whose variance comes from it."""
        out = []
        for i in np.flatnonzero(self.condition_index >= STRONG)[::-1]:
            names = tuple(n for n, share in zip(self.names, self.variance_share[i]) if share >= _SHARE)
            if len(names) > 1:
                out.append((float(self.condition_index[i]), names))
        return tuple(out)


def collinearity(S: Reals, names: tuple[str, ...]) -> Collinearity:
    """Of the scaled Jacobian S (n, k), columns in prior and rows in residual standard deviations."""
    effect = np.linalg.norm(S, axis=0)
    used = effect > 1e-12 * effect.max(initial=0.0)
    unit = S / np.where(used, effect, 1.0) * used
    own = unit[:, used]
    values, vectors = _directions(own)
    k, u = len(names), np.flatnonzero(used)
    indices, shares = np.full(k, np.inf), np.zeros((k, k))
    with np.errstate(divide="ignore", invalid="ignore"):
        indices[: len(u)] = values.max(initial=0.0) / values
        parts = (vectors / values[:, None]) ** 2
        shares[np.ix_(np.arange(len(u)), u)] = np.nan_to_num(parts / parts.sum(axis=0), nan=1.0)
    least = float(values.min(initial=np.inf))
    return Collinearity(names, effect, unit.T @ unit, indices, shares, 1.0 / least if least > 0.0 else float("inf"))


def _directions(unit: Reals) -> tuple[Reals, Reals]:
    """Singular values (descending, those of rounding set to zero) and right vectors as rows."""
    k = unit.shape[1]
    _, s, vt = np.linalg.svd(np.vstack([unit, np.zeros((max(0, k - len(unit)), k))]), full_matrices=False)
    return np.where(s > 1e-10 * s.max(initial=0.0), s, 0.0), vt
