"""VTU files: cells in the order of VTK, shapes as solved, values of the parameters on their elements."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from tests.messages.shown import check_shown

import femtune as ft
from femtune.cli import main
from femtune.errors import FemtuneError
from femtune.files.nastran import read_deck
from femtune.files.nastran.build import build_structure
from femtune.study.vtk_cells import vtk_cells

from .cantilever import EI, Bench, modes_of_deck

# edges on which the mid-side grid points lie: as Nastran counts them, as VTK does
SOLIDS: dict[str, tuple[str, list[tuple[int, int]], list[tuple[int, int]]]] = {
    "CTETRA": ("tetra10", *2 * ([(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],)),
    "CPYRAM": ("pyramid13", *2 * ([(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)],)),
    "CPENTA": (
        "wedge15",
        [(0, 1), (1, 2), (2, 0), (0, 3), (1, 4), (2, 5), (3, 4), (4, 5), (5, 3)],
        [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
    ),
    "CHEXA": (
        "hexahedron20",
        [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 5), (2, 6), (3, 7), (4, 5), (5, 6), (6, 7), (7, 4)],
        [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)],
    ),
}
CORNERS = {
    "CTETRA": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
    "CPYRAM": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 1)],
    "CPENTA": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)],
    "CHEXA": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
}


def solid(folder: Path, card: str, leave_out: int = 0) -> Any:
    """Structure of one solid with mid-side grid points, the last of which may be left out."""
    corners = np.array(CORNERS[card], dtype=float)
    points = [*corners, *(corners[[a, b]].mean(axis=0) for a, b in SOLIDS[card][1])]
    fields = [str(k + 1) for k in range(len(points) - leave_out)]
    lines = [",".join(["", *fields[i : i + 8]]) for i in range(6, len(fields), 8)]
    grids = [f"GRID,{k + 1},,{p[0]},{p[1]},{p[2]}" for k, p in enumerate(points)]
    deck = ["SOL 103", "CEND", "BEGIN BULK", *grids, "MAT1,1,2.1+11,,.3,7850.", "PSOLID,1,1"]
    deck += [",".join([card, "7", "1", *fields[:6]]), *lines, "ENDDATA"]
    file = folder / "solid.bdf"
    file.write_text("\n".join(deck) + "\n", encoding="utf-8")
    return build_structure(read_deck(file)).structure


@pytest.mark.parametrize("card", SOLIDS)
def test_mid_side_points_lie_on_the_edges_of_vtk(tmp_path: Path, card: str) -> None:
    kind, _, edges = SOLIDS[card]
    structure = solid(tmp_path, card)
    (cells,) = vtk_cells(structure)
    assert (cells.kind, cells.elements.tolist()) == (kind, [7])
    at = structure.nodes.xyz[cells.nodes[0]]
    corners = len(CORNERS[card])
    np.testing.assert_allclose(at[corners:], [at[[a, b]].mean(axis=0) for a, b in edges], atol=1e-12)
    assert vtk_cells(structure, off={7}) == []


def test_a_solid_without_one_of_them_has_its_corners(tmp_path: Path) -> None:
    (cells,) = vtk_cells(solid(tmp_path, "CHEXA", leave_out=1))
    assert (cells.kind, cells.nodes.shape) == ("hexahedron", (1, 8))


def test_without_its_library_the_extra_is_named(beam: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(FemtuneError) as caught:
        ft.modes(beam.folder / "beam.bdf", vtu=beam.folder / "modes.vtu")
    assert caught.value.code == "install.missing"
    assert "femtune[vtu]" in (caught.value.hint or "")


class TestWithMeshio:
    @pytest.fixture(autouse=True)
    def _library(self) -> None:
        self.meshio = pytest.importorskip("meshio", reason="the extra vtu is not installed")

    def test_shapes_are_those_of_the_modes(self, beam: Bench) -> None:
        deck, file = beam.folder / "beam.bdf", beam.folder / "modes.vtu"
        assert CliRunner().invoke(main, ["modes", str(deck), "--count", "3", "--vtu", str(file)]).exit_code == 0
        mesh = self.meshio.read(file)
        assert mesh.point_data["grid point"].tolist() == [1, 2, 3, 4, 5]
        freq, shapes = modes_of_deck(deck, 3)
        for j in range(3):
            motion = mesh.point_data[f"mode {j + 1}, {freq[j]:.5g} Hz"]
            wanted = shapes.reshape(5, 6, -1)[:, :3, j]
            # one sign for all points: that of a mode is arbitrary, but not from point to point
            sign = np.sign(np.sum(motion * wanted))
            np.testing.assert_allclose(sign * motion, wanted, atol=1e-6 * np.abs(wanted).max())
        lines, masses = mesh.cells_dict["line"], mesh.cells_dict["vertex"]
        assert lines.tolist() == [[0, 1], [1, 2], [2, 3], [3, 4]]
        assert masses.tolist() == [[4]]

    @pytest.mark.slow
    def test_a_run_writes_the_updated_values_on_the_elements(self, beam: Bench) -> None:
        result = ft.run(beam.study(f"{EI}[output]\nvtu = true\n"))
        mesh = self.meshio.read(result.folder / "shapes.vtu")
        values = dict(zip(("lines", "mass"), mesh.cell_data["root: PBAR 1 I1"]))
        root = next(p for p in result.results.update.parameters if p.name == "root")
        np.testing.assert_allclose(values["lines"][:2], 2.0e-7 * root.value, rtol=1e-9)
        assert np.isnan(values["lines"][2:]).all()
        assert np.isnan(values["mass"]).all()

    @pytest.mark.parametrize(
        ("name", "case"), [("modes.vtk", "write.vtu, suffix"), ("nowhere/modes.vtu", "write.vtu, no folder")]
    )
    def test_a_file_that_cannot_be_written(
        self, beam: Bench, monkeypatch: pytest.MonkeyPatch, name: str, case: str
    ) -> None:
        monkeypatch.chdir(beam.folder)
        with pytest.raises(FemtuneError) as caught:
            ft.modes("beam.bdf", vtu=name)
        check_shown(case, caught.value)

    def test_scalar_points_cannot_be_drawn(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        springs = "SPOINT,1,2\nCELAS2,1,1000.,1,,2\nCELAS2,2,900.,1\nCMASS2,3,1.,1\nCMASS2,4,2.,2\n"
        Path("springs.bdf").write_text(f"SOL 103\nCEND\nBEGIN BULK\n{springs}ENDDATA\n", encoding="utf-8")
        with pytest.raises(FemtuneError) as caught:
            ft.modes("springs.bdf", count=2, vtu="modes.vtu")
        check_shown("write.vtu, no mesh", caught.value)
