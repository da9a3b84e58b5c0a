"""Many starts: what became of them, and the optima that they found."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from femtune.report.document import Block, Figure, Paragraph, Table, columns, row
from femtune.report.figures.optima import optima_svg
from femtune.report.numbers import short
from femtune.report.sections.places import places
from femtune.study.results_search import StartsResults
from femtune.study.results_update import ParameterFacts, UpdateResults

_SHOWN = 12


def starts(update: UpdateResults, facts: Sequence[ParameterFacts]) -> list[Block]:
    """Sentences, picture and table of optima; nothing where the update had one start."""
    found = update.starts
    if found is None:
        return []
    words = Paragraph(f"{len(found.starts)} starts, seed {found.seed}: {' '.join(found.sentences)}")
    return [words, *_picture(update, found, facts), _table(update, found)] if found.optima else [words]


def _picture(update: UpdateResults, found: StartsResults, facts: Sequence[ParameterFacts]) -> list[Block]:
    names = update.history_parameters
    shown = found.optima[:_SHOWN]
    spots = [places(names, o.parameters, facts) for o in shown]
    heights = [places(names, s.start, facts) for s in found.starts]
    counts, good = [len(o.starts) for o in shown], [o.as_good for o in shown]
    draw = partial(optima_svg, names, spots, counts, good, heights)
    caption = (
        "Each optimum as a line through its parameters between their bounds, as wide as many starts ended there. "
        "Dark: the best and those as good within the noise; grey: worse ones. Dots: where the starts set out."
    )
    alt = f"{len(found.optima)} optima of {len(found.starts)} starts, by parameter between the bounds"
    return [Figure(draw, caption, alt, wide=True)]


def _table(update: UpdateResults, found: StartsResults) -> Block:
    names = update.history_parameters[:6]
    heads = columns(">Optimum", ">Starts", ">Objective", "As good", *(f">{name}" for name in names))
    rows = [
        row(
            str(i),
            str(len(o.starts)),
            short(o.objective),
            "the best" if i == 1 else "yes" if o.as_good else "no",
            *(short(v) for v in o.parameters[: len(names)]),
        )
        for i, o in enumerate(found.optima[:_SHOWN], start=1)
    ]
    return Table("Distinct optima", heads, tuple(rows))
