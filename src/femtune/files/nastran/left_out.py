"""What a deck requests and the modes of femtune leave out: preloads, contact, glue and fluid."""

from __future__ import annotations

from collections.abc import Iterator

from femtune.errors import FemtuneError, Notice, Where
from femtune.files.nastran.case_control import CaseCommand
from femtune.files.nastran.deck import Deck

_NONLINEAR = (106, 129, 153, 400, 401, 402, 600, 601, 700)
_BUCKLING = 105
_COMPLEX_MODES = (107, 110)
_OF_STATSUB = ("", "(PRELOAD)")

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


# matrices that enter responses, but no real modes
_OF_RESPONSES = ("K2PP", "M2PP", "B2PP", "TFL")


def left_out(deck: Deck) -> list[Notice]:
    """A warning for each effect that the deck requests for its modes and that is not modelled."""
    found = {notice.code + notice.what: notice for notice in _all(deck)}
    return list(found.values())


def preloads(deck: Deck) -> dict[str, FemtuneError]:
    """Why the modes of a deck whose structure is loaded first are not solved, by the name of what requests the load.

    The differential stiffness is not modelled, and the modes without it would be those of another structure.
    """
    found: dict[str, FemtuneError] = {}
    for notice in (*_preloads(deck), *_nonlinear(deck), *_commands(deck)):
        name = str(notice.facts.get("loaded_by", ""))
        if name:
            request = notice.facts.get("command") or notice.facts.get("request")
            request = f"{request}{notice.facts.get('loads', '')}"
            found.setdefault(name, FemtuneError("deck.preload", where=notice.where, request=request, name=name))
    return found


def _all(deck: Deck) -> Iterator[Notice]:
    yield from _preloads(deck)
    yield from _nonlinear(deck)
    yield from _complex_modes(deck)
    yield from _commands(deck)


def _complex_modes(deck: Deck) -> Iterator[Notice]:
    number = deck.executive.solution_number
    command = next((c for c in deck.case_control.effective if c.name == "CMETHOD"), None)
    if command is not None:
        yield Notice("deck.left-out/complex-modes", where=command.where, request=_text(command))
    elif number in _COMPLEX_MODES:
        where = Where(str(deck.path), record="SOL")
        yield Notice("deck.left-out/complex-modes", where=where, request=f"SOL {number}")


def _preloads(deck: Deck) -> Iterator[Notice]:
    if deck.executive.solution_number == _BUCKLING:
        yield Notice("deck.left-out/buckling", where=Where(str(deck.path), record="SOL"))
        return
    for command in deck.case_control.effective:
        if command.name == "STATSUB" and command.options.replace(" ", "").upper() in _OF_STATSUB:
            loads = ", ".join(_text(load) for load in deck.case_control.preload)
            of_loads = f" ({loads})" if loads else ""
            text, name = _text(command), "STATSUB" if loads else ""
            yield Notice("deck.left-out/preload", where=command.where, command=text, loads=of_loads, loaded_by=name)


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
        # a deck without METHOD does not request modes; it only serves as the model
        level = "info" if case.method is None else "warning"
        yield Notice("deck.left-out/nonlinear-solution", where=where, level=level, number=number)


def _commands(deck: Deck) -> Iterator[Notice]:
    for command in deck.case_control.effective:
        code = _COMMANDS.get(command.name)
        if code and command.value.upper() not in ("NONE", "NO", "0"):
            loaded_by = "NLIC" if command.name == "NLIC" else ""
            yield Notice(code, where=command.where, request=_text(command), loaded_by=loaded_by)
        elif command.name in _OF_RESPONSES:
            yield Notice("deck.left-out/of-responses", where=command.where, level="info", request=_text(command))


def _text(command: CaseCommand) -> str:
    return f"{command.name}{command.options} = {command.value}"
