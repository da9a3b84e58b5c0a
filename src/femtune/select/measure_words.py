"""Collinearity, information and subset selection in sentences."""

from __future__ import annotations

from femtune.select.collinearity import Collinearity
from femtune.select.information import Information
from femtune.select.subset import Subset
from femtune.select.words import listed

_MOST = 5


def measure_sentences(alike: Collinearity, information: Information, subset: Subset) -> list[str]:
    """What the measures say, the most useful first; empty without parameters."""
    if not alike.names:
        return []
    return [*_of_subset(subset), *_of_pairs(alike), *_of_dependences(alike), *_of_information(information)]


def _of_subset(found: Subset) -> list[str]:
    if not found.steps:
        return ["No parameter has any effect on what is compared."]
    if not found.chosen:
        best = found.steps[0]
        return [
            f"No parameter explains more of the residual than chance would; nearest is {best.name}, which leaves "
            f"{100 * best.left:.0f} % of it."
        ]
    last = found.steps[len(found.chosen) - 1]
    verb = "explains" if len(found.chosen) == 1 else "explain"
    return [f"{_few(found.chosen)} {verb} the residual best: {100 * last.left:.0f} % of it is left."]


def _of_pairs(alike: Collinearity) -> list[str]:
    return [
        f"{a} and {b} do nearly the same (cosine {c:+.3f}): tie them, or leave one out."
        for a, b, c in alike.pairs[:_MOST]
    ]


def _of_dependences(alike: Collinearity) -> list[str]:
    """Those of more than two, since pairs are told already."""
    told = {frozenset((a, b)) for a, b, _ in alike.pairs}
    return [
        f"{_few(names)} are hardly told from each other (condition index {index:.0f})."
        for index, names in alike.dependences[:_MOST]
        if frozenset(names) not in told
    ]


def _of_information(found: Information) -> list[str]:
    known = found.known
    if len(known) == len(found.names):
        return []
    if not known:
        return ["No parameter is known by the data alone once all the others are unknown."]
    return [f"By the data alone, with all others unknown, {_few(known)} {'is' if len(known) == 1 else 'are'} known."]


def _few(names: tuple[str, ...]) -> str:
    shown = list(names[:8]) + ([f"{len(names) - 8} more"] if len(names) > 8 else [])
    return listed(shown)
