"""Solids with mid-side nodes: projections of the volumetric strain, ν near one half, orders of convergence."""

from __future__ import annotations

import numpy as np
import pytest
from tests.fem.quadratic_parts import SHAPES, curved, one
from tests.fem.solid_parts import dense, sliding_box

from femtune.fem.elements.solids.quadratic import HEXA20 as HEXA
from femtune.fem.elements.solids.quadratic import PENTA15 as PENTA
from femtune.fem.elements.solids.quadratic import TETRA10 as TETRA
from femtune.fem.elements.solids.shape import HEXA20_SHAPE as HEXA20
from femtune.fem.elements.solids.shape import eight_points, hexahedron_points, pentahedron_points
from femtune.fem.elements.solids.strains import SolidPlaces
from structures.shells import Isotropic, dofs_of, static_displacements
from structures.solids import solid_mesh, solid_model


@pytest.mark.parametrize("nu", [0.46, 0.4999])
@pytest.mark.parametrize("kind", ["penta15", "tetra10"])
def test_the_mean_is_selective_integration(kind: str, nu: float) -> None:
    """λ meets the mean volumetric strain, μ the whole strain (Hughes 1980), here put together from the strains."""
    xyz = curved(kind)
    formulation = {"penta15": PENTA, "tetra10": TETRA}[kind]
    rows = formulation.strains(SolidPlaces(xyz[None], np.array([0.3])))[0].rows[0]
    flat = rows.reshape(len(rows), 6, -1)
    volume = whole_volumes(kind, xyz)
    lam, mu = 200.0 * nu / ((1 + nu) * (1 - 2 * nu)), 200.0 / (2 + 2 * nu)
    mean = np.sqrt(volume) @ flat[:, :3].sum(axis=1) / np.sqrt(volume.sum())
    wanted = np.einsum("pia,i,pib->ab", flat, mu * np.array([2, 2, 2, 1, 1, 1.0]), flat) + lam * np.outer(mean, mean)
    found = dense(one(kind, xyz, Isotropic(200.0, nu)))
    np.testing.assert_allclose(found, wanted, atol=1e-11 * np.abs(wanted).max())


def whole_volumes(kind: str, xyz: np.ndarray) -> np.ndarray:
    rule = {"penta15": pentahedron_points(3), "tetra10": eight_points()}[kind]
    return rule.weights * np.linalg.det(SHAPES[kind].slopes(rule.places) @ xyz)


def test_linear_volumetric_strains_come_through_the_projection() -> None:
    """A parallelepiped of hexahedra: the trace of the strains of a quadratic field is the exact one at every point."""
    xyz = HEXA20.nodes @ np.array([[1.0, 0.3, -0.2], [0.4, 0.7, 0.1], [0.2, -0.1, 0.3]])
    rows = HEXA.strains(SolidPlaces(xyz[None], np.array([0.3])))[0].rows[0]
    ones, field = np.ones((len(xyz), 3)) * [1.0, 0, 0] * xyz, xyz**2 * [1.0, 2.0, 3.0]
    weight, trace = ((rows[:, :3].sum(axis=1).reshape(len(rows), -1) @ u.ravel()) for u in (ones, field))
    at = np.array(np.linalg.lstsq(HEXA20.nodes, xyz, rcond=None)[0])
    points = hexahedron_points(3).places @ at
    np.testing.assert_allclose(trace / weight, points @ [2.0, 4.0, 6.0], atol=1e-12)


def thick_cylinder(kind: str, nu: float) -> float:
    """Ten degrees of a thick cylinder in plane strain under pressure: mean displacement inside over the exact one."""

    def place(u, v, w):
        r = np.interp(u, np.linspace(0, 1, 6), [3, 3.5, 4.2, 5.2, 6.75, 9.0])
        return r * np.cos(np.radians(10 * v)), r * np.sin(np.radians(10 * v)), w

    mesh = solid_mesh(place, (5, 1, 1), kind)
    angle = np.arctan2(mesh.xyz[:, 1], mesh.xyz[:, 0])
    frames = np.zeros((len(angle), 3, 3))
    frames[:, 0, 0] = frames[:, 1, 1] = np.cos(angle)
    frames[:, 1, 0], frames[:, 0, 1], frames[:, 2, 2] = np.sin(angle), -np.sin(angle), 1.0
    structure = solid_model(mesh, Isotropic(1000.0, nu), frames=frames, held=dofs_of(np.arange(len(angle)), "23"))
    inside, force = mesh.face("u0"), np.zeros(structure.nodes.n_dofs)
    force[6 * inside] = pressure_shares(mesh, inside) * 3 * np.radians(10)
    theory = (1 + nu) * 9 / (1000 * 72) * (81 / 3 + (1 - 2 * nu) * 3)
    return float(static_displacements(structure, force)[6 * inside] @ force[6 * inside] / force.sum() / theory)


def pressure_shares(mesh, inside: np.ndarray) -> np.ndarray:
    """Shares of a uniform pressure on a face of one serendipity quadrilateral: −1/12 at corners, 1/3 at middles."""
    corner = (np.minimum(mesh.uvw[inside][:, 1:], 1 - mesh.uvw[inside][:, 1:]) < 1e-9).all(axis=1)
    assert (corner.sum(), len(inside)) == (4, 8)
    return np.where(corner, -1.0 / 12.0, 1.0 / 3.0)


@pytest.mark.parametrize("nu", [0.3, 0.49, 0.4999])
def test_a_thick_cylinder_of_nearly_incompressible_material(nu: float) -> None:
    assert thick_cylinder("hexa20", nu) == pytest.approx(1.0, abs=0.005)


@pytest.mark.quick(1)
@pytest.mark.parametrize(("kind", "n"), [("hexa20", 2), ("penta15", 3), ("tetra10", 3), ("pyram13", 2)])
def test_nearly_incompressible_waves(kind: str, n: int) -> None:
    """A box that slides on its faces: its lowest modes are shear waves, whatever ν, λ = (G/ρ) π² (1/a² + 1/b²)."""
    assert abs(sliding_box(kind, n, 0.4999, 0.03)) < 0.022


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "counts"), [("hexa20", (3, 5)), ("penta15", (4, 6)), ("tetra10", (4, 6)), ("pyram13", (2, 3))]
)
def test_eigenvalues_converge_with_order_four(kind: str, counts: tuple[int, int]) -> None:
    errors = [sliding_box(kind, n, 0.3, 0.0) for n in counts]
    rate = np.log(errors[0] / errors[1]) / np.log(counts[1] / counts[0])
    assert 3.6 < rate < 4.6
    assert errors[1] > 0.0
