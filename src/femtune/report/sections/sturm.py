"""Was a mode missed: eigenvalues counted by the signs of the pivots beside those that were found."""

from __future__ import annotations

from collections.abc import Sequence

from femtune.report.document import Block, Cell, Paragraph, Table, columns, row
from femtune.report.numbers import NONE, NOT_TESTED, freq, listed
from femtune.report.source import Source
from femtune.study.results_base import Stage
from femtune.study.results_model import ModelModes

_STAGES: dict[Stage, str] = {"before": "before", "after": "after", "after as written": "written deck"}


def sturm(source: Source) -> list[Block]:
    """A table of numbers, and one sentence on what they say."""
    found = source.results.modes
    if not found:
        return [Paragraph("Modes were not solved: not run.")]
    heads = columns("Configuration", "Stage", ">Modes", ">Rigid-body", ">Shift Hz", ">Found below it", ">Counted")
    return [
        Table("Was a mode missed? (Sturm count)", heads, tuple(map(_row, found)), _sentence(found)),
        *solved_by(found),
    ]


def solved_by(found: Sequence[ModelModes]) -> list[Block]:
    """Who solved the modes, a line; [] in results of before it was kept."""
    names = dict.fromkeys(m.solver for m in found if m.solver)
    return [Paragraph(f"Solved by: {'; '.join(names)}.", "muted")] if names else []


def _row(m: ModelModes) -> tuple[Cell, ...]:
    below = NONE if m.modes_below_shift is None else str(m.modes_below_shift)
    counted = Cell(NOT_TESTED, tone="muted") if m.sturm_count is None else Cell(str(m.sturm_count))
    if m.sturm_count is not None and m.sturm_count != m.modes_below_shift:
        counted = Cell(counted.text, tone="poor")
    return row(
        m.configuration, _STAGES[m.stage], str(len(m.freq_hz)), str(m.rigid_body_modes),
        freq(m.sturm_shift_hz), below, counted,
    )  # fmt: skip


def _sentence(found: tuple[ModelModes, ...]) -> str:
    """That nothing is missing, or where it may be and where nobody counted."""
    missed = [_place(m) for m in found if m.sturm_count is not None and m.sturm_count != m.modes_below_shift]
    untested = {_place(m): m.sturm_sentence.removeprefix("not tested: ") for m in found if m.sturm_count is None}
    why = "; ".join(dict.fromkeys(reason for reason in untested.values() if reason))
    parts = [
        f"The counts differ in {listed(missed)}: a mode may have been missed." if missed else "",
        f"Not tested in {listed(untested)}{f': {why}' if why else ''}." if untested else "",
    ]
    good = "No mode was missed: the signs of the pivots count as many eigenvalues below each shift as were found."
    return " ".join(p for p in parts if p) or good


def _place(m: ModelModes) -> str:
    return f"{m.configuration} ({_STAGES[m.stage]})"
