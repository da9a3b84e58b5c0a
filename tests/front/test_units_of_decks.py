"""Units that a call gives to a deck, which does not state them; completion of names."""

from __future__ import annotations

from pathlib import Path

import pytest

import femtune as ft
from femtune.testing import example_deck


@pytest.fixture(autouse=True)
def _own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Examples are written into the working folder."""
    monkeypatch.chdir(tmp_path)


@pytest.mark.slow
def test_modes_of_a_deck_in_given_units(tmp_path: Path) -> None:
    plain = ft.modes(example_deck(), count=3).freq_hz
    for source in (example_deck(), ft.read_deck(example_deck()), ft.read_deck(example_deck(), units="m-kg-s")):
        found = ft.modes(source, count=3, units="m-kg-s", report=tmp_path / "modes.html")
        assert found.freq_hz == pytest.approx(plain, rel=1e-12)


def test_other_units_than_those_of_the_source_are_refused() -> None:
    with pytest.raises(ft.FemtuneError) as error:
        ft.modes(ft.read_deck(example_deck(), units="m-kg-s"), units="mm-t-s")
    assert error.value.code == "response.units-given"


def test_completion_shows_what_users_call() -> None:
    shown = {name for name in dir(ft) if not name.startswith("__")}
    assert shown == set(ft.__all__)
    assert {name for name in dir(ft.testing) if not name.startswith("__")} == set(ft.testing.__all__)
