"""Modes of many records of one structure followed over time, with the temperature as regressor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.stats import t as student_t

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.modal import ModeSet, mac

LEAST_MAC = 0.8
"""MAC from which a mode of a record may be one of the reference: noise lowers it, other modes are far below."""
LARGEST_SHIFT = 0.1
"""Relative difference of frequencies up to which it may be the same mode."""
LEAST_RECORDS = 4
"""Records with a mode from which a line through its frequencies has a standard deviation."""
_LEVEL = 0.95
"""Of the intervals of the slopes."""


@dataclass(frozen=True, eq=False)
class TrackedModes:
    """Frequencies of the reference modes in each record.

    Parameters
    ----------
    freq_hz, damping_ratio, mac : (records, modes); NaN where a record does not have the mode
    slope : (modes,) relative change of the frequency per degree, NaN without temperatures or with too few records
    slope_interval : (modes, 2) its 95 % interval
    corrected_hz : (records, modes) frequencies brought to the mean temperature; as `freq_hz` where there is no slope
    """

    freq_hz: Reals
    damping_ratio: Reals
    mac: Reals
    slope: Reals
    slope_interval: Reals
    corrected_hz: Reals

    def parameters(self, sensitivities: Reals) -> Reals:
        """(records, parameters) relative changes of parameters since the first record, to first order.

        Parameters
        ----------
        sensitivities : (modes, parameters) ∂ln f/∂ln p of the updated model, for the reference modes

        Returns
        -------
        least-squares changes from the corrected frequencies of the modes that the first record and the record share;
        NaN where these are fewer than the parameters
        """
        change = np.log(self.corrected_hz / self.corrected_hz[0])
        out = np.full((len(change), sensitivities.shape[1]), np.nan)
        for r, row in enumerate(change):
            known = np.isfinite(row)
            if known.sum() >= sensitivities.shape[1]:
                out[r] = np.linalg.lstsq(sensitivities[known], row[known], rcond=None)[0]
        return out


def track_modes(
    reference: ModeSet, records: Sequence[ModeSet], temperature: Sequence[float] | None = None
) -> TrackedModes:
    """Each record's modes tied one to one to those of the reference, by frequency and shape.

    Parameters
    ----------
    reference : usually the modes of the first record
    records : modes of each record, at the DOFs that they share with the reference
    temperature : of each record, any unit; the slope is per degree of it

    Raises
    ------
    FemtuneError : ``identify.tracking`` for temperatures of another number than records, or that are not finite

    Examples
    --------
    >>> import numpy as np
    >>> import femtune as ft
    >>> from femtune.identification.tracking import track_modes
    >>> dofs, shapes = ft.DofSet.parse(["1Z+", "2Z+"]), np.array([[1.0, 1.0], [1.0, -1.0]])
    >>> degrees = [0.0, 10.0, 20.0, 30.0]
    >>> records = [ft.ModeSet(np.array([5.0, 9.0]) * (1.0 - 1e-3 * t), shapes, dofs) for t in degrees]
    >>> track_modes(records[0], records, degrees).slope.round(5)
    array([-0.00102, -0.00102])
    """
    shape = (len(records), len(reference))
    freq, damping, alike = (np.full(shape, np.nan) for _ in range(3))
    for r, record in enumerate(records):
        for i, k, same in _pairs(reference, record):
            freq[r, i], alike[r, i] = record.freq_hz[k], same
            damping[r, i] = np.nan if record.damping_ratio is None else record.damping_ratio[k]
    slope, interval, corrected = np.full(shape[1], np.nan), np.full((shape[1], 2), np.nan), freq.copy()
    if temperature is not None:
        degrees = np.asarray(temperature, dtype=float)
        if degrees.shape != shape[:1] or not np.isfinite(degrees).all():
            raise FemtuneError("identify.tracking", values={"records": len(records), "temperatures": degrees.size})
        away = degrees - degrees.mean()
        for i in range(shape[1]):
            slope[i], interval[i] = _line(away, freq[:, i])
            if np.isfinite(slope[i]):
                corrected[:, i] = freq[:, i] / (1.0 + slope[i] * away)
    return TrackedModes(freq, damping, alike, slope, interval, corrected)


def _pairs(reference: ModeSet, record: ModeSet) -> list[tuple[int, int, float]]:
    """Positions of the modes that are the same, and their MAC."""
    shared = reference.dofs.common(record.dofs)
    if not len(shared) or not len(record):
        return []
    rows, own = shared.align(reference.dofs), shared.align(record.dofs)
    same = mac(rows[1][:, None] * reference.shapes[rows[0]], own[1][:, None] * record.shapes[own[0]])
    away = np.abs(record.freq_hz / reference.freq_hz[:, None] - 1.0)
    fits = (same >= LEAST_MAC) & (away <= LARGEST_SHIFT)
    # a pair that does not fit costs more than all that fit
    cost = np.where(fits, 1.0 - same + away / LARGEST_SHIFT, 1e3)
    return [(int(i), int(k), float(same[i, k])) for i, k in zip(*linear_sum_assignment(cost)) if fits[i, k]]


def _line(away: Reals, freq_hz: Reals) -> tuple[float, tuple[float, float]]:
    """Slope of frequencies over temperatures, relative to the frequency at their mean, and its interval."""
    known = np.isfinite(freq_hz)
    spread = away[known] - away[known].mean() if known.any() else away[known]
    if known.sum() < LEAST_RECORDS or not spread.any():
        return np.nan, (np.nan, np.nan)
    steep = float(spread @ freq_hz[known] / (spread @ spread))
    middle = float(freq_hz[known].mean() - steep * away[known].mean())
    rest = freq_hz[known] - middle - steep * away[known]
    freedom = int(known.sum()) - 2
    error = float(np.sqrt(rest @ rest / freedom / (spread @ spread)) * student_t.ppf(0.5 + 0.5 * _LEVEL, freedom))
    return steep / middle, ((steep - error) / middle, (steep + error) / middle)
