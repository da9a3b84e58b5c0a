"""Sections of the report: the starts and the optima they found, the L-curve, reduced models of the update."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.document import Figure, Listing, Paragraph, Table, columns, row
from femtune.document.figures.parameters import optima_svg, weight_path_svg
from femtune.document.numbers import as_sentence, counted, short
from femtune.steps.update.page.parameters import places

if TYPE_CHECKING:
    from femtune.document.document import Block
    from femtune.steps.update.record.reduction import ReductionResults
    from femtune.steps.update.record.search import StartsResults
    from femtune.steps.update.record.update import ParameterFacts, UpdateResults

_MOST_OPTIMA = 12
"""Optima in the table, the best ones first; worse ones rarely matter."""


def starts(update: UpdateResults, facts: Sequence[ParameterFacts]) -> list[Block]:
    """Sentences, picture and table of optima; nothing where the update had one start."""
    record = update.starts
    if record is None:
        return []
    words, *table = optima(update)
    return [words, *_picture(update, record, facts), *table] if table else [words]


def optima(update: UpdateResults, most: int = _MOST_OPTIMA) -> list[Block]:
    """Sentences and table of the best optima, for page and terminal; nothing where the update had one start."""
    record = update.starts
    if record is None:
        return []
    chosen = f", the initial values and the best of {record.samples} samples" if record.samples else ""
    words = Paragraph(f"{len(record.starts)} starts{chosen}, seed {record.seed}: {' '.join(record.sentences)}")
    return [words, _table(update, record, most)] if record.optima else [words]


def _picture(update: UpdateResults, record: StartsResults, facts: Sequence[ParameterFacts]) -> list[Block]:
    names = update.history_parameters
    shown = record.optima[:_MOST_OPTIMA]
    spots = [places(names, o.parameters, facts) for o in shown]
    heights = [places(names, s.start, facts) for s in record.starts]
    counts, good = [len(o.starts) for o in shown], [o.as_good for o in shown]
    draw = partial(optima_svg, names, spots, counts, good, heights)
    caption = (
        "Each line is an optimum, drawn through its parameters between their bounds; the width shows how many initial "
        "points led to it. Dark: the best optimum, and optima that are equally good within the noise. Grey: worse "
        "optima. Dots: initial points."
    )
    ends, starts = counted(len(record.optima), "optimum", "optima"), counted(len(record.starts), "initial point")
    alt = f"{ends} from {starts}, by parameter between the bounds"
    return [Figure(draw, caption, alt, wide=True)]


def _table(update: UpdateResults, starts: StartsResults, most: int) -> Block:
    names = update.history_parameters[:6]
    heads = columns(">Optimum", ">Initial points", ">Objective", "Equally good", *(f">{name}" for name in names))
    rows = [
        row(
            str(i),
            str(len(o.starts)),
            short(o.objective),
            "the best" if i == 1 else "yes" if o.as_good else "no",
            *(short(v) for v in o.parameters[: len(names)]),
        )
        for i, o in enumerate(starts.optima[:most], start=1)
    ]
    more = len(starts.optima) - most
    note = f"and {counted(more, 'worse optimum', 'worse optima')} in the results" if more > 0 else ""
    return Table("Distinct optima", heads, tuple(rows), note)


def weight_choice(update: UpdateResults, facts: Sequence[ParameterFacts]) -> list[Block]:
    """A sentence and a picture; nothing where the weight was given."""
    choice = update.weight_choice
    if choice is None:
        return []
    at = f" It is {short(choice.weight)}." if choice.found else ""
    norms = [p.residual_norm for p in choice.path], [p.constraint_norm for p in choice.path]
    relative = _relative(update, facts, [p.parameters for p in choice.path])
    draw = partial(
        weight_path_svg, [p.weight for p in choice.path], *norms, update.history_parameters, relative, choice.weight
    )
    caption = (
        "Left: L-curve, the norm of the side constraint over the norm of the residuals for increasing weight. Right: "
        "change of the parameters from their initial values for each weight, by the linear model of the first "
        "iteration, without bounds."
    )
    alt = "L-curve, and paths of the parameters over the weight of the side constraint"
    return [Paragraph(f"Weight of the regularisation: {choice.sentence}.{at}"), Figure(draw, caption, alt, wide=True)]


def _relative(
    update: UpdateResults, facts: Sequence[ParameterFacts], paths: Sequence[Sequence[float]]
) -> list[list[float]]:
    """Changes in % of the nominal values, an entry each weight."""
    nominal = {f.name: f.nominal for f in facts}
    base = np.array([nominal.get(name) or 1.0 for name in update.history_parameters])
    return [[float(v) for v in 100.0 * (np.array(p) - base) / np.abs(base)] for p in paths]


_COST = (
    "Full solutions: for the training, and at the end of each search. Solutions for the comparison before the update "
    "and for the written deck, and for the final derivatives, are not included."
)


_COMPONENTS = (
    "DOFs: degrees of freedom that the component alone has, and those that it shares with others. Modes: with fixed "
    "interface, up to the stated frequency, at the first point. Coordinates: all that it has at the end, without the "
    "interface: these modes, those at other points, and parts of modes of the full model. Points: values of the "
    "parameters at which its modes and static shapes were computed."
)


def reduced_models(reduction: ReductionResults | None, of: str = "") -> list[Block]:
    """A table of the models, and what was found each time the search ended; nothing without reduced models.

    `of` is the beginning of the titles, such as the name of a stage.
    """
    if reduction is None:
        return []
    heads = columns("Configuration", ">Order", ">Full solutions", ">Estimate %", ">Certified error %", "Training")
    rows = [
        row(
            m.configuration,
            str(m.order),
            str(m.full_solutions),
            short(m.estimate_percent),
            short(m.certified_error_percent),
            m.training,
        )
        for m in reduction.models
    ]
    if not rows:
        return [Paragraph("; ".join(reduction.rounds).capitalize() + ".")]
    rounds = tuple(map(as_sentence, reduction.rounds))
    models = Table(f"{of}reduced models" if of else "Reduced models", heads, tuple(rows), _COST)
    return [Paragraph(_verdict(reduction)), models, *_components(reduction, of), Listing(rounds)]


def _components(reduction: ReductionResults, of: str) -> list[Block]:
    """The components of the models that are assembled from such."""
    assembled = [m for m in reduction.models if m.components]
    if not assembled:
        return []
    heads = columns(
        "Configuration", "Component", ">DOFs", ">Interface DOFs", ">Modes up to Hz", ">Modes", ">Coordinates", ">Points"
    )
    rows = tuple(
        row(
            m.configuration if i == 0 else "", c.name, str(c.dofs), str(c.interface_dofs), short(c.max_hz),
            str(c.modes), str(c.coordinates), str(c.builds),
        )
        for m in assembled
        for i, c in enumerate(m.components)
    )  # fmt: skip
    errors = "; ".join(
        f"{m.configuration}: {m.interface_dofs} interface DOFs, largest error of a frequency at the initial values "
        f"{short(m.truncation_percent)} %"
        for m in assembled
    )
    title = f"{of}components" if of else "Components"
    return [
        Table(title, heads, rows, _COMPONENTS),
        Paragraph(
            f"{errors}. It is the effect of the omitted modes, before parts of modes of the full model were added."
        ),
    ]


def _verdict(reduction: ReductionResults) -> str:
    tolerance = f"{short(reduction.tolerance_percent)} %"
    if reduction.frfs is not None:
        tolerance += (
            f" (frequencies) and {short(reduction.frfs.tolerance)} standard deviations of the parameters (FRFs)"
        )
    if reduction.certified:
        return f"The search used reduced models; at the final point they agree with the full model within {tolerance}."
    return (
        "The search used reduced models; at the final point they differ from the full model by more than "
        f"{tolerance}. The residuals and frequencies above are those of the full model, but the parameters may not be "
        "its optimum. Allow more full solutions."
    )
