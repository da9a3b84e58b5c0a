"""Degrees of freedom are read strictly and matched with their signs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from femtune.dofs import DIRECTIONS, Dof, DofSet, parse_dof
from femtune.errors import FemtuneError

_DOFS = st.builds(Dof, st.integers(1, 10**9), st.sampled_from(DIRECTIONS), st.sampled_from([1, -1]))
_SETS = st.lists(_DOFS, max_size=12, unique_by=lambda d: (d.node, d.direction)).map(DofSet)


@given(_DOFS)
def test_writing_and_reading_gives_the_same(dof: Dof) -> None:
    assert parse_dof(str(dof)) == dof


@pytest.mark.parametrize(
    "text",
    [
        "",
        "101",
        "101Z",
        "Z+",
        "101z+",
        "0Z+",
        "-1Z+",
        "101 Z+",
        "101Z++",
        "101W+",
        "101RS+",
        "1.0Z+",
        "١Z+",
        "9" * 5000 + "Z+",
    ],
)
def test_what_is_not_whole_is_refused(text: str) -> None:
    with pytest.raises(FemtuneError, match="101Z") as caught:
        parse_dof(text)
    assert caught.value.code == "dof.syntax"


@pytest.mark.parametrize(
    ("node", "direction", "sign"), [(0, "X", 1), (-3, "X", 1), (1, "Q", 1), (1, "X", 0), (1, "X", 2)]
)
def test_an_impossible_dof_is_refused(node: int, direction: str, sign: int) -> None:
    with pytest.raises(FemtuneError) as caught:
        Dof(node, direction, sign)
    assert caught.value.code == "dof.syntax"
    assert caught.value.values == {"sign": sign}


def test_dofs_sort_by_node_and_component() -> None:
    texts = ["2X+", "1RX+", "1Z-", "1X+", "1S+"]
    assert [str(d) for d in sorted(map(parse_dof, texts))] == ["1S+", "1X+", "1Z-", "1RX+", "2X+"]
    assert Dof(1, "X") >= Dof(1, "X", -1)


def test_a_direction_stands_once_whatever_its_sign() -> None:
    with pytest.raises(FemtuneError, match=r"3Y[+-] occurs twice") as caught:
        DofSet.parse(["1X+", "3Y+", "3Y-"])
    assert caught.value.code == "dof.duplicate"


@given(_SETS, st.randoms())
def test_alignment_turns_one_set_into_the_other(dofs: DofSet, random: object) -> None:
    order = list(range(len(dofs)))
    random.shuffle(order)  # type: ignore[attr-defined]
    other = DofSet(Dof(d.node, d.direction, -d.sign if i % 2 else d.sign) for i, d in enumerate(dofs)).select(order)
    motion = {(d.node, d.direction): i + 1.0 for i, d in enumerate(dofs)}
    here, there = (np.array([d.sign * motion[d.node, d.direction] for d in s]) for s in (dofs, other))
    at, signs = dofs.align(other)
    np.testing.assert_array_equal(here, signs * there[at])


def test_alignment_names_what_is_missing() -> None:
    with pytest.raises(FemtuneError, match="1 of 2 DOFs") as caught:
        DofSet.parse(["1X+", "7RZ-"]).align(DofSet.parse(["1X-"]))
    assert caught.value.code == "dof.missing"
    assert caught.value.values == {"missing": "7RZ-"}


def test_what_two_sets_have_in_common_keeps_order_and_sign_of_the_first() -> None:
    common = DofSet.parse(["3X-", "1X+", "2Y+"]).common(DofSet.parse(["1X-", "9Z+", "3X+"]))
    assert common.labels() == ["3X-", "1X+"]


def test_columns_of_numbers() -> None:
    dofs = DofSet.parse(["10S+", "11Z-", "12RY+"])
    assert dofs.nodes.tolist() == [10, 11, 12]
    assert dofs.components.tolist() == [0, 3, 5]
    assert dofs.signs.tolist() == [1.0, -1.0, 1.0]
    assert repr(dofs) == "DofSet(10S+ 11Z- 12RY+)"


def test_sets_are_values() -> None:
    assert DofSet.parse(["1X+"]) == DofSet.parse(["1X+"]) != DofSet.parse(["1X-"])
    assert len({DofSet.parse(["1X+"]), DofSet.parse(["1X+"])}) == 1
