"""A global search, its convergence, and the accuracy of the surrogate: sections of the report and terminal."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from femtune.document.alert_boxes import alert_boxes
from femtune.document.document import (
    Cell,
    Figure,
    KeyNumber,
    KeyNumbers,
    Listing,
    Paragraph,
    Section,
    Table,
    columns,
    row,
)
from femtune.document.figures.effects import front_svg, search_svg
from femtune.document.numbers import NONE, counted, short, value

if TYPE_CHECKING:
    from femtune.document.document import Block, Document, Level
    from femtune.steps.report_source import ReportSource, Subject
    from femtune.steps.search.record import GlobalSearchResults, SurrogateFacts


_MOST_DRAWN = 6
"""Searches whose convergence is drawn: the curves of more cover each other."""


def _of(source: ReportSource) -> GlobalSearchResults:
    assert source.results.search is not None
    return source.results.search


def search_summary(source: ReportSource) -> list[Block]:
    """Numbers, sentences, and what should be known."""
    return summary_blocks(_of(source))


def summary_blocks(search: GlobalSearchResults) -> list[Block]:
    """Numbers, sentences, and alerts, for page and terminal."""
    alerts = alert_boxes(search.alerts)
    numbers = KeyNumbers(
        (
            KeyNumber(
                "χ²", short(search.chi2_initial), short(search.chi2), remark=counted(search.residuals, "residual")
            ),
            KeyNumber("Runs of the model", str(search.runs), remark=f"{search.method} on the {search.on}"),
        )
    )
    return [numbers, Listing((*search.sentences, f"{search.status}: {search.message}.")), *alerts]


def search_parameters(source: ReportSource) -> list[Block]:
    """The table of parameters."""
    return [parameter_table(_of(source))]


def parameter_table(search: GlobalSearchResults) -> Table:
    """A line each parameter."""
    known = any(p.variance_total is not None for p in search.parameters)
    extra = (">Variance alone", ">Total") if known else ()
    heads = columns("Parameter", "Unit", ">Lower", ">Upper", ">Initial", ">Found", ">Value", *extra, "")
    rows = tuple(
        row(
            p.name, p.unit, value(p.lower), value(p.upper), value(p.initial), value(p.found), value(p.value),
            *((_share(p.variance_alone), _share(p.variance_total)) if known else ()),
            Cell("at its bound", tone="poor") if p.at_bound else "",
        )
        for p in search.parameters
    )  # fmt: skip
    note = "Variance: part of that of all residuals over the box which the parameter explains alone, and with others."
    return Table("", heads, rows, note if known else "")


def _share(part: float | None) -> str:
    return NONE if part is None else f"{100.0 * part:.1f} %"


def search_convergence(source: ReportSource) -> list[Block]:
    """The picture, and a line each seed."""
    search, history = _of(source), source.arrays[_of(source).history_key]
    lines = []
    for seed in search.seeds[:_MOST_DRAWN]:
        mine = history[history[:, 0] == seed.seed]
        lines.append((f"seed {seed.seed}", mine[:, 1].tolist(), mine[:, 2].tolist()))
    caption = f"Smallest χ² on the {search.on} against the number of evaluations. Dotted: where the searches ended."
    draw = partial(search_svg, lines, [seed.chi2 for seed in search.seeds])
    return [Figure(draw, caption, f"{caption} {search.sentences[0]}", wide=True), seed_table(search)]


def seed_table(search: GlobalSearchResults) -> Table:
    """A line each seed."""
    heads = columns(">Seed", ">Evaluations", ">χ²", "Same minimum", "Converged")
    words = {True: "yes", False: "no"}
    rows = tuple(
        row(str(s.seed), str(s.evaluations), short(s.chi2), words[s.same], words[s.converged]) for s in search.seeds
    )
    return Table("", heads, rows)


def search_front(source: ReportSource) -> list[Block]:
    """The front: picture and table; nothing where it was not requested."""
    front = _of(source).front
    if front is None:
        return []
    first = len(_of(source).parameters)
    whole = source.arrays[front.front_key][:, first : first + 2]
    confirmed = [(p.frequency_model, p.other_model) for p in front.points]
    known = [(f, o) for f, o in confirmed if f is not None and o is not None]
    if front.third_label:
        # of a surface, its points are drawn by those that the model has confirmed
        return [front_table(_of(source))]
    caption = (
        f"Sum of squared relative errors of the frequencies against the {front.label}. Line: front on the "
        f"{_of(source).on}. Dots: the model at points of the front. Cross: initial values."
    )
    draw = partial(
        front_svg, whole.tolist(), known, (front.initial_frequency, front.initial_other), front.label,
    )  # fmt: skip
    return [Figure(draw, caption, caption, wide=True), front_table(_of(source))]


def front_table(search: GlobalSearchResults) -> Table:
    """A line each point of the front that the model has confirmed."""
    assert search.front is not None
    third = search.front.third_label
    heads = columns(
        *(f">{p.name}" for p in search.parameters), ">Frequencies", ">model", f">{search.front.label}", ">model",
        *((f">{third}", ">model") if third else ()),
    )  # fmt: skip
    rows = tuple(
        row(
            *map(value, p.parameters), short(p.frequency), _or_none(p.frequency_model), short(p.other),
            _or_none(p.other_model), *((_or_none(p.third), _or_none(p.third_model)) if third else ()),
        )
        for p in search.front.points
    )  # fmt: skip
    note = "Frequencies: sum of the squared relative errors. All errors on what was searched, and of the model there."
    return Table("", heads, rows, note)


def _or_none(number: float | None) -> str:
    return NONE if number is None else short(number)


def _form(s: SurrogateFacts) -> tuple[str, str]:
    """Method, and what it consists of."""
    if s.method == "kriging":
        return "Kriging", f"{s.trend} trend, correlation {s.correlation}"
    if s.method == "radial-basis":
        return "radial basis functions", f"{s.kernel}, {s.trend} trend"
    few, many = min(s.terms), max(s.terms)
    return "polynomial chaos", counted(many, "term") if few == many else f"{few} to {many} terms"


def search_surrogate(source: ReportSource) -> list[Block]:
    """The surrogate and its errors."""
    return surrogate_blocks(_of(source))


def surrogate_blocks(search: GlobalSearchResults) -> list[Block]:
    """The surrogate and its errors, for page and terminal."""
    s = search.surrogate
    if s is None:
        return [Paragraph("The model itself was searched.")]
    heads = columns(
        "Surrogate", "Form", ">Runs", ">Responses", "Further runs by", ">Number", ">Leaving out a run before σ",
        ">Leaving out a run σ", ">Fresh runs σ", ">Error / predicted",
    )  # fmt: skip
    line = row(
        *_form(s), str(s.runs), str(s.responses), s.infill_by or NONE, str(s.infill_runs),
        _or_none(s.left_out_rms_before), short(s.left_out_rms), _or_none(s.fresh_rms), short(s.left_out_ratio),
    )  # fmt: skip
    note = (
        "Root mean square errors of the residuals, in standard deviations σ of the data, before and after the further "
        "runs. The last column compares the errors of leaving out a run with their predicted standard deviation; it is "
        "near 1 if the intervals are right."
    )
    return [Table("", heads, (line,), note)]


def search_verdict(search: GlobalSearchResults) -> tuple[str, Level]:
    """What the search came to."""
    level: Level = "warning" if any(a.level != "info" for a in search.alerts) else "info"
    return search.sentences[-1], level


def search_document(subject: Subject, search: GlobalSearchResults) -> Document:
    """Numbers, parameters, seeds, surrogate."""
    verdict, level = search_verdict(search)
    front = () if search.front is None else (Section("front", "Frequencies against shapes", (front_table(search),)),)
    sections = (
        Section("search", "Global search", tuple(summary_blocks(search))),
        Section("parameters", "Parameters", (parameter_table(search),)),
        Section("seeds", "Searches", (seed_table(search),)),
        *front,
        Section("surrogate", "Surrogate", tuple(surrogate_blocks(search))),
    )
    return subject.document(verdict, level, sections)
