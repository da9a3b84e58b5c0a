"""Held-out sensors: the model's shape, scaled on the sensors that were used, beside the test's at the others."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.correlate import Correlation, NotTested, paired_shapes
from femtune.modal.mac import modal_scale_factor

Reals = NDArray[np.float64]


@dataclass(frozen=True)
class HeldOutSensors:
    """Shape errors at the held-out sensors, pair by pair.

    Parameters
    ----------
    sensors : labels of the held-out sensors
    labels : of the pairs, in words
    error : (p,) root mean square of ψ − cφ at the held-out sensors over that of ψ at all sensors; c is the modal scale
        factor of the sensors that were used. NaN where a pair has no entry to compare
    noise : (p,) what the scatter of the shape gives on average, NaN where it is not known
    """

    sensors: tuple[str, ...]
    labels: tuple[str, ...]
    error: Reals
    noise: Reals

    def worst(self) -> tuple[float, str, str] | NotTested:
        """The largest error, its pair, and what noise explains of it."""
        if not np.isfinite(self.error).any():
            return NotTested("no pair has a measured entry at the held-out sensors")
        at = int(np.nanargmax(self.error))
        return float(self.error[at]), self.labels[at], self._words(at)

    def _words(self, at: int) -> str:
        error, noise = self.error[at], self.noise[at]
        if not np.isfinite(noise):
            return ""
        word = "could explain" if error <= 2.0 * noise else "does not explain"
        return f"scatter of the measured shape (it gives {100 * noise:.2g} % on average) {word} it"


def held_out_sensors(c: Correlation, held: Collection[int], tests: Collection[int] | None = None) -> HeldOutSensors:
    """Errors of all pairs, or of those of some test modes, at the sensors of positions `held`."""
    rows = [k for k, p in enumerate(c.pairing.pairs) if tests is None or p.test in tests]
    psi, phi = (matrix[:, rows] for matrix in paired_shapes(c.test, c.model, c.pairing))
    out = np.zeros(len(c.dofs), dtype=bool)
    out[list(held)] = True
    scaled = phi * modal_scale_factor(psi[~out], phi[~out])
    size = np.sqrt(np.nanmean(np.abs(psi) ** 2, axis=0))
    sd = _sd(c)[:, [c.pairing.pairs[k].test for k in rows]]
    names = tuple(str(c.dofs[int(k)]) for k in np.flatnonzero(out))
    pairs = tuple(f"test mode {c.test.labels[c.pairing.pairs[k].test]}" for k in rows)
    return HeldOutSensors(names, pairs, _rms(psi[out] - scaled[out]) / size, _rms(sd[out]) / size)


def _sd(c: Correlation) -> Reals:
    return np.full(c.test.shapes.shape, np.nan) if c.test.shapes_sd is None else c.test.shapes_sd


def _rms(values: NDArray) -> Reals:
    """(p,) root mean square of the known entries; NaN without any."""
    known = ~np.isnan(values)
    total = np.sum(np.where(known, np.abs(values) ** 2, 0.0), axis=0)
    count = known.sum(axis=0)
    return np.where(count > 0, np.sqrt(total / np.maximum(count, 1)), np.nan)
