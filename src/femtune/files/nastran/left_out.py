"""Effects that a deck requests and that are not modelled: preloads, contact, glue and fluid."""

from __future__ import annotations

from collections.abc import Iterator

from femtune.errors import FemtuneError, Notice, Where
from femtune.files.nastran.deck import BUCKLING, Deck
from femtune.files.nastran.loads import preload_command, preload_request

# numbers of solution sequences
_NONLINEAR = (64, 66, 99, 106, 129, 153, 400, 401, 402, 600, 601, 700)
_DIFFERENTIAL = 13
"""Old rigid format for modes with the differential stiffness of the loads of its first subcase."""
_CRAIG_BAMPTON = 31
"""Craig-Bampton solution of MYSTRAN."""
_COMPLEX_MODES = (107, 110)

# commands that change stiffness or mass, with the wording of the warning
_COMMANDS = {
    "NLIC": "deck.left-out/nonlinear",
    "MFLUID": "deck.left-out/fluid",
    "A2GG": "deck.left-out/fluid",
    "BGSET": "deck.left-out/glue",
    "BCSET": "deck.left-out/contact",
    "BCTABLE": "deck.left-out/contact",
    "BCONTACT": "deck.left-out/contact",
    "BOLTLD": "deck.left-out/bolts",
    "RGYRO": "deck.left-out/rotation",
}


# matrices that affect responses, but not real modes
_OF_RESPONSES = ("K2PP", "M2PP", "B2PP", "TFL")


def left_out(deck: Deck, preloaded: bool = True) -> list[Notice]:
    """A warning for each effect that the deck requests for its modes and that is not modelled.

    `preloaded` is True if the static preload is modelled, provided its loads are known.
    """
    distinct = {notice.code + notice.what: notice for notice in _all(deck, preloaded)}
    return list(distinct.values())


def preloads(deck: Deck) -> dict[str, FemtuneError]:
    """Errors for modes after a nonlinear solution, by the name of the command that requests it.

    Their stiffness is not modelled, and modes without it would be those of a different structure.
    """
    errors: dict[str, FemtuneError] = {}
    for notice in (*_nonlinear(deck), *_commands(deck)):
        name = str(notice.facts.get("loaded_by", ""))
        if name:
            request = notice.facts.get("request")
            errors.setdefault(name, FemtuneError("deck.preload", where=notice.where, request=request, name=name))
    return errors


def _all(deck: Deck, preloaded: bool) -> Iterator[Notice]:
    yield from _other_solutions(deck)
    yield from _preloads(deck, preloaded)
    yield from _nonlinear(deck)
    yield from _complex_modes(deck)
    yield from _commands(deck)


def _complex_modes(deck: Deck) -> Iterator[Notice]:
    number = deck.executive.solution_number
    command = next((c for c in deck.case_control.effective if c.name == "CMETHOD"), None)
    if command is not None:
        yield Notice("deck.left-out/complex-modes", where=command.where, request=command.text)
    elif number in _COMPLEX_MODES:
        where = Where(str(deck.path), record="SOL")
        yield Notice("deck.left-out/complex-modes", where=where, request=f"SOL {number}")


def _other_solutions(deck: Deck) -> Iterator[Notice]:
    """Buckling, modes under the loads of another subcase, and modes with fixed interfaces."""
    where, number = Where(str(deck.path), record="SOL"), deck.executive.solution_number
    if number in BUCKLING:
        yield Notice("deck.left-out/buckling", where=where, number=number)
    elif number == _DIFFERENTIAL:
        yield Notice("deck.left-out/differential", where=where, number=number, loads=_loads(deck))
    elif number == _CRAIG_BAMPTON:
        yield Notice("deck.left-out/fixed-interface", where=where)


def _loads(deck: Deck) -> str:
    """The static loads that any subcase selects, as written."""
    given = [c.text for c in deck.case_control.others if c.name in ("LOAD", "DEFORM") or c.name.startswith("TEMP")]
    return ", ".join(dict.fromkeys(given)) or "no load"


def _preloads(deck: Deck, preloaded: bool) -> Iterator[Notice]:
    if deck.executive.solution_number in BUCKLING:
        # its loads are for the buckling analysis only
        return
    for command in deck.case_control.effective:
        if command.name == "STATSUB" and not command.is_preload:
            yield Notice("deck.left-out/statsub", where=command.where, request=command.text)
        elif command.is_preload and not (preloaded and preload_command(deck)):
            yield Notice("deck.left-out/preload", where=command.where, request=preload_request(deck, command))


def _nonlinear(deck: Deck) -> Iterator[Notice]:
    """Modes after a nonlinear solution: earlier steps, METHOD in a nonlinear solution, or PARAM NMLOOP."""
    case, number = deck.case_control, deck.executive.solution_number
    loop = deck.params.get("NMLOOP")
    if loop is not None and loop.value not in ("", "0"):
        request = f"PARAM NMLOOP = {loop.value}"
        yield Notice("deck.left-out/nonlinear", where=loop.card.where(), request=request, loaded_by="NMLOOP")
    elif number in _NONLINEAR and case.loading:
        steps = ", ".join(case.loading)
        where = Where(str(deck.path), record=f"SOL {number}")
        request = f"SOL {number} with {steps} before the modes"
        yield Notice("deck.left-out/nonlinear", where=where, request=request, loaded_by="STEP")
    elif number in _NONLINEAR:
        where = Where(str(deck.path), record=f"SOL {number}")
        yield Notice("deck.left-out/nonlinear-solution", where=where, number=number)


def _commands(deck: Deck) -> Iterator[Notice]:
    for command in deck.case_control.effective:
        code = _COMMANDS.get(command.name)
        if code and command.value.upper() not in ("NONE", "NO", "0"):
            loaded_by = "NLIC" if command.name == "NLIC" else ""
            yield Notice(code, where=command.where, request=command.text, loaded_by=loaded_by)
        elif command.name in _OF_RESPONSES:
            yield Notice("deck.left-out/of-responses", where=command.where, level="info", request=command.text)
