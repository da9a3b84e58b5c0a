"""Remarks on identified modes: damping that structures do not have, negative modal mass, complex shapes, phases."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Complexes, Reals
from femtune.errors import Notice
from femtune.modal.shape_criteria import turn_to_real_axis
from femtune.testdata.checks import LOW_COLLINEARITY

LARGE_DAMPING = 0.1
"""Damping ratio above which a mode is reported: structures have less, computational poles and filters have more."""
LARGE_AND_KNOWN = 0.2
"""The same for a mode whose damping the data determine, beside which the fit of a record leaves noise only: poles that
are computational or stand for a filter do not have both."""
WELL_KNOWN = 0.1
"""Standard deviation of a damping ratio relative to it, below which it is determined. It is large only if it is above
the limit by two standard deviations."""
KNOWN_DAMPING = 2.0
"""Standard deviations above zero that the damping ratio of a mode has at least; a pole with less is reported. A pole of
the noise is fitted to single lines, with hardly any damping."""
NEGATIVE_MASS = 0.0
"""Share of the driving-point residues that has the sign of a modal mass; a mode with less is reported."""
QUADRATURE_DEG = 70.0
"""Mean distance in degrees of the phase of a channel from those of the others, over the modes in which it moves, from
which it is reported: a channel of another quantity has 90°."""
QUADRATURE_MODES = 2
"""Modes in which it must move; a single one may be complex."""
_DOUBTFUL = (
    "identify.damping", "identify.driving-point-sign", "identify.left-cluster", "identify.harmonic",
    "identify.same-shape", "identify.unsound-hits",
)  # fmt: skip


@dataclass(frozen=True)
class ModeRemark:
    """A remark on the mode at a position."""

    mode: int
    notice: Notice

    @property
    def doubtful(self) -> bool:
        """True where the mode may not be one of the structure, or not that within its standard deviations.

        Its damping is impossible, large or not known, its modal mass is negative, its fit left its cluster, a
        harmonic is at its frequency, a neighbouring mode has the same shape, or a hit that is not sound was used.
        """
        return self.notice.code in _DOUBTFUL


def damping_remarks(
    freq_hz: Sequence[float] | Reals,
    damping_ratio: Reals | None,
    sd: Reals | None = None,
    noise_only: Sequence[bool] | None = None,
) -> tuple[ModeRemark, ...]:
    """``identify.damping`` of modes that do not decay, or are damped above `LARGE_DAMPING`; unknown damping has none.

    With standard deviations also of modes whose damping ratio is less than `KNOWN_DAMPING` of them above zero.

    Parameters
    ----------
    noise_only : of each mode, whether its fit to a record leaves noise only near it; its damping may be
        `LARGE_AND_KNOWN`
    """
    if damping_ratio is None:
        return ()
    remarks = []
    for i, (hz, ratio) in enumerate(zip(freq_hz, damping_ratio)):
        error = 0.0 if sd is None else float(sd[i])
        known = 0.0 < error < WELL_KNOWN * ratio
        largest = LARGE_AND_KNOWN if known and noise_only is not None and noise_only[i] else LARGE_DAMPING
        if ratio - (2.0 * error if known else 0.0) > largest:
            notice = Notice("identify.damping", frequency_hz=float(hz), ratio=float(ratio), largest=largest)
        elif ratio <= 0.0:
            notice = Notice("identify.damping/negative", frequency_hz=float(hz), ratio=float(ratio))
        elif ratio < KNOWN_DAMPING * error:
            notice = Notice("identify.damping/not-above-zero", frequency_hz=float(hz), ratio=float(ratio), sd=error)
        else:
            continue
        remarks.append(ModeRemark(i, notice))
    return tuple(remarks)


def collinearity_remarks(
    freq_hz: Sequence[float] | Reals, collinearity: Sequence[float] | Reals, deviation_deg: Sequence[float] | Reals
) -> tuple[ModeRemark, ...]:
    """``identify.complex-mode`` of modes whose phase collinearity is below `LOW_COLLINEARITY`."""
    return tuple(
        ModeRemark(i, Notice("identify.complex-mode", frequency_hz=float(f), collinearity=c, deviation_deg=d))
        for i, (f, c, d) in enumerate(zip(freq_hz, collinearity, deviation_deg))
        if c < LOW_COLLINEARITY
    )


def mass_remarks(freq_hz: Sequence[float] | Reals, mass_sign: Reals) -> tuple[ModeRemark, ...]:
    """``identify.driving-point-sign`` of modes whose modal mass is negative; NaN without a driving point."""
    return tuple(
        ModeRemark(i, Notice("identify.driving-point-sign", frequency_hz=float(freq_hz[i])))
        for i in np.flatnonzero(mass_sign < NEGATIVE_MASS).tolist()
    )


def quadrature_notices(shapes: Complexes, names: Sequence[str]) -> tuple[Notice, ...]:
    """``identify.quadrature`` of channels whose phase differs by about 90° from the others in the modes of (s, m).

    So do velocities among accelerations. Their entries may be small in the units of the others, and then no phase
    collinearity shows them.
    """
    turned = shapes * turn_to_real_axis(shapes) / np.linalg.norm(shapes, axis=0)
    size = np.abs(turned)
    angle = np.degrees(np.arctan2(np.abs(turned.imag), np.abs(turned.real)))
    # at a node of a mode the phase is that of noise
    mean = (size * angle).sum(axis=1) / np.maximum(size.sum(axis=1), np.finfo(float).tiny)
    moving = (size > 0.1 * size.max(axis=1, keepdims=True, initial=0.0)).sum(axis=1)
    odd = [names[int(i)] for i in np.flatnonzero((mean > QUADRATURE_DEG) & (moving >= QUADRATURE_MODES))]
    return (Notice("identify.quadrature", channels=", ".join(odd)),) if odd else ()
