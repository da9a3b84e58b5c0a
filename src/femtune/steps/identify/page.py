"""The page of an identification: modes with their standard deviations, how they were chosen, how well they fit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.alert_boxes import alert_boxes
from femtune.document.document import Document, Figure, Listing, Paragraph, Section, Table, columns, row
from femtune.document.figures.frfs import FrfCurve, FrfPanel, frfs_svg
from femtune.document.figures.shapes import ShapePanel, Wireframe, shapes_svg
from femtune.document.figures.stabilisation import StabilisationPicture, stabilisation_svg
from femtune.document.numbers import (
    NONE,
    NOT_TESTED,
    as_sentence,
    counted,
    freq,
    listed,
    percent,
    short,
    signed_percent,
    typeset,
    unit_fraction,
)
from femtune.document.page_view import (
    FUNCTION_BYTES,
    FunctionsView,
    InputView,
    OperatingView,
    PageView,
    PickedView,
    SceneView,
    StabilisationView,
    StageView,
    coordinates,
    curve_view,
    phases,
    quantised,
    single,
    whole,
)
from femtune.identification.mode_checks import LARGE_AND_KNOWN, LARGE_DAMPING
from femtune.steps.report.approval import approval_of, document_facts
from femtune.units import frf_unit, unit_system

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from femtune.document.document import Block, Level
    from femtune.dofs import Dof
    from femtune.modal import ModeSet
    from femtune.steps.identify.record import (
        Identification,
        IdentifiedMode,
        LevelFunctions,
        LevelMode,
        LevelTrend,
        LinearityResults,
    )
    from femtune.steps.identify.result import IdentifyResult
    from femtune.testdata import WireFrame


_SHOWN_FUNCTIONS = 6
"""Measured functions in the figure, those that are fitted best and worst.

They must stay large enough to be compared.
"""


def build_identification_page(made: IdentifyResult) -> Document:
    """The page as data; pictures are drawn when a renderer asks for them."""
    sentence, level = _verdict(made)
    sections = (
        Section("summary", "Summary", tuple(_basis(made))),
        Section("modes", "Modes", tuple(_modes(made))),
        Section("shapes", "Mode shapes", tuple(_shapes(made))),
        Section("poles", "Choice of the modes", tuple(_poles(made))),
        Section("fit", "Measured and synthesised functions", tuple(_fit(made))),
        Section("linearity", "Linearity", tuple(_linearity(made))),
        Section("checks", "Remarks", tuple(_remarks(made))),
        Section("files", "Files", (Paragraph(f"{made.folder}: {', '.join(made.files)}"),)),
    )
    kept = tuple(s for s in sections if s.blocks)
    short_form = tuple(s for s in kept if s.id in ("modes", "linearity", "checks", "files"))
    facts, collect = _facts(made), partial(_view, made)
    approval = approval_of(made.record.report, made.record.inputs or (made.record.source,), ())
    return Document(
        made.record.title, sentence, level, facts, kept, short_form, "Identification", collect, approval
    )  # fmt: skip


def _basis(made: IdentifyResult) -> Iterator[Block]:
    """What a reviewer needs to know before signing."""
    record, stated = made.record, made.record.report
    modes = [m for m in record.modes if not m.of_input]
    ratios = [100.0 * m.damping_ratio for m in modes if m.damping_ratio is not None]
    doubtful = [m.label for m in modes if m.doubtful]
    poor = record.largest_misfit_percent
    one_level = "no measured force" if poor is None else "one level of the force"
    lines = (
        ("Measurement", ", ".join(dict.fromkeys(one.path for one in (*record.inputs, record.source)))),
        ("Sampling", "; ".join(a.sentence for a in record.alerts if a.code == "record.clock")),
        ("Methods", ", ".join(record.modes[0].by_method) if record.modes else ""),
        ("Modes", f"{len(modes)}, {f'doubtful: {listed(doubtful)}' if doubtful else 'none doubtful'}"),
        ("Left out", _left_out(record)),
        ("Damping measured", f"{percent(min(ratios))} to {percent(max(ratios))} % of critical" if ratios else ""),
        ("Sensors", f"{counted(len(record.dofs), 'measured DOF')}, shapes {record.normalisation}, {record.units}"),
        ("Boundary in the test", stated.boundary or "not stated; state it with boundary in [report]"),
        ("Excitation", stated.excitation or "not stated; state it with excitation in [report]"),
        ("Fit", f"poorest function {percent(poor)} %" if poor is not None else "not tested: no measured input"),
        ("Linearity", record.linearity.sentence if record.linearity else f"not tested: {one_level}"),
        ("Standard", stated.standard),
        ("Computed by", f"femtune {record.femtune_version}"),
    )
    rows = tuple(row(name, text) for name, text in lines if text)
    yield Table("Basis of the report", columns("Question", "Answer"), rows, prose=True)


def _left_out(record: Identification) -> str:
    peaks = sum(bool(m.of_input) for m in record.modes)
    parts = [counted(len(record.harmonics), "harmonic")] if record.harmonics else []
    parts += [counted(peaks, "peak of the excitation", "peaks of the excitation")] if peaks else []
    unchosen = [c for c in record.clusters if not c.chosen]
    parts += [counted(len(unchosen), "cluster of poles", "clusters of poles")] if unchosen else []
    return f"{listed(parts)}, see the choice of the modes" if parts else "nothing"


def _verdict(made: IdentifyResult) -> tuple[str, Level]:
    modes = made.record.modes
    structural = [m for m in modes if not m.of_input]
    text = (
        f"{counted(len(structural), 'mode')} from {freq(structural[0].freq_hz)} to {freq(structural[-1].freq_hz)} Hz"
        if structural
        else "No mode"
    )
    doubtful = sum(m.doubtful for m in structural)
    if doubtful:
        text += f", {doubtful} of them doubtful"
    text += _agreement(structural)
    if made.record.harmonics:
        text += f"; {counted(len(made.record.harmonics), 'harmonic')} excluded"
    others = len(modes) - len(structural)
    if others:
        text += f"; {counted(others, 'peak')} of the excitation excluded"
    warned = any(a.level != "info" for a in made.record.alerts) or not structural
    return text + ".", "warning" if warned else "info"


def _agreement(modes: list[IdentifiedMode]) -> str:
    """How far several methods agree on the modes that they have in common, and how many only one of them has."""
    if not modes or len(modes[0].by_method) < 2:
        return ""
    frequencies = [[f for f in mode.by_method.values() if f is not None] for mode in modes]
    spans = [(max(f) - min(f)) / mode.freq_hz for mode, f in zip(modes, frequencies) if len(f) > 1]
    alone = sum(len(f) == 1 for f in frequencies)
    text = "; no mode was found by several methods"
    if spans:
        which = "all modes" if len(spans) == len(modes) else counted(len(spans), "mode")
        text = (
            f"; several methods found {which}, with frequencies that differ by at most {percent(100.0 * max(spans))} %"
        )
    return f"{text}; only one method found {counted(alone, 'mode')}" if alone and spans else text


def _facts(made: IdentifyResult) -> tuple[tuple[str, str], ...]:
    record = made.record
    return (
        *document_facts(record.report),
        ("Measurement", record.source.path),
        ("Sensors", str(len(record.dofs))),
        ("Shapes", f"{record.normalisation}, {record.units}"),
        ("Written by", f"femtune {record.femtune_version}"),
    )


def _modes(made: IdentifyResult) -> Iterator[Block]:
    record = made.record
    methods = list(record.modes[0].by_method) if record.modes else []
    counted_in = any(m.estimates is not None for m in record.modes)
    heads = columns(
        "Mode", ">Hz", ">± σ", ">Damping %", ">± σ", *(f">{m} Hz" for m in methods), ">Collinearity",
        *((">Found in",) if counted_in else ()),
    )  # fmt: skip
    rows = [row(*_mode_cells(m, methods, made.found.estimates, counted_in)) for m in record.modes]
    note = (
        "σ is the standard deviation (– if the method gives none). The collinearity of a real shape is 1. A mode is "
        f"doubtful if its damping ratio is not between 0 and {100.0 * LARGE_DAMPING:g} % "
        f"({100.0 * LARGE_AND_KNOWN:g} % where a record with a force determines it), or not above zero by two standard "
        "deviations, if its modal mass is negative, if a harmonic is within its half-power bandwidth, or if a "
        "neighbouring mode has the same shape."
    )
    yield Table("Modes", heads, tuple(rows), note)
    if record.harmonics:
        heads = columns(">Hz", ">Kurtosis", ">Power %", "Ratio")
        lines = tuple(
            row(freq(e.freq_hz), f"{e.kurtosis:.2f}", percent(100.0 * e.share), e.multiple) for e in record.harmonics
        )
        note = (
            "Lines of machines and of the mains, which are not modes: the kurtosis of the band-passed signal is 1.5 "
            "for a sine and 3 for a mode under random forces. The key remove_hz, or --remove, subtracts them from the "
            "record."
        )
        yield Table("Harmonics", heads, lines, note)


def _mode_cells(mode: IdentifiedMode, methods: list[str], estimates: int, counted_in: bool) -> list[str]:
    damping = None if mode.damping_ratio is None else 100.0 * mode.damping_ratio
    spread = None if mode.damping_sd is None else 100.0 * mode.damping_sd
    word = " (excitation)" if mode.of_input else " (doubtful)" if mode.doubtful else ""
    name = f"{mode.label}{word}"
    cells = [name, freq(mode.freq_hz), _spread(mode.freq_sd_hz), short(damping), _spread(spread)]
    cells += [freq(mode.by_method[m]) for m in methods]
    cells.append(unit_fraction(mode.phase_collinearity, NONE))
    return [*cells, f"{mode.estimates} of {estimates}"] if counted_in else cells


def _spread(number: float | None) -> str:
    return NONE if number is None else typeset(f"{number:.2g}")


_MODES_PER_FIGURE = 6
"""Modes in one figure: they must stay large enough to be compared."""
_MOST_TRACE_LINES = 20_000
"""Trace lines in all figures: the page must stay small enough to be sent."""


def _shapes(made: IdentifyResult) -> Iterator[Block]:
    """The identified shapes on the wire frame of the test; nothing without a geometry."""
    geometry, modes = made.found.geometry, made.found.modes
    placed = [i for i, dof in enumerate(modes.dofs) if dof.node in geometry and 1 <= dof.component <= 3]
    if not placed:
        return
    frame = _wire_frame(geometry)
    most = min(len(modes), max(1, _MOST_TRACE_LINES // max(len(frame.lines), 1)))
    for first in range(0, most, _MODES_PER_FIGURE):
        group = range(first, min(first + _MODES_PER_FIGURE, most))
        titles = [f"{modes.labels[i]}: {freq(modes.freq_hz[i])} Hz" for i in group]
        draw = partial(_draw_shapes, frame, geometry, modes, group, placed)
        yield Figure(draw, "", f"Identified mode shapes. {'; '.join(titles)}", wide=True)
    lost = len(modes.dofs) - len(placed)
    if lost:
        yield Paragraph(
            f"{counted(lost, 'degree')} of freedom not drawn: rotations, or points without a place.", "muted"
        )


def _wire_frame(geometry: WireFrame) -> Wireframe:
    row = {int(node): i for i, node in enumerate(geometry.nodes)}
    paths = [*geometry.lines, *((*e, e[0]) for e in geometry.elements if len(e) > 1)]
    lines = [(row[a], row[b]) for path in paths for a, b in pairwise(path)]
    ends = np.array(lines, dtype=np.int64).reshape(-1, 2)
    return Wireframe(geometry.coordinates, ends, np.zeros(len(ends), dtype=bool))


def _draw_shapes(frame: Wireframe, geometry: WireFrame, modes: ModeSet, group: range, placed: list[int]) -> str:
    titles = [f"{modes.labels[i]}: {freq(modes.freq_hz[i])} Hz" for i in group]
    panels = [ShapePanel(title, motion_at_points(geometry, modes, i, placed)) for title, i in zip(titles, group)]
    return shapes_svg(frame, panels, axes=group[0] == 0)


def motion_at_points(geometry: WireFrame, modes: ModeSet, mode: int, placed: list[int]) -> NDArray[np.float64]:
    """(n, 3) the shortest motion of each point that its sensors, along their directions, agree with."""
    values = np.nan_to_num(np.real(modes.shapes[:, mode]))
    motion = np.zeros((len(geometry), 3))
    nodes = np.array([modes.dofs[i].node for i in placed])
    for node in np.unique(nodes):
        at = [i for i, n in zip(placed, nodes) if n == node]
        directions = np.array([geometry.direction(modes.dofs[i]) for i in at])
        motion[geometry.nodes == node] = np.linalg.lstsq(directions, values[at], rcond=None)[0]
    return motion


def _view(made: IdentifyResult) -> PageView:
    """What moves on the page: the shapes on the wire frame, measured and synthesised functions."""
    return PageView(tuple(_scenes(made)), tuple(_functions(made)), stabilisation=_stabilisation(made))


_SINGULAR_VALUES = 50_000
"""Numbers of all singular values behind the diagram: the page must stay small enough to be sent."""


def _stabilisation(made: IdentifyResult) -> StabilisationView | None:
    """The poles in the band to pick from, with those of the modes; None for several set-ups or fragments."""
    identified, table = made.found, made.found.table
    if table is None or identified.estimates > 1:
        return None
    low, high = _picture(made).band_hz
    shown = np.flatnonzero((table.freq_hz >= low) & (table.freq_hz <= high))
    row = {int(at): i for i, at in enumerate(shown)}
    ours = [c for c in identified.candidates if c.chosen or c.left]
    # two modes that begin at one pole are picked with it, and are two again
    once = {c.at: PickedView(row[c.at], c.name, c.left) for c in reversed(ours) if c.at in row}
    picked = list(once.values())[::-1]
    methods = list(dict.fromkeys(table.method))
    curve, measured = identified.curve, identified.measured
    most = max(1, _SINGULAR_VALUES // max(1, len(curve.freq_hz)))
    return StabilisationView(
        tuple(methods),
        whole(np.array([methods.index(table.method[i]) for i in shown], np.int64)),
        whole(table.order[shown]),
        single(table.freq_hz[shown]),
        single(table.damping_ratio[shown]),
        whole(identified.stable_poles()[shown].astype(np.int64)),
        tuple(picked),
        single(curve.freq_hz),
        single(curve.level_db),
        curve.words,
        single(curve.singular_db[:most]),
        single(curve.power),
        identified.derivatives,
        identified.decay,
        0 if measured is None else len(measured.responses) * len(measured.references),
        (low, high),
        tuple(InputView(one.path, one.sha256) for one in made.record.inputs),
    )


def _scenes(made: IdentifyResult) -> Iterator[SceneView]:
    geometry, modes = made.found.geometry, made.found.modes
    placed = [i for i, dof in enumerate(modes.dofs) if dof.node in geometry and 1 <= dof.component <= 3]
    if not placed or not len(modes):
        return
    frame = _wire_frame(geometry)
    turned = modes.shapes * phases(np.nan_to_num(modes.shapes))
    real, imaginary = (
        np.stack([motion_at_points(geometry, part, i, placed) for i in range(len(modes))], axis=-1)
        for part in (replace(modes, shapes=turned.real), replace(modes, shapes=turned.imag))
    )
    ratios = modes.damping_ratio
    none = np.zeros((0, 4), np.int64)
    stage = StageView(
        title="identified",
        numbers=tuple(range(1, len(modes) + 1)),
        freq_hz=tuple(map(float, modes.freq_hz)),
        stored=tuple(range(len(modes))),
        motion=quantised(real),
        damping_ratio=() if ratios is None else tuple(float(z) if np.isfinite(z) else None for z in ratios),
        motion_imaginary=quantised(imaginary) if imaginary.any() else None,
    )
    yield SceneView(
        configuration="test", note="", points=coordinates(frame.points), faces=whole(none), edges=whole(none[:, :2]),
        lines=whole(frame.lines), rigid=whole(none[:, :2]), stages=(stage,), test_labels=tuple(modes.labels),
        test_only=True, point_numbers=whole(np.asarray(geometry.nodes, np.int64)),
    )  # fmt: skip


def _functions(made: IdentifyResult) -> Iterator[FunctionsView]:
    """Those with the poorest fits where there is no room for all."""
    identified = made.found
    measured, synthesised, misfit = identified.measured, identified.synthesised, identified.misfit_percent
    if measured is None:
        return
    both = (("test", measured), ("identified", synthesised))
    sides = [(look, side) for look, side in both if side is not None]
    size = measured.values.shape[:2]
    order = np.arange(size[0] * size[1]) if misfit is None else np.argsort(-misfit, axis=None)
    shown = order[: max(1, FUNCTION_BYTES // (8 * sum(len(side.freq_hz) for _, side in sides)))]
    i, j = np.unravel_index(shown, size)
    titles = [
        f"{measured.responses[a]} / {measured.references[b]}"
        + ("" if misfit is None else f", error {percent(float(misfit[a, b]))} %")
        for a, b in zip(i.tolist(), j.tolist())
    ]
    left = len(order) - len(shown)
    curves = tuple(curve_view(look, side.freq_hz, side.values[i, j]) for look, side in sides)
    which = "" if misfit is None else " with the poorest fits"
    note = f"The {len(shown)} functions{which}, of {len(order)}." if left else ""
    unit = frf_unit(measured.kind, unit_system(made.record.units))
    ordinate = f"{measured.kind.capitalize()}, {unit}"
    dofs = [(measured.responses[a], str(measured.references[b])) for a, b in zip(i.tolist(), j.tolist())]
    operating = _operating(identified.geometry, dofs)
    yield FunctionsView("test", ordinate, tuple(titles), curves, note, section="fit", operating=operating)


def _operating(geometry: WireFrame, functions: list[tuple[Dof, str]]) -> OperatingView | None:
    """Places and directions of the responses; None where no response has a place."""
    row = {int(node): k for k, node in enumerate(geometry.nodes)}
    rows = tuple(row.get(dof.node, -1) if 1 <= dof.component <= 3 else -1 for dof, _ in functions)
    if max(rows, default=-1) < 0:
        return None
    none = np.zeros(3)
    directions = [geometry.direction(dof) if k >= 0 else none for k, (dof, _) in zip(rows, functions)]
    return OperatingView(rows, single(np.array(directions)), tuple(name for _, name in functions))


def _poles(made: IdentifyResult) -> Iterator[Block]:
    picture = _picture(made)
    shown = "no pole has a model order" if made.found.table is None else counted(len(made.found.table), "pole")
    yield Figure(
        partial(stabilisation_svg, picture),
        "Poles of all model orders; poles that are stable from order to order are drawn large. Curve in the "
        f"background: {made.found.curve.words}. Solid lines: chosen modes. Dashed lines: peaks of the excitation.",
        f"Stabilisation diagram, {shown}, {counted(len(made.record.modes), 'mode')} chosen",
        wide=True,
    )
    if made.record.clusters:
        heads = columns(">Hz", ">Damping %", "Chosen", "Reason")
        rows = [
            row(freq(c.freq_hz), short(100.0 * c.damping_ratio), "yes" if c.chosen else "no", c.reason)
            for c in made.record.clusters
        ]
        note = (
            "To change the choice, pick poles in the diagram, save them and identify with choices or --choices; or use "
            "take_hz and drop_hz in the file, or --take and --drop."
        )
        yield Table("Clusters of stable poles", heads, tuple(rows), note, folded=True)


def _picture(made: IdentifyResult) -> StabilisationPicture:
    identified, table = made.found, made.found.table
    structural_hz = [m.freq_hz for m in made.record.modes if not m.of_input]
    others = [m.freq_hz for m in made.record.modes if m.of_input]
    curve = identified.curve
    ends = curve.freq_hz if len(curve.freq_hz) else np.array([*structural_hz, *others])
    band = float(ends.min()), float(ends.max())
    if table is None:
        nothing = np.zeros(0)
        return StabilisationPicture(
            nothing, np.zeros(0, int), (), np.zeros(0, bool), curve.freq_hz, curve.level_db, structural_hz, others, band
        )
    inside = (table.freq_hz >= band[0]) & (table.freq_hz <= band[1])
    shown, firm = table.select(inside), identified.stable_poles()[inside]
    return StabilisationPicture(
        shown.freq_hz, shown.order, shown.method, firm, curve.freq_hz, curve.level_db, structural_hz, others, band
    )


def _fit(made: IdentifyResult) -> Iterator[Block]:
    identified = made.found
    if identified.measured is not None and not len(identified.modes):
        yield Paragraph("No mode was chosen: the functions are shown as they were measured.")
    if identified.measured is None or identified.synthesised is None or identified.misfit_percent is None:
        return
    worst, middle = float(identified.misfit_percent.max()), float(np.median(identified.misfit_percent))
    yield Paragraph(
        "The error is the root mean square of measured − synthesised relative to that of the measured function. It is "
        f"{percent(worst)} % for the function with the poorest fit and {percent(middle)} % in the median. The "
        "synthesis contains the modes and residual terms for the modes outside the band. Check the sensors of "
        "functions with a poor fit."
    )
    yield from _coherence(made)
    panels = tuple(_panel(made, i, j) for i, j in _functions_to_show(identified.misfit_percent))
    caption = "Wide line: measured. Narrow line: synthesised from the identified modes. The poorest fits come last."
    yield Figure(partial(frfs_svg, panels), caption, "Measured and synthesised functions", wide=True)


POOR_COHERENCE = 0.9
"""Coherence below which a line is counted as poor: noise has a ninth of the power then."""


def _coherence(made: IdentifyResult) -> Iterator[Block]:
    """What the coherence of the measured functions is, and what it is computed from."""
    measured = made.found.measured
    if measured is None or measured.coherence is None or not np.isfinite(measured.coherence).any():
        return
    poor = 100.0 * float(np.mean(measured.coherence[np.isfinite(measured.coherence)] < POOR_COHERENCE))
    middle = np.nanmedian(measured.coherence.reshape(-1, len(measured.freq_hz)), axis=1)
    worst = int(np.nanargmin(middle))
    i, j = divmod(worst, measured.values.shape[1])
    source = (
        " It is the share of the power of a response that the identified modes explain, since a record that is fitted "
        "as a whole has no averages."
        if made.found.of_whole_record
        else ""
    )
    yield Paragraph(
        f"The coherence is {float(np.nanmedian(measured.coherence)):.3f} in the median of all lines, below "
        f"{POOR_COHERENCE:g} at {percent(poor)} % of them, and lowest for {measured.responses[i]} / "
        f"{measured.references[j]} ({float(middle[worst]):.3f} in the median of its lines).{source}"
    )


def _functions_to_show(misfit: np.ndarray) -> list[tuple[int, int]]:
    """Half of them from the best, half from the worst."""
    order = [(int(i), int(j)) for i, j in zip(*np.unravel_index(np.argsort(misfit, axis=None), misfit.shape))]
    if len(order) <= _SHOWN_FUNCTIONS:
        return order
    half = _SHOWN_FUNCTIONS // 2
    return [*order[:half], *order[-half:]]


def _panel(made: IdentifyResult, i: int, j: int) -> FrfPanel:
    identified = made.found
    assert identified.measured is not None
    assert identified.synthesised is not None
    assert identified.misfit_percent is not None
    missed = percent(float(identified.misfit_percent[i, j]))
    title = f"{identified.measured.responses[i]} / {identified.measured.references[j]}, error {missed} %"
    curves = (
        FrfCurve("test", identified.measured.freq_hz, identified.measured.values[i, j]),
        FrfCurve("model", identified.synthesised.freq_hz, identified.synthesised.values[i, j]),
    )
    return FrfPanel(title, identified.measured.kind, curves)


def _linearity(made: IdentifyResult) -> Iterator[Block]:
    linearity = made.record.linearity
    if linearity is None and made.found.measured is not None:
        yield Paragraph(
            "Whether the structure is linear was not tested. This requires measurements at several levels of the force "
            "([[level]] in the settings file)."
        )
    if linearity is None:
        return
    yield Paragraph(as_sentence(linearity.sentence), "poor" if linearity.linear is False else "")
    note = (
        f"Changes relative to {linearity.names[0]}, the largest over the levels, ± one standard deviation, and for "
        "twice the force. A mode is not linear if its frequency changes by more than "
        f"{linearity.frequency_limit_percent:g} % or its damping ratio by more than "
        f"{linearity.damping_limit_percent:g} %, and by more than three standard deviations "
        "where these are known."
    )
    heads = columns(
        "Mode", *(f">{name}, Hz" for name in linearity.names), ">Change %", ">Per doubling %",
        *(f">{name}, damping %" for name in linearity.names), ">Change %", ">Per doubling %", "Linear",
    )  # fmt: skip
    if linearity.modes:
        yield Table(
            "Modes at several levels of force", heads, tuple(row(*_level_cells(m)) for m in linearity.modes), note
        )
    yield _level_functions(linearity)


def _level_cells(mode: LevelMode) -> list[str]:
    damping = [short(None if z is None else 100.0 * z) for z in mode.damping_ratio]
    return [
        mode.label,
        *(freq(f) for f in mode.freq_hz),
        *_trend_cells(mode.frequency),
        *damping,
        *_trend_cells(mode.damping),
        NOT_TESTED if mode.linear is None else "yes" if mode.linear else "no",
    ]


def _trend_cells(trend: LevelTrend) -> list[str]:
    pairs = (
        (trend.largest_percent, trend.sd_percent),
        (trend.per_doubling_percent, trend.per_doubling_sd_percent),
    )
    return [signed_percent(v) + (f" ± {_spread(sd)}" if v is not None and sd is not None else "") for v, sd in pairs]


def _level_functions(linearity: LinearityResults) -> Table:
    heads = columns(
        "Level",
        ">Functions",
        ">Lines",
        ">FRAC",
        ">Lowest FRAC",
        "Response / reference",
        ">Change %",
        ">Noise %",
        "Remark",
    )
    rows = [
        row(
            name, str(f.functions), str(f.lines), unit_fraction(f.frac, NONE), unit_fraction(f.lowest_frac, NONE),
            f.lowest, percent(f.change_percent), percent(f.noise_percent),
            as_sentence(f.reason) if f.reason else _differing(f),
        )
        for name, f in zip(linearity.names[1:], linearity.functions)
    ]  # fmt: skip
    note = (
        f"FRFs compared with those of {linearity.names[0]}. Noise: the change that noise alone would give (from the "
        "record, or estimated from the fit and from neighbouring lines). A level is not linear if the FRAC is below "
        f"{linearity.frac_limit:g} and the functions differ by more than noise."
    )
    return Table("FRFs at several levels of force", heads, tuple(rows), note)


def _differing(f: LevelFunctions) -> str:
    if not f.differing:
        return ""
    return f"{counted(f.differing, 'function')} below the limit" if f.noise_percent is not None else "below the limit"


def _remarks(made: IdentifyResult) -> Iterator[Block]:
    flagged = tuple(as_sentence(m.remark) for m in made.record.modes if m.of_input)
    if flagged:
        yield Listing(flagged)
    if made.found.dropped:
        few = ", ".join(f"{freq(f)} Hz ({n})" for f, n in made.found.dropped)
        words = f"Left out because they occur in too few of {made.found.estimates} estimates: {few}."
        yield Paragraph(words, tone="muted")
    yield from alert_boxes(made.record.alerts)
