"""Properties that vary over a region: value of element e = deck value · (1 + Σ_j a_j f_j(x_e)).

The functions f_j are given at the middle of each element; the amplitudes a_j are entries of the value table, zero in
the deck. The values of the elements follow from them by the table, so that all derivatives are exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError
from femtune.fem.fields import AMPLITUDE, FieldRef, amplitude_ref
from femtune.fem.structure import Structure
from femtune.fem.values import Derived, ValueTable
from femtune.parameters.jet import Jet


def region_of_element(name: str, element: int) -> str:
    """Name of the region that consists of one element of a distribution."""
    return f"{name} {element}"


@dataclass(frozen=True, eq=False)
class Distribution:
    """Fields that vary over elements.

    Parameters
    ----------
    elements : (m,) numbers
    functions : (m, n) f_j at the middle of each element
    """

    name: str
    fields: tuple[FieldRef, ...]
    elements: Integers
    functions: Reals


def with_distribution(structure: Structure, distribution: Distribution) -> Structure:
    """The structure with an individual value for each element, which follows from the amplitudes.

    Raises
    ------
    FemtuneError : ``distribution.field`` for a field that no element of the region uses, or that varies already
    """
    d, n = distribution, distribution.functions.shape[1]
    amplitudes = {amplitude_ref(d.name, j + 1): 0.0 for j in range(n)}
    structure = replace(structure, values=structure.values.extended(amplitudes))
    row = {int(e): i for i, e in enumerate(d.elements)}
    for ref in d.fields:
        at = structure.values.index(ref)
        users = [] if at is None else [int(e) for e in structure.direct_users(at) if int(e) in row]
        if at is None or not users:
            raise FemtuneError("distribution.field", name=d.name, field=ref)
        functions = d.functions[[row[e] for e in users]]
        structure = _varied(structure, at, users, functions, d.name)
    return structure


def _varied(structure: Structure, at: int, users: Sequence[int], functions: Reals, name: str) -> Structure:
    """A copy of an entry, and of what follows from it, for each element; the copies follow from the amplitudes."""
    regions = [region_of_element(name, e) for e in users]
    structure, copies = structure.split_each(at, users, regions)
    table, n = structure.values, functions.shape[1]
    first = len(table.refs)
    amplitudes = tuple(table.index(amplitude_ref(name, j + 1)) or 0 for j in range(n))
    known = table.refs[at]
    constants = tuple(
        FieldRef(f"{AMPLITUDE} {known.card} {known.name}", e, f"{name} F{j + 1}") for e in users for j in range(n)
    )
    rules = tuple(
        Derived(copy, varied, (at, *amplitudes, *range(first + n * i, first + n * (i + 1))))
        for i, copy in enumerate(copies)
    )
    values = np.concatenate([table.values, functions.ravel()])
    return replace(structure, values=ValueTable((*table.refs, *constants), values, (*table.derived, *rules)))


def varied(base: Jet, *rest: Jet) -> Jet:
    """base · (1 + Σ a_j f_j); `rest` are the amplitudes, then the functions."""
    n = len(rest) // 2
    total = rest[0] * rest[n]
    for a, f in zip(rest[1:n], rest[n + 1 :]):
        total = total + a * f
    return base * (total + 1.0)


def varied_entries(table: ValueTable) -> frozenset[int]:
    """Positions of the values of single elements, and of what follows from them."""
    targets = [d.target for d in table.derived if d.function is varied]
    return frozenset(table.dependents(targets))
