"""Sections of the report: updated parameters with their uncertainty, and quantities derived from them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING

from femtune.document.document import Cell, Figure, Paragraph, Table, columns, row
from femtune.document.figures.parameters import ForestRow, forest_svg
from femtune.document.numbers import NONE, counted, listed, short, signed_percent, value

if TYPE_CHECKING:
    from femtune.document.document import Block
    from femtune.steps.posterior.record import PosteriorResults
    from femtune.steps.report_source import ReportSource
    from femtune.steps.update.record.update import DerivedResult, ParameterFacts, ParameterResult, PhysicalValue


def derived_quantities(quantities: Sequence[DerivedResult]) -> list[Block]:
    """A table of them; nothing where the study defines none."""
    heads = columns("Quantity", "Unit", ">Initial", ">Updated", ">± σ", ">95 %", "Expression")
    return [Table("Derived quantities", heads, tuple(_derived_row(d) for d in quantities))] if quantities else []


def _derived_row(quantity: DerivedResult) -> tuple[Cell, ...]:
    spread = Cell(short(quantity.sd)) if quantity.sd is not None else Cell(quantity.sd_reason, tone="poor")
    nominal, updated = ("not finite" if v is None else value(v) for v in (quantity.nominal, quantity.value))
    ends = interval_ends(quantity.interval_95)
    return row(quantity.name, quantity.unit or NONE, nominal, updated, spread, ends, quantity.expression)


def interval_ends(interval: tuple[float, float] | None) -> str:
    """The two ends of an interval."""
    return NONE if interval is None else " … ".join(value(end) for end in interval)


def physical_values(parameters: Sequence[ParameterResult], most: int | None = None) -> list[Block]:
    """A table of them; fields of one parameter with the same value and unit share a row."""
    rows = [r for p in parameters for r in _physical_rows(p)]
    heads = columns("Parameter", "Field", "Unit", ">Initial", ">Updated", ">95 %")
    more = 0 if most is None else len(rows) - most
    note = f"and {counted(more, 'more field')} in the section on parameters of the report" if more > 0 else ""
    return [Table("Physical values of the factors", heads, tuple(rows[:most]), note)] if rows else []


def _physical_rows(parameter: ParameterResult) -> Iterator[tuple[Cell, ...]]:
    alike: dict[tuple[float, str], list[PhysicalValue]] = {}
    for one in parameter.physical:
        alike.setdefault((one.nominal, one.unit), []).append(one)
    for same in alike.values():
        first = same[0]
        yield row(
            parameter.name, _named(tuple(one.field for one in same)), first.unit or NONE, value(first.nominal),
            value(first.value), interval_ends(first.interval_95),
        )  # fmt: skip


def interval_remarks(parameters: Sequence[ParameterResult]) -> list[Block]:
    """How intervals follow from the bounds, if some do."""
    cut, left_open = ([p.name for p in parameters if p.interval_kind == kind] for kind in ("truncated", "bounds"))
    said = []
    if cut or left_open:
        said.append(
            "The 95 % intervals are those of the distribution of the linearised problem, truncated to the bounds. They "
            "are equal-tailed, unless the value lies in a tail, as it does on a bound: there the tails differ so that "
            "the interval contains it."
        )
    if left_open:
        these = "its interval is" if len(left_open) == 1 else "their intervals are"
        said.append(f"The data hardly narrow {listed(left_open)}: {these} nearly as wide as the bounds allow.")
    return [Paragraph(" ".join(said))] if said else []


def sampled_remarks(posterior: PosteriorResults | None) -> list[Block]:
    """Where the sampled intervals are, and how wide they are beside these; nothing without samples."""
    if posterior is None:
        return []
    ratios = {
        p.parameter: (p.interval_95[1] - p.interval_95[0]) / (p.update_interval_95[1] - p.update_interval_95[0])
        for p in posterior.parameters
        if p.update_interval_95 is not None and p.update_interval_95[1] > p.update_interval_95[0]
    }
    text = "The study has a sampled distribution of the parameters, see Posterior distribution."
    if ratios:
        least, most = min(ratios.values()), max(ratios, key=lambda name: ratios[name])
        (one,) = (p for p in posterior.parameters if p.parameter == most)
        wide = f"{least:.2g}" if len(ratios) == 1 else f"{least:.2g} to {ratios[most]:.2g}"
        text += (
            f" Its 95 % intervals are {wide} times as wide as those of the update; that of {most} is "
            f"{interval_ends(one.interval_95)}."
        )
    return [Paragraph(text)]


_CAPTION = (
    "Each line runs from the lower to the upper bound. Grey: prior ± one standard deviation about the nominal value. "
    "Blue: the updated value ± one standard deviation; thin line: the 95 % interval. Orange square: at a bound, where "
    "no standard deviation is given."
)

_MOST_FIELDS = 6
"""Fields of a parameter that a cell lists, so that rows stay low."""


def parameters(source: ReportSource) -> list[Block]:
    """Forest plot and table."""
    facts, update = source.results.parameters, source.results.update
    if not facts:
        return [Paragraph("The study has no parameters.")]
    if update is None:
        return [Paragraph("The update was not run; these are the parameters of the study."), _table(facts, {})]
    results = {p.name: p for p in update.parameters}
    rows = [r for f in facts if (r := _forest_row(f, results.get(f.name))) is not None]
    return [
        *([_figure(rows)] if rows else []),
        _table(facts, results),
        *interval_remarks(update.parameters),
        *sampled_remarks(source.results.posterior),
        *physical_values(update.parameters),
        *derived_quantities(update.derived),
    ]


def _figure(rows: list[ForestRow]) -> Figure:
    alt = f"Updated parameters between their bounds: {listed(f'{r.name} {value(r.final)}' for r in rows)}"
    return Figure(partial(forest_svg, rows), _CAPTION, alt, wide=True)


def _forest_row(fact: ParameterFacts, result: ParameterResult | None) -> ForestRow | None:
    """None for tied parameters, which have no bounds of their own."""
    if result is None or fact.lower is None or fact.upper is None or fact.lower >= fact.upper:
        return None
    return ForestRow(
        name=fact.name,
        unit=fact.unit,
        lower=fact.lower,
        upper=fact.upper,
        nominal=fact.nominal,
        prior_sd=fact.prior_sd,
        final=result.value,
        sd=result.sd,
        at_bound=bool(result.at_bound),
        interval=result.interval_95,
    )


def _table(facts: tuple[ParameterFacts, ...], results: dict[str, ParameterResult]) -> Block:
    # factors have no unit: without the column the table fits its place
    units = any(f.unit for f in facts)
    heads = columns(
        "Parameter", *(("Unit",) if units else ()), ">Nominal", ">Updated", ">± σ", ">95 %", ">Change %", ">Bounds",
        ">Prior σ", "Fields or tie",
    )  # fmt: skip
    return Table("Values", heads, tuple(_row(f, results.get(f.name), units) for f in facts))


def _row(fact: ParameterFacts, result: ParameterResult | None, units: bool) -> tuple[Cell, ...]:
    return row(
        fact.name,
        *((fact.unit or NONE,) if units else ()),
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
    # with few degrees of freedom Student's t interval can be wider than the bounds
    if fact.lower is not None and fact.upper is not None and low < fact.lower and high > fact.upper:
        return "wider than the bounds"
    return interval_ends(result.interval_95)


def _fields(fact: ParameterFacts) -> str:
    named = _named(fact.fields)
    if fact.tie:
        return f"tied: {fact.tie}" + (f"; {named}" if named else "")
    return named + (f", in {fact.elements} elements" if fact.elements is not None else "") or "no field in the model"


def _named(fields: tuple[str, ...]) -> str:
    more = len(fields) - _MOST_FIELDS
    return ", ".join(fields[:_MOST_FIELDS]) + (f" and {more} more" if more > 0 else "")


def places(names: Sequence[str], values: Sequence[float], facts: Sequence[ParameterFacts]) -> list[float]:
    """0 at the lower bound, 1 at the upper one; a half where there are none."""
    by_name = {f.name: f for f in facts}
    return [_place(by_name.get(name), x) for name, x in zip(names, values, strict=True)]


def _place(fact: ParameterFacts | None, x: float) -> float:
    if fact is None or fact.lower is None or fact.upper is None or fact.lower >= fact.upper:
        return 0.5
    return (x - fact.lower) / (fact.upper - fact.lower)
