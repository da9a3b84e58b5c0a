"""Sections of the report: convergence of the update, and residuals before and after by kind."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from femtune.document.document import Cell, Figure, Listing, Paragraph, Table, columns, row
from femtune.document.figures.convergence import convergence_svg
from femtune.document.numbers import NONE, counted, freq, listed, percent, short, value
from femtune.steps.update.page.parameters import places
from femtune.steps.update.page.stages import stages
from femtune.steps.update.page.starts import reduced_models, starts, weight_choice
from femtune.steps.validate.page import goodness

if TYPE_CHECKING:
    from femtune.document.document import Block
    from femtune.steps.report_source import ReportSource
    from femtune.steps.update.record.search import MinimumResults, SmallestChangeResults
    from femtune.steps.update.record.truncation import FrfTruncation
    from femtune.steps.update.record.update import ComparisonResults, ParameterFacts, ResidualCount, UpdateResults

_MOST_UNFOLDED_ROWS = 12
"""Rows of the largest table of residuals that is shown unfolded: less than half a screen."""
_MOST_LEFT = 3
"""Other pairings that a sentence names."""
_ENOUGH_STARTS = 2
"""Starts that have to reach a minimum for it to be called the best one."""
_TRIALS_NOTE = (
    "With another pairing the update continues from its end with these pairs held, then with pairs by their MACs. χ² "
    "of both ends is over the same comparisons: a test mode without a partner is compared with the nearest model mode. "
    "“Led back”: a start was given up because its steps led back to the best end."
)
_POLES_NOTE = (
    "Of a pole λ the frequency is |λ|/2π, and the damping ratio −Re λ/|λ|. Close modes that are paired together have "
    "one mean pole."
)
_TRUNCATION_NOTE = (
    "The FRFs of a residual are superposed from modes and residual vectors, and compared with solutions of "
    "K + iωC − ω²M at a few frequency lines; σ is the standard deviation of the measured values."
)
_LEFT_OUT_NOTE = (
    "Their terms in the modal sum are taken away, before and after the update. Correlation: square of the product of "
    "the mass-normalised shapes, weighted by the mass; 1 for the same shape."
)
_NOTE = (
    "Mean error: √(Σr²/Σσ⁻²) of one kind, relative to the measured values. Root mean square: of the residuals r, in "
    "units of the standard deviations that the study states; it is about 1 if only measurement noise is left."
)


def residual_kinds(update: UpdateResults) -> list[Block]:
    """A table of kinds; nothing where the results do not have it."""
    known = [kind for kind in update.residual_counts if kind.rms_after is not None]
    if not known:
        return []
    heads = columns("Residuals", ">Number", ">Mean error % before", ">after", ">Root mean square before", ">after")
    by_kind = Table("Residuals by kind", heads, tuple(_row(kind) for kind in known))
    note = Paragraph(_NOTE, tone="muted")
    return [by_kind, note, *_poles(update), *_comparisons(update), *_truncation(update), *_left_out(update)]


def _row(kind: ResidualCount) -> tuple[Cell, ...]:
    return row(
        kind.kind,
        str(kind.count),
        _percent(kind.error_before_percent),
        _percent(kind.error_after_percent),
        short(kind.rms_before),
        short(kind.rms_after),
    )


def _comparisons(update: UpdateResults) -> list[Block]:
    """Every comparison by itself, unfolded where they are few."""
    heads = columns("Configuration", "Compared", ">Values", ">Error % before", ">after", ">Root mean square after")
    rows = tuple(_comparison(c) for c in update.comparisons)
    return [Table("All residuals", heads, rows, folded=len(rows) > _MOST_UNFOLDED_ROWS)] if rows else []


def _poles(update: UpdateResults) -> list[Block]:
    """Measured and computed damping ratios and natural frequencies of the poles that were compared."""
    heads = columns(
        "Configuration", "Test mode", ">Damping ratio % measured", ">before", ">after", ">Frequency Hz measured",
        ">before", ">after",
    )  # fmt: skip
    rows = tuple(
        row(p.configuration, p.label, *map(_ratio, (p.measured_ratio, p.before_ratio, p.after_ratio)),
            freq(p.measured_hz), NONE if p.before_hz is None else freq(p.before_hz), freq(p.after_hz))
        for p in update.poles
    )  # fmt: skip
    return [Table("Poles of test and damped model", heads, rows, _POLES_NOTE)] if rows else []


def _ratio(ratio: float | None) -> str:
    return NONE if ratio is None else short(100.0 * ratio)


def _truncation(update: UpdateResults) -> list[Block]:
    """Error of the FRFs by truncation of their modes."""
    if not update.frf_truncation:
        return []
    heads = columns(
        "Configuration", "Stage", ">Modes", ">up to Hz", ">Highest line Hz", ">Lines compared", ">Largest error σ",
        ">RMS σ", ">Largest error %", "Missing",
    )  # fmt: skip
    rows = tuple(_truncated(t) for t in update.frf_truncation)
    return [Table("FRFs of the model: superposition of modes beside direct solutions", heads, rows, _TRUNCATION_NOTE)]


def _left_out(update: UpdateResults) -> list[Block]:
    """Modes of the model that FRFs are compared without."""
    if not update.left_out_modes:
        return []
    heads = columns("Configuration", ">Mode before", ">Hz", ">Mode after", ">Hz", ">Correlation")
    rows = tuple(
        row(m.configuration, str(m.before), freq(m.before_hz), str(m.after), freq(m.after_hz), short(m.correlation))
        for m in update.left_out_modes
    )
    return [Table("Modes that are left out of the FRFs of the model", heads, rows, _LEFT_OUT_NOTE)]


def _truncated(t: FrfTruncation) -> tuple[Cell, ...]:
    missing = Cell(f"{t.missing} ({t.limit})" if t.limit else t.missing, tone="poor")
    return row(
        t.configuration,
        t.stage,
        NONE if t.modes is None else str(t.modes),
        freq(t.modes_to_hz),
        freq(t.highest_line_hz),
        str(len(t.lines_hz)),
        short(t.largest_sd),
        short(t.rms_sd),
        short(t.largest_percent),
        Cell("none") if t.small else missing,
    )


def _comparison(c: ComparisonResults) -> tuple[Cell, ...]:
    return row(
        c.configuration,
        f"{c.kind} {c.label}",
        str(c.count),
        _percent(c.error_before_percent),
        percent(c.error_after_percent),
        short(c.rms_after),
    )


def _percent(value: float | None) -> str:
    return NONE if value is None else percent(value)


def convergence(source: ReportSource) -> list[Block]:
    """Status, picture, pairing events, table of iterations."""
    update = source.results.update
    if update is None:
        return [Paragraph("The update was not run.")]
    history = [_table(update)] if update.history else [Paragraph("The history of the iterations was not stored.")]
    return [
        Paragraph(f"Outcome: {update.message} ({update.status})."),
        *([_figure(update, source.results.parameters)] if len(update.history) > 1 else []),
        *_optimality(update),
        *_long_steps(update),
        *_trials(update),
        _events(update),
        *goodness(source),
        *residual_kinds(update),
        *weight_choice(update, source.results.parameters),
        *starts(update, source.results.parameters),
        *reduced_models(update.reduction),
        *stages(update.stages),
        *history,
    ]


def _optimality(update: UpdateResults) -> list[Block]:
    """Which point the result is, what it costs, and how well it meets the conditions of a minimum."""
    if not update.ok or update.certificate is None:
        return []
    certificate, small = update.certificate, update.smallest_change
    negative = [m for m in certificate.multipliers if m.value < 0.0]
    at_bounds = f"{counted(len(certificate.multipliers), 'parameter')} at a bound"
    conditions = (
        f"Conditions of a minimum: the steepest remaining slope of the objective in a direction that the bounds allow "
        f"is {short(certificate.projected_gradient)}; a further Gauss-Newton step would reduce the sum of squares by "
        f"{short(certificate.predicted_decrease)} of its value; {at_bounds}{_inwards(len(negative))}."
    )
    if small is None:
        which = f"The result is {_minimum(update)}: χ² = {value(update.chi_square)}."
        return [Paragraph(f"{which} {conditions}")]
    return [Paragraph(f"{_smallest_change(update, small)} {conditions}")]


def _inwards(count: int) -> str:
    """Parameters that would fit better inside, away from their bounds (negative Lagrange multipliers)."""
    return f", {count} of which would fit better inside the bounds" if count else ""


def which_point(update: UpdateResults) -> list[str]:
    """Short sentences on which point the result is, and on what was tried for a better one."""
    return [*_which_point(update), *minimum_sentences(update)]


def minimum_sentences(update: UpdateResults) -> list[str]:
    """What was tried for a better minimum, with which result; none if nothing suggested another one."""
    minimum = update.minimum
    if minimum is None or not minimum.reasons:
        return []
    why = f"Search for a better minimum ({'; '.join(minimum.reasons)})"
    if not minimum.trials:
        return [f"{why}: nothing was tried; the MACs leave no other pairing open. {_left(minimum)}".rstrip()]
    kinds = [t.kind for t in minimum.trials]
    counts = ((kinds.count("pairing"), "other pairing"), (kinds.count("start"), "start"))
    tried = listed(counted(n, word) for n, word in counts if n)
    cost = f"{tried}, {counted(minimum.iterations, 'iteration')} beside {minimum.update_iterations} of the update"
    if not minimum.improved:
        return [f"{why}: {cost}; none ended at a lower χ². {_left(minimum)}".rstrip()]
    (*_, best) = (t for t in minimum.trials if t.better)
    return [
        f"{why}: {cost}. A better minimum was found: χ² {value(minimum.chi_square)} instead of "
        f"{value(minimum.first_chi_square)} ({best.sentence}). {_left(minimum)}".rstrip()
    ]


def _left(minimum: MinimumResults) -> str:
    some = "; ".join(minimum.left[:_MOST_LEFT])
    more = f"; and {len(minimum.left) - _MOST_LEFT} more" if len(minimum.left) > _MOST_LEFT else ""
    return f"Other pairings that were not tried: {some}{more}." if minimum.left else ""


def _which_point(update: UpdateResults) -> list[str]:
    if not update.ok or update.certificate is None:
        return []
    certificate, small = update.certificate, update.smallest_change
    negative = sum(m.value < 0.0 for m in certificate.multipliers)
    at_bounds = f", {counted(len(certificate.multipliers), 'parameter')} at a bound" if certificate.multipliers else ""
    slope = short(certificate.projected_gradient)
    conditions = f"steepest slope within the bounds {slope}{at_bounds}{_inwards(negative)}"
    if small is None:
        return [f"Result: {_minimum(update)}, χ² = {value(update.chi_square)} ({conditions})."]
    return [
        f"Result: the smallest change whose χ² is at most {short(small.allowed)} above a minimum within the bounds, "
        f"{value(small.chi_square)}; it is {short(small.increase)} above ({conditions})."
    ]


def _minimum(update: UpdateResults) -> str:
    """What a minimum is called: one is the best that is known only where starts support it."""
    starts = update.starts
    if starts is None or not starts.unique or not starts.optima or len(starts.optima[0].starts) < _ENOUGH_STARTS:
        return "a minimum within the bounds"
    return f"the best minimum within the bounds of {len(starts.starts)} starts"


def _long_steps(update: UpdateResults) -> list[Block]:
    numbers = [i.iteration for i in update.history if i.long_step]
    if not numbers:
        return []
    text = (
        "No short step reduced the objective function any more, although the linear model predicted a decrease, as "
        f"where modes nearly cross. {counted(len(numbers), 'long step')} followed, at iteration "
        f"{', '.join(map(str, numbers))}; the objective function may have increased there. The best end is the result."
    )
    return [Paragraph(text)]


def _smallest_change(update: UpdateResults, small: SmallestChangeResults) -> str:
    last = [i.iteration for i in update.history if not i.to_smallest_change]
    at_bound = ", ".join(small.optimum_at_bound) or "no parameter"
    return (
        "At a minimum of χ² within the bounds the data leave combinations of the parameters undetermined, those of "
        "parameters at a bound included, so that noise decides where it lies. The result is the smallest "
        "change from the nominal values, in prior standard deviations, whose χ² "
        f"exceeds this minimum by at most {short(small.allowed)}: χ² is {value(small.chi_square)} at "
        f"the minimum, and {short(small.increase)} more in the result. The change is {short(small.size)} "
        f"prior standard deviations long, against {short(small.optimum_size)} at the minimum (iteration {last[-1]}), "
        f"where {at_bound} would be at a bound."
    )


def _figure(update: UpdateResults, facts: tuple[ParameterFacts, ...]) -> Block:
    between = [places(update.history_parameters, i.parameters, facts) for i in update.history]
    draw = partial(
        convergence_svg,
        [i.iteration for i in update.history],
        [i.objective_percent for i in update.history],
        update.history_parameters,
        between,
        sorted({e.iteration for e in update.pairing_events}),
    )
    caption = "Weighted mean error, and the parameters relative to their bounds. Dotted lines: the pairing changed."
    first, last = update.history[0], update.history[-1]
    alt = (
        f"Weighted mean error from {percent(first.objective_percent)} % to {percent(last.objective_percent)} % "
        f"in {counted(last.iteration, 'iteration')}, and the parameters relative to their bounds"
    )
    return Figure(draw, caption, alt, wide=True)


def _events(update: UpdateResults) -> Block:
    events = tuple(
        f"After iteration {e.iteration}, {e.configuration}: {e.sentence}".removesuffix(".") + "."
        for e in update.pairing_events
    )
    return Listing(events) if events else Paragraph("The pairing of modes did not change during the update.")


def _trials(update: UpdateResults) -> list[Block]:
    """What was tried for a better minimum, in words and as a table."""
    minimum = update.minimum
    if minimum is None or not minimum.reasons:
        return []
    heads = columns("Tried", ">χ² at its end", ">χ² of the best end before", ">Iterations", "Result")
    rows = tuple(
        row(
            t.sentence, NONE if t.chi_square is None else value(t.chi_square), value(t.before), str(t.iterations),
            "yes" if t.better else "no, led back" if t.leads_back else "no",
        )
        for t in minimum.trials
    )  # fmt: skip
    words: list[Block] = [Paragraph(text) for text in minimum_sentences(update)]
    return [*words, Table("Other pairings and starts that were tried", heads, rows, _TRIALS_NOTE)] if rows else words


def _table(update: UpdateResults) -> Block:
    heads = columns(">Iteration", ">Weighted mean error %", ">Step", ">Damping", "At a bound", "Pairing")
    rows = [
        row(
            str(i.iteration),
            percent(i.objective_percent),
            short(i.step_length),
            short(i.damping),
            ", ".join(i.active_bounds) or NONE,
            "; ".join(i.events) or NONE,
        )
        for i in update.history
    ]
    return Table("Iterations", heads, tuple(rows))
