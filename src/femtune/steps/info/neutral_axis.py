"""Bars whose neutral axis is moved, as records."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from femtune.model.neutral_axis import offset_beams, offset_mass_change
from femtune.study.record import Alert, alert

if TYPE_CHECKING:
    from femtune.model import EigenSolution
    from femtune.model.configured import ModelPoint


_SMALL_CHANGE = 0.001
"""Relative change of a frequency below which modes are not listed.

It is smaller than errors of measured frequencies.
"""
_LARGE_CHANGE = 0.01
"""Relative change of a frequency above which the notice is a warning.

It is of the size of frequency errors that an update corrects.
"""


_MOST_LISTED = 6
"""Modes with the largest changes that a notice lists, so that it stays one sentence."""


def of_unknown_neutral_axis(name: str, point: ModelPoint) -> Iterable[Alert]:
    """That there are such beams, where no modes are computed."""
    beams = offset_beams(point)
    if beams:
        yield alert("info", "model.neutral-axis/not-computed", configuration=name, beams=beams)


def of_neutral_axis(name: str, solution: EigenSolution) -> Iterable[Alert]:
    """How far frequencies would move if the mass of beams were at their shear centres, not on the neutral axis."""
    offset = offset_mass_change(solution)
    if offset is None:
        return
    change = offset.change
    listed = [int(k) for k in np.flatnonzero(np.abs(change) >= _SMALL_CHANGE)]
    largest = sorted(listed, key=lambda k: -abs(change[k]))[:_MOST_LISTED]
    parts = [f"{100.0 * change[k]:+.2g} % in mode {k + 1} ({offset.freq_hz[k]:.5g} Hz)" for k in sorted(largest)]
    if len(listed) > len(largest):
        parts.append(f"less than that in {len(listed) - len(largest)} more")
    lost = np.flatnonzero(np.isnan(change) & ~np.isnan(offset.freq_hz))
    if len(lost):
        numbers = ", ".join(str(k + 1) for k in lost)
        parts.append(f"mode{'s' if len(lost) > 1 else ''} {numbers} would have other shapes")
    rest = int((np.abs(change) < _SMALL_CHANGE).sum())
    if rest:
        parts.append(f"less than {100.0 * _SMALL_CHANGE:g} % in {'the others' if parts else 'all modes'}")
    grave = len(lost) or np.abs(change[listed]).max(initial=0.0) > _LARGE_CHANGE
    facts = {"configuration": name, "beams": offset.beams, "changes": "; ".join(parts)}
    yield alert("warning" if grave else "info", "model.neutral-axis", **facts)
