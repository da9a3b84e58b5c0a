"""Values that a model has only where a study names them: factors of matrices, offsets of bars, generic elements."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from femtune.assembly.error_places import errors_at
from femtune.assembly.parameters import region_of
from femtune.errors import ErrorCollector, FemtuneError, Notice, did_you_mean
from femtune.fem import FieldRef
from femtune.fem.factors import with_factors
from femtune.fem.fields import FACTORS
from femtune.fem.generic import GenericGroup, generic_modes, with_generic
from femtune.fem.offsets import with_offsets
from femtune.files.nastran.building import FieldPlace
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.field_refs import BARS
from femtune.files.study_file import element_list

if TYPE_CHECKING:
    from femtune.errors import Where
    from femtune.fem.generic import GenericModes
    from femtune.files.nastran.build import BuiltModel
    from femtune.files.study_file import GenericEntry, StudyFile

_MOST_SHOWN = 12


def with_named_fields(file: StudyFile, built: BuiltModel) -> BuiltModel:
    """The model with all values that the parameters of a study move.

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
    return replace(built, fields={**built.fields, **dict(_places(built, offset))})


def _offset_elements(file: StudyFile, built: BuiltModel) -> Iterator[int]:
    """Bars and beams whose offsets a parameter names, by number or by its region."""
    for i, entry in enumerate(file.parameter):
        for ref in entry.targets:
            if ref.card in BARS and ref.id:
                yield from {ref.id} & built.element_cards.keys()
            elif ref.card in BARS:
                chosen = region_of(file, i, built)
                kinds = built.structure.element_kinds
                yield from (n for n, kind in kinds.items() if kind == ref.card and (chosen is None or n in chosen))


def _places(built: BuiltModel, elements: set[int]) -> Iterator[tuple[FieldRef, FieldPlace]]:
    """Where filled offset fields stand."""
    for number in sorted(elements):
        card = built.deck.cards[built.element_cards[number]]
        kind = CATALOGUE.get(card.name)
        for name in kind.values if kind is not None and card.name in BARS else ():
            at = CATALOGUE[card.name].fields.index(name)
            if at < len(card.fields) and not card.blank(at):
                yield FieldRef(card.name, number, name), FieldPlace(card.position, (at,))


def _with_groups(file: StudyFile, built: BuiltModel, named: list[FieldRef]) -> BuiltModel:
    """The generic elements, with a notice of each; several problems are shown together."""
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


def _eigenvalues(name: str, modes: GenericModes, where: Where) -> Notice:
    """What a study may name: the eigenvalues of a group, and how many shapes each has."""
    pairs = list(enumerate(zip(modes.kappa, modes.multiplicity), 1))
    shown = (f"K{i} = {k:.6g}" + (f" ({n} shapes)" if n > 1 else "") for i, (k, n) in pairs[:_MOST_SHOWN])
    more = f" and {len(pairs) - _MOST_SHOWN} more" if len(pairs) > _MOST_SHOWN else ""
    return Notice(
        "generic.eigenvalues",
        where=where,
        level="info",
        group=name,
        rigid=modes.rigid,
        eigenvalues=", ".join(shown),
        more=more,
    )


def _group(entry: GenericEntry, built: BuiltModel) -> GenericGroup:
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
