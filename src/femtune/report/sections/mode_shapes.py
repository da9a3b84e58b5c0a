"""Drawings of the paired modes: the model's motion, and the measured one over it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from femtune.report.document import Block, Figure, Heading, Paragraph
from femtune.report.figures.shapes import ShapePanel, Wireframe, shapes_svg
from femtune.report.numbers import NOT_TESTED, counted, unit_fraction
from femtune.report.sections.pictures import parts_of, simplified
from femtune.report.sections.structure import structure_of
from femtune.report.source import STAGE_WORDS, Source
from femtune.study.results_correlation import CorrelationResults, PairedMode
from femtune.study.results_shapes import ModeShapes

_A_FIGURE = 6
_MOST_PARTS = 24_000
"""Lines and faces in all drawings of a configuration: the page must stay small enough to be sent."""
Reals = NDArray[np.float64]


@dataclass(frozen=True)
class _Drawn:
    """Arrays of one configuration; `rows` of the test's modes by label."""

    frame: Wireframe
    translations: Reals
    seats: Reals
    directions: Reals
    rotations: NDArray[np.bool_]
    test: Reals
    seen: Reals
    rows: tuple[str, ...]


def mode_shapes(source: Source) -> list[Block]:
    """A heading and pictures for each configuration."""
    names = [c for c in source.results.study.configurations if source.before(c)]
    blocks = [block for name in names for block in _configuration(source, name)]
    return blocks or [Paragraph("Mode shapes: not tested, modes were not compared.")]


def _configuration(source: Source, name: str) -> list[Block]:
    kept = _last_kept(source, name)
    stage = source.at(name, kept.stage) if kept else None
    if kept is None or stage is None:
        return [Heading(name), Paragraph("No shapes were kept for drawing: not run.")]
    if kept.reason:
        return [Heading(name), Paragraph(f"Not drawn: {kept.reason}.")]
    drawn = _drawn(source, kept, stage)
    if not stage.pairs or drawn is None:
        why = "no mode is paired" if not stage.pairs else "the test has no mode shapes"
        return [Heading(name), Paragraph(f"Not drawn: {why}.")]
    most = max(1, _MOST_PARTS // parts_of(drawn.frame))
    shown = stage.pairs[:most]
    groups = [shown[i : i + _A_FIGURE] for i in range(0, len(shown), _A_FIGURE)]
    figures = (_figure(drawn, stage, g, axes=g is groups[0]) for g in groups)
    return [Heading(name), *simplified(kept), *figures, *_rest(stage, len(shown))]


def _last_kept(source: Source, name: str) -> ModeShapes | None:
    found = [m for m in source.results.mode_shapes if m.configuration == name]
    return found[-1] if found else None


def _rest(stage: CorrelationResults, shown: int) -> list[Block]:
    left = len(stage.pairs) - shown
    if not left:
        return []
    words = f"{counted(left, 'more paired mode')} {'is' if left == 1 else 'are'} not drawn, to keep the page small."
    return [Paragraph(words, tone="muted")]


def _drawn(source: Source, kept: ModeShapes, stage: CorrelationResults) -> _Drawn | None:
    keys = (
        kept.translations_key, kept.sensor_positions_key, kept.sensor_directions_key, kept.sensor_rotations_key,
        kept.test_shapes_key, kept.model_at_sensors_key,
    )  # fmt: skip
    found = [a for a in map(source.array, keys) if a is not None]
    frame = structure_of(source, kept)
    if frame is None or len(found) < len(keys):
        return None
    motion, seats, directions, rotations, test, seen = found
    return _Drawn(
        frame, motion.astype(float), seats.astype(float), directions.astype(float), rotations.astype(bool),
        test.astype(float), seen.astype(float), stage.mac_test_labels,
    )  # fmt: skip


def _figure(drawn: _Drawn, stage: CorrelationResults, pairs: Sequence[PairedMode], *, axes: bool) -> Figure:
    titles = [_title(p) for p in pairs]
    draw = partial(_draw, drawn, stage, tuple(pairs), axes)
    return Figure(
        draw, "", f"Mode shapes of {stage.configuration} {STAGE_WORDS[stage.stage]}. {'; '.join(titles)}", wide=True
    )


def _title(p: PairedMode) -> str:
    mac = NOT_TESTED if p.mac is None else unit_fraction(p.mac)
    return f"{p.test_label}: {p.model_freq_hz:.4g} Hz (test {p.test_freq_hz:.4g}), MAC {mac}"


def _draw(drawn: _Drawn, stage: CorrelationResults, pairs: tuple[PairedMode, ...], axes: bool) -> str:
    return shapes_svg(drawn.frame, [_panel(drawn, stage, p) for p in pairs], axes=axes)


def _panel(drawn: _Drawn, stage: CorrelationResults, pair: PairedMode) -> ShapePanel:
    test = np.nan_to_num(drawn.test[:, drawn.rows.index(pair.test_label)])
    columns = _columns(stage, pair)
    # modes of a cluster are drawn in the combination that is nearest to the test's shape
    mixture = np.linalg.lstsq(drawn.seen[:, columns], test, rcond=None)[0]
    motion, seen = drawn.translations[:, :, columns] @ mixture, drawn.seen[:, columns] @ mixture
    factor = float(test @ seen / (test @ test)) if test.any() else 0.0
    places, measured = measured_motion(drawn, factor * test)
    return ShapePanel(_title(pair), motion, places, measured)


def _columns(stage: CorrelationResults, pair: PairedMode) -> list[int]:
    cluster = next((c for c in stage.clusters if c.cluster == pair.cluster), None)
    return [n - 1 for n in (cluster.model_numbers if cluster else (pair.model_number,))]


def measured_motion(drawn: _Drawn, values: Reals) -> tuple[Reals, Reals]:
    """Places and motion of what was measured, both (k, 3): sensors at one place are joined to a vector.

    A place with measured rotations that carries rigid elements moves their other ends as well.
    """
    places, motions = [], []
    known = np.isfinite(drawn.seats).all(axis=1)
    for seat in np.unique(drawn.seats[known], axis=0):
        here = known & (drawn.seats == seat).all(axis=1)
        shift = _vector(drawn, here & ~drawn.rotations, values)
        spin = _vector(drawn, here & drawn.rotations, values)
        ends = _rigid_ends(drawn.frame, seat) if (here & drawn.rotations).any() else np.zeros((0, 3))
        places += [seat, *ends]
        motions += [shift, *(shift + np.cross(spin, ends - seat))]
    return np.array(places).reshape(-1, 3), np.array(motions).reshape(-1, 3)


def _vector(drawn: _Drawn, rows: NDArray[np.bool_], values: Reals) -> Reals:
    """The shortest vector that agrees with sensors along their directions."""
    if not rows.any():
        return np.zeros(3)
    return np.asarray(np.linalg.lstsq(drawn.directions[rows], values[rows], rcond=None)[0])


def _rigid_ends(frame: Wireframe, seat: Reals) -> Reals:
    tied = frame.lines[frame.rigid]
    at = np.flatnonzero((frame.points == seat).all(axis=1))
    ends = np.concatenate([tied[np.isin(tied[:, 0], at), 1], tied[np.isin(tied[:, 1], at), 0]])
    return frame.points[np.unique(ends)]
