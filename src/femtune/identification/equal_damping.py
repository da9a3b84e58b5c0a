"""Measured FRFs as those of the identified system with one damping ratio, at lines chosen by half bandwidths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from femtune.identification.input_known import IdentifiedModes, InputKnown, identify_frfs
from femtune.modal import Equalised, FrfSet, equalise_damping, half_band_lines
from femtune.modal.equalise import Band


@dataclass(frozen=True, eq=False)
class EqualisedTest:
    """FRFs of an identified test with one damping ratio.

    Parameters
    ----------
    frfs : at the chosen lines
    damping_ratio : of all modes inside the band
    band_hz : of the identification and of the lines
    moved : the identified system with that ratio, and what its modes had before
    identified : the identification
    """

    frfs: FrfSet
    damping_ratio: float
    band_hz: Band
    moved: Equalised
    identified: IdentifiedModes

    @property
    def misfit(self) -> float:
        """Median over the functions of the relative error of the identified system, before its poles are moved."""
        return float(np.median(self.identified.quality.error))


def equalised_test(
    frfs: FrfSet,
    damping_ratio: float,
    asked: InputKnown | None = None,
    per_half_band: float = 3.0,
    left_out_hz: Sequence[Band] = (),
) -> EqualisedTest:
    """Identify a test, equalise its damping and compute its FRFs at new lines.

    Parameters
    ----------
    frfs : measured, with values for every pair of response and reference
    damping_ratio : ζ of all modes inside the band
    asked : options of the identification, with the band; the default takes all lines
    per_half_band : lines in a half bandwidth 2ζf
    left_out_hz : bands without lines, whose poles stay as they are

    Raises
    ------
    FemtuneError : ``system.equalise``, and as `identify_frfs`
    """
    identified = identify_frfs(frfs, asked or InputKnown())
    used = identified.measured.freq_hz
    band = (float(used[0]), float(used[-1]))
    moved = equalise_damping(identified.system, damping_ratio, band, left_out_hz)
    lines = half_band_lines(band, damping_ratio, per_half_band, left_out_hz)
    return EqualisedTest(moved.system.frf(lines), damping_ratio, band, moved, identified)
