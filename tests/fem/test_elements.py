"""Element matrices: strain-free motions, hand results, releases, offsets, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.assemble import assemble
from femtune.fem.checks import rigid_body_modes
from femtune.fem.elements import contributions
from structures.frames import Part, bars, bushes, dense_matrices, make_structure, masses, rods, scalars

SECTION = {"E": 200.0, "G": 80.0, "A": 3.0, "I1": 0.7, "I2": 0.4, "J": 0.9, "rho": 2.0}
SHEAR = {"K1": 0.8, "K2": 0.6}
BUSH = {f"K{i}": float(i) for i in range(1, 7)}
XYZ = np.array([[0.2, 0.1, 0.0], [1.4, 0.3, -0.5]])


def turned(n: int, seed: int = 5) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.array([np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(n)])


OFFSETS = ((0.1, 0.3, -0.2), (0.0, -0.4, 0.1))
STRAIN_FREE = {
    "bar": bars([[0, 1]], SECTION),
    "bar with offsets": bars([[0, 1]], SECTION, offsets=OFFSETS),
    "bar with shear": bars([[0, 1]], {**SECTION, **SHEAR}, offsets=OFFSETS),
    "bar with pins": bars([[0, 1]], {**SECTION, **SHEAR}, offsets=OFFSETS, pins=(5, 10, 3)),
    "beam with I12": bars([[0, 1]], {**SECTION, **SHEAR, "I12": 0.2}, card="CBEAM", offsets=OFFSETS),
    "rod": rods([[0, 1]], SECTION),
    "bush": bushes([[0, 1]], BUSH, frame=turned(1)[0], arm_a=(0.3, 0.1, 0.2), arm_b=XYZ[0] + (0.3, 0.1, 0.2) - XYZ[1]),
}


@pytest.mark.parametrize("name", STRAIN_FREE)
def test_six_motions_are_strain_free_and_no_more(name: str):
    structure = make_structure(XYZ, [STRAIN_FREE[name]], turned(2))
    K = assemble(structure, "stiffness").toarray()
    motions = rigid_body_modes(structure.nodes, np.array([0.3, -0.2, 0.7]))
    assert np.abs(K @ motions).max() < 1e-12 * np.abs(K).max()
    deformations = {"rod": 2, "bar with pins": 3}.get(name, 6)
    assert np.linalg.matrix_rank(K, tol=1e-9 * np.abs(K).max()) == deformations
    assert np.linalg.eigvalsh(K)[0] > -1e-12 * np.abs(K).max()


@pytest.mark.parametrize("name", STRAIN_FREE)
def test_displacement_frames_only_rename(name: str):
    frames = turned(2)
    plain, other = (make_structure(XYZ, [STRAIN_FREE[name]], f, consistent_mass=True) for f in (None, frames))
    F = np.zeros((12, 12))
    for i, k in enumerate((0, 0, 1, 1)):
        F[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = frames[k]
    for kind in ("stiffness", "mass"):
        there = F.T @ assemble(plain, kind).toarray() @ F
        np.testing.assert_allclose(assemble(other, kind).toarray(), there, atol=1e-12 * np.abs(there).max(initial=1.0))


def tip(part: Part, force: np.ndarray, xyz: np.ndarray) -> np.ndarray:
    """Displacements of node 2 of an element clamped at node 1."""
    K, _ = dense_matrices(make_structure(xyz, [part]), range(6))
    return np.linalg.solve(K, force)


STRAIGHT = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])


@pytest.mark.parametrize("shear", [False, True])
def test_cantilever_tip_loads(shear: bool):
    L, E, G, A, I1, I2, J = 2.0, 200.0, 80.0, 3.0, 0.7, 0.4, 0.9
    part = bars([[0, 1]], {**SECTION, **(SHEAR if shear else {})})
    slip = [L / (k * A * G) if shear else 0.0 for k in SHEAR.values()]
    for i, expected in enumerate([L / (E * A), L**3 / (3 * E * I1) + slip[0], L**3 / (3 * E * I2) + slip[1],
                                  L / (G * J), L / (E * I2), L / (E * I1)]):  # fmt: skip
        assert tip(part, np.eye(6)[i], STRAIGHT)[i] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("shear", [False, True])
def test_skew_bending_of_a_cantilever(shear: bool):
    """Unsymmetric bending: curvatures solve E [[I1, I12], [I12, I2]] κ = M."""
    L, I12 = 2.0, 0.3
    part = bars([[0, 1]], {**SECTION, **(SHEAR if shear else {}), "I12": I12}, card="CBEAM")
    inertia = 200.0 * np.array([[0.7, I12], [I12, 0.4]])
    slip = np.diag([L / (k * 3.0 * 80.0) if shear else 0.0 for k in SHEAR.values()])
    for load in ([1.0, 0.0], [0.0, 1.0]):
        expected = (L**3 / 3.0 * np.linalg.inv(inertia) + slip) @ load
        np.testing.assert_allclose(tip(part, np.array([0, *load, 0, 0, 0]), STRAIGHT)[1:3], expected, rtol=1e-11)


def test_product_of_inertia_is_that_of_turned_principal_axes():
    """A section described in turned axes with I12 is the section described in its principal axes."""
    c, s = np.cos(0.6), np.sin(0.6)
    principal = bars([[0, 1]], SECTION, orientation=(0.0, c, s))
    moments = {"I1": c * c * 0.7 + s * s * 0.4, "I2": s * s * 0.7 + c * c * 0.4, "I12": c * s * (0.7 - 0.4)}
    turned_axes = bars([[0, 1]], {**SECTION, **moments})
    K = [assemble(make_structure(STRAIGHT, [p]), "stiffness").toarray() for p in (principal, turned_axes)]
    np.testing.assert_allclose(K[0], K[1], atol=1e-11 * np.abs(K[0]).max())


def test_bar_ignores_shear_where_its_planes_are_coupled_and_beam_does_not():
    values = {**SECTION, **SHEAR, "I12": 0.2}
    K = {
        card: assemble(make_structure(STRAIGHT, [bars([[0, 1]], v, card=card)]), "stiffness").toarray()
        for card, v in (("CBAR", values), ("CBEAM", values))
    }
    rigid = assemble(make_structure(STRAIGHT, [bars([[0, 1]], {**values, "K1": 0.0, "K2": 0.0})]), "stiffness")
    np.testing.assert_allclose(K["CBAR"], rigid.toarray(), atol=1e-12)
    assert np.abs(K["CBEAM"] - K["CBAR"]).max() > 1.0


def test_a_general_mass_acts_along_its_frame_and_with_the_mass_factor():
    """½ m v·v of a rigid motion is the same along the frame and along the basic axes."""
    rng = np.random.default_rng(3)
    whole = rng.standard_normal((6, 6))
    whole, Q = whole @ whole.T, turned(1)[0]
    values = {f"M{i + 1}{j + 1}": whole[i, j] for i in range(6) for j in range(i + 1)}
    part = Part("general-mass", "CONM1", np.array([[0]]), values, {"frame": Q[None]})
    M = assemble(make_structure(XYZ[:1], [part], mass_factor=0.25), "mass").toarray()
    motion = rng.standard_normal(6)
    along = np.concatenate([Q.T @ motion[:3], Q.T @ motion[3:]])
    assert motion @ M @ motion == pytest.approx(0.25 * along @ whole @ along, rel=1e-12)


def condensed(K: np.ndarray, out: list[int]) -> np.ndarray:
    """Static condensation of released DOFs; their rows and columns are left zero."""
    keep = [i for i in range(len(K)) if i not in out]
    result = np.zeros_like(K)
    inner = K[np.ix_(out, out)]
    result[np.ix_(keep, keep)] = (
        K[np.ix_(keep, keep)] - K[np.ix_(keep, out)] @ np.linalg.pinv(inner, rcond=1e-10) @ K[np.ix_(out, keep)]
    )
    return result


@pytest.mark.parametrize("shear", [False, True])
@pytest.mark.parametrize(
    "pins", [(5,), (11,), (4,), (1,), (8,), (5, 11), (1, 7), (1, 5), (2, 10), (0,), (9,), (4, 5, 10, 11), (0, 3, 4, 11)]
)
def test_releases_are_static_condensation(pins: tuple[int, ...], shear: bool):
    values = {**SECTION, **(SHEAR if shear else {})}
    whole, released = (
        assemble(make_structure(STRAIGHT, [bars([[0, 1]], values, pins=p)]), "stiffness").toarray() for p in ((), pins)
    )
    expected = condensed(whole, list(pins))
    np.testing.assert_allclose(released, expected, atol=1e-11 * np.abs(whole).max())


def test_cantilever_with_rigid_offset():
    """Axis at height a over the nodes: an axial force at the node bends the bar too; the rigid end adds a lever."""
    L, a, E, A, I1 = 2.0, 0.3, 200.0, 3.0, 0.7
    part = bars([[0, 1]], SECTION, offsets=((0.0, a, 0.0), (0.0, a, 0.0)))
    u = tip(part, np.array([1.0, 0, 0, 0, 0, 0]), STRAIGHT)
    assert u[0] == pytest.approx(L / (E * A) + a * a * L / (E * I1), rel=1e-12)
    assert u[5] == pytest.approx(a * L / (E * I1), rel=1e-12)
    # a rigid end of length r along the axis: force at the node, flexible length L − r
    r = 0.5
    part = bars([[0, 1]], SECTION, offsets=((0.0, 0.0, 0.0), (-r, 0.0, 0.0)))
    u = tip(part, np.array([0, 1.0, 0, 0, 0, 0]), STRAIGHT)
    f = L - r
    assert u[1] == pytest.approx((f**3 / 3 + r * f**2 + r**2 * f) / (E * I1), rel=1e-12)


def test_bush_at_a_distance_carries_moments():
    """A lateral spring at the end of an arm: force times arm turns the node."""
    part = bushes([[0, -1]], {"K2": 5.0, "K1": 1.0, "K3": 1.0, "K4": 1.0, "K5": 1.0, "K6": 2.0}, arm_a=(1.5, 0.0, 0.0))
    K = assemble(make_structure([[0.0, 0.0, 0.0]], [part]), "stiffness").toarray()
    assert K[1, 1] == pytest.approx(5.0)
    assert K[1, 5] == pytest.approx(5.0 * 1.5)
    assert K[5, 5] == pytest.approx(2.0 + 5.0 * 1.5**2)


def test_concentrated_mass_by_hand():
    """Signs: products of inertia enter negative, and the offset adds M (r² δ − r rᵀ)."""
    values = {"M": 2.0, "I11": 5.0, "I21": 0.3, "I22": 6.0, "I31": 0.4, "I32": 0.5, "I33": 7.0}
    r = np.array([0.1, -0.2, 0.3])
    M = assemble(make_structure([[1.0, 2.0, 3.0]], [masses([0], values, r)], mass_factor=0.25), "mass").toarray() * 4
    tensor = np.array([[5.0, -0.3, -0.4], [-0.3, 6.0, -0.5], [-0.4, -0.5, 7.0]])
    np.testing.assert_allclose(M[3:, 3:], tensor + 2.0 * (r @ r * np.eye(3) - np.outer(r, r)), atol=1e-14)
    np.testing.assert_allclose(M[:3, 3:], 2.0 * np.cross(np.eye(3), r).T, atol=1e-14)
    np.testing.assert_allclose(M[:3, :3], 2.0 * np.eye(3))


@pytest.mark.parametrize("consistent", [False, True])
@pytest.mark.parametrize("name", ["bar", "bar with offsets", "rod"])
def test_total_mass(name: str, consistent: bool):
    part = STRAIN_FREE[name]
    structure = make_structure(XYZ, [part], turned(2), consistent_mass=consistent, mass_factor=0.5)
    motions = rigid_body_modes(structure.nodes)
    ends = XYZ + (np.array(OFFSETS) if "offsets" in name else 0.0)
    mass = 0.5 * 2.0 * 3.0 * np.linalg.norm(ends[1] - ends[0])
    np.testing.assert_allclose(
        (motions.T @ assemble(structure, "mass") @ motions)[:3, :3], mass * np.eye(3), atol=1e-12
    )


def test_grounded_spring_and_scalar_mass():
    parts = [scalars("spring", [[0, 6], [1, -1]], "K", [2.0, 3.0]), scalars("scalar-mass", [[2, -1]], "M", 4.0)]
    structure = make_structure(XYZ, parts)
    K, M = (assemble(structure, kind).toarray() for kind in ("stiffness", "mass"))
    assert K[0, 0] == K[6, 6] == -K[0, 6] == 2.0
    assert K[1, 1] == 3.0
    assert M[2, 2] == 4.0


BAD = {
    "element.zero-length": bars([[0, 1], [1, 1]], SECTION),
    "element.orientation": bars([[0, 1]], SECTION, orientation=XYZ[1] - XYZ[0]),
    "element.pinned-i12": bars([[0, 1]], {**SECTION, "I12": 0.1}, pins=(5,)),
}


@pytest.mark.parametrize("code", BAD)
def test_refusals_name_the_element(code: str):
    structure = make_structure(XYZ, [BAD[code]])
    with pytest.raises(FemtuneError) as caught:
        contributions(structure.batches[0], structure)
    assert caught.value.code == code
    assert "CBAR" in str(caught.value.where)
    assert caught.value.hint


def test_zero_length_rod_is_refused_and_names_the_second_element():
    structure = make_structure(XYZ, [rods([[0, 1], [1, 1]], SECTION)])
    with pytest.raises(FemtuneError, match="same place") as caught:
        contributions(structure.batches[0], structure)
    assert "CROD 2" in str(caught.value)
