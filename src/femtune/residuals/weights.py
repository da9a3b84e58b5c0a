"""Weights: how well it is known what is compared, by standard deviations or by a covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as la
from numpy.typing import ArrayLike

from femtune.arrays import Complexes, Integers, Reals
from femtune.errors import FemtuneError
from femtune.residuals.kinds import FrfForm

if TYPE_CHECKING:
    from femtune.identification.redrawn import RedrawnTest

# ----------------------------------------------------------------------------------------------------
# ResidualBlock: what one comparison adds to r(p).


@dataclass(frozen=True, eq=False)
class IdentifiedValues:
    """Values of a block that come from an identified test.

    Parameters
    ----------
    test : the test
    at : positions (responses, references, lines) of the complex values in its equalised FRFs
    sd : (n,) σ of real and imaginary part of each, or of its logarithm
    form : how residuals are made of them
    """

    test: RedrawnTest
    at: tuple[Integers, Integers, Integers]
    sd: Reals
    form: FrfForm

    def change(self, functions: Complexes) -> Reals:
        """Change of the residuals, in their order, with other equalised FRFs of the test."""
        new, old = functions[self.at], self._here
        moved = (old - new if self.form == "linear" else np.log(old / new)) / self.sd
        return moved.real if self.form == "log-magnitude" else np.concatenate([moved.real, moved.imag])

    @cached_property
    def _here(self) -> Complexes:
        return np.asarray(self.test.equalised[self.at])


@dataclass(frozen=True, eq=False)
class LineSamples:
    """Origin of the values of a block: measured complex values at frequency lines, from which a bootstrap draws.

    Parameters
    ----------
    freq_hz : (n,) frequency line of each value
    entry : (n,) number of the measured complex value; its real and imaginary parts have the same number
    log_sd : (n,) σ of the logarithm, if the values are real (first) and imaginary parts of logarithms of ratios; None
        for values that are linear in the measured ones
    identified : how the values follow the measured ones, if they are those of an identified test; None if they were
        measured themselves
    noise : (n,) standard deviation of the noise that an identification has found, over the stated one; None if it is
        not known
    common : (n, q) change of the residuals with q independent errors of unit variance that all values of a
        configuration share, besides noise; None if there are none
    """

    freq_hz: Reals
    entry: Integers
    log_sd: Reals | None = None
    identified: IdentifiedValues | None = None
    noise: Reals | None = None
    common: Reals | None = None


_IDENTIFIED = "the values come from one identified test, so that the errors of different lines are not independent"
_NOISE_FOUND = "the size of their errors was found by the identification of the same FRFs, too roughly for a test"


@dataclass(frozen=True)
class PolePair:
    """Poles in rad/s, measured and of the model, of the test modes with a label."""

    label: str
    measured: complex
    model: complex


@dataclass(frozen=True)
class ResidualBlock:
    """One block of r(p) = (z_model(p) − z_test)/σ. The residual that makes it fills in what its kind says of itself.

    Parameters
    ----------
    kind : label of the kind of residual: "frequency", "shape", "mass" …
    configuration : name of the configuration
    mode : label of the test mode, or of what else is compared: a load case, "total"
    values : (n,) residuals
    jacobian : (n, k) ∂r/∂x
    sd : σ relative to the size of what is compared; of values of several deviations their root mean square
    of_mode : whether the block belongs to a test mode
    lost : number of combinations of the values that are zero whatever the noise, because the data themselves scale or
        complete what is compared
    covariance : (n, n) covariance of the values where the data have the stated standard deviations; None if that is
        the identity, but for the combinations that are lost
    not_normal : why the values have no normal distribution; "" where they have one, to first order
    common : (n,) change of the values by a relative error of 1 that all values of the kind share; None if such an
        error has no meaning
    poles : measured and computed poles that the values compare; none for other kinds
    sensors, modes : (n,) sensor and test mode of each value, where they differ within the block; empty otherwise
    scaled : (n,) unit vector of the combination of the values that is lost to the scale of a shape; None if there is
        none, or if `covariance` tells
    """

    kind: str
    configuration: str
    mode: str
    values: Reals
    jacobian: Reals
    sd: float
    of_mode: bool = False
    lost: int = 0
    covariance: Reals | None = field(default=None, repr=False)
    not_normal: str = ""
    common: Reals | None = field(default=None, repr=False)
    samples: LineSamples | None = field(default=None, repr=False)
    poles: tuple[PolePair, ...] = ()
    sensors: tuple[str, ...] = ()
    modes: tuple[str, ...] = ()
    scaled: Reals | None = field(default=None, repr=False)

    @property
    def directions(self) -> Reals:
        """(n, m) combinations of the values that are lost, as far as it is known which they are."""
        return np.zeros((len(self.values), 0)) if self.scaled is None else self.scaled[:, None]

    @property
    def without_distribution(self) -> str:
        """Why it is not known how the values are distributed where the model is right; "" where it is."""
        if self.not_normal or self.samples is None:
            return self.not_normal
        if self.samples.identified is not None:
            return _IDENTIFIED
        return "" if self.samples.noise is None else _NOISE_FOUND

    @property
    def error(self) -> float:
        """Size of the misfit relative to what is compared: |r|·σ."""
        return float(np.linalg.norm(self.values) * self.sd)

    @property
    def label(self) -> str:
        """Text for tables."""
        if not self.configuration:
            return f"{self.kind} of {self.mode}"
        word = "mode " if self.of_mode else ""
        return f"{self.configuration} {word}{self.mode} {self.kind}"

    def whitened(self) -> ResidualBlock:
        """The block with independent values of unit variance, if the data have the stated standard deviations."""
        if self.covariance is None:
            return self
        variances, V = la.eigh(self.covariance)
        positive = variances > DEFINITE * variances[-1]
        # a combination that is lost is zero; it keeps its scale
        scale = np.where(positive, np.sqrt(np.where(positive, variances, 1.0)), 1.0)
        root = (V / scale) @ V.T
        # the scale of a shape takes one combination; another kind of covariance is not singular
        scaled = V[:, int(np.argmin(positive))] if not positive.all() else None
        return replace(self, values=root @ self.values, jacobian=root @ self.jacobian, covariance=None, scaled=scaled)


def without_common_error(blocks: Sequence[ResidualBlock], sd: float) -> tuple[ResidualBlock, ...]:
    """Blocks with independent values of unit variance where all values share a further error.

    With u = common·sd the covariance of the values together is I + uuᵀ. Its inverse root I − (1 − 1/√(1 + uᵀu)) uuᵀ/uᵀu
    is applied to values and Jacobian, so that least squares are generalised least squares.

    Parameters
    ----------
    sd : relative standard deviation of the error; zero leaves everything as it is
    """
    parts = [np.zeros(len(b.values)) if b.common is None else sd * b.common for b in blocks]
    square = float(sum(u @ u for u in parts))
    if not square > 0.0:
        return tuple(blocks)
    share = (1.0 - 1.0 / np.sqrt(1.0 + square)) / square
    value = share * sum(float(u @ b.values) for u, b in zip(parts, blocks))
    slope = share * np.sum([u @ b.jacobian for u, b in zip(parts, blocks)], axis=0)
    return tuple(
        replace(b, values=b.values - u * value, jacobian=b.jacobian - np.outer(u, slope), common=None)
        for u, b in zip(parts, blocks)
    )


DEFINITE = 1e-12
"""Least eigenvalue of a correlation matrix over its largest one, below which it counts as singular."""


@dataclass(frozen=True, eq=False)
class Weights:
    """Uncertainty of n values, in their unit: `sd` (one for all, or (n,)) or `covariance` (n, n), one of the two.

    Residuals are r = L⁻¹e with LLᵀ the covariance (Cholesky), so that their own covariance is the identity.

    Raises
    ------
    FemtuneError : ``residual.weights`` for both, none, or what is no matrix; ``residual.zero-variance``;
        ``residual.covariance`` where the matrix is not symmetric and positive definite
    """

    sd: ArrayLike | None = None
    covariance: ArrayLike | None = None

    def __post_init__(self) -> None:
        if (self.sd is None) == (self.covariance is None):
            raise FemtuneError("residual.weights/one-of-two")
        if self.covariance is None:
            _check_sd(np.asarray(self.sd, dtype=float))
        else:
            _check_covariance(np.asarray(self.covariance, dtype=float))

    def of(self, keep: ArrayLike) -> Weights:
        """Weights of some of the values, by position."""
        at = np.asarray(keep, dtype=int)
        if self.size is None or np.array_equal(at, np.arange(self.size)):
            return self
        if self.covariance is not None:
            return Weights(covariance=np.asarray(self.covariance, dtype=float)[np.ix_(at, at)])
        return Weights(np.asarray(self.sd, dtype=float)[at])

    @property
    def size(self) -> int | None:
        """n; None for one standard deviation that holds for any number of values."""
        matrix = np.asarray(self.sd if self.covariance is None else self.covariance)
        return None if matrix.ndim == 0 else len(matrix)

    def root(self, n: int) -> Reals:
        """(n, n) L with LLᵀ the covariance of n values."""
        if self.covariance is not None:
            return np.asarray(la.cholesky(np.asarray(self.covariance, dtype=float), lower=True))
        return np.diag(np.broadcast_to(np.asarray(self.sd, dtype=float), (n,)))

    def check_size(self, n: int, what: str) -> None:
        """Refuse weights for another number of values (error ``residual.weights``)."""
        if self.size not in (None, n):
            raise FemtuneError("residual.weights/number", given=self.size, compared=n, described=what)

    def whiten(self, errors: Reals, jacobian: Reals) -> tuple[Reals, Reals]:
        """Residuals (n,) and Jacobian (n, k) of errors in their unit."""
        if self.covariance is None:
            sd = np.broadcast_to(np.asarray(self.sd, dtype=float), errors.shape)
            return errors / sd, jacobian / sd[:, None]
        lower = la.cholesky(np.asarray(self.covariance, dtype=float), lower=True)
        both = la.solve_triangular(lower, np.column_stack([errors, jacobian]), lower=True)
        return both[:, 0], both[:, 1:]

    @property
    def scale(self) -> float:
        """Root mean square of the standard deviations."""
        if self.covariance is not None:
            return float(np.sqrt(np.mean(np.diag(np.asarray(self.covariance, dtype=float)))))
        return float(np.sqrt(np.mean(np.asarray(self.sd, dtype=float) ** 2)))


def as_weights(given: float | Weights) -> Weights:
    """A number is a standard deviation."""
    return given if isinstance(given, Weights) else Weights(given)


def _check_sd(sd: Reals) -> None:
    if sd.ndim > 1 or not np.isfinite(sd).all() or (sd < 0.0).any():
        raise FemtuneError("residual.weights/standard-deviation", values={"sd": sd.tolist()})  # fmt: skip
    if (sd == 0.0).any():
        raise _zero("standard deviation", int(np.argmin(sd)), sd.ndim)


def _check_covariance(matrix: Reals) -> None:
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not np.isfinite(matrix).all():
        raise FemtuneError("residual.weights/covariance", values={"shape": matrix.shape})  # fmt: skip
    variances = np.diag(matrix)
    if (variances == 0.0).any():
        raise _zero("variance", int(np.argmin(np.abs(variances))), 1)
    if (variances < 0.0).any() or not np.allclose(matrix, matrix.T, rtol=1e-8, atol=0.0):
        raise _not_definite("it is not symmetric" if (variances > 0.0).all() else "it has a negative variance")
    root = np.sqrt(variances)
    eigenvalues = la.eigvalsh(matrix / np.outer(root, root))
    if eigenvalues.size and eigenvalues[0] <= DEFINITE * eigenvalues[-1]:
        raise _not_definite(f"the smallest eigenvalue of the correlation matrix is {eigenvalues[0]:.2g}")


def _not_definite(why: str) -> FemtuneError:
    return FemtuneError("residual.covariance", reason=why)


def _zero(what: str, position: int, dimensions: int) -> FemtuneError:
    place = f" of value {position + 1}" if dimensions else ""
    return FemtuneError("residual.zero-variance", quantity=what, place=place)
