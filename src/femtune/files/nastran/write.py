"""A deck written into a folder: changed files are written there, unchanged INCLUDEs are referred to.

The main file is written as ``updated.bdf``; an included file is written beside it if it was changed or includes
a file that was. The path of an INCLUDE is rewritten only if it would no longer lead to its file.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from femtune.errors import FemtuneError, Where
from femtune.fem.fields import FieldRef
from femtune.files.nastran.build import BuiltDeck, element_record
from femtune.files.nastran.card import CardEntry, records_of
from femtune.files.nastran.catalogue import CATALOGUE, MATERIAL, PROPERTY
from femtune.files.nastran.deck import Deck
from femtune.files.nastran.edit import EditedDeck, NewCard, edit_fields, in_all_fields, new_text
from femtune.files.nastran.lines import format_real, rounded
from femtune.files.nastran.source import ENCODING, IncludeStatement, SourceLine, plain_path
from femtune.files.whole_file import write_whole

_PATH_COLUMNS = 56
"""Longest piece of a path on a line: with ``INCLUDE '`` before it, it ends before column 72."""
_STATEMENT = re.compile(r"\s*INCLUDE\s*=?\s*", re.IGNORECASE)


@dataclass(frozen=True)
class IncludeChange:
    """An INCLUDE whose path was rewritten: its place in the original deck, old and new path."""

    where: Where
    before: str
    after: str


@dataclass(frozen=True)
class WrittenDeck:
    """Files that were written (the main file first) and the INCLUDEs whose path had to change."""

    main: Path
    files: tuple[Path, ...]
    include_changes: tuple[IncludeChange, ...]


def write_deck(
    edited: EditedDeck, folder: str | Path, name: str = "updated.bdf", reserved: Collection[str] = ()
) -> WrittenDeck:
    """Write an edited deck into `folder`, which is created if it does not exist.

    `reserved` are names of other files of the folder, which changed INCLUDEs may not have.

    Raises
    ------
    FemtuneError : ``run.unwritable``, ``write.overwrites-input``
    """
    folder, deck = Path(folder), edited.deck
    check_overwrites((file.file for file in deck.files), folder, name)
    names = _new_names(edited, name, folder, reserved)
    includes = _rewritten_includes(deck, names, folder)
    replacements = {**edited.replacements, **_include_lines(deck, includes)}
    texts = {names[file.file]: new_text(file, replacements) for file in deck.files if file.file in names}
    _write(folder, texts)
    changes = tuple(
        IncludeChange(Where(one.file, one.first, "INCLUDE"), one.written, path) for one, path in includes.items()
    )
    return WrittenDeck(folder / name, tuple(folder / new for new in texts), changes)


def _new_names(edited: EditedDeck, name: str, folder: Path, reserved: Collection[str]) -> dict[str, str]:
    """Names in the run folder of all files that must be written, by their present file; never that of an input."""
    main = edited.deck.files[0].file
    written = {main} | set(edited.texts)
    for _ in edited.deck.files:
        written |= {one.file for one in edited.deck.source.includes if one.target in written}
    read = {os.path.realpath(file.file) for file in edited.deck.files}
    names = {main: name}
    for file in edited.deck.files[1:]:
        if file.file in written:
            names[file.file] = _free_name(os.path.basename(file.file), {*names.values(), *reserved}, folder, read)
    return names


def _free_name(name: str, used: set[str], folder: Path, read: set[str]) -> str:
    taken = {other.lower() for other in used}
    stem, ending = os.path.splitext(name)
    candidates = [name, *(f"{stem}_{number}{ending}" for number in range(2, len(used) + len(read) + 3))]
    return next(one for one in candidates if one.lower() not in taken and os.path.realpath(folder / one) not in read)


def check_overwrites(read: Iterable[str], folder: Path, name: str) -> None:
    """Refuse a folder in which the updated deck would overwrite a file that was read, such as an INCLUDE.

    Raises
    ------
    FemtuneError : ``write.overwrites-input``
    """
    if os.path.realpath(folder / name) in set(map(os.path.realpath, read)):
        raise FemtuneError("write.overwrites-input", where=Where(str(folder / name)))


def _rewritten_includes(deck: Deck, names: Mapping[str, str], folder: Path) -> dict[IncludeStatement, str]:
    """New paths of those INCLUDEs in written files that would no longer lead to their file."""
    new_paths = {}
    for statement in deck.source.includes:
        if statement.file in names:
            path = names.get(statement.target) or _kept_path(statement, folder)
            if path != plain_path(statement.written):
                new_paths[statement] = path
    return new_paths


def _kept_path(statement: IncludeStatement, folder: Path) -> str:
    """Path from the run folder to an unchanged file: the old one if it still leads there."""
    target = os.path.realpath(statement.target)
    spelled = plain_path(statement.written)
    if os.path.realpath(folder / spelled) == target:
        return spelled
    try:
        return os.path.relpath(target, os.path.realpath(folder)).replace("\\", "/")
    except ValueError:  # another drive
        return target.replace("\\", "/")


def _include_lines(deck: Deck, includes: Mapping[IncludeStatement, str]) -> dict[tuple[str, int], str]:
    by_file = {file.file: file.lines for file in deck.files}
    replacements: dict[tuple[str, int], str] = {}
    for statement, path in includes.items():
        lines = by_file[statement.file][statement.first - 1 : statement.last]
        replacements.update({line[:2]: "" for line in lines})
        replacements[lines[0][:2]] = _include_text(lines, path)
    return replacements


def _include_text(lines: tuple[SourceLine, ...], path: str) -> str:
    """The statement with another path; the text after the path (a comment) is kept."""
    match = _STATEMENT.match(lines[0].text)
    assert match is not None
    joined = "".join(line.text for line in lines)[match.end() :]
    quoted = joined[0] in "'\""
    rest = joined[1:].partition(joined[0])[2] if quoted else lines[-1].text[len(lines[-1].body) :]
    path = path.encode("utf-8", "surrogateescape").decode(ENCODING)
    quote = '"' if "'" in path else "'"
    ending = lines[0].ending or "\n"
    return match[0] + quote + ending.join(_path_pieces(path)) + quote + rest


def _path_pieces(path: str) -> list[str]:
    """A long path split after slashes, as no line may extend beyond column 72."""
    pieces, at = [], 0
    while len(path) - at > _PATH_COLUMNS:
        slash = path.rfind("/", at, at + _PATH_COLUMNS)
        slash = slash if slash >= at else path.find("/", at + _PATH_COLUMNS)
        if slash < 0:
            break
        pieces.append(path[at : slash + 1])
        at = slash + 1
    return [piece for piece in [*pieces, path[at:]] if piece]


def _write(folder: Path, texts: Mapping[str, str]) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            write_whole(folder / name, text.encode(ENCODING))
    except OSError as broken:
        raise FemtuneError("run.unwritable", where=Where(str(folder)), reason=broken.strerror) from broken


# ----------------------------------------------------------------------------------------------------
# Updated values as changes of a deck: fields in place, or copies of cards for a part of their elements.


Owner = tuple[str, int]
_LARGEST_NUMBER = 99_999_999
"""Largest number that fits in a field of eight columns."""


@dataclass(frozen=True)
class Split:
    """A card that was copied for some elements, which now refer to the copy.

    `values` are the updated values on the copy, `materials` the (old, new) numbers of materials that it refers to.
    """

    source: str
    copy: str
    region: str
    elements: tuple[int, ...]
    values: Mapping[FieldRef, float] = field(default_factory=dict)
    materials: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True)
class WritePlan:
    """An edited deck, for `write_deck`; the copied cards; the new value of each field.

    `places` has the field of each place (card, index) that was changed.
    """

    edited: EditedDeck
    splits: tuple[Split, ...]
    values: Mapping[FieldRef, float]
    places: Mapping[tuple[int, int], FieldRef]


def plan_edits(
    built: BuiltDeck,
    updates: Mapping[FieldRef, float],
    regions: Mapping[str, Iterable[int]] | None = None,
    wide: bool = False,
) -> WritePlan:
    """Changes that give the deck the updated values.

    Parameters
    ----------
    updates : new values; a reference with a region changes the field for the elements of that region only:
        its card is copied under a free number (for a material the properties that refer to it too) and the
        elements are made to refer to the copy
    regions : element numbers by name of the region
    wide : rewrite cards in large field if a value would be truncated

    Raises
    ------
    FemtuneError : ``write.no-field``, ``write.unknown-region`` and those of `edit_fields`
    """
    planning = _Planning(built, wide)
    for ref, value in updates.items():
        if not ref.region:
            planning.change(ref, value)
    names = sorted({ref.region for ref in updates if ref.region})
    planning.split({name: _elements(built, name, regions or {}) for name in names}, updates)
    return planning.result()


def _elements(built: BuiltDeck, region: str, regions: Mapping[str, Iterable[int]]) -> set[int]:
    chosen = set(regions.get(region, ()))
    unknown = sorted(chosen - set(built.element_cards))
    if unknown or not chosen:
        raise FemtuneError(
            "write.unknown-region",
            region=region,
            problem=f"element {unknown[0]}, which does not exist" if unknown else "no elements",
        )
    return chosen


@dataclass
class _Planning:
    """Edits and new cards, gathered step by step."""

    built: BuiltDeck
    wide: bool
    edits: dict[tuple[int, int], float | int | str] = field(default_factory=dict)
    new_cards: list[NewCard] = field(default_factory=list)
    splits: list[Split] = field(default_factory=list)
    at: dict[FieldRef, tuple[int, int]] = field(default_factory=dict)
    places: dict[tuple[int, int], FieldRef] = field(default_factory=dict)
    values: dict[FieldRef, float] = field(default_factory=dict)
    taken: dict[str, set[int]] = field(default_factory=dict)

    def change(self, ref: FieldRef, value: float) -> None:
        """Change a field in place, at all stations if it is repeated."""
        plain = replace(ref, region="")
        if plain not in self.built.fields:
            raise _no_field(ref)
        place = self.built.fields[plain]
        if place.flag is not None:
            place = place.beside({index: text for (card, index), text in self.edits.items() if card == place.card})
        if place.flag is not None:
            self.edits[place.card, place.flag[0]] = place.flag[1]
        # a value in several fields remains one value
        card = self.built.deck.cards[place.card]
        held = float(value) if self.wide else in_all_fields(card, place.fields, float(value))
        self.edits.update({(place.card, index): held for index in place.fields})
        self.places.update({(place.card, index): ref for index in place.fields})
        self.at[ref] = (place.card, place.fields[0])

    def split(self, regions: Mapping[str, set[int]], updates: Mapping[FieldRef, float]) -> None:
        """Copies of cards for the elements of regions; an element may belong to several of them."""
        changed: dict[Owner, dict[FieldRef, float]] = {}
        for ref, value in updates.items():
            if not ref.region:
                continue
            if ref.card not in CATALOGUE or CATALOGUE[ref.card].role not in (PROPERTY, MATERIAL):
                self.change(ref, value)
            else:
                changed.setdefault((ref.card, ref.id), {})[ref] = value
        copying = _Copying(self, regions, changed)
        for number, owners in sorted(_owners(self.built, set().union(*regions.values())).items()):
            copying.repoint(number, *owners)
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
        return WritePlan(edited, tuple(self.splits), values, self.places)


@dataclass(frozen=True)
class _Copy:
    """A card to be copied: its changes, and the (old, new) numbers of materials that it refers to."""

    owner: Owner
    changes: frozenset[FieldRef]
    materials: tuple[tuple[int, int], ...] = ()


@dataclass
class _Copying:
    """Copies for regions; elements with the same changes share a copy."""

    planning: _Planning
    regions: Mapping[str, set[int]]
    changed: Mapping[Owner, Mapping[FieldRef, float]]
    new: dict[_Copy, int] = field(default_factory=dict)
    users: dict[_Copy, list[int]] = field(default_factory=dict)

    def repoint(self, number: int, property_owner: Owner | None, materials: Iterable[Owner]) -> None:
        """Make an element, with its property and materials, refer to copies of the cards that change."""
        built = self.planning.built
        card = built.element_cards[number]
        if built.deck.cards[card].superelement:
            # the numbers of a part differ from those on its cards
            element = built.deck.cards[card]
            raise FemtuneError("write.superelement", where=element.where(), element=number, part=element.superelement)
        copies = {m[1]: self._copy(_Copy(m, self._changes(m, number)), number) for m in materials}
        new = tuple((old, copy) for old, copy in sorted(copies.items()) if copy)
        entry = element_record(built.deck.cards[card], number)
        if new and property_owner is None:
            self.planning.edits[card, entry.at("MID")] = new[0][1]
        new_own = (
            self._copy(_Copy(property_owner, self._changes(property_owner, number), new), number)
            if property_owner
            else 0
        )
        if new_own:
            self.planning.edits[card, entry.at("PID")] = new_own

    def _changes(self, owner: Owner, element: int) -> frozenset[FieldRef]:
        return frozenset(ref for ref in self.changed.get(owner, {}) if element in self.regions[ref.region])

    def _copy(self, copy: _Copy, element: int) -> int:
        """Number of a copy; 0 if nothing changes."""
        if not copy.changes and not copy.materials:
            return 0
        if copy not in self.new:
            self.new[copy] = self.planning.free_number(copy.owner[0][0])
        self.users.setdefault(copy, []).append(element)
        return self.new[copy]

    def finish(self) -> None:
        """The new cards; an update that no element of its region uses is an error."""
        used = {ref for copy in self.new for ref in copy.changes}
        unused = [ref for refs in self.changed.values() for ref in refs if ref not in used]
        if unused:
            raise FemtuneError(
                "write.unknown-region/card-not-used", region=unused[0].region, value_name=replace(unused[0], region="")
            )
        for copy in self.new:
            self._write(copy)

    def _write(self, copy: _Copy) -> None:
        record, number = _record(self.planning.built, copy.owner), self.new[copy]
        fields: list[float | int | str | None] = list(_own_fields(record))
        fields[0] = number
        for at in _material_fields(record):
            fields[at] = dict(copy.materials).get(record.card.integer(record.start + at), fields[at])
        held = {ref: self._put(fields, record, ref, value) for ref, value in self._held(copy, record).items()}
        self.planning.new_cards.append(NewCard(record.card.position, record.name, tuple(fields)))
        regions = ", ".join(sorted({ref.region for ref in copy.changes} or self._regions_of(copy)))
        source, made = f"{copy.owner[0]} {copy.owner[1]}", f"{copy.owner[0]} {number}"
        self.planning.splits.append(Split(source, made, regions, tuple(self.users[copy]), held, copy.materials))

    def _held(self, copy: _Copy, record: CardEntry) -> dict[FieldRef, float]:
        """New values of a copy: those of its regions, and the other changes of the card itself."""
        of_copy = {ref: self.changed[copy.owner][ref] for ref in sorted(copy.changes)}
        of_regions = {replace(ref, region="") for ref in of_copy}
        return {ref: v for ref, v in self._in_place(record).items() if ref not in of_regions} | of_copy

    def _in_place(self, record: CardEntry) -> dict[FieldRef, float]:
        """Changes of the card itself, and so of its copies."""
        planning = self.planning
        owner = (record.name, record.card.integer(record.start))
        edited = {ref: at for ref, at in planning.at.items() if not ref.region and (ref.card, ref.id) == owner}
        return {ref: float(planning.edits[at]) for ref, at in edited.items()}

    def _regions_of(self, copy: _Copy) -> set[str]:
        """Regions of the materials that a property is copied for."""
        made = {new for _, new in copy.materials}
        return {ref.region for c, n in self.new.items() if n in made and _is_material(c) for ref in c.changes}

    def _put(self, fields: list[float | int | str | None], record: CardEntry, ref: FieldRef, value: float) -> float:
        """Write a value into the fields of a copy; returns the value as rounded there."""
        place = self.planning.built.fields.get(replace(ref, region=""))
        if place is None:
            raise _no_field(ref)
        width = 16 if self.planning.wide else 8
        place = place.beside({record.start + i: text for i, text in enumerate(fields)})
        texts: dict[int, str] = {index: format_real(value, width) for index in place.fields}
        texts.update([place.flag] if place.flag else [])
        for index, text in texts.items():
            at = index - record.start
            fields += [""] * (at + 1 - len(fields))
            fields[at] = text
        held = rounded(value, width)
        if ref.region:
            self.planning.values[ref] = held
        return held


def _is_material(copy: _Copy) -> bool:
    return CATALOGUE[copy.owner[0]].role == MATERIAL


def _material_fields(record: CardEntry) -> list[int]:
    """Positions of the fields that hold the number of a material: MID, or MID1 to MID4 of a shell."""
    named = (i for i, name in enumerate(record.names) if name.startswith("MID") and i > 0)
    return [i for i in named if record.card.is_integer(record.start + i)]


def _owners(built: BuiltDeck, elements: set[int]) -> dict[int, tuple[Owner | None, tuple[Owner, ...]]]:
    """For each element, the property card and the material cards of its values."""
    refs = built.structure.values.refs
    owners: dict[int, tuple[Owner | None, tuple[Owner, ...]]] = {}
    for batch in built.structure.batches:
        for i, number in enumerate(batch.ids.tolist()):
            if number in elements:
                at = {refs[positions[i]] for positions in batch.roles.values()}
                by_role = {role: _of_role(at, role) for role in (PROPERTY, MATERIAL)}
                owners[number] = next(iter(by_role[PROPERTY]), None), by_role[MATERIAL]
    return owners


def _of_role(refs: Iterable[FieldRef], role: str) -> tuple[Owner, ...]:
    known = (r for r in refs if r.card in CATALOGUE)
    return tuple(sorted({(r.card, r.id) for r in known if CATALOGUE[r.card].role == role}))


def _record(built: BuiltDeck, owner: Owner) -> CardEntry:
    records = (r for card in built.deck.by_name(owner[0]) for r in records_of(card))
    return next(r for r in records if r.card.integer(r.start) == owner[1])


def _own_fields(record: CardEntry) -> tuple[str, ...]:
    """Fields of a card, or of one entry of a card with several."""
    many = len(CATALOGUE[record.name].starts) > 1
    return record.card.fields[record.start : record.start + len(record.names)] if many else record.card.fields


def _numbers(built: BuiltDeck, prefix: str) -> set[int]:
    """Numbers of the property or material cards of a deck, read or not."""
    cards = (c for name, cs in built.deck.names.items() if name[0] == prefix and name != "PARAM" for c in cs)
    return {c.integer(at) for c in cards for at in range(len(c.fields)) if at in _starts(c.name) and c.is_integer(at)}


def _starts(card: str) -> tuple[int, ...]:
    return CATALOGUE[card].starts if card in CATALOGUE else (0,)


def _no_field(ref: FieldRef) -> FemtuneError:
    return FemtuneError("write.no-field", value_name=ref)
