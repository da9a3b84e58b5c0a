"""Which modes depend on the drilling stiffness of shells, and where it acts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.fem.assemble import assemble
from femtune.fem.drilling import drilling_energies
from femtune.files.nastran import build_structure, read_deck
from femtune.model import Configuration, configure, parametric_model, solve_modes
from femtune.model.drilling import MOST_ENERGY, drilling_modes
from femtune.parameters import ParameterSet
from structures.shells import Isotropic, Section, ShellPart, cylinder, shell_mesh, shell_structure

ISO = Isotropic(200.0, 0.3, 2.0, 0.02)


@pytest.mark.quick(0)
@pytest.mark.parametrize("cells", ["quad", "right", "quad8", "right6"])
@pytest.mark.parametrize("z0", [None, 0.07])
def test_energies_are_those_of_the_matrix(cells: str, z0: float | None) -> None:
    """uᵀ(K − K₀)u with K₀ of K6ROT 0, on a curved mesh in turned displacement frames; absent elements have none."""
    mesh = shell_mesh(cylinder(1.0, 1.0, 0.0, 1.0), 3, 2, cells)
    rng = np.random.default_rng(4)
    frames = np.array([np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in mesh.xyz])
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(ISO, 0.1, z0))], frames=frames, drilling=1e6)
    u = rng.standard_normal((structure.nodes.n_dofs, 3))
    bare = assemble(replace(structure, drilling=0.0), "stiffness")
    wanted = np.einsum("ij,ij->j", u, (assemble(structure, "stiffness") - bare) @ u)
    energies = drilling_energies(structure, u)
    np.testing.assert_allclose(energies.sum(axis=0), wanted, rtol=1e-9)
    ids = structure.batches[0].ids
    one = drilling_energies(structure, u, ids[1:].tolist())
    others = drilling_energies(structure, u, ids[:1].tolist())
    np.testing.assert_allclose(one + others, energies, atol=1e-12 * energies.max())
    assert np.count_nonzero(one[:, 0]) <= structure.batches[0].nodes.shape[1]


DECK = """SOL 103
CEND
METHOD = 1
SPC = 1
BEGIN BULK
PARAM,K6ROT,{k6rot}
EIGRL,1,,,6
{mesh}
GRID,90,,4.,3.,0.
CBAR,90,2,26,90,0.,0.,1.
CONM2,91,90,,2.0
PBAR,2,1,.01,1.-4,1.-4,1.-4
PSHELL,1,1,.01,1,,1
MAT1,1,7.+10,,.3,2700.
SPC1,1,123456,1,21
ENDDATA
"""


def sheet_with_bar(folder: Path, k6rot: float = 100.0) -> Path:
    """A sheet 4 × 1 in x and y, clamped at one end; a bar in its plane with a mass stands on its far corner."""
    grids = [f"GRID,{i + 1 + 20 * j},,{0.8 * i},{float(j)},0." for j in range(2) for i in range(6)]
    shells = [f"CQUAD4,{i},1,{i},{i + 1},{i + 21},{i + 20}" for i in range(1, 6)]
    path = folder / f"sheet_{k6rot:g}.bdf"
    path.write_text(DECK.format(k6rot=k6rot, mesh="\n".join([*grids, *shells])))
    return path


@pytest.mark.slow
def test_the_share_is_how_the_frequency_follows_k6rot(tmp_path: Path) -> None:
    """d ln f² / d ln K6ROT, by differences; all modes with more than the limit are listed, at the bar's foot."""
    solutions = []
    for k6rot in (100.0, 99.9, 100.1):
        structure = build_structure(read_deck(sheet_with_bar(tmp_path, k6rot))).structure
        model = parametric_model(structure, ParameterSet(()), ())
        solutions.append(solve_modes(configure(model, Configuration(support_set=1)).at(np.zeros(0)), 6))
    found = {mode.number: mode for mode in drilling_modes(solutions[0])}
    low, high = (np.log(s.eigenvalues[:6]) for s in solutions[1:])
    slopes = (high - low) / np.log(100.1 / 99.9)
    assert set(found) == set((np.flatnonzero(slopes > MOST_ENERGY) + 1).tolist())
    assert slopes.max() > 0.9
    for number, mode in found.items():
        assert mode.share == pytest.approx(slopes[number - 1], rel=1e-4)
        assert mode.freq_hz == solutions[0].freq_hz[number - 1]
        assert mode.grids[0] == 26


@pytest.mark.slow
def test_modes_tell_what_depends_on_k6rot(tmp_path: Path) -> None:
    result = ft.modes(sheet_with_bar(tmp_path))
    (told,) = result[0].alerts
    check_shown("model.drilling", f"[{told.code}] {told.sentence}")
    assert told.sentence in repr(result)
    assert told in result.results.alerts


def test_a_mode_of_drilling_has_no_mesh_error(tmp_path: Path) -> None:
    """A bar that only drilling holds: its frequency falls with every refinement. The other modes have their errors."""
    result = ft.modes(sheet_with_bar(tmp_path))
    assert [row["mode"] for row in result.mesh_errors if row["error_percent"] is None] == [3]
    mesh = result.records[0].mesh
    assert mesh is not None
    assert mesh.sentence.endswith(
        "; no estimate for mode 3, whose drilling stiffness (K6ROT) falls with the size of the elements"
    )


def test_bars_along_a_sheet_are_no_matter(tmp_path: Path) -> None:
    path = sheet_with_bar(tmp_path)
    lines = path.read_text().replace("CBAR,90,2,26,90", "CBAR,90,2,26,25").replace("CONM2,91,90", "CONM2,91,26")
    path.write_text(lines.replace("GRID,90,,4.,3.,0.\n", ""))
    assert ft.modes(path)[0].alerts == ()
