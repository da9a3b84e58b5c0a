"""How many modes are solved where neither [modes] nor METHOD says it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.deck_models import model_of
from tests.messages.shown import check_shown

import femtune as ft
from femtune.model import solve_modes
from femtune.model.eigen import default_count
from femtune.model.eigen import solution as eigen_solution
from femtune.model.reduce.modes_in_basis import reduced_modes
from femtune.model.reduce.reduced_model import reduce_model

from .cantilever import Bench


def _chain(n: int = 24, more: str = "") -> str:
    """A free frame of n elements, 25 mm each, with two legs at a right angle."""
    places = ((0.025 * min(i, n // 2), 0.025 * max(i - n // 2, 0)) for i in range(n + 1))
    grids = "".join(f"GRID,{i or 100},,{x:.4f},{y:.4f},0.\n" for i, (x, y) in enumerate(places))
    bars = "".join(f"CBAR,{i},1,{i - 1 or 100},{i},0.,0.,1.\n" for i in range(1, n + 1))
    return f"{grids}{bars}PBAR,1,1,1.-3,2.-7,5.-7,4.-7\nMAT1,1,2.1+11,,.3,7850.\n{more}"


HEAD = "SOL 103\nCEND\n{}BEGIN BULK\n"


def _point(folder: Path, text: str) -> Any:
    path = folder / "chain.bdf"
    path.write_text(text)
    return model_of(path).at(np.zeros(0))


SUPPORTS = {
    "free": ("", 6),
    "clamped": ("SPC1,1,123456,100\n", 0),
    "pinned": ("SPC1,1,123,100\n", 3),
    "in a plane": ("SPC1,1,345,100,THRU,100\nSPC1,1,3,24\n", 3),
    "on a spring": ("CELAS2,900,1.+6,100,2\n", 5),
    "on soft springs": ("CELAS2,900,.01,100,2\nCELAS2,901,.01,24,2\n", 6),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SUPPORTS)
def test_free_rigid_body_motions(tmp_path: Path, name: str) -> None:
    cards, count = SUPPORTS[name]
    point = _point(tmp_path, HEAD.format("SPC = 1\n" if "SPC1" in cards else "") + _chain(more=cards) + "ENDDATA\n")
    assert default_count.free_rigid_motions(point) == count
    assert solve_modes(point).wanted == 10 + count


def test_a_deck_alone_has_ten_elastic_modes(tmp_path: Path) -> None:
    path = tmp_path / "free.bdf"
    path.write_text(HEAD.format("") + _chain() + "ENDDATA\n")
    freq = ft.modes(path).freq_hz
    assert (len(freq), int((freq > 1.0).sum())) == (16, 10)
    assert len(ft.modes(path, count=10).freq_hz) == 10


def test_a_number_and_a_frequency(tmp_path: Path) -> None:
    point = _point(tmp_path, HEAD.format("") + _chain() + "ENDDATA\n")
    all_hz = solve_modes(point, 60).freq_hz
    reached = solve_modes(point, 10, 0.5 * (all_hz[39] + all_hz[40]))
    assert reached.wanted == 40
    assert reached.freq_hz == pytest.approx(all_hz[:40], rel=1e-6, abs=1e-2)
    assert solve_modes(point, 10, 0.5 * all_hz[8]).wanted == 16
    assert solve_modes(point, None, 0.5 * (all_hz[39] + all_hz[40])).wanted == 40


def test_a_frequency_below_the_first_mode_is_told(tmp_path: Path) -> None:
    path = tmp_path / "clamped.bdf"
    path.write_text(HEAD.format("SPC = 1\n") + _chain(more=SUPPORTS["clamped"][0]) + "ENDDATA\n")
    found = ft.modes(path, max_hz=0.01)[0]
    (alert,) = [a for a in found.alerts if a.code == "eigen.none-below"]
    assert f"{found.freq_hz[0]:.4g} Hz" in alert.sentence
    check_shown("eigen.none-below", f"[{alert.code}] {alert.sentence}")


def test_no_more_than_a_limit_and_a_notice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(eigen_solution, "MOST_MODES", 30)
    point = _point(tmp_path, HEAD.format("") + _chain() + "ENDDATA\n")
    all_hz = solve_modes(point, 60).freq_hz
    found = solve_modes(point, 10, 0.5 * (all_hz[49] + all_hz[50]))
    assert found.wanted == 30
    (notice,) = [n for n in found.notices if n.code == "eigen.many-modes"]
    assert notice.what.startswith("the model has 50 modes ")
    check_shown("eigen.many-modes", notice)


def test_reduced_models_do_the_same(tmp_path: Path) -> None:
    point = _point(tmp_path, HEAD.format("") + _chain() + "ENDDATA\n")
    full = solve_modes(point, 60)
    model = reduce_model(point.configured, full.shapes, shift=full.shift)
    small = model.at(np.zeros(0))
    assert reduced_modes(small).wanted == 16
    assert reduced_modes(small, 10, 0.5 * (full.freq_hz[39] + full.freq_hz[40])).wanted == 40


def _free_study(bench: Bench, count: int = 10) -> Path:
    """A free chain and a test of its first elastic modes, without [modes]."""
    deck = bench.write("chain.bdf", HEAD.format("") + _chain() + "ENDDATA\n")
    sensors = tuple(f"{node}{d}+" for node in range(1, 25) for d in "XYZ")
    test = bench.measure(deck, *sensors, count=6 + count)
    elastic = test.modes.select_modes(range(6, 6 + count))
    bench.uff(replace(test, modes=elastic))
    text = bench.study("", deck="chain.bdf").read_text().replace("[modes]\ncount = 6\n", "")
    return bench.write("study.toml", text)


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, 10, 14])
def test_all_modes_of_a_free_structure_are_paired(bench: Bench, count: int) -> None:
    assert len(ft.correlate(_free_study(bench, count)).pairs) == count
