"""The damping that a deck describes."""

from __future__ import annotations

from femtune.report.document import Block, Paragraph, Table, columns, row
from femtune.report.numbers import value
from femtune.study.results_model import DampingFacts, DampingField, ModelFacts


def damping_blocks(facts: ModelFacts) -> list[Block]:
    """A line for the whole model, one for the modes, and a table by card and field; nothing where it is not known."""
    damping = facts.damping
    if damping is None:
        return []
    lines = [line for line in (_overall(damping), _modal(damping)) if line]
    blocks: list[Block] = [Paragraph(line) for line in lines]
    if damping.fields:
        return [*blocks, _table(damping.fields)]
    return blocks or [Paragraph("Damping: the deck describes none.", "muted")]


def _overall(damping: DampingFacts) -> str:
    """PARAM G, W3 and W4; a G of zero is told too, as an update may start there."""
    given = {"G": damping.overall_loss_factor, "W3": damping.overall_omega_rad_s, "W4": damping.element_omega_rad_s}
    units = {"G": "", "W3": " rad/s", "W4": " rad/s"}
    words = ", ".join(f"{name} = {value(x)}{units[name]}" for name, x in given.items() if x is not None)
    return f"Damping of the whole model: {words}." if words else ""


def _modal(damping: DampingFacts) -> str:
    return f"Damping of modes (SDAMPING), {damping.modal_damping}." if damping.modal_damping else ""


def _table(fields: tuple[DampingField, ...]) -> Table:
    rows = [row(f.field, f.kind, str(f.cards), _range(f), str(f.elements)) for f in fields]
    return Table("Damping", columns("Field", "Kind", ">Cards", ">Values", ">Elements"), tuple(rows))


def _range(field: DampingField) -> str:
    low, high = value(field.lowest), value(field.highest)
    return low if low == high else f"{low} to {high}"
