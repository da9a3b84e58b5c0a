"""Are the residuals noise? Chi-square test with the stated standard deviations, a test of runs, the largest residual.

The part of the residuals that no parameters could remove is looked at: r⊥ = r − U Uᵀ r with U spanning the Jacobian's
range. If the model is correct and the stated standard deviations are those of the data, |r⊥|² is chi-square with n −
rank degrees of freedom, whatever the regularisation and the bounds did to the parameters (to first order). Where an
update ended without an optimum, r⊥ would be the prediction of a linear model for values that do not exist: r itself is
looked at.

Source: Bard (1974), Nonlinear Parameter Estimation, section 7; Wald and Wolfowitz (1940) for runs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, gammaln, logsumexp

from femtune.arrays import Reals
from femtune.residuals import ResidualBlock
from femtune.validation.criteria import Outcome

LEVEL = 0.01
"""Residuals with a smaller probability than this are not called noise."""


class Finding(Enum):
    """Joint conclusion from the sum of squares and the sequence of signs; the text begins the sentence of a report."""

    NOT_TESTED = "not tested"
    NOISE = "the residuals may be noise of the stated size"
    SMALL = (
        "the fit is better than the stated standard deviations predict: they are probably too large, or the errors of "
        "the values are correlated"
    )
    SMALL_SYSTEMATIC = (
        "the fit is better than the stated standard deviations predict, and the residuals are not random: the "
        "standard deviations are probably too large, or the errors of the values are correlated"
    )
    SYSTEMATIC = "the residuals have the stated size, but they are not random"
    LARGE = "the residuals are larger than noise of the stated size"
    LARGE_SYSTEMATIC = "the residuals are larger than noise of the stated size, and they are not random"
    BOUNDED = "the bounds keep residuals that noise of the stated size does not explain"

    @property
    def outcome(self) -> Outcome:
        """Residuals of the stated size or larger that are no noise fail.

        Smaller ones are no proof: with standard deviations that are too large everything fits.
        """
        if self in (Finding.NOT_TESTED, Finding.SMALL, Finding.SMALL_SYSTEMATIC):
            return Outcome.NOT_TESTED
        failed = (Finding.SYSTEMATIC, Finding.LARGE, Finding.LARGE_SYSTEMATIC, Finding.BOUNDED)
        return Outcome.FAIL if self in failed else Outcome.PASS

    @property
    def larger(self) -> bool:
        """True where the stated standard deviations may be too small."""
        return self in (Finding.LARGE, Finding.LARGE_SYSTEMATIC)


_FEWEST_SIGNS = 10
"""Residuals for a test of the sequence of their signs; fewer hardly ever reject."""
RANK = 1e-10
"""Singular value of scaled columns relative to the largest, at or below which they are dependent."""


@dataclass(frozen=True)
class GoodnessOfFit:
    """Outcome of the tests; numbers are None if nothing was tested.

    Parameters
    ----------
    chi_square, degrees_of_freedom : |r⊥|² (|r|² without an optimum) and n − rank
    p_value : chance of a chi-square as large or larger where the residuals are noise of the stated size
    runs, runs_p_value : runs of one sign in the order of the comparisons, and the chance of as few; None for fewer than
        ten residuals
    largest, largest_label : largest studentised residual, with its sign, and what it compares
    by_kind : chi-square, degrees of freedom and p-value of each kind of residual by itself
    untested : by kind of residual, why it is not in the test
    values, rank : independent values of all residuals, and how many combinations of the parameters fit themselves to
        them; of those not in the test too
    held, held_p_value : chi-square that the parameters would remove from the residuals without bounds, and the chance
        of as much where the true values are within the bounds: the true values leave a chi-square distribution with
        `rank` degrees of freedom, and the minimum within the bounds is not above them. None if no bound is active
    optimum : False if the residuals are those of values at which the update ended without an optimum
    assumed : True if the stated size is an assumption, for the words of `sentence`
    """

    chi_square: float | None
    degrees_of_freedom: int
    p_value: float | None
    runs: int | None = None
    runs_p_value: float | None = None
    largest: float | None = None
    largest_label: str = ""
    by_kind: tuple[tuple[str, float, int, float], ...] = ()
    untested: tuple[tuple[str, str], ...] = ()
    values: int = 0
    rank: int = 0
    held: float | None = None
    held_p_value: float | None = None
    optimum: bool = True
    assumed: bool = False

    @property
    def finding(self) -> Finding:
        """Size and order of the residuals together, and what the bounds keep of them."""
        finding = self._of_size_and_order
        return Finding.BOUNDED if self.bounds_contradict and finding.outcome is not Outcome.FAIL else finding

    @property
    def bounds_contradict(self) -> bool:
        """True if noise does not explain what the parameters would remove without bounds."""
        return self.held_p_value is not None and self.held_p_value < LEVEL

    @property
    def _of_size_and_order(self) -> Finding:
        if self.p_value is None:
            return Finding.NOT_TESTED
        random = self.runs_p_value is None or self.runs_p_value >= LEVEL
        if self.p_value < LEVEL:
            return Finding.LARGE if random else Finding.LARGE_SYSTEMATIC
        if self.p_value > 1.0 - LEVEL:
            return Finding.SMALL if random else Finding.SMALL_SYSTEMATIC
        return Finding.NOISE if random else Finding.SYSTEMATIC

    @property
    def outcome(self) -> Outcome:
        """Pass if the residuals may be noise of the stated size."""
        return self.finding.outcome

    @property
    def sentence(self) -> str:
        """Outcome in words with the numbers."""
        finding = self.finding.value.replace("stated", "assumed") if self.assumed else self.finding.value
        if self.p_value is None or self.chi_square is None:
            return f"{finding}: {self._held() if self.bounds_contradict else self._why_not()}"
        degrees = "degree" if self.degrees_of_freedom == 1 else "degrees"
        numbers = f"chi-square {self.chi_square:.4g} on {self.degrees_of_freedom} {degrees} of freedom"
        largest = self._largest() if self.finding.larger else ""
        tested = f"{numbers}, {_chance(self.p_value)}{self._runs()}{largest}"
        if self.finding is Finding.BOUNDED:
            return f"{finding}: {self._held()}; without it, {tested}"
        if not self.optimum:
            tested += "; the update ended without an optimum, and these are the residuals at the values that were kept"
        held = f"; bounds keep more: {self._held()}" if self.bounds_contradict else ""
        return f"{finding}: {tested}{held}"

    def _held(self) -> str:
        assert self.held is not None
        assert self.held_p_value is not None
        return (
            f"the parameters would remove a chi-square of {self.held:.4g} if they were not bounded, "
            f"{_chance(self.held_p_value)}"
        )

    def _why_not(self) -> str:
        if self.untested:
            return "; ".join(f"{kind} residuals: {reason}" for kind, reason in self.untested)
        return "there are no more residuals than parameters, so that no degrees of freedom are left"

    def _runs(self) -> str:
        if self.runs is None or self.runs_p_value is None or self.runs_p_value >= LEVEL:
            return ""
        return f"; the residuals change sign less often than random errors do ({_chance(self.runs_p_value)})"

    def _largest(self) -> str:
        return f"; the largest is {self.largest:+.1f} σ, {self.largest_label}" if self.largest is not None else ""


def _chance(p: float) -> str:
    """The probability; one that rounds to 1 is not written as certainty."""
    if p > 0.995:
        return "p > 0.99"
    return f"p = {p:.2g}" if p >= 1e-12 else "p < 1e-12"


def goodness_of_fit(
    blocks: Sequence[ResidualBlock],
    *,
    prior: Sequence[ResidualBlock] = (),
    untested: str = "",
    bounded: bool = False,
    optimum: bool = True,
) -> GoodnessOfFit:
    """Test the residuals of an update at its last point.

    Blocks that have no normal distribution are left out of the test with their reason; of the others each says how many
    of its values are independent, and their covariance.

    Parameters
    ----------
    blocks : with derivatives
    prior : the rows of a prior, tested like the others: what it holds is a misfit of both together
    untested : why none of them can be tested; "" where they can
    bounded : whether bounds, and nothing else, keep the parameters from the least squares of all blocks; where all
        kinds are tested, it is tested whether noise explains what they keep
    optimum : False if the update ended without an optimum: all of the residuals is tested, not only the part that the
        parameters cannot change
    """
    why = {b.kind: reason for b in blocks if (reason := untested or b.without_distribution)}
    kept = [b.whitened() for b in blocks if b.kind not in why]
    kept += prior if kept else ()
    skipped, (values, rank) = tuple(why.items()), _counts(blocks)
    chi2, dof = _chi_square(kept, optimum)
    held, chance_held = _held(kept) if bounded and not skipped else (None, None)
    if dof <= 0:
        return GoodnessOfFit(
            None, 0, None, untested=skipped, values=values, rank=rank, held=held, held_p_value=chance_held,
            optimum=optimum,
        )  # fmt: skip
    rest, spread = _left_over(kept, optimum)
    runs, chance = _runs(rest)
    at = int(np.argmax(np.abs(rest) / spread))
    label = [b.label for b in kept for _ in b.values][at]
    numbers = GoodnessOfFit(chi2, dof, _p_value(chi2, dof), runs, chance, float(rest[at] / spread[at]), label)
    return replace(
        numbers, by_kind=tuple(_by_kind(kept, optimum)), untested=skipped, values=values, rank=rank, held=held,
        held_p_value=chance_held, optimum=optimum,
    )  # fmt: skip


def _held(blocks: Sequence[ResidualBlock]) -> tuple[float, float]:
    r, U = _range(blocks)
    squares = float(np.sum((U.T @ r) ** 2))
    return squares, _p_value(squares, U.shape[1])


def _counts(blocks: Sequence[ResidualBlock]) -> tuple[int, int]:
    """Independent values, and the rank of the Jacobian."""
    if not blocks:
        return 0, 0
    r, U = _range([b.whitened() for b in blocks])
    return len(r) - sum(b.lost for b in blocks), U.shape[1]


def _chi_square(blocks: Sequence[ResidualBlock], optimum: bool) -> tuple[float, int]:
    if not blocks:
        return 0.0, 0
    r, U = _range(blocks)
    rest = r - U @ (U.T @ r) if optimum else r
    return float(rest @ rest), len(r) - U.shape[1] - sum(b.lost for b in blocks)


def _range(blocks: Sequence[ResidualBlock]) -> tuple[Reals, Reals]:
    """Residuals (n,) and an orthonormal basis (n, rank) of the Jacobian's range; columns are scaled first."""
    r = np.concatenate([b.values for b in blocks])
    J = np.vstack([b.jacobian for b in blocks])
    size = np.linalg.norm(J, axis=0)
    U, s, _ = np.linalg.svd(J[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    return r, U[:, s > RANK * s.max(initial=0.0)]


def _left_over(blocks: Sequence[ResidualBlock], optimum: bool) -> tuple[Reals, Reals]:
    """r⊥ and the standard deviation of each entry, √(1 − leverage); without an optimum r and ones."""
    r, U = _range(blocks)
    if not optimum:
        return r, np.ones(len(r))
    return r - U @ (U.T @ r), np.sqrt(np.maximum(1.0 - np.sum(U**2, axis=1), 1e-6))


def _p_value(chi2: float, dof: int) -> float:
    return float(chdtrc(dof, chi2))


def _by_kind(blocks: Sequence[ResidualBlock], optimum: bool) -> Iterator[tuple[str, float, int, float]]:
    for kind in dict.fromkeys(b.kind for b in blocks):
        chi2, dof = _chi_square([b for b in blocks if b.kind == kind], optimum)
        if dof > 0:
            yield kind, chi2, dof, _p_value(chi2, dof)


def _runs(rest: Reals) -> tuple[int | None, float | None]:
    signs = np.sign(rest[rest != 0.0])
    if len(signs) < _FEWEST_SIGNS:
        return None, None
    runs = 1 + int(np.count_nonzero(np.diff(signs)))
    positive = int(np.count_nonzero(signs > 0))
    return runs, fewest_runs(runs, positive, len(signs) - positive)


def fewest_runs(runs: int, first: int, second: int) -> float:
    """Chance of `runs` or fewer runs in a random order of `first` signs of one kind and `second` of the other."""
    if not first or not second:
        return 1.0
    if runs < 2:
        return 0.0
    half, odd = np.divmod(np.arange(2, runs + 1), 2)
    # of the first and of the second kind as many groups, or one more of either; in logarithms, as residuals are many
    equal = np.log(2.0) + _log_ways(first - 1, half - 1) + _log_ways(second - 1, half - 1)
    more = _log_ways(first - 1, half) + _log_ways(second - 1, half - 1)
    fewer = _log_ways(first - 1, half - 1) + _log_ways(second - 1, half)
    ways = np.where(odd, np.logaddexp(more, fewer), equal)
    return float(min(np.exp(logsumexp(ways) - _log_ways(first + second, np.array(first))), 1.0))


def _log_ways(count: int, chosen: NDArray[np.int64]) -> Reals:
    """Logarithm of the number of choices of some out of `count`; minus infinity where these are not there."""
    left = np.maximum(count - chosen, 0)
    ways = gammaln(count + 1.0) - gammaln(chosen + 1.0) - gammaln(left + 1.0)
    return np.where(chosen > count, -np.inf, ways)
