"""Where a value lies between its bounds."""

from __future__ import annotations

from collections.abc import Sequence

from femtune.study.results_update import ParameterFacts


def places(names: Sequence[str], values: Sequence[float], facts: Sequence[ParameterFacts]) -> list[float]:
    """0 at the lower bound, 1 at the upper one; a half where there are none."""
    by_name = {f.name: f for f in facts}
    return [_place(by_name.get(name), x) for name, x in zip(names, values, strict=True)]


def _place(fact: ParameterFacts | None, x: float) -> float:
    if fact is None or fact.lower is None or fact.upper is None or fact.lower >= fact.upper:
        return 0.5
    return (x - fact.lower) / (fact.upper - fact.lower)
