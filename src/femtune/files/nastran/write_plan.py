"""Updated values as changes of a deck: fields in place, or copies of cards for a part of their elements."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from femtune.errors import FemtuneError
from femtune.fem.values import FieldRef
from femtune.files.nastran.build import BuiltModel
from femtune.files.nastran.catalogue import CATALOGUE, MATERIAL, PROPERTY
from femtune.files.nastran.edit import EditedDeck, NewCard, edit_fields
from femtune.files.nastran.reals import format_real, rounded
from femtune.files.nastran.record import Record, records_of

Owner = tuple[str, int]
_LARGEST_NUMBER = 99_999_999


@dataclass(frozen=True)
class Split:
    """A card that was copied for some elements, which refer to the copy now."""

    source: str
    copy: str
    region: str
    elements: tuple[int, ...]


@dataclass(frozen=True)
class WritePlan:
    """An edited deck, for `write_deck`; the cards that were copied; the value that each field will hold."""

    edited: EditedDeck
    splits: tuple[Split, ...]
    values: Mapping[FieldRef, float]


def plan_edits(
    built: BuiltModel,
    updates: Mapping[FieldRef, float],
    regions: Mapping[str, Iterable[int]] | None = None,
    wide: bool = False,
) -> WritePlan:
    """Changes of the deck that bring it to updated values.

    Parameters
    ----------
    updates : new values; a reference with a region changes the field for the elements of that region only:
        its card is copied under a free number (for a material the properties that refer to it too) and the
        elements are made to refer to the copy
    regions : element numbers by name of the region
    wide : rewrite cards in large field where a value would be cut

    Raises
    ------
    FemtuneError : ``write.no-field``, ``write.unknown-region`` and those of `edit_fields`
    """
    planning = _Planning(built, wide)
    for ref, value in updates.items():
        if not ref.region:
            planning.change(ref, value)
    for region in sorted({ref.region for ref in updates if ref.region}):
        chosen = {ref: value for ref, value in updates.items() if ref.region == region}
        planning.split(region, _elements(built, region, regions or {}), chosen)
    return planning.result()


def _elements(built: BuiltModel, region: str, regions: Mapping[str, Iterable[int]]) -> set[int]:
    chosen = set(regions.get(region, ()))
    unknown = sorted(chosen - set(built.element_cards))
    if unknown or not chosen:
        what = f"region '{region}' has " + (f"element {unknown[0]}, which does not exist" if unknown else "no elements")
        raise FemtuneError("write.unknown-region", what, hint="give the numbers of elements of the model")
    return chosen


@dataclass
class _Planning:
    """Edits and new cards as they are gathered."""

    built: BuiltModel
    wide: bool
    edits: dict[tuple[int, int], float | int | str] = field(default_factory=dict)
    new_cards: list[NewCard] = field(default_factory=list)
    splits: list[Split] = field(default_factory=list)
    at: dict[FieldRef, tuple[int, int]] = field(default_factory=dict)
    values: dict[FieldRef, float] = field(default_factory=dict)
    taken: dict[str, set[int]] = field(default_factory=dict)

    def change(self, ref: FieldRef, value: float) -> None:
        """A field in place, on all stations where it is repeated."""
        plain = replace(ref, region="")
        if plain not in self.built.fields:
            raise _no_field(ref)
        place = self.built.fields[plain]
        self.edits.update({(place.card, index): float(value) for index in place.fields})
        self.at[ref] = (place.card, place.fields[0])

    def split(self, region: str, elements: set[int], updates: Mapping[FieldRef, float]) -> None:
        """Copies of cards for the elements of a region."""
        changed: dict[Owner, dict[FieldRef, float]] = {}
        for ref, value in updates.items():
            if ref.card not in CATALOGUE or CATALOGUE[ref.card].role not in (PROPERTY, MATERIAL):
                self.change(ref, value)
            else:
                changed.setdefault((ref.card, ref.id), {})[ref] = value
        copying = _Copying(self, region, changed)
        for number, owners in sorted(_owners(self.built, elements).items()):
            copying.repoint(number, owners)
        copying.finish()

    def free_number(self, prefix: str) -> int:
        """A number that no property (P) or material (M) card of the deck has."""
        taken = self.taken.setdefault(prefix, _numbers(self.built, prefix))
        highest = max(taken, default=0) + 1
        number = highest if highest <= _LARGEST_NUMBER else next(n for n in range(1, highest) if n not in taken)
        taken.add(number)
        return number

    def result(self) -> WritePlan:
        """The edited deck."""
        edited = edit_fields(self.built.deck, self.edits, new_cards=self.new_cards, wide=self.wide)
        values = {**self.values, **{ref: edited.values[at] for ref, at in self.at.items()}}
        return WritePlan(edited, tuple(self.splits), values)


@dataclass
class _Copying:
    """Copies for one region."""

    planning: _Planning
    region: str
    changed: Mapping[Owner, Mapping[FieldRef, float]]
    new: dict[Owner, int] = field(default_factory=dict)
    users: dict[Owner, list[int]] = field(default_factory=dict)
    material_of: dict[Owner, Owner] = field(default_factory=dict)

    def repoint(self, number: int, owners: Mapping[str, Owner]) -> None:
        """Make an element refer to copies of what changes."""
        built = self.planning.built
        card = built.element_cards[number]
        names = CATALOGUE[built.deck.cards[card].name].fields
        material, own = owners.get(MATERIAL), owners.get(PROPERTY)
        new_material = material is not None and material in self.changed
        if material is not None and new_material:
            self._copy(material, number)
            if own is None:
                self.planning.edits[card, names.index("MID")] = self.new[material]
        if own is not None and (own in self.changed or new_material):
            if material is not None and new_material:
                self.material_of[own] = material
            self._copy(own, number)
            self.planning.edits[card, names.index("PID")] = self.new[own]

    def _copy(self, owner: Owner, element: int) -> None:
        if owner not in self.new:
            self.new[owner] = self.planning.free_number(owner[0][0])
        self.users.setdefault(owner, []).append(element)

    def finish(self) -> None:
        """The new cards; what no element of the region uses is an error."""
        unused = [ref for owner, refs in self.changed.items() if owner not in self.new for ref in refs]
        if unused:
            raise FemtuneError("write.unknown-region", f"no element of region '{self.region}' uses {unused[0]}",
                               hint="name elements that refer to this card")  # fmt: skip
        for owner in self.new:
            self._write(owner)

    def _write(self, owner: Owner) -> None:
        record = _record(self.planning.built, owner)
        fields: list[float | int | str | None] = list(_own_fields(record))
        fields[0] = self.new[owner]
        if owner in self.material_of:
            fields[record.names.index("MID")] = self.new[self.material_of[owner]]
        for ref, value in self.changed.get(owner, {}).items():
            self._put(fields, record, ref, value)
        self.planning.new_cards.append(NewCard(record.card.position, record.name, tuple(fields)))
        source, copy = f"{owner[0]} {owner[1]}", f"{owner[0]} {self.new[owner]}"
        self.planning.splits.append(Split(source, copy, self.region, tuple(self.users[owner])))

    def _put(self, fields: list[float | int | str | None], record: Record, ref: FieldRef, value: float) -> None:
        place = self.planning.built.fields.get(replace(ref, region=""))
        if place is None:
            raise _no_field(ref)
        width = 16 if self.planning.wide else 8
        for index in place.fields:
            at = index - record.start
            fields += [""] * (at + 1 - len(fields))
            fields[at] = format_real(value, width)
        self.planning.values[ref] = rounded(value, width)


def _owners(built: BuiltModel, elements: set[int]) -> dict[int, dict[str, Owner]]:
    """For each element the property card and the material card that its values stand on."""
    refs = built.structure.values.refs
    found: dict[int, dict[str, Owner]] = {}
    for batch in built.structure.batches:
        for i, number in enumerate(batch.ids.tolist()):
            if number in elements:
                at = (refs[positions[i]] for positions in batch.roles.values())
                found[number] = {CATALOGUE[r.card].role: (r.card, r.id) for r in at}
    return found


def _record(built: BuiltModel, owner: Owner) -> Record:
    records = (r for card in built.deck.by_name(owner[0]) for r in records_of(card))
    return next(r for r in records if r.card.integer(r.start) == owner[1])


def _own_fields(record: Record) -> tuple[str, ...]:
    """Fields of a card, or of the one entry where a card holds several."""
    many = len(CATALOGUE[record.name].starts) > 1
    return record.card.fields[record.start : record.start + len(record.names)] if many else record.card.fields


def _numbers(built: BuiltModel, prefix: str) -> set[int]:
    """Numbers of the property or material cards of a deck, read or not."""
    cards = (c for name, cs in built.deck.names.items() if name[0] == prefix and name != "PARAM" for c in cs)
    return {c.integer(at) for c in cards for at in range(len(c.fields)) if at in _starts(c.name) and c.is_integer(at)}


def _starts(card: str) -> tuple[int, ...]:
    return CATALOGUE[card].starts if card in CATALOGUE else (0,)


def _no_field(ref: FieldRef) -> FemtuneError:
    return FemtuneError("write.no-field", f"{ref} has no field in the deck to be written to",
                        hint="update the fields that it follows from, or fill its field in the deck")  # fmt: skip
