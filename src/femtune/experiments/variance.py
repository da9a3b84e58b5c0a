"""Range analysis and analysis of variance of the main effects of a design by levels.

The model is y = μ + Σ α(level of each factor) + ε. The sum of squares of a factor is what the residual gains when the
factor is left out; for an orthogonal array that is Σ n (mean of a level − mean)², and the sums of all factors and the
error add up to the total. Runs may be missing: the sums of squares are then each factor's own beside all others, and do
not add up.

Source: Montgomery 2017.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from femtune.arrays import Flags, Integers, Reals
from femtune.errors import FemtuneError

_EXACT = 1e-12
"""Residual sum of squares, relative to the total, below which the error is rounding and F says nothing."""

_ROUNDING = 1e-13
"""Range of a response relative to its size up to which it is rounding."""


@dataclass(frozen=True, eq=False)
class Effects:
    """Main effects of n factors on m responses.

    Parameters
    ----------
    level_means : of each factor, (levels, m) mean of the responses over the runs of each level
    ranges : (n, m) largest mean of a level minus the smallest
    squares : (n, m) sum of squares of each factor
    freedom : (n,) its degrees of freedom
    error_squares, total_squares : (m,)
    error_freedom : degrees of freedom left for the error; 0 for a saturated design
    """

    level_means: tuple[Reals, ...]
    ranges: Reals
    squares: Reals
    freedom: Integers
    error_squares: Reals
    total_squares: Reals
    error_freedom: int

    @property
    def contribution(self) -> Reals:
        """(n, m) part of each factor in the total sum of squares; 0 for a response that does not vary."""
        total = np.where(self.total_squares > 0.0, self.total_squares, np.inf)
        return np.asarray(self.squares / total)

    @property
    def error_contribution(self) -> Reals:
        """(m,) part of the error in the total sum of squares: what main effects do not explain."""
        return np.asarray(self.error_squares / np.where(self.total_squares > 0.0, self.total_squares, np.inf))

    @property
    def f_values(self) -> Reals:
        """(n, m) mean square of the factor over that of the error; NaN without degrees of freedom for the error.

        Infinite where main effects explain a response exactly.
        """
        if self.error_freedom == 0:
            return np.full(self.squares.shape, np.nan)
        exact = self.error_squares <= _EXACT * self.total_squares
        error = np.where(exact, 1.0, self.error_squares) / self.error_freedom
        means = self.squares / self.freedom[:, None]
        nothing = np.where(self.squares > _EXACT * self.total_squares, np.inf, np.nan)
        return np.where(exact, nothing, means / error)

    @property
    def p_values(self) -> Reals:
        """(n, m) probability of at least this F if the factor had no effect and the error were normal.

        NaN where F is infinite: there is no error that could be normal.
        """
        f = np.where(np.isinf(self.f_values), np.nan, self.f_values)
        return np.asarray(fdtrc(self.freedom[:, None], max(self.error_freedom, 1), f))


def main_effects(levels: Integers, responses: Reals) -> Effects:
    """Range analysis and analysis of variance.

    Parameters
    ----------
    levels : (runs, n) level of each factor, any integers
    responses : (runs, m)

    Raises
    ------
    FemtuneError : ``screen.one-level``, ``screen.confounded``, ``screen.too-few-runs``, ``screen.not-finite``

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.experiments import main_effects
    >>> levels = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
    >>> effects = main_effects(levels, np.array([[1.0], [2.0], [4.0], [5.5]]))
    >>> effects.squares.ravel(), effects.error_squares
    (array([10.5625,  1.5625]), array([0.0625]))
    """
    levels, responses = np.asarray(levels), np.asarray(responses, dtype=float)
    if not np.all(np.isfinite(responses)):
        raise FemtuneError("screen.not-finite", runs=", ".join(str(i + 1) for i in _bad_rows(responses)))
    codes = [np.unique(column, return_inverse=True)[1] for column in levels.T]
    constant = [i + 1 for i, code in enumerate(codes) if code.max() == 0]
    if constant:
        raise FemtuneError("screen.one-level", factors=", ".join(map(str, constant)))
    blocks = [np.eye(code.max() + 1)[code] for code in codes]
    runs, freedom = len(levels), np.array([block.shape[1] - 1 for block in blocks])
    if runs < 1 + freedom.sum():
        raise FemtuneError("screen.too-few-runs", runs=runs, needed=1 + freedom.sum())
    _check_separate(blocks, 1 + int(freedom.sum()))
    centred = responses - responses.mean(axis=0)
    centred[:, constant_responses(responses)] = 0.0
    error = _residual_squares(blocks, centred)
    rest = [_residual_squares(blocks[:i] + blocks[i + 1 :], centred) for i in range(len(blocks))]
    means = tuple(block.T @ responses / block.sum(axis=0)[:, None] for block in blocks)
    return Effects(
        means,
        np.array([np.ptp(mean, axis=0) for mean in means]),
        np.array([without - error for without in rest]),
        freedom,
        error,
        np.asarray(np.sum(centred**2, axis=0)),
        runs - 1 - int(freedom.sum()),
    )


def constant_responses(responses: Reals) -> Flags:
    """(m,) responses (runs, m) that vary by rounding alone."""
    return np.asarray(np.ptp(responses, axis=0) <= _ROUNDING * np.abs(responses).max(axis=0))


def _bad_rows(responses: Reals) -> Integers:
    return np.asarray(np.flatnonzero(~np.isfinite(responses).all(axis=1)))


def _matrix(blocks: list[Reals]) -> Reals:
    """The constant, and every level of every factor but its first."""
    runs = len(blocks[0]) if blocks else 0
    return np.hstack([np.ones((runs, 1)), *(block[:, 1:] for block in blocks)])


def _residual_squares(blocks: list[Reals], responses: Reals) -> Reals:
    """(m,) residual sum of squares of a fit of main effects; the total where there is no factor."""
    if not blocks:
        return np.asarray(np.sum((responses - responses.mean(axis=0)) ** 2, axis=0))
    q, _ = np.linalg.qr(_matrix(blocks))
    return np.asarray(np.sum((responses - q @ (q.T @ responses)) ** 2, axis=0))


def _check_separate(blocks: list[Reals], rank: int) -> None:
    if np.linalg.matrix_rank(_matrix(blocks)) < rank:
        raise FemtuneError("screen.confounded")
