"""Sections of the report: MAC matrices before and after, AutoMAC, cross-orthogonality, COMAC, unpaired modes."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.document.document import Cell, Figure, FigureRow, Heading, Paragraph, Table, columns, row
from femtune.document.figures.bars import comac_svg
from femtune.document.figures.matrix import SIDE_BY_SIDE, MatrixPicture, matrix_svg
from femtune.document.numbers import NONE, NOT_TESTED, counted, freq, listed, typeset, unit_fraction
from femtune.steps.report_source import VERSION_HEADS

if TYPE_CHECKING:
    from femtune.document.document import Block
    from femtune.steps.correlate.record.correlation import CorrelationResults
    from femtune.steps.report_source import ReportSource


def mac(source: ReportSource) -> list[Block]:
    """Pictures of each configuration."""
    names = [c for c in source.results.study.configurations if source.before(c)]
    blocks = [block for name in names for block in _configuration(source, name)]
    return [*blocks, *source.after_notes] if blocks else [Paragraph("MAC: not tested, modes were not compared.")]


def _configuration(source: ReportSource, name: str) -> list[Block]:
    comparisons = [s for s in (source.before(name), source.after(name)) if s is not None]
    figures = [f for s in comparisons if (f := _figure(source, s, s.mac_key, "MAC")) is not None]
    if not figures:
        return [Heading(name), Paragraph("MAC: not tested, the test has no mode shapes.")]
    return [Heading(name), *_rows(figures), *_auto(source, comparisons[-1]), *_orthogonality(source, comparisons)]


def _rows(figures: list[Figure]) -> list[Block]:
    """Side by side where the matrices are small."""
    return list(figures) if any(f.wide for f in figures) else [FigureRow(tuple(figures))]


def _figure(
    source: ReportSource, comparison: CorrelationResults, key: str | None, what: str, *, of_pairs: bool = False
) -> Figure | None:
    """A matrix of test modes by model modes; `of_pairs` leaves out those without a partner, which have no values."""
    values, pairs = source.array(key), pair_places(comparison)
    if values is None or values.size == 0 or (of_pairs and not pairs):
        return None
    names = _labels(comparison.mac_test_labels, comparison.mac_test_freq_hz)
    rows = sorted({i for i, _ in pairs}) if of_pairs else list(range(len(names)))
    kept = sorted({j for _, j in pairs}) if of_pairs else shown_columns(comparison)
    framed = tuple((rows.index(i), kept.index(j)) for i, j in pairs)
    title, some = f"{what} {VERSION_HEADS[comparison.stage]}", tuple(names[i] for i in rows)
    shown, columns = values[np.ix_(rows, kept)], _model_labels(comparison, kept)
    picture = MatrixPicture(shown, some, columns, "test", "model", title, framed)
    return _shown(picture, f"{comparison.configuration}, {title}")


def _shown(picture: MatrixPicture, name: str) -> Figure:
    """The picture; its alternative text has the numbers of the framed cells."""
    rows, columns = picture.values.shape
    cells = listed(
        f"{picture.row_labels[i]} and {picture.column_labels[j]} {_text(picture.values[i, j])}"
        for i, j in picture.framed
    )
    alt = f"{name}: matrix of {rows} by {columns} modes{f'; pairs: {cells}' if cells else ''}"
    return Figure(partial(matrix_svg, picture), "", alt, max(rows, columns) > SIDE_BY_SIDE)


def _text(value: float) -> str:
    return unit_fraction(value) if np.isfinite(value) else NOT_TESTED


def _labels(names: Any, freqs: tuple[float, ...]) -> tuple[str, ...]:
    return tuple(f"{name}: {freq(f)} Hz" for name, f in zip(names, freqs, strict=True))


def shown_columns(comparison: CorrelationResults) -> list[int]:
    """Positions of the model modes that are worth a column: all but rigid-body motions without a partner."""
    paired = {j for _, j in pair_places(comparison)}
    return [j for j, n in enumerate(comparison.mac_model_numbers) if n > comparison.rigid_body_modes or j in paired]


def _model_labels(comparison: CorrelationResults, kept: list[int]) -> tuple[str, ...]:
    labels = _labels(map(str, comparison.mac_model_numbers), comparison.mac_model_freq_hz)
    return tuple(labels[j] for j in kept)


def pair_places(comparison: CorrelationResults) -> tuple[tuple[int, int], ...]:
    """Row and column of each pair in the MAC matrix."""
    rows, columns = comparison.mac_test_labels, comparison.mac_model_numbers
    return tuple(
        (rows.index(p.test_label), columns.index(p.model_number))
        for p in comparison.pairs
        if p.test_label in rows and p.model_number in columns
    )


def _auto(source: ReportSource, comparison: CorrelationResults) -> list[Block]:
    """AutoMAC of test and model: which shapes the sensors can distinguish."""
    test = _labels(comparison.mac_test_labels, comparison.mac_test_freq_hz)
    kept = shown_columns(comparison)
    parts = (
        ("AutoMAC of the test", comparison.auto_mac_test_key, test, list(range(len(test)))),
        ("AutoMAC of the model", comparison.auto_mac_model_key, _model_labels(comparison, kept), kept),
    )
    figures = [_square(source.array(key), labels, title, some) for title, key, labels, some in parts if key is not None]
    if not figures:
        return [Paragraph("AutoMAC: not tested.", tone="muted")]
    return _rows(figures)  # fmt: skip


def _square(values: NDArray[Any] | None, labels: tuple[str, ...], title: str, kept: list[int]) -> Figure:
    assert values is not None
    values = values[np.ix_(kept, kept)]
    off = values - np.diag(np.diag(values))
    most = f", largest off the diagonal {_text(np.nanmax(off))}" if np.isfinite(off).any() and len(off) > 1 else ""
    return _shown(MatrixPicture(values, labels, labels, "", "", title), f"{title}{most}")


def _orthogonality(source: ReportSource, comparisons: list[CorrelationResults]) -> list[Block]:
    keys = [(s, s.cross_orthogonality_key) for s in comparisons]
    made = (_figure(source, s, key, "Cross-orthogonality", of_pairs=True) for s, key in keys)
    figures = [f for f in made if f is not None]
    if figures:
        return [*_rows(figures), *dropped_sensors(comparisons[-1])]
    why = comparisons[-1].cross_orthogonality_reason
    return [Paragraph(f"Cross-orthogonality: not tested{f' ({why})' if why else ''}.", tone="muted")]


def dropped_sensors(comparison: CorrelationResults) -> list[Block]:
    """Sensors without a part in the mass-weighted comparison; [] where all take part."""
    names = comparison.cross_orthogonality_dropped
    if not names:
        return []
    one = len(names) == 1
    words = f"{'it is' if one else 'they are'} linearly dependent on the others, as on a rigid body"
    return [Paragraph(f"Cross-orthogonality is computed without {listed(names)}: {words}.", tone="muted")]


_MOST_COMAC_BARS = 40
"""Measured DOFs with the lowest COMAC in the chart; the labels of more bars are not legible."""
_MOST_NAMED_DOFS = 5
"""Lowest values of COMAC that the caption names, so that it stays one line."""


def comac(source: ReportSource) -> list[Block]:
    """A picture each configuration; of many DOFs the worst."""
    names = [c for c in source.results.study.configurations if source.before(c)]
    blocks = [_comac_of(source, name) for name in names]
    figures = tuple(b for b in blocks if isinstance(b, Figure))
    said = [b for b in blocks if isinstance(b, Paragraph)]
    if not blocks:
        return [Paragraph("COMAC: not tested, modes were not compared.")]
    tables = [t for name in names for t in contribution_table(source.shown(name)[-1])]
    return [*([FigureRow(figures)] if figures else []), *said, *tables]


def _comac_of(source: ReportSource, name: str) -> Figure | Paragraph:
    before, after = _values(source.before(name)), _values(source.after(name))
    last = after or before
    if not last:
        return Paragraph(f"{name}, COMAC: not tested (at least two paired modes with shapes are required).")
    worst = sorted(last, key=lambda dof: last[dof])[:_MOST_COMAC_BARS]
    dofs = [dof for dof in last if dof in set(worst)]
    draw = partial(comac_svg, dofs, [before.get(d) for d in dofs], [after.get(d) for d in dofs])
    some = f", the {_MOST_COMAC_BARS} lowest of {len(last)} DOFs" if len(last) > _MOST_COMAC_BARS else ""
    caption = f"{name}{some}. Lowest: {listed(f'{unit_fraction(last[d])} at {d}' for d in worst[:_MOST_NAMED_DOFS])}."
    return Figure(draw, caption, f"COMAC by measured DOF, {listed(f'{d} {unit_fraction(last[d])}' for d in dofs)}")


def contribution_table(comparison: CorrelationResults, most: int = 10) -> list[Block]:
    """The DOFs that lower the MAC most, for page and terminal; [] where no MAC can be compared without a DOF."""
    known = [s for s in comparison.contributions if s.mac_change is not None]
    order = sorted(known, key=lambda s: -(s.mac_change or 0.0))[:most]
    comacs = _values(comparison)
    heads = columns("DOF", ">COMAC", ">eCOMAC", ">Change of MAC, mean", ">largest", "in mode")
    rows = tuple(
        row(
            s.dof, unit_fraction(comacs.get(s.dof), NONE), unit_fraction(s.ecomac, NONE), _change(s.mac_change),
            _change(s.largest_change), s.largest_change_label,
        )
        for s in order
    )  # fmt: skip
    some = f"the {most} of {len(known)} DOFs with the largest increase" if len(known) > most else "all DOFs"
    note = (
        f"Change of the MAC of the pairs when the DOF is left out, {some}: positive where the DOF lowers the MAC. "
        "eCOMAC is 0 for agreement."
    )
    title = f"{comparison.configuration}: MAC without one DOF, {VERSION_HEADS[comparison.stage]}"
    return [Table(title, heads, rows, note)] if rows else []


def _change(value: float | None) -> str:
    return NONE if value is None else typeset(f"{value:+.4f}").replace("−0.0000", "0.0000").replace("+0.0000", "0.0000")


def _values(comparison: CorrelationResults | None) -> dict[str, float]:
    return {entry.dof: entry.comac for entry in comparison.comac} if comparison else {}


_Row = tuple[str, int, dict[str, float], "CorrelationResults"]
"""Configuration, number, frequency by version, and the last comparison where a mode has no partner."""

LISTED_UP_TO = 1.2
"""Model modes up to this multiple of the highest test mode are listed one by one.

Modes just above the measured band can be partners of unpaired test modes; those far above cannot.
"""


def unpaired_test(source: ReportSource, names: list[str]) -> list[Block]:
    """Test modes without a partner with the reason; versions with the same reason share a row."""
    modes: dict[tuple[str, str, float, str], list[str]] = {}
    for name in names:
        for comparison in source.shown(name):
            for m in (*comparison.unpaired_test, *comparison.suspension):
                key = (name, m.test_label, m.test_freq_hz, m.reason)
                modes.setdefault(key, []).append(VERSION_HEADS[comparison.stage])
    rows = [
        row(name, label, freq(hz), " and ".join(versions), reason)
        for (name, label, hz, reason), versions in modes.items()
    ]
    heads = columns("Configuration", "Test mode", ">Hz", "When", "Reason")
    return [Table("Test modes without a partner", heads, tuple(rows))] if rows else []


def unpaired_model(source: ReportSource, names: list[str]) -> list[Block]:
    """Model modes without a partner by configuration and number: those that a test up to its highest mode could show.

    How many lie higher is said, and rigid-body motions share a line.
    """
    rows_of = [_model_rows(source.shown(name)) for name in names]
    near = [r for rows in rows_of for r in rows if _in_range(r)]
    if not any(rows_of):
        return []
    heads = columns("Configuration", ">Model mode", ">Hz before", ">Hz after", "Remark")
    notes = [note for rows in rows_of for note in _notes(rows)]
    table = Table("Model modes without a partner", heads, tuple(_plain(source, r) for r in near), " ".join(notes))
    return [table] if near else [Paragraph(note, "muted") for note in notes]


def _in_range(entry: _Row) -> bool:
    _, number, hz, comparison = entry
    return number > comparison.rigid_body_modes and min(hz.values()) <= highest_hz(comparison)


def highest_hz(comparison: CorrelationResults) -> float:
    """Up to where model modes without a partner are listed one by one: a fifth above the highest test mode."""
    return LISTED_UP_TO * max(comparison.mac_test_freq_hz, default=0.0)


def _notes(rows: list[_Row]) -> list[str]:
    """What is not listed one by one, of one configuration."""
    if not rows:
        return []
    name, _, _, comparison = rows[-1]
    rigid = sum(number <= comparison.rigid_body_modes for _, number, *_ in rows)
    return others(name, comparison, rigid, len(rows) - rigid - sum(map(_in_range, rows)))


def others(name: str, comparison: CorrelationResults, rigid: int, higher: int) -> list[str]:
    """A sentence on the modes that are not listed one by one; [] where all are."""
    parts = [counted(rigid, "rigid-body mode")] if rigid else []
    parts += [f"{counted(higher, 'mode')} above {freq(highest_hz(comparison))} Hz"] if higher else []
    is_or_are = "is" if rigid + higher == 1 else "are"
    return [f"{name}: {' and '.join(parts)} without a partner {is_or_are} not listed."] if parts else []


def _model_rows(comparisons: list[CorrelationResults]) -> list[_Row]:
    """Configuration, number, frequency by version, and the last comparison where it has no partner."""
    modes: dict[int, tuple[dict[str, float], CorrelationResults]] = {}
    for comparison in comparisons:
        for m in comparison.unpaired_model:
            known = modes[m.model_number][0] if m.model_number in modes else {}
            modes[m.model_number] = (known | {VERSION_HEADS[comparison.stage]: m.model_freq_hz}, comparison)
    return [(comparison.configuration, number, hz, comparison) for number, (hz, comparison) in sorted(modes.items())]


def _plain(source: ReportSource, entry: _Row) -> tuple[Cell, ...]:
    name, number, hz, comparison = entry
    remark = model_mode_remark(source.array(comparison.mac_key), comparison, number)
    by_head = {VERSION_HEADS[s.stage]: s for s in source.shown(name)}
    cells = (_freq_or_partner(hz.get(when), by_head.get(when), number) for when in ("before", "after"))
    return row(name, str(number), *cells, remark)


def _freq_or_partner(hz: float | None, comparison: CorrelationResults | None, number: int) -> Cell:
    """The frequency where the mode has no partner, else its partner at that version."""
    if hz is not None:
        return Cell(freq(hz))
    labels = [p.test_label for p in comparison.pairs if p.model_number == number] if comparison else []
    return Cell(f"paired with test mode {labels[0]}" if labels else NONE, tone="muted")


def model_mode_remark(mac: NDArray[Any] | None, comparison: CorrelationResults, number: int) -> str:
    """That it resembles a mode that was left out, where its MAC reaches the gate; else the reason of the results."""
    out = [m.test_label for m in comparison.left_out if m.test_label in comparison.mac_test_labels]
    if mac is not None and out and comparison.mac_gate is not None and number in comparison.mac_model_numbers:
        column = mac[:, comparison.mac_model_numbers.index(number)]
        like = {label: float(column[comparison.mac_test_labels.index(label)]) for label in out}
        alike = [label for label in out if np.isfinite(like[label]) and like[label] >= comparison.mac_gate]
        if alike:
            return _resembles([f"{label} (MAC {unit_fraction(like[label])})" for label in alike])
    reasons = {m.model_number: m.reason for m in comparison.unpaired_model}
    return reasons[number] or "no test mode was paired with it"


def _resembles(labels: list[str]) -> str:
    one = len(labels) == 1
    return f"resembles test mode{'' if one else 's'} {' and '.join(labels)}, which {'was' if one else 'were'} left out"
