"""Frequency lines of measured FRFs that are compared: those of a band, or a few around each resonance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError, Notice
from femtune.residuals.case import CaseState
from femtune.residuals.pairing import pair_case


@dataclass(frozen=True, eq=False)
class Region:
    """Lines that belong together.

    Parameters
    ----------
    label : of the resonance; "" for a band
    at : (n,) positions among the lines of the test, increasing
    stretch : frequency of the model's resonance over that of the test's; the model answers at lines so much higher
    """

    label: str
    at: Integers
    stretch: float = 1.0


class Lines(Protocol):
    """A choice among the lines of a test."""

    def regions(self, freq_hz: Reals) -> list[Region]:
        """Regions of the test's lines (n,), each line in one of them at most.

        Raises
        ------
        FemtuneError : ``residual.no-frf-lines``
        """
        ...


@dataclass(frozen=True)
class Band:
    """Lines from `from_hz` to `to_hz`, at most `most` of them, evenly thinned; 0 Hz is left out."""

    from_hz: float = 0.0
    to_hz: float = float("inf")
    most: int | None = None

    def regions(self, freq_hz: Reals) -> list[Region]:
        """One region without a label."""
        inside = np.flatnonzero((freq_hz >= self.from_hz) & (freq_hz <= self.to_hz) & (freq_hz > 0.0))
        if not inside.size:
            raise _no_lines(freq_hz, self._words, "widen the band")
        if self.most is not None and len(inside) > self.most:
            inside = inside[np.unique(np.linspace(0, len(inside) - 1, self.most).round().astype(int))]
        return [Region("", inside)]

    @property
    def _words(self) -> str:
        open_ended = not np.isfinite(self.to_hz)
        return f"from {self.from_hz:g} Hz on" if open_ended else f"between {self.from_hz:g} and {self.to_hz:g} Hz"


@dataclass(frozen=True)
class Resonance:
    """A resonance of the test.

    Parameters
    ----------
    label : of the mode
    freq_hz : natural frequency
    damping_ratio : ζ; the half-power bandwidth is 2ζf
    model_hz : natural frequency of the paired mode of the model: its functions are then taken at lines that are so
        much higher, so that the peaks coincide and what is left of the difference is damping; None: the same lines

    Raises
    ------
    FemtuneError : ``residual.resonance`` where frequency or damping is not a positive number
    """

    label: str
    freq_hz: float
    damping_ratio: float
    model_hz: float | None = None

    def __post_init__(self) -> None:
        numbers = np.array([self.freq_hz, self.damping_ratio, self.freq_hz if self.model_hz is None else self.model_hz])
        if not (np.isfinite(numbers).all() and (numbers > 0.0).all() and self.damping_ratio < 1.0):
            raise FemtuneError(
                "residual.resonance/region",
                values={"frequency (Hz)": self.freq_hz, "damping ratio": self.damping_ratio},
                mode=self.label,
            )


@dataclass(frozen=True)
class Resonances:
    """A few lines around each resonance; a line between two belongs to the nearer one.

    Parameters
    ----------
    modes : the resonances
    bandwidths : width of a region in half-power bandwidths 2ζf
    lines : wanted lines in a half-power bandwidth, of which the nearest of the test are taken
    """

    modes: Sequence[Resonance] = field(default_factory=tuple)
    bandwidths: float = 2.0
    lines: int = 3

    def regions(self, freq_hz: Reals) -> list[Region]:
        """A region for each resonance that has a line; at least the nearest line within its width."""
        out = []
        for i, mode in enumerate(self.modes):
            at = self._lines_of(freq_hz, mode)
            at = at[self._nearest(freq_hz[at]) == i]
            if at.size:
                out.append(Region(mode.label, at, (mode.model_hz or mode.freq_hz) / mode.freq_hz))
        if not out:
            raise _no_lines(
                freq_hz, "at the resonances", "widen the regions, or check the damping ratios of the test modes"
            )
        return out

    def _lines_of(self, freq_hz: Reals, mode: Resonance) -> Integers:
        half = self.bandwidths * mode.damping_ratio * mode.freq_hz
        count = max(2, round(self.lines * self.bandwidths)) + 1
        wanted = np.linspace(mode.freq_hz - half, mode.freq_hz + half, count)
        at = np.unique(np.abs(freq_hz[:, None] - wanted).argmin(axis=0)) if freq_hz.size else np.zeros(0, np.int64)
        spacing = np.diff(freq_hz).min(initial=np.inf)
        reach = max(half, 0.5 * spacing if np.isfinite(spacing) else 0.0) * (1.0 + 1e-9)
        return at[(np.abs(freq_hz[at] - mode.freq_hz) <= reach) & (freq_hz[at] > 0.0)]

    def _nearest(self, lines: Reals) -> Integers:
        """Position of the resonance that is nearest to each line, in half bandwidths."""
        centre = np.array([m.freq_hz for m in self.modes])
        width = np.array([m.damping_ratio * m.freq_hz for m in self.modes])
        return np.asarray((np.abs(lines[:, None] - centre) / width).argmin(axis=1))


def _no_lines(freq_hz: Reals, where: str, hint: str) -> FemtuneError:
    span = f"{freq_hz[0]:g} to {freq_hz[-1]:g} Hz" if freq_hz.size else "none"
    return FemtuneError("residual.no-frf-lines", values={"lines of the test": span}, hint=hint, place=where)


# ----------------------------------------------------------------------------------------------------
# Resonances of the test that have partners in the model, as regions of frequency lines.


@dataclass(frozen=True)
class PairedResonances:
    """Which paired test modes have a region, and how wide it is.

    Parameters
    ----------
    labels : of test modes; None takes all that are paired
    ratio : damping ratio of modes whose test tells none; None takes the test's word for it
    aligned : True takes the model's functions at lines that make its peaks coincide with the test's
    bandwidths, lines : as of `Resonances`
    """

    labels: tuple[str, ...] | None = None
    ratio: float | None = None
    aligned: bool = False
    bandwidths: float = 2.0
    lines: int = 3

    def found(self, state: CaseState) -> tuple[Resonances, tuple[Notice, ...]]:
        """Regions of the modes that are paired in a state, and the others with their reasons.

        Raises
        ------
        FemtuneError : ``residual.resonance`` where no mode is left, or one has no damping ratio
        """
        modes = tuple(self._paired(state))
        if not modes:
            raise FemtuneError("residual.resonance/none-paired", configuration=state.case.name)
        return Resonances(modes, self.bandwidths, self.lines), tuple(self._left(state))

    def _wanted(self, label: str) -> bool:
        return self.labels is None or label in self.labels

    def _paired(self, state: CaseState) -> Iterator[Resonance]:
        test, solution = state.case.test, state.solution
        for tests, models in state.groups:
            for i, j in zip(sorted(tests), sorted(models)):
                label, freq = test.labels[i], float(test.freq_hz[i])
                if self._wanted(label):
                    partner = float(solution.freq_hz[j]) if self.aligned else None
                    yield Resonance(label, freq, self._ratio(state, i), partner)

    def _ratio(self, state: CaseState, i: int) -> float:
        given = state.case.test.damping_ratio
        known = float(given[i]) if given is not None else 0.0
        return known if known > 0.0 else self.ratio or 0.0

    def _left(self, state: CaseState) -> Iterator[Notice]:
        labels = state.case.test.labels
        for u in pair_case(state.case, state.solution).unpaired_test:
            if self._wanted(labels[u.test]):
                yield Notice(
                    "residual.resonance-unpaired",
                    level="info",
                    configuration=state.case.name,
                    mode=labels[u.test],
                    reason=u.reason,
                )
