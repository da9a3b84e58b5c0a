"""Supports that give way: derivatives by a compliance beside springs and complex step, and a run that names one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

from femtune.fem import FieldRef
from femtune.files.nastran import build_structure, read_deck
from femtune.judge.supports import GivingWay, Support, released, support_rows, supported_dofs
from femtune.judge.widened import widened
from femtune.model import Assignment, Configuration, ConfiguredModel, configure, parametric_model, solve_modes
from femtune.model.full_model import direct
from femtune.parameters import Parameter, ParameterSet

_MODES = 5


def beam(held: str = "123456", springs: Sequence[str] = ()) -> str:
    """Ten bars of steel, clamped at grid point 1."""
    grids = [f"GRID,{i},,{0.1 * (i - 1):.1f},0.,0." for i in range(1, 12)]
    bars = [f"CBAR,{i},1,{i},{i + 1},0.,1.,0." for i in range(1, 11)]
    return "\n".join([
        "SOL 103", "CEND", "SPC = 1", "METHOD = 1", "BEGIN BULK", "EIGRL,1,,,10", "PARAM,COUPMASS,1",
        "MAT1,1,2.1E11,,0.3,7850.", "PBAR,1,1,4.E-4,1.333E-8,3.E-8,3.E-8", *grids, *bars, f"SPC1,1,{held},1", *springs,
        "ENDDATA", "",
    ])  # fmt: skip


def plate(held: str = "123456", springs: Sequence[str] = ()) -> str:
    """Five times four shells of aluminium, clamped at the edge x = 0."""
    grids = [f"GRID,{10 * i + j + 1},,{0.1 * i:.1f},{0.11 * j:.2f},0." for i in range(6) for j in range(5)]
    shells = [
        f"CQUAD4,{10 * i + j + 1},1,{10 * i + j + 1},{10 * i + j + 11},{10 * i + j + 12},{10 * i + j + 2}"
        for i in range(5)
        for j in range(4)
    ]
    return "\n".join([
        "SOL 103", "CEND", "SPC = 1", "METHOD = 1", "BEGIN BULK", "EIGRL,1,,,10", "PARAM,COUPMASS,1",
        "MAT1,1,7.E10,,0.3,2700.", "PSHELL,1,1,0.004,1,,1", *grids, *shells, f"SPC1,1,{held},1,2,3,4,5", *springs,
        "ENDDATA", "",
    ])  # fmt: skip


def _configured(path: Path, deck: str) -> ConfiguredModel:
    path.write_text(deck)
    structure = build_structure(read_deck(path)).structure
    model = parametric_model(structure, ParameterSet((Parameter("E"),)), [Assignment("E", FieldRef("MAT1", 1, "E"))])
    return configure(model, Configuration("a"))


def _local_stiffness(rigid: ConfiguredModel, support: Support) -> float:
    """Largest diagonal entry of K at the supported DOFs."""
    dofs = np.array(support.dofs)
    free = configure(rigid.model, released(rigid, dofs))
    return float(free.at(np.zeros(1)).stiffness.diagonal()[np.isin(free.free, dofs)].max())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("deck", "nodes", "component"),
    [
        (beam, (1,), 5),
        (beam, (1,), 3),
        (beam, (1,), 6),
        (plate, (1, 2, 3, 4, 5), 5),
        (plate, (1, 2), 3),
        (plate, (2,), 4),
    ],
)
def test_derivatives_at_a_rigid_support(deck: object, nodes: tuple[int, ...], component: int, tmp_path: Path) -> None:
    """Beside stiff springs in the place of the constraint: the difference grows with the compliance."""
    rigid = _configured(tmp_path / "rigid.bdf", deck())
    structure = rigid.model.structure
    support = Support("c", tuple(structure.nodes.dof(n, component) for n in nodes))
    wide = widened(rigid.model, [], [], [support])
    x = np.zeros(2)
    solution = solve_modes(configure(wide, Configuration("a")).at(x), _MODES)
    own = support_rows(rigid, supported_dofs(structure, [Configuration("a")]), x[:1])
    solver = GivingWay(direct, own, (support,))
    seen = sp.csr_array(sp.eye_array(rigid.n_free, format="csr"))
    found = [solver.derivative(solution, [j], seen) for j in range(_MODES)]
    forces = own.forces(solution)[np.isin(own.dofs, support.dofs), :_MODES]
    slopes = np.array([f.eigenvalue_gradient[1] for f in found])
    np.testing.assert_allclose(slopes, -np.sum(forces**2, axis=0), rtol=1e-9)
    moving = np.abs(slopes) > 1e-6 * np.abs(slopes).max()
    errors, local = [], _local_stiffness(rigid, support)
    for share in (2e-3, 1e-3):
        # of the compliance of the elements at the support
        c = share / local
        rest = "123456".replace(str(component), "")
        others = sorted({1, 2, 3, 4, 5} - set(nodes)) if deck is plate else []
        cards = [f"CELAS2,{900 + n},{1.0 / c:.9E},{n},{component}" for n in nodes]
        cards += [f"SPC1,1,{component},{n}" for n in others]
        soft = _configured(tmp_path / "soft.bdf", deck(rest, cards))
        there = solve_modes(soft.at(np.zeros(1)), _MODES)
        place = {int(dof): i for i, dof in enumerate(soft.free)}
        same = [place[int(dof)] for dof in rigid.free]
        worst = 0.0
        for j in np.flatnonzero(moving):
            change = (there.eigenvalues[j] - solution.eigenvalues[j]) / c
            worst = max(worst, abs(change / slopes[j] - 1.0))
            after = there.shapes[same, j] * np.sign(there.shapes[same, j] @ solution.shapes[:, j])
            slope = found[j].shape_gradient[:, 1]
            worst = max(worst, float(np.abs((after - solution.shapes[:, j]) / c - slope).max() / np.abs(slope).max()))
        errors.append(worst)
    # the remainder is of the first order in the compliance
    assert errors[1] < 5e-3
    assert errors[1] < 0.6 * errors[0]


def test_derivatives_at_a_few_sensors_are_those_at_all_dofs(tmp_path: Path) -> None:
    """Many supports are solved for by the sensors, which are fewer; for all DOFs each support is solved for."""
    rigid = _configured(tmp_path / "rigid.bdf", plate())
    structure = rigid.model.structure
    dofs = supported_dofs(structure, [Configuration("a")])
    own = support_rows(rigid, dofs, np.zeros(1))
    supports = [Support(f"c{n}", (int(dof),)) for n, dof in enumerate(own.dofs)]
    edge = [int(dof) for dof in own.dofs if dof % 6 == 4]
    supports = [*(s for s in supports if s.dofs[0] not in edge), Support("edge", tuple(edge))]
    wide = widened(rigid.model, [], [], supports)
    solution = solve_modes(configure(wide, Configuration("a")).at(np.zeros(1 + len(supports))), _MODES)
    solver = GivingWay(direct, own, tuple(supports))
    everywhere = sp.csr_array(sp.eye_array(rigid.n_free, format="csr"))
    place = {int(dof): i for i, dof in enumerate(rigid.free)}
    at = [place[structure.nodes.dof(n, 3)] for n in (23, 41, 55)]
    seen = sp.csr_array(everywhere[at])
    for members in ([0], [3], [1, 2]):
        few, all_dofs = (solver.derivative(solution, members, rows) for rows in (seen, everywhere))
        np.testing.assert_array_equal(few.stiffness, all_dofs.stiffness)
        exact = all_dofs.outside[at]
        assert few.outside.shape == (3, len(members), 1 + len(supports))
        # each support by itself, since translations and rotations have other units; bending moves no support in plane
        bending = [1 + k for k, s in enumerate(supports) if s.dofs[0] % 6 in {2, 3, 4}]
        largest = np.abs(exact).max(axis=(0, 1))[bending]
        worst = np.abs(few.outside - exact).max(axis=(0, 1))[bending] / largest
        assert len(bending) == 11
        assert 1e-14 < worst.max() < 1e-4


def test_the_eigenvalue_by_complex_step(tmp_path: Path) -> None:
    """Of the matrices with the DOF condensed exactly, at a complex compliance."""
    rigid = _configured(tmp_path / "rigid.bdf", beam())
    dof = rigid.model.structure.nodes.dof(1, 5)
    solution = solve_modes(rigid.at(np.zeros(1)), 3)
    own = support_rows(rigid, np.array([dof]), np.zeros(1))
    K, M = (m.toarray() for m in (rigid.at(np.zeros(1)).stiffness, rigid.at(np.zeros(1)).mass))
    for j in range(3):
        value, h = float(solution.eigenvalues[j]), 1e-30
        d = (own.stiffness - value * own.mass).toarray()[0]
        # ∂λ/∂c of (K − λM − c·ddᵀ)φ = 0 with φᵀMφ = 1: Newton's step for λ at a complex c
        phi = solution.shapes[:, j]
        D = (K - value * M).astype(complex) - 1j * h * np.outer(d, d)
        step = (phi @ D @ phi).imag / h
        assert step == pytest.approx(-(float(own.forces(solution)[0, j]) ** 2), rel=1e-9)
    assert la.norm(own.stiffness.toarray()) > 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("held", "supports"),
    [
        ("123456", "SPC1,1,123456,6"),
        ("123456", "SPC1,1,123456,11"),
        ("1234", "SPC1,1,1234,11\nSPC1,1,23,1"),
    ],
)
def test_a_beam_that_turns_about_itself_without_its_support(held: str, supports: str, tmp_path: Path) -> None:
    """A line of bars without polar inertia is then held at a point of it; the other directions are still tested."""
    deck = beam(held).replace(f"SPC1,1,{held},1", supports)
    rigid = _configured(tmp_path / "beam.bdf", deck)
    dofs = supported_dofs(rigid.model.structure, [Configuration("a")])
    own = support_rows(rigid, dofs, np.zeros(1))
    solution = solve_modes(rigid.at(np.zeros(1)), _MODES)
    assert set(own.dofs.tolist()) == {int(d) for d in dofs if d % 6 != 3}
    assert own.dofs.tolist() == sorted(own.dofs.tolist())
    for dof in own.dofs.tolist():
        # each row is that of the model in which this direction alone is free
        alone = support_rows(rigid, np.array([dof]), np.zeros(1))
        row = own.forces(solution)[own.dofs == dof]
        np.testing.assert_allclose(row, alone.forces(solution), rtol=1e-9, atol=1e-9 * np.abs(row).max())


def test_what_a_plane_model_holds_everywhere_is_no_support(tmp_path: Path) -> None:
    path = tmp_path / "beam.bdf"
    path.write_text(beam().replace("ENDDATA", "SPC1,1,246,2,THRU,11\nENDDATA"))
    structure = build_structure(read_deck(path)).structure
    found = supported_dofs(structure, [Configuration("a")])
    assert {str(structure.nodes.describe(int(i))) for i in found} == {
        str(structure.nodes.describe(structure.nodes.dof(1, c))) for c in (1, 3, 5)
    }
    assert not len(supported_dofs(structure, [Configuration("a"), Configuration("b", supports_removed=((1, "135"),))]))
