"""Fields that a study names: ``PBAR 3 I1`` as a reference, and its position in the value table."""

from __future__ import annotations

from femtune.errors import FemtuneError, Where, did_you_mean
from femtune.fem.factors import FACTORS
from femtune.fem.mode_ratios import MODAL, mode_ratio_field
from femtune.fem.values import FieldRef
from femtune.files.nastran.build import BuiltModel
from femtune.files.nastran.catalogue import CATALOGUE, PLY_CARDS
from femtune.files.nastran.reals import parse_integer
from femtune.files.nastran.record import records_of
from femtune.files.nastran.sections import SECTION_ROLES

UPDATABLE = tuple(kind.name for kind in CATALOGUE.values() if kind.values)

# what the Nastran manuals call them, and what a study may write too
_OTHER_NAMES = {("PSHELL", "12I/T**3"): "RI", ("PSHELL", "12I/T3"): "RI", ("PSHELL", "TS/T"): "TS"}
_SHELLS = ("CQUAD4", "CTRIA3", "CQUAD8", "CTRIA6")
_MOST_NAMED = 12
_OF_DIMENSIONS = "it follows from the dimensions; update DIM1 …"
_OF_CORNERS = "a shell's thickness is that of its PSHELL or the mean of its corners; update T of the PSHELL, or T1 …"
_FOLLOWING = {
    **{(card, name): _OF_DIMENSIONS for card in ("PBARL", "PBEAML") for name in SECTION_ROLES},
    **{(card, "T"): _OF_CORNERS for card in _SHELLS},
}


BARS = ("CBAR", "CBEAM")
OF_MATRICES = ("MATRIX", "VARIABLE")
"""``MATRIX FRAME`` is the factor of a matrix that no element made, ``VARIABLE T`` what sets of matrices depend on."""
WITHOUT_CARD = (*OF_MATRICES, *FACTORS, "GENERIC")
"""What a study may move although no card of a deck holds it."""


def parse_field_ref(text: str, where: Where | None = None) -> FieldRef:
    """Read ``PBAR 3 I1``: card, number, name of the field.

    Of the whole model there are ``PARAM G``, the loss factor of all stiffness, and ``MODAL 3 ZETA``, the damping ratio
    of mode 3 (``MODAL ZETA``: of every mode without one of its own).

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
        raise _unknown(f"'{text}' is not a field", "write card, number and field, as in PBAR 3 I1", where)
    card, name = words[0], _OTHER_NAMES.get((words[0], words[2]), words[2])
    if card not in UPDATABLE:
        raise _unknown(f"'{card}' has no field that can be updated", did_you_mean(card, UPDATABLE), where)
    if (card, name) in _FOLLOWING:
        raise _derived(FieldRef(card, number, name), _FOLLOWING[card, name], where)
    if not CATALOGUE[card].holds(name):
        hint = did_you_mean(name, CATALOGUE[card].values)
        raise _unknown(f"{card} has no field '{name}' that can be updated", hint, where)
    return FieldRef(card, number, name)


def _of_modes(text: str, words: list[str], where: Where | None) -> FieldRef:
    number = parse_integer(words[1]) if len(words) == 3 else 0
    if words[-1] != "ZETA" or len(words) not in (2, 3) or number is None or (len(words) == 3 and number < 1):
        hint = 'write "MODAL 3 ZETA" for the damping ratio of mode 3, or "MODAL ZETA" for that of all modes'
        raise _unknown(f"'{text}' is no damping of modes", hint, where)
    return mode_ratio_field(number)


def _param(text: str, words: list[str], where: Where | None) -> FieldRef:
    if words != ["PARAM", "G"]:
        raise _unknown(f"'{text}' cannot be updated", "of the parameters of a deck PARAM G can be", where)
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
        raise _unknown(f"the bulk data have no {ref}", "add PARAM,G,0.0 behind BEGIN BULK", where)
    if index is None and ref.card in OF_MATRICES:
        known = [r.name for r in table.refs if r.card == ref.card]
        raise _unknown(f"the model has no {ref}", did_you_mean(ref.name, known) or "it has no matrices", where)
    if ref.card in BARS and (index is None or ref not in built.fields) and ref.id in built.element_cards:
        raise _blank(ref, where)
    if index is None:
        raise _not_in_table(built, ref, where)
    if table.is_derived(index):
        raise _derived(ref, _explanation(built, index), where)
    if not len(built.structure.users(index)):
        raise _untouched(ref, where)
    return index


def _explanation(built: BuiltModel, index: int) -> str:
    table = built.structure.values
    rule = next(d for d in table.derived if d.target == index)
    sources = " and ".join(table.refs[s].name for s in rule.sources)
    return f"its field is blank, so that it follows from {sources}; update {sources}, or fill the field in the deck"


def _not_in_table(built: BuiltModel, ref: FieldRef, where: Where | None) -> FemtuneError:
    cards = built.deck.by_name(ref.card)
    numbers = [record.card.text(record.start) for card in cards for record in records_of(card)]
    if str(ref.id) not in numbers:
        hint = did_you_mean(str(ref.id), numbers[:50]) or f"the deck has no {ref.card} card at all"
        return _unknown(f"the deck has no {ref.card} {ref.id}", hint, where)
    if ref.name.startswith("DIM"):
        return _unknown(f"the section of {ref.card} {ref.id} has no {ref.name}", "name one of its dimensions", where)
    if ref.card in _SHELLS:
        return _blank(ref, where)
    if ref.card in PLY_CARDS:
        return _no_ply(built, ref, where)
    return _untouched(ref, where)


def _no_ply(built: BuiltModel, ref: FieldRef, where: Where | None) -> FemtuneError:
    """Plies that are not there, or whose thickness is that of the ply before."""
    known = [r.name for r in built.fields if (r.card, r.id) == (ref.card, ref.id)]
    hint = f"it has {', '.join(known[:_MOST_NAMED])}" if known else "no element uses it"
    return _unknown(f"{ref.card} {ref.id} has no value {ref.name} of its own", hint, where)


def _unknown(what: str, hint: str, where: Where | None) -> FemtuneError:
    return FemtuneError("study.unknown-field", what, where=where, hint=hint)


def _derived(ref: FieldRef, why: str, where: Where | None) -> FemtuneError:
    reason, _, hint = why.rpartition("; ")
    return FemtuneError("parameter.derived-field", f"{ref} cannot be updated: {reason}", where=where, hint=hint)


def _blank(ref: FieldRef, where: Where | None) -> FemtuneError:
    """Fields of shells and offsets of bars are values where they are filled; blank ones have none of their own."""
    start = "0." if ref.name == "ZOFFS" or ref.card in BARS else "the thickness of the PSHELL"
    return FemtuneError(
        "parameter.touches-nothing",
        f"the field of {ref} is blank in the deck",
        where=where,
        hint=f"write {start} there to have it as a value of its own",
    )


def _untouched(ref: FieldRef, where: Where | None) -> FemtuneError:
    return FemtuneError(
        "parameter.touches-nothing",
        f"no element's stiffness, mass or damping depends on {ref}",
        where=where,
        hint="name a field of a card that elements of the model use",
    )
