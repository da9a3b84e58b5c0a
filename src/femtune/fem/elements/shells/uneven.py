"""Shells whose thickness varies between their corners, with one thickness per integration point.

The thickness at a point is Σ wᵢ tᵢ, so that t³ is a cubic form of the corners' values and remains exact; the price is
a term for each point.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.contribution import Coefficient
from femtune.fem.elements.shells.laws import ShellTerm
from femtune.fem.structure import ElementBatch
from femtune.parameters.jet import Jet


@dataclass(frozen=True, eq=False)
class UnevenThickness:
    """The elements of a batch with varying thickness.

    Parameters
    ----------
    has : (e,) True for elements with varying thickness
    weights : (p, c) shares of the corners' thicknesses at each point
    """

    has: NDArray[np.bool_]
    weights: Reals

    @property
    def roles(self) -> tuple[str, ...]:
        """Names of the corners' thicknesses."""
        return tuple(f"t{i + 1}" for i in range(self.weights.shape[1]))

    def terms(self, terms: list[ShellTerm]) -> list[ShellTerm]:
        """The terms of elements of constant thickness, and those of the others point by point."""
        if not self.has.any():
            return terms
        return [part for term in terms for part in self._parts(term) if len(part.at)]

    def _parts(self, term: ShellTerm) -> Iterator[ShellTerm]:
        yield replace(term, at=term.at[~self.has[term.at]])
        at = term.at[self.has[term.at]]
        for k in range(len(self.weights)):
            label, roles = f"{term.label}@{k + 1}", self.roles_for(term.roles)
            yield replace(term, label=label, at=at, roles=roles, coefficient=self.at(k, term.coefficient), point=k)

    def roles_for(self, roles: tuple[str, ...]) -> tuple[str, ...]:
        """Names of the values that a coefficient needs, with the corners' thicknesses in place of the element's."""
        return (*(name for name in roles if name != "t"), *self.roles)

    def at(self, point: int, coefficient: Coefficient) -> Coefficient:
        """A coefficient evaluated with the thickness at a point."""
        shares = dict(zip(self.roles, self.weights[point]))

        def own(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
            first, *others = (values[name] * share for name, share in shares.items())
            thickness = first
            for other in others:
                thickness = thickness + other
            return coefficient({**values, "t": thickness}, facts)

        return own


def uneven_thickness(batch: ElementBatch, weights: Reals) -> UnevenThickness:
    """The elements of a batch with varying thickness; `weights` as in ``UnevenThickness``."""
    return UnevenThickness(batch.facts.get("uneven", np.zeros(len(batch), bool)), weights)
