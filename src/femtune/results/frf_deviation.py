"""The deviation δ of measured FRFs before and after the update, of the FRFs that it used and of those that it did not.

δ is the mean over the lines of |log₁₀(H/H_test)|², with the principal value of the complex logarithm of the ratio, as
in published FRF calibrations.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from femtune.residuals.frf.model_way import settled
from femtune.residuals.frf.residual import FrfResidual
from femtune.results.base import Record
from femtune.validation.frfs import squared_deviation

if TYPE_CHECKING:
    from femtune.arrays import Complexes, Flags
    from femtune.residuals import Evaluation
    from femtune.results.frf_validation import UnusedFrfs

DataSet = Literal["calibration", "validation"]


class ChannelDeviation(Record):
    """One measured FRF."""

    configuration: str
    """Name of the configuration."""
    data: DataSet
    """"calibration" if the update used it, otherwise "validation"."""
    output: str
    """Response DOF."""
    input: str
    """Reference DOF."""
    lines: int
    """Number of frequency lines."""
    before: float
    """δ before the update (no unit)."""
    after: float
    """δ after the update."""


class DeviationSum(Record):
    """FRFs of one set, each line of each FRF with the same weight."""

    data: DataSet
    """The set."""
    configuration: str = ""
    """Name of the configuration; "" for all together."""
    frfs: int
    """Number of FRFs."""
    before: float
    """δ before the update."""
    after: float
    """δ after the update."""
    change_percent: float | None
    """Change of δ in %; None if it was zero before."""
    risen: int
    """Number of FRFs whose δ has increased."""


class FrfDeviations(Record):
    """δ of the measured FRFs before and after the update."""

    sums: tuple[DeviationSum, ...]
    """The calibration set, and the validation set if there is one, of all configurations."""
    by_configuration: tuple[DeviationSum, ...] = ()
    """The same for each configuration."""
    channels: tuple[ChannelDeviation, ...]
    """Every FRF."""
    sentences: tuple[str, ...]
    """The sums in words."""


def frf_deviations(
    start: Evaluation, end: Evaluation, before: Sequence[UnusedFrfs], after: Sequence[UnusedFrfs]
) -> FrfDeviations | None:
    """δ of all FRFs; None where the update uses none.

    Parameters
    ----------
    before, after : FRFs that the update did not use, beside the model at the start and at the end
    """
    used = tuple(_used(start, end))
    if not used:
        return None
    return deviations_of((*used, *_unused(before, after)))


def deviations_of(channels: Sequence[ChannelDeviation]) -> FrfDeviations:
    """Single FRFs and their sums, of all configurations and of each."""
    sums = tuple(_sums(channels))
    each = tuple(
        one
        for name in dict.fromkeys(c.configuration for c in channels)
        for one in _sums([c for c in channels if c.configuration == name], name)
    )
    return FrfDeviations(
        sums=sums, by_configuration=each, channels=tuple(channels), sentences=tuple(map(_sentence, sums))
    )


_SETS: tuple[DataSet, ...] = ("calibration", "validation")


def _used(start: Evaluation, end: Evaluation) -> Iterator[ChannelDeviation]:
    for first, last in zip(start.states, end.states):
        for one in first.case.residuals:
            residual = settled(one)
            if isinstance(residual, FrfResidual) and first.case.name == last.case.name:
                models = [residual.functions(residual.way.model(s, residual.highest_hz))[0] for s in (first, last)]
                known, test = np.isfinite(residual.sd), residual.measured.values
                labels = residual.measured.responses.labels(), residual.measured.references.labels()
                yield from _channels(residual.configuration, "calibration", labels, models, test, known)


def _unused(before: Sequence[UnusedFrfs], after: Sequence[UnusedFrfs]) -> Iterator[ChannelDeviation]:
    for old, new in zip(before, after):
        if old.found is not None and new.found is not None:
            labels = new.found.outputs, new.found.inputs
            known = old.found.known & new.found.known
            models = [old.found.model, new.found.model]
            yield from _channels(new.case.name, "validation", labels, models, new.found.test, known)


def _channels(
    name: str, data: DataSet, labels: tuple[Sequence[str], Sequence[str]], models: Sequence[Complexes],
    test: Complexes, known: Flags,
) -> Iterator[ChannelDeviation]:  # fmt: skip
    before, after = (squared_deviation(model, test, known) for model in models)
    for i, j in np.ndindex(before.shape):
        if np.isfinite(before[i, j]):
            yield ChannelDeviation(
                configuration=name,
                data=data,
                output=labels[0][i],
                input=labels[1][j],
                lines=int(known[i, j].sum()),
                before=float(before[i, j]),
                after=float(after[i, j]),
            )


def _sums(channels: Sequence[ChannelDeviation], configuration: str = "") -> Iterator[DeviationSum]:
    for data in _SETS:
        own = [c for c in channels if c.data == data]
        if own:
            yield _sum(data, own, configuration)


def _sum(data: DataSet, channels: Sequence[ChannelDeviation], configuration: str) -> DeviationSum:
    lines = np.array([c.lines for c in channels], float)
    before, after = (float(np.average([getattr(c, k) for c in channels], weights=lines)) for k in ("before", "after"))
    return DeviationSum(
        data=data,
        configuration=configuration,
        frfs=len(channels),
        before=before,
        after=after,
        change_percent=100.0 * (after / before - 1.0) if before > 0.0 else None,
        risen=sum(c.after > c.before for c in channels),
    )


def _sentence(one: DeviationSum) -> str:
    change = "" if one.change_percent is None else f" ({one.change_percent:+.0f} %)"
    risen = f"; it has increased in {one.risen} of them" if one.risen else ""
    return f"δ of the {one.data} set, {one.frfs} FRFs: {one.before:.3g} before, {one.after:.3g} after{change}{risen}."
