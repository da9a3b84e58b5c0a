"""Ten thousand damaged decks: each gives a result, or an error with file and line; never a traceback or a hang."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import pytest

from femtune.errors import FemtuneError, FemtuneErrors, Where
from femtune.files.nastran import build_structure, read_deck
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.error_places import errors_at_cards

from .card_samples import decks_of_samples, names_in
from .mutant_trial import trial, unplaced
from .mutations import mutant
from .whole_decks import DECKS

Sources = Mapping[str, Mapping[str, bytes]]
_HELD = names_in("".join(text for files in DECKS.values() for text in files.values()))
_FILES = {**DECKS, **{name: {"deck.bdf": text} for name, text in decks_of_samples(_HELD).items()}}
OWN: Sources = {name: {n: text.encode("latin-1") for n, text in files.items()} for name, files in _FILES.items()}
REFERENCE = ("beam_modes.dat", "satk.dat", "cbush.dat", "pt145.bdf", "random_test_bar_plus_tri.bdf",
             "actuator_tf_modeling.bdf", "004_72_bar_truss/modes.dat", "002_svanberg_beam/modes.dat",
             "002_svanberg_beam/svanberg.bdf")  # fmt: skip
QUICK, GATE, SOME, ALL = 20, 60, 500, 10_000


def reference_sources(folder: Path) -> Sources:
    """Small decks of other programs, each with the files of its folder that it includes."""
    found: dict[str, dict[str, bytes]] = {}
    for name in REFERENCE:
        deck = name.partition("/")[0]
        found.setdefault(deck, {})["deck.bdf" if deck not in found else Path(name).name] = (folder / name).read_bytes()
    return found


def run(sources: Sources, number: int) -> tuple[int, str, str, str]:
    name = list(sources)[number % len(sources)]
    return number, name, *trial(sources[name], number)


def failures(outcomes: Iterable[tuple[int, str, str, str]], codes: Counter[str]) -> list[str]:
    """Numbers of the mutants that failed and why; outcomes are counted in `codes`."""
    found = []
    for number, name, outcome, why in outcomes:
        codes[outcome] += 1
        if outcome == "FAILURE":
            found.append(f"mutant {number} of {name}:\n{why}")
    return found


def test_the_decks_hold_every_card() -> None:
    text = "".join(text.decode("latin-1") for files in OWN.values() for text in files.values())
    assert set(CATALOGUE) - names_in(text) == set()


@pytest.mark.parametrize("name", OWN)
@pytest.mark.quick(2)
def test_the_decks_are_sound(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(trial.__globals__, "mutant", lambda files, number: dict(files))
    assert trial(OWN[name], 1) == ("result", "")


def test_mutants_are_the_same_again_and_changed() -> None:
    both = [[mutant(OWN["frame"], number) for number in range(100)] for _ in range(2)]
    assert both[0] == both[1]
    assert sum(one != OWN["frame"] for one in both[0]) > 90


# about a quarter is understood; of a small number it may be less
@pytest.mark.slow
@pytest.mark.parametrize(
    ("count", "kinds", "understood"),
    [
        (QUICK, 4, 1 / 8),
        pytest.param(GATE, 8, 1 / 8, marks=pytest.mark.slow),
        pytest.param(SOME, 20, 1 / 5, marks=pytest.mark.long),
    ],
)
def test_mutants_of_our_own_decks(count: int, kinds: int, understood: float) -> None:
    codes: Counter[str] = Counter()
    assert not failures((run(OWN, number) for number in range(count)), codes)
    assert codes["result"] > understood * count
    assert len(codes) > kinds


@pytest.mark.long
def test_ten_thousand_mutants(shared_data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sources = {**OWN, **reference_sources(shared_data / "nastran_decks")}
    codes: Counter[str] = Counter()
    for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        # matrices are tiny, and threads that wait for work take the cores from the other processes
        monkeypatch.setenv(name, "1")
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        found = failures(pool.map(partial(run, sources), range(ALL), chunksize=50), codes)
    assert not found, "\n\n".join(found[:5])
    assert sum(codes.values()) == ALL


# -- the trial itself can fail


@pytest.mark.parametrize(
    ("code", "where", "good"),
    [
        ("deck.material", Where("a.bdf", 3, "MAT1 1"), True),
        ("deck.material", Where("a.bdf", None, "MAT1 1"), False),
        ("deck.material", Where(record="MAT1 1"), False),
        ("deck.material", None, False),
        ("deck.not-text", Where("a.bdf"), True),
        ("eigen.mechanism", None, True),
    ],
)
def test_errors_without_a_place_are_found(code: str, where: Where | None, good: bool) -> None:
    error = FemtuneError(code, "what", where=where, hint="mend it")
    assert (unplaced(error) == "") is good
    assert (unplaced(FemtuneErrors([FemtuneError("x.y", "", where=Where("f", 1)), error])) == "") is good


def test_a_traceback_and_a_hang_are_failures(monkeypatch: pytest.MonkeyPatch) -> None:
    space = trial.__globals__
    monkeypatch.setitem(space, "_use", lambda path, number: 1 / 0)
    assert trial(OWN["shells"], 0)[0] == "FAILURE"

    def forever(path: Path, number: int) -> None:
        while True:
            pass

    monkeypatch.setitem(space, "SECONDS", 0.05)
    monkeypatch.setitem(space, "_use", forever)
    outcome, why = trial(OWN["shells"], 0)
    assert outcome == "FAILURE"
    assert "TooLongError" in why


def test_errors_of_elements_get_the_place_of_their_card(tmp_path: Path) -> None:
    (tmp_path / "deck.bdf").write_bytes(OWN["springs"]["deck.bdf"])
    built = build_structure(read_deck(tmp_path / "deck.bdf"))
    kernel = FemtuneError("element.zero-length", "what", where=Where(record="CROD 1"), hint="h", element=1)
    unknown = FemtuneError("constraint.circular", "what", where=Where(record="MPC"))
    with pytest.raises(FemtuneErrors) as caught, errors_at_cards(built):
        raise FemtuneErrors([kernel, unknown])
    places = [error.where for error in caught.value.errors]
    assert places[0] == built.deck.by_name("CROD")[0].where()
    assert places[1] == Where(record="MPC")
    with pytest.raises(FemtuneError) as alone, errors_at_cards(built):
        raise kernel
    assert alone.value.where == places[0]
