"""Which parameters, and which combinations, the data determine: in words first."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.report.document import Bar, Block, Cell, Figure, Listing, Paragraph, Table, columns, row
from femtune.report.figures.bars import combinations_svg, singular_values_svg
from femtune.report.figures.matrix import SIDE_BY_SIDE, MatrixPicture, matrix_svg
from femtune.report.numbers import NOT_TESTED, counted, listed, percent, short, value
from femtune.report.sections.measures import measures
from femtune.report.sections.sensitivities import page_table, sensitivities
from femtune.report.source import Source
from femtune.study.results_update import Combination, Identifiability, SelectionResults

_PANELS = 4


def identifiability(source: Source) -> list[Block]:
    """Sentences, a table, and pictures of singular values, combinations, correlation and sensitivities."""
    selection = source.results.selection
    if selection is None:
        return [Paragraph("Not tested: the selection step was not run.")]
    return [
        *_sentences(selection),
        parameter_table(selection),
        *page_table(selection),
        *_singular(selection),
        *_combinations(selection),
        *_correlation(source, selection),
        *sensitivities(source, selection),
        *measures(selection.measures),
    ]


def _lead(selection: SelectionResults) -> str:
    k, open_, weak = len(selection.column_labels), len(selection.undetermined), len(selection.weakly_determined)
    if not open_:
        head = f"The data say something about all {k} combinations of the {counted(k, 'free parameter')}"
    else:
        head = (
            f"The data determine {selection.rank} of {k} combinations of parameters; {counted(open_, 'combination')} "
            f"{'stays' if open_ == 1 else 'stay'} undetermined: the update cannot choose there, the prior does"
        )
    return f"{head}; {counted(weak, 'combination')} {'is' if weak == 1 else 'are'} weakly determined."


def _sentences(selection: SelectionResults) -> list[Block]:
    """The selection's own sentences, or ours where it gives none; each fact once."""
    first, *others = in_words(selection)
    return [Paragraph(first), *([Listing(tuple(others))] if others else [])]


def in_words(selection: SelectionResults) -> tuple[str, ...]:
    """The sentences of the selection, or ours where it has none; never empty."""
    return selection.sentences or (_lead(selection), *_own_words(selection))


def _own_words(selection: SelectionResults) -> list[str]:
    return [c.sentence for c in (*selection.undetermined, *selection.weakly_determined) if c.sentence]


def parameter_table(selection: SelectionResults) -> Table:
    """How much the data narrow each parameter."""
    heads = columns("Parameter", ">Posterior σ / prior σ", "Verdict")
    note = "0: the data alone decide. 1: the data add nothing to the prior."
    return Table("Parameter by parameter", heads, tuple(_row(p) for p in selection.parameters), note)


def _row(p: Identifiability) -> tuple[Cell, ...]:
    if p.sd_ratio is None:
        ratio = Cell(NOT_TESTED, tone="muted")
    else:
        ratio = Cell(percent(p.sd_ratio), Bar(0.0, max(0.0, min(1.0, p.sd_ratio))))
    return row(p.parameter, ratio, f"{p.verdict}: {p.sentence}" if p.sentence else p.verdict)


def _singular(selection: SelectionResults) -> list[Block]:
    if not selection.singular_values:
        return [Paragraph("Singular values: not tested.")]
    draw = partial(singular_values_svg, selection.singular_values, selection.rank)
    last = value(selection.singular_values[0])
    caption = (
        f"Singular values of the scaled Jacobian; the largest is {last}, "
        f"values below {short(selection.rank_threshold)} count as zero."
    )
    alt = f"Singular values of the scaled Jacobian: {listed(map(short, selection.singular_values))}"
    return [Figure(draw, caption, alt, wide=True)]


def _combinations(selection: SelectionResults) -> list[Block]:
    found = [(f"undetermined {i + 1}", c) for i, c in enumerate(selection.undetermined)]
    found += [(f"weak {i + 1}", c) for i, c in enumerate(selection.weakly_determined)]
    if not found:
        return []
    shown = found[:_PANELS]
    labels = selection.column_labels
    titles, coefficients = [title for title, _ in shown], [_coefficients(c, labels) for _, c in shown]
    draw = partial(combinations_svg, titles, labels, coefficients)
    more = f" The first {_PANELS} of {len(found)}." if len(found) > _PANELS else ""
    alt = "; ".join(f"{title}: {_shares(c)}" for title, c in shown)
    caption = f"Combinations of parameters that the data determine badly.{more}"
    return [Figure(draw, caption, f"Coefficients by parameter. {alt}")]


def _shares(combination: Combination) -> str:
    return listed(f"{s.parameter} {short(s.coefficient)}" for s in combination.shares)


def _coefficients(combination: Combination, labels: tuple[str, ...]) -> list[float]:
    shares = {s.parameter: s.coefficient for s in combination.shares}
    return [shares.get(name, 0.0) for name in labels]


def _correlation(source: Source, selection: SelectionResults) -> list[Block]:
    values = source.array(selection.correlation_key)
    if values is None or not values.size:
        return [Paragraph("Correlation of the parameters: not tested.")]
    labels = selection.column_labels
    draw = partial(matrix_svg, MatrixPicture(values, labels, labels, "", "", signed=True))
    caption = "Correlation of the parameters after the update. Near ±1: only a combination of the two is determined."
    alt = f"Correlation matrix of the parameters{_strongest(values, labels)}"
    return [Figure(draw, caption, alt, max(values.shape) > SIDE_BY_SIDE)]


def _strongest(values: NDArray[Any], labels: tuple[str, ...]) -> str:
    """The three largest coefficients off the diagonal."""
    rows, columns = np.triu_indices(len(values), 1)
    order = np.argsort(-np.abs(np.nan_to_num(values[rows, columns])), kind="stable")[:3]
    pairs = [f"{labels[rows[k]]} and {labels[columns[k]]} {short(float(values[rows[k], columns[k]]))}" for k in order]
    return f"; largest: {listed(pairs)}" if pairs else ""
