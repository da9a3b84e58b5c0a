"""Frequency residual: (f − f_e)/f_e, or the same of eigenvalues (handbook chapter, eigenvalue residual)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.modal import ModeSet
from femtune.residuals.asked import Asked, asked_covariance
from femtune.residuals.case import PairedMode
from femtune.residuals.kinds import RELATIVE_TO_FREQUENCY, FrequencyForm
from femtune.residuals.pair import OfPairs, PairResidual, unknown_modes
from femtune.residuals.weights import ResidualBlock, Weights


def frequency_residual(
    eigenvalue: float, gradient: Reals, test_hz: float, sd: float, form: str = "frequency"
) -> tuple[Reals, Reals]:
    """Residual (1,) and Jacobian (1, k).

    Parameters
    ----------
    eigenvalue, gradient : λ in rad²/s² and ∂λ/∂x (k,)
    test_hz : test frequency
    sd : relative standard deviation σ of the frequency, or of the eigenvalue
    form : "frequency" or "eigenvalue"
    """
    ratio = eigenvalue / (2.0 * np.pi * test_hz) ** 2
    slope = gradient / (2.0 * np.pi * test_hz) ** 2
    if form == "frequency":
        root = np.sqrt(max(ratio, 0.0))
        ratio, slope = root, slope / (2.0 * max(root, 1e-12))
    return np.array([(ratio - 1.0) / sd]), slope[None, :] / sd


@dataclass(frozen=True)
class FrequencyResidual(PairResidual):
    """Relative differences of frequencies, or of eigenvalues.

    Parameters
    ----------
    sd : relative standard deviation; "test": that of the test (error ``residual.no-scatter``
        where it gives none)
    """

    sd: float | Literal["test"]
    form: FrequencyForm = "frequency"
    key = "frequency"
    label = "frequency"

    @property
    def of_ratio(self) -> bool:
        """See `Residual`."""
        return True

    @classmethod
    def of_study(cls, asked: Asked) -> FrequencyResidual | FrequencyCovariance:
        """See `Residual`; errors ``residual.no-scatter``, ``residual.weights``, ``residual.covariance``."""
        entry, modes = asked.entry, asked.modes
        if entry.covariance is None:
            if entry.sd == "test" and not asked.short:
                _check_scatter(asked, modes.freq_sd_hz, "sd")
            return cls(entry.sd, entry.form)
        if entry.covariance == "test":
            _check_scatter(asked, modes.covariance, "covariance")
            return FrequencyCovariance("test", entry.form)
        return FrequencyCovariance(asked_covariance(asked, len(modes), "the modes of the test"), entry.form)

    def without_sd(self, test: ModeSet) -> tuple[int, ...]:
        """See `OfPairs`."""
        return unknown_modes(test, test.freq_sd_hz) if self.sd == "test" else ()

    def of_pair(self, pair: PairedMode) -> ResidualBlock:
        """One value a mode."""
        sd = self.sd if self.sd != "test" else self._of_test(pair)
        values = frequency_residual(pair.eigenvalue, pair.eigenvalue_gradient, pair.test_hz, sd, self.form)
        return self.block(
            pair.case.name, pair.label, *values, sd, common=np.array([RELATIVE_TO_FREQUENCY[self.form] / sd])
        )

    def _of_test(self, pair: PairedMode) -> float:
        known = pair.case.test.freq_sd_hz
        if known is None or not known[pair.position] > 0.0:
            raise _no_scatter(pair)
        return RELATIVE_TO_FREQUENCY[self.form] * float(known[pair.position] / pair.test_hz)


@dataclass(frozen=True, eq=False)
class FrequencyCovariance(OfPairs):
    """Differences of all frequencies at once, weighted by their covariance; one block a configuration.

    Parameters
    ----------
    covariance : (m, m) in Hz² of the test's m modes in their order, paired or not; "test" takes the test's own (error
        ``residual.no-scatter`` where it gives none)
    form : "frequency", or "eigenvalue": the covariance of λ = ω² follows to first order
    """

    covariance: Reals | Literal["test"]
    form: FrequencyForm = "frequency"
    key = FrequencyResidual.key
    label = FrequencyResidual.label

    @property
    def of_ratio(self) -> bool:
        """See `Residual`."""
        return True

    def of_pairs(self, pairs: Sequence[PairedMode]) -> Sequence[ResidualBlock]:
        """One value a paired mode, whitened together: relative errors e, of which the covariance is C_ij/(f_i f_j)."""
        if not pairs:
            return []
        test_hz = np.array([p.test_hz for p in pairs])
        times = RELATIVE_TO_FREQUENCY[self.form]
        relative = Weights(covariance=times**2 * self._covariance(pairs) / np.outer(test_hz, test_hz))
        each = [frequency_residual(p.eigenvalue, p.eigenvalue_gradient, p.test_hz, 1.0, self.form) for p in pairs]
        errors, slopes = np.concatenate([e for e, _ in each]), np.concatenate([s for _, s in each])
        values = relative.whiten(errors, slopes)
        label = ", ".join(p.label for p in pairs)
        common, _ = relative.whiten(np.full(len(pairs), times), np.zeros((len(pairs), 0)))
        block = self.block(pairs[0].case.name, label, *values, relative.scale, common=common)
        return [replace(block, modes=tuple(p.label for p in pairs))]

    def _covariance(self, pairs: Sequence[PairedMode]) -> Reals:
        test, at = pairs[0].case.test, [p.position for p in pairs]
        given = test.covariance if isinstance(self.covariance, str) else self.covariance
        if given is None:
            raise _no_scatter(pairs[0])
        matrix = np.asarray(given)[: len(test), : len(test)]
        Weights(covariance=matrix).check_size(len(test), "the modes of the test")
        return np.asarray(matrix[np.ix_(at, at)])


def _check_scatter(asked: Asked, known: Reals | None, key: str) -> None:
    if known is None:
        raise FemtuneError("residual.no-scatter/test", where=asked.where(key), configuration=asked.name)


def _no_scatter(pair: PairedMode) -> FemtuneError:
    return FemtuneError("residual.no-scatter/mode", configuration=pair.case.name, mode=pair.label)
