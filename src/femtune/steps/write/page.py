"""What was changed in the deck."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from femtune.document.document import Heading, Listing, Paragraph, Table, columns, row, table_or_none
from femtune.document.numbers import NONE, listed, typeset

if TYPE_CHECKING:
    from femtune.document.document import Block, Cell
    from femtune.steps.report_source import ReportSource
    from femtune.steps.write.record import EditedField, NewCardFacts, RepointedElements

_MOST_NUMBERS = 12
"""Numbers of elements that a cell lists, so that rows stay low."""


def write_back(source: ReportSource) -> list[Block]:
    """Every changed field with its old and new text, new cards with their values, elements that refer to them."""
    record = source.results.write_back
    no_deck = [a.sentence for a in source.results.alerts if a.code == "write.no-deck"]
    if record is None and no_deck:
        return [Paragraph(f"{no_deck[0][0].upper()}{no_deck[0][1:]}.")]
    if record is None:
        return [Paragraph("No updated deck was written.")]
    heads = columns("Card", "Field", "File and line", "Old text", "New text", ">Value", ">As written", "Parameter")
    written = listed(record.files) or "no file"
    return [
        Paragraph(f"Written: {written}. All other cards are copied from the original deck without change."),
        table_or_none("Changed fields", heads, map(_row, record.edits), "No field was changed."),
        *_new_cards(record.new_cards),
        *_repointed(record.repointed),
        *_sentences("Cards split", record.splits, "No card was split."),
        *_sentences("Parameters without a field", record.without_field, "Every parameter has a field in the deck."),
        *_sentences("INCLUDE lines", record.includes_changed, "No INCLUDE line was changed."),
    ]  # fmt: skip


def _row(e: EditedField) -> tuple[Cell, ...]:
    return row(
        e.card, e.field, f"{e.file}:{e.line}", e.old_text.strip() or "(blank)", e.new_text.strip(),
        _number(e.value), _number(e.rounded_value), e.parameter or NONE,
    )  # fmt: skip


def _number(value: float | None) -> str:
    return NONE if value is None else typeset(f"{value:.7g}")


def _new_cards(cards: Iterable[NewCardFacts]) -> list[Block]:
    """A row for each value in which a new card differs from its original."""
    heads = columns("New card", "Copy of", ">For elements", "Field", "Old text", ">Value", ">As written", "Parameter")
    rows = [
        row(
            c.card, c.copied_from, str(c.elements), v.field, v.old_text or "(blank)",
            _number(v.value), _number(v.rounded_value), v.parameter or NONE,
        )
        for c in cards
        for v in c.values
    ]  # fmt: skip
    return [Table("New cards", heads, tuple(rows))] if rows else []


def _repointed(groups: Iterable[RepointedElements]) -> list[Block]:
    rows = tuple(row(_refer(g), g.field, g.before or "(blank)", g.after, _numbers(g.elements)) for g in groups)
    heads = columns("Elements", "Field", "Before", "After", "Element IDs")
    return [Table("Elements that refer to a new card", heads, rows)] if rows else []


def _refer(group: RepointedElements) -> str:
    count = len(group.elements)
    return f"{count} {group.card} now {'refers' if count == 1 else 'refer'} to {group.after}"


def _numbers(numbers: tuple[int, ...]) -> str:
    shown, more = ", ".join(map(str, numbers[:_MOST_NUMBERS])), len(numbers) - _MOST_NUMBERS
    return f"{shown} and {more} more in results.json" if more > 0 else shown


def _sentences(title: str, sentences: tuple[str, ...], none: str) -> list[Block]:
    return [Heading(title), Listing(sentences)] if sentences else [Paragraph(none, tone="muted")]
