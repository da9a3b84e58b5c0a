"""Fields that a study names: ``PBAR 3 I1`` as a reference, and its position in the value table."""

from __future__ import annotations

from femtune.errors import FemtuneError, Where, did_you_mean
from femtune.fem.fields import AMPLITUDE, FACTORS, FieldRef
from femtune.fem.structure import MODAL, mode_ratio_field
from femtune.files.built_model import BuiltModel
from femtune.files.nastran.card import records_of
from femtune.files.nastran.catalogue import CATALOGUE, ELEMENT, PLY_CARDS
from femtune.files.nastran.lines import parse_integer
from femtune.files.nastran.sections import SECTION_ROLES

UPDATABLE = tuple(kind.name for kind in CATALOGUE.values() if kind.values)

# names in the Nastran manuals that a study may also use
_OTHER_NAMES = {("PSHELL", "12I/T**3"): "RI", ("PSHELL", "12I/T3"): "RI", ("PSHELL", "TS/T"): "TS"}
_SHELLS = tuple(kind.name for kind in CATALOGUE.values() if kind.role == ELEMENT and kind.holds("ZOFFS"))
_MOST_NAMED = 12
"""Number of known fields that a message lists."""
_OF_DIMENSIONS = "parameter.derived-field/of-dimensions"
_OF_CORNERS = "parameter.derived-field/of-corners"
_FOLLOWING = {
    **{(card, name): _OF_DIMENSIONS for card in ("PBARL", "PBEAML") for name in SECTION_ROLES},
    **{(card, "T"): _OF_CORNERS for card in _SHELLS},
}


BARS = ("CBAR", "CBEAM")
OF_MATRICES = ("MATRIX", "VARIABLE")
"""``MATRIX FRAME`` is the factor of a matrix given as such, ``VARIABLE T`` a variable of sets of matrices."""
WITHOUT_CARD = (*OF_MATRICES, *FACTORS, "GENERIC", AMPLITUDE)
"""Values that a study may change although they are not on a card of a deck."""


def parse_field_ref(text: str, where: Where | None = None) -> FieldRef:
    """Read ``PBAR 3 I1``: card, number, name of the field.

    Values of the whole model are ``PARAM G``, the loss factor of all stiffness, and ``MODAL 3 ZETA``, the damping ratio
    of mode 3 (``MODAL ZETA``: of every mode without an individual one).

    Raises
    ------
    FemtuneError : ``study.unknown-field``, ``parameter.derived-field``
    """
    words = text.upper().split()
    if words[:1] == [MODAL]:
        return _of_modes(text, words, where)
    if words[:1] == ["PARAM"]:
        return _param(text, words, where)
    if len(words) == 2 and words[0] in OF_MATRICES:
        return FieldRef(words[0], 0, words[1])
    number = parse_integer(words[1]) if len(words) == 3 else None
    if number is None:
        raise FemtuneError("study.unknown-field/form", where=where, text=text)
    card, name = words[0], _OTHER_NAMES.get((words[0], words[2]), words[2])
    if card not in UPDATABLE:
        raise FemtuneError("study.unknown-field/card", where=where, hint=did_you_mean(card, UPDATABLE), card=card)
    if (card, name) in _FOLLOWING:
        raise FemtuneError(_FOLLOWING[card, name], where=where, field=FieldRef(card, number, name))
    if not CATALOGUE[card].holds(name):
        hint = did_you_mean(name, CATALOGUE[card].values)
        raise FemtuneError("study.unknown-field/name", where=where, hint=hint, card=card, field=name)
    return FieldRef(card, number, name)


def _of_modes(text: str, words: list[str], where: Where | None) -> FieldRef:
    number = parse_integer(words[1]) if len(words) == 3 else 0
    if words[-1] != "ZETA" or len(words) not in (2, 3) or number is None or (len(words) == 3 and number < 1):
        raise FemtuneError("study.unknown-field/of-modes", where=where, text=text)
    return mode_ratio_field(number)


def _param(text: str, words: list[str], where: Where | None) -> FieldRef:
    if words != ["PARAM", "G"]:
        raise FemtuneError("study.unknown-field/param", where=where, text=text)
    return FieldRef("PARAM", 0, "G")


def resolve(built: BuiltModel, ref: FieldRef, where: Where | None = None) -> int:
    """Position of a field in the value table of a built model.

    Raises
    ------
    FemtuneError : ``study.unknown-field`` (no such card in the deck), ``parameter.touches-nothing``,
        ``parameter.derived-field``
    """
    table = built.structure.values
    index = table.index(ref)
    if ref.card == "PARAM" and ref not in built.fields:
        raise FemtuneError("study.unknown-field/no-param-g", where=where, ref=ref)
    if index is None and ref.card in OF_MATRICES:
        known = [r.name for r in table.refs if r.card == ref.card]
        raise FemtuneError(
            "study.unknown-field/no-matrix", where=where, hint=did_you_mean(ref.name, known) or None, field=ref
        )
    if ref.card in BARS and (index is None or ref not in built.fields) and ref.id in built.element_cards:
        raise _blank(ref, where)
    if index is None:
        raise _not_in_table(built, ref, where)
    if follows(built, index):
        raise FemtuneError("parameter.derived-field/blank", where=where, field=ref, sources=_sources(built, index))
    if not len(built.structure.users(index)):
        raise _untouched(ref, where)
    return index


def follows(built: BuiltModel, index: int) -> bool:
    """Whether an entry of the value table is derived from others and has no field."""
    table = built.structure.values
    return table.is_derived(index) and table.refs[index] not in built.fields


def _sources(built: BuiltModel, index: int) -> str:
    table = built.structure.values
    rule = next(d for d in table.derived if d.target == index)
    return " and ".join(table.refs[s].name for s in rule.sources)


def _not_in_table(built: BuiltModel, ref: FieldRef, where: Where | None) -> FemtuneError:
    cards = built.cards_named(ref.card)
    numbers = [record.card.text(record.start) for card in cards for record in records_of(card)]
    known = any((r.card, r.id) == (ref.card, ref.id) for r in built.fields)
    if str(ref.id) not in numbers and not known:
        hint = did_you_mean(str(ref.id), numbers[:50]) or None
        return FemtuneError("study.unknown-field/no-card", where=where, hint=hint, card=ref.card, number=ref.id)
    if ref.name.startswith("DIM"):
        return FemtuneError(
            "study.unknown-field/no-dimension", where=where, card=ref.card, number=ref.id, dimension=ref.name
        )
    if ref.card in _SHELLS:
        return _blank(ref, where)
    if ref.card in PLY_CARDS:
        return _no_ply(built, ref, where)
    return _untouched(ref, where)


def _no_ply(built: BuiltModel, ref: FieldRef, where: Where | None) -> FemtuneError:
    """Error for plies that do not exist, or whose thickness is that of the previous ply."""
    known = [r.name for r in built.fields if (r.card, r.id) == (ref.card, ref.id)]
    code = "study.unknown-field/no-ply" if known else "study.unknown-field/no-ply-unused"
    return FemtuneError(code, where=where, field=ref, known=", ".join(known[:_MOST_NAMED]))


def _blank(ref: FieldRef, where: Where | None) -> FemtuneError:
    """Error for blank fields of shells and blank offsets of bars, which have no values."""
    start = "0." if ref.name == "ZOFFS" or ref.card in BARS else "the thickness of the PSHELL"
    return FemtuneError("parameter.touches-nothing/blank", where=where, field=ref, value=start)


def _untouched(ref: FieldRef, where: Where | None) -> FemtuneError:
    return FemtuneError("parameter.touches-nothing/untouched", where=where, field=ref)
