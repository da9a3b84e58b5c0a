"""Which antiresonance of the model stands against which of the test: by frequency and by the motion of all sensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from femtune.model.response import ZeroFinder
from femtune.residuals.measured_zeros import Antiresonance

Reals = NDArray[np.float64]

_TELLING = 3
"""Sensors from which on the motion at an antiresonance says which one it is."""
_BEYOND = 1e6


@dataclass(frozen=True)
class ZeroGates:
    """How far a partner may be at the start: relative frequency difference, and MAC of the motions of all responses."""

    frequency: float = 0.30
    mac: float = 0.50


@dataclass(frozen=True, eq=False)
class Candidates:
    """Zeros of one function of the model beside those of the test.

    Parameters
    ----------
    eigenvalues : (m,) μ
    off : (t, m) ln(f_model/f_test), t zeros of the test
    mac : (t, m) of the motions; 1 where fewer than three sensors see them
    """

    eigenvalues: Reals
    off: Reals
    mac: Reals

    def assigned(self) -> list[int | None]:
        """The partner of each zero of the test, together as near and as like as can be; None without."""
        cost = np.abs(self.off) + (1.0 - self.mac)
        out: list[int | None] = [None] * len(cost)
        for i, j in zip(*linear_sum_assignment(cost)):
            out[int(i)] = int(j)
        return out

    def why_not(self, i: int, j: int | None, gates: ZeroGates) -> str:
        """What speaks against a pair; "" where nothing does."""
        if j is None:
            return "the model has no antiresonance left for it"
        off, mac = float(np.expm1(self.off[i, j])), float(self.mac[i, j])
        if abs(off) > gates.frequency:
            return f"the nearest of the model is {100.0 * off:+.0f} % away; the gate is {100.0 * gates.frequency:.0f} %"
        if mac < gates.mac:
            return f"there the model moves otherwise (MAC {mac:.2f} below {gates.mac:.2f})"
        return ""


def candidates(
    finder: ZeroFinder, output: int, reference: int, tests: Sequence[Antiresonance], reach: float
) -> Candidates:
    """Zeros of a function of the model up to `reach` times the highest one of the test."""
    test_hz = np.array([z.freq_hz for z in tests])
    values = finder.candidates(output, reference, reach * float(test_hz.max()))
    freq = np.sqrt(values) / (2.0 * np.pi)
    motions = np.array([finder.seen(reference, mu) for mu in values]).reshape(
        len(values), finder.ports.outputs.shape[0]
    )
    mac = np.array([[_mac(z.motion, m) for m in motions] for z in tests]).reshape(len(tests), len(values))
    return Candidates(values, np.log(freq[None, :] / test_hz[:, None]), mac)


def _mac(test: NDArray, model: Reals) -> float:
    known = np.isfinite(test)
    a, b = test[known], model[known]
    size = float(np.vdot(a, a).real * (b @ b))
    return float(abs(np.vdot(a, b)) ** 2 / size) if known.sum() >= _TELLING and size > 0.0 else 1.0
