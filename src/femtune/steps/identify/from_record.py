"""Identification with unknown input: from records of responses, with or without the ground motion."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from femtune.dofs import parse_dof
from femtune.errors import FemtuneError, Notice
from femtune.files.records import ChannelColumn
from femtune.files.records.headings import stated_channel
from femtune.files.records.read import read_record_and_clock
from femtune.identification.averaging import cross_spectra, no_lost_samples
from femtune.identification.choice import CHOSEN_BY_USER, PickedPole, change_choice, has_candidate, pick_poles
from femtune.identification.combine import Estimate, combine
from femtune.identification.harmonics import Line, Removed, find_lines, multiples, without_lines
from femtune.identification.in_place import ON_SUSPENSION
from femtune.identification.input_lines import judge_peaks
from femtune.identification.kinds import OUTPUT_ONLY
from femtune.identification.late_channels import late_notices
from femtune.identification.mode_checks import (
    ModeRemark,
    collinearity_remarks,
    damping_remarks,
    quadrature_notices,
)
from femtune.identification.operational import (
    Operational,
    chosen_modes,
    prepared,
    segment_of,
)
from femtune.identification.record_checks import dead_channels, level_ratios
from femtune.identification.refined import refined
from femtune.identification.ssi import supported_order
from femtune.identification.unnamed_force import steady_force
from femtune.modal.shape_criteria import mac
from femtune.steps.identify.choices import picked_poles
from femtune.steps.identify.identified import MOST_SINGULAR, Curve, Found
from femtune.steps.identify.request import check_length
from femtune.steps.identify.result import NothingFound
from femtune.units import unit_system

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from femtune.files.identification_file import ChannelEntry, IdentifyFile
    from femtune.identification.operational import (
        OperationalModes,
    )
    from femtune.modal import Channel, ModeSet, TimeSeries
    from femtune.study.progress import Progress

DEFAULT_ORDER = 60
"""Largest order of the models if the request gives none.

Each mode needs an order of two, and noise needs several times as much; higher orders take longer.
"""
DEFAULT_METHODS = ("SSI-cov", "ERA", "FDD")
"""Methods if the request gives none: two parametric ones, and one in the frequency domain that makes other errors."""
_MOST_LISTED = 5
"""Frequencies of further modes that a notice lists, so that it stays one sentence."""
FREQUENCY_TOLERANCE = 0.02
"""Relative difference of frequencies up to which modes of two methods can be the same one.

It must cover the scatter between methods, and stay below the distance of neighbouring modes.
"""
LEAST_MAC = 0.8
"""MAC from which modes of two methods can be the same one.

Noise lowers the MAC of one mode by two methods; the MAC of different modes is mostly far lower.
"""


def read_asked(file: IdentifyFile) -> list[tuple[TimeSeries, tuple[Notice, ...]]]:
    """The records with their channels, each with what its reader and the headings of its columns tell.

    Raises
    ------
    FemtuneError : ``record.*``, ``dof.duplicate``
    """
    table = file.identify
    columns = [_column(entry) for entry in file.channel]
    units = unit_system(table.units)
    read = [
        read_record_and_clock(path, columns, table.sampling_hz, table.variable, table.format, units)
        for path in file.measured_paths
    ]
    return [
        (one.record, (_clock_notice(one.record, one.rate_from), *one.notices, *_of_headings(one.record, file)))
        for one in read
    ]


def _clock_notice(record: TimeSeries, rate_from: str) -> Notice:
    """``record.clock``: rate, duration and number of samples; of uneven times, the rate of the usual step."""
    rate = record.sampling_hz
    if rate is None:
        rate = 1.0 / float(np.median(np.diff(record.time_s)))
    seconds = record.samples / rate if record.sampling_hz is not None else record.duration_s
    return Notice(
        "record.clock", level="info", rate=float(rate), source=rate_from, seconds=seconds, samples=record.samples
    )


def _of_headings(record: TimeSeries, file: IdentifyFile) -> Iterable[Notice]:
    """``record.headings`` where the headings of a table say which column is a force, and not [[channel]]."""
    forces = [c for c in record.channels if c.role == "input"]
    if file.channel or not any(c.name for c in forces):
        return
    others = {c.quantity for c in record.channels if c.role != "input"}
    responses, quantities = ", ".join(record.dofs("response").labels()[:5]), ", ".join(sorted(others))
    names = ", ".join(f"'{c}'" for c in forces)
    level = "warning" if any(map(_is_assumed, record.channels)) else "info"
    yield Notice("record.headings", level=level, forces=names, responses=responses, quantities=quantities)


def _is_assumed(channel: Channel) -> bool:
    """Whether the quantity of a channel is not a motion or force that its heading or its unit states."""
    if channel.quantity not in _MOTIONS_AND_FORCE:
        return True
    return not channel.unit and stated_channel(channel.name).quantity != channel.quantity


_MOTIONS_AND_FORCE = ("acceleration", "velocity", "displacement", "force")


def _column(entry: ChannelEntry) -> ChannelColumn:
    return ChannelColumn(entry.column, parse_dof(entry.dof), entry.quantity, entry.role, entry.unit, entry.factor)


def found_from_record(parts: Sequence[TimeSeries], file: IdentifyFile, progress: Progress) -> Found:
    """Modes of a record by every method that is requested; those of the first one, or means over fragments.

    Parameters
    ----------
    parts : the record, or its parts between gaps, which are its fragments then

    Raises
    ------
    FemtuneError : ``identify.*``, ``record.uneven``
    """
    table = file.identify
    _check_parts(parts, file)
    record = max(parts, key=lambda part: part.samples)
    asked = _asked(record, file)
    names = [m for m in table.methods or DEFAULT_METHODS if m in OUTPUT_ONLY]
    check_length(record, asked, file)
    levels = level_ratios(record)
    record, removed, gone = subtracted(record, file)
    measured, record = record, replace(record, values=record.values / levels[:, None])
    pieces, short = _pieces(parts, record, levels, asked, file)
    several: dict[tuple[str, int], OperationalModes] = {}
    for i, piece in enumerate(pieces):
        for j, name in enumerate(names):
            progress.step(f"{name}, fragment {i + 1}", i * len(names) + j, len(pieces) * len(names))
            several[name, i] = chosen_by_hand(OUTPUT_ONLY[name].load()(piece, asked), file)
    if picked := picked_poles(file):
        several[names[0], 0] = with_picked(several[names[0], 0], picked)
    check_choice([several[names[0], i] for i in range(len(pieces))], file)
    ready = prepared(record, asked)
    lines = find_lines(ready, asked.band_hz, [float(f) for one in several.values() for f in one.modes.freq_hz])
    several = {key: _without_harmonics(one, lines, ready, asked, table.take_hz) for key, one in several.items()}
    curve = _curve(ready, asked)
    by_likelihood: tuple[Notice, ...] = ()
    if len(pieces) == 1:
        several[names[0], 0], by_likelihood = _refined(several[names[0], 0], ready, lines, gone, asked)
    try:
        single = len(pieces) == 1
        identified = of_first_method(names, several, table.drop_hz) if single else _means(several, pieces, record)
    except FemtuneError as error:
        first = several[names[0], 0]
        found = Found(first.modes, first.collinearity, first.table, first.candidates, {}, curve, lines=lines)
        raise NothingFound(error, found) from error
    labels = identified.modes.dofs.labels()
    force, step_s = steady_force(measured, ~dead_channels(measured)), 1.0 / measured.even_hz
    phases = next((n for one in several.values() if (n := _phase_notices(one, labels, step_s, force))), ())
    identified = _unscaled(_judged(identified, measured), measured, levels)
    stated = _order_notices(several, asked) if len(pieces) == 1 else ()
    notices = (*short, *removed, *line_notices(lines), *phases, *stated, *by_likelihood, *identified.notices)
    return _beside_lines(replace(identified, curve=curve, notices=notices), lines)


def _check_parts(parts: Sequence[TimeSeries], file: IdentifyFile) -> None:
    """Parts are fragments already, and poles are picked in one record."""
    other = "fragments" if file.identify.fragments > 1 else "choices" if file.identify.choices else None
    if len(parts) > 1 and other is not None:
        raise FemtuneError("identify.gaps/with-others", where=file.where("identify", "gaps"), other=other)


def _pieces(
    parts: Sequence[TimeSeries], record: TimeSeries, levels: NDArray[np.float64], asked: Operational, file: IdentifyFile
) -> tuple[list[TimeSeries], tuple[Notice, ...]]:
    """The fragments: equal pieces of the record, or its parts as far as they are long enough for the methods."""
    if len(parts) == 1:
        length = record.samples // file.identify.fragments
        return [record.select_samples(i * length, (i + 1) * length) for i in range(file.identify.fragments)], ()
    enough = [part for part in parts if _is_long(part, asked, file)]
    short = len(parts) - len(enough)
    told = (Notice("identify.gaps/short-parts", short=short, parts=len(parts)),) if short else ()
    clean = [subtracted(part, file)[0] for part in enough]
    return [replace(part, values=part.values / levels[:, None]) for part in clean], told


def _is_long(part: TimeSeries, asked: Operational, file: IdentifyFile) -> bool:
    try:
        check_length(part, asked, file)
    except FemtuneError as error:
        if error.code not in ("identify.short-record", "identify.band"):
            raise
        return False
    return True


def _refined(
    found: OperationalModes, ready: TimeSeries, lines: tuple[Line, ...], gone: tuple[Removed, ...], asked: Operational
) -> tuple[OperationalModes, tuple[Notice, ...]]:
    """The modes of a method with poles by maximum likelihood, and for which of them that was possible."""
    after = refined(found, ready, lines, asked, gone)
    count = len(after.modes.modes)
    if found.table is None or not count:
        return found, ()
    others = ", ".join(f"{hz:.4g}" for i, hz in enumerate(after.modes.modes.freq_hz) if i not in after.positions)
    done = len(after.positions)
    if not done:
        told = [Notice("identify.likelihood/none", level="info", refined=done, count=count)]
    elif others:
        told = [Notice("identify.likelihood/partly", level="info", refined=done, count=count, others=others)]
    else:
        told = [Notice("identify.likelihood", level="info", refined=done, count=count)]
    if after.divided:
        hz = ", ".join(f"{f:.4g}" for f in after.divided)
        told.append(Notice("identify.likelihood/divided", level="info", frequencies=hz))
    return after.modes, tuple(told)


def _curve(ready: TimeSeries, asked: Operational) -> Curve:
    spectra = cross_spectra(ready.values, ready.even_hz, segment_of(ready, asked))
    inside = (spectra.freq_hz >= asked.band_hz[0]) & (spectra.freq_hz <= asked.band_hz[1])
    # those of a positive matrix are its eigenvalues
    values = np.maximum(np.linalg.eigvalsh(spectra.values[inside])[:, ::-1], 1e-300)
    levels = 10.0 * np.log10(values[:, :MOST_SINGULAR].T / values.max())
    power = values.sum(axis=1)
    words = "first singular value of the spectra"
    return Curve(spectra.freq_hz[inside], levels[0], words, levels, power / power.max())


def _phase_notices(found: OperationalModes, labels: list[str], step_s: float, force: int | None) -> tuple[Notice, ...]:
    """Channels that are late, else those in quadrature; not one that looks like a force, which has other phases."""
    rows = [i for i in range(len(labels)) if i != force]
    shapes, names = found.complex_shapes[rows], [labels[i] for i in rows]
    late = late_notices(shapes, found.modes.freq_hz, names, step_s, counted=True)
    return late or quadrature_notices(shapes, names)


def _order_notices(several: dict[tuple[str, int], OperationalModes], asked: Operational) -> tuple[Notice, ...]:
    """How many states the correlations hold by their scatter, where SSI-cov has found it."""
    model = next((one.model for one in several.values() if one.model is not None), None)
    if model is None:
        return ()
    order = supported_order(model)
    if order is None:
        return (Notice("identify.order/larger", level="info", largest=asked.largest_order),)
    return (Notice("identify.order", level="info", order=order, largest=asked.largest_order),)


def subtracted(record: TimeSeries, file: IdentifyFile) -> tuple[TimeSeries, tuple[Notice, ...], tuple[Removed, ...]]:
    """The record without the lines that the request names, and what was subtracted."""
    if not file.identify.remove_hz:
        return record, (), ()
    no_lost_samples(record)
    try:
        record, removed = without_lines(record, file.identify.remove_hz)
    except FemtuneError as error:
        error.where = file.where("identify", "remove_hz")
        raise
    said = ", ".join(f"{line.freq_hz:.5g} Hz ({line.share:.2g} of the power)" for line in removed)
    return record, (Notice("identify.removed-lines", level="info", lines=said),), removed


def _is_line(freq: float, ratio: float | None, line: Line, step_hz: float) -> bool:
    """Whether a pole is that of a line: it is nearer than its bandwidth, and its own bandwidth is not larger."""
    width = max(line.width_hz, step_hz)
    narrow = ratio is None or not np.isfinite(ratio) or ratio * freq <= width
    return narrow and abs(freq - line.freq_hz) <= width


def _without_harmonics(
    found: OperationalModes, lines: tuple[Line, ...], record: TimeSeries, asked: Operational, taken: tuple[float, ...]
) -> OperationalModes:
    """The modes of a method without the lines of machines, except those that the user takes."""
    # the resolution of spectra limits only the methods that use them
    step = 0.0 if found.table is not None else 2.0 * record.even_hz / segment_of(record, asked)
    if found.table is not None:
        candidates = tuple(
            replace(c, chosen=False, reason=f"harmonic at {at.freq_hz:.4g} Hz")
            if c.chosen
            and c.reason != CHOSEN_BY_USER
            and (at := next((e for e in lines if _is_line(c.freq_hz, c.damping_ratio, e, step)), None))
            else c
            for c in found.candidates
        )
        return found if candidates == found.candidates else chosen_modes(found, candidates)
    ratios = found.modes.damping_ratio
    keep = [
        i
        for i, f in enumerate(found.modes.freq_hz.tolist())
        if any(abs(f - t) <= 0.01 * t for t in taken)
        or not any(_is_line(f, None if ratios is None else float(ratios[i]), line, step) for line in lines)
    ]
    return replace(found, modes=found.modes.select_modes(keep), complex_shapes=found.complex_shapes[:, keep])


def line_notices(lines: tuple[Line, ...]) -> tuple[Notice, ...]:
    if not lines:
        return ()
    ratios = multiples(lines)
    said = "; ".join(
        f"{line.freq_hz:.5g} Hz (kurtosis {line.kurtosis:.2f}, {100.0 * line.share:.2g} % of the power"
        f"{', ' + ratios[i] if ratios[i] else ''})"
        for i, line in enumerate(lines)
    )
    hz = ", ".join(f"{line.freq_hz:.5g}" for line in lines)
    return (Notice("identify.harmonic", lines=said, remove=hz),)


def _beside_lines(identified: Found, lines: tuple[Line, ...]) -> Found:
    """With the lines, and a remark on modes within whose half-power bandwidth one of them is."""
    modes = identified.modes
    ratios = np.zeros(len(modes)) if modes.damping_ratio is None else np.nan_to_num(modes.damping_ratio)
    remarks = tuple(
        ModeRemark(i, Notice("identify.harmonic/in-bandwidth", frequency_hz=float(f), line_hz=line.freq_hz))
        for i, (f, ratio) in enumerate(zip(modes.freq_hz, ratios))
        for line in lines
        if abs(line.freq_hz - f) <= max(ratio * f, line.width_hz)
    )
    notices = (*identified.notices, *(r.notice for r in remarks))
    return replace(identified, lines=lines, remarks=(*identified.remarks, *remarks), notices=notices)


def _unscaled(identified: Found, record: TimeSeries, levels: NDArray[np.float64]) -> Found:
    """Shapes of the channels as they were measured, of those that were divided by their levels."""
    if (levels == 1.0).all():
        return identified
    of_channel = {c.dof: level for c, level in zip(record.channels, levels) if c.role != "input"}
    factors = np.array([of_channel[dof] for dof in identified.modes.dofs])[:, None]
    modes, table = identified.modes, identified.table
    sd = None if modes.shapes_sd is None else factors * modes.shapes_sd
    modes = replace(modes, shapes=factors * modes.shapes, shapes_sd=sd, normalisation="unknown")
    return replace(identified, modes=modes, table=table and replace(table, shapes=factors * table.shapes))


def _asked(record: TimeSeries, file: IdentifyFile) -> Operational:
    table = file.identify
    if table.band_hz is None:
        half = 0.5 * record.even_hz
        raise FemtuneError(
            "identify.no-band",
            where=file.where("identify"),
            values={"half the sampling rate": f"{half:g} Hz", "length": f"{record.duration_s:g} s"},
        )
    # a line at zero belongs to no mode; a record of ten samples is told so before its band is raised
    low = max(table.band_hz[0], min(2.0 / record.duration_s, 0.5 * table.band_hz[1]))
    return Operational((low, table.band_hz[1]), table.largest_order or DEFAULT_ORDER)


def chosen_by_hand(operational: OperationalModes, file: IdentifyFile) -> OperationalModes:
    """The choice of the file, as far as this method has such clusters in this fragment."""
    take, drop = (
        tuple(f for f in asked if has_candidate(operational.candidates, f))
        for asked in (file.identify.take_hz, file.identify.drop_hz)
    )
    if take or drop:
        operational = chosen_modes(operational, change_choice(operational.candidates, take, drop))
    return _without_suspension(operational, file.identify.suspension_hz or 0.0)


def _without_suspension(found: OperationalModes, highest_hz: float) -> OperationalModes:
    """Without the modes of the rigid body on its suspension, which are below a frequency."""
    if found.table is None:
        keep = np.flatnonzero(found.modes.freq_hz >= highest_hz)
        return replace(found, modes=found.modes.select_modes(keep), complex_shapes=found.complex_shapes[:, keep])
    candidates = tuple(
        replace(c, chosen=False, reason=ON_SUSPENSION) if c.chosen and c.freq_hz < highest_hz else c
        for c in found.candidates
    )
    changed = any(a is not b for a, b in zip(candidates, found.candidates))
    return chosen_modes(found, candidates) if changed else found


def with_picked(found: OperationalModes, picked: tuple[PickedPole, ...]) -> OperationalModes:
    """The picked poles of the first method as its modes (errors ``identify.choices``)."""
    others = sorted({one.method for one in picked if one.method != found.method})
    if others or found.table is None:
        raise FemtuneError("identify.choices/method", method=found.method, others=", ".join(others) or found.method)
    return chosen_modes(found, pick_poles(found.candidates, found.table, picked))


def check_choice(first: list[OperationalModes], file: IdentifyFile) -> None:
    """What is taken or dropped by hand is a cluster of the first method, in one fragment at least."""
    for key, asked in (("take_hz", file.identify.take_hz), ("drop_hz", file.identify.drop_hz)):
        for freq in asked:
            if any(has_candidate(found.candidates, freq) for found in first):
                continue
            try:
                change_choice(first[0].candidates, (freq,))
            except FemtuneError as error:
                error.where = file.where("identify", key)
                raise


def of_first_method(
    names: list[str], several: dict[tuple[str, int], OperationalModes], dropped: tuple[float, ...]
) -> Found:
    first = several[names[0], 0]
    if not len(first.modes) and not any(c.reason.startswith("harmonic") for c in first.candidates):
        raise FemtuneError("identify.no-modes/of-first-method", method=names[0])
    by_method = {name: _one_to_one(first.modes, several[name, 0].modes) for name in names}
    notices = _further(names[0], {name: several[name, 0].modes for name in names}, dropped)
    identified = Found(
        first.modes, first.collinearity, first.table, first.candidates, by_method, _NO_CURVE, notices=notices
    )  # fmt: skip
    return _remarked(identified, first.deviation_deg)


def _further(first: str, modes: dict[str, ModeSet], dropped: tuple[float, ...]) -> tuple[Notice, ...]:
    """The modes of other methods that the first one lacks, except those that the user dropped."""
    sentences = []
    for name, others in modes.items():
        lacking = [
            float(hz)
            for hz, own in zip(others.freq_hz, _beside(others, modes[first]))
            if np.isnan(own) and not any(abs(hz - f) <= FREQUENCY_TOLERANCE * f for f in dropped)
        ]
        if lacking:
            more = f" and {len(lacking) - _MOST_LISTED} more" if len(lacking) > _MOST_LISTED else ""
            sentences.append(f"{name}: {', '.join(f'{hz:.4g}' for hz in lacking[:_MOST_LISTED])} Hz{more}")
    notice = (
        Notice("identify.further-modes", level="info", first=first, found="; ".join(sentences)) if sentences else None
    )
    return (notice,) if notice else ()


def _one_to_one(modes: ModeSet, others: ModeSet) -> NDArray[np.float64]:
    """(m,) as `_beside`, but a mode of the other method belongs to one of `modes` only: as many pairs as possible, and
    among these the nearest."""
    out = np.full(len(modes), np.nan)
    if not len(others) or not len(modes):
        return out
    away = _away(modes, others)
    # a pair that is not allowed costs more than all others together
    cost = np.where(away <= FREQUENCY_TOLERANCE, away, len(modes) + len(others))
    for i, j in zip(*linear_sum_assignment(cost)):
        if away[i, j] <= FREQUENCY_TOLERANCE:
            out[i] = others.freq_hz[j]
    return out


def _away(modes: ModeSet, others: ModeSet) -> NDArray[np.float64]:
    """(m, k) relative distances of frequencies, infinite where the shapes differ."""
    same = mac(modes.shapes, others.shapes) >= LEAST_MAC
    return np.where(same, np.abs(others.freq_hz / modes.freq_hz[:, None] - 1.0), np.inf)


def _beside(modes: ModeSet, others: ModeSet) -> NDArray[np.float64]:
    """(m,) the frequency of the other method's mode that is the same one, NaN where there is none."""
    if not len(others):
        return np.full(len(modes), np.nan)
    away = _away(modes, others)
    at = away.argmin(axis=1)
    near = away[np.arange(len(modes)), at] <= FREQUENCY_TOLERANCE
    return np.where(near, others.freq_hz[at], np.nan)


def _means(several: dict[tuple[str, int], OperationalModes], pieces: Sequence[TimeSeries], record: TimeSeries) -> Found:
    combined = combine([Estimate(name, i, one.modes, pieces[i].samples) for (name, i), one in several.items()])
    with_orders = next((f for f in several.values() if f.table is not None), None)
    table, candidates = (None, ()) if with_orders is None else (with_orders.table, with_orders.candidates)
    modes = replace(combined.modes, source=record.source)
    collinearity, deviation_deg = (
        np.array([_middle(several.values(), modes, i, name) for i in range(len(modes))])
        for name in ("collinearity", "deviation_deg")
    )
    identified = Found(
        modes, collinearity, table, candidates, combined.by_method, _NO_CURVE, combined.found, len(several),
        combined.dropped,
    )  # fmt: skip
    return _remarked(identified, deviation_deg)


def _middle(several: Iterable[OperationalModes], modes: ModeSet, i: int, name: str) -> float:
    """Median over the estimates that have a mode of what their complex shapes show of it."""
    only = modes.select_modes([i])
    at = [(identified, _beside(only, identified.modes)[0]) for identified in several]
    values = [getattr(f, name)[int(np.argmin(np.abs(f.modes.freq_hz - hz)))] for f, hz in at if np.isfinite(hz)]
    return float(np.median(values)) if values else float("nan")


def _remarked(identified: Found, deviation_deg: NDArray[np.float64]) -> Found:
    """With remarks on modes whose damping or shape is not that of a structure."""
    freq = identified.modes.freq_hz
    remarks = (
        *damping_remarks(freq, identified.modes.damping_ratio, identified.modes.damping_sd),
        *collinearity_remarks(freq, identified.collinearity, deviation_deg),
    )
    return replace(identified, remarks=remarks, notices=(*identified.notices, *(r.notice for r in remarks)))


def _judged(identified: Found, record: TimeSeries) -> Found:
    """Peaks that a recorded ground has too."""
    ground = record.positions("input")
    if not ground or not len(identified.modes):
        return identified
    segment = min(2 ** int(np.log2(record.even_hz / identified.modes.freq_hz.min() * 200.0)), record.samples // 8)
    spectra = cross_spectra(record.values - record.values.mean(axis=1, keepdims=True), record.even_hz, segment)
    return replace(identified, of_input=judge_peaks(identified.modes.freq_hz.tolist(), spectra, ground))


_NO_CURVE = Curve(np.zeros(0), np.zeros(0), "")
