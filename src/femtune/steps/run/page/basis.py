"""What a reviewer needs to know before signing: criteria, inputs, modes, masses, damping, sensors, supports."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.document import Cell, Column, Figure, Paragraph, Table, TwoColumns, columns, row
from femtune.document.figures.sensors import TEST_POINT, Marks, still_svg
from femtune.document.numbers import NONE, counted, freq, listed, percent, short, signed_percent, value, with_unit
from femtune.steps.info.page import support_words
from femtune.steps.modes.page.mode_shapes import structure_of
from femtune.steps.report_source import left_out_modes, versions

if TYPE_CHECKING:
    from femtune.document.document import Block
    from femtune.steps.correlate.record.correlation import CorrelationResults, UnpairedTestMode
    from femtune.steps.info.record.model import ModelModes, SensorResults
    from femtune.steps.report_source import ReportSource

MOST_MODES = 24
"""Rows of the table of effective masses on the first page; the other modes are counted below it."""
_MOST_FEATURES = 4
"""Configurations, channels or modes that a line names before it counts the others."""
_TRANSLATIONS = 3
_ROUNDING_PERCENT = 1e-3
"""Change of the mass by an update that is rounding, of written fields too, in %."""
_DAMPED = ("frf", "complex-eigenvalue", "damping")
"""Kinds of residuals that the damping of the model enters."""
_SMALL_MASS_PERCENT = 2.0
"""Largest effective mass of a model mode that is left out where there is no room for all, in %."""


def basis(source: ReportSource) -> list[Block]:
    """The table of what the report is based on, effective masses, and the sensors on the structure."""
    rows = [row(name, text) for name, make in _LINES if (text := make(source))]
    heads = columns("Question", "Answer")
    masses, still = effective_masses(source), sensors_on_structure(source)
    last: list[Block] = [TwoColumns((*masses,), (*still,))] if masses and still else [*masses, *still]
    return [Table("Basis of the report", heads, tuple(rows), prose=True), *last]


# ----------------------------------------------------------------------------------------------------
# The lines of the table, each a text or "" where a page has nothing to say.


def _criteria(source: ReportSource) -> str:
    judged = source.results.judgement
    stated = source.results.study.report.standard
    used = judged.acceptance.standard if judged and judged.acceptance else ""
    if stated and used:
        return f"{stated} (stated in the study); limits: {used}"
    return stated or (f"{used}; the study states no edition" if used else "")


def _last(source: ReportSource) -> list[CorrelationResults]:
    """The comparisons of the last version of the model."""
    version = versions(source)[-1] if source.results.correlations else "before"
    return [c for c in source.results.correlations if c.stage == version]


def _missing(c: CorrelationResults) -> tuple[UnpairedTestMode, ...]:
    return (*c.unpaired_test, *c.suspension)


def _compared(source: ReportSource) -> str:
    last = _last(source)
    if not last:
        return ""
    counts = [(c.configuration, len(c.pairs), len(c.pairs) + len(_missing(c)) + len(c.left_out)) for c in last]
    total = f"{sum(n for _, n, _ in counts)} of {counted(sum(of for _, _, of in counts), 'test mode')}"
    each = _some([f"{name} {n} of {of}" for name, n, of in counts])
    return total if len(counts) == 1 else f"{total}: {each}"


def _not_compared(source: ReportSource) -> str:
    last = _last(source)
    out = [f"{', '.join(m.labels)} ({', '.join(m.configurations)}): {m.reason}" for m in left_out_modes(last)]
    alone = [f"{m.test_label} ({c.configuration}, {freq(m.test_freq_hz)} Hz): {m.reason}" for c in last for m in
             _missing(c)]  # fmt: skip
    return "; ".join([*out, *([_some(alone)] if alone else [])]) or ("none" if last else "")


def _targets(source: ReportSource) -> str:
    judged = source.results.judgement
    if judged is None or judged.acceptance is None or not _last(source):
        return ""
    asked = judged.acceptance
    named = f"{', '.join(asked.target_modes)}" if asked.target_modes else "none stated: all test modes are target modes"
    paired = [all(any(p.test_label == t for p in c.pairs) for t in asked.target_modes) for c in _last(source)]
    done = f"; all compared in {sum(paired)} of {counted(len(paired), 'configuration')}" if asked.target_modes else ""
    mass = f"a model mode with more than {short(asked.target_mass_percent)} % of the mass must have a partner"
    if _of_runs(source):
        mass = "the masses of the model modes are not known"
    return f"{named}{done}; {mass}"


def _of_runs(source: ReportSource) -> bool:
    """Whether another program, or a function of the user, computed the modes: what femtune holds is made of them, and
    its size, supports and eigenvalue counts are not those of the structure."""
    model = source.results.model
    return model is not None and bool(model.configurations) and all(c.mass is None for c in model.configurations)


def _model(source: ReportSource) -> str:
    model, study = source.results.model, source.results.study
    if model is None:
        return study.deck_file
    if _of_runs(source):
        return f"{study.deck_file}, units {study.units or 'not declared'}: modes computed outside femtune"
    sizes = dict.fromkeys(f"{c.grids} grid points, {c.free_dofs} free DOFs" for c in model.configurations)
    return f"{study.deck_file}, units {study.units or 'not declared'}: {_some(sizes)}"


def _tests(source: ReportSource) -> str:
    return ", ".join(dict.fromkeys(s.test_file for s in source.results.sensors))


def _configurations(source: ReportSource) -> str:
    model = source.results.model
    unchanged = "as in the deck" if source.results.study.has_deck else "as the model is given"
    by = [(c.configuration, "; ".join(c.overlay) or unchanged) for c in (model.configurations if model else ())]
    return _by_configuration(by)


def _supports(source: ReportSource) -> str:
    model = source.results.model
    if _of_runs(source):
        return "those of the model outside femtune, which are not known here"
    by = [(c.configuration, ", ".join(filter(None, support_words(c)))) for c in (model.configurations if model else ())]
    return _by_configuration(by)


def _boundary(source: ReportSource) -> str:
    stated = source.results.study.report.boundary
    return stated or ("not stated; state it with boundary in [report]" if source.results.sensors else "")


def _mass(source: ReportSource) -> str:
    model = source.results.model
    units = source.results.study.units.split("-")
    unit = units[1] if len(units) == 3 else ""
    by = []
    for c in model.configurations if model else ():
        if c.mass is None:
            by.append((c.configuration, "model not known"))
            continue
        mass = f"model {with_unit(value(c.mass), unit)}"
        if c.weighed_mass is not None:
            mass += (
                f", weighed {with_unit(value(c.weighed_mass), unit)} ({signed_percent(c.mass_difference_percent)} %)"
            )
        by.append((c.configuration, mass))
    said = _by_configuration(by)
    weighed = any(c.weighed_mass is not None for c in (model.configurations if model else ()))
    known = any(c.mass is not None for c in (model.configurations if model else ()))
    initial = f" at the initial values{_mass_change(source)}" if source.results.update and known else ""
    return said and f"{said}{initial}{'' if weighed else '; not weighed'}"


def _mass_change(source: ReportSource) -> str:
    """What the update does to the mass that moves, as the largest change of effective mass in X, Y and Z."""
    before = {m.configuration: m.effective_masses for m in source.results.modes if m.stage == "before"}
    by = []
    for m in _modes(source):
        first = before.get(m.configuration)
        if m.stage == "before" or first is None or m.effective_masses is None:
            continue
        pairs = zip(first.total[:_TRANSLATIONS], m.effective_masses.total[:_TRANSLATIONS])
        changes = [100.0 * (new / old - 1.0) for old, new in pairs if old > 0.0]
        if changes:
            most = max(changes, key=abs)
            changed = (
                f"changes it by {signed_percent(most)} %" if abs(most) > _ROUNDING_PERCENT else "does not change it"
            )
            by.append((m.configuration, f"the update {changed}"))
    said = _by_configuration(by) if by else ""
    return said and f" ({said})"


def _damping_measured(source: ReportSource) -> str:
    correlations = [c for c in source.results.correlations if c.stage == "before"]
    ratios = [100.0 * r for c in correlations for r in c.test_damping_ratio if r is not None]
    if not correlations:
        return ""
    return f"{_span(ratios)} % of critical ({counted(len(ratios), 'mode')})" if ratios else "not given by the test"


def _damping_used(source: ReportSource) -> str:
    results, model = source.results, source.results.model
    if results.mapped_damping:
        equal = _span([m.equalised_percent for m in results.mapped_damping])
        return f"{equal} % on all modes of test and model during the update; afterwards the measured damping"
    if model is None or model.damping is None:
        return ""
    d = model.damping
    parts = [f"PARAM G {short(d.overall_loss_factor)}"] if d.overall_loss_factor else []
    parts += [d.modal_damping] if d.modal_damping else []
    parts += [f"{f.kind} {f.field} {short(f.lowest)} to {short(f.highest)}" for f in d.fields]
    used = "; ".join(parts)
    compared = [c.kind for c in results.update.residual_counts if c.kind in _DAMPED] if results.update else []
    if compared:
        parts += _damping_found(source)
        parts += ["damping ratios stated for the FRF residuals"] if "frf" in compared else []
        return f"in the comparison of kind {listed(dict.fromkeys(compared))}: {'; '.join(parts) or 'none in the deck'}"
    undamped = f"none: undamped modes are compared{f' (the deck has {used})' if used else ''}"
    computed = dict.fromkeys(r.frfs.damping for r in results.responses if r.frfs is not None)
    return f"{undamped}; for the computed responses {'; '.join(computed)}" if computed else undamped


def _damping_found(source: ReportSource) -> list[str]:
    """Parameters that are damping ratios of modes, with their updated values."""
    update = source.results.update
    found = {p.name: p.value for p in update.parameters} if update else {}
    return [
        f"{p.name} {short(p.nominal)}, updated {short(found[p.name])}"
        for p in source.results.parameters
        if p.name in found and any(field.startswith("MODAL ") for field in p.fields)
    ]


def _sensors(source: ReportSource) -> str:
    by = []
    for s in source.results.sensors:
        points = len({m.test_node for m in s.matched})
        left = f", {len(s.unmatched)} not matched" if s.unmatched else ""
        by.append((s.configuration, f"{counted(len(s.matched), 'measured DOF')} at {counted(points, 'point')}{left}"))
    return _by_configuration(by)


def _exciters(source: ReportSource) -> str:
    stated = source.results.study.report.excitation
    by = [(s.configuration, _some(e.test_dof for e in s.exciters)) for s in source.results.sensors if s.exciters]
    known = _by_configuration(by)
    if stated or known:
        return "; ".join(filter(None, (stated, known)))
    return (
        "not stated; state it with excitation in [report]. The test has modes only." if source.results.sensors else ""
    )


def _orthogonality(source: ReportSource) -> str:
    last = _last(source)
    if not last:
        return ""
    macs = [p.mac for c in last for p in c.pairs if p.mac is not None]
    diagonals, offs, untested = [], [], []
    for c in last:
        matrix = source.array(c.cross_orthogonality_key)
        if matrix is None:
            untested.append(c.cross_orthogonality_reason)
            continue
        rows = [c.mac_test_labels.index(p.test_label) for p in c.pairs]
        places = [c.mac_model_numbers.index(p.model_number) for p in c.pairs]
        part = np.abs(matrix[np.ix_(rows, places)])
        diagonals += list(np.diag(part))
        offs += list(part[~np.eye(len(part), dtype=bool)])
    words = [f"lowest MAC {min(macs):.3f}"] if macs else ["MAC not tested: no mode shapes"]
    if diagonals:
        most = f", off the diagonal at most {np.nanmax(offs):.3f}" if len(offs) else ""
        words.append(f"cross-orthogonality of the pairs at least {np.nanmin(diagonals):.3f}{most}")
    words += [f"cross-orthogonality not tested ({why})" for why in dict.fromkeys(filter(None, untested))]
    return "; ".join(words)


def _held_out(source: ReportSource) -> str:
    validation = source.results.validation
    if validation is None:
        return ""
    data = list(dict.fromkeys(v.data for v in validation.verdicts))
    return _some(data) if data else "none: the model was not tested on data that the update did not use"


def _found(source: ReportSource) -> str:
    """Whether a mode may have been missed: the Sturm count of the last version of the model."""
    modes = _modes(source)
    if _of_runs(source):
        return "not possible: the modes were computed outside femtune"
    counted_ = [m for m in modes if m.sturm_count is not None]
    if not counted_:
        return "not checked" if modes else ""
    open_ = [m.configuration for m in modes if m.sturm_count is None]
    unchecked = f"; not checked in {listed(open_)}" if open_ else ""
    short_ = [m.configuration for m in counted_ if m.sturm_count != m.modes_below_shift]
    upto = f"up to {freq(min(m.sturm_shift_hz or 0.0 for m in counted_))} Hz"
    said = f"differs in {listed(short_)}: modes may be missing" if short_ else f"no mode was missed {upto}"
    return said + unchecked + _sums_of_masses(modes)


def _sums_of_masses(modes: Sequence[ModelModes]) -> str:
    """How much of the mass of a structure that is held moves in the modes that were solved."""
    held = [
        (m.configuration, m.effective_masses.fractions) for m in modes
        if m.effective_masses is not None and m.effective_masses.fractions and not m.rigid_body_modes
    ]  # fmt: skip
    if not held:
        return ""
    sums = []
    for name, fractions in held:
        parts = zip(*(of_mode[:_TRANSLATIONS] for of_mode in fractions))
        shares = (NONE if None in d else f"{100.0 * sum(p or 0.0 for p in d):.1f}" for d in parts)
        sums.append((name, ", ".join(shares)))
    return f"; sums of their effective masses in X, Y, Z {_by_configuration(sums)} %"


def _software(source: ReportSource) -> str:
    origin = source.results.provenance
    inside = bool(origin.eigen_solver) and not _of_runs(source)
    solver = f"; {origin.eigen_solver}" if inside else ""
    return f"femtune {origin.femtune_version}, {origin.started_at}{solver}"


_LINES: tuple[tuple[str, Callable[[ReportSource], str]], ...] = (
    ("Criteria and edition", _criteria),
    ("Test modes compared", _compared),
    ("Test modes not compared", _not_compared),
    ("Target modes", _targets),
    ("Model", _model),
    ("Test", _tests),
    ("Configurations", _configurations),
    ("Supports of the model", _supports),
    ("Boundary in the test", _boundary),
    ("Mass", _mass),
    ("Damping measured", _damping_measured),
    ("Damping used", _damping_used),
    ("Sensors", _sensors),
    ("Excitation", _exciters),
    ("MAC and orthogonality", _orthogonality),
    ("Data held out", _held_out),
    ("Sturm check", _found),
    ("Computed by", _software),
)


def _some(texts: Iterable[str]) -> str:
    names = list(texts)
    more = len(names) - _MOST_FEATURES
    return ", ".join(names[:_MOST_FEATURES]) + (f" and {more} more" if more > 0 else "")


def _by_configuration(texts: Sequence[tuple[str, str]]) -> str:
    """Configurations with the same text share it; without names where all have it."""
    groups: dict[str, list[str]] = {}
    for name, text in texts:
        groups.setdefault(text, []).append(name)
    if len(groups) == 1:
        return next(iter(groups))
    parts = [f"{', '.join(names)}: {text}" for text, names in groups.items()]
    more = len(parts) - _MOST_FEATURES
    return "; ".join(parts[:_MOST_FEATURES]) + (f"; and {more} more" if more > 0 else "")


def _span(numbers: Sequence[float]) -> str:
    low, high = percent(min(numbers)), percent(max(numbers))
    return low if low == high else f"{low} to {high}"


# ----------------------------------------------------------------------------------------------------
# Effective masses, and the sensors on the structure.


def _modes(source: ReportSource) -> list[ModelModes]:
    """Modes of the last version of the model that was solved."""
    version = source.results.modes[-1].stage if source.results.modes else "before"
    return [m for m in source.results.modes if m.stage == version]


def effective_masses(source: ReportSource) -> list[Block]:
    """All elastic modes of the model with their partners and effective masses in three directions."""
    partners = {(c.configuration, p.model_number): p.test_label for c in _last(source) for p in c.pairs}
    solved = [m for m in _modes(source) if m.effective_masses is not None and any(m.effective_masses.total)]
    if not solved or _of_runs(source):
        return []
    several, compared = len(solved) > 1, bool(_last(source))
    rows: list[tuple[float, bool, tuple[Cell, ...]]] = []
    for m in solved:
        assert m.effective_masses is not None
        for i in range(m.rigid_body_modes, len(m.freq_hz)):
            parts = [None if p is None else 100.0 * p for p in m.effective_masses.fractions[i][:_TRANSLATIONS]]
            partner = partners.get((m.configuration, i + 1))
            cells = row(
                *((m.configuration,) if several else ()), str(i + 1), freq(m.freq_hz[i]),
                *((Cell("none", tone="poor" if _much(parts) else "muted") if partner is None else partner,)
                  if compared else ()),
                *(NONE if p is None else f"{p:.1f}" for p in parts),
            )  # fmt: skip
            rows.append((max((p or 0.0 for p in parts), default=0.0), partner is not None, cells))
    if not rows:
        return []
    kept = rows
    if len(rows) > MOST_MODES:
        order = sorted(range(len(rows)), key=lambda k: (not rows[k][1], -rows[k][0]))[:MOST_MODES]
        kept = [rows[k] for k in sorted(order)]
    heads = (
        *(columns("Configuration") if several else ()),
        *columns(">Mode", ">Hz", *(("Test mode",) if compared else ())),
        *(Column(d, "right", "Effective mass, %") for d in "XYZ"),
    )
    left = [share for share, _, cells in rows if not any(cells is k[2] for k in kept)]
    note = f"{counted(len(left), 'further mode')} with at most {max(left):.1f} %. " if left else ""
    if all(m.rigid_body_modes for m in solved) and max(share for share, _, _ in rows) < _SMALL_MASS_PERCENT:
        note += "The rigid-body motions carry the mass of a free structure."
    return [Table("Effective masses of the model modes", heads, tuple(r[2] for r in kept), note.strip())]


def _much(parts: Sequence[float | None]) -> bool:
    return max((p or 0.0 for p in parts), default=0.0) >= _SMALL_MASS_PERCENT


def sensors_on_structure(source: ReportSource) -> list[Block]:
    """Sensors and exciters of the first configuration that can be drawn; configurations with other points are named."""
    for sensors in source.results.sensors:
        kept = next((m for m in source.results.mode_shapes if m.configuration == sensors.configuration), None)
        # the summary can be made of results without their arrays
        if kept is None or kept.reason or kept.points_key not in source.arrays:
            continue
        frame, marks = structure_of(source, kept), _marks(sensors)
        if frame is not None and marks is not None:
            same = [s.configuration for s in source.results.sensors if _points(s) == _points(sensors)]
            others = [s.configuration for s in source.results.sensors if s.configuration not in same]
            caption = f"Sensors{' and exciters' if sensors.exciters else ''} on the model: {_some(same)}."
            caption += f" Other points: {_some(others)}." if others else ""
            alt = f"The structure with {counted(marks.kinds.count(TEST_POINT), 'test point')}: {_some(marks.names)}"
            return [Figure(partial(still_svg, frame, marks), caption, alt)]
    return [Paragraph("Sensors: not drawn, their places are not known.", "muted")] * bool(source.results.sensors)


def _points(sensors: SensorResults) -> set[object]:
    return {(s.test_node, s.place) for s in sensors.matched}


def _marks(sensors: SensorResults) -> Marks | None:
    known = {s.test_node: s.place or s.grid_place for s in sensors.matched}
    points = [(str(node), place) for node, place in known.items() if place is not None]
    drive = [(e.test_dof, e.place) for e in sensors.exciters if e.place is not None]
    if not points:
        return None
    places = np.array([place for _, place in (*points, *drive)])
    kinds = [TEST_POINT] * len(points) + ["exciter"] * len(drive)
    return Marks(places, [name for name, _ in (*points, *drive)], kinds, np.zeros_like(places))
