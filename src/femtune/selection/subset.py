"""Subset selection by orthogonal projection: which few parameters explain the residual.

Forward selection takes, one after the other, the parameter whose column lowers |r + S d| most once those taken before
are free to adapt; the others are made orthogonal to it. Stepwise selection also drops one that later ones have made
superfluous.

A step takes the best of all candidates, so that its F value is the largest of many. It is compared with the largest F
value that noise gives with the same candidates. Noise has no preferred direction d in the space of the m candidates
(freed of those taken), and its length ρ is independent of d: with unit columns u_j the gain ρ² max (u_jᵀd)² exceeds a
value with a probability that is a tail of F or χ² for each d, and its mean over d is the p-value. The mean is taken
over random directions; everything else is exact. For one candidate it is the F test.

Sources: Lallement and Piranda (1990); Friswell, Penny and Garvey (1997); Miller, Subset Selection in Regression (2002);
Forsythe, Engelman, Jennrich and May (1973) for the largest F value.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, fdtrc, fdtri

from femtune.arrays import Reals

_INDEPENDENT = 1e-8
"""Part of a column outside those taken before, at or below which it is dependent on them."""
_EXACT_FIT = 1e-12
"""Share of the squares of the residuals that a fit exact but for rounding leaves."""
_DIRECTIONS = 10_000
"""Random directions for the distribution of the largest of several shares: probabilities are known to ± 0.5 %."""


@dataclass(frozen=True)
class SubsetStep:
    """One parameter taken or dropped.

    Parameters
    ----------
    name : of the parameter
    taken : False where it was dropped again
    cosine : of the angle between its column, freed of those taken before, and what is left of the residual
    left : |r| of the best fit with the subset so far, by |r| without any
    f_value : lessening of |r|² by the mean square that all columns leave together (forward), or that is left at this
        step (stepwise); by the stated variance where no freedom is left
    candidates : number of parameters of which this one was the best; 0 for one that was dropped
    p_value : probability that the best of the candidates has a larger F value if the residual is noise; NaN where it
        was not tested: for a parameter that was dropped, and after the first step that is not significant
    """

    name: str
    taken: bool
    cosine: float
    left: float
    f_value: float
    candidates: int
    p_value: float


@dataclass(frozen=True)
class Subset:
    """Order of the forward selection, and the selected parameters.

    `chosen` are the parameters that reduce the residual significantly; `steps` continues beyond them.
    """

    chosen: tuple[str, ...]
    steps: tuple[SubsetStep, ...]

    @property
    def order(self) -> tuple[str, ...]:
        """Names in the order in which they were first taken."""
        return tuple(dict.fromkeys(s.name for s in self.steps if s.taken))


def forward_selection(
    S: Reals,
    r: Reals,
    names: tuple[str, ...],
    significance: float = 0.05,
    lost: int = 0,
    variance_stated: bool = True,
) -> Subset:
    """Order all parameters by what they add.

    Parameters
    ----------
    S, r : (n, k), (n,) scaled Jacobian and residuals; r + S d is to become small
    significance : of the test that ends the choice; the order goes on to the last independent column. r in units of
        its standard deviation, which counts where there are as many columns as independent residuals
    lost : combinations of residuals that are zero whatever the noise and the parameters: one of each shape of unit norm
    variance_stated : False if the standard deviations are relative weights; then nothing is tested, or chosen, where
        there are as many columns as independent residuals
    """
    taken: list[int] = []
    cosines: list[float] = []
    counts: list[int] = []
    while len(taken) < len(r) - lost and (best := _best(S, r, taken)) is not None:
        j, cosine, count = best
        taken.append(j)
        cosines.append(cosine)
        counts.append(count)
    squares = np.array([_square(S, r, taken[:n]) for n in range(len(taken) + 1)])
    values, freedom = _against_all(squares, r, lost)
    chances = np.full(len(taken), np.nan)
    chosen = 0
    for n, value in enumerate(values if variance_stated or freedom else ()):
        chances[n] = _chance_of_gain(_candidates(S, taken[:n]), float(value), freedom)
        if not chances[n] < significance:
            break
        chosen = n + 1
    steps = [
        SubsetStep(names[j], True, cosines[n], _left(S, r, taken[: n + 1]), float(values[n]), counts[n], chances[n])
        for n, j in enumerate(taken)
    ]
    return Subset(tuple(names[j] for j in taken[:chosen]), tuple(steps))


def _against_all(squares: Reals, r: Reals, lost: int) -> tuple[Reals, int]:
    """Gain of each step by the mean square that all columns together leave, and the degrees of freedom of that.

    What a step leaves is no measure of chance as long as other parameters are wrong too. Where all together leave no
    freedom (0), the stated standard deviations are used instead: residuals are in these units.
    """
    freedom, gains = len(r) - lost - len(squares) + 1, squares[:-1] - squares[1:]
    if freedom < 1:
        return gains, 0
    left = max(float(squares[-1]), _EXACT_FIT * float(r @ r)) / freedom
    return (gains / left if left > 0.0 else np.zeros_like(gains)), freedom


def stepwise_selection(
    S: Reals, r: Reals, names: tuple[str, ...], enter: float = 0.05, leave: float = 0.10, lost: int = 0
) -> Subset:
    """Add and drop parameters until neither changes the fit significantly; arguments as of `forward_selection`.

    Parameters
    ----------
    enter : significance of the test of the best candidate against the largest F value of noise
    leave : significance of the F test of a single parameter, above which it is dropped again; enter < leave
    """
    taken: list[int] = []
    steps: list[SubsetStep] = []
    for _ in range(4 * len(names)):
        best = _best(S, r, taken)
        if best is None:
            break
        j, cosine, count = best
        dimension = len(r) - lost - len(taken)
        value = _f_value(S, r, taken, [*taken, j], dimension - 1)
        chance = _chance_of_ratio(_candidates(S, taken), value, dimension)
        if not chance < enter:
            break
        taken.append(j)
        steps.append(SubsetStep(names[j], True, cosine, _left(S, r, taken), value, count, chance))
        steps += _dropped(S, r, names, taken, leave, lost)
    return Subset(tuple(names[j] for j in taken), tuple(steps))


def _dropped(S: Reals, r: Reals, names: tuple[str, ...], taken: list[int], leave: float, lost: int) -> list[SubsetStep]:
    """Drop parameters that have become superfluous, except the last one added; `taken` is changed."""
    out: list[SubsetStep] = []
    while len(taken) > 1:
        freedom = len(r) - lost - len(taken)
        values = [_f_value(S, r, [i for i in taken if i != j], taken, freedom) for j in taken[:-1]]
        worst = int(np.argmin(values))
        if _significant(values[worst], freedom, leave):
            break
        j = taken.pop(worst)
        out.append(SubsetStep(names[j], False, 0.0, _left(S, r, taken), values[worst], 0, float("nan")))
    return out


def _best(S: Reals, r: Reals, taken: list[int]) -> tuple[int, float, int] | None:
    """The column with the largest cosine to what is left, that cosine, and of how many; None without any."""
    rest, size, open_ = _freed(S, taken)
    if not open_.any() or len(taken) >= len(r):
        return None
    basis = _basis(S[:, taken])
    left = r - basis @ (basis.T @ r)
    length = np.linalg.norm(left)
    cosine = np.abs(left @ rest) / np.where(open_, size, 1.0) / (length if length > 0.0 else 1.0)
    j = int(np.argmax(np.where(open_, cosine, -1.0)))
    return j, float(cosine[j]), int(open_.sum())


def _freed(S: Reals, taken: list[int]) -> tuple[Reals, Reals, NDArray[np.bool_]]:
    """All columns freed of those taken, their lengths, and which of them are independent candidates."""
    basis = _basis(S[:, taken])
    rest = S - basis @ (basis.T @ S)
    size, whole = np.linalg.norm(rest, axis=0), np.linalg.norm(S, axis=0)
    open_ = (size > _INDEPENDENT * whole) & (whole > 0.0)
    open_[taken] = False
    return rest, size, open_


def _basis(columns: Reals) -> Reals:
    length = np.linalg.norm(columns, axis=0)
    return np.linalg.qr(columns / np.where(length > 0.0, length, 1.0))[0]


def _square(S: Reals, r: Reals, taken: list[int]) -> float:
    basis = _basis(S[:, taken])
    return float(np.sum((r - basis @ (basis.T @ r)) ** 2))


def _left(S: Reals, r: Reals, taken: list[int]) -> float:
    whole = float(r @ r)
    return float(np.sqrt(_square(S, r, taken) / whole)) if whole > 0.0 else 0.0


def _f_value(S: Reals, r: Reals, fewer: list[int], more: list[int], freedom: int) -> float:
    if freedom < 1:
        return float("nan")
    gain, left = _square(S, r, fewer) - _square(S, r, more), _square(S, r, more)
    # a fit that is exact but for rounding has no mean square to compare with
    left = max(left, _EXACT_FIT * float(r @ r))
    return float(gain * freedom / left) if left > 0.0 else 0.0


def _significant(value: float, freedom: int, level: float) -> bool:
    return bool(freedom >= 1 and np.isfinite(value) and value > fdtri(1, freedom, 1.0 - level))


# ----------------------------------------------------------------------------------------------------
# Chance that the best of all candidates gains as much from noise.


def _candidates(S: Reals, taken: list[int]) -> Reals:
    """(m, k) unit columns of the candidates, freed of those taken, in an orthonormal basis of their own space.

    The basis depends on the order of the columns but not on their lengths and signs, so that the units of parameters
    do not change the directions that are drawn.
    """
    rest, size, open_ = _freed(S, taken)
    unit = rest[:, open_] / size[open_]
    # a generic direction, to which no column is orthogonal by symmetry, gives each its sign
    unit = unit * np.where(np.random.default_rng(1).standard_normal(len(S)) @ unit < 0.0, -1.0, 1.0)
    basis = np.zeros((len(S), 0))
    for u in unit.T:
        once = u - basis @ (basis.T @ u)
        left = once - basis @ (basis.T @ once)
        length = np.linalg.norm(left)
        if length > _INDEPENDENT and basis.shape[1] < len(S) - len(taken):
            basis = np.column_stack([basis, left / length])
    return np.asarray(basis.T @ unit)


def _largest_shares(unit: Reals) -> Reals:
    """max (u_jᵀd)² of random directions d, the same at each call."""
    if len(unit) < 2:
        return np.ones(1)
    d = np.random.default_rng(0).standard_normal((_DIRECTIONS, len(unit)))
    return np.asarray(((d @ unit) ** 2).max(axis=1) / (d**2).sum(axis=1))


def _chance_of_gain(unit: Reals, value: float, freedom: int) -> float:
    """Probability of a larger gain over an independent mean square with these degrees of freedom; 0: variance 1."""
    space = len(unit)
    needed = max(value, 0.0) / _largest_shares(unit)
    tail = chdtrc(space, needed) if freedom < 1 else fdtrc(space, freedom, needed / space)
    return float(np.mean(tail))


def _chance_of_ratio(unit: Reals, value: float, dimension: int) -> float:
    """Probability of a larger gain over the mean square left after it, in a space of this dimension; NaN if it is 1."""
    space, freedom = len(unit), dimension - 1
    if freedom < 1:
        return float("nan")
    value = max(value, 0.0)
    cosine, shares = value / (value + freedom), _largest_shares(unit)
    if space >= dimension:
        return float(np.mean(shares > cosine))
    inside = np.minimum(cosine / shares, 1.0)
    with np.errstate(divide="ignore"):
        odds = inside / (1.0 - inside)
    return float(np.mean(fdtrc(space, dimension - space, odds * (dimension - space) / space)))
