"""Choices of case control and PARAM cards: sets, eigenvalue method, mass factor, coupled mass, AUTOSPC."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from femtune.errors import FemtuneError, Notice, Where
from femtune.fem.structure import ElementBatch
from femtune.files.nastran.building import Building
from femtune.files.nastran.card import CardEntry
from femtune.files.nastran.deck import Deck, DeckParameter
from femtune.files.nastran.lines import parse_number

UNDERSTOOD_PARAMS = ("WTMASS", "COUPMASS", "GRDPNT", "AUTOSPC", "K6ROT", "SNORM", "G", "W3", "W4", "KDAMP", "CK2",
    "CM2", "CB2", "CK42")  # fmt: skip

LARGEST_NORMAL_ANGLE = 45.0
"""Largest value of PARAM SNORM, degrees from the mean normal.

Two facets are then at a right angle; at larger angles they do not approximate a smooth surface.
"""

_PROPORTIONAL = ": damping proportional to mass and stiffness is not modelled"
_WHY_IGNORED = {
    "BARMASS": ": CBAR has no torsional and rotary inertia here, as with BARMASS 0; CBEAM has torsional inertia",
    **dict.fromkeys(("ALPHA1", "ALPHA2"), _PROPORTIONAL),
}


@dataclass(frozen=True)
class EigenMethod:
    """Modes that an EIGR or EIGRL card requests: range in Hz and number; None if not given."""

    id: int
    card: str
    lower_hz: float | None
    upper_hz: float | None
    wanted: int | None


def eigen_methods(building: Building) -> dict[int, EigenMethod]:
    """Methods by number."""
    return {n: _method(r, n) for n, r in building.by_number(building.records("EIGRL", "EIGR"), "METHOD").items()}


def _method(record: CardEntry, number: int) -> EigenMethod:
    low, high = ("V1", "V2") if record.name == "EIGRL" else ("F1", "F2")
    # with the old inverse power method NE is an estimate; with all methods ND is the requested number
    return EigenMethod(
        number, record.name, record.real(low, None), record.real(high, None), record.integer("ND", None)
    )  # fmt: skip


def check_selected(building: Building, kind: str, number: int | None, known: Collection[int]) -> None:
    """The set that case control selects must exist (error ``deck.missing-set``)."""
    if number is not None and number not in known:
        with building.errors.catch():
            raise _missing(building.deck, kind, number, known)


def selected_equations(building: Building, number: int | None, known: Collection[int]) -> int | None:
    """MPC set that case control selects; if there are no such equations none apply, as in Nastran."""
    if number is None or number in known:
        return number
    building.notices.append(
        Notice("deck.missing-set/no-mpc-cards", where=Where(str(building.deck.path), record="MPC"), number=number)
    )
    return None


def _missing(deck: Deck, kind: str, number: int, known: Collection[int]) -> FemtuneError:
    cards = {
        "SPC": "SPC, SPC1 or SPCADD",
        "MPC": "MPC or MPCADD",
        "METHOD": "EIGR or EIGRL",
        "SDAMPING": "TABDMP1",
        "NSM": "NSM, NSM1, NSML, NSML1 or NSMADD",
    }[kind]
    shown = ", ".join(map(str, sorted(known)[:10]))
    return FemtuneError(
        "deck.missing-set",
        where=Where(str(deck.path), record=kind),
        hint=f"select one that exists: {shown}" if shown else f"add the {cards} card or remove the line",
        kind=kind,
        number=number,
        cards=cards,
    )


def real_param(building: Building, name: str, default: float) -> float:
    """Value of a PARAM that is a number (error ``deck.param``)."""
    given = building.deck.params.get(name)
    if given is None or not given.value:
        return default
    value = parse_number(given.value)
    if value is not None:
        return value
    with building.errors.catch():
        raise _bad_param(name, given, "a number")
    return default


def mass_factor(building: Building) -> float:
    """PARAM WTMASS, by which masses are multiplied (error ``deck.param`` unless it is above zero)."""
    value = real_param(building, "WTMASS", 1.0)
    if value > 0.0:
        return value
    with building.errors.catch():
        raise _bad_param("WTMASS", building.deck.params["WTMASS"], "above zero")
    return 1.0


def coupled_mass(building: Building) -> bool:
    """PARAM COUPMASS: 1 or YES is consistent mass; blank, −1 or NO is lumped."""
    return _switch(building, "COUPMASS", {"1": True, "YES": True, "-1": False, "0": False, "NO": False}, False)


def hold_singular(building: Building) -> bool:
    """AUTOSPC of case control, else PARAM AUTOSPC; YES by default, as in normal modes."""
    words = {"YES": True, "NO": False, "1": True, "0": False, "-1": False}
    for command in building.deck.case_control.effective:
        word = command.value.upper()
        if command.name == "AUTOSPC" and word in words:
            return words[word]
    return _switch(building, "AUTOSPC", words, True)


def drilling_factor(building: Building, batches: Collection[ElementBatch]) -> float:
    """PARAM K6ROT, the stiffness of shells against rotation about their normal; 100 by default.

    Zero if every shell is a membrane: commercial Nastran then ignores K6ROT, as its listing of a wing of membranes and
    rods shows.
    """
    bends = [b.facts["has_bending"].any() for b in batches if "has_bending" in b.facts]
    value = real_param(building, "K6ROT", 100.0)
    if value >= 0.0:
        return value if any(bends) or not bends else 0.0
    with building.errors.catch():
        raise _bad_param("K6ROT", building.deck.params["K6ROT"], "zero or more")
    return 100.0


def normal_angle(building: Building) -> float:
    """PARAM SNORM, degrees from their mean normal up to which shells share it; 20 by default."""
    value = real_param(building, "SNORM", 20.0)
    if value < 0.0:
        with building.errors.catch():
            raise _bad_param("SNORM", building.deck.params["SNORM"], "zero or more")
    if value > LARGEST_NORMAL_ANGLE:
        given = building.deck.params["SNORM"]
        where, most = given.card.where(), LARGEST_NORMAL_ANGLE
        building.notices.append(
            Notice("deck.ignored-param/normals", where=where, given_value=given.value, most=f"{most:g}")
        )
    return min(value, LARGEST_NORMAL_ANGLE)


def _switch(building: Building, name: str, words: dict[str, bool], default: bool) -> bool:
    given = building.deck.params.get(name)
    if given is None or not given.value:
        return default
    if given.value.upper() in words:
        return words[given.value.upper()]
    with building.errors.catch():
        raise _bad_param(name, given, " or ".join(words))
    return default


def _bad_param(name: str, given: DeckParameter, expected: str) -> FemtuneError:
    return given.card.error("deck.param", index=1, name=name, expected=expected)


def ignored_params(deck: Deck) -> list[Notice]:
    """Notices of PARAM cards that are not interpreted; a warning if one would change the modes of the deck."""
    return [
        Notice(
            "deck.ignored-param",
            where=given.card.where(),
            level="warning" if name == "BARMASS" and given.value not in ("", "0") else "info",
            name=name,
            given_value=given.value,
            reason=_WHY_IGNORED.get(name, ""),
        )
        for name, given in deck.params.items()
        if name not in UNDERSTOOD_PARAMS
    ]
