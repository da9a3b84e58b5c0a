"""Identification with known input: from measured FRFs, or from records that include the forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from femtune.dofs import DofSet
from femtune.errors import FemtuneError, Notice, with_notices
from femtune.files.described_test import read_described
from femtune.identification.averaging import Averaging, input_output_spectra, no_lost_samples
from femtune.identification.estimators import KIND_OF, estimate_frfs
from femtune.identification.hammer import (
    DECAYED,
    LEAST_HITS,
    hits_of,
    is_impulsive,
    samples_before,
    still_moving,
    without_hits,
)
from femtune.identification.input_known import InputKnown, NoModesChosen, identify_frfs
from femtune.identification.join import at_lines
from femtune.identification.kinds import KNOWN_INPUT
from femtune.identification.late_forces import late_force_notices
from femtune.identification.mode_checks import ModeRemark
from femtune.identification.periodic import periodic_frfs
from femtune.identification.record_checks import dead_channels
from femtune.identification.shapes import leading_shapes
from femtune.identification.whole_record import binned, in_bins, whole_record
from femtune.modal import ModeSet
from femtune.steps.identify.choices import picked_poles
from femtune.steps.identify.identified import Curve, Found, singular_levels
from femtune.steps.identify.result import NothingFound
from femtune.testdata import NO_GEOMETRY
from femtune.testdata.checks import phase_collinearity

if TYPE_CHECKING:
    from femtune.files.identification_file import IdentifyFile
    from femtune.identification.input_known import IdentifiedModes
    from femtune.identification.whole_record import WholeRecord
    from femtune.modal import FrfSet, TimeSeries
    from femtune.testdata import WireFrame

DEFAULT_ORDER = 60
"""Largest order of the models if the request gives none.

Each mode needs an order of two, and noise needs several times as much; higher orders take longer.
"""

LINES_TO = 2.56
"""Sampling rate over the highest line of functions that come without their record."""


def found_from_file(file: IdentifyFile) -> Found:
    """Modes of measured functions.

    Raises
    ------
    FemtuneError : ``uff.*``, ``frf.layout``, ``identify.no-frfs`` for a file without functions of motion over force,
        ``identify.*``
    """
    described = read_described(file)
    usable = np.isfinite(described.frfs.values).any(axis=(0, 1)) & (described.frfs.freq_hz > 0.0)
    frfs = described.frfs if usable.all() else at_lines(described.frfs, np.flatnonzero(usable))
    found = found_from_frfs(frfs, file, described.geometry)
    return replace(found, notices=(*described.notices, *found.notices))


def found_from_frfs(
    frfs: FrfSet,
    file: IdentifyFile,
    geometry: WireFrame = NO_GEOMETRY,
    sd: NDArray[np.float64] | None = None,
    whole: WholeRecord | None = None,
    step_s: float | None = None,
) -> Found:
    """Modes of functions, with every pole, the fit and the state-space model.

    Parameters
    ----------
    sd : of the functions, or None
    whole : the record of which these are the functions, where its lines are to be fitted
    step_s : between two samples of the record from which these are, or None
    """
    table = file.identify
    methods = tuple(m for m in table.methods or KNOWN_INPUT if m in KNOWN_INPUT)
    asked = InputKnown(
        table.band_hz, table.largest_order or _order(frfs, table.band_hz), methods, take=table.take_hz,
        drop=table.drop_hz, picked=picked_poles(file), real=table.real, exponential_s=table.exponential_s,
        suspension_hz=table.suspension_hz or 0.0, raised=table.largest_order is None and whole is None,
    )  # fmt: skip
    decay = 0.0 if table.exponential_s is None else 1.0 / table.exponential_s
    try:
        made = identify_frfs(frfs, asked, sd, whole)
    except NoModesChosen as chosen_none:
        measured = chosen_none.measured
        nothing = ModeSet(np.zeros(0), np.zeros((len(measured.responses), 0)), measured.responses)
        found = Found(
            nothing, np.zeros(0), chosen_none.table, chosen_none.candidates, {}, _curve(measured), measured=measured,
            geometry=geometry, decay=decay,
        )  # fmt: skip
        raise NothingFound(chosen_none, found) from chosen_none
    measured, synthesised = made.fit.measured, made.fit.synthesised
    error = np.linalg.norm(synthesised.values - measured.values, axis=2)
    size = np.linalg.norm(measured.values, axis=2)
    forces = frfs.references.labels()
    late = late_force_notices(
        made.fit, forces, step_s or 1.0 / (LINES_TO * float(frfs.freq_hz[-1])), counted=step_s is not None
    )
    collinearity = np.array([phase_collinearity(shape) for shape in leading_shapes(made.fit_of_shapes).T])
    return Found(
        made.modes, collinearity, made.table, made.candidates, _by_method(made), _curve(measured),
        measured=measured,
        synthesised=synthesised, misfit_percent=100.0 * error / np.where(size > 0.0, size, 1.0), system=made.system,
        notices=(*made.notices, *late), remarks=made.remarks, geometry=geometry,
        measured_sd=None if sd is None else sd[:, :, np.isin(frfs.freq_hz, measured.freq_hz)],
        of_whole_record=whole is not None and whole.width > 0, decay=decay,
    )  # fmt: skip


def _order(frfs: FrfSet, band_hz: tuple[float, float] | None) -> int:
    """The largest order: `DEFAULT_ORDER`, or half the number of lines where these are fewer than the order."""
    low, high = band_hz or (0.0, np.inf)
    lines = int(np.sum((frfs.freq_hz >= low) & (frfs.freq_hz <= high)))
    return DEFAULT_ORDER if lines > DEFAULT_ORDER else max(4, 2 * (lines // 4))


def _by_method(made: IdentifiedModes) -> dict[str, NDArray[np.float64]]:
    """Median of each method's own poles in the cluster of every mode; two modes do not have the same one.

    Of modes that have one cluster, that with the most certain frequency has its poles.
    """
    names = np.array(made.table.method)
    clusters = [made.candidates[i] for i in made.clusters]
    sd = np.zeros(len(made.modes)) if made.modes.freq_sd_hz is None else made.modes.freq_sd_hz
    out = {}
    for name in dict.fromkeys(made.table.method):
        members = [c.members[names[c.members] == name] for c in clusters]
        middle = np.array([float(np.median(made.table.freq_hz[i])) if len(i) else float("nan") for i in members])
        shared = [[j for j, f in enumerate(middle) if f == own] for own in middle]
        surest = [not same or i == min(same, key=sd.__getitem__) for i, same in enumerate(shared)]
        out[name] = np.where(surest, middle, np.nan)
    return out


def _curve(frfs: FrfSet) -> Curve:
    size = np.sqrt((np.abs(frfs.values) ** 2).sum(axis=(0, 1)))
    largest = 20.0 * np.log10(max(float(size.max()), 1e-300))
    level = 20.0 * np.log10(np.maximum(size, 1e-300)) - largest
    singular = singular_levels(frfs.values.transpose(2, 0, 1)) - largest
    return Curve(frfs.freq_hz, level, "all functions together", singular)


_OF_BLOCKS = ("identify.hits", "identify.one-hit", "identify.hits-not-decayed")
"""Notices of the functions of blocks, which are not shown where the whole record is fitted."""
LARGEST_DECAY = 0.5
"""Part of the relative standard deviation of a damping ratio that the decay before a hit may have without a doubt."""
DEFAULT_LINES = 400
"""Lines of a band if no resolution is requested, as far as the record allows with eight segments.

More lines resolve close modes better; fewer leave more segments, whose average has less noise.
"""


PERIOD_TOLERANCE = 1e-3
"""Largest deviation of a period from a whole number of samples, in samples: periods are written with few digits."""


def has_forces(record: TimeSeries) -> bool:
    """True where every input is a force: the ground's motion is no force."""
    quantities = {record.channels[i].quantity for i in record.positions("input")}
    return quantities == {"force"}


def found_from_forces(records: Sequence[TimeSeries], file: IdentifyFile) -> Found:
    """Modes of the functions that the record gives, weighted by their standard deviations; without dead responses.

    Raises
    ------
    FemtuneError : ``identify.*``, ``record.*``
    """
    if len({len(record) for record in records}) > 1:
        counts = ", ".join(str(len(record)) for record in records[:5])
        raise FemtuneError("identify.records-differ", values={"channels of each record": counts})
    dead = np.all([dead_channels(record) for record in records], axis=0)
    alive = [i for i, c in enumerate(records[0].channels) if c.role == "input" or not dead[i]]
    living = [record.select_channels(alive) for record in records]
    whole, hits = _whole(living, file), is_impulsive(living[0]) if len(living[0].positions("input")) == 1 else False
    if whole is not None and not hits:
        whole = in_bins(whole, FUNCTION_LINES)
        frfs, sd = binned(whole)
        return found_from_frfs(frfs, file, sd=sd, whole=whole, step_s=1.0 / living[0].even_hz)
    frfs, sd, notices = functions_of(living, file)
    if whole is not None and whole.pulse is not None:
        # too few hits for a scatter: the functions are those of the whole record, whose fit knows what its end cuts off
        whole = in_bins(whole, FUNCTION_LINES)
        (said,) = [n for n in notices if n.code == "identify.hits"]
        notices = tuple(n for n in notices if n.code not in _OF_BLOCKS)
        notices += (Notice("identify.hits/whole", level="info", count=said.facts["count"]),)
    usable = np.isfinite(frfs.values).all(axis=(0, 1)) & (frfs.freq_hz > 0.0)
    kept = np.flatnonzero(usable)
    errors = sd[:, :, kept]
    known = np.isfinite(errors).all() and (errors > 0.0).all()
    with with_notices(notices):
        step_s = 1.0 / living[0].even_hz
        found = found_from_frfs(at_lines(frfs, kept), file, sd=errors if known else None, whole=whole, step_s=step_s)
    unsound = _unsound_hits(found, living, notices, in_motion=whole is None and not known)
    return replace(
        found,
        notices=(*notices, *found.notices, *dict.fromkeys(r.notice for r in unsound)),
        remarks=(*found.remarks, *unsound),
    )


def _unsound_hits(
    found: Found, records: Sequence[TimeSeries], notices: Sequence[Notice], in_motion: bool
) -> tuple[ModeRemark, ...]:
    """``identify.unsound-hits`` of the modes whose standard deviations miss an error of the hits that are used.

    A hit without the decay of the one before it moves a pole by about that decay, relative to the bandwidth. It counts
    where that is more than a part of the standard deviation.

    Parameters
    ----------
    notices : of the hits
    in_motion : whether the decay after a hit that is left out is part of the functions of the next one
    """
    modes, reasons = found.modes, [str(n.facts["reason"]) for n in notices if n.code == "identify.hit-overloaded"]
    reasons += [str(n.facts["reasons"]) for n in notices if n.code == "identify.hits-doubtful"]
    if reasons:
        doubt = Notice("identify.unsound-hits", reasons=", ".join(dict.fromkeys(reasons)))
        return tuple(ModeRemark(i, doubt) for i in range(len(modes)))
    left_out = hits_of(records).left_out if in_motion else ()
    if not left_out or modes.damping_ratio is None or modes.damping_sd is None:
        return ()
    pause_s = min(end - begin for begin, end in left_out) / records[0].even_hz
    decay = np.exp(-2.0 * np.pi * modes.freq_hz * modes.damping_ratio * pause_s)
    doubt = Notice("identify.unsound-hits", reasons="decay after a hit that is left out")
    far = decay > LARGEST_DECAY * modes.damping_sd / np.abs(modes.damping_ratio)
    return tuple(ModeRemark(int(i), doubt) for i in np.flatnonzero(far))


def _whole(records: Sequence[TimeSeries], file: IdentifyFile) -> WholeRecord | None:
    """The lines of a record with one force, where nothing else was asked for.

    Hits that are left out are cut from it; with other hits that are not sound there is none. What follows a single hit
    cannot be told from motion before it, since both are free decays: a record with few hits must begin at rest, or
    one of its pieces must have a second hit.
    """
    table, record = file.identify, records[0]
    asked = (table.period_s, table.resolution_hz, table.exponential_s, table.force_window_s)
    responses = [record.channels[i] for i in record.positions("response") + record.positions("reference")]
    quantities = {c.quantity for c in responses}
    if len(records) > 1 or any(one is not None for one in asked) or table.estimator != "H1" or len(quantities) != 1:
        return None
    if len(record.positions("input")) != 1 or np.isnan(record.values).any():
        return None
    kind = KIND_OF.get(quantities.pop())
    if kind is None:
        return None
    low, high = table.band_hz or (0.0, 0.5 * record.even_hz)
    if not is_impulsive(record):
        return whole_record(record, kind, low, high)
    hits = hits_of(records)
    if hits.doubtful:
        return None
    record, begins = without_hits(record, hits.left_out)
    if len(begins) == 1 and len(hits.blocks) < LEAST_HITS:
        from_rest = whole_record(record, kind, low, high, samples_before(record))
        if from_rest is not None:
            return from_rest
    return whole_record(record, kind, low, high, begins=begins) if len(hits.blocks) > len(begins) else None


def functions_of(
    records: Sequence[TimeSeries], file: IdentifyFile
) -> tuple[FrfSet, NDArray[np.float64], tuple[Notice, ...]]:
    """The functions, √E|error|² of each, (n, u, k), and what a user should know of their making."""
    table, record = file.identify, records[0]
    if table.period_s is not None:
        periodic = periodic_frfs(records, _period(record, file))
        return periodic.frfs, periodic.sd, ()
    if len(record.positions("input")) == 1 and all(map(is_impulsive, records)):
        return _functions_of_hits(records, file)
    asked = [key for key in ("exponential_s", "force_window_s") if getattr(table, key) is not None]
    if asked:
        raise FemtuneError("identify.no-hits", where=file.where("identify", asked[0]), key=asked[0])
    averaging = Averaging(min(_segment(one, file) for one in records))
    estimates = [estimate_frfs(input_output_spectra(some, averaging), table.estimator) for some in _by_forces(records)]
    frfs = _together([one.frfs for one in estimates])
    return replace(frfs, source=record.source), np.concatenate([one.sd for one in estimates], axis=1), ()


FUNCTION_LINES = 2000
"""Functions of a whole record in a band at most, by which poles are found; the fit has all of its lines."""
MOST_LINES = 4000
"""Lines of a band that a block of a hit may have: longer blocks are cut, since the response has decayed long before."""


def _functions_of_hits(
    records: Sequence[TimeSeries], file: IdentifyFile
) -> tuple[FrfSet, NDArray[np.float64], tuple[Notice, ...]]:
    """Functions over the hits of a hammer; standard deviations come from the scatter over three hits or more."""
    table, rate = file.identify, records[0].even_hz
    for record in records:
        no_lost_samples(record)
    wanted = None if table.resolution_hz is None else round(rate / table.resolution_hz)
    force_window = None if table.force_window_s is None else max(1, round(table.force_window_s * rate))
    hits = hits_of(records, wanted, force_window)
    low, high = table.band_hz or (0.0, 0.5 * rate)
    block = min(hits.blocks[0].samples, max(int(MOST_LINES * rate / (high - low)), 4))
    blocks = [one.select_samples(0, block) for one in hits.blocks]
    averaging = Averaging(block, 0.0, "boxcar", table.exponential_s)
    points = _by_forces(blocks)
    estimates = [estimate_frfs(input_output_spectra(some, averaging), table.estimator) for some in points]
    counts, notices = [len(some) for some in points], list(hits.notices)
    notices.append(Notice("identify.hits", level="info", count=len(blocks), seconds=block / rate, step=rate / block))
    if max(counts) == 1:
        notices.append(Notice("identify.one-hit", level="info"))
    moving = still_moving(blocks, records)
    if moving > DECAYED and table.exponential_s is None:
        notices.append(Notice("identify.hits-not-decayed", part=moving, seconds=block / rate))
    frfs = replace(_together([one.frfs for one in estimates]), source=records[0].source)
    if min(counts) == 1:
        frfs = replace(frfs, coherence=None)
    sd = np.concatenate([one.sd for one in estimates], axis=1)
    if min(counts) < LEAST_HITS:
        return frfs, np.full(sd.shape, np.nan), tuple(notices)
    # few hits give the noise of one line with a large error, that of its neighbourhood with a small one
    width = 2 * int(np.ceil(LEAST_FREEDOM / (min(counts) - 1) / 2.0)) + 1
    variance = np.where(np.isfinite(sd), sd, 0.0) ** 2
    smooth = np.sqrt(uniform_filter1d(variance, min(width, variance.shape[2]), axis=2, mode="nearest"))
    return frfs, smooth, tuple(notices)


def _by_forces(records: Sequence[TimeSeries]) -> list[list[TimeSeries]]:
    """The records of each point where the force was, in the order in which it was there: a hammer may rove."""
    points: dict[tuple[str, ...], list[TimeSeries]] = {}
    for record in records:
        points.setdefault(tuple(record.dofs("input").labels()), []).append(record)
    return list(points.values())


def _together(several: Sequence[FrfSet]) -> FrfSet:
    """Functions of the same responses and lines to one or more forces each.

    Raises
    ------
    FemtuneError : ``identify.records-differ`` for other responses or lines
    """
    first = several[0]
    if len(several) == 1:
        return first
    same = (first.responses.labels(), first.kind, first.freq_hz.tolist())
    if any((one.responses.labels(), one.kind, one.freq_hz.tolist()) != same for one in several):
        names = "; ".join(", ".join(one.responses.labels()[:5]) for one in several[:3])
        raise FemtuneError("identify.records-differ", values={"responses of the records": names})
    coherence = None
    if all(one.coherence is not None for one in several):
        coherence = np.concatenate([one.coherence for one in several if one.coherence is not None], axis=1)
    references = DofSet([dof for one in several for dof in one.references])
    values = np.concatenate([one.values for one in several], axis=1)
    return replace(first, values=values, references=references, coherence=coherence)


LEAST_FREEDOM = 30
"""Degrees of freedom of a variance of the noise, over hits and neighbouring lines."""


def _period(record: TimeSeries, file: IdentifyFile) -> int:
    """Samples of the period that is stated, which must be whole: a fraction would leak into every line."""
    period_s = file.identify.period_s or 0.0
    samples = period_s * record.even_hz
    if abs(samples - round(samples)) > PERIOD_TOLERANCE:
        raise FemtuneError(
            "identify.period",
            where=file.where("identify", "period_s"),
            values={"period_s": period_s, "sampling rate": f"{record.even_hz:g} Hz", "samples": f"{samples:.6g}"},
        )
    return round(samples)


def _segment(record: TimeSeries, file: IdentifyFile) -> int:
    """Samples of a segment: by the resolution, or so that the band has `DEFAULT_LINES` lines; an even number."""
    table = file.identify
    low, high = table.band_hz or (0.0, 0.5 * record.even_hz)
    step = table.resolution_hz or (high - low) / DEFAULT_LINES
    wanted = 2 * round(0.5 * record.even_hz / step)
    most = 2 * (record.samples // 16)
    if table.resolution_hz is not None and wanted > record.samples:
        raise FemtuneError(
            "identify.resolution",
            where=file.where("identify", "resolution_hz"),
            values={"segment": f"{wanted / record.even_hz:g} s", "record": f"{record.duration_s:g} s"},
            step=step,
        )
    return wanted if table.resolution_hz is not None else min(wanted, most)
