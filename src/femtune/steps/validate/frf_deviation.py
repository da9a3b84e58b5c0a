"""Deviations of FRFs before and after the update, as records."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.residuals.frf.model_way import settled
from femtune.residuals.frf.residual import FrfResidual
from femtune.validation.frfs import squared_deviation

if TYPE_CHECKING:
    from femtune.arrays import Complexes, Flags
    from femtune.modal.equalise import Band
    from femtune.residuals import Evaluation
    from femtune.steps.equalise.record import MappedDamping
    from femtune.steps.validate.frf_validation import UnusedFrfs
from femtune.steps.validate.record.frf_deviation import (
    ChannelDeviation,
    ComparedAs,
    DataSet,
    DeviationSum,
    FrfDeviations,
)


@dataclass(frozen=True, eq=False)
class MeasuredBeside:
    """The measured FRFs of identified tests beside the model with the measured damping.

    Parameters
    ----------
    records : of each configuration
    arrays : their lines and FRFs by key
    left_out_hz : bands that are not compared
    """

    records: Sequence[MappedDamping] = ()
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    left_out_hz: Sequence[Band] = ()


def frf_deviations(
    start: Evaluation,
    end: Evaluation,
    before: Sequence[UnusedFrfs],
    after: Sequence[UnusedFrfs],
    beside: MeasuredBeside = MeasuredBeside(),
) -> FrfDeviations | None:
    """δ of all FRFs; None where the update uses none.

    FRFs of identified tests have it twice: with equal damping on both sides, and as they were measured.

    Parameters
    ----------
    before, after : FRFs that the update did not use, beside the model at the start and at the end
    beside : the measured FRFs of identified tests
    """
    used = tuple(_used(start, end))
    if not used:
        return None
    return deviations_of((*used, *_measured(beside, used), *_unused(before, after)))


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


_DATA_SETS: tuple[DataSet, ...] = ("calibration", "validation")
"""Data that the update used, and data that it did not use."""
_COMPARED: tuple[ComparedAs, ...] = ("equal damping", "measured")


def _used(start: Evaluation, end: Evaluation) -> Iterator[ChannelDeviation]:
    for first, last in zip(start.states, end.states):
        for one in first.case.residuals:
            residual = settled(one)
            if isinstance(residual, FrfResidual) and first.case.name == last.case.name:
                models = [residual.functions(residual.way.model(s, residual.highest_hz))[0] for s in (first, last)]
                known, test = np.isfinite(residual.sd), residual.measured.values
                labels = residual.measured.responses.labels(), residual.measured.references.labels()
                compared: ComparedAs = "measured" if residual.identified is None else "equal damping"
                yield from _channels(residual.configuration, "calibration", labels, models, test, known, compared)


def _measured(beside: MeasuredBeside, used: Sequence[ChannelDeviation]) -> Iterator[ChannelDeviation]:
    """The FRFs that were compared with equal damping as they were measured."""
    equalised = {(c.configuration, c.output, c.input) for c in used if c.compared == "equal damping"}
    for one in beside.records:
        if one.before_values_key is None:
            continue
        keys = (one.test_values_key, one.before_values_key, one.after_values_key)
        test, *models = (np.asarray(beside.arrays[key]) for key in keys)
        hertz, known = beside.arrays[one.freq_key], np.isfinite(test)
        for low, high in beside.left_out_hz:
            known[:, :, (hertz >= low) & (hertz <= high)] = False
        for channel in _channels(one.configuration, "calibration", (one.outputs, one.inputs), models, test, known):
            if (channel.configuration, channel.output, channel.input) in equalised:
                yield channel


def _unused(before: Sequence[UnusedFrfs], after: Sequence[UnusedFrfs]) -> Iterator[ChannelDeviation]:
    for old, new in zip(before, after):
        if old.found is not None and new.found is not None:
            labels = new.found.outputs, new.found.inputs
            known = old.found.known & new.found.known
            models = [old.found.model, new.found.model]
            yield from _channels(new.case.name, "validation", labels, models, new.found.test, known)


def _channels(
    name: str, data: DataSet, labels: tuple[Sequence[str], Sequence[str]], models: Sequence[Complexes],
    test: Complexes, known: Flags, compared: ComparedAs = "measured",
) -> Iterator[ChannelDeviation]:  # fmt: skip
    before, after = (squared_deviation(model, test, known) for model in models)
    for i, j in np.ndindex(before.shape):
        if np.isfinite(before[i, j]):
            yield ChannelDeviation(
                configuration=name,
                data=data,
                compared=compared,
                output=labels[0][i],
                input=labels[1][j],
                lines=int(known[i, j].sum()),
                before=float(before[i, j]),
                after=float(after[i, j]),
            )


def _sums(channels: Sequence[ChannelDeviation], configuration: str = "") -> Iterator[DeviationSum]:
    for data in _DATA_SETS:
        for compared in _COMPARED:
            of_data = [c for c in channels if c.data == data and c.compared == compared]
            if of_data:
                yield _sum(data, compared, of_data, configuration)


def _sum(data: DataSet, compared: ComparedAs, channels: Sequence[ChannelDeviation], configuration: str) -> DeviationSum:
    lines = np.array([c.lines for c in channels], float)
    before, after = (float(np.average([getattr(c, k) for c in channels], weights=lines)) for k in ("before", "after"))
    return DeviationSum(
        data=data,
        compared=compared,
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
    how = ", with equal damping" if one.compared == "equal damping" else ""
    return (
        f"δ of the {one.data} set, {one.frfs} FRFs{how}: {one.before:.3g} before, {one.after:.3g} after{change}{risen}."
    )
