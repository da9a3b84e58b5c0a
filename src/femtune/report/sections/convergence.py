"""How the update went."""

from __future__ import annotations

from functools import partial

from femtune.report.document import Block, Figure, Listing, Paragraph, Table, columns, row
from femtune.report.figures.convergence import convergence_svg
from femtune.report.numbers import NONE, counted, percent, short
from femtune.report.sections.goodness import goodness
from femtune.report.sections.places import places
from femtune.report.sections.reduction import reduced_models
from femtune.report.sections.residual_kinds import residual_kinds
from femtune.report.sections.stages import stages
from femtune.report.sections.starts import starts
from femtune.report.sections.weight_choice import weight_choice
from femtune.report.source import Source
from femtune.study.results_update import ParameterFacts, UpdateResults


def convergence(source: Source) -> list[Block]:
    """Status, picture, pairing events, table of iterations."""
    update = source.results.update
    if update is None:
        return [Paragraph("The update was not run.")]
    history = [_table(update)] if update.history else [Paragraph("No history was kept.")]
    return [
        Paragraph(f"Outcome: {update.message} ({update.status})."),
        *([_figure(update, source.results.parameters)] if len(update.history) > 1 else []),
        _events(update),
        *goodness(source),
        *residual_kinds(update),
        *weight_choice(update, source.results.parameters),
        *starts(update, source.results.parameters),
        *reduced_models(update.reduction),
        *stages(update.stages),
        *history,
    ]


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
    caption = "Weighted mean error, and each parameter between its bounds. Dotted lines: the pairing changed."
    first, last = update.history[0], update.history[-1]
    alt = (
        f"Weighted mean error from {percent(first.objective_percent)} % to {percent(last.objective_percent)} % "
        f"in {counted(last.iteration, 'iteration')}, and the parameters between their bounds"
    )
    return Figure(draw, caption, alt, wide=True)


def _events(update: UpdateResults) -> Block:
    events = tuple(
        f"After iteration {e.iteration}, {e.configuration}: {e.sentence}".removesuffix(".") + "."
        for e in update.pairing_events
    )
    return Listing(events) if events else Paragraph("The pairing of modes did not change during the update.")


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
