"""A sample of the random layouts: none is wrong without a word."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

LAYOUTS = runpy.run_path(str(Path(__file__).resolve().parents[2] / "benchmarks" / "sensors" / "layouts.py"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mesh", "change", "seed"),
    [("frame", "rotated", 1), ("plate", "shifted", 2), ("stiffened plate", "left-handed", 3), ("frame", "none", 4)],
)
def test_layouts_are_right(mesh: str, change: str, seed: int) -> None:
    assert LAYOUTS["outcome"](LAYOUTS["layout"](mesh, change, seed)) in ("right", "right, symmetry told")
