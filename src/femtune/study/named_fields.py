"""Values that a model has only where a study names them: factors of matrices, offsets of bars, generic elements."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune.errors import ErrorCollector, FemtuneError, Notice, did_you_mean
from femtune.fem import FieldRef
from femtune.fem.distribution import Distribution, with_distribution
from femtune.fem.factors import with_factors
from femtune.fem.fields import FACTORS, amplitude_ref
from femtune.fem.generic import GenericGroup, generic_modes, with_generic
from femtune.fem.offsets import with_offsets
from femtune.fem.random_field import expansion
from femtune.files.nastran.building import FieldPlace
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.field_refs import BARS
from femtune.files.nastran.field_units import field_nature
from femtune.files.study_file import element_list
from femtune.files.study_file.distribution import POSITION
from femtune.parameters import parse_expression
from femtune.study.error_places import errors_at
from femtune.study.parameters import element_centres, elements_of, fields_of, region_of

if TYPE_CHECKING:
    from femtune.arrays import Integers, Reals
    from femtune.errors import Where
    from femtune.fem.generic import GenericModes
    from femtune.files.nastran.build import BuiltDeck
    from femtune.files.study_file import DistributionEntry, GenericEntry, StudyFile

_MOST_STIFFNESSES_SHOWN = 12
"""Stiffnesses of a generic element that a notice lists; the others are counted."""


def with_named_fields(file: StudyFile, built: BuiltDeck) -> BuiltDeck:
    """The model with all values that the parameters of a study change.

    Raises
    ------
    FemtuneError : ``generic.*``, and ``parameter.region`` of offsets of a region
    """
    named = [ref for entry in file.parameter for ref in entry.targets]
    words = sorted({ref.card for ref in named if ref.card in FACTORS})
    structure = with_factors(built.structure, words) if words else built.structure
    offset = set(_offset_elements(file, built))
    structure = with_offsets(structure, offset) if offset else structure
    built = _with_groups(file, replace(built, structure=structure), named)
    built = _with_distributions(file, built)
    return replace(built, fields={**built.fields, **dict(_places(built, offset))})


def _offset_elements(file: StudyFile, built: BuiltDeck) -> Iterator[int]:
    """Bars and beams whose offsets a parameter names, by number or by its region."""
    for i, entry in enumerate(file.parameter):
        for ref in entry.targets:
            if ref.card in BARS and ref.id:
                yield from {ref.id} & built.element_cards.keys()
            elif ref.card in BARS:
                chosen = region_of(file, i, built)
                kinds = built.structure.element_kinds
                yield from (n for n, kind in kinds.items() if kind == ref.card and (chosen is None or n in chosen))


def _places(built: BuiltDeck, elements: set[int]) -> Iterator[tuple[FieldRef, FieldPlace]]:
    """Positions of offset fields that are filled in."""
    for number in sorted(elements):
        card = built.deck.cards[built.element_cards[number]]
        kind = CATALOGUE.get(card.name)
        for name in kind.values if kind is not None and card.name in BARS else ():
            at = CATALOGUE[card.name].fields.index(name)
            if at < len(card.fields) and not card.blank(at):
                yield FieldRef(card.name, number, name), FieldPlace(card.position, (at,))


def _with_groups(file: StudyFile, built: BuiltDeck, named: list[FieldRef]) -> BuiltDeck:
    """The generic elements, with a notice for each; several problems are shown together."""
    errors, structure, notices = ErrorCollector(), built.structure, list(built.notices)
    words = [ref.name.split() for ref in named if ref.card == "GENERIC"]
    for i, entry in enumerate(file.generic):
        names = list(dict.fromkeys(name for group, name in words if group == entry.name))
        with errors.catch(), errors_at(file.where("generic", i)):
            group = _group(entry, built)
            structure = with_generic(structure, group, names)
            notices.append(_eigenvalues(entry.name, generic_modes(built.structure, group), file.where("generic", i)))
    errors.raise_if_any()
    return replace(built, structure=structure, notices=tuple(notices))


def _with_distributions(file: StudyFile, built: BuiltDeck) -> BuiltDeck:
    """The fields that vary over regions; several problems are shown together."""
    errors, structure, notices = ErrorCollector(), built.structure, list(built.notices)
    for i, entry in enumerate(file.distribution):
        with errors.catch(), errors_at(file.where("distribution", i)):
            subject = f"distribution {entry.name}"
            chosen = elements_of(file, ("distribution", i), entry, built, subject)
            where = file.where("distribution", i, "fields")
            fields = [ref for text in entry.fields for ref in fields_of(text, built, chosen, where)]
            distribution = _distribution(entry, tuple(dict.fromkeys(fields)), chosen, built)
            structure = with_distribution(structure, distribution)
            _check_range(file, i, distribution)
            notices += _random_share(entry, distribution, file.where("distribution", i))
    errors.raise_if_any()
    return replace(built, structure=structure, notices=tuple(notices))


_LARGEST_FIELD_FACTOR = 1e4
"""Largest factor on a field that the bounds of amplitudes may allow; above it a bound is a mistyped number."""


def _check_range(file: StudyFile, i: int, distribution: Distribution) -> None:
    """Refuse bounds of amplitudes within which 1 + Σ a f is not positive, or is huge, at some element. Tied amplitudes
    are not checked.

    Raises
    ------
    FemtuneError : ``distribution.range``
    """
    field = next((ref for ref in distribution.fields if field_nature(ref).positive), None)
    bounds = _amplitude_bounds(file, distribution)
    if field is None or not bounds or not len(distribution.elements):
        return
    low, high, names = np.array([b[0] for b in bounds]), np.array([b[1] for b in bounds]), [b[2] for b in bounds]
    values = distribution.functions[:, [b[3] for b in bounds]]
    least = np.minimum(low * values, high * values)
    factor, most = 1.0 + least.sum(axis=1), 1.0 + np.maximum(low * values, high * values).sum(axis=1)
    e = int(factor.argmin())
    where = file.where("distribution", i)
    facts: dict[str, Any] = {"name": distribution.name, "field": f"{field.card} {field.name}"}
    if factor[e] <= 0.0:
        j = int(least[e].argmin())
        side = "lower" if least[e, j] == low[j] * values[e, j] else "upper"
        limit = -(1.0 + least[e].sum() - least[e, j]) / values[e, j]
        raise FemtuneError(
            "distribution.range", where=where, hint=_positive_from(names, j, side, float(limit), float(least[e].sum())),
            **facts, element=int(distribution.elements[e]), factor=float(factor[e]),
        )  # fmt: skip
    if (worst := float(most.max())) > _LARGEST_FIELD_FACTOR:
        element = int(distribution.elements[most.argmax()])
        raise FemtuneError(
            "distribution.range/huge", where=where, **facts, element=element, factor=worst, most=_LARGEST_FIELD_FACTOR
        )


def _amplitude_bounds(file: StudyFile, distribution: Distribution) -> list[tuple[float, float, str, int]]:
    """Bounds, name and position of the function of each free amplitude."""
    at = {amplitude_ref(distribution.name, j + 1): j for j in range(distribution.functions.shape[1])}
    return [
        (entry.lower, entry.upper, entry.name, at[ref])
        for entry in file.parameter
        for ref in entry.targets
        if ref in at and entry.absolute and entry.lower is not None and entry.upper is not None
    ]


def _positive_from(names: list[str], j: int, side: str, limit: float, total: float) -> str:
    """The bound from which the field is positive; a factor on all bounds if one bound is not enough."""
    if (limit < 0.0) == (side == "lower") and limit != 0.0:
        relation = "above" if side == "lower" else "below"
        return f"it is positive with {side} of {names[j]} {relation} {limit:.4g}"
    return f"it is positive if the bounds of {', '.join(names)} are multiplied by less than {-1.0 / total:.4g}"


def _distribution(
    entry: DistributionEntry, fields: tuple[FieldRef, ...], chosen: frozenset[int] | None, built: BuiltDeck
) -> Distribution:
    """The functions at the middle of the elements that use a field, and are in the region."""
    structure = built.structure
    users = {int(e) for ref in fields for e in structure.users(structure.values.index(ref) or 0)}
    wanted = users if chosen is None else users & chosen
    numbers, centres = element_centres(built)
    keep = np.isin(numbers, list(wanted))
    numbers, centres = numbers[keep], centres[keep]
    if entry.random is not None:
        return Distribution(entry.name, fields, numbers, _random(entry, numbers, centres))
    low, size = centres.min(axis=0, initial=np.inf), np.ptp(centres, axis=0) if len(centres) else np.ones(3)
    scaled = 2.0 * (centres - low) / np.where(size > 0.0, size, 1.0) - 1.0
    scaled[:, size == 0.0] = 0.0
    at = dict(zip(POSITION, [*centres.T, *scaled.T]))
    functions = np.empty((len(numbers), len(entry.functions)))
    for j, expression in enumerate(map(parse_expression, entry.functions)):
        for i, element in enumerate(numbers):
            try:
                functions[i, j] = expression({name: float(values[i]) for name, values in at.items()})
            except FemtuneError as error:
                raise FemtuneError(
                    "distribution.function/not-finite", name=entry.name, number=j + 1, element=int(element)
                ) from error
    return Distribution(entry.name, fields, numbers, functions)


_MOST_ELEMENTS = 6000
"""Elements of a random field at most: their covariance is a dense matrix (288 MB, and its eigenvectors as many)."""


def _random(entry: DistributionEntry, numbers: Integers, centres: Reals) -> Reals:
    """(m, terms) functions of a random field (error ``distribution.random``)."""
    assert entry.random is not None
    field = entry.random
    if not field.terms <= len(numbers) <= _MOST_ELEMENTS:
        raise FemtuneError(
            "distribution.random", name=entry.name, elements=len(numbers), terms=field.terms, most=_MOST_ELEMENTS
        )
    return expansion(centres, field.length, field.kernel, field.terms)[0]


def _random_share(entry: DistributionEntry, distribution: Distribution, where: Where) -> Iterator[Notice]:
    """The part of the variance of a random field that its functions hold."""
    if entry.random is not None:
        part = float(np.mean(np.sum(distribution.functions**2, axis=1)))
        yield Notice(
            "distribution.share", where=where, level="info", name=entry.name, terms=entry.random.terms,
            percent=100.0 * part,
        )  # fmt: skip


def _eigenvalues(name: str, modes: GenericModes, where: Where) -> Notice:
    """Fields of a group that a study may name: its eigenvalues, and the number of shapes of each."""
    pairs = list(enumerate(zip(modes.kappa, modes.multiplicity), 1))
    shown = (f"K{i} = {k:.6g}" + (f" ({n} shapes)" if n > 1 else "") for i, (k, n) in pairs[:_MOST_STIFFNESSES_SHOWN])
    more = f" and {len(pairs) - _MOST_STIFFNESSES_SHOWN} more" if len(pairs) > _MOST_STIFFNESSES_SHOWN else ""
    return Notice(
        "generic.eigenvalues",
        where=where,
        level="info",
        group=name,
        rigid=modes.rigid,
        eigenvalues=", ".join(shown),
        more=more,
    )


def _group(entry: GenericEntry, built: BuiltDeck) -> GenericGroup:
    known, wanted = built.structure.element_kinds, element_list(entry.elements)
    missing = sorted(set(wanted.singles) - set(known))
    if missing:
        raise FemtuneError(
            "generic.elements",
            hint=did_you_mean(str(missing[0]), map(str, known)) or "name elements of the deck",
            group=entry.name,
            element=missing[0],
        )
    return GenericGroup(entry.name, frozenset(wanted.among(known)), entry.nodes, entry.components)
