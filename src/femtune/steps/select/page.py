"""What the data determine: sections of the report on parameters and their combinations, tables on the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.document.document import (
    GAP,
    Bar,
    Cell,
    Details,
    Figure,
    Heading,
    Listing,
    Paragraph,
    Section,
    Table,
    column_groups,
    columns,
    row,
    widest,
)
from femtune.document.figures.bars import combinations_svg, singular_values_svg
from femtune.document.figures.matrix import SIDE_BY_SIDE, MatrixPicture, matrix_svg
from femtune.document.numbers import (
    NONE,
    NOT_TESTED,
    counted,
    freq,
    listed,
    percent,
    sensitivity,
    short,
    unit_fraction,
    value,
)
from femtune.steps.info.page import model_check_table
from femtune.steps.judge.page.missing import blocks_of

if TYPE_CHECKING:
    from femtune.document.document import Block, Document, Level
    from femtune.steps.report_source import ReportSource, Subject
    from femtune.steps.select.record.fisher import FisherResults, KnownParameter
    from femtune.steps.select.record.identifiability import CombinationRecord, SelectionResults
    from femtune.steps.select.record.identifiability import IdentifiabilityResults as Identifiability
    from femtune.steps.select.record.selection import GroupEnergy, ModeEnergies, SelectionMeasures

_MOST_MODES = 10
"""Modes side by side in the table of energies; more do not fit the width of a page."""


def measures(record: SelectionMeasures | None) -> list[Block]:
    """Sentences and tables; nothing for results without them."""
    if record is None:
        return []
    words = [Listing(record.sentences)] if record.sentences else []
    return [
        Heading("Selection of parameters"),
        *words,
        choice_table(record),
        *alike_table(record),
        *energy_tables(record),
    ]


def choice_table(record: SelectionMeasures) -> Table:
    """Order of the projection, and what the data know of each."""
    repeated = any(p.cosine_distance is not None for p in record.information)
    heads = columns(
        "Parameter", ">Order", ">Residual left %", "Chosen", ">p-value", ">σ alone", ">σ together", ">D-order",
        ">A-order", *([">Distance"] if repeated else []),
    )  # fmt: skip
    order = {s.parameter: i for i, s in enumerate(record.subset)}
    rows = []
    for p in sorted(record.information, key=lambda p: order.get(p.parameter, len(order))):
        at = order.get(p.parameter)
        step = None if at is None else record.subset[at]
        taken = (NONE, NONE, "no independent effect", NONE) if step is None or at is None else (
            str(at + 1), percent(step.left_percent), "yes" if step.chosen else "no", _chance(step.p_value))  # fmt: skip
        sds = short(p.sd_alone), short(p.sd_together)
        distance = (short(p.cosine_distance),) if repeated else ()
        rows.append(row(p.parameter, *taken, *sds, str(p.d_rank), str(p.a_rank), *distance))
    note = (
        "Order: rank by contribution to the reduction of the residual (orthogonal projection). Chosen: this reduction "
        "and all before it are significant. p-value: probability that noise alone gives the best of the remaining "
        "candidates a larger F value; it must be below 5 % (–: not tested, because an earlier one is not). σ alone, "
        "σ together: standard deviation relative to the prior if all other parameters are known, and if all are "
        "unknown (– if other parameters have the same effect)."
    )
    if repeated:
        note += (
            " Distance: 1 − cosine between the scaled sensitivities and the covariance of the repeated tests; near 0 "
            "for a parameter that varies."
        )
    return Table("Choice of parameters", heads, tuple(rows), note)


def _chance(p: float | None) -> str:
    return NONE if p is None else "< 1e-6" if p < 1e-6 else short(p)


def alike_table(record: SelectionMeasures) -> list[Block]:
    """Parameters that do nearly the same."""
    rows = [row(f"{p.first}, {p.second}", unit_fraction(p.cosine), NONE) for p in record.pairs]
    rows += [row(", ".join(d.parameters), NONE, short(d.condition_index, "∞")) for d in record.dependences]
    heads = columns("Parameters", ">Cosine", ">Condition index")
    index = short(record.collinearity_index, "∞")
    note = f"Collinearity index of all: {index} (1: all independent; above 15: the data cannot determine all of them)."
    return [Table("Parameters with similar effects", heads, tuple(rows), note)] if rows else []


def energy_tables(record: SelectionMeasures) -> list[Block]:
    """A table for each of the first modes."""
    shown = record.energies[:_MOST_MODES]
    more = len(record.energies) - len(shown)
    tables: list[Block] = [_energy(mode) for mode in shown]
    return [*tables, *([Listing((f"The results contain {more} more modes.",))] if more > 0 else [])]


def _energy(mode: ModeEnergies) -> Table:
    heads = columns("Group", ">Strain energy %", ">Kinetic energy %", ">Residual energy %")
    title = f"Energies: {mode.configuration}, mode {mode.test_label} ({freq(mode.freq_hz)} Hz)"
    note = ""
    if mode.contradiction_percent is not None:
        share = short(mode.contradiction_percent)
        note = f"√(residual energy / strain energy of the expanded mode): {share} %."
    return Table(title, heads, tuple(map(_group, mode.groups)), note)


def _group(g: GroupEnergy) -> tuple[Cell, ...]:
    return row(g.group, percent(g.strain_percent), percent(g.kinetic_percent), percent(g.residual_percent))


_MOST_RESIDUALS = 60
"""Residuals in the pictures of the Jacobian, those with the largest norms: weak rows show nothing."""
_RESIDUALS_PER_PICTURE = 30
"""Residuals in one picture: the labels of more rows are not legible."""
_MOST_TABLE_COLUMNS = 12
"""Parameters up to which the sensitivities are also a table; more do not fit the width of a page."""
_MOST_TABLE_ROWS = 40
"""Residuals up to which the sensitivities are also a table: a longer one is not read."""
_CAPTION = (
    "Scaled sensitivities: change of each residual for a change of one prior standard deviation of a parameter. "
    "Residuals with several values, such as a shape, are shown by the root sum of squares."
)


def sensitivities(source: ReportSource, selection: SelectionResults) -> list[Block]:
    """Pictures that fit a page; of many residuals the strongest."""
    values = source.array(selection.jacobian_key)
    if values is None or not values.size:
        return [Paragraph("Sensitivities: not tested.")]
    labels, joined = joined_rows(selection.row_labels, values)
    strongest = np.sort(np.argsort(-np.linalg.norm(joined, axis=1), kind="stable")[:_MOST_RESIDUALS])
    limit = float(np.abs(joined).max()) or 1.0
    parts = [strongest[i : i + _RESIDUALS_PER_PICTURE] for i in range(0, len(strongest), _RESIDUALS_PER_PICTURE)]
    some = f" The {_MOST_RESIDUALS} largest of {len(joined)} are shown." if len(joined) > _MOST_RESIDUALS else ""
    captions = [*[""] * (len(parts) - 1), _CAPTION + some]
    names = selection.column_labels
    return [
        _figure(joined[rows], tuple(labels[i] for i in rows), names, limit, caption)
        for rows, caption in zip(parts, captions, strict=True)
    ]


def page_table(selection: SelectionResults) -> list[Block]:
    """The table of the frequencies where it fits a page; the pictures show the others."""
    fits = len(selection.column_labels) <= _MOST_TABLE_COLUMNS and len(selection.sensitivities) <= _MOST_TABLE_ROWS
    return [frequency_table(selection, selection.column_labels)] if fits and selection.sensitivities else []


def frequency_table(selection: SelectionResults, names: Sequence[str]) -> Table:
    """Change of each compared frequency in % for 1 % of the parameters `names`."""
    heads = columns("Configuration", "Mode", *(f">{name}" for name in names))
    places = [selection.column_labels.index(name) for name in names]
    rows = [
        row(s.configuration, s.test_label, *(_number(s.percent_per_percent[i]) for i in places))
        for s in selection.sensitivities
    ]
    title = "Change of the model's frequencies in % for a change of 1 % of the initial value of the parameter"
    note = "If the initial value is zero (an amplitude, for example), the change is 1 % of the width of the bounds."
    return Table(title, heads, tuple(rows), note)


def _number(value: float) -> Cell:
    text = sensitivity(value)
    return Cell(text, tone="muted" if text == "0" else "")


def joined_rows(labels: tuple[str, ...], values: NDArray[Any]) -> tuple[list[str], NDArray[np.float64]]:
    """Rows of one label joined: a single one as it is, several by the root of their sum of squares."""
    rows: dict[str, list[int]] = {}
    for i, label in enumerate(labels):
        rows.setdefault(label, []).append(i)
    rows_joined = [values[at[0]] if len(at) == 1 else np.linalg.norm(values[at], axis=0) for at in rows.values()]
    return list(rows), np.array(rows_joined)


def _figure(
    values: NDArray[np.float64], rows: tuple[str, ...], columns: tuple[str, ...], limit: float, caption: str
) -> Figure:
    picture = MatrixPicture(values, rows, columns, "", "", signed=True, limit=limit)
    i, j = np.unravel_index(int(np.abs(values).argmax()), values.shape)
    alt = (
        f"Scaled sensitivities, {counted(len(rows), 'row')}; the largest is {short(float(values[i, j]))}, "
        f"{rows[i]} to {columns[j]}"
    )
    return Figure(partial(matrix_svg, picture), caption, alt, wide=True)


_MOST_PANELS = 4
"""Combinations of parameters in the figure: they must stay large enough to be read."""


def identifiability(source: ReportSource) -> list[Block]:
    """Sentences, a table, and pictures of singular values, combinations, correlation and sensitivities."""
    selection = source.results.selection
    if selection is None:
        return [Paragraph("Not tested: the selection step was not run.")]
    return [
        *_sentences(selection),
        parameter_table(selection),
        *fisher_blocks(selection.fisher, None if source.results.update is None else source.results.update.fisher),
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
        head = f"The data determine all {k} combinations of the {counted(k, 'free parameter')}"
    else:
        head = (
            f"The data determine {selection.rank} of {k} combinations of parameters; {counted(open_, 'combination')} "
            f"{'is' if open_ == 1 else 'are'} undetermined by the data and remain at the prior"
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
    note = (
        "Ratio 0: determined by the data alone. Ratio 1: the data add no information to the prior. The prior is taken "
        "as normal here; the standard deviation of an update also takes the bounds into account and can be smaller."
    )
    return Table("Parameter by parameter", heads, tuple(_row(p) for p in selection.parameters), note)


def fisher_blocks(before: FisherResults | None, after: FisherResults | None = None) -> list[Block]:
    """Expected standard deviations from the FRFs alone, before and after the update; nothing for other studies."""
    if before is None:
        return []
    last = after or before
    noise = (
        "noise as large as the errors of the identification, followed through identification and equalised damping"
        if last.measured
        else "the stated standard deviations of the FRFs"
    )
    note = (
        f"From {noise}, by linearisation, without prior and bounds. Together: all parameters are unknown "
        "(∞: the data leave the parameter open). Alone: all others are known. Known: below a third of the prior's "
        "standard deviation."
    )
    heads = ["Parameter", ">Together before, %", ">Alone before, %"]
    heads += [">Together after, %", ">Alone after, %"] if after is not None else []
    ends = {p.parameter: p for p in after.parameters} if after is not None else {}
    rows = [_fisher_row(p, ends.get(p.parameter), after is not None) for p in before.parameters]
    title = "Expected standard deviations from the FRFs, in % of the parameter"
    return [Listing(last.sentences), Table(title, columns(*heads, "Known"), tuple(rows), note)]


def _fisher_row(p: KnownParameter, end: KnownParameter | None, *both: bool) -> tuple[Cell, ...]:
    values = [short(p.sd_percent, "∞"), short(p.sd_alone_percent, "∞")]
    if any(both):
        values += [NONE, NONE] if end is None else [short(end.sd_percent, "∞"), short(end.sd_alone_percent, "∞")]
    return row(p.parameter, *values, "yes" if (end or p).known else Cell("no", tone="poor"))


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
        f"Singular values of the scaled Jacobian; the largest is {last}. Those after the first {selection.rank} are "
        "treated as zero."
        if selection.rank < len(selection.singular_values)
        else f"Singular values of the scaled Jacobian; the largest is {last}."
    )
    alt = f"Singular values of the scaled Jacobian: {listed(map(short, selection.singular_values))}"
    return [Figure(draw, caption, alt, wide=True)]


def _combinations(selection: SelectionResults) -> list[Block]:
    combinations = [(f"undetermined {i + 1}", c) for i, c in enumerate(selection.undetermined)]
    combinations += [(f"weak {i + 1}", c) for i, c in enumerate(selection.weakly_determined)]
    if not combinations:
        return []
    shown = combinations[:_MOST_PANELS]
    labels = selection.column_labels
    titles, coefficients = [title for title, _ in shown], [_coefficients(c, labels) for _, c in shown]
    draw = partial(combinations_svg, titles, labels, coefficients)
    more = f" The first {_MOST_PANELS} of {len(combinations)}." if len(combinations) > _MOST_PANELS else ""
    alt = "; ".join(f"{title}: {_shares(c)}" for title, c in shown)
    caption = f"Combinations of parameters that the data determine weakly or not at all.{more}"
    return [Figure(draw, caption, f"Coefficients by parameter. {alt}")]


def _shares(combination: CombinationRecord) -> str:
    return listed(f"{s.parameter} {short(s.coefficient)}" for s in combination.shares)


def _coefficients(combination: CombinationRecord, labels: tuple[str, ...]) -> list[float]:
    shares = {s.parameter: s.coefficient for s in combination.shares}
    return [shares.get(name, 0.0) for name in labels]


def _correlation(source: ReportSource, selection: SelectionResults) -> list[Block]:
    values = source.array(selection.correlation_key)
    if values is None or not values.size:
        return [Paragraph("Correlation of the parameters: not tested.")]
    labels = selection.column_labels
    draw = partial(matrix_svg, MatrixPicture(values, labels, labels, "", "", signed=True))
    caption = (
        "Correlation of the parameters after the update. If a value is near ±1, only a combination of the two "
        "parameters is determined."
    )
    alt = f"Correlation matrix of the parameters{_strongest(values, labels)}"
    return [Figure(draw, caption, alt, max(values.shape) > SIDE_BY_SIDE)]


def _strongest(values: NDArray[Any], labels: tuple[str, ...]) -> str:
    """The three largest coefficients off the diagonal."""
    rows, columns = np.triu_indices(len(values), 1)
    order = np.argsort(-np.abs(np.nan_to_num(values[rows, columns])), kind="stable")[:3]
    pairs = [f"{labels[rows[k]]} and {labels[columns[k]]} {short(float(values[rows[k], columns[k]]))}" for k in order]
    return f"; largest: {listed(pairs)}" if pairs else ""


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
        Section("missing", "Fields of the deck that are no parameters", missing_of_select(selection)),
        Section("model", "Checks of the model before the update", tuple(model_check_table(selection.model_checks))),
        Section("combinations", "Undetermined and weak combinations", tuple(_open_and_weak(selection))),
    )
    return subject.document(first, level, sections)


def missing_of_select(selection: SelectionResults) -> tuple[Block, ...]:
    """Fields that are no parameters, without the heading, which the section has.

    Lines for the study are shown one by one, since a terminal folds nothing.
    """
    if selection.missing is None:
        return ()
    _, *blocks = blocks_of(selection.missing, {})
    lines = [
        Paragraph(text) for d in blocks if isinstance(d, Details) for text in (f"{d.summary}:", *d.text.split("\n"))
    ]
    return *(block for block in blocks if not isinstance(block, Details)), *lines


def _listing(sentences: list[str]) -> tuple[Block, ...]:
    return (Listing(tuple(sentences)),) if sentences else ()


def _sensitivities(selection: SelectionResults) -> list[Block]:
    """Groups of columns one below the other where the parameters are many."""
    sensitivities = selection.sensitivities
    if not sensitivities:
        return [Paragraph("Frequencies are not compared.", "muted")]
    taken = widest(["Configuration", *(s.configuration for s in sensitivities)]) + GAP
    taken += widest(["Mode", *(s.test_label for s in sensitivities)])
    groups = column_groups(selection.column_labels, taken, _NUMBER)
    return [frequency_table(selection, names) for names in groups]


def _singular_values(selection: SelectionResults) -> Block:
    if not selection.singular_values:
        return Paragraph("Singular values: not tested.", "muted")
    words = ", ".join(map(short, selection.singular_values))
    open_ = len(selection.singular_values) - selection.rank
    zero = f"; the last {open_} {'is' if open_ == 1 else 'are'} treated as zero" if open_ else ""
    return Paragraph(f"Singular values of the scaled Jacobian: {words}{zero}.")


def _open_and_weak(selection: SelectionResults) -> list[Block]:
    rows = [_combination_row("undetermined", c) for c in selection.undetermined]
    rows += [_combination_row("weak", c) for c in selection.weakly_determined]
    heads = columns("", ">Singular value", ">Posterior σ / prior σ", "Combination")
    note = f"{counted(selection.rank, 'combination')} of {len(selection.column_labels)} are determined by the data."
    return [Table("", heads, tuple(rows), note)] if rows else []


def _combination_row(kind: str, c: CombinationRecord) -> tuple[Cell, ...]:
    return row(kind, short(c.singular_value), percent(c.sd_ratio), c.sentence)
