"""Mistakes of measured FRFs that show beside the model: a wrong sign, another unit, another kind."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from femtune.arrays import Complexes, Flags, Reals
from femtune.errors import Notice
from femtune.identification.frf_checks import KNOWN_FACTORS
from femtune.modal import FrfSet
from femtune.modal.frf_set import KINDS

_OPPOSITE = -0.6
"""Mean cosine of the phase between measured and computed FRFs below which the sign of a channel is wrong."""
_ALIKE = 0.5
"""The same, that the other channels must have in the median for this to be said."""
_FEWEST_VALUES = 8
"""Values of a channel for a mean: by chance the mean cosine of so many random phases is below −0.6 in about 1 % of all
cases."""
_FEWEST_CHANNELS = 3
"""Responses that are needed to tell the odd one."""
_FEWEST_OUTPUTS = 4
"""Responses whose levels are compared."""
_LEVEL = 3.0
"""Ratio of the levels, in both directions, from which units are doubted."""
_OUTLYING = 3.0
"""A channel has a separate level if its distance from the others is so many times its scatter over the lines, and
the scatter of the levels of the others."""
_CLEARER = 0.7
"""Another kind is likely if it makes the scatter of the ratios so much smaller."""


def against_model(measured: FrfSet, model: Complexes, known: Flags, configuration: str) -> tuple[Notice, ...]:
    """Mistakes in some or all channels.

    Parameters
    ----------
    model : (outputs, inputs, lines) functions of the model at the start
    known : (outputs, inputs, lines) True where both are compared

    Returns
    -------
    ``residual.frf-sign`` for channels whose phase is opposite at nearly all lines, ``residual.frf-kind`` where the
    ratio grows with a power of the frequency, ``residual.frf-level`` where its size is far from one, and
    ``residual.frf-channel-level`` for outputs where it is far from that of the other outputs
    """
    test = measured.values
    used = known & (model != 0.0) & np.isfinite(test) & (test != 0.0)
    if used.sum() < _FEWEST_VALUES:
        return ()
    ratio = np.divide(model, test, out=np.full(test.shape, np.nan + 0j), where=used)
    sizes = tuple(_sizes(measured, ratio, configuration))
    other_kind = any(notice.code == "residual.frf-kind" for notice in sizes)
    levels = () if other_kind else tuple(_levels(measured, ratio, configuration))
    return (*_signs(measured, ratio, configuration), *sizes, *levels)


def _signs(measured: FrfSet, ratio: Complexes, configuration: str) -> Iterator[Notice]:
    """Outputs, then inputs, that are opposite to the model while most others are not."""
    phase = np.cos(np.angle(ratio))
    for axis, dofs, word in ((0, measured.responses, "output"), (1, measured.references, "input")):
        alike = _means(phase, axis)
        known = np.isfinite(alike)
        opposite = known & (alike < _OPPOSITE)
        others = alike[known & ~opposite]
        enough = known.sum() >= _FEWEST_CHANNELS if axis == 0 else known.sum() > 1
        if not opposite.any() or not enough or opposite.sum() > others.size or np.median(others) < _ALIKE:
            continue
        names = ", ".join(str(dof) for dof, wrong in zip(dofs, opposite) if wrong)
        yield Notice(
            "residual.frf-sign", configuration=configuration, channel=word, names=names,
            cosine=float(alike[opposite].max()),
        )  # fmt: skip


def _means(values: Reals, axis: int) -> Reals:
    """Mean over all lines of each channel; NaN for too few."""
    rows = np.moveaxis(values, axis, 0).reshape(values.shape[axis], -1)
    counts = np.isfinite(rows).sum(axis=1)
    sums = np.where(np.isfinite(rows), rows, 0.0).sum(axis=1)
    return np.where(counts >= _FEWEST_VALUES, sums / np.maximum(counts, 1), np.nan)


def _sizes(measured: FrfSet, ratio: Complexes, configuration: str) -> Iterator[Notice]:
    omega = np.broadcast_to(2.0 * np.pi * measured.freq_hz, ratio.shape)
    used = np.isfinite(ratio) & (omega > 0.0)
    size, lines = np.log(np.abs(ratio[used])), np.log(omega[used])
    order = KINDS.index(measured.kind)
    # model over test of the stated kind: what the test would have to be multiplied by, as another kind
    scatter = {kind: _scatter(size + (i - order) * lines) for i, kind in enumerate(KINDS)}
    best = min(scatter, key=lambda kind: scatter[kind])
    if best != measured.kind and scatter[best] < _CLEARER * scatter[measured.kind]:
        yield Notice("residual.frf-kind", configuration=configuration, kind=measured.kind, better=best)
        return
    level = float(np.exp(-np.median(size)))
    if not 1.0 / _LEVEL < level < _LEVEL:
        yield Notice("residual.frf-level", configuration=configuration, factor=level, guess=_guess(level))


def _guess(level: float) -> str:
    """Known causes of such a factor."""
    near = [w for w, f in KNOWN_FACTORS.items() for r in (f, 1.0 / f) if abs(np.log(level / r)) < np.log(1.5)]
    return f"; the cause may be {' or '.join(near)}" if near else ""


def _levels(measured: FrfSet, ratio: Complexes, configuration: str) -> Iterator[Notice]:
    """Outputs whose level differs from that of the others, by far more than the levels of the others do."""
    size = -np.log(np.abs(ratio)).reshape(ratio.shape[0], -1)
    known = np.flatnonzero(np.isfinite(size).sum(axis=1) >= _FEWEST_VALUES)
    if len(known) < _FEWEST_OUTPUTS:
        return
    level = np.nanmedian(size[known], axis=1)
    scatter = np.nanmedian(np.abs(size[known] - level[:, None]), axis=1)
    apart = np.abs(level - np.median(level))
    least = np.maximum(np.log(_LEVEL), _OUTLYING * np.maximum(scatter, _scatter(level)))
    for i in np.flatnonzero(apart > least):
        factor = float(np.exp(level[i] - np.median(level)))
        yield Notice(
            "residual.frf-channel-level", configuration=configuration, output=str(measured.responses[known[i]]),
            factor=factor, guess=_guess(factor),
        )  # fmt: skip


def _scatter(values: Reals) -> float:
    """Median absolute deviation."""
    return float(np.median(np.abs(values - np.median(values))))
