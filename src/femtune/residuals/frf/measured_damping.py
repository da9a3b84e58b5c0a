"""Damping ratios of an identified test on the modes of a model, and modes of one side that the other does not have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.correlation import Pairing, pair_modes
from femtune.correlation.mode_damping import paired_damping
from femtune.identification.guided import with_mode_near
from femtune.identification.modal_fit import ModalFit
from femtune.identification.redrawn import RedrawnTest
from femtune.modal import ModeSet
from femtune.modal.frf_set import KINDS
from femtune.model import EigenSolution
from femtune.residuals.frf.residual import FrfResidual

SEEN = 3.0
"""Height of a resonance over the noise beside it from which a test should show it."""
_ROUNDING = 1e-9
"""Height of a resonance, relative to the largest measured value, at or below which the mode is not seen or not
driven."""


_LEAST_RATIO = 1e-6
"""Damping ratio of a mode at least."""


@dataclass(frozen=True, eq=False)
class LackingMode:
    """A mode of the model inside the band of a test that has no partner in the identified test.

    Parameters
    ----------
    mode : its position
    freq_hz : its natural frequency
    damping_ratio : that the model gets for it
    heights : (outputs, inputs) magnitude of its own part of the functions at its resonance, by the model
    noise : (outputs, inputs) standard deviation of the measured functions beside it
    """

    mode: int
    freq_hz: float
    damping_ratio: float
    heights: Reals
    noise: Reals

    @property
    def over_noise(self) -> Reals:
        """(outputs, inputs) heights over the noise; zero where neither is known."""
        known = self.noise > 0.0
        return np.divide(self.heights, self.noise, out=np.where(self.heights > 0.0, np.inf, 0.0), where=known)

    @property
    def above_noise(self) -> float:
        """The largest of these."""
        return float(self.over_noise.max(initial=0.0))

    @property
    def seen_in(self) -> int:
        """Number of functions in which it should stand out of the noise."""
        return int(np.sum(self.over_noise > SEEN))


@dataclass(frozen=True, eq=False)
class MeasuredDamping:
    """Damping ratios (n,) of the modes of a solution, by the modes of an identified test.

    Parameters
    ----------
    test : identified modes
    of : the test behind them, without modes that were looked for
    further : its fit with those that were found; None if none were
    pairing : with those of the model
    ratios : of all modes of the solution; modes without a partner have the median of the paired ones
    lacking : modes of the model inside the band of the test without a partner
    found : positions of modes of the model whose partner the identification has missed
    """

    test: ModeSet
    of: RedrawnTest = field(repr=False)
    further: ModalFit | None = field(repr=False)
    pairing: Pairing
    ratios: Reals
    lacking: tuple[LackingMode, ...] = ()
    found: frozenset[int] = frozenset()

    @cached_property
    def identified(self) -> RedrawnTest:
        """The identified test with the modes that were found, so that its noise is what remains without these."""
        return self.of if self.further is None else self.of.with_fit(self.further)

    @cached_property
    def partners(self) -> tuple[tuple[int, int], ...]:
        """Positions of the pairs, test and model."""
        return tuple((pair.test, pair.model) for pair in self.pairing.pairs)


def measured_damping(
    residual: FrfResidual, test: RedrawnTest, modes: EigenSolution, *, guided: bool = False
) -> MeasuredDamping:
    """Damping ratios of an identified test for the modes of a model.

    Parameters
    ----------
    guided : whether a mode of the test is looked for near each mode of the model without a partner

    Raises
    ------
    FemtuneError : ``correlate.no-damping`` where no mode is paired
    """
    ports = residual.places.ports(modes.point.configured, residual.measured)
    seen = residual.measured.references if test.roving else residual.measured.responses
    identified = test.modes.select_dofs(seen)
    count = modes.wanted
    outputs = np.asarray(ports.outputs @ modes.shapes[:, :count])
    inputs = np.asarray(ports.inputs.T @ modes.shapes[:, :count])
    model = ModeSet(modes.freq_hz, inputs if test.roving else outputs, seen)
    pairing = pair_modes(identified, model)
    ratios = _damping(identified, pairing, count)
    largest = _ROUNDING * float(np.nanmax(np.abs(residual.measured.values)))

    def lacking() -> tuple[LackingMode, ...]:
        out = []
        for j in _without_partner(test, modes, pairing).tolist():
            hertz, ratio = float(modes.freq_hz[j]), float(ratios[j])
            # a window lowers the peak as its damping does
            unit = _at_resonance(hertz, ratio + test.decay / (2.0 * np.pi * hertz), residual.measured.kind)
            heights = unit * np.abs(np.outer(outputs[:, j], inputs[:, j]))
            heights[heights <= largest] = 0.0
            out.append(LackingMode(j, hertz, ratio, heights, _noise_beside(residual, test, hertz)))
        return tuple(out)

    missed, added = lacking(), frozenset[int]()
    further = _with_further(test, [one for one in missed if one.seen_in]) if guided else None
    if further is not None:
        identified = test.modes_of(further).select_dofs(seen)
        pairing = pair_modes(identified, model)
        ratios = _damping(identified, pairing, count)
        left = lacking()
        added = frozenset(one.mode for one in missed) - {one.mode for one in left}
        missed = left
    return MeasuredDamping(identified, test, further, pairing, ratios, missed, added)


def _damping(test: ModeSet, pairing: Pairing, count: int) -> Reals:
    """(n,) ratios; a small one that noise has made negative, where a window was taken out, is nearly zero."""
    return np.maximum(paired_damping(test, pairing, count), _LEAST_RATIO)


def _without_partner(test: RedrawnTest, modes: EigenSolution, pairing: Pairing) -> Integers:
    """Positions of the modes of the model inside the band of the test that are not paired."""
    lines, hertz = test.measured.freq_hz, modes.freq_hz[: modes.wanted]
    inside = np.flatnonzero((hertz >= lines[0]) & (hertz <= lines[-1]))
    return np.setdiff1d(inside, [pair.model for pair in pairing.pairs])


def _with_further(test: RedrawnTest, missed: Sequence[LackingMode]) -> ModalFit | None:
    """The fit of the test with modes near those of the model; None if it has none there."""
    further = None
    for one in missed:
        further = with_mode_near(further or test.fit, test.terms, one.freq_hz, one.damping_ratio, test.decay) or further
    return further


def _at_resonance(freq_hz: float, ratio: float, kind: str) -> float:
    """Magnitude of a function of a kind at the resonance of a mode of unit modal mass and unit shapes."""
    omega = 2.0 * np.pi * freq_hz
    return float(omega ** KINDS.index(kind) / (2.0 * ratio * omega**2))


def _noise_beside(residual: FrfResidual, test: RedrawnTest, freq_hz: float) -> Reals:
    """(outputs, inputs) the noise of a line, not raised by a mode there that the identification has missed."""
    line = int(np.argmin(np.abs(test.measured.freq_hz - freq_hz)))
    rows, columns = (
        residual.measured.responses.align(test.measured.responses)[0],
        residual.measured.references.align(test.measured.references)[0],
    )
    return np.asarray(test.noise_beside_peak(line)[np.ix_(rows, columns)])
