"""The notebooks run from the first cell to the last; `make notebooks` executes them as Jupyter does."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from matplotlib import pyplot

_FOLDER = Path(__file__).resolve().parents[2] / "examples" / "notebooks"
_NOTEBOOKS = sorted(_FOLDER.glob("*.ipynb"))


def _cells(path: Path) -> list[dict[str, Any]]:
    return [c for c in json.loads(path.read_text(encoding="utf-8"))["cells"] if c["cell_type"] == "code"]


@pytest.mark.parametrize("path", _NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_outputs(path: Path) -> None:
    assert all(not cell["outputs"] and cell["execution_count"] is None for cell in _cells(path))


@pytest.mark.long  # the gate executes the notebooks as Jupyter does
@pytest.mark.parametrize("path", _NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    names: dict[str, Any] = {}
    for cell in _cells(path):
        # this is what Jupyter does with a cell
        exec(compile("".join(cell["source"]), path.name, "exec"), names)
    pyplot.close("all")
    assert names["result"].ok
    assert names["result"].values == pytest.approx({"root": 0.9, "tip": 1.15}, rel=0.01)
    assert names["found"].modes.freq_hz == pytest.approx(names["modes"].freq_hz[:4], rel=1e-5)
    assert (tmp_path / "cantilever" / "updated.bdf").is_file()
