"""What was changed in the deck."""

from __future__ import annotations

from femtune.report.document import Block, Cell, Heading, Listing, Paragraph, columns, row, table_or_none
from femtune.report.numbers import NONE, listed, typeset
from femtune.report.source import Source
from femtune.study.results_update import EditedField


def write_back(source: Source) -> list[Block]:
    """Every changed field with its old and new text."""
    found = source.results.write_back
    if found is None:
        return [Paragraph("Not run: no updated deck was written.")]
    heads = columns("Card", "Field", "Place", "Old text", "New text", ">Value", ">As written", "Parameter")
    return [
        Paragraph(f"Written: {listed(found.files) or 'no file'}. Only the fields below differ from the user's deck."),
        table_or_none("Changed fields", heads, map(_row, found.edits), "No field was changed."),
        *_sentences("Cards split", found.splits, "No card was split."),
        *_sentences("Parameters without a field", found.without_field, "Every parameter has a field in the deck."),
        *_sentences("INCLUDE lines", found.includes_changed, "No INCLUDE line was changed."),
    ]  # fmt: skip


def _row(e: EditedField) -> tuple[Cell, ...]:
    return row(
        e.card, e.field, f"{e.file}:{e.line}", e.old_text.strip() or "(blank)", e.new_text.strip(),
        typeset(f"{e.value:.7g}"), typeset(f"{e.rounded_value:.7g}"), e.parameter or NONE,
    )  # fmt: skip


def _sentences(title: str, sentences: tuple[str, ...], none: str) -> list[Block]:
    return [Heading(title), Listing(sentences)] if sentences else [Paragraph(none, tone="muted")]
