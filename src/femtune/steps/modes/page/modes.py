"""Sections of the report: frequencies and MAC before and after, effective masses, Sturm sequence check."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.alert_boxes import alert_boxes
from femtune.document.document import Bar, Cell, Column, Heading, Listing, Paragraph, Table, columns, row
from femtune.document.numbers import (
    NONE,
    NOT_TESTED,
    freq,
    listed,
    percent,
    short,
    signed_percent,
    unit_fraction,
    value,
    with_unit,
)
from femtune.steps.correlate.page.correlation import unpaired_model, unpaired_test
from femtune.steps.report_source import VERSION_HEADS

if TYPE_CHECKING:
    from femtune.document.document import Block, Level
    from femtune.steps.correlate.record.correlation import CorrelationResults, ModePairRecord
    from femtune.steps.info.record.model import ModelModes
    from femtune.steps.report_source import ReportSource

if TYPE_CHECKING:
    from femtune.document.document import Block, Tone
    from femtune.steps.correlate.record.correlation import ClusterRecord, CorrelationResults, ModePairRecord
    from femtune.steps.info.record.checks import ModelCheck
    from femtune.steps.info.record.model import EffectiveMasses, ModelModes
    from femtune.steps.report_source import ReportSource
    from femtune.study.record import ModelVersion

_LEFT_OUT = "reason above"
_SUSPENSION = "mode of the suspension"
_WORDS = {_LEFT_OUT: "left out", _SUSPENSION: "suspension"}
"""Word in place of a partner, by remark."""


def modes(source: ReportSource) -> list[Block]:
    """One table a configuration: before and after; then all modes without a partner."""
    names = [c for c in source.results.study.configurations if source.before(c)]
    if not names:
        return [Paragraph("Modes were not compared.")]
    scale = max([abs(p.freq_error_percent) for c in source.results.correlations for p in c.pairs], default=1.0) or 1.0
    tables = [block for name in names for block in _configuration(source, name, scale)]
    return [*tables, *source.after_notes, *unpaired_test(source, names), *unpaired_model(source, names)]


def _configuration(source: ReportSource, name: str, scale: float) -> list[Block]:
    before, after = source.before(name), source.after(name)
    assert before is not None
    if after is None:
        return [_table(source, name, before, after, scale), *cluster_paragraphs(before)]
    both = [*cluster_paragraphs(before, "Before: "), *cluster_paragraphs(after)]
    return [_table(source, name, before, after, scale), *both]


def _table(
    source: ReportSource, name: str, before: CorrelationResults, after: CorrelationResults | None, scale: float
) -> Block:
    heads = [*columns("Test mode", ">Hz"), *_version_columns("before")]
    if after:
        heads += _version_columns(after.stage)
    heads.append(Column("Remark"))
    comparisons = [before, after] if after else [before]
    kept = _kept(source, name)
    rows = [_row(entry, comparisons, scale, kept) for entry in _entries(before, after)]
    if not rows:
        return Paragraph(f"{name}: the test has no mode.")
    return Table(name, tuple(heads), tuple(rows))


def _version_columns(version: ModelVersion) -> list[Column]:
    return [Column(title, "right", VERSION_HEADS[version]) for title in ("Model no.", "Hz", "Error %", "MAC")]


@dataclass(frozen=True)
class _ModeRow:
    label: str
    freq_hz: float
    remark: str = ""


def _entries(before: CorrelationResults, after: CorrelationResults | None) -> list[_ModeRow]:
    """All test modes, sorted by frequency, each once; those left out marked."""
    comparisons = [before, after] if after else [before]
    entries: dict[str, _ModeRow] = {}
    for comparison in comparisons:
        modes_ = [*((p.test_label, p.test_freq_hz) for p in comparison.pairs)]
        modes_ += [(m.test_label, m.test_freq_hz) for m in comparison.unpaired_test]
        entries |= {label: _ModeRow(label, freq_hz) for label, freq_hz in modes_}
        entries |= {m.test_label: _ModeRow(m.test_label, m.test_freq_hz, _SUSPENSION) for m in comparison.suspension}
    for out in before.left_out:
        entries[out.test_label] = _ModeRow(out.test_label, out.test_freq_hz, _LEFT_OUT)
    return sorted(entries.values(), key=lambda e: e.freq_hz)


def _kept(source: ReportSource, name: str) -> set[str]:
    """Test modes of a configuration that the update did not see."""
    predictions = source.results.validation.predictions if source.results.validation else ()
    return {p.test_label for p in predictions if p.configuration == name and p.data}


def _row(entry: _ModeRow, comparisons: list[CorrelationResults], scale: float, kept: set[str]) -> tuple[Cell, ...]:
    pairs = [next((p for p in s.pairs if p.test_label == entry.label), None) for s in comparisons]
    cells = [cell for pair in pairs for cell in _pair_cells(pair, scale, _WORDS.get(entry.remark, "no partner"))]
    tone: Tone = "muted" if entry.remark else ""
    held = "not used in the update" if entry.label in kept else ""
    remark = entry.remark or "; ".join(filter(None, (held, pair_remark(pairs))))
    return row(Cell(entry.label, tone=tone), Cell(freq(entry.freq_hz), tone=tone), *cells, Cell(remark, tone="muted"))


def _pair_cells(pair: ModePairRecord | None, scale: float, without: str) -> list[Cell]:
    if pair is None:
        return [Cell(without, tone="muted"), *[Cell(NONE, tone="muted")] * 3]
    error = Cell(signed_percent(pair.freq_error_percent), error_bar(pair.freq_error_percent, scale))
    return [Cell(str(pair.model_number)), Cell(freq(pair.model_freq_hz)), error, mac_cell(pair.mac)]


def error_bar(error: float, scale: float) -> Bar:
    """From the middle to the left for negative errors, to the right for positive ones."""
    end = 0.5 + 0.5 * max(-1.0, min(1.0, error / scale))
    return Bar(min(0.5, end), max(0.5, end), 0.5)


def mac_cell(mac: float | None) -> Cell:
    """MAC with a bar; "not tested" where no shape was measured."""
    return (
        Cell(NOT_TESTED, tone="muted") if mac is None else Cell(unit_fraction(mac), Bar(0.0, max(0.0, min(1.0, mac))))
    )


def pair_remark(pairs: Sequence[ModePairRecord | None]) -> str:
    """What is special about the pair of a test mode, at one model version or several."""
    paired = [p for p in pairs if p]
    numbers = {p.model_number for p in paired}
    words = [
        "pair given in the study" if any(p.fixed_by_hand for p in paired) else "",
        _in_cluster(pairs),
        "pairing changed" if len(numbers) > 1 else "",
    ]
    return ", ".join(w for w in words if w)


def _in_cluster(pairs: Sequence[ModePairRecord | None]) -> str:
    """Where a MAC is that of a subspace; before the update also if it is not after it."""
    *before, last = pairs
    if last is not None and last.cluster is not None:
        return f"close modes, cluster {last.cluster}"
    earlier = [p.cluster for p in before if p is not None and p.cluster is not None]
    return f"close modes before, cluster {earlier[0]}" if earlier else ""


def cluster_paragraphs(comparison: CorrelationResults, head: str = "") -> list[Block]:
    """A sentence each cluster of close modes, after a head."""
    return [Paragraph(head + _cluster(c)) for c in comparison.clusters]


def _cluster(c: ClusterRecord) -> str:
    tail = f"; {c.sentence.removesuffix('.')}" if c.sentence else ""
    test, model = _named("test", c.test_labels), _named("model", [str(n) for n in c.model_numbers])
    return (
        f"Cluster {c.cluster}: {test} and {model} are closely spaced and were compared as subspaces: "
        f"the largest angle between the two subspaces is {short(c.angle_deg)}°{tail}."
    )


def _named(whose: str, labels: Sequence[str]) -> str:
    return f"{whose} {'mode' if len(labels) == 1 else 'modes'} {listed(labels)}"


_STURM = "Completeness of the modes (Sturm sequence check)"
_VERSIONS: dict[ModelVersion, str] = {"before": "before", "after": "after", "after as written": "written deck"}


def sturm(source: ReportSource) -> list[Block]:
    """A table of numbers, and one sentence on what they say."""
    records = source.results.modes
    if not records:
        return [Paragraph("Modes were not computed.")]
    heads = columns(
        "Configuration", "Model", ">Modes", ">Rigid-body", ">Shift Hz", ">Modes below shift", ">Sturm count"
    )
    return [
        Table(_STURM, heads, tuple(map(_count_row, records)), _sentence(records)),
        *solved_by(records),
    ]


def solved_by(modes: Sequence[ModelModes]) -> list[Block]:
    """Who solved the modes, a line; [] in results of before it was kept."""
    names = dict.fromkeys(m.solver for m in modes if m.solver)
    return [Paragraph(f"Eigen-solver: {'; '.join(names)}.", "muted")] if names else []


def _count_row(m: ModelModes) -> tuple[Cell, ...]:
    below = NONE if m.modes_below_shift is None else str(m.modes_below_shift)
    counted = Cell(NOT_TESTED, tone="muted") if m.sturm_count is None else Cell(str(m.sturm_count))
    if m.sturm_count is not None and m.sturm_count != m.modes_below_shift:
        counted = Cell(counted.text, tone="poor")
    return row(
        m.configuration, _VERSIONS[m.stage], str(len(m.freq_hz)), str(m.rigid_body_modes),
        freq(m.sturm_shift_hz), below, counted,
    )  # fmt: skip


def _sentence(found: tuple[ModelModes, ...]) -> str:
    """Whether modes are missing: none, possibly in some ranges, or not tested."""
    missed = [_place(m) for m in found if m.sturm_count is not None and m.sturm_count != m.modes_below_shift]
    untested = {_place(m): m.sturm_sentence.removeprefix("not tested: ") for m in found if m.sturm_count is None}
    why = "; ".join(dict.fromkeys(reason for reason in untested.values() if reason))
    parts = [
        f"The counts differ in {listed(missed)}: a mode may have been missed." if missed else "",
        f"Not tested in {listed(untested)}{f': {why}' if why else ''}." if untested else "",
    ]
    good = "No mode was missed: the Sturm count agrees with the number of modes below each shift."
    return " ".join(p for p in parts if p) or good


def _place(m: ModelModes) -> str:
    return f"{m.configuration} ({_VERSIONS[m.stage]})"


_DIRECTIONS = ("X", "Y", "Z", "RX", "RY", "RZ")
_LEAST_SHOWN_PART = 5e-5
"""Fraction of the mass below which a dash is shown: a table of zeros hides what matters.

The table would show it as 0.00 %.
"""
_NOTE = (
    "Modal effective mass: the part of the structure's mass (X, Y, Z) and inertia about its centre of gravity (RX, RY, "
    "RZ) that a mode moves when the supports move as a rigid body, in %. A dash is less than 0.005 %. The "
    "remainder to 100 % belongs to higher modes and to mass on constrained DOFs."
)

_FREE = (
    "The structure is unconstrained: its rigid-body modes have the total effective mass, and the modal effective mass "
    "of the other modes is zero."
)


MESH_HEADS = ("Mesh error %", "Converged mesh Hz")
MESH_NOTE = (
    "Mesh error: estimated error of the frequency due to the finite size of the elements. Converged mesh: the "
    "frequency without this error."
)


def mesh_cells(check: ModelCheck, mode: int) -> list[Cell]:
    """Estimated error of a mode (from 1), marked where it is beyond the limit, and frequency of a converged mesh."""
    mode_check = next((m for m in check.modes if m.mode == mode), None)
    if mode_check is None or mode_check.error_percent is None:
        return [Cell(NONE, tone="muted"), Cell(NONE, tone="muted")]
    tone: Tone = "poor" if abs(mode_check.error_percent) > check.limit else ""
    return [Cell(signed_percent(mode_check.error_percent), tone=tone), Cell(freq(mode_check.converged_hz))]


def mesh_sentences(modes: Sequence[ModelModes]) -> list[Block]:
    """Result of the check of each mesh, or the reason why there is none; one for all configurations that share it."""
    joined: dict[str, list[str]] = {}
    for m in modes:
        if m.mesh:
            head = "Mesh error not tested" if m.mesh.verdict == "not tested" else "Mesh"
            joined.setdefault(f"{head}: {m.mesh.sentence}.", []).append(m.configuration)
    named = len(modes) > 1
    return [Paragraph(f"{', '.join(names)}. {text}" if named else text) for text, names in joined.items()]


def mesh_table(check: ModelCheck, named: bool) -> Table:
    """Frequencies of the mesh, of one of half the size, and of a converged one."""
    heads = (*columns(">Mode", ">Hz", ">Half element size Hz"), *columns(*(f">{head}" for head in MESH_HEADS)))
    rows = (
        row(
            str(m.mode),
            freq(m.freq_hz),
            NONE if m.refined_hz is None else freq(m.refined_hz),
            *mesh_cells(check, m.mode),
        )
        for m in check.modes
    )
    title = "Errors of the frequencies due to the mesh"
    return Table(f"{title}, {check.configuration}" if named else title, heads, tuple(rows), MESH_NOTE)


def natural_modes(source: ReportSource) -> list[Block]:
    """A table each configuration; then the sentences on missed modes."""
    records = source.results.modes
    if not records:
        return [Paragraph("Modes were not computed.")]
    units = _units(source.results.study.units)
    alerts = alert_boxes(a for m in records for a in m.alerts)
    tables = [block for m in records for block in _natural_modes_of(m, len(records) > 1, units)]
    note: list[Block] = [Paragraph(_NOTE, "muted")] if any(m.effective_masses for m in records) else []
    note += mesh_sentences(records)
    note += [Paragraph(MESH_NOTE, "muted")] if any(m.mesh and m.mesh.modes for m in records) else []
    return [*alerts, *tables, *note, Heading(_STURM), Listing(tuple(map(_sturm, records))), *solved_by(records)]


def _units(units: str) -> tuple[str, str]:
    """Units of mass and of inertia; "" if none are declared."""
    length, mass, *_ = (*units.split("-"), "")
    return (mass, f"{mass}·{length}²") if mass else ("", "")


def _natural_modes_of(m: ModelModes, named: bool, units: tuple[str, str]) -> list[Block]:
    masses, mesh = m.effective_masses, MESH_HEADS if m.mesh and m.mesh.modes else ()
    heads = columns(">Mode", ">Hz", *(f">{head}" for head in mesh))
    if masses is None:
        return [Table(m.configuration if named else "", heads, tuple(_rows(m, None)))]
    if _is_free(m, masses):
        return [Table(m.configuration if named else "", heads, tuple(_rows(m, None)), _FREE)]
    heads += tuple(Column(d, "right", "Modal effective mass, %") for d in _DIRECTIONS)
    none = [Cell("")] * len(mesh)
    rows = [*_rows(m, masses), *((*r[:2], *none, *r[2:]) for r in (_sum(masses), _total(masses, units)))]
    return [Table(m.configuration if named else "", heads, tuple(rows))]


def _is_free(m: ModelModes, masses: EffectiveMasses) -> bool:
    """True where the rigid-body motions carry all: a table of dashes would say no more."""
    elastic = range(m.rigid_body_modes, len(m.freq_hz))
    parts = (part or 0.0 for i in elastic for part in _parts(masses, range(i, i + 1)))
    return m.rigid_body_modes == 6 and len(elastic) > 0 and max(parts) < _LEAST_SHOWN_PART


def _rows(m: ModelModes, masses: EffectiveMasses | None) -> list[tuple[Cell, ...]]:
    """Rigid-body modes share a row: each by itself is a chance mixture of the motions that are free."""
    rigid, count = m.rigid_body_modes, len(m.freq_hz)
    rows = []
    if rigid:
        name = "1" if rigid == 1 else f"1 to {rigid}"
        rows.append(row(name, Cell("rigid body", tone="muted"), *_mesh(m, 0), *_cells(masses, range(rigid))))
    for i in range(rigid, count):
        rows.append(row(str(i + 1), freq(m.freq_hz[i]), *_mesh(m, i + 1), *_cells(masses, range(i, i + 1))))
    return rows


def _mesh(m: ModelModes, mode: int) -> list[Cell]:
    return mesh_cells(m.mesh, mode) if m.mesh and m.mesh.modes else []


def _cells(masses: EffectiveMasses | None, modes: range) -> list[Cell]:
    if masses is None:
        return []
    return [_cell(part) for part in _parts(masses, modes)]


def _parts(masses: EffectiveMasses, modes: range) -> list[float | None]:
    """Sum over modes in each direction; None where the structure has no mass."""
    chosen = np.array([[np.nan if f is None else f for f in masses.fractions[i]] for i in modes]).reshape(-1, 6)
    return [None if total == 0.0 else float(part) for total, part in zip(masses.total, chosen.sum(axis=0))]


def _cell(part: float | None) -> Cell:
    if part is None or part < _LEAST_SHOWN_PART:
        return Cell(NONE, tone="muted")
    return Cell(percent(100.0 * part), Bar(0.0, min(1.0, part)))


def _sum(masses: EffectiveMasses) -> tuple[Cell, ...]:
    parts = _parts(masses, range(len(masses.fractions)))
    return row("all", Cell("sum", tone="muted"), *(Cell(percent(None if p is None else 100.0 * p)) for p in parts))


def _total(masses: EffectiveMasses, units: tuple[str, str]) -> tuple[Cell, ...]:
    mass, inertia = units
    shown = zip(masses.total, (mass,) * 3 + (inertia,) * 3)
    return row("", Cell("100 % is", tone="muted"), *(with_unit(value(t), unit) if t else NONE for t, unit in shown))


def _sturm(m: ModelModes) -> str:
    return f"{m.configuration}: {m.sturm_sentence or NOT_TESTED}."


def sturm_verdict(modes: Sequence[ModelModes]) -> tuple[str, Level]:
    """Whether a mode was missed, in one sentence."""
    untested = [m.configuration for m in modes if m.sturm_count is None]
    missed = [m.configuration for m in modes if m.sturm_count is not None and m.sturm_count != m.modes_below_shift]
    if missed:
        return f"The Sturm counts differ in {listed(missed)}: a mode may have been missed.", "problem"
    if untested:
        return f"The completeness of the modes was not tested in {listed(untested)}.", "warning"
    return "No mode was missed: the Sturm counts agree.", "info"
