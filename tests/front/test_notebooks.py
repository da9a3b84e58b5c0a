"""The notebooks run from the first cell to the last; `make notebooks` executes them as Jupyter does."""

from __future__ import annotations

import json
from collections.abc import Callable
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
    _CHECKS[path.stem](names, tmp_path)


def _of_the_deck(names: dict[str, Any], folder: Path) -> None:
    assert names["result"].ok
    assert names["result"].values == pytest.approx({"root": 0.9, "tip": 1.15}, rel=0.01)
    assert names["found"].modes.freq_hz == pytest.approx(names["modes"].freq_hz[:4], rel=1e-5)
    assert (folder / "cantilever" / "updated.bdf").is_file()


def _of_the_frfs(names: dict[str, Any], folder: Path) -> None:
    """The true values within four standard deviations; the output that was held out deviates by its noise of 2 %."""
    true = {"root": 0.9, "tip": 1.15, "zeta": 0.01}
    for row in names["result"].parameters:
        assert abs(row.value - true[row.name]) < 4.0 * row.sd + 1e-6
    # the median is not moved by antiresonances, where the floor of the noise is larger than the function
    assert 0.01 < sorted(names["deviation"])[len(names["deviation"]) // 2] < 0.04
    assert (folder / "calibrated" / "report.html").is_file()


def _of_the_valley(names: dict[str, Any], folder: Path) -> None:
    """The flexibility has twice the relative error of the frequency: 2·0.02·2; the samples reach along the valley."""
    assert names["mean"] == pytest.approx(2.0, abs=0.03)
    assert names["sd"] == pytest.approx(0.08, rel=0.15)
    assert all(row.interval_95_upper > 4.0 for row in names["result"].posterior)


def _of_the_population(names: dict[str, Any], folder: Path) -> None:
    """Mean and standard deviation of thirty structures, within three standard errors of each."""
    true = {"root": (0.90, 0.05), "tip": (1.15, 0.08)}
    for row in names["result"].parameters:
        mean, sd = true[row.parameter]
        assert row.mean == pytest.approx(mean, abs=3.0 * sd / 30**0.5)
        assert row.sd == pytest.approx(sd, abs=3.0 * sd / 58**0.5)
    assert names["found"].record.population is not None


def _of_the_own_model(names: dict[str, Any], folder: Path) -> None:
    """The true stiffnesses within four standard deviations."""
    rows = names["found"].parameters
    assert [row.name for row in rows] == list(names["true"])
    for row in rows:
        assert abs(row.value - names["true"][row.name]) < 4.0 * row.sd
        assert row.sd < 0.03 * row.value
    assert (folder / "chain" / "results.json").is_file()


_CHECKS: dict[str, Callable[[dict[str, Any], Path], None]] = {
    "from_deck_to_result": _of_the_deck,
    "frf_calibration": _of_the_frfs,
    "own_model": _of_the_own_model,
    "posterior": _of_the_valley,
    "population": _of_the_population,
}


def test_every_notebook_has_a_check() -> None:
    assert sorted(_CHECKS) == [path.stem for path in _NOTEBOOKS]
