"""Lines of keys and values: hand-counted texts, and agreement with the data of tomllib."""

from __future__ import annotations

import tomllib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from femtune.files.study_file.source import Place, line_numbers

_TEXT = '''\
# a comment with [brackets] and key = 1
title = "a # no comment, [no] = table"

[a]
x = 1  # [b]
"quoted ] key" = 'literal \\'
c.d = 3
[a.b.'e f']
y = [ # comment
  1, [2,
  3],
  { u = 1, v.w = "}" }, # trailing comma
]
[[list]]
k = """
[not.a.table]
= \\""" still text
"""
[[list]]
k = 2
m = { n = [ {o = 1}, { o = 2 } ] }
[[list.inner]]
p = 1979-05-27 07:32:00
[[list.inner]]
p = \'\'\'two
quotes\'\'\'\'\'
[list.table]
q = -inf
'''

_EXPECTED: dict[Place, int] = {
    ("title",): 2,
    ("a",): 4,
    ("a", "x"): 5,
    ("a", "quoted ] key"): 6,
    ("a", "c", "d"): 7,
    ("a", "b", "e f"): 8,
    ("a", "b", "e f", "y"): 9,
    ("a", "b", "e f", "y", 0): 10,
    ("a", "b", "e f", "y", 1, 0): 10,
    ("a", "b", "e f", "y", 1, 1): 11,
    ("a", "b", "e f", "y", 2): 12,
    ("a", "b", "e f", "y", 2, "v", "w"): 12,
    ("list", 0): 14,
    ("list", 0, "k"): 15,
    ("list", 1): 19,
    ("list", 1, "k"): 20,
    ("list", 1, "m", "n", 1, "o"): 21,
    ("list", 1, "inner", 0): 22,
    ("list", 1, "inner", 0, "p"): 23,
    ("list", 1, "inner", 1, "p"): 25,
    ("list", 1, "table", "q"): 28,
}


def _places(data: Any, place: Place = ()) -> set[Place]:
    """Places of all keys and entries in the data of tomllib."""
    pairs = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    found = {place} if place else set()
    return found.union(*(_places(value, (*place, key)) for key, value in pairs))


@pytest.mark.parametrize(("place", "line"), _EXPECTED.items(), ids=str)
def test_line_counted_by_hand(place: Place, line: int) -> None:
    assert line_numbers(_TEXT)[place] == line


def test_every_place_of_tomllib_has_a_line_and_no_other() -> None:
    assert set(line_numbers(_TEXT)) == _places(tomllib.loads(_TEXT))


_KEYS = st.sampled_from(["a", "b", '"c.d"', "'e'", "f.g"])
_VALUES = st.recursive(
    st.sampled_from(["1", "true", '"x, ]"', "'#'", '"""\n]"""', "1.5e3", '"\\""', "nan"]),
    lambda inner: (
        st.lists(inner, max_size=3).map(lambda v: "[\n" + ", ".join(v) + "\n]")
        | inner.map(lambda v: "{ h = " + v + " }")
        | inner.map(lambda v: "{ h.i = 1, j = " + v + " }")
    ),
    max_leaves=6,
)
_PAIRS = st.builds(lambda k, v, c: f"{k} = {v}{c}", _KEYS, _VALUES, st.sampled_from(["", " # [x] = 1"]))
_HEADERS = st.sampled_from(["[t]", "[[s]]", "[s.u]", "[[s.w]]", "[ t . 'v' ]", "", "# [[s]]"])


@given(st.lists(_PAIRS | _HEADERS, max_size=12).map("\n".join))
def test_places_agree_with_tomllib(text: str) -> None:
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return
    lines = line_numbers(text)
    assert set(lines) == _places(data)
    assert all(1 <= line <= text.count("\n") + 1 for line in lines.values())
