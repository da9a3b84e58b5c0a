"""Residuals of a user's own: objects with a method `blocks`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import femtune as ft
from femtune.model import eigenvalue_derivatives
from femtune.residuals import ResidualBlock
from femtune.testing import check_residual, example_deck, example_test

from ..messages.shown import check_shown

ROOT = ft.Parameter("root", fields=["PBAR 1 I1"], lower=0.5, upper=2.0)


@pytest.fixture(autouse=True)
def _own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Examples are written into the working folder."""
    monkeypatch.chdir(tmp_path)


class FirstMode:
    """(f₁ − 25 Hz)/0.1 Hz, with a factor on its derivatives."""

    def __init__(self, factor: float = 1.0) -> None:
        self.factor = factor

    def blocks(self, state: Any, derivatives: bool) -> list[ResidualBlock]:
        hz = state.solution.freq_hz[:1]
        slopes = eigenvalue_derivatives(state.solution)[:1] / (8 * np.pi**2 * hz[:, None])
        return [ResidualBlock("first", state.case.name, "1", (hz - 25.0) / 0.1, self.factor * slopes / 0.1, 0.1 / 25.0)]


class Answer:
    """Returns what it is given."""

    def __init__(self, found: Any) -> None:
        self.found = found

    def blocks(self, state: Any, derivatives: bool) -> Any:
        return self.found


class OneArgument:
    def blocks(self, state: Any) -> list[ResidualBlock]:
        return []


def _study(*residuals: Any, **words: Any) -> ft.Study:
    model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    words = {"configurations": None, "test": test, **words}
    return ft.Study(model=model, parameters=[ROOT], residuals=list(residuals), modes={"count": 5}, **words)


def _block(values: Any, jacobian: Any, sd: Any = 0.01, **more: Any) -> list[ResidualBlock]:
    return [ResidualBlock("own", "", "all", values, jacobian, sd, **more)]


@pytest.mark.slow
def test_a_class_without_a_base_moves_the_parameter(tmp_path: Path) -> None:
    found = ft.run(_study(ft.FrequencyResidual(sd=1000.0), FirstMode()), output=tmp_path / "run")
    assert found.deck is not None
    changed = ft.modes(found.deck, count=1)
    assert changed.freq_hz[0] == pytest.approx(25.0, rel=1e-4)  # eight columns of the written field


def test_it_is_asked_in_each_configuration() -> None:
    test = ft.read_test(example_test())
    both = [ft.Configuration("one", test=test), ft.Configuration("two", test=test)]
    seen = set()

    class Names:
        def blocks(self, state: Any, derivatives: bool) -> list[ResidualBlock]:
            seen.add(state.case.name)
            return []

    first = ft.FrequencyResidual(sd=0.01, configuration="one")
    ft.select(_study(first, Names(), test=None, configurations=both))
    assert seen == {"one", "two"}


def test_right_derivatives_pass_and_wrong_ones_do_not() -> None:
    check_residual(_study(ft.FrequencyResidual(sd=0.01), FirstMode()), [0.1])
    with pytest.raises(AssertionError):
        check_residual(_study(ft.FrequencyResidual(sd=0.01), FirstMode(1.1)), [0.1])


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        ([np.array([1.0])], ("found at 0 = ndarray", "ResidualBlock")),
        (np.array([1.0]), ("found = ndarray",)),
        (None, ("found = NoneType",)),
        ([(np.ones(2), np.ones((2, 1)))], ("found at 0 = tuple",)),
        (_block(np.ones(2), np.ones((2, 3))), ("jacobian", "(2, 3)", "(2, 1)")),
        (_block(np.ones(2), np.ones(2)), ("jacobian", "(2,)", "(2, 1)")),
        (_block(np.ones((2, 1)), np.ones((2, 1))), ("values", "(2, 1)", "(2,)")),
        (_block(1.0, np.ones((1, 1))), ("values", "()", "(1,)")),
        (_block(np.array([1j]), np.ones((1, 1))), ("values", "complex")),
        (_block(np.ones(2), np.ones((2, 1)), covariance=np.eye(3)), ("covariance", "(3, 3)", "(2, 2)")),
        (_block(np.array([np.nan]), np.ones((1, 1))), ("not finite",)),
        (_block(np.ones(1), np.ones((1, 1)), 0.0), ("sd", "0.0")),
    ],
)
def test_what_blocks_returns_is_checked(answer: Any, told: tuple[str, ...]) -> None:
    with pytest.raises(ft.FemtuneError, match=r"Answer\.blocks") as error:
        ft.select(_study(ft.FrequencyResidual(sd=0.01), Answer(answer)))
    assert error.value.code == "residual.own"
    assert all(word in str(error.value) for word in told)


def test_the_message_of_a_wrong_block() -> None:
    with pytest.raises(ft.FemtuneError) as error:
        ft.select(_study(ft.FrequencyResidual(sd=0.01), Answer([np.array([1.0])])))
    check_shown("residual.own", error.value)


@pytest.mark.parametrize(("given", "told"), [(OneArgument(), "OneArgument.blocks"), (FirstMode, "FirstMode()")])
def test_what_cannot_be_called_is_refused_at_once(given: Any, told: str) -> None:
    with pytest.raises(ft.FemtuneError) as error:
        _study(given)
    assert error.value.code == "residual.own"
    assert told in str(error.value)
