"""Model modes that are excluded from the compared FRFs, as records."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from femtune.residuals.frf.truncation import frf_residuals

if TYPE_CHECKING:
    from femtune.residuals import CaseState, Evaluation, FrfResidual
from femtune.steps.update.record.left_out import ModeLeftOutOfFrfs


def left_out_mode_records(start: Evaluation, end: Evaluation) -> tuple[ModeLeftOutOfFrfs, ...]:
    """Those of all FRF residuals, each mode once."""
    last = {state.case.name: state for state in end.states}
    records: dict[tuple[str, int], ModeLeftOutOfFrfs] = {}
    for state in start.states:
        if state.case.name in last:
            for residual in frf_residuals(state.case.residuals):
                for one in _records(residual, last[state.case.name]):
                    records.setdefault((one.configuration, one.before), one)
    return tuple(records.values())


def _records(residual: FrfResidual, last: CaseState) -> Iterator[ModeLeftOutOfFrfs]:
    left_out = residual.left_out
    if left_out is None:
        return
    modes = residual.way.model(last, residual.highest_hz)
    numbers, likeness = left_out.of(modes)  # type: ignore[arg-type]  # superposed of modes
    for i, j in enumerate(numbers):
        yield ModeLeftOutOfFrfs(
            configuration=residual.configuration, before=1 + left_out.numbers[i],
            before_hz=float(left_out.freq_hz[i]), after=1 + j, after_hz=float(modes.freq_hz[j]),  # type: ignore[union-attr]
            correlation=float(likeness[i]),
        )  # fmt: skip
