"""Shear panels against closed forms: webs between rods, Garvey's oblique and tapered panels."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.fem.assemble import assemble
from femtune.fem.checks import mass_properties, rigid_body_modes
from femtune.fem.elements import contributions
from femtune.fem.elements.shear_panel import field_functions, flow, web_field
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ElementBatch, NodeTable, Structure
from femtune.fem.values import ValueTableBuilder
from femtune.testing.contributions import check_contribution

Reals = NDArray[np.float64]
VALUES = {"E": 200.0, "G": 80.0, "rho": 3.0, "t": 0.1, "NSM": 0.2, "F1": 0.0, "F2": 0.0, "GE": 0.01}
RECTANGLE = np.array([[0.0, 0, 0], [3, 0, 0], [3, 2, 0], [0, 2, 0]])
GENERAL = np.array([[0.0, 0, 0], [3, 0.2, 0], [2.5, 2, 0], [-0.3, 1.5, 0]])


def structure(xyz: Reals, frames: Reals | None = None, consistent: bool = False, **changed: float) -> Structure:
    n = len(xyz)
    table = ValueTableBuilder()
    values = {**VALUES, **changed}
    roles = {name: np.array([table.add(FieldRef("X", 1, name), x)]) for name, x in values.items()}
    frames = np.tile(np.eye(3), (n, 1, 1)) if frames is None else frames
    nodes = np.arange(4)[None]
    dofs = (6 * nodes[:, :, None] + np.arange(3)).reshape(1, 12)
    batch = ElementBatch("shear-panel", "CSHEAR", np.array([7]), nodes, dofs, roles)
    table_of_nodes = NodeTable(np.arange(1, n + 1), xyz, frames)
    return Structure(table_of_nodes, table.table(), (batch,), consistent_mass=consistent)


def stiffness(model: Structure) -> Reals:
    at = model.batches[0].dofs[0]
    return np.asarray(assemble(model, "stiffness").toarray()[np.ix_(at, at)])


def test_uniform_shear_of_a_rectangle_has_its_energy() -> None:
    u = np.zeros((4, 3))
    u[:, 0] = 0.3 * RECTANGLE[:, 1]
    u[:, 1] = 0.1 * RECTANGLE[:, 0]
    energy = u.ravel() @ stiffness(structure(RECTANGLE)) @ u.ravel()
    assert energy == pytest.approx(80.0 * 0.1 * 6.0 * 0.4**2, rel=1e-13)


@pytest.mark.parametrize(
    "xyz", [RECTANGLE, GENERAL, GENERAL + np.array([[0, 0, 0.3], [0, 0, -0.1], [0, 0, 0.4], [0] * 3])]
)
def test_rigid_motions_cost_nothing_and_the_web_has_one_stress(xyz: Reals) -> None:
    model = structure(xyz)
    k = stiffness(model)
    motions = rigid_body_modes(model.nodes)[model.batches[0].dofs[0]]
    assert np.abs(k @ motions).max() < 1e-12 * np.abs(k).max()
    assert (np.abs(np.linalg.eigvalsh(k)) > 1e-10 * np.abs(k).max()).sum() == 1


def test_a_web_between_rods_bends_as_the_closed_form() -> None:
    """One bay, held at one end: the web shears and its flow stretches the flanges, half of it at each end."""
    a, b, area, force = 3.0, 2.0, 0.05, 1.0
    k = stiffness(structure(RECTANGLE))
    for i, j, axis, size in ((0, 1, 0, a), (3, 2, 0, a), (1, 2, 1, b)):
        g = np.zeros(12)
        g[3 * i + axis], g[3 * j + axis] = -1.0, 1.0
        k += VALUES["E"] * area / size * np.outer(g, g)
    free = [3, 4, 6, 7]
    load = np.array([0.0, force / 2, 0.0, force / 2])
    tip = np.linalg.solve(k[np.ix_(free, free)], load)
    expected = force * a / (VALUES["G"] * VALUES["t"] * b) + force * a**3 / (2.0 * b**2 * VALUES["E"] * area)
    assert [tip[1], tip[3]] == pytest.approx([expected] * 2, rel=1e-12)


def test_the_field_of_any_quadrilateral_loads_its_edges_along_them_only() -> None:
    flat = GENERAL[None, :, :2]
    lines = field_functions(flat)
    for i, j in ((0, 1), (1, 2), (2, 3), (3, 0)):
        along = flat[0, j] - flat[0, i]
        n = np.array([along[1], -along[0]]) / np.linalg.norm(along)
        for x in (0.1, 0.6):
            nx, ny, nxy = (float(c[0]) for c in flow(lines, flat[:, i] + x * along))
            stress = np.array([[nx, nxy], [nxy, ny]])
            assert abs(n @ stress @ n) < 1e-13
            assert abs(n @ stress @ along) > 0.1


def test_the_field_is_in_equilibrium() -> None:
    flat, h = GENERAL[None, :, :2], 1e-5
    lines, at = field_functions(flat), np.array([[1.1, 0.8]])

    def slope(component: int, axis: int) -> float:
        step = h * np.eye(2)[axis]
        return float((flow(lines, at + step)[component] - flow(lines, at - step)[component])[0] / (2 * h))

    assert abs(slope(0, 0) + slope(2, 1)) < 1e-9
    assert abs(slope(2, 0) + slope(1, 1)) < 1e-9


def test_an_oblique_panel_is_garveys() -> None:
    """Energy of a parallelogram: q² A (1 + 2 cot² / (1 + ν)) / 2Gt."""
    angle = np.radians(55.0)
    c, s = 2.0 * np.cos(angle), 2.0 * np.sin(angle)
    web = web_field(np.array([[[0.0, 0], [3, 0], [3 + c, s], [c, s]]]))
    nu = VALUES["E"] / (2.0 * VALUES["G"]) - 1.0
    factor = 1.0 + web.direct[0] / web.shear[0] * VALUES["G"] / VALUES["E"]
    assert factor == pytest.approx(1.0 + 2.0 / np.tan(angle) ** 2 / (1.0 + nu), rel=1e-12)


def test_a_tapered_panel_is_garveys() -> None:
    """A trapezoid whose sides fall by angles α and rise by β: 1 + 2 (tan²α − tan α tan β + tan²β) / 3(1 + ν)."""
    a, b, nu = np.tan(0.3), np.tan(0.1), 0.25
    web = web_field(np.array([[[0.0, 0], [2, 2 * b], [2, 3 - 2 * a], [0, 3]]]))
    factor = 1.0 + web.direct[0] / web.shear[0] / (2.0 * (1.0 + nu))
    assert factor == pytest.approx(1.0 + 2.0 / (3.0 * (1.0 + nu)) * (a * a - a * b + b * b), rel=1e-8)


@pytest.mark.parametrize(("f1", "area"), [(1.0, 0.1 * 6.0 / 6.0), (0.5, 0.05), (30.0, 0.5 * 30.0 * 0.01)])
def test_edges_stretch_as_rods(f1: float, area: float) -> None:
    u = np.zeros((4, 3))
    u[[1, 2], 0] = 0.3
    energy = u.ravel() @ stiffness(structure(RECTANGLE, F1=f1)) @ u.ravel()
    # two rods of length 3
    assert energy == pytest.approx(2.0 * VALUES["E"] * area * 0.3**2 / 3.0, rel=1e-12)
    across = np.zeros((4, 3))
    across[[2, 3], 1] = 0.3
    assert across.ravel() @ stiffness(structure(RECTANGLE, F1=f1)) @ across.ravel() == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("consistent", [False, True])
def test_mass(consistent: bool) -> None:
    model = structure(GENERAL, consistent=consistent)
    found = mass_properties(model.nodes, assemble(model, "mass"))
    one, other = GENERAL[2] - GENERAL[0], GENERAL[3] - GENERAL[1]
    area = 0.5 * (one[0] * other[1] - one[1] * other[0])
    assert found.mass == pytest.approx((3.0 * 0.1 + 0.2) * area, rel=1e-13)


@pytest.mark.parametrize("xyz", [RECTANGLE, GENERAL])
def test_terms_are_exact(xyz: Reals) -> None:
    model = structure(xyz, F1=0.7, F2=25.0)
    (batch,) = model.batches
    terms = contributions(batch, model)
    assert {t.label for t in terms} >= {"effective F1", "effective width F2", "mass", "added-mass"}
    for term in terms:
        check_contribution(term, {role: model.values.values[batch.roles[role]] for role in term.roles})


def test_displacement_frames() -> None:
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(4, 3, 3)))[0]
    plain, turned = (structure(GENERAL, frames, F1=0.7, F2=25.0) for frames in (None, turn))
    block = np.zeros((12, 12))
    for i in range(4):
        block[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = turn[i]
    np.testing.assert_allclose(stiffness(turned), block.T @ stiffness(plain) @ block, atol=1e-12)


@pytest.mark.parametrize(
    ("xyz", "t", "code"),
    [
        (RECTANGLE[[0, 1, 1, 3]], 0.1, "element.shell-shape"),
        (RECTANGLE[[0, 2, 1, 3]], 0.1, "element.shell-shape"),
        (RECTANGLE, 0.0, "element.shell-thickness"),
    ],
)
def test_panels_without_a_shape_are_refused(xyz: Reals, t: float, code: str) -> None:
    model = structure(xyz, t=t)
    with pytest.raises(FemtuneError) as error:
        contributions(model.batches[0], model)
    assert error.value.code == code
