"""How the weight of the side constraint was found: the L-curve, and the parameters over the weight."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from femtune.report.document import Block, Figure, Paragraph
from femtune.report.figures.weight_path import weight_path_svg
from femtune.report.numbers import short
from femtune.study.results_update import ParameterFacts, UpdateResults


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
        "Left: norm of the side constraint over norm of the residuals as the weight rises, the L-curve. Right: what "
        "the linear model of the first iteration gives for each weight, as change of the start value, without bounds."
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
