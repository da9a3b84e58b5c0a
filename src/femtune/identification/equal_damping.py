"""Measured FRFs as those of the identified system with one damping ratio, at lines chosen by half bandwidths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from femtune.arrays import Complexes, Reals
from femtune.errors import FemtuneError
from femtune.identification.input_known import IdentifiedModes, InputKnown, identify_frfs, largest_order_of
from femtune.identification.join import complete_lines, in_band
from femtune.identification.modal_solve import outside_terms
from femtune.identification.redrawn import RedrawnTest
from femtune.identification.rigid_body import with_rigid_body
from femtune.identification.window import fit_with_window
from femtune.modal import Equalised, FrfSet, equalise_damping, half_band_lines
from femtune.modal.equalise import Band, poles_to_move


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
    left_out_hz : bands without lines
    largest_order : of the models of the identification
    redrawn : how the FRFs follow the measured ones
    """

    frfs: FrfSet
    damping_ratio: float
    band_hz: Band
    moved: Equalised
    identified: IdentifiedModes
    redrawn: RedrawnTest
    left_out_hz: tuple[Band, ...] = ()
    largest_order: int = 0

    @property
    def outside_ratio(self) -> float:
        """Damping ratio for modes outside the band, whose poles keep theirs: the median of those inside."""
        zeta = self.moved.damping_ratio
        return max(float(np.median(zeta)), 0.0) if len(zeta) else self.damping_ratio

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
    asked : options of the identification, with the band; the default takes all lines. Lines below `suspension_hz` are
        left out, and the poles there keep their damping. The FRFs are those without an exponential window
    per_half_band : lines in a half bandwidth 2ζf
    left_out_hz : bands without lines, whose poles stay as they are

    Raises
    ------
    FemtuneError : ``system.equalise``, and as `identify_frfs`
    """
    asked = asked or InputKnown()
    try:
        identified = identify_frfs(frfs, asked)
    except FemtuneError as error:
        if error.code != "identify.no-poles":
            raise
        raise FemtuneError("system.equalise/no-modes", order=asked.largest_order) from error
    band = _band(identified.measured)
    left_out = without_suspension(left_out_hz, asked.suspension_hz)
    # without rigid-body motion, whose poles at zero are double and have no modes of their own
    elastic = identified.system if asked.rigid is None else identified.system_fit.system
    moved = equalise_damping(elastic, damping_ratio, band, left_out)
    if asked.rigid is not None:
        moved = replace(moved, system=with_rigid_body(moved.system, asked.rigid))
    lines = _lines(band, damping_ratio, per_half_band, left_out)
    again = _Again(damping_ratio, asked, per_half_band, left_out)
    redrawn = _redrawn(identified, again, lines, band)
    return EqualisedTest(
        moved.system.frf(lines),
        damping_ratio,
        band,
        moved,
        identified,
        redrawn,
        again.left_out_hz,
        largest_order_of(identified.table),
    )


def check_equalised_lines(
    frfs: FrfSet,
    damping_ratio: float,
    band_hz: Band | None = None,
    per_half_band: float = 3.0,
    left_out_hz: Sequence[Band] = (),
) -> Reals:
    """The lines that are compared, before a test is identified; a band without lines, and too many, are refused.

    Raises
    ------
    FemtuneError : ``identify.band``, ``system.equalise``, and as `complete_lines`
    """
    used = complete_lines(frfs if band_hz is None else in_band(frfs, *band_hz))
    return _lines(_band(used), damping_ratio, per_half_band, left_out_hz)


def without_suspension(left_out_hz: Sequence[Band], suspension_hz: float) -> tuple[Band, ...]:
    """Bands without lines, with that of the motions on a suspension."""
    bands = tuple((float(low), float(high)) for low, high in left_out_hz)
    on_suspension = (0.0, suspension_hz)
    return bands if not suspension_hz or on_suspension in bands else (on_suspension, *bands)


def _band(used: FrfSet) -> Band:
    return float(used.freq_hz[0]), float(used.freq_hz[-1])


def _lines(band: Band, damping_ratio: float, per_half_band: float, left_out_hz: Sequence[Band]) -> Reals:
    """The lines that are compared in a band."""
    lines = half_band_lines(band, damping_ratio, per_half_band, left_out_hz)
    if not len(lines):
        shown = {"leave_out_hz": [list(one) for one in left_out_hz]}
        raise FemtuneError("system.equalise/no-lines", values=shown, low_hz=band[0], high_hz=band[1])
    return lines


@dataclass(frozen=True)
class _Again:
    """The options of `equalised_test`; called with other functions, it gives their equalised values."""

    damping_ratio: float
    asked: InputKnown
    per_half_band: float
    left_out_hz: tuple[Band, ...]

    def __call__(self, frfs: FrfSet) -> Complexes:
        equalised = equalised_test(frfs, self.damping_ratio, self.asked, self.per_half_band, self.left_out_hz)
        return equalised.frfs.values


def _redrawn(identified: IdentifiedModes, again: _Again, lines: Reals, band: Band) -> RedrawnTest:
    asked = again.asked
    fit = replace(identified.fit, poles=identified.fit.poles - asked.decay)
    moved = poles_to_move(identified.system_fit.poles, band, again.left_out_hz)
    # of one layout in memory, so that a copy in another process gives the same numbers to the last bit
    measured = replace(identified.measured, values=np.ascontiguousarray(identified.measured.values))
    return RedrawnTest(
        measured, fit, fit_with_window(identified.system_fit, asked.decay), outside_terms(asked.decay), moved,
        again.damping_ratio, lines, again, roving=identified.roving, decay=asked.decay, rigid=asked.rigid,
    )  # fmt: skip
