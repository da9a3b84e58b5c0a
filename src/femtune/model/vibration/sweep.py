"""Responses in time: sine sweeps with their rate, and transients.

A sweep is followed in coordinates that turn with the excitation, y = z·exp(iφ): the steps need to resolve the change of
the frequency, not the oscillation. Each step is exact for a constant frequency. For a slow sweep the envelope is |H|; a
fast one has lower, later peaks. A transient is exact for an excitation that is linear between its samples.

Sources: Lewis 1932 (passage through resonance); Ahlin 2010 (ramp-invariant filters).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.model.kinds import SweepLaw
from femtune.model.vibration.transfer import ModalTransfer

_PHASE_TOLERANCE = 5e-3
"""Largest difference, in rad, between the phase of a step and that of a constant frequency."""
_LARGEST_STEP = 0.02
"""Largest step relative to the frequency."""
_MOST_STEPS = 2_000_000
"""Steps of a sweep at most; slower sweeps are quasi-static, and the responses are those of a steady state."""


@dataclass(frozen=True)
class Sweep:
    """A sine whose frequency goes from one value to another.

    Parameters
    ----------
    from_hz, to_hz : the frequency may rise or fall
    rate : octaves per minute of a logarithmic sweep, Hz/s of a linear one
    law : logarithmic or linear
    amplitude : of the excitation

    Raises
    ------
    FemtuneError : ``vibration.sweep``
    """

    from_hz: float
    to_hz: float
    rate: float
    law: SweepLaw = "logarithmic"
    amplitude: float = 1.0

    def __post_init__(self) -> None:
        values = (self.from_hz, self.to_hz, self.rate)
        if not (all(np.isfinite(v) and v > 0.0 for v in values) and self.from_hz != self.to_hz):
            raise FemtuneError("vibration.sweep")

    def slope(self, freq_hz: Reals) -> Reals:
        """(n,) |df/dt| in Hz/s where the frequency is (n,)."""
        per_second = self.rate * np.log(2.0) / 60.0
        return np.asarray(per_second * freq_hz if self.law == "logarithmic" else self.rate + 0.0 * freq_hz)

    @property
    def duration_s(self) -> float:
        """Time from the first to the last frequency."""
        if self.law == "linear":
            return abs(self.to_hz - self.from_hz) / self.rate
        return abs(float(np.log2(self.to_hz / self.from_hz))) * 60.0 / self.rate

    def _step(self, freq_hz: float) -> float:
        rate = float(self.slope(np.array(freq_hz)))
        return min(float(np.sqrt(8.0 * _PHASE_TOLERANCE * rate / (2.0 * np.pi))), _LARGEST_STEP * freq_hz)

    def steps(self) -> tuple[Reals, Reals]:
        """Frequencies (n + 1,) at the ends of all steps, and their durations (n,) in s (error ``vibration.sweep``)."""
        low, high = sorted((self.from_hz, self.to_hz))
        if (high - low) / self._step(high) > _MOST_STEPS:
            raise FemtuneError("vibration.sweep/slow", steps=_MOST_STEPS)
        hz = [low]
        while hz[-1] < high:
            hz.append(min(hz[-1] + self._step(hz[-1]), high))
        line = np.array(hz if self.to_hz > self.from_hz else hz[::-1])
        change = np.abs(np.diff(np.log2(line)) * 60.0 if self.law == "logarithmic" else np.diff(line))
        return line, change / self.rate


def swept_response(transfer: ModalTransfer, sweep: Sweep, input_number: int = 0) -> tuple[Reals, Reals]:
    """Frequencies (n,) of a sweep in Hz, and envelopes (o, n) of the responses to it.

    The structure is at rest when the sweep begins.
    """
    hz, seconds = sweep.steps()
    poles = np.concatenate([transfer.poles, transfer.poles.conj()])
    residues = transfer.residues[:, input_number]
    R = np.concatenate([residues, residues.conj()], axis=1)
    away = poles - 2j * np.pi * 0.5 * (hz[1:] + hz[:-1])[:, None]
    decay = np.exp(away * seconds[:, None])
    forced = (decay - 1.0) / away
    z = np.zeros(len(poles), dtype=complex)
    out = np.empty((len(hz), len(transfer.direct)), dtype=complex)
    out[0] = transfer.direct[:, input_number]
    for n in range(len(seconds)):
        z = decay[n] * z + forced[n]
        out[n + 1] = transfer.direct[:, input_number] + R @ z
    return hz, np.asarray(sweep.amplitude * np.abs(out).T)


def transient_response(transfer: ModalTransfer, signals: Reals, step_s: float) -> Reals:
    """(o, n) responses to signals (i, n) that are sampled at intervals of `step_s`, from rest.

    Raises
    ------
    FemtuneError : ``vibration.inputs``
    """
    from scipy.signal import lfilter  # noqa: PLC0415  slow to import, and wanted here alone

    signals = np.atleast_2d(np.asarray(signals, dtype=float))
    if len(signals) != len(transfer.inputs):
        raise FemtuneError("vibration.inputs", given=len(signals), inputs=len(transfer.inputs))
    out = transfer.direct @ signals
    for m, pole in enumerate(transfer.poles):
        turn = pole * step_s
        growth = np.expm1(turn)
        late = (growth - turn) / (pole * turn)
        early = growth / pole - late
        # at rest before the first sample, where a signal that is not zero begins with a step
        y = lfilter([late, early], [1.0, -np.exp(turn)], signals, axis=1)
        y -= late * signals[:, :1] * np.exp(turn) ** np.arange(signals.shape[1])
        out += 2.0 * np.real(transfer.residues[:, :, m] @ y)
    return np.asarray(out)
