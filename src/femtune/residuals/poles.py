"""Residuals of complex eigenvalues λ = ω(−ζ + i√(1 − ζ²)) and of damping ratios, of the damped model.

Each paired test mode is compared with the complex mode that belongs to its real mode. Of close modes that are paired as
a cluster the means of the poles are compared, on both sides.
Source: Friswell and Mottershead (1995), section 7; the derivative λ′ = −ψᵀZ′(λ)ψ is exact.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, TypeVar

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.modal import ModeSet
from femtune.model.response import DampingRatios
from femtune.residuals.asked import Asked, asked_covariance
from femtune.residuals.case import CaseState, PairedMode
from femtune.residuals.damped import damped_modes
from femtune.residuals.pair import OfPairs, unknown_modes
from femtune.residuals.weights import PolePair, ResidualBlock, Weights


def pole_of(freq_hz: Reals, ratio: Reals) -> NDArray[np.complex128]:
    """λ in rad/s of natural frequencies |λ|/2π and damping ratios below 1."""
    return np.asarray(2.0 * np.pi * freq_hz * (-ratio + 1j * np.sqrt(1.0 - ratio**2)))


@dataclass(frozen=True, eq=False)
class ComparedPole:
    """The mean pole of some test modes and that of the model.

    Parameters
    ----------
    test : its modes, with their positions `at`
    pole, slopes : λ of the model and ∂λ/∂x (k,)
    """

    test: ModeSet
    at: tuple[int, ...]
    pole: complex
    slopes: NDArray[np.complex128]

    @property
    def label(self) -> str:
        """Labels of the test modes."""
        return " and ".join(self.test.labels[i] for i in self.at)

    @property
    def measured(self) -> complex:
        """Mean pole of the test modes."""
        freq, ratio = self._values
        return complex(np.mean(pole_of(freq, ratio)))

    @property
    def _values(self) -> tuple[Reals, Reals]:
        ratios = self.test.damping_ratio
        assert ratios is not None
        return self.test.freq_hz[list(self.at)], ratios[list(self.at)]

    @property
    def by_values(self) -> NDArray[np.complex128]:
        """(2t,) derivatives of the mean measured pole by the t frequencies in Hz and the t damping ratios."""
        freq, ratio = self._values
        by_freq = 2.0 * np.pi * (-ratio + 1j * np.sqrt(1.0 - ratio**2))
        by_ratio = 2.0 * np.pi * freq * (-1.0 - 1j * ratio / np.sqrt(1.0 - ratio**2))
        return np.asarray(np.concatenate([by_freq, by_ratio]) / len(self.at), complex)


Spread = float | Literal["test"]
Kind = TypeVar("Kind", bound="PoleResidual")


@dataclass(frozen=True, eq=False)
class PoleResidual(OfPairs):
    """A comparison of poles.

    Parameters
    ----------
    sd : relative standard deviation of each mode; "test": those of the test's frequencies and damping ratios, as
        independent errors
    covariance : instead of `sd`; (2m, 2m) of the m frequencies in Hz and m damping ratios of the test, or (m, m) of the
        damping ratios alone, paired or not; "test": that of the test
    damping : modal damping in addition to that of the model
    """

    sd: Spread | None = None
    covariance: Reals | Literal["test"] | None = None
    damping: DampingRatios | None = None
    of_frequencies: ClassVar[bool] = True
    """Whether errors of the measured frequencies matter even where every pole is compared by itself."""

    @property
    def of_ratio(self) -> bool:
        """See `Residual`."""
        return True

    @classmethod
    @abstractmethod
    def order(cls, modes: int) -> int:
        """Number of rows of a covariance that a study gives for the modes of a test."""

    @abstractmethod
    def errors(self, pole: ComparedPole) -> tuple[Reals, Reals]:
        """Relative errors (n,) and their derivatives (n, k)."""

    @abstractmethod
    def by_pole(self, pole: ComparedPole, change: NDArray[np.complex128]) -> Reals:
        """(n, j) changes of the quantity for changes (j,) of the measured pole, relative to the measured one."""

    @classmethod
    def of_study(cls: type[Kind], asked: Asked) -> Kind:
        """See `Residual`; errors ``residual.no-damping``, ``residual.no-scatter``, ``residual.weights``,
        ``residual.covariance``."""
        entry, modes = asked.entry, asked.modes
        if modes.damping_ratio is None:
            raise FemtuneError("residual.no-damping/test", where=asked.where(), configuration=asked.name)
        if entry.covariance is None:
            unknown = modes.damping_sd is None or (cls.of_frequencies and modes.freq_sd_hz is None)
            if entry.sd == "test" and unknown:
                raise _no_scatter(asked, "sd")
            return cls(sd=entry.sd, damping=asked.damping)
        if entry.covariance == "test":
            if modes.covariance is None:
                raise _no_scatter(asked, "covariance")
            return cls(covariance="test", damping=asked.damping)
        given = asked_covariance(asked, cls.order(len(modes)), f"the {cls.label}s of the modes of the test")
        return cls(covariance=given, damping=asked.damping)

    def without_sd(self, test: ModeSet) -> tuple[int, ...]:
        """See `OfPairs`."""
        if self.sd != "test":
            return ()
        return unknown_modes(test, test.damping_sd, *([test.freq_sd_hz] if self.of_frequencies else []))

    def of_pairs(self, pairs: Sequence[PairedMode]) -> Sequence[ResidualBlock]:
        """The values of each pole; all of them in one block where their errors have a covariance."""
        poles = list(self._poles(pairs))
        if self.covariance is None or not poles:
            return [self._block(pairs[0], [pole]) for pole in poles]
        return [self._block(pairs[0], poles)]

    def _poles(self, pairs: Sequence[PairedMode]) -> Iterator[ComparedPole]:
        for pair in pairs:
            _check_measured(pair)
        for members in dict.fromkeys(pair.members for pair in pairs):
            mine = [pair for pair in pairs if pair.members == members]
            state = mine[0].state
            assert isinstance(state, CaseState)
            derivatives = bool(mine[0].eigenvalue_gradient.size)
            for at, pole, slopes in damped_modes(state, self.damping).poles(mine, derivatives):
                yield ComparedPole(mine[0].case.test, tuple(mine[i].position for i in at), pole, slopes)

    def _block(self, pair: PairedMode, poles: Sequence[ComparedPole]) -> ResidualBlock:
        pole_errors = [self.errors(pole) for pole in poles]
        errors, slopes = np.concatenate([e for e, _ in pole_errors]), np.vstack([s for _, s in pole_errors])
        label = ", ".join(pole.label for pole in poles)
        block = self.weighted(pair.case.name, label, errors, slopes, self._weights(pair, poles))
        return replace(block, poles=tuple(PolePair(p.label, p.measured, p.pole) for p in poles))

    def _weights(self, pair: PairedMode, poles: Sequence[ComparedPole]) -> Weights:
        """Weights of the relative errors, to first order."""
        if self.covariance is None and self.sd != "test":
            assert self.sd is not None
            return Weights(float(self.sd) / np.sqrt(len(poles[0].at)))
        known = self._known(pair, poles)
        test = pair.case.test
        m = len(test)
        rows = []
        for pole in poles:
            change = np.zeros(2 * m, complex)
            change[[*pole.at, *(i + m for i in pole.at)]] = pole.by_values
            rows.append(self.by_pole(pole, change))
        turn = np.vstack(rows)
        return Weights(covariance=_symmetric(turn @ known @ turn.T))

    def _known(self, pair: PairedMode, poles: Sequence[ComparedPole]) -> Reals:
        """(2m, 2m) covariance of all frequencies and damping ratios of the test; zero for those that do not matter."""
        test, at = pair.case.test, [i for pole in poles for i in pole.at]
        m = len(test)
        some = np.zeros(2 * m)
        some[[*at, *(i + m for i in at)]] = 1.0
        if self.covariance is None:
            sd = [np.zeros(m) if s is None else s for s in (test.freq_sd_hz, test.damping_sd)]
            for i in at:
                if not sd[1][i] > 0.0 or (self.of_frequencies and not sd[0][i] > 0.0):
                    raise FemtuneError("residual.no-scatter/pole", configuration=pair.case.name, mode=test.labels[i])
            return np.diag(np.where(some > 0.0, np.nan_to_num(np.concatenate(sd)) ** 2, 0.0))
        given = test.covariance if isinstance(self.covariance, str) else self.covariance
        if given is None:
            raise FemtuneError("residual.no-scatter/pole", configuration=pair.case.name, mode=test.labels[at[0]])
        matrix = np.asarray(given)
        if len(matrix) == m:
            # of the damping ratios alone; frequencies do not change these
            matrix = la.block_diag(np.zeros((m, m)), matrix)
        return np.where(np.outer(some, some) > 0.0, matrix, 0.0)


class ComplexEigenvalueResidual(PoleResidual):
    """(λ − λ_e)/|λ_e|, its real and its imaginary part.

    Errors of identified poles have about the same size in both parts, which a single `sd` states.
    """

    key = "complex-eigenvalue"
    label = "complex eigenvalue"

    @classmethod
    def order(cls, modes: int) -> int:
        """Frequencies and damping ratios."""
        return 2 * modes

    def errors(self, pole: ComparedPole) -> tuple[Reals, Reals]:
        """Two values."""
        size = abs(pole.measured)
        return _parts(np.array([(pole.pole - pole.measured) / size]))[:, 0], _parts(pole.slopes / size)

    def by_pole(self, pole: ComparedPole, change: NDArray[np.complex128]) -> Reals:
        """Real and imaginary part."""
        return _parts(change / abs(pole.measured))


class DampingResidual(PoleResidual):
    """(ζ − ζ_e)/ζ_e with ζ = −Re λ/|λ|."""

    key = "damping"
    label = "damping ratio"
    of_frequencies = False

    @classmethod
    def order(cls, modes: int) -> int:
        """Damping ratios."""
        return modes

    def errors(self, pole: ComparedPole) -> tuple[Reals, Reals]:
        """One value."""
        measured = _ratio(pole.measured)
        slopes = _ratio_change(pole.pole, pole.slopes) / measured
        return np.array([_ratio(pole.pole) / measured - 1.0]), slopes[None, :]

    def by_pole(self, pole: ComparedPole, change: NDArray[np.complex128]) -> Reals:
        """One row."""
        return _ratio_change(pole.measured, change)[None, :] / _ratio(pole.measured)


def _ratio(pole: complex) -> float:
    return -pole.real / abs(pole)


def _ratio_change(pole: complex, change: NDArray[np.complex128]) -> Reals:
    """Derivatives of −Re λ/|λ| for those of λ."""
    size = abs(pole)
    return np.asarray(-change.real / size + pole.real * (np.conj(pole) * change).real / size**3)


def _parts(values: NDArray[np.complex128]) -> Reals:
    return np.stack([values.real, values.imag])


def _symmetric(matrix: Reals) -> Reals:
    return 0.5 * (matrix + matrix.T)


def _check_measured(pair: PairedMode) -> None:
    """Refuse a mode whose damping ratio is not known or cannot be that of a decaying oscillation."""
    ratios = pair.case.test.damping_ratio
    if ratios is None:
        raise FemtuneError("residual.no-damping", configuration=pair.case.name, mode=pair.label)
    ratio = float(ratios[pair.position])
    if np.isnan(ratio):
        raise FemtuneError("residual.no-damping", configuration=pair.case.name, mode=pair.label)
    if not 0.0 < ratio < 1.0 or not pair.test_hz > 0.0:
        values = {"damping ratio": f"{ratio:.6g}", "frequency (Hz)": f"{pair.test_hz:.6g}"}
        raise FemtuneError(
            "residual.no-damping/not-oscillating", values=values, configuration=pair.case.name, mode=pair.label
        )


def _no_scatter(asked: Asked, key: str) -> FemtuneError:
    return FemtuneError("residual.no-scatter/test-poles", where=asked.where(key), configuration=asked.name)
