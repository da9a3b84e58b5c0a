"""Fisher information: how well each parameter would be known, alone and beside the others, and in which order to add.

F = SᵀS for residuals in units of their standard deviations and parameters in units of their priors'. Its inverse
bounds the covariance of any unbiased estimate (Cramér and Rao). Designs: D-optimal sets have the largest determinant,
A-optimal ones the least sum of variances (Atkinson, Donev and Tobias 2007).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.selection.combinations import listed
from femtune.selection.subset import Subset, SubsetStep

KNOWN = 1.0 / 3.0
"""Standard deviation, in units of the prior's, below which the data alone determine a parameter."""


@dataclass(frozen=True)
class Information:
    """Fisher information on k parameters in units of their prior standard deviations.

    Parameters
    ----------
    matrix : (k, k) Fisher information F
    alone : (k,) standard deviation were all others known; inf without effect
    together : (k,) Cramér-Rao bound with all of them unknown and no prior; inf where undetermined
    d_order, a_order : positions, the parameter to update first in front: each next one makes the determinant of the
        information largest, or the sum of the variances of those taken smallest
    d_gain : (k,) standard deviation of each parameter of `d_order` beside those before it; inf where dependent
    a_sum : (k,) root of the sum of variances of the first ones of `a_order`; inf where dependent
    """

    names: tuple[str, ...]
    matrix: Reals
    alone: Reals
    together: Reals
    d_order: tuple[int, ...]
    d_gain: Reals
    a_order: tuple[int, ...]
    a_sum: Reals

    @property
    def known(self) -> tuple[str, ...]:
        """Names of the parameters that the data determine if all others are unknown."""
        return tuple(n for n, sd in zip(self.names, self.together) if sd <= KNOWN)


def fisher_information(S: Reals, names: tuple[str, ...]) -> Information:
    """Computed from the scaled Jacobian S (n, k)."""
    F, k = S.T @ S, S.shape[1]
    size = np.linalg.norm(S, axis=0)
    with np.errstate(divide="ignore"):
        alone = 1.0 / size
    d_order, d_gain = _ordered(S, _d_next)
    a_order, a_sum = _ordered(S, _a_next)
    return Information(names, F, alone, _bounds(S, range(k)), d_order, d_gain, a_order, a_sum)


def _bounds(S: Reals, columns: range) -> Reals:
    """1/|s_j freed of all others| for each column."""
    out = np.full(len(columns), np.inf)
    for i in columns:
        others = np.delete(S, i, axis=1)
        out[i] = 1.0 / d if (d := _distance(others, S[:, i])) > 0.0 else np.inf
    return out


def _distance(columns: Reals, s: Reals) -> float:
    """Length of s freed of the columns; zero where it depends on them."""
    length = np.linalg.norm(columns, axis=0)
    u, values, _ = np.linalg.svd(columns[:, length > 0.0] / length[length > 0.0], full_matrices=False)
    u = u[:, values > 1e-10 * values.max(initial=0.0)]
    rest = s - u @ (u.T @ s)
    d = float(np.linalg.norm(rest))
    return d if d > 1e-9 * float(np.linalg.norm(s)) else 0.0


def _ordered(S: Reals, following: object) -> tuple[tuple[int, ...], Reals]:
    taken: list[int] = []
    sizes: list[float] = []
    while len(taken) < S.shape[1]:
        j, size = following(S, taken)  # type: ignore[operator]
        taken.append(j)
        sizes.append(size)
    return tuple(taken), np.array(sizes)


def _d_next(S: Reals, taken: list[int]) -> tuple[int, float]:
    """det grows by the squared length of the new column freed of the others."""
    open_ = [j for j in range(S.shape[1]) if j not in taken]
    lengths = [_distance(S[:, taken], S[:, j]) for j in open_]
    best = int(np.argmax(lengths))
    return open_[best], 1.0 / lengths[best] if lengths[best] > 0.0 else float("inf")


def _a_next(S: Reals, taken: list[int]) -> tuple[int, float]:
    open_ = [j for j in range(S.shape[1]) if j not in taken]
    sums = [_variance_sum(S[:, [*taken, j]]) for j in open_]
    best = int(np.argmin(sums))
    return open_[best], float(np.sqrt(sums[best]))


def _variance_sum(columns: Reals) -> float:
    if np.linalg.matrix_rank(columns, 1e-10 * np.linalg.norm(columns, axis=0).max(initial=0.0)) < columns.shape[1]:
        return float("inf")
    return float(np.sum(np.linalg.pinv(columns) ** 2))


# ----------------------------------------------------------------------------------------------------
# How alike the effects of parameters are: cosines, condition indices, variance shares, collinearity index.
#
# Sources: Belsley, Kuh and Welsch (1980) for condition indices and variance-decomposition proportions; Brun, Reichert
# and Künsch (2001) for the collinearity index.


ALIKE = 0.95
"""Absolute cosine above which two parameters have nearly the same effect."""
STRONG = 30.0
"""Condition index from which Belsley calls a near dependence strong."""
_HIGH_SHARE = 0.5
"""Variance share from which a parameter takes part in a near dependence (Belsley, Kuh and Welsch 1980)."""


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
        """Pairs of parameters with nearly the same effect, most similar first."""
        i, j = np.triu_indices(len(self.names), 1)
        alike = [(int(a), int(b)) for a, b in zip(i, j) if abs(self.cosine[a, b]) >= ALIKE]
        alike.sort(key=lambda p: -abs(self.cosine[p]))
        return tuple((self.names[a], self.names[b], float(self.cosine[a, b])) for a, b in alike)

    @property
    def dependences(self) -> tuple[tuple[float, tuple[str, ...]], ...]:
        """Near dependences: condition index, and the parameters more than half of whose variance comes from it."""
        out = []
        for i in np.flatnonzero(self.condition_index >= STRONG)[::-1]:
            names = tuple(n for n, share in zip(self.names, self.variance_share[i]) if share >= _HIGH_SHARE)
            if len(names) > 1:
                out.append((float(self.condition_index[i]), names))
        return tuple(out)


def collinearity(S: Reals, names: tuple[str, ...]) -> Collinearity:
    """Computed from the scaled Jacobian S (n, k), columns in prior and rows in residual standard deviations."""
    effect = np.linalg.norm(S, axis=0)
    used = effect > 1e-12 * effect.max(initial=0.0)
    unit = S / np.where(used, effect, 1.0) * used
    columns = unit[:, used]
    values, vectors = _directions(columns)
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


# ----------------------------------------------------------------------------------------------------
# Collinearity, information and subset selection in sentences.


_MOST_NAMED = 5
"""Pairs and dependences that are named."""


def measure_sentences(alike: Collinearity, information: Information, subset: Subset) -> list[str]:
    """The measures in sentences, most useful first; empty without parameters."""
    if not alike.names:
        return []
    return [*_of_subset(subset), *_of_pairs(alike), *_of_dependences(alike), *_of_information(information)]


def _of_subset(subset: Subset) -> list[str]:
    if not subset.steps:
        return ["No parameter affects the residuals."]
    if not subset.chosen:
        best = subset.steps[0]
        if np.isnan(best.p_value):
            return [
                f"{best.name} reduces the misfit most, by {100 * (1.0 - best.left):.0f} %. Not tested whether "
                "this is more than noise: the standard deviations are relative weights, and all parameters together "
                "leave no degrees of freedom to estimate their size."
            ]
        return [
            f"No parameter reduces the misfit significantly. The best is {best.name}, which reduces it by "
            f"{100 * (1.0 - best.left):.0f} %. {_against_noise(best)}"
        ]
    last = subset.steps[len(subset.chosen) - 1]
    weakest = max(subset.steps[: len(subset.chosen)], key=lambda step: step.p_value)
    verb, least = (
        ("reduces", "")
        if len(subset.chosen) == 1
        else ("together reduce", f"{weakest.name} is the least significant. ")
    )
    return [
        f"{_few(subset.chosen)} {verb} the misfit by {100 * (1.0 - last.left):.0f} %. {least}{_against_noise(weakest)}"
    ]


def _against_noise(step: SubsetStep) -> str:
    best = "a single candidate" if step.candidates == 1 else f"the best of {step.candidates} candidates"
    return (
        f"Noise alone gives {best} a larger reduction than that of {step.name} with a probability of "
        f"{_chance(step.p_value)}; the limit is 5 %."
    )


def _chance(p: float) -> str:
    return f"{100.0 * p:.2g} %" if p >= 1e-5 else "less than 0.001 %"


def _of_pairs(alike: Collinearity) -> list[str]:
    return [
        f"{a} and {b} have nearly the same effect (cosine {c:+.3f}): tie them, or leave one out."
        for a, b, c in alike.pairs[:_MOST_NAMED]
    ]


def _of_dependences(alike: Collinearity) -> list[str]:
    """Those of more than two, since pairs are listed already."""
    listed_pairs = {frozenset((a, b)) for a, b, _ in alike.pairs}
    return [
        f"The effects of {_few(names)} are nearly linearly dependent (condition index {index:.0f})."
        for index, names in alike.dependences[:_MOST_NAMED]
        if frozenset(names) not in listed_pairs
    ]


def _of_information(information: Information) -> list[str]:
    known = information.known
    if len(known) == len(information.names):
        return []
    if not known:
        return ["The data alone determine no parameter if all others are unknown."]
    return [f"The data alone determine {_few(known)} if all other parameters are unknown."]


def _few(names: tuple[str, ...]) -> str:
    shown = list(names[:8]) + ([f"{len(names) - 8} more"] if len(names) > 8 else [])
    return listed(shown)
