"""Modes of shell models: complex steps, derivative equations, Taylor slopes, and repeated modes that split."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from femtune.fem import FieldRef
from femtune.files.nastran import BuiltDeck, plan_edits, read_deck, write_deck
from femtune.files.nastran.build import build_structure
from femtune.files.nastran.field_refs import parse_field_ref, resolve
from femtune.model import (
    Assignment,
    Configuration,
    ConfiguredModel,
    EigenSolution,
    configure,
    parametric_model,
    solve_modes,
    subspace_derivative,
)
from femtune.parameters import Parameter, ParameterSet
from femtune.testing import check_derivative_equation, check_directional, check_simple_mode, check_taylor_slope
from structures.shells import Isotropic, Section, ShellPart, cylinder, dofs_of, rectangle, shell_mesh, shell_structure

from .field_decks import DECKS

STIFFENED = """SOL 103
CEND
BEGIN BULK
PARAM,COUPMASS,1
MAT1,1,7.+10,,.33,2700.,,,.01
PSHELL,1,1,.004,1,,1,,2.
PBARL,2,1,,T
,.04,.05,.004,.003
PBAR,3,1,1.-4,2.-9,3.-9,4.-9,,
PBUSH,4,K,2.+5,3.+5,4.+5,50.,60.,70.
,,B,20.,20.,20.
PDAMP,5,30.
"""
# E, ν, ρ, t, offset, added mass, the stiffener's height and wall, bush, damper
FIELDS = (
    "MAT1 1 E", "MAT1 1 NU", "MAT1 1 RHO", "PSHELL 1 T", "CQUAD4 1 ZOFFS", "PSHELL 1 NSM",
    "PBARL 2 DIM2", "PBARL 2 DIM4", "PBUSH 4 K1", "PDAMP 5 B", "MAT1 1 GE",
)  # fmt: skip


def stiffened_plate(nu: int, nv: int) -> str:
    """A plate of 0.6 × 0.4 m on four bushes, an offset stiffener along its middle, all shells offset."""

    def grid(i: int, j: int) -> int:
        return 1 + i * (nv + 1) + j

    lines = [STIFFENED.rstrip()]
    lines += [
        f"GRID,{grid(i, j)},,{0.6 * i / nu:.5f},{0.4 * j / nv:.5f},0." for i in range(nu + 1) for j in range(nv + 1)
    ]
    cells = [(i, j) for i in range(nu) for j in range(nv)]
    for e, (i, j) in enumerate(cells, 1):
        lines.append(f"CQUAD4,{e},1,{grid(i, j)},{grid(i + 1, j)},{grid(i + 1, j + 1)},{grid(i, j + 1)},,.002")
    middle = nv // 2
    for i in range(nu):
        lines.append(f"CBAR,{1001 + i},2,{grid(i, middle)},{grid(i + 1, middle)},0.,0.,1.")
        lines.append(",,,0.,0.,-.02,0.,0.,-.02")
    for k, (i, j) in enumerate([(0, 0), (nu, 0), (nu, nv), (0, nv)]):
        lines += [f"GRID,{901 + k},,{0.6 * i / nu:.5f},{0.4 * j / nv:.5f},0.,,123456",
                  f"CBUSH,{2001 + k},4,{grid(i, j)},{901 + k},,,,0"]  # fmt: skip
    lines += [f"CDAMP1,3001,5,{grid(nu, 0)},3", "ENDDATA"]
    return "\n".join(lines) + "\n"


def plate_model(path: Path, nu: int, nv: int, fields: tuple[str, ...] = FIELDS) -> tuple[ConfiguredModel, BuiltDeck]:
    path.write_text(stiffened_plate(nu, nv))
    built = build_structure(read_deck(path))
    refs = [parse_field_ref(text) for text in fields]
    for ref in refs:
        resolve(built, ref)
    assignments = [Assignment(f"p{i}", ref) for i, ref in enumerate(refs)]
    parameters = ParameterSet(tuple(Parameter(f"p{i}") for i in range(len(refs))))
    return configure(parametric_model(built.structure, parameters, assignments), Configuration()), built


def at(model: ConfiguredModel) -> np.ndarray:
    return np.linspace(-0.05, 0.07, len(model.model.parameters.free))


@pytest.mark.slow
def test_simple_modes_of_a_small_stiffened_plate(tmp_path: Path):
    """By complex steps through the dense standard form; turning about the normal has no mass."""
    model, _ = plate_model(tmp_path / "small.bdf", 3, 2)
    solution = solve_modes(model.at(at(model)), 6)
    for j in range(5):
        check_derivative_equation(solution, [j])
        # a thin plate on soft bushes: the dense solution keeps its eigenvalues to 1e-10, its shapes to some 1e-9
        check_simple_mode(solution, j, 1e-8)


@pytest.fixture(scope="module")
def plate(tmp_path_factory: pytest.TempPathFactory) -> tuple[ConfiguredModel, EigenSolution]:
    model, _ = plate_model(tmp_path_factory.mktemp("plate") / "plate.bdf", 18, 12)
    return model, solve_modes(model.at(at(model)), 10)


@pytest.mark.slow
def test_the_derivative_equation_holds_on_a_stiffened_plate(plate: tuple[ConfiguredModel, EigenSolution]):
    for j in range(8):
        check_derivative_equation(plate[1], [j])


@pytest.mark.slow
def test_frequencies_of_a_stiffened_plate_follow_their_gradients(plate: tuple[ConfiguredModel, EigenSolution]):
    model, solution = plate
    slopes = np.array([subspace_derivative(solution, [j]).eigenvalue_gradient for j in range(8)])
    values = solution.eigenvalues[:8]
    check_taylor_slope(
        lambda x: solve_modes(model.at(x), 10).eigenvalues[:8] / values, np.ones(8), slopes / values[:, None], at(model)
    )


def quadrants(shape: str) -> tuple[ConfiguredModel, int]:
    """A clamped square plate by quadrants, or a free ring; thickness and modulus of two parts, the pair's position."""
    steel = [Section(Isotropic(2.1e11, 0.3, 7850.0), 0.01) for _ in range(4)]
    if shape == "plate":
        mesh = shell_mesh(rectangle(1.0, 1.0), 8, 8)
        part = (mesh.xyz[mesh.cells].mean(axis=1)[:, :2] > 0.5) @ [1, 2]
        held = dofs_of(mesh.rim, "123456")
    else:
        mesh = shell_mesh(cylinder(0.5, 0.2), 16, 2, closed=True)
        # eighths: a quarter of a ring moves both of its oval modes alike
        part = np.minimum(np.repeat(np.arange(8), len(mesh.cells) // 8), 3)
        held = dofs_of(np.arange(len(mesh.xyz)), "")
    shells = [ShellPart(mesh.cells[part == k], section) for k, section in enumerate(steel)]
    structure = shell_structure(mesh.xyz, shells, held=held)
    names = ParameterSet(tuple(Parameter(f"p{i}") for i in range(3)))
    fields = (("PSHELL", 1, "T"), ("MAT1", 1, "E"), ("PSHELL", 2, "T"))
    assignments = [Assignment(f"p{i}", FieldRef(*field)) for i, field in enumerate(fields)]
    model = configure(parametric_model(structure, names, assignments), Configuration())
    return model, 1 if shape == "plate" else 6


@pytest.fixture(scope="module", params=["plate", "ring"])
def repeated(request: pytest.FixtureRequest) -> tuple[EigenSolution, list[int]]:
    """Two modes of one frequency by the structure's symmetry."""
    model, first = quadrants(request.param)
    solution = solve_modes(model.at(np.zeros(3)), first + 4)
    pair = [first, first + 1]
    values = solution.eigenvalues
    assert abs(values[pair[1]] / values[pair[0]] - 1.0) < 1e-9
    assert min(values[pair[0]] - values[first - 1], values[first + 2] - values[pair[1]]) > 0.01 * values[first]
    return solution, pair


def branches(solution: EigenSolution, pair: list[int], x: np.ndarray) -> np.ndarray:
    """Eigenvalues of the two modes where the symmetry is broken."""
    return solve_modes(solution.point.configured.at(x), pair[-1] + 3).eigenvalues[pair]


DIRECTIONS = [np.array(d) for d in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.3, -0.5, 0.8])]


@pytest.mark.quick(0)
@pytest.mark.parametrize("direction", DIRECTIONS, ids=str)
def test_the_branches_of_a_double_mode_have_the_slopes_of_the_small_matrix(
    repeated: tuple[EigenSolution, list[int]], direction: np.ndarray
):
    solution, pair = repeated
    d, h = subspace_derivative(solution, pair), 1e-4
    slopes = np.linalg.eigvalsh(np.tensordot(direction, d.stiffness - d.eigenvalues.mean() * d.mass, axes=1))
    up, down = (branches(solution, pair, sign * h * direction) for sign in (1.0, -1.0))
    # the branch that lies above on one side lies below on the other
    found = (up - down[::-1]) / (2.0 * h)
    assert abs(slopes[1] - slopes[0]) > 1e-3 * abs(slopes).max()
    np.testing.assert_allclose(found, slopes, atol=1e-6 * abs(slopes).max())


@pytest.mark.quick(0)
@pytest.mark.parametrize("direction", DIRECTIONS, ids=str)
def test_functions_of_the_subspace_of_a_double_mode(repeated: tuple[EigenSolution, list[int]], direction: np.ndarray):
    """Φ Φᵀf of some forces f, and the sum of both eigenvalues: neither depends on the choice of vectors."""
    solution, pair = repeated
    model, d = solution.point.configured, subspace_derivative(solution, pair)
    force = np.random.default_rng(4).uniform(-1.0, 1.0, model.n_free)

    def response(x: np.ndarray) -> np.ndarray:
        phi = solve_modes(model.at(x), pair[-1] + 3).shapes[:, pair]
        return phi @ (phi.T @ force)

    along = d.shapes.T @ force
    inside = d.shapes @ (d.mass @ along).T
    exact = np.einsum("ncp,c->np", d.outside, along) - inside
    exact += d.shapes @ np.einsum("ncp,n->cp", d.outside, force)
    check_directional(response, exact, np.zeros(3), direction, tolerance=1e-6, step=1e-5)
    trace = np.trace(d.stiffness - d.eigenvalues.mean() * d.mass, axis1=1, axis2=2)[None]
    check_directional(
        lambda x: branches(solution, pair, x).sum()[None], trace, np.zeros(3), direction, tolerance=1e-6, step=1e-4
    )


@pytest.mark.slow
@pytest.mark.parametrize("field", ["PSHELL 1 T", "CQUAD4 1 ZOFFS", "PBARL 2 DIM2", "PBUSH 4 K1", "MAT1 1 NU"])
def test_a_written_deck_has_the_frequencies_that_the_derivatives_foretell(field: str, tmp_path: Path):
    """The field as it was written, read and solved again: the change is that of the derivative, with slope 2."""
    model, built = plate_model(tmp_path / "plate.bdf", 6, 4, (field,))
    solution = solve_modes(model.at(np.zeros(1)), 6)
    slopes = np.array([subspace_derivative(solution, [j]).eigenvalue_gradient[0] for j in range(5)])
    rest = []
    for size in (1e-2, 5e-3):
        ref = model.model.assignments[0].ref
        start = built.structure.values.values[built.structure.values.index(ref)]
        plan = plan_edits(built, {ref: start * (1.0 + size)})
        written = build_structure(read_deck(write_deck(plan.edited, tmp_path / str(size)).main)).structure
        again = configure(parametric_model(written, ParameterSet(()), ()), Configuration())
        step = plan.values[ref] / start - 1.0
        moved = solve_modes(again.at(np.zeros(0)), 6).eigenvalues[:5]
        rest.append(np.abs(moved - solution.eigenvalues[:5] - step * slopes))
        assert (rest[-1] <= 3.0 * step * step * moved).all()
    assert (np.abs(slopes) > 1e-6 * solution.eigenvalues[:5]).any()
    # where the remainder is more than the solver's rounding
    clear = rest[0] > 1e-8 * solution.eigenvalues[:5]
    assert np.allclose(np.log2(rest[0][clear] / rest[1][clear]), 2.0, atol=0.1)


@pytest.mark.slow
def test_simple_modes_of_curved_shells(tmp_path: Path):
    """CQUAD8 and CTRIA6 with corner thicknesses, an offset, a coupling law and plies, by complex steps."""
    path = tmp_path / "curved.bdf"
    path.write_text(DECKS["curved"])
    built = build_structure(read_deck(path))
    fields = ("CQUAD8 1 T2", "CTRIA6 3 T3", "CQUAD8 1 ZOFFS", "PCOMP 2 T1", "PCOMP 2 THETA3", "MAT8 4 E1", "PSHELL 4 T")
    assignments = [Assignment(f"p{i}", parse_field_ref(text)) for i, text in enumerate(fields)]
    parameters = ParameterSet(tuple(Parameter(f"p{i}") for i in range(len(fields))))
    model = configure(parametric_model(built.structure, parameters, assignments), Configuration())
    solution = solve_modes(model.at(at(model)), 6)
    for j in range(4):
        check_derivative_equation(solution, [j])
        check_simple_mode(solution, j, 1e-8)
