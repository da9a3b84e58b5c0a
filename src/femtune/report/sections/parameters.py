"""Parameters with their uncertainty."""

from __future__ import annotations

from functools import partial

from femtune.report.document import Block, Cell, Figure, Paragraph, Table, columns, row
from femtune.report.figures.forest import ForestRow, forest_svg
from femtune.report.numbers import NONE, listed, short, signed_percent, value
from femtune.report.sections.derived import derived_quantities
from femtune.report.source import Source
from femtune.study.results_update import ParameterFacts, ParameterResult

_CAPTION = (
    "Each line runs from the lower to the upper bound. Grey: prior ± one standard deviation about the nominal value. "
    "Blue: the updated value ± one standard deviation. Orange square: at a bound, where no standard deviation is given."
)

_MOST_FIELDS = 6


def parameters(source: Source) -> list[Block]:
    """Forest plot and table."""
    facts, update = source.results.parameters, source.results.update
    if not facts:
        return [Paragraph("The study has no parameters.")]
    if update is None:
        return [Paragraph("The update was not run; these are the parameters of the study."), _table(facts, {})]
    results = {p.name: p for p in update.parameters}
    rows = [r for f in facts if (r := _forest_row(f, results.get(f.name))) is not None]
    return [*([_figure(rows)] if rows else []), _table(facts, results), *derived_quantities(update.derived)]


def _figure(rows: list[ForestRow]) -> Figure:
    alt = f"Updated parameters between their bounds: {listed(f'{r.name} {value(r.final)}' for r in rows)}"
    return Figure(partial(forest_svg, rows), _CAPTION, alt, wide=True)


def _forest_row(fact: ParameterFacts, result: ParameterResult | None) -> ForestRow | None:
    """None for tied parameters, which have no bounds of their own."""
    if result is None or fact.lower is None or fact.upper is None or fact.lower >= fact.upper:
        return None
    return ForestRow(
        fact.name, fact.unit, fact.lower, fact.upper, fact.nominal, fact.prior_sd,
        result.value, result.sd, bool(result.at_bound),
    )  # fmt: skip


def _table(facts: tuple[ParameterFacts, ...], results: dict[str, ParameterResult]) -> Block:
    heads = columns(
        "Parameter",
        "Unit",
        ">Nominal",
        ">Updated",
        ">± σ",
        ">95 %",
        ">Change %",
        ">Bounds",
        ">Prior σ",
        "Fields, or tie",
    )  # fmt: skip
    return Table("Values", heads, tuple(_row(f, results.get(f.name)) for f in facts))


def _row(fact: ParameterFacts, result: ParameterResult | None) -> tuple[Cell, ...]:
    return row(
        fact.name,
        fact.unit or NONE,
        value(fact.nominal),
        value(result.value) if result else "not updated",
        _spread(result),
        _interval(fact, result),
        signed_percent(result.change_percent) if result else NONE,
        f"{value(fact.lower)} … {value(fact.upper)}" if fact.lower is not None else NONE,
        short(fact.prior_sd),
        _fields(fact),
    )


def _spread(result: ParameterResult | None) -> Cell:
    if result is None:
        return Cell(NONE)
    if result.sd is None:
        return Cell(result.sd_reason or "not given", tone="poor")
    return Cell(short(result.sd))


def _interval(fact: ParameterFacts, result: ParameterResult | None) -> str:
    if result is None or result.interval_95 is None:
        return NONE
    low, high = result.interval_95
    # few data left over to estimate a scatter from: Student's t then says less than the bounds did
    if fact.lower is not None and fact.upper is not None and low < fact.lower and high > fact.upper:
        return "wider than the bounds"
    return " … ".join(value(end) for end in result.interval_95)


def _fields(fact: ParameterFacts) -> str:
    named = _named(fact.fields)
    if fact.tie:
        return f"tied: {fact.tie}" + (f"; {named}" if named else "")
    return named + (f", in {fact.elements} elements" if fact.elements is not None else "") or "no field of the model"


def _named(fields: tuple[str, ...]) -> str:
    more = len(fields) - _MOST_FIELDS
    return ", ".join(fields[:_MOST_FIELDS]) + (f" and {more} more" if more > 0 else "")
