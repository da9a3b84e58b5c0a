"""Calls that do not fit a function are refused by name, before anything is read or solved."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.arguments import checked
from femtune.testing import example_deck, example_test

_SHOWN: dict[str, Callable[[], object]] = {
    "call.argument": lambda: ft.read_deck("frame.bdf", units=3),  # type: ignore[arg-type]
    "call.argument, an element of a list": lambda: ft.simulate("frame.bdf", ["2Z+", 3]),  # type: ignore[list-item]
    "call.argument, NUL": lambda: ft.read_deck("frame\0.bdf"),
    "call.signature": lambda: ft.modes("frame.bdf", cuont=3),  # type: ignore[call-arg]
}


@pytest.mark.parametrize("name", _SHOWN)
def test_the_page_shows_the_message(name: str) -> None:
    with pytest.raises(ft.FemtuneError) as caught:
        _SHOWN[name]()
    assert caught.value.code == name.partition(",")[0]
    check_shown(name, caught.value)


_READERS = [ft.read_deck, ft.read_test, ft.read_results, ft.modes, ft.info, ft.correlate, ft.identify, ft.report]
_READERS += [ft.Study, ft.plot.mac, ft.plot.modes, ft.plot.frf, ft.plot.parameters, ft.plot.convergence]
_READERS += [ft.plot.stabilisation, ft.to_xarray]


@pytest.mark.parametrize(
    "wrong", [3, 2.5, np.zeros((3, 1, 1)), [], {}, b"frame.bdf", object()], ids=lambda w: type(w).__name__
)
@pytest.mark.parametrize("function", _READERS, ids=lambda f: f"{f.__module__}.{f.__name__}")
def test_no_function_takes_what_is_no_source(function: Callable[..., Any], wrong: object) -> None:
    with pytest.raises(ft.FemtuneError):
        function(wrong)


def test_arrays_of_other_shapes_are_no_shapes() -> None:
    matrix = np.eye(2)
    for wrong in (3.0, "a", np.array([["a"], ["b"]]), np.ones(2), np.ones((2, 2, 2))):
        with pytest.raises(ft.FemtuneError):
            ft.mac(matrix, wrong)  # type: ignore[arg-type]


def test_an_array_is_no_table_of_a_study(tmp_path: Path) -> None:
    with pytest.raises(ft.FemtuneError) as caught:
        ft.Study(model=example_deck(tmp_path), units="m-kg-s", modes=np.array([1.0, 2.0]))
    assert caught.value.code == "study.type"


def test_new_values_have_fields_for_keys_and_numbers_for_values(tmp_path: Path) -> None:
    for wrong in ({3: 1.0}, {"PBAR 1 I1": "2"}, {"PBAR 1 I1": None}, {"PBAR 1 I1": True}):
        with pytest.raises(ft.FemtuneError) as caught:
            ft.write_deck(example_deck(tmp_path), wrong, tmp_path / "new.bdf")  # type: ignore[arg-type]
        assert caught.value.code == "call.argument"
    assert not (tmp_path / "new.bdf").exists()


@pytest.mark.slow
def test_numbers_of_numpy_are_numbers_and_aliases_are_looked_up(tmp_path: Path) -> None:
    deck, test = example_deck(tmp_path), example_test(tmp_path)
    assert len(ft.modes(deck, count=np.int64(2)).freq_hz) == 2  # type: ignore[arg-type]
    found = ft.correlate(ft.read_deck(deck, units="m-kg-s"), test)
    assert found.mac.shape[0] == 4


def test_signature_and_documentation_stay() -> None:
    def twice(value: float) -> float:
        """Two times it."""
        return 2.0 * value

    wrapped = checked(twice)
    assert (wrapped.__doc__, wrapped.__name__, wrapped(2)) == ("Two times it.", "twice", 4.0)
