"""Superelements that just miss each other, are joined over a distance, are absent, or have other units; their cost."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from femtune.errors import FemtuneError
from femtune.files.nastran import Deck, build_structure, superelements

DeckOf = Callable[..., Deck]
CARDS = "MAT1,1,7.+10,,.3,2700.\nPSHELL,1,1,.02,1,,1\n"


def _plate(first: int, start: float, lifted: float = 0.0) -> str:
    """Three shells in a row; the first of their upper points is lifted."""
    grids = [
        (first + 2 * i + j, start + i, 0.5 * j + (lifted if (i, j) == (0, 1) else 0.0))
        for i in range(4)
        for j in (0, 1)
    ]
    out = "".join(f"GRID,{n},,{x:.4f},{y:.4f},0.\n" for n, x, y in grids)
    return out + "".join(
        f"CQUAD4,{first + i},1,{first + 2 * i},{first + 2 * i + 2},{first + 2 * i + 3},{first + 2 * i + 1}\n"
        for i in range(3)
    )


def _deck(part: str, main: str = "", case: str = "SPC = 1\n") -> str:
    head = f"SOL 103\nCEND\n{case}BEGIN BULK\n{CARDS}SPC1,1,123456,1,2\n{_plate(1, 0.0)}{main}"
    return f"{head}BEGIN SUPER=3\n{CARDS}{part}ENDDATA\n"


def _told(deck: Deck) -> list[str]:
    codes = ("deck.superelement", "deck.inactive-set")
    said = [n.what for n in build_structure(deck).notices if n.code in codes]
    return [what for what in said if "solved together" not in what and "are increased" not in what]


def test_sound_parts_raise_no_doubt(deck_of: DeckOf) -> None:
    assert _told(deck_of(_deck(_plate(101, 3.0)))) == []


@pytest.mark.parametrize("miss", [3e-4, 0.01])
def test_points_that_just_miss(deck_of: DeckOf, miss: float) -> None:
    (what,) = _told(deck_of(_deck(_plate(101, 3.0, miss))))
    assert "1 pair of grid points of superelements 0 and 3 just miss each other" in what
    assert f"grid points 8 and 102 are {miss:g} apart" in what


def test_points_an_element_apart_are_no_miss(deck_of: DeckOf) -> None:
    assert _told(deck_of(_deck(_plate(101, 3.0, 0.2)))) == []


def test_a_tolerance_that_joins_distant_points(deck_of: DeckOf) -> None:
    (what,) = _told(deck_of(_deck(_plate(101, 3.0, 0.1), "SEBULK,3,PRIMARY,,AUTO,.2\n")))
    assert "1 pair of points that are not in one place: grid points 8 and 102 are 0.1 apart" in what


def test_listed_pairs_that_are_apart(deck_of: DeckOf) -> None:
    main = "SEBULK,3,PRIMARY,,MANUAL\nSECONCT,3,0,9.,NO\n,107,7,108,8\n"
    (what,) = _told(deck_of(_deck(_plate(101, 3.0), main)))
    assert "SECONCT 3 joins 2 pairs of points that are not in one place: grid points 108 and 8 are 3 apart" in what


def test_a_part_joined_with_itself(deck_of: DeckOf) -> None:
    with pytest.raises(FemtuneError, match="joins superelement 3 with itself"):
        build_structure(deck_of(_deck(_plate(101, 3.0), "SECONCT,3,3\n,101,102\n")))


def test_selections_of_an_absent_part(deck_of: DeckOf) -> None:
    case = "SPC = 1\nSUBCASE 1\nSUPER = 0\nSUBCASE 2\nSUPER = 5\nSPC = 7\n"
    (what,) = _told(deck_of(_deck(_plate(101, 3.0), case=case)))
    assert "superelement 5, which the deck does not have; its superelements are 3" in what


def test_supports_of_a_part_that_its_subcase_does_not_select(deck_of: DeckOf) -> None:
    case = "SUBCASE 1\nSUPER = 0\nSPC = 1\nSUBCASE 2\nSUPER = 3\nLABEL = part\n"
    (what,) = _told(deck_of(_deck(_plate(101, 3.0) + "SPC1,7,3,108\n", case=case)))
    assert "SPC set 7 has no effect: case control selects no SPC" in what


def test_a_part_in_other_units(deck_of: DeckOf) -> None:
    text = _deck(_plate(101, 3.0))
    head, _, part = text.partition("BEGIN SUPER")
    (what,) = _told(deck_of(head + "BEGIN SUPER" + part.replace("2700.", "2.7-9")))
    assert "density of superelement 3 is 2.7e-09, that of the main bulk data 2.7e+03" in what


def test_the_search_is_linear_in_the_parts(deck_of: DeckOf, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a row of parts each is compared with its neighbours only."""
    searched: list[tuple[int, int]] = []
    search = superelements.joined_pairs

    def counted(deck: Deck, sections: Any, meshes: Any, i: int, j: int) -> Iterator[Any]:
        searched.append((i, j))
        return search(deck, sections, meshes, i, j)

    monkeypatch.setattr(superelements, "joined_pairs", counted)
    parts = "".join(f"BEGIN SUPER={k}\n{CARDS}{_plate(100 * k, 3.0 * k)}" for k in range(1, 13))
    build_structure(deck_of(f"SOL 103\nCEND\nBEGIN BULK\n{CARDS}{_plate(1, 0.0)}{parts}ENDDATA\n"))
    assert searched == [(k, k + 1) for k in range(12)]
