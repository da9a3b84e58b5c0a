"""Errors of mesh and mass against closed forms: cantilevers and a simply supported plate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from femtune.fem import FieldRef
from femtune.files.nastran import read_deck
from femtune.files.nastran.build import build_structure
from femtune.model import Configuration, EigenSolution, configure, parametric_model, solve_modes
from femtune.model.mesh_error import MeshChange, mass_change, mesh_change
from femtune.model.parametric import Assignment
from femtune.parameters import Parameter, ParameterSet

E, RHO, AREA, MOMENTS = 2.1e11, 7850.0, 1e-3, (2e-7, 5e-7)


def _modes(text: str, folder: Path, count: int, configuration: Configuration | None = None) -> EigenSolution:
    (folder / "deck.bdf").write_text(text)
    structure = build_structure(read_deck(folder / "deck.bdf")).structure
    model = parametric_model(structure, ParameterSet(()), ())
    return solve_modes(configure(model, configuration or Configuration()).at(np.zeros(0)), count)


def _deck(bulk: list[str], coupled: bool) -> str:
    head = ["SOL 103", "CEND", "SPC = 1", "METHOD = 1", "BEGIN BULK", "EIGRL,1,,,6"]
    return "\n".join([*head, f"PARAM,COUPMASS,{1 if coupled else -1}", *bulk, "ENDDATA", ""])


def cantilever(bars: int, coupled: bool) -> str:
    """One metre along x, clamped at the origin, bending in two planes."""
    out = ["MAT1,1,2.1+11,,0.3,7850.", "PBAR,1,1,1.-3,2.-7,5.-7,4.-7", "SPC1,1,123456,1"]
    out += [f"GRID,{i + 1},,{i / bars:.8f},0.,0." for i in range(bars + 1)]
    return _deck(out + [f"CBAR,{i + 1},1,{i + 1},{i + 2},0.,1.,0." for i in range(bars)], coupled)


def _cantilever_hz(count: int) -> NDArray[np.float64]:
    roots = np.array([1.875104068711961, 4.694091132974175, 7.854757438237613])
    values = [k**2 / (2 * np.pi) * np.sqrt(E * inertia / (RHO * AREA)) for inertia in MOMENTS for k in roots]
    return np.sort(values)[:count]


def plate(sides: int, triangles: bool = False) -> str:
    """1 × 0.8 m, 10 mm, simply supported, in bending only; the middles of its edges must be supported too."""

    def node(i: int, j: int) -> int:
        return 1 + i + j * (sides + 1)

    out = ["MAT1,1,7.2+10,,0.3,2700.", "PSHELL,1,1,.01,1,,1"]
    out += [f"GRID,{node(i, j)},,{i / sides:.8f},{0.8 * j / sides:.8f},0."
            for i in range(sides + 1) for j in range(sides + 1)]  # fmt: skip
    for k, (i, j) in enumerate((i, j) for i in range(sides) for j in range(sides)):
        a, b, c, d = node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)
        quad = [f"CQUAD4,{k + 1},1,{a},{b},{c},{d}"]
        pair = [f"CTRIA3,{2 * k + 1},1,{a},{b},{c}", f"CTRIA3,{2 * k + 2},1,{a},{c},{d}"]
        out += pair if triangles else quad
    edge = {node(i, j) for i in range(sides + 1) for j in range(sides + 1) if {i, j} & {0, sides}}
    return _deck([*out, *(f"SPC1,1,3,{n}" for n in sorted(edge)), f"SPC1,1,126,1,THRU,{(sides + 1) ** 2}"], True)


def _plate_hz(count: int) -> NDArray[np.float64]:
    stiffness = 7.2e10 * 0.01**3 / (12 * (1 - 0.3**2))
    waves = [(m / 1.0) ** 2 + (n / 0.8) ** 2 for m in range(1, 5) for n in range(1, 5)]
    return np.sort(waves)[:count] * np.pi / 2 * np.sqrt(stiffness / (2700 * 0.01))


def _change(solution: EigenSolution) -> MeshChange:
    found = mesh_change(solution)
    assert isinstance(found, MeshChange)
    return found


@pytest.mark.parametrize("bars", [4, 8])
def test_bars_with_lumped_mass_err_as_the_refinement_says(bars: int, tmp_path: Path) -> None:
    """Second order: the estimate is the error."""
    solution = _modes(cantilever(bars, False), tmp_path, 4)
    true = solution.freq_hz / _cantilever_hz(4) - 1.0
    assert true.min() < -0.02 if bars == 4 else -0.005
    assert _change(solution).error == pytest.approx(true, rel=0.03)


def test_bars_with_consistent_mass_err_less_than_the_refinement_says(tmp_path: Path) -> None:
    """Fourth order: the change is 15/16 of the error, and 4/3 of it a quarter too much."""
    solution = _modes(cantilever(4, True), tmp_path, 4)
    true = solution.freq_hz / _cantilever_hz(4) - 1.0
    assert _change(solution).error == pytest.approx(1.25 * true, rel=0.02)


@pytest.mark.quick(0)
@pytest.mark.parametrize("triangles", [False, True], ids=["CQUAD4", "CTRIA3"])
def test_plates_err_as_the_refinement_says(triangles: bool, tmp_path: Path) -> None:
    """Within a factor of two of true errors above 0.5 %, which is what the estimate is for; the largest within a third.

    Below, errors of mass, bending and residual flexibility of CQUAD4 cancel, and not alike on both meshes.
    """
    solution = _modes(plate(8, triangles), tmp_path, 4)
    true = solution.freq_hz / _plate_hz(4) - 1.0
    found = _change(solution)
    assert np.abs(true).max() > 0.02
    ratio, known = found.error / true, np.abs(true) > 0.005
    assert ((ratio > 0.5) & (ratio < 2.0))[known].all()
    assert np.abs(found.error - true)[~known].max(initial=0.0) < 0.005
    assert ratio[np.abs(true).argmax()] == pytest.approx(1.0, abs=1.0 / 3.0)
    # 17 × 17 points with three free DOFs, less the supports of the edge
    assert found.free_dofs == 3 * 17**2 - 4 * 16


def test_rigid_body_modes_have_no_error(tmp_path: Path) -> None:
    lines = plate(6).splitlines()
    free = "\n".join(line for line in lines if not line.startswith("SPC1,1,3,"))
    error = _change(_modes(free, tmp_path, 6)).error
    assert np.isnan(error[:3]).all()
    assert np.isfinite(error[3:]).all()


@pytest.mark.parametrize("coupled", [False, True], ids=["lumped", "consistent"])
def test_the_other_mass_changes_frequencies_as_a_solution_with_it(coupled: bool, tmp_path: Path) -> None:
    own, other = (_modes(cantilever(8, flag), tmp_path, 4) for flag in (coupled, not coupled))
    found = mass_change(own)
    assert not isinstance(found, str)
    # first order in the matrix: second-order parts are a few per cent of the change
    assert found == pytest.approx(other.freq_hz / own.freq_hz - 1.0, rel=0.05)


def test_elements_that_are_off_stay_off(tmp_path: Path) -> None:
    text = cantilever(4, True).replace("ENDDATA", "CELAS2,99,1.+6,5,2\nENDDATA")
    off = _modes(text, tmp_path, 4, Configuration("off", elements_off=frozenset({99})))
    assert _change(off).refined_hz == pytest.approx(_change(_modes(cantilever(4, True), tmp_path, 4)).refined_hz)


def test_modes_that_change_places_are_matched_by_their_shapes(tmp_path: Path) -> None:
    """The fourth bending mode of six bars with lumped mass lies below the first one along the axis, of twelve above."""
    solution = _modes(cantilever(6, False), tmp_path, 8)
    refined = _change(solution).refined_hz
    fine = _modes(cantilever(12, False), tmp_path, 8).freq_hz
    assert solution.freq_hz[6] < solution.freq_hz[7]
    assert refined[7] == pytest.approx(fine[6], rel=1e-3)
    assert refined[6] == pytest.approx(fine[7], rel=2e-3)


def test_models_of_springs_and_masses_have_no_mesh(tmp_path: Path) -> None:
    text = _deck(["GRID,1", "CELAS2,1,100.,1,1", "CMASS2,2,1.,1,1"], True).replace("SPC = 1\n", "")
    found = mesh_change(_modes(text, tmp_path, 1))
    assert found == "the model has no straight bars, shells or solids to divide (CELAS2, CMASS2)"


def test_large_models_are_not_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    solution = _modes(cantilever(4, True), tmp_path, 3)
    monkeypatch.setattr("femtune.model.mesh_error.MOST_DOFS", 20)
    assert mass_change(solution) == "the model has 30 DOFs, more than 20"
    assert mesh_change(solution) == "the refined model would have at least 54 DOFs, more than 20"
    assert str(mesh_change(solution, 10)).endswith("more than 10; refinement = true in [checks] computes it")


@pytest.mark.slow
@pytest.mark.parametrize("coupled", [False, True])
def test_the_estimate_of_a_very_thin_plate(tmp_path: Path, coupled: bool) -> None:
    """1 m by 100 µm, with its membrane: the first two frequencies expected of a converged mesh are those of theory."""
    sides, thickness = 4, 1e-4
    out = ["MAT1,1,7.2+10,,0.3,2700.", f"PSHELL,1,1,{thickness:.1e},1,,1".replace("e-0", "-")]
    out += [f"GRID,{1 + i + 5 * j},,{i / sides},{j / sides},0." for j in range(5) for i in range(5)]
    out += [f"CQUAD4,{1 + i + 4 * j},1,{n},{n + 1},{n + 6},{n + 5}"
            for j in range(4) for i in range(4) for n in [1 + i + 5 * j]]  # fmt: skip
    out += [f"SPC1,1,123,{1 + i + 5 * j}" for j in range(5) for i in range(5) if {i, j} & {0, 4}]
    found = mesh_change(_modes(_deck(out, coupled), tmp_path, 3))
    assert isinstance(found, MeshChange)
    bending = 7.2e10 * thickness**3 / (12.0 * (1.0 - 0.3**2))
    exact = 0.5 * np.pi * np.sqrt(bending / (2700.0 * thickness)) * np.array([2.0, 5.0, 5.0])
    np.testing.assert_allclose(found.converged_hz[:3], exact, rtol=0.01)


def test_rigid_body_modes_alone_have_no_error(tmp_path: Path) -> None:
    """Six modes of a free plate: what rounding leaves of their frequencies is no scale of the others."""
    deck = "\n".join(line for line in plate(4).replace(",.01,", ",.0001,").splitlines() if not line.startswith("SPC"))
    assert mesh_change(_modes(deck, tmp_path, 6)) == "no elastic mode was computed"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changed", "written"),
    [
        # half the modulus at the clamp, by a region
        (Assignment("p", FieldRef("MAT1", 1, "E"), elements=frozenset({1, 2})), ("MAT1,2,1.05+11,,0.3,7850.",)),
        # the density of all bars
        (Assignment("p", FieldRef("MAT1", 1, "RHO")), ()),
    ],
    ids=["region", "density"],
)
@pytest.mark.parametrize("nominal", [1.0, 0.5], ids=["at x = -0.5", "at the initial value"])
def test_the_refined_model_and_the_other_mass_have_the_values_of_the_parameters(
    changed: Assignment, written: tuple[str, ...], nominal: float, tmp_path: Path
) -> None:
    text = cantilever(4, True)
    (tmp_path / "deck.bdf").write_text(text)
    structure = build_structure(read_deck(tmp_path / "deck.bdf")).structure
    model = parametric_model(structure, ParameterSet((Parameter("p", nominal, 0.2, 2.0),)), (changed,))
    solution = solve_modes(configure(model, Configuration()).at(np.array([0.5 / nominal - 1.0])), 4)
    if written:
        same = text.replace("ENDDATA", "\n".join([*written, "PBAR,2,2,1.-3,2.-7,5.-7,4.-7", "ENDDATA"]))
        for bar in changed.elements or ():
            same = same.replace(f"CBAR,{bar},1,", f"CBAR,{bar},2,")
    else:
        same = text.replace("0.3,7850.", "0.3,3925.")
    of_deck = _modes(same, tmp_path, 4)
    assert solution.freq_hz == pytest.approx(of_deck.freq_hz, rel=1e-9)
    assert _change(solution).refined_hz == pytest.approx(_change(of_deck).refined_hz, rel=1e-7)
    assert mass_change(solution) == pytest.approx(mass_change(of_deck), rel=1e-7)
