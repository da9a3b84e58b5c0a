"""COMAC by measured DOF."""

from __future__ import annotations

from functools import partial

from femtune.report.document import Block, Figure, FigureRow, Paragraph
from femtune.report.figures.bars import comac_svg
from femtune.report.numbers import listed, unit_fraction
from femtune.report.source import Source
from femtune.study.results_correlation import CorrelationResults

_SHOWN = 40
_NAMED = 5


def comac(source: Source) -> list[Block]:
    """A picture each configuration; of many DOFs the worst."""
    names = [c for c in source.results.study.configurations if source.before(c)]
    blocks = [_configuration(source, name) for name in names]
    figures = tuple(b for b in blocks if isinstance(b, Figure))
    said = [b for b in blocks if isinstance(b, Paragraph)]
    if not blocks:
        return [Paragraph("COMAC: not tested, modes were not compared.")]
    return [*([FigureRow(figures)] if figures else []), *said]


def _configuration(source: Source, name: str) -> Figure | Paragraph:
    before, after = _values(source.before(name)), _values(source.after(name))
    last = after or before
    if not last:
        return Paragraph(f"{name}, COMAC: not tested (it takes shapes of at least two paired modes).")
    worst = sorted(last, key=lambda dof: last[dof])[:_SHOWN]
    dofs = [dof for dof in last if dof in set(worst)]
    draw = partial(comac_svg, dofs, [before.get(d) for d in dofs], [after.get(d) for d in dofs])
    some = f", the {_SHOWN} lowest of {len(last)} DOFs" if len(last) > _SHOWN else ""
    caption = f"{name}{some}. Lowest: {listed(f'{unit_fraction(last[d])} at {d}' for d in worst[:_NAMED])}."
    return Figure(draw, caption, f"COMAC by measured DOF, {listed(f'{d} {unit_fraction(last[d])}' for d in dofs)}")


def _values(stage: CorrelationResults | None) -> dict[str, float]:
    return {entry.dof: entry.comac for entry in stage.comac} if stage else {}
