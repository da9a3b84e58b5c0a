"""A surrogate: fitted responses of a table of runs, on parameters and responses that are scaled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, Self

import numpy as np
from scipy.special import stdtrit

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.surrogates.kriging import KrigingRules


class FittedResponse(Protocol):
    """One response, of unit variance, over parameters u in the unit cube; its values accept complex u."""

    @property
    def errors(self) -> Reals:
        """(N,) errors of leaving out each run; of polynomial chaos, a tenth of the runs."""

    @property
    def error_sd(self) -> Reals:
        """(N,) their standard deviations."""

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the intervals: runs less coefficients."""

    def value(self, u: Reals) -> Reals:
        """(k,) at points (k, n)."""

    def slopes(self, u: Reals) -> Reals:
        """(k, n) first derivatives."""

    def curvatures(self, u: Reals) -> Reals:
        """(k, n, n) second derivatives."""

    def spread(self, u: Reals) -> Reals:
        """(k,) standard deviation of a run."""

    def again(self, u: Reals, y: Reals) -> Self:
        """The fit to other runs (N, n), (N,), with unchanged hyperparameters."""


class SurrogateRules(Protocol):
    """How a surrogate is fitted: a method with its options."""

    @property
    def logarithms(self) -> bool:
        """Fit the logarithms of the responses over those of the parameters, all of which must be positive."""

    @property
    def label(self) -> str:
        """Name in messages."""

    def least_runs(self, parameters: int) -> int:
        """Fewest runs that determine the coefficients and a variance."""

    def fits(self, u: Reals, y: Reals) -> tuple[FittedResponse, ...]:
        """Fits of the responses (N, m) over scaled parameters (N, n)."""


@dataclass(frozen=True, eq=False)
class Surrogate:
    """A fitted surrogate of m responses over n parameters.

    Parameters
    ----------
    parameters, responses : names
    x, y : (N, n) and (N, m) the runs
    lower, upper : (n,) the box that is scaled to the unit cube
    rules : how it was fitted
    fits : one per response
    centre, scale : (m,) of the responses, or of their logarithms
    """

    parameters: tuple[str, ...]
    responses: tuple[str, ...]
    x: Reals
    y: Reals
    lower: Reals
    upper: Reals
    rules: SurrogateRules
    fits: tuple[FittedResponse, ...]
    centre: Reals
    scale: Reals

    def predict(self, x: Reals) -> Reals:
        """(k, m) responses at points (k, n); accepts complex values."""
        u = self.in_unit_cube(np.atleast_2d(x))
        predicted = self.centre + self.scale * np.stack([fit.value(u) for fit in self.fits], axis=1)
        return np.asarray(np.exp(predicted) if self.rules.logarithms else predicted)

    def predict_sd(self, x: Reals) -> Reals:
        """(k, m) standard deviations of a run at points (k, n); of its logarithm, with `logarithms`."""
        u = self.in_unit_cube(np.atleast_2d(x))
        return np.asarray(self.scale * np.stack([fit.spread(u) for fit in self.fits], axis=1))

    def interval(self, x: Reals, level: float = 0.95) -> tuple[Reals, Reals]:
        """Two (k, m) limits between which a run at each point lies with a probability, by Student's t."""
        wide = stdtrit([fit.freedom for fit in self.fits], 0.5 + 0.5 * level) * self.predict_sd(x)
        middle = self.predict(x)
        if self.rules.logarithms:
            return middle * np.exp(-wide), middle * np.exp(wide)
        return middle - wide, middle + wide

    def gradient(self, x: Reals) -> Reals:
        """(k, m, n) derivatives of the responses."""
        x = np.atleast_2d(x)
        u = self.in_unit_cube(x)
        slopes = np.stack([fit.slopes(u) for fit in self.fits], axis=1)
        gradient = self.scale[:, None] * slopes / (self._edges[1] - self._edges[0])
        if self.rules.logarithms:
            gradient = gradient * self.predict(x)[:, :, None] / x[:, None, :]
        return np.asarray(gradient)

    @property
    def left_out(self) -> Reals:
        """(N, m) response of each run as predicted from all others; by polynomial chaos, without a tenth of them."""
        scaled = np.stack([fit.errors for fit in self.fits], axis=1) * self.scale
        return np.asarray(self.y * np.exp(-scaled) if self.rules.logarithms else self.y - scaled)

    @property
    def left_out_ratio(self) -> Reals:
        """(N, m) errors of leaving out each run over their standard deviations; of unit variance if sound."""
        return np.stack([fit.errors / fit.error_sd for fit in self.fits], axis=1)

    def with_runs(self, x: Reals, y: Reals) -> Surrogate:
        """The surrogate of other runs (N, n), (N, m), with unchanged hyperparameters."""
        moved = replace(self, x=x, y=y)
        pairs = zip(self.fits, moved._scaled.T, strict=True)
        return replace(moved, fits=tuple(fit.again(moved._runs, column) for fit, column in pairs))

    @cached_property
    def _edges(self) -> tuple[Reals, Reals]:
        return (np.log(self.lower), np.log(self.upper)) if self.rules.logarithms else (self.lower, self.upper)

    @property
    def _scaled(self) -> Reals:
        """(N, m) responses, or their logarithms, of unit variance."""
        return np.asarray(((np.log(self.y) if self.rules.logarithms else self.y) - self.centre) / self.scale)

    @cached_property
    def _runs(self) -> Reals:
        return self.in_unit_cube(self.x)

    def in_unit_cube(self, x: Reals) -> Reals:
        """(k, n) points as the surrogate sees them: between the bounds 0 to 1, with logarithms if it has these."""
        low, high = self._edges
        return np.asarray(((np.log(x) if self.rules.logarithms else x) - low) / (high - low))


def fit_surrogate(
    x: Reals,
    y: Reals,
    rules: SurrogateRules | None = None,
    box: tuple[Reals, Reals] | None = None,
    parameters: Sequence[str] = (),
    responses: Sequence[str] = (),
) -> Surrogate:
    """A surrogate of a table of runs.

    Parameters
    ----------
    x : (N, n) parameters of the runs
    y : (N, m) responses
    rules : how to fit: `KrigingRules`, `RadialRules` or `ChaosRules`; None: Kriging with constant trend, Gaussian
        correlation and estimated noise
    box : (n,) lower and (n,) upper bounds, which are scaled to the unit cube; None: those of the runs
    parameters, responses : names, for messages

    Raises
    ------
    FemtuneError : ``surrogate.*``

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.surrogates import fit_surrogate
    >>> x = np.linspace(0.0, 1.0, 8)[:, None]
    >>> fitted = fit_surrogate(x, np.sin(6.0 * x))
    >>> bool(abs(fitted.predict([[0.4]])[0, 0] - np.sin(2.4)) < 1e-3)
    True
    """
    rules = rules or KrigingRules()
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    lower, upper = (x.min(axis=0), x.max(axis=0)) if box is None else map(np.asarray, box)
    names = tuple(parameters) or tuple(f"x{i + 1}" for i in range(x.shape[1]))
    called = tuple(responses) or tuple(f"y{i + 1}" for i in range(y.shape[1]))
    _check(x, y, rules, (lower, upper), names, called)
    values = np.log(y) if rules.logarithms else y
    spread = values.std(axis=0)
    scale = np.where(spread > 0.0, spread, 1.0)
    empty = Surrogate(
        parameters=names,
        responses=called,
        x=x,
        y=y,
        lower=lower,
        upper=upper,
        rules=rules,
        fits=(),
        centre=values.mean(axis=0),
        scale=scale,
    )
    return replace(empty, fits=rules.fits(empty._runs, empty._scaled))


def _check(
    x: Reals, y: Reals, rules: SurrogateRules, box: tuple[Reals, Reals], names: Sequence[str], called: Sequence[str]
) -> None:
    if not (np.all(np.isfinite(x)) and np.all(np.isfinite(y))):
        bad = np.flatnonzero(~(np.isfinite(x).all(axis=1) & np.isfinite(y).all(axis=1)))
        raise FemtuneError("surrogate.not-finite", runs=", ".join(str(i + 1) for i in bad))
    still = [name for name, low, high in zip(names, *box, strict=True) if not high > low]
    if still:
        raise FemtuneError("surrogate.still", names=", ".join(still))
    needed = rules.least_runs(x.shape[1])
    if len(x) < needed:
        raise FemtuneError("surrogate.too-few-runs", runs=len(x), method=rules.label, needed=needed)
    if rules.logarithms:
        low = [name for name, values in zip((*names, *called), (*x.T, *y.T), strict=True) if np.any(values <= 0.0)]
        if low:
            raise FemtuneError("surrogate.not-positive", names=", ".join(low))
