"""Integer lists: THRU, BY, EXCEPT, ALL."""

from __future__ import annotations

import pytest

from femtune.errors import FemtuneError, Where
from femtune.files.nastran.lists import IntegerList, read_list

HERE = Where("deck.bdf", 3, "SET")


def _read(text: str) -> IntegerList:
    return read_list(text.replace(",", " ").split(" "), HERE)


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("5", (5,)),
        ("1, 5, 10 THRU 13", (1, 5, 10, 11, 12, 13)),
        ("10 thru 20 by 5", (10, 15, 20)),
        ("10 THRU 14 EXCEPT 11, 13", (10, 12, 14)),
        ("10 THRU 20 EXCEPT 12 THRU 19, 30", (10, 11, 20, 30)),
        ("5, 6, 10 THRU 15 EXCEPT 12, 13, 77, 100 THRU 102", (5, 6, 10, 11, 14, 15, 77, 100, 101, 102)),
    ],
)
def test_lists(text: str, numbers: tuple[int, ...]) -> None:
    assert _read(text).expand() == numbers
    assert _read(text).among(range(200)) == numbers


def test_all() -> None:
    everything = _read("ALL")
    assert 12345 in everything
    assert everything.among([3, 1, 2]) == (1, 2, 3)
    with pytest.raises(ValueError, match="too long"):
        everything.expand()


def test_huge_range_costs_nothing() -> None:
    huge = _read("1 THRU 99999999 EXCEPT 7")
    assert huge.among([7, 8, 100_000_000]) == (8,)
    with pytest.raises(ValueError, match="too long"):
        huge.expand()


def test_named_numbers_are_told_from_ranges() -> None:
    chosen = _read("4, 10 THRU 12")
    assert chosen.singles == (4,)
    assert [span.numbers for span in chosen.spans] == [range(10, 13)]


@pytest.mark.parametrize(
    "text", ["THRU 5", "1 THRU", "9 THRU 3", "1 THRU 5 BY 0", "1, two", "ALL 5", "1 THRU 5 EXCEPT x"]
)
def test_wrong_lists(text: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        _read(text)
    assert caught.value.code == "deck.list"
    assert caught.value.where == HERE
