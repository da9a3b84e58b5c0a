"""Subset selection by orthogonal projection: which few parameters explain the residual.

Forward selection takes, one after the other, the parameter whose column lowers |r + S d| most once those taken before
are free to adapt; the others are made orthogonal to it. Stepwise selection also drops one that later ones have made
superfluous.

Sources: Lallement and Piranda (1990); Friswell, Penny and Garvey (1997); Miller, Subset Selection in Regression (2002).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, fdtri

from femtune.arrays import Reals

_INDEPENDENT, _FULL = 1e-8, 1e-12


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
    """

    name: str
    taken: bool
    cosine: float
    left: float
    f_value: float


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


def forward_selection(S: Reals, r: Reals, names: tuple[str, ...], significance: float = 0.05) -> Subset:
    """Order all parameters by what they add.

    Parameters
    ----------
    S, r : (n, k), (n,) scaled Jacobian and residuals; r + S d is to become small
    significance : of the F test that ends the choice; the order goes on to the last independent column. r in units of
        its standard deviation, which counts where there are as many columns as residuals
    """
    taken: list[int] = []
    cosines: list[float] = []
    while (best := _best(S, r, taken)) is not None:
        taken.append(best[0])
        cosines.append(best[1])
    squares = np.array([_square(S, r, taken[:n]) for n in range(len(taken) + 1)])
    values, limit = _against_all(squares, r, significance)
    steps = [
        SubsetStep(names[j], True, c, _left(S, r, taken[: n + 1]), float(values[n]))
        for n, (j, c) in enumerate(zip(taken, cosines))
    ]
    chosen = int(np.append(values > limit, False).argmin())
    return Subset(tuple(names[j] for j in taken[:chosen]), tuple(steps))


def _against_all(squares: Reals, r: Reals, significance: float) -> tuple[Reals, float]:
    """Gain of each step by the mean square that all columns together leave, and the value that chance exceeds seldom.

    What a step leaves is no measure of chance as long as other parameters are wrong too. Where all together leave no
    freedom, the stated standard deviations are used instead: residuals are in these units.
    """
    freedom, gains = len(r) - len(squares) + 1, squares[:-1] - squares[1:]
    if freedom < 1:
        return gains, float(chdtri(1, significance))
    left = max(float(squares[-1]), _FULL * float(r @ r)) / freedom
    limit = float(fdtri(1, freedom, 1.0 - significance))
    return (gains / left if left > 0.0 else np.zeros_like(gains)), limit


def stepwise_selection(S: Reals, r: Reals, names: tuple[str, ...], enter: float = 0.05, leave: float = 0.10) -> Subset:
    """Add and drop parameters until neither changes the fit significantly; arguments as of `forward_selection`.

    Parameters
    ----------
    enter, leave : significance to be taken, and above which a parameter is dropped again; enter < leave
    """
    taken: list[int] = []
    steps: list[SubsetStep] = []
    for _ in range(4 * len(names)):
        best = _best(S, r, taken)
        if best is None:
            break
        j, cosine = best
        value = _f_value(S, r, taken, [*taken, j])
        if not _significant(value, len(r) - len(taken) - 1, enter):
            break
        taken.append(j)
        steps.append(SubsetStep(names[j], True, cosine, _left(S, r, taken), value))
        steps += _dropped(S, r, names, taken, leave)
    return Subset(tuple(names[j] for j in taken), tuple(steps))


def _dropped(S: Reals, r: Reals, names: tuple[str, ...], taken: list[int], leave: float) -> list[SubsetStep]:
    """Drop parameters that have become superfluous, except the last one added; `taken` is changed."""
    out: list[SubsetStep] = []
    while len(taken) > 1:
        values = [_f_value(S, r, [i for i in taken if i != j], taken) for j in taken[:-1]]
        worst = int(np.argmin(values))
        if _significant(values[worst], len(r) - len(taken), leave):
            break
        j = taken.pop(worst)
        out.append(SubsetStep(names[j], False, 0.0, _left(S, r, taken), values[worst]))
    return out


def _best(S: Reals, r: Reals, taken: list[int]) -> tuple[int, float] | None:
    """The column with the largest cosine to what is left, and that cosine; None where none is independent."""
    basis = _basis(S[:, taken])
    rest, left = S - basis @ (basis.T @ S), r - basis @ (basis.T @ r)
    size, whole = np.linalg.norm(rest, axis=0), np.linalg.norm(S, axis=0)
    open_ = (size > _INDEPENDENT * whole) & (whole > 0.0)
    open_[taken] = False
    if not open_.any() or len(taken) >= len(r):
        return None
    length = np.linalg.norm(left)
    cosine = np.abs(left @ rest) / np.where(open_, size, 1.0) / (length if length > 0.0 else 1.0)
    j = int(np.argmax(np.where(open_, cosine, -1.0)))
    return j, float(cosine[j])


def _basis(columns: Reals) -> Reals:
    length = np.linalg.norm(columns, axis=0)
    return np.linalg.qr(columns / np.where(length > 0.0, length, 1.0))[0]


def _square(S: Reals, r: Reals, taken: list[int]) -> float:
    basis = _basis(S[:, taken])
    return float(np.sum((r - basis @ (basis.T @ r)) ** 2))


def _left(S: Reals, r: Reals, taken: list[int]) -> float:
    whole = float(r @ r)
    return float(np.sqrt(_square(S, r, taken) / whole)) if whole > 0.0 else 0.0


def _f_value(S: Reals, r: Reals, fewer: list[int], more: list[int]) -> float:
    freedom = len(r) - len(more)
    if freedom < 1:
        return float("nan")
    gain, left = _square(S, r, fewer) - _square(S, r, more), _square(S, r, more)
    # a fit that is exact but for rounding has no mean square to compare with
    left = max(left, _FULL * float(r @ r))
    return float(gain * freedom / left) if left > 0.0 else 0.0


def _significant(value: float, freedom: int, level: float) -> bool:
    return bool(freedom >= 1 and np.isfinite(value) and value > fdtri(1, freedom, 1.0 - level))
