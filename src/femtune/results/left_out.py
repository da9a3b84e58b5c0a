"""Modes of the model that are left out of the compared FRFs, before and after the update, as records."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from femtune.residuals.frf.truncation import frf_residuals
from femtune.results.base import Record

if TYPE_CHECKING:
    from femtune.residuals import CaseState, Evaluation, FrfResidual

RESEMBLES = 0.5
"""Correlation from which a mode after the update is that of before."""


class ModeLeftOutOfFrfs(Record):
    """A mode of the model that FRFs are compared without."""

    configuration: str
    """Name of the configuration."""
    before: int
    """Number of the mode at the initial values, from 1."""
    before_hz: float
    """Its natural frequency there, Hz."""
    after: int
    """Number of the mode after the update."""
    after_hz: float
    """Its natural frequency, Hz."""
    correlation: float
    """(φ₀ᵀM₀φ)² of the mass-normalised shapes before and after (no unit): 1 for the same shape."""

    @property
    def resembles(self) -> bool:
        """False if the mode after the update has another shape than the one that was named."""
        return self.correlation >= RESEMBLES


def left_out_mode_records(start: Evaluation, end: Evaluation) -> tuple[ModeLeftOutOfFrfs, ...]:
    """Those of all FRF residuals, each mode once."""
    last = {state.case.name: state for state in end.states}
    found: dict[tuple[str, int], ModeLeftOutOfFrfs] = {}
    for state in start.states:
        if state.case.name in last:
            for residual in frf_residuals(state.case.residuals):
                for one in _records(residual, last[state.case.name]):
                    found.setdefault((one.configuration, one.before), one)
    return tuple(found.values())


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
