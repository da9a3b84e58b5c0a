"""MAC matrices before and after, AutoMAC, cross-orthogonality."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.report.document import Block, Figure, FigureRow, Heading, Paragraph
from femtune.report.figures.matrix import SIDE_BY_SIDE, MatrixPicture, matrix_svg
from femtune.report.numbers import NOT_TESTED, freq, listed, unit_fraction
from femtune.report.source import STAGE_HEADS, Source
from femtune.study.results_correlation import CorrelationResults


def mac(source: Source) -> list[Block]:
    """Pictures of each configuration."""
    names = [c for c in source.results.study.configurations if source.before(c)]
    blocks = [block for name in names for block in _configuration(source, name)]
    return [*blocks, *source.after_notes] if blocks else [Paragraph("MAC: not tested, modes were not compared.")]


def _configuration(source: Source, name: str) -> list[Block]:
    stages = [s for s in (source.before(name), source.after(name)) if s is not None]
    figures = [f for s in stages if (f := _figure(source, s, s.mac_key, "MAC")) is not None]
    if not figures:
        return [Heading(name), Paragraph("MAC: not tested, the test has no mode shapes.")]
    return [Heading(name), *_rows(figures), *_auto(source, stages[-1]), *_orthogonality(source, stages)]


def _rows(figures: list[Figure]) -> list[Block]:
    """Side by side where the matrices are small."""
    return list(figures) if any(f.wide for f in figures) else [FigureRow(tuple(figures))]


def _figure(
    source: Source, stage: CorrelationResults, key: str | None, what: str, *, of_pairs: bool = False
) -> Figure | None:
    """A matrix of test modes by model modes; `of_pairs` leaves out those without a partner, which have no values."""
    values, pairs = source.array(key), pair_places(stage)
    if values is None or values.size == 0 or (of_pairs and not pairs):
        return None
    names = _labels(stage.mac_test_labels, stage.mac_test_freq_hz)
    rows = sorted({i for i, _ in pairs}) if of_pairs else list(range(len(names)))
    kept = sorted({j for _, j in pairs}) if of_pairs else shown_columns(stage)
    framed = tuple((rows.index(i), kept.index(j)) for i, j in pairs)
    title, some = f"{what} {STAGE_HEADS[stage.stage]}", tuple(names[i] for i in rows)
    shown, columns = values[np.ix_(rows, kept)], _model_labels(stage, kept)
    picture = MatrixPicture(shown, some, columns, "test", "model", title, framed)
    return _shown(picture, f"{stage.configuration}, {title}")


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


def shown_columns(stage: CorrelationResults) -> list[int]:
    """Positions of the model modes that are worth a column: all but rigid-body motions without a partner."""
    paired = {j for _, j in pair_places(stage)}
    return [j for j, n in enumerate(stage.mac_model_numbers) if n > stage.rigid_body_modes or j in paired]


def _model_labels(stage: CorrelationResults, kept: list[int]) -> tuple[str, ...]:
    labels = _labels(map(str, stage.mac_model_numbers), stage.mac_model_freq_hz)
    return tuple(labels[j] for j in kept)


def pair_places(stage: CorrelationResults) -> tuple[tuple[int, int], ...]:
    """Row and column of each pair in the MAC matrix."""
    rows, columns = stage.mac_test_labels, stage.mac_model_numbers
    return tuple(
        (rows.index(p.test_label), columns.index(p.model_number))
        for p in stage.pairs
        if p.test_label in rows and p.model_number in columns
    )


def _auto(source: Source, stage: CorrelationResults) -> list[Block]:
    """AutoMAC of test and model: which shapes the sensors can tell apart."""
    test = _labels(stage.mac_test_labels, stage.mac_test_freq_hz)
    kept = shown_columns(stage)
    parts = (
        ("AutoMAC of the test", stage.auto_mac_test_key, test, list(range(len(test)))),
        ("AutoMAC of the model", stage.auto_mac_model_key, _model_labels(stage, kept), kept),
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


def _orthogonality(source: Source, stages: list[CorrelationResults]) -> list[Block]:
    keys = [(s, s.cross_orthogonality_key) for s in stages]
    made = (_figure(source, s, key, "Cross-orthogonality", of_pairs=True) for s, key in keys)
    figures = [f for f in made if f is not None]
    if figures:
        return [*_rows(figures), *dropped_sensors(stages[-1])]
    why = stages[-1].cross_orthogonality_reason
    return [Paragraph(f"Cross-orthogonality: not tested{f' ({why})' if why else ''}.", tone="muted")]


def dropped_sensors(stage: CorrelationResults) -> list[Block]:
    """Sensors without a part in the mass-weighted comparison; [] where all take part."""
    names = stage.cross_orthogonality_dropped
    if not names:
        return []
    one = len(names) == 1
    words = f"{'it repeats' if one else 'they repeat'} the others, as sensors on a rigid body do"
    return [Paragraph(f"Cross-orthogonality leaves out {listed(names)}: {words}.", tone="muted")]
