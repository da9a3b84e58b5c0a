"""A picture of each solved mode, where there is no test to compare with."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from femtune.report.document import Block, Figure, Heading, Paragraph
from femtune.report.figures.shapes import VECTOR_FACES, ShapePanel, Wireframe, shapes_svg
from femtune.report.numbers import counted, freq
from femtune.report.sections.structure import structure_of
from femtune.report.source import Source
from femtune.study.results_model import ModelModes
from femtune.study.results_shapes import ModeShapes

_A_FIGURE = 6
_MOST_PARTS = 80_000
"""Lines and faces in all pictures of the page: it must stay small enough to be sent."""

Reals = NDArray[np.float64]


def pictures(source: Source) -> list[Block]:
    """Pictures by configuration; those of the first modes where all would make the page too large."""
    found = source.results.modes
    return [block for modes in found for block in _configuration(source, modes, _MOST_PARTS // len(found))]


def _configuration(source: Source, modes: ModelModes, room: int) -> list[Block]:
    name = modes.configuration
    head: list[Block] = [Heading(name)] if len(source.results.modes) > 1 else []
    kept = next((m for m in source.results.mode_shapes if m.configuration == name), None)
    frame = None if kept is None or kept.reason else structure_of(source, kept)
    motion = None if kept is None else source.array(kept.translations_key)
    if frame is None or motion is None:
        return [*head, Paragraph(f"Not drawn: {_why(kept)}.")]
    most = min(max(1, room // parts_of(frame)), motion.shape[2], len(modes.freq_hz))
    groups = [range(i, min(i + _A_FIGURE, most)) for i in range(0, most, _A_FIGURE)]
    figures = [_figure(modes, frame, motion, group) for group in groups]
    return [*head, *simplified(kept), *figures, *_left(len(modes.freq_hz) - most)]


def simplified(kept: ModeShapes | None) -> list[Block]:
    """That a large mesh is drawn with fewer faces and lines; [] where it is drawn as it is."""
    sentence = kept.simplified if kept else ""
    return [Paragraph(f"{sentence[0].upper()}{sentence[1:]}.", "muted")] if sentence else []


def _why(kept: ModeShapes | None) -> str:
    return (kept.reason if kept else "") or "no shapes were kept"


def parts_of(frame: Wireframe) -> int:
    """How much a picture of it weighs: its lines and faces; pixels weigh the same however many faces they show."""
    return max(1, len(frame.lines) + min(len(frame.faces), VECTOR_FACES))


def _left(count: int) -> list[Block]:
    if count <= 0:
        return []
    words = f"{counted(count, 'more mode')} {'is' if count == 1 else 'are'} not drawn, to keep the page small."
    return [Paragraph(words, tone="muted")]


def _figure(modes: ModelModes, frame: Wireframe, motion: Reals, group: Sequence[int]) -> Figure:
    titles = [_title(modes, i) for i in group]
    draw = partial(_draw, frame, motion[:, :, group[0] : group[-1] + 1].astype(float), titles, group[0] == 0)
    return Figure(draw, "", f"Mode shapes of {modes.configuration}. {'; '.join(titles)}", wide=True)


def _title(modes: ModelModes, i: int) -> str:
    what = "rigid body" if i < modes.rigid_body_modes else f"{freq(modes.freq_hz[i])} Hz"
    return f"{i + 1}: {what}"


def _draw(frame: Wireframe, motion: Reals, titles: Sequence[str], axes: bool) -> str:
    panels = [ShapePanel(title, motion[:, :, k]) for k, title in enumerate(titles)]
    return shapes_svg(frame, panels, axes=axes)
