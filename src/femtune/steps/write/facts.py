"""The written deck as records: changed fields, new cards with their values, elements that refer to them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from femtune.fem import FieldRef
from femtune.files.nastran.catalogue import CATALOGUE, ELEMENT
from femtune.files.nastran.lines import parse_number
from femtune.steps.write.record import EditedField, NewCardFacts, NewCardValue, RepointedElements
from femtune.study.provenance import relative

if TYPE_CHECKING:
    from femtune.files.nastran.edit import FieldChange
    from femtune.files.nastran.write import Split, WritePlan
    from femtune.study.study import Study

Values = Mapping[FieldRef, float]
Owners = Mapping[FieldRef, str]


def edits(study: Study, plan: WritePlan, values: Values, owners: Owners) -> Iterable[EditedField]:
    """Fields with a changed value, or a text that belongs to one; references are left to `repointed`."""
    for change in plan.edited.changes:
        ref = plan.places.get((change.position, change.index))
        if ref is not None or not _reference(study, change):
            yield _edit(study, change, ref, values, plan, owners)


def _edit(
    study: Study, change: FieldChange, ref: FieldRef | None, values: Values, plan: WritePlan, owners: Owners
) -> EditedField:
    card = study.built_deck.deck.cards[change.position]
    value = float(values[ref]) if ref is not None else parse_number(change.after)
    return EditedField(
        card=f"{ref.card} {ref.id}" if ref is not None and ref.id else card.record,
        field=ref.name if ref is not None else f"field {change.index + 2}",
        file=relative(Path(change.where.file), study.file.path.parent),
        line=change.where.line or 1,
        old_text=change.before.strip(),
        new_text=change.after.strip(),
        value=value,
        rounded_value=value if ref is None else float(plan.values.get(ref, values[ref])),
        parameter=owners.get(ref, "") if ref is not None else "",
    )


def _reference(study: Study, change: FieldChange) -> str:
    """PID or MID where the field is the reference of an element; else \"\"."""
    kind = CATALOGUE.get(study.built_deck.deck.cards[change.position].name)
    if kind is None or kind.role != ELEMENT or change.index >= len(kind.fields):
        return ""
    name = kind.fields[change.index]
    return name if name in ("PID", "MID") else ""


def repointed(study: Study, plan: WritePlan) -> Iterable[RepointedElements]:
    """Elements of one kind that changed the same reference, as one record."""
    fields: dict[tuple[str, str, str, str], list[int]] = {}
    for change in plan.edited.changes:
        name = _reference(study, change)
        if name and (change.position, change.index) not in plan.places:
            card = study.built_deck.deck.cards[change.position]
            after = _card_of(name, change.after.strip(), plan)
            fields.setdefault((card.name, name, change.before.strip(), after), []).append(card.integer(0))
    for (kind, name, before, after), numbers in fields.items():
        yield RepointedElements(card=kind, field=name, before=before, after=after, elements=tuple(numbers))


def _card_of(name: str, number: str, plan: WritePlan) -> str:
    """The new card of a number, \"PSHELL 21\": properties and materials are numbered apart."""
    copies = (s.copy for s in plan.splits if s.copy[0] == name[0] and s.copy.split()[1] == number)
    return next(copies, number)


def new_cards(study: Study, plan: WritePlan, values: Values, owners: Owners) -> Iterable[NewCardFacts]:
    """Cards that were copied for regions, with what differs in them."""
    for split in plan.splits:
        held = (_new_value(study, ref, value, values, owners) for ref, value in split.values.items())
        yield NewCardFacts(
            card=split.copy,
            copied_from=split.source,
            region=split.region,
            elements=len(split.elements),
            values=(*held, *_new_materials(split)),
        )


def _new_value(study: Study, ref: FieldRef, held: float, values: Values, owners: Owners) -> NewCardValue:
    place = study.built.fields[replace(ref, region="")]
    fields, at = study.built_deck.deck.cards[place.card].fields, place.fields[0]
    return NewCardValue(
        field=ref.name,
        old_text=fields[at].strip() if at < len(fields) else "",
        value=float(values[ref]),
        rounded_value=float(held),
        parameter=owners.get(ref, ""),
    )


def _new_materials(split: Split) -> Iterable[NewCardValue]:
    for old, new in split.materials:
        yield NewCardValue(field="material", old_text=str(old), value=float(new), rounded_value=float(new))
