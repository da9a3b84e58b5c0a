"""The lines of a whole record with one force: no segments, no window, and the transients of its ends in the fit.

A segment of a record begins with motion that was there before it, and ends before its response does. Windows hide this
at the price of the resolution: damping that is small beside it is found too large. The transform of a whole record is
Y = H U + T + noise, exactly. T is a sum of the modes of the structure, with residues of its own, since all that its
ends leave out are free decays. The modal fit has both.

Source: R. Pintelon, J. Schoukens (2012), System Identification: A Frequency Domain Approach, 2nd edition, chapter 6.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, median_filter, uniform_filter1d
from scipy.special import chdtri

from femtune.arrays import Complexes, Reals
from femtune.dofs import DofSet
from femtune.identification.modal_solve import (
    OutsideTerms,
    PartialFractions,
    modal_basis,
    with_cut_decays,
    with_transients,
)
from femtune.modal import FrfSet, TimeSeries

MOST_VALUES = 4_000_000
"""Lines times responses up to which whole records are used: 64 MB."""
LEAST_LINES = 100
"""Lines of a band at least."""
LEAST_REST = 8
"""Samples before a hit that show whether the structure is at rest."""
REST_LEVEL = 3.0
"""What moves less than this times its noise is at rest."""
REST_PART = 0.005
"""What moves less than this part of the peak of the response is at rest."""
WINDOW = 9
"""Neighbouring lines whose functions are a parabola, to see the noise; two more for each further piece of a record."""
PULSE_LEVEL = 6.0
"""What exceeds this times the noise of the force is part of a hit, and so are the samples beside it."""
_BESIDE = 16
"""Samples before and after those of a hit that belong to it: the ends of the pulse and the ringing of a filter."""
_ROUNDING = 1e-9
"""Part of the largest force below which a sample is rounding."""
_MEDIAN_OF_NORMAL = 0.6745
"""Median of the magnitude of Gaussian noise with a standard deviation of 1."""
_NEIGHBOURS = 51
"""Windows of lines over which the median of the noise is taken."""


@dataclass(frozen=True, eq=False)
class WholeRecord:
    """Lines of a record.

    Parameters
    ----------
    frfs : (n, 1, k) Y/U, with the transients that are in them
    force : (k,) U
    colour : (k,) size of the noise of a response beside that of the other lines
    noise : (n, k) its standard deviation, √E|error|² of Y
    step_s : time from one sample to the next
    width : neighbouring lines of which each function is the mean; 0 where the functions were made in another way
    pulse : (samples,) the force of a record that begins at rest, whose only transients are the decays that its end cuts
        off; zero where it is noise. None where the transients have residues of their own
    begins : first sample of each piece of which the record consists; each has transients of its own
    """

    frfs: FrfSet
    force: Complexes
    colour: Reals
    noise: Reals
    step_s: float
    width: int = 0
    pulse: Reals | None = None
    begins: tuple[int, ...] = (0,)

    @property
    def line(self) -> Reals:
        """(k,) weights of the lines, inverses of the noise of Y/U but for a factor."""
        return np.asarray(np.abs(self.force) / self.colour)

    def basis(self, poles: Complexes, terms: OutsideTerms) -> PartialFractions:
        """The columns of the functions with their transients."""
        frfs = self.frfs
        modal = modal_basis(frfs.freq_hz, poles, frfs.kind, terms)
        if self.pulse is None:
            return with_transients(modal, frfs.freq_hz, poles, self.force, self.step_s, self.begins)
        return with_cut_decays(modal, frfs.freq_hz, poles, frfs.kind, self.force, self.pulse, self.step_s)

    def of_functions(self, coefficients: Reals, poles: int, terms: int) -> Reals:
        """Of the coefficients (n, q) of all columns those without residues and terms of the transients."""
        if self.pulse is not None:
            return coefficients
        first = 2 * poles * (1 + len(self.begins))
        return np.hstack([coefficients[:, : 2 * poles], coefficients[:, first : first + terms]])

    def inside(self, low_hz: float, high_hz: float) -> WholeRecord:
        """The lines of a band."""
        return self._at(np.flatnonzero((self.frfs.freq_hz >= low_hz) & (self.frfs.freq_hz <= high_hz)))

    def thinned(self, most: int) -> WholeRecord:
        """At most so many lines, evenly taken."""
        k = len(self.force)
        return self._at(np.unique(np.linspace(0, k - 1, min(most, k)).astype(int)))

    def _at(self, kept: NDArray[np.int64]) -> WholeRecord:
        frfs = replace(self.frfs, freq_hz=self.frfs.freq_hz[kept], values=self.frfs.values[:, :, kept])
        return replace(self, frfs=frfs, force=self.force[kept], colour=self.colour[kept], noise=self.noise[:, kept])

    def without(self, ends: Complexes) -> WholeRecord:
        """The lines without the part (n, k) of the functions that the transients of the ends are."""
        return replace(self, frfs=replace(self.frfs, values=self.frfs.values - ends[:, None, :]))


def whole_record(
    record: TimeSeries,
    kind: str,
    low_hz: float,
    high_hz: float,
    rest: int | None = None,
    begins: tuple[int, ...] = (0,),
) -> WholeRecord | None:
    """The lines of a band; None where they are too many or too few, or where the force has none.

    Parameters
    ----------
    record : with one input and without lost samples; responses of one quantity
    kind : of the functions
    rest : samples before a single hit, in which nothing may move; else there is no such record
    begins : first sample of each of the pieces that were put together to this record
    """
    rows, (column,) = record.positions("response") + record.positions("reference"), record.positions("input")
    hz = np.fft.rfftfreq(record.samples, 1.0 / record.even_hz)
    kept = np.flatnonzero((hz >= low_hz) & (hz <= high_hz) & (hz > 0.0))
    if not LEAST_LINES <= len(kept) <= MOST_VALUES / len(rows):
        return None
    values = record.values - np.median(record.values, axis=1, keepdims=True)
    force = np.fft.rfft(values[column])[kept]
    if not (np.abs(force) > 1e-9 * np.abs(force).max()).all():
        return None
    motion = np.stack([np.fft.rfft(values[i])[kept] for i in rows])
    # the decay of the motion before a piece turns from line to line
    turns = np.exp(-2j * np.pi * np.outer(kept, begins) / record.samples)
    noise = _noise(motion, force, turns)
    if not (noise > 0.0).all():
        return None
    if rest is not None and not _at_rest(values[rows], rest, noise):
        return None
    log = np.log(noise)
    colour = np.exp(np.mean(log - log.mean(axis=1, keepdims=True), axis=0))
    frfs = FrfSet(
        np.asarray(hz[kept], float), (motion / force)[:, None, :], DofSet(record.channels[i].dof for i in rows),
        record.dofs("input"), kind, source=record.source,
    )  # fmt: skip
    pulse = None if rest is None else _pulse(values[column])
    return WholeRecord(frfs, force, colour, noise, 1.0 / record.even_hz, pulse=pulse, begins=begins)


def _at_rest(responses: Reals, samples: int, noise: Reals) -> bool:
    """Whether responses (n, N) move no more in their first samples than their noise (n, k) at the lines explains."""
    if samples < LEAST_REST:
        return False
    level = np.median(noise, axis=1) / np.sqrt(responses.shape[1])
    most = np.maximum(REST_LEVEL * level, REST_PART * np.abs(responses).max(axis=1))
    return bool((np.sqrt(np.mean(responses[:, :samples] ** 2, axis=1)) <= most).all())


def _pulse(force: Reals) -> Reals:
    """(samples,) a force with hits, with zeros for its noise: the sum of a long record would contain mainly noise."""
    size = np.abs(force)
    least = max(PULSE_LEVEL * float(np.median(size)) / _MEDIAN_OF_NORMAL, _ROUNDING * float(size.max()))
    return np.where(binary_dilation(size > least, iterations=_BESIDE), force, 0.0)


def _noise(motion: Complexes, force: Complexes, turns: Complexes) -> Reals:
    """(n, k) √E|error|² near each line: what parabolas over a few neighbouring lines leave, in the median.

    Parameters
    ----------
    motion, force : (n, k), (k,) their transforms
    turns : (k, pieces) by which the transients of each piece turn from line to line
    """
    n, k = motion.shape
    window = WINDOW + 2 * (turns.shape[1] - 1)
    count = k // window
    at = np.arange(window) - window // 2
    powers = np.vander(at / (window // 2), 3)
    pieces = motion[:, : count * window].reshape(n, count, window)
    U = force[: count * window].reshape(count, window)
    # the functions, and the transients of the ends, which do not follow the force
    T = turns[: count * window].reshape(count, window, -1, 1) * powers[:, None, 1:]
    basis = np.concatenate([U[:, :, None] * powers, T.reshape(count, window, -1)], axis=2)
    Q = np.linalg.qr(basis / np.linalg.norm(basis, axis=1, keepdims=True))[0]
    left = pieces - np.einsum("cwq,ncq->ncw", Q, np.einsum("cwq,ncw->ncq", Q.conj(), pieces))
    freedom = window - Q.shape[2]
    power = np.sum(np.abs(left) ** 2, axis=2) / freedom
    width = min(_NEIGHBOURS, 2 * ((count - 1) // 2) + 1)
    middle = median_filter(power, (1, width), mode="nearest") / (chdtri(2 * freedom, 0.5) / (2 * freedom))
    return np.asarray(np.sqrt(np.repeat(middle, window, axis=1)[:, np.minimum(np.arange(k), count * window - 1)]))


def in_bins(whole: WholeRecord, most: int) -> WholeRecord:
    """With the least `width` that leaves at most so many functions."""
    return replace(whole, width=-(-len(whole.force) // most))


def binned(whole: WholeRecord) -> tuple[FrfSet, Reals]:
    """Functions of `width` neighbouring lines together, and √E|error|² of each."""
    k, width = len(whole.force), whole.width
    count = k // width
    cut = slice(0, count * width)
    weights = (np.abs(whole.force[cut]) / whole.colour[cut]).reshape(count, width) ** 2
    total = weights.sum(axis=1)

    def mean(values: NDArray) -> NDArray:
        return np.asarray((values[..., cut].reshape(*values.shape[:-1], count, width) * weights).sum(axis=-1) / total)

    size = np.abs(whole.force[cut].reshape(count, width)) ** 2
    noise = whole.noise[:, cut].reshape(-1, count, width) ** 2
    sd = np.sqrt((weights**2 * noise / size).sum(axis=2)) / total
    lines = whole.frfs.freq_hz[cut].reshape(count, width)
    # rounding would put the mean of a line at the end of the band outside of it
    at = np.clip(mean(whole.frfs.freq_hz), lines[:, 0], lines[:, -1])
    frfs = replace(whole.frfs, freq_hz=at, values=mean(whole.frfs.values))
    return frfs, sd[:, None, :]


COHERENCE_LINES = 32
"""Neighbouring lines at least from whose powers a coherence is computed: of noise alone it is below a tenth then."""


def coherence_of_fit(whole: WholeRecord, model: Complexes, left: Complexes) -> Reals:
    """(n, count) share of the power of each response, without its transients, that the model explains at the bins.

    A record that is not cut into segments has no averages, from which a coherence is computed otherwise. This one has
    in it what is not linear, and what the model lacks, as that of averages has.

    Parameters
    ----------
    model, left : (n, k) the functions at the lines, and what they leave of the measured ones
    """
    count, width = len(whole.force) // whole.width, whole.width
    force = np.abs(whole.force[: count * width]) ** 2

    def power(values: Complexes) -> Reals:
        together = (np.abs(values[:, : count * width]) ** 2 * force).reshape(len(values), count, width).sum(axis=2)
        size = min(2 * (COHERENCE_LINES // (2 * width)) + 1, count)
        return np.asarray(uniform_filter1d(together, size, axis=1, mode="nearest"))

    explained, rest = power(model), power(left)
    return np.asarray(explained / np.maximum(explained + rest, np.finfo(float).tiny))
