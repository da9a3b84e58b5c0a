"""Pictures of the paired modes, with the measured shape over that of the model, and of modes without a test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.document.document import Figure, Heading, Paragraph
from femtune.document.figures.shapes import VECTOR_FACES, ShapePanel, Wireframe, shapes_svg
from femtune.document.numbers import NOT_TESTED, as_sentence, counted, freq, unit_fraction
from femtune.steps.report_source import VERSION_WORDS

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.document.document import Block
    from femtune.steps.correlate.record.correlation import CorrelationResults, ModePairRecord
    from femtune.steps.info.record.model import ModelModes
    from femtune.steps.modes.record import ModeShapes
    from femtune.steps.report_source import ReportSource

_RIGID = 1
"""Kind of a drawn line that stands for a rigid element."""


def structure_of(source: ReportSource, kept: ModeShapes) -> Wireframe | None:
    """Points, lines and faces; None where they were not kept. Results of before shells were drawn have no faces."""
    points, lines, kinds = map(source.array, (kept.points_key, kept.lines_key, kept.line_kinds_key))
    if points is None or lines is None or kinds is None:
        return None
    faces = source.array(kept.faces_key)
    none = np.zeros((0, 4), np.int64)
    return Wireframe(
        points.astype(float), lines.astype(np.int64), kinds == _RIGID, none if faces is None else faces.astype(np.int64)
    )


MOST_PICTURES = 80_000
"""Lines and faces in all pictures of the page: it must stay small enough to be sent."""


def pictures(source: ReportSource) -> list[Block]:
    """Pictures by configuration; those of the first modes where all would make the page too large."""
    mode_records = source.results.modes
    return [
        block for modes in mode_records for block in _pictures_of(source, modes, MOST_PICTURES // len(mode_records))
    ]


def _pictures_of(source: ReportSource, modes: ModelModes, room: int) -> list[Block]:
    name = modes.configuration
    head: list[Block] = [Heading(name)] if len(source.results.modes) > 1 else []
    kept = next((m for m in source.results.mode_shapes if m.configuration == name), None)
    frame = None if kept is None or kept.reason else structure_of(source, kept)
    motion = None if kept is None else source.array(kept.translations_key)
    if frame is None or motion is None:
        return [*head, Paragraph(f"Not drawn: {_why(kept)}.")]
    most = min(max(1, room // parts_of(frame)), motion.shape[2], len(modes.freq_hz))
    groups = [range(i, min(i + _MODES_PER_FIGURE, most)) for i in range(0, most, _MODES_PER_FIGURE)]
    figures = [_picture(modes, frame, motion, group) for group in groups]
    return [*head, *simplified(kept), *figures, *_left(len(modes.freq_hz) - most)]


def simplified(kept: ModeShapes | None) -> list[Block]:
    """That a large mesh is drawn with fewer faces and lines; [] where it is drawn as it is."""
    sentence = kept.simplified if kept else ""
    return [Paragraph(as_sentence(sentence), "muted")] if sentence else []


def _why(kept: ModeShapes | None) -> str:
    return (kept.reason if kept else "") or "the shapes were not stored"


def parts_of(frame: Wireframe) -> int:
    """Size of its picture: number of lines and faces; a raster image counts the same for any number of faces."""
    return max(1, len(frame.lines) + min(len(frame.faces), VECTOR_FACES))


def _left(count: int) -> list[Block]:
    if count <= 0:
        return []
    words = f"{counted(count, 'more mode')} {'is' if count == 1 else 'are'} not drawn, to keep the page small."
    return [Paragraph(words, tone="muted")]


def _picture(modes: ModelModes, frame: Wireframe, motion: Reals, group: Sequence[int]) -> Figure:
    titles = [_picture_title(modes, i) for i in group]
    draw = partial(_draw_picture, frame, motion[:, :, group[0] : group[-1] + 1].astype(float), titles, group[0] == 0)
    return Figure(draw, "", f"Mode shapes of {modes.configuration}. {'; '.join(titles)}", wide=True)


def _picture_title(modes: ModelModes, i: int) -> str:
    what = "rigid body" if i < modes.rigid_body_modes else f"{freq(modes.freq_hz[i])} Hz"
    return f"{i + 1}: {what}"


def _draw_picture(frame: Wireframe, motion: Reals, titles: Sequence[str], axes: bool) -> str:
    panels = [ShapePanel(title, motion[:, :, k]) for k, title in enumerate(titles)]
    return shapes_svg(frame, panels, axes=axes)


_MODES_PER_FIGURE = 6
"""Modes in one figure: they must stay large enough to be compared."""
_MOST_DRAWN_PARTS = 24_000
"""Lines and faces in all drawings of a configuration: the page must stay small enough to be sent."""


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


def mode_shapes(source: ReportSource) -> list[Block]:
    """A heading and pictures for each configuration."""
    names = [c for c in source.results.study.configurations if source.before(c)]
    blocks = [block for name in names for block in _configuration(source, name)]
    return blocks or [Paragraph("Mode shapes: not available because modes were not compared.")]


def _configuration(source: ReportSource, name: str) -> list[Block]:
    kept = _last_kept(source, name)
    comparison = source.at(name, kept.stage) if kept else None
    if kept is None or comparison is None:
        return [Heading(name), Paragraph("The shapes were not stored.")]
    if kept.reason:
        return [Heading(name), Paragraph(f"Not drawn: {kept.reason}.")]
    drawn = _drawn(source, kept, comparison)
    if not comparison.pairs or drawn is None:
        why = "no mode is paired" if not comparison.pairs else "the test has no mode shapes"
        return [Heading(name), Paragraph(f"Not drawn: {why}.")]
    most = max(1, _MOST_DRAWN_PARTS // parts_of(drawn.frame))
    shown = comparison.pairs[:most]
    groups = [shown[i : i + _MODES_PER_FIGURE] for i in range(0, len(shown), _MODES_PER_FIGURE)]
    figures = (_figure(drawn, comparison, g, axes=g is groups[0]) for g in groups)
    return [Heading(name), *simplified(kept), *figures, *_rest(comparison, len(shown))]


def _last_kept(source: ReportSource, name: str) -> ModeShapes | None:
    kept = [m for m in source.results.mode_shapes if m.configuration == name]
    return kept[-1] if kept else None


def _rest(comparison: CorrelationResults, shown: int) -> list[Block]:
    left = len(comparison.pairs) - shown
    if not left:
        return []
    words = f"{counted(left, 'more paired mode')} {'is' if left == 1 else 'are'} not drawn, to keep the page small."
    return [Paragraph(words, tone="muted")]


def _drawn(source: ReportSource, kept: ModeShapes, comparison: CorrelationResults) -> _Drawn | None:
    keys = (
        kept.translations_key, kept.sensor_positions_key, kept.sensor_directions_key, kept.sensor_rotations_key,
        kept.test_shapes_key, kept.model_at_sensors_key,
    )  # fmt: skip
    arrays = [a for a in map(source.array, keys) if a is not None]
    frame = structure_of(source, kept)
    if frame is None or len(arrays) < len(keys):
        return None
    motion, seats, directions, rotations, test, seen = arrays
    return _Drawn(
        frame, motion.astype(float), seats.astype(float), directions.astype(float), rotations.astype(bool),
        test.astype(float), seen.astype(float), comparison.mac_test_labels,
    )  # fmt: skip


def _figure(drawn: _Drawn, comparison: CorrelationResults, pairs: Sequence[ModePairRecord], *, axes: bool) -> Figure:
    titles = [_title(p) for p in pairs]
    draw = partial(_draw, drawn, comparison, tuple(pairs), axes)
    return Figure(
        draw,
        "",
        f"Mode shapes of {comparison.configuration} {VERSION_WORDS[comparison.stage]}. {'; '.join(titles)}",
        wide=True,
    )


def _title(p: ModePairRecord) -> str:
    mac = NOT_TESTED if p.mac is None else unit_fraction(p.mac)
    return f"{p.test_label}: {p.model_freq_hz:.4g} Hz (test {p.test_freq_hz:.4g}), MAC {mac}"


def _draw(drawn: _Drawn, comparison: CorrelationResults, pairs: tuple[ModePairRecord, ...], axes: bool) -> str:
    return shapes_svg(drawn.frame, [_panel(drawn, comparison, p) for p in pairs], axes=axes)


def _panel(drawn: _Drawn, comparison: CorrelationResults, pair: ModePairRecord) -> ShapePanel:
    test = np.nan_to_num(drawn.test[:, drawn.rows.index(pair.test_label)])
    columns = _columns(comparison, pair)
    # modes of a cluster are drawn in the combination that is nearest to the test's shape
    mixture = np.linalg.lstsq(drawn.seen[:, columns], test, rcond=None)[0] if len(test) else np.ones(1)
    motion, seen = drawn.translations[:, :, columns] @ mixture, drawn.seen[:, columns] @ mixture
    factor = float(test @ seen / (test @ test)) if test.any() else 0.0
    places, measured = measured_motion(drawn, factor * test)
    return ShapePanel(_title(pair), motion, places, measured)


def _columns(comparison: CorrelationResults, pair: ModePairRecord) -> list[int]:
    cluster = next((c for c in comparison.clusters if c.cluster == pair.cluster), None)
    return [n - 1 for n in (cluster.model_numbers if cluster else (pair.model_number,))]


def measured_motion(drawn: _Drawn, values: Reals) -> tuple[Reals, Reals]:
    """Places and motion of what was measured, both (k, 3), see `measured_places`."""
    places, motions, _ = measured_places(drawn.frame, drawn.seats, drawn.directions, drawn.rotations)
    return places, motions @ values


def measured_places(
    frame: Wireframe, seats: Reals, directions: Reals, rotations: NDArray[np.bool_]
) -> tuple[Reals, Reals, NDArray[np.int64]]:
    """Places (k, 3) of the sensors, matrices (k, 3, sensors) from what they measure to the motion of each place, and
    the place of each sensor (sensors,), −1 where its position is not known.

    Sensors at one place are joined to a vector. A place with measured rotations that carries rigid elements moves
    their other ends as well.
    """
    places: list[Reals] = []
    motions: list[Reals] = []
    place_of = np.full(len(seats), -1)
    known = np.isfinite(seats).all(axis=1)
    for seat in np.unique(seats[known], axis=0):
        here = known & (seats == seat).all(axis=1)
        place_of[here] = len(places)
        shift, spin = (_vector(directions, here & of) for of in (~rotations, rotations))
        ends = _rigid_ends(frame, seat) if (here & rotations).any() else np.zeros((0, 3))
        places += [seat, *ends]
        motions += [shift, *(shift + np.cross(spin, end - seat, axis=0) for end in ends)]
    return np.array(places).reshape(-1, 3), np.array(motions).reshape(len(places), 3, len(seats)), place_of


def _vector(directions: Reals, rows: NDArray[np.bool_]) -> Reals:
    """(3, sensors) from values of sensors to the shortest vector that agrees with them along their directions."""
    out = np.zeros((3, len(rows)))
    out[:, rows] = np.linalg.pinv(directions[rows])
    return out


def _rigid_ends(frame: Wireframe, seat: Reals) -> Reals:
    tied = frame.lines[frame.rigid]
    at = np.flatnonzero((frame.points == seat).all(axis=1))
    ends = np.concatenate([tied[np.isin(tied[:, 0], at), 1], tied[np.isin(tied[:, 1], at), 0]])
    return frame.points[np.unique(ends)]
