"""What the data determine: sentences, sensitivities, parameters, combinations."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.document.document import Listing, Paragraph, Section, Table, columns, row
from femtune.document.numbers import counted, percent, short
from femtune.steps.info.page import model_check_table
from femtune.steps.info.terminal import COLUMN_GAP, column_groups, widest
from femtune.steps.select.page import fisher_blocks, frequency_table, in_words, measures, parameter_table

if TYPE_CHECKING:
    from femtune.document.document import Block, Cell, Document, Level
    from femtune.steps.info.terminal import Subject
    from femtune.steps.select.record.identifiability import CombinationRecord, SelectionResults

_NUMBER = len("−0.000")


def selection_document(subject: Subject, selection: SelectionResults) -> Document:
    """The verdict is the first sentence of the selection."""
    first, *others = in_words(selection)
    level: Level = "warning" if selection.undetermined else "info"
    sections = (
        Section("words", "Combinations of parameters", _listing(others)),
        Section("sensitivities", "Sensitivities", tuple(_sensitivities(selection))),
        Section("parameters", "Parameters", (parameter_table(selection), _singular_values(selection))),
        Section("expected", "Expected standard deviations", tuple(fisher_blocks(selection.fisher))),
        Section("choice", "Choice of parameters", tuple(measures(selection.measures)[1:])),
        Section("model", "Checks of the model before the update", tuple(model_check_table(selection.model_checks))),
        Section("combinations", "Undetermined and weak combinations", tuple(_combinations(selection))),
    )
    return subject.document(first, level, sections)


def _listing(sentences: list[str]) -> tuple[Block, ...]:
    return (Listing(tuple(sentences)),) if sentences else ()


def _sensitivities(selection: SelectionResults) -> list[Block]:
    """Groups of columns one below the other where the parameters are many."""
    found = selection.sensitivities
    if not found:
        return [Paragraph("Frequencies are not compared.", "muted")]
    taken = widest(["Configuration", *(s.configuration for s in found)]) + COLUMN_GAP
    taken += widest(["Mode", *(s.test_label for s in found)])
    groups = column_groups(selection.column_labels, taken, _NUMBER)
    return [frequency_table(selection, names) for names in groups]


def _singular_values(selection: SelectionResults) -> Block:
    if not selection.singular_values:
        return Paragraph("Singular values: not tested.", "muted")
    words = ", ".join(map(short, selection.singular_values))
    open_ = len(selection.singular_values) - selection.rank
    zero = f"; the last {open_} {'is' if open_ == 1 else 'are'} treated as zero" if open_ else ""
    return Paragraph(f"Singular values of the scaled Jacobian: {words}{zero}.")


def _combinations(selection: SelectionResults) -> list[Block]:
    rows = [_row("undetermined", c) for c in selection.undetermined]
    rows += [_row("weak", c) for c in selection.weakly_determined]
    heads = columns("", ">Singular value", ">Posterior σ / prior σ", "Combination")
    note = f"{counted(selection.rank, 'combination')} of {len(selection.column_labels)} are determined by the data."
    return [Table("", heads, tuple(rows), note)] if rows else []


def _row(kind: str, c: CombinationRecord) -> tuple[Cell, ...]:
    return row(kind, short(c.singular_value), percent(c.sd_ratio), c.sentence)
