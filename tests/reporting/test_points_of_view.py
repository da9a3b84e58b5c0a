"""Numbers of points on the page, and where measured functions are for the operating shape."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from femtune.document.page_view import Packed
from femtune.testing import example_deck, example_test

from .packed import unpacked


def _view(page: Path) -> dict:
    return json.loads(re.search(r'id="view">(.*?)</script>', page.read_text(encoding="utf-8"), re.S)[1])  # type: ignore[index]


def test_points_have_the_numbers_of_the_deck_and_of_the_test(tmp_path: Path) -> None:
    deck, test = example_deck(tmp_path), example_test(tmp_path)
    study = tmp_path / "study.toml"
    study.write_text(
        f'[study]\ntitle = "beam"\ndeck = "{deck.name}"\nunits = "m-kg-s"\n[test]\nfile = "{test.name}"\n',
        encoding="utf-8",
    )
    ft.correlate(study, report=tmp_path / "page.html")
    (scene,) = _view(tmp_path / "page.html")["scenes"]
    points, numbers, places, named = (
        unpacked(Packed(**scene[key])) for key in ("points", "point_numbers", "places", "place_numbers")
    )
    text = deck.read_text(encoding="utf-8")
    grids = {int(line[8:16]): float(line[24:32] or 0) for line in text.splitlines() if line.startswith("GRID")}
    assert {int(n): round(float(x), 4) for n, x in zip(numbers, points[:, 0])} == pytest.approx(grids, abs=1e-3)
    assert {int(n): float(x) for n, x in zip(named, places[:, 0])} == pytest.approx(
        {n: grids[n] for n in map(int, named)}, abs=1e-6
    )
    assert (named > 0).all()
    assert len(np.unique(named)) == len(named)
