"""What becomes of one mutant: a result, or errors that name a place. Anything else is a failure."""

from __future__ import annotations

import os
import random
import signal
import tempfile
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import numpy as np

from femtune.errors import FemtuneError, FemtuneErrors
from femtune.files.nastran import (  # fmt: skip
    BuiltDeck,
    Deck,
    build_structure,
    edit_fields,
    plan_edits,
    read_deck,
    write_deck,
)
from femtune.files.nastran.error_places import errors_at_cards
from femtune.model import Configuration, configure, parametric_model, solve_modes
from femtune.parameters import ParameterSet

from .mutations import Files, mutant

SECONDS = 20.0
_MEMORY = "/dev/shm"
FOLDER = _MEMORY if os.access(_MEMORY, os.W_OK) else None
"""Mutants are written here, in memory where that can be: writing waits until a file is on the disc."""

# problems of a whole file or of what a deck lacks: they name the file, but no line
OF_A_FILE = frozenset({"deck.not-text", "deck.not-found", "deck.unreadable", "deck.missing-set", "deck.no-points",
                       "deck.param", "deck.truncated"})  # fmt: skip
# problems of the equations: they name DOFs, and no card alone is at fault
OF_THE_EQUATIONS = frozenset({
    "eigen.mechanism", "eigen.no-mass", "eigen.no-dofs", "eigen.negative", "eigen.inaccurate", "eigen.missed-modes",
    "eigen.no-convergence", "constraint.dependent-twice", "constraint.dependent-held", "constraint.zero-coefficient",
    "constraint.circular", "deck.more-problems", "configuration.preload-not-held",
})  # fmt: skip


_AGAIN = 0.1


class TooLongError(Exception):
    """The time of a mutant is over."""


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Stops the block after so much time of the processor, so that a busy machine makes no failures."""

    def stop(number: int, frame: FrameType | None) -> None:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        raise TooLongError

    before = signal.signal(signal.SIGPROF, stop)
    # again and again: a signal that a library's thread receives does not wake this one
    signal.setitimer(signal.ITIMER_PROF, seconds, _AGAIN)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def trial(files: Files, number: int) -> tuple[str, str]:
    """Outcome of a mutant ("result", the codes of its errors, or "FAILURE") and an explanation of a failure."""
    changed = mutant(files, number)
    with tempfile.TemporaryDirectory(dir=FOLDER) as folder, warnings.catch_warnings():
        warnings.simplefilter("error")
        path = Path(folder) / "in"
        path.mkdir()
        for name, text in changed.items():
            (path / name).write_bytes(text)
        try:
            with time_limit(SECONDS):
                _use(path / next(iter(changed)), number)
        except FemtuneError as error:
            wrong = unplaced(error)
            return ("FAILURE", f"no place: {wrong}") if wrong else (error.code, "")
        except BaseException:
            return "FAILURE", traceback.format_exc()
        return "result", ""


def unplaced(error: FemtuneError) -> str:
    """Errors that don't name file and line though they could."""
    members = error.errors if isinstance(error, FemtuneErrors) else (error,)
    return "; ".join(str(e) for e in members if not _placed(e))


def _placed(error: FemtuneError) -> bool:
    has_file = error.where is not None and bool(error.where.file)
    if error.code in OF_THE_EQUATIONS:
        return bool(error.what and error.hint)
    return has_file and (error.code in OF_A_FILE or (error.where is not None and error.where.line is not None))


def _use(path: Path, number: int) -> None:
    """Read, write unchanged, build, write one value, solve."""
    deck = read_deck(path)
    _check_bytes(deck, path)
    built = build_structure(deck)
    _check_one_value(built, random.Random(number), path.parent.parent / "out")
    with errors_at_cards(built):
        model = configure(parametric_model(built.structure, ParameterSet(()), ()), Configuration())
    solution = solve_modes(model.at(np.zeros(0)), 3)
    assert np.isfinite(solution.freq_hz).all(), solution.freq_hz


def _check_bytes(deck: Deck, path: Path) -> None:
    edited = edit_fields(deck, {})
    assert edited.texts == {}
    for file in deck.files:
        assert file.text.encode("latin-1") == Path(file.file).read_bytes(), file.file
    written = write_deck(edited, path.parent.parent / "plain")
    if not written.include_changes:
        assert written.main.read_bytes() == path.read_bytes()


def _check_one_value(built: BuiltDeck, chance: random.Random, folder: Path) -> None:
    """A value that is written changes the texts of its fields, and of no other field of any card."""
    if not built.fields:
        return
    ref = chance.choice(sorted(built.fields))
    try:
        plan = plan_edits(built, {ref: chance.choice((1 / 3, 12.5, 1e-7))})
        written = write_deck(plan.edited, folder)
    except FemtuneError as error:
        if not error.code.startswith("write."):
            raise
        return
    place = built.fields[ref]
    flag = () if place.flag is None else (place.flag[0],)
    before, after = built.deck.cards, read_deck(written.main).cards
    assert [card.name for card in before] == [card.name for card in after]
    for old, new in zip(before, after):
        for i in range(max(len(old.fields), len(new.fields))):
            changed = old.position == place.card and i in (*place.fields, *flag)
            assert changed or old.text(i) == new.text(i), (str(ref), old.record, i, old.text(i), new.text(i))
    assert all(after[place.card].real(i) == plan.values[ref] for i in place.fields), str(ref)
