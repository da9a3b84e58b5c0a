"""Modes of records with unmeasured excitation; each method turns a record into a ModeSet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import ceil

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from femtune.arrays import Complexes, Reals
from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.identification.averaging import CrossSpectra, cross_spectra, no_lost_samples
from femtune.identification.choice import Candidate, Limits, Rule, choose
from femtune.identification.fdd import decompose, enhanced, peaks
from femtune.identification.pole_table import PoleTable, table_of
from femtune.identification.quantities import derivatives_of, in_one_quantity
from femtune.identification.realisation import Observability, correlations, era
from femtune.identification.ssi import CovarianceModel, PoleScatter, covariance_driven, data_driven, scatter_of_order
from femtune.identification.tfie import mode_at, phase_scatter, steady_lines
from femtune.modal import Channel, ModeSet, TimeSeries
from femtune.modal.shape_criteria import turn_to_real_axis
from femtune.testdata.checks import mean_phase_deviation_deg, phase_collinearity

_LEAST_SEGMENTS = 8
"""Segments of spectra in a record at least: the relative standard deviation of a spectrum of eight averages is 35 %."""


@dataclass(frozen=True)
class Operational:
    """Settings of output-only methods.

    Parameters
    ----------
    band_hz : where modes are looked for; records are resampled to a little above its end
    largest_order : of state-space models; orders go up to it in steps of two
    pieces : number of segments for the variance of the correlations
    resolution_hz : of spectra; None: a four-hundredth of the lower end of the band, or what the record allows
    references : DOFs whose past is used; None: all responses
    block_rows : of Hankel matrices; None: one and a half periods of the lowest frequency, 40 at most
    limits, rule : of stable poles and of modes among them
    """

    band_hz: tuple[float, float]
    largest_order: int = 40
    pieces: int = 20
    resolution_hz: float | None = None
    references: DofSet | None = None
    block_rows: int | None = None
    limits: Limits = field(default_factory=Limits)
    rule: Rule = field(default_factory=Rule)

    def reference_rows(self, record: TimeSeries) -> Sequence[int]:
        """Positions of the channels whose past is used: the references, or at most `MOST_REFERENCES` of all."""
        if self.references is not None:
            wanted = {(d.node, d.direction) for d in self.references}
            return [i for i, c in enumerate(record.channels) if (c.dof.node, c.dof.direction) in wanted]
        stated = record.positions("reference")
        return stated or (range(len(record)) if len(record) <= MOST_REFERENCES else independent_rows(record.values))

    def rows(self, record: TimeSeries) -> int:
        """Block rows: as asked, else one and a half periods of the lowest frequency; always enough for the order."""
        return self.rows_at(record.even_hz, len(self.reference_rows(record)))

    def rows_at(self, rate_hz: float, references: int) -> int:
        """Block rows for correlations of this rate with this number of references."""
        of_period = ceil(1.5 * rate_hz / self.band_hz[0])
        of_order = ceil(1.2 * self.largest_order / references)
        return max(self.block_rows or min(of_period, 40), of_order, 4)


MOST_REFERENCES = 16
"""Channels whose past is used, where none is stated as a reference: more of them take longer and tell nothing new."""


def independent_rows(values: Reals, count: int = MOST_REFERENCES) -> list[int]:
    """Positions of so many channels (s, n) that the others repeat most of what they have not: pivots of Cholesky."""
    moving = np.nan_to_num(values - np.nanmean(values, axis=1, keepdims=True))
    size = np.linalg.norm(moving, axis=1, keepdims=True)
    moving = moving / np.where(size > 0.0, size, 1.0)
    left = moving @ moving.T
    rows: list[int] = []
    for _ in range(count):
        i = int(np.argmax(np.where(np.isin(np.arange(len(left)), rows), -1.0, np.diag(left))))
        rows.append(i)
        left = left - np.outer(left[i], left[i]) / max(float(left[i, i]), np.finfo(float).tiny)
    return sorted(rows)


@dataclass(frozen=True, eq=False)
class OperationalModes:
    """Result of one method.

    Parameters
    ----------
    method : its name
    modes : real shapes of unit norm, as of one quantity also where the channels differ in it
    complex_shapes : (s, m) what these were made of, of one quantity too
    table, candidates : every pole with its order, and their clusters; empty for methods without a model order
    model : what standard deviations are from, SSI-cov only
    derivatives : (s,) of the channels, by which shapes are brought to one quantity
    """

    method: str
    modes: ModeSet
    complex_shapes: Complexes
    table: PoleTable | None = None
    candidates: tuple[Candidate, ...] = ()
    model: CovarianceModel | None = field(default=None, repr=False)
    derivatives: Reals = field(default_factory=lambda: np.zeros(0), repr=False)

    @property
    def collinearity(self) -> Reals:
        """(m,) phase collinearity of the complex shapes."""
        return np.array([phase_collinearity(s) for s in self.complex_shapes.T])

    @property
    def deviation_deg(self) -> Reals:
        """(m,) mean phase deviation of the complex shapes."""
        return np.array([mean_phase_deviation_deg(s) for s in self.complex_shapes.T])


def prepared(record: TimeSeries, asked: Operational) -> TimeSeries:
    """The responses without mean and trend, resampled to 2.5 times the end of the band or a little more.

    Raises
    ------
    FemtuneError : ``record.uneven``, ``record.lost-samples`` where samples are NaN, ``identify.record-band`` where
        the record does not reach the band, ``identify.mixed-quantities``
    """
    record = record.select_channels([*record.positions("reference"), *record.positions("response")])
    rate, high = record.even_hz, asked.band_hz[1]
    no_lost_samples(record)
    derivatives_of(record.channels)
    if not 0.0 < asked.band_hz[0] < high <= 0.5 * rate:
        values = {"band": f"{asked.band_hz[0]:g} to {high:g} Hz", "half the sampling rate": f"{0.5 * rate:g} Hz"}
        empty = asked.band_hz[0] >= high
        raise FemtuneError("identify.record-band/empty" if empty else "identify.record-band", values=values)
    values = signal.detrend(record.values, axis=1)
    factor = int(rate // (2.5 * high))
    if factor > 1:
        values = signal.decimate(values, factor, ftype="fir", axis=1)
        return replace(record, values=values, sampling_hz=rate / factor)
    return replace(record, values=values)


def by_covariances(record: TimeSeries, asked: Operational) -> OperationalModes:
    """SSI-cov, with standard deviations of frequencies, damping and shapes."""
    record = prepared(record, asked)
    model = covariance_driven(
        record.values, 1.0 / record.even_hz, asked.reference_rows(record), asked.rows(record), asked.largest_order,
        asked.pieces,
    )  # fmt: skip
    return modes_of_orders(model.observability, record.channels, asked, "SSI-cov", model)


def chosen_modes(found: OperationalModes, candidates: tuple[Candidate, ...]) -> OperationalModes:
    """The same poles with another choice among their clusters; SSI-cov with its standard deviations."""
    assert found.table is not None
    table, moved = found.table, dict[int, PoleScatter]()
    for c in candidates:
        order = int(table.order[c.at])
        if c.chosen and found.model is not None and order not in moved:
            moved[order] = scatter_of_order(found.model, order).in_one_quantity(found.derivatives)
    at = [c.at for c in candidates if c.chosen]
    names = tuple(c.name or str(i + 1) for i, c in enumerate(c for c in candidates if c.chosen))
    modes = replace(_modes(table, at, moved), labels=names)
    if moved:
        modes = _with_scatter_over_orders(modes, table, [c for c in candidates if c.chosen])
    return replace(found, modes=modes, complex_shapes=table.shapes[:, at], candidates=candidates)


def by_data(record: TimeSeries, asked: Operational) -> OperationalModes:
    """SSI-data."""
    record = prepared(record, asked)
    rows = max(ceil(asked.rows(record) / 2), ceil(asked.largest_order / len(record)) + 1)
    seen = data_driven(record.values, 1.0 / record.even_hz, asked.reference_rows(record), rows, asked.largest_order)
    return modes_of_orders(seen, record.channels, asked, "SSI-data")


def by_era(record: TimeSeries, asked: Operational) -> OperationalModes:
    """ERA on the correlation functions (NExT)."""
    record = prepared(record, asked)
    references, rows = asked.reference_rows(record), 2 * asked.rows(record)
    decays = correlations(record.values, references, 2 * rows)
    seen = era(decays, 1.0 / record.even_hz, rows, rows, asked.largest_order)
    return modes_of_orders(seen, record.channels, asked, "ERA")


def by_decomposition(record: TimeSeries, asked: Operational) -> OperationalModes:
    """FDD peaks with the frequency and damping of their bells (EFDD)."""
    record = prepared(record, asked)
    return modes_of_peaks(
        cross_spectra(record.values, record.even_hz, segment_of(record, asked)), record.channels, asked
    )


def modes_of_peaks(spectra: CrossSpectra, channels: Sequence[Channel], asked: Operational) -> OperationalModes:
    """FDD of spectra of all channels with each other."""
    found = decompose(spectra)
    bells = [enhanced(spectra, found, line) for line in peaks(found, asked.band_hz)]
    freq, ratio = np.array([b.freq_hz for b in bells]), np.array([b.damping_ratio for b in bells])
    lines = np.array([b.peak_hz for b in bells])
    return _of_lines(channels, "FDD", lines, [b.shape for b in bells], freq, ratio)


def by_steady_phases(record: TimeSeries, asked: Operational) -> OperationalModes:
    """TFIE with shapes from complex ratios; no damping."""
    return _steady(record, asked, "TFIE")


def by_steady_magnitudes(record: TimeSeries, asked: Operational) -> OperationalModes:
    """TFIE in its published form, with shapes from magnitudes; no damping."""
    return _steady(record, asked, "TFIE-magnitude")


def _steady(record: TimeSeries, asked: Operational, method: str) -> OperationalModes:
    record = prepared(record, asked)
    scatter = phase_scatter(record.values, record.even_hz, segment_of(record, asked))
    at = steady_lines(scatter, asked.band_hz)
    ratios = scatter.magnitudes if method == "TFIE-magnitude" else scatter.ratios
    modes = [mode_at(scatter, line, ratios) for line in at]
    freq = np.array([f for f, _ in modes])
    return _of_lines(record.channels, method, scatter.freq_hz[at], [s for _, s in modes], freq, None)


def segment_of(record: TimeSeries, asked: Operational) -> int:
    """Samples of a segment of spectra: a power of two where the record is long enough, eight in a record at least."""
    step = asked.resolution_hz or asked.band_hz[0] / 400.0
    wanted = 2 ** round(np.log2(record.even_hz / step))
    return int(min(wanted, 2 * (record.samples // (2 * _LEAST_SEGMENTS))))


def real_shape(shape: NDArray) -> Reals:
    """Unit norm, turned so that the imaginary part is as small as it can be, largest entry positive."""
    real = (shape * turn_to_real_axis(shape)).real
    real = real / np.linalg.norm(real)
    return np.asarray(real * (np.sign(real[np.abs(real).argmax()]) or 1.0))


def modes_of_orders(
    seen: Observability, channels: Sequence[Channel], asked: Operational, method: str,
    model: CovarianceModel | None = None,
) -> OperationalModes:  # fmt: skip
    """Modes out of the poles of all orders."""
    orders = range(2, min(asked.largest_order, seen.matrix.shape[1]) + 1, 2)
    poles_of_orders, derivatives = list(seen.poles(orders)), derivatives_of(channels)
    shapes = [in_one_quantity(p.shapes, p.poles, derivatives) for p in poles_of_orders]
    dofs = DofSet(c.dof for c in channels)
    table = table_of([p.poles for p in poles_of_orders], shapes, list(orders), method, dofs)
    candidates = choose(table, replace(asked.limits, band_hz=asked.band_hz), asked.rule)
    nothing = ModeSet(np.zeros(0), np.zeros((0, 0)), DofSet(()))
    made = OperationalModes(method, nothing, np.zeros((0, 0), complex), table, candidates, model, derivatives)
    return chosen_modes(made, candidates)


def _of_lines(
    channels: Sequence[Channel], method: str, lines_hz: Reals, shapes: Sequence[NDArray], freq: Reals,
    ratio: Reals | None,
) -> OperationalModes:  # fmt: skip
    """Modes with the complex shapes that the channels have at single lines."""
    dofs = DofSet(c.dof for c in channels)
    columns = np.asarray(np.stack(shapes, axis=1) if len(shapes) else np.zeros((len(dofs), 0)), np.complex128)
    scaled = in_one_quantity(columns, np.asarray(2j * np.pi * lines_hz, np.complex128), derivatives_of(channels))
    modes = ModeSet(
        freq, _real_shapes(scaled), dofs, damping_ratio=ratio, normalisation="unit-norm", source=method
    )  # fmt: skip
    return OperationalModes(method, modes, scaled)


def _real_shapes(shapes: Complexes) -> Reals:
    return np.stack([real_shape(s) for s in shapes.T], axis=1) if shapes.size else np.zeros(shapes.shape)


def _modes(table: PoleTable, at: Sequence[int], moved: dict[int, PoleScatter]) -> ModeSet:
    sd = [_deviations(table, i, moved) for i in at] if moved else []
    return ModeSet(
        table.freq_hz[at],
        _real_shapes(table.shapes[:, at]),
        table.dofs,
        damping_ratio=table.damping_ratio[at],
        normalisation="unit-norm",
        freq_sd_hz=np.array([s[0] for s in sd]) if sd else None,
        damping_sd=np.array([s[1] for s in sd]) if sd else None,
        shapes_sd=np.stack([s[2] for s in sd], axis=1) if sd else None,
        source=", ".join(dict.fromkeys(table.method)),
    )


def _with_scatter_over_orders(modes: ModeSet, table: PoleTable, chosen: Sequence[Candidate]) -> ModeSet:
    """Modes whose standard deviations contain the choice of the order: σ² plus the variance over the stable poles.

    All orders with the pole count alike; the variance is by the median deviation from the median, which a few low
    orders with a pole of their own do not move.

    Source: S. T. Buckland, K. P. Burnham, N. H. Augustin (1997), Model selection: an integral part of inference,
    Biometrics 53, with equal weights.
    """
    assert modes.freq_sd_hz is not None
    assert modes.damping_sd is not None
    freq, ratio = (
        np.array([_robust_deviation(values[c.members]) for c in chosen])
        for values in (table.freq_hz, table.damping_ratio)
    )
    return replace(modes, freq_sd_hz=np.hypot(modes.freq_sd_hz, freq), damping_sd=np.hypot(modes.damping_sd, ratio))


def _robust_deviation(values: Reals) -> float:
    """Standard deviation of a normal distribution with the median deviation of these values from their median."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def _deviations(table: PoleTable, i: int, moved: dict[int, PoleScatter]) -> tuple[float, float, Reals]:
    scatter = moved[int(table.order[i])]
    j = int(np.argmin(np.abs(scatter.found.poles - table.poles[i])))
    return float(scatter.freq_sd_hz[j]), float(scatter.damping_sd[j]), scatter.shapes_sd[:, j]
