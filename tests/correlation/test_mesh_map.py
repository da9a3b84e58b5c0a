"""Common points of two meshes: by definition, and the modes of plates and beams with different meshes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from tests.messages.shown import check_shown

import femtune as ft
from femtune.cli.commands import main
from femtune.correlation.mesh_map import map_meshes
from femtune.errors import FemtuneError
from femtune.modal import mac
from femtune.testing import example_deck


def test_pairs_are_each_others_nearest() -> None:
    rng = np.random.default_rng(2)
    first, second = rng.random((60, 3)), rng.random((45, 3))
    away = np.linalg.norm(first[:, None] - second[None], axis=2)
    found = map_meshes(first, second, 0.15, most=100)
    expected = {
        (i, j) for i in range(60) for j in range(45)
        if away[i, j] <= 0.15 and away[i, j] == away[i].min() == away[:, j].min()
    }  # fmt: skip
    assert set(zip(found.first.tolist(), found.second.tolist())) == expected
    np.testing.assert_array_equal(found.distance, away[found.first, found.second])


def test_few_points_are_spread_over_the_structure() -> None:
    line = np.linspace(0.0, 1.0, 101)[:, None] * [1.0, 0.0, 0.0]
    found = map_meshes(line, line, 0.1, most=5)
    np.testing.assert_allclose(line[found.first, 0], [0.0, 0.25, 0.5, 0.75, 1.0], atol=0.011)


def cantilever(parts: int, rise: float = 0.0, first: int = 1) -> str:
    """A beam of bars along X, one metre, with another numbering and height."""
    lines = ["SOL 103", "CEND", "SPC = 1", "METHOD = 1", "BEGIN BULK", "EIGRL,1,,,5"]
    lines += [f"GRID,{first + i},,{i / parts:.6f},0.0,{rise}" for i in range(parts + 1)]
    lines += [f"CBAR,{i + 1},1,{first + i},{first + i + 1},0.0,1.0,0.0" for i in range(parts)]
    lines += ["PBAR,1,1,1.0-4,1.0-9,4.0-9,1.0-9", "MAT1,1,2.1+11,,0.3,7850.0", f"SPC1,1,123456,{first}", "ENDDATA"]
    return "\n".join(lines) + "\n"


@pytest.fixture
def two(tmp_path: Path) -> tuple[Path, Path]:
    """Two meshes of a beam, the second beside the first."""
    for name, text in (("coarse", cantilever(8)), ("fine", cantilever(20, 0.004, 501))):
        (tmp_path / f"{name}.bdf").write_text(text)
    return tmp_path / "coarse.bdf", tmp_path / "fine.bdf"


@pytest.mark.slow
def test_two_meshes_of_a_beam(two: tuple[Path, Path]) -> None:
    """MAC as of the modes of each mesh at the common points, frequencies as of each deck alone."""
    found = ft.compare(*two, count=4, units="m-kg-s")
    table = found.arrays["common_points"]
    # every fourth of an eighth and of a twentieth, but for the clamped end
    np.testing.assert_array_equal(table[:, :2], [[3, 506], [5, 511], [7, 516], [9, 521]])
    np.testing.assert_allclose(table[:, 2], 0.004)
    one, other = (ft.modes(path, count=10).mode_sets["baseline"] for path in two)
    rows = [
        [6 * (n - 1) + c for n in (3, 5, 7, 9) for c in range(3)],
        [6 * n + c for n in (5, 10, 15, 20) for c in range(3)],
    ]
    expected = mac(one.shapes[rows[0], :4], other.shapes[rows[1]])
    np.testing.assert_allclose(found.mac, expected, atol=1e-9)
    pairs = found.pairs
    np.testing.assert_allclose(pairs.column("test_freq_hz").astype(float), one.freq_hz[:4], rtol=1e-9)
    for hz, number in zip(pairs.column("model_freq_hz"), pairs.column("model_number")):
        assert hz == pytest.approx(other.freq_hz[int(number) - 1], rel=1e-9)
    # a lumped beam of eight elements: the first bending modes differ by less than one per cent
    assert np.abs(pairs.column("freq_error_percent").astype(float)[:2]).max() < 1.0


@pytest.mark.slow
def test_the_command(two: tuple[Path, Path]) -> None:
    told = CliRunner().invoke(main, ["compare", *map(str, two), "--count", "3", "--units", "m-kg-s"])
    assert told.exit_code == 0, told.output
    assert "4 points are compared; the mean distance between the meshes is 0.004" in told.output
    assert "MAC" in told.output


def test_meshes_that_are_apart(two: tuple[Path, Path]) -> None:
    two[1].write_text(cantilever(20, 0.5))
    with pytest.raises(FemtuneError) as caught:
        ft.compare(*two, count=3, units="m-kg-s")
    check_shown("correlate.no-common-points", caught.value)


@pytest.mark.parametrize(("tolerance", "most"), [(-0.1, 300), (0.1, 2), (0.1, -1)])
def test_impossible_options(tolerance: float, most: int) -> None:
    with pytest.raises(FemtuneError) as caught:
        map_meshes(np.eye(3), np.eye(3), tolerance, most)
    assert caught.value.code == "correlate.no-common-points"
    assert "must not be negative" in str(caught.value)


def test_decks_without_units_are_not_compared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FemtuneError) as caught:
        ft.compare(example_deck(), example_deck(), count=4)
    assert caught.value.where is not None
    check_shown("response.units-needed, compared", str(caught.value).replace(caught.value.where.file, "deck.bdf"))
