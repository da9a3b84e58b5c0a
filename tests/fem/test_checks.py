"""Mass properties, rigid-body checks and grounding against hand results."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.fem.assemble import assemble
from femtune.fem.checks import grounding_elements, mass_properties, rigid_body_modes, rigid_motion_checks
from structures.frames import bars, bushes, make_structure, masses, scalars

SECTION = {"E": 200.0, "G": 80.0, "A": 3.0, "I1": 0.7, "I2": 0.4, "J": 0.9, "rho": 2.0}
XYZ = np.array([[0.0, 0.0, 0.0], [2.0, 0.5, 0.0], [2.0, 3.0, 1.0]])


def turned() -> np.ndarray:
    rng = np.random.default_rng(4)
    return np.array([np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in XYZ])


def test_mass_properties_of_point_masses():
    m, points = np.array([2.0, 3.0, 5.0]), XYZ
    structure = make_structure(XYZ, [masses([0, 1, 2], {"M": m})], turned())
    about = np.array([0.3, -0.7, 0.2])
    found = mass_properties(structure.nodes, assemble(structure, "mass"), about)
    centre = m @ points / m.sum()
    assert found.mass == pytest.approx(10.0)
    np.testing.assert_allclose(found.directional_mass, 10.0)
    np.testing.assert_allclose(found.centre, centre, atol=1e-13)
    for tensor, origin in ((found.inertia, about), (found.central_inertia, centre)):
        r = points - origin
        expected = np.einsum("k,kij->ij", m, (r**2).sum(1)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None, :])
        np.testing.assert_allclose(tensor, expected, atol=1e-12)


def test_mass_in_one_direction_only():
    parts = [masses([0, 1], {"M": 2.0}), scalars("scalar-mass", [[1, -1]], "M", 6.0)]
    found = mass_properties((s := make_structure(XYZ, parts)).nodes, assemble(s, "mass"))
    np.testing.assert_allclose(found.directional_mass, [4.0, 10.0, 4.0])


def test_no_mass_at_all():
    structure = make_structure(XYZ, [])
    found = mass_properties(structure.nodes, assemble(structure, "mass"))
    assert found.mass == 0.0
    assert np.isfinite(found.centre).all()


def test_rigid_modes_by_hand():
    structure = make_structure(XYZ, [])
    about_z = rigid_body_modes(structure.nodes, np.array([1.0, 0.0, 0.0]))[:, 5]
    np.testing.assert_allclose(about_z[12:], [-3.0, 1.0, 0.0, 0.0, 0.0, 1.0])


def test_free_frame_is_strain_free():
    structure = make_structure(XYZ, [bars([[0, 1], [1, 2]], SECTION, orientation=(0.1, 0.2, 1.0))], turned())
    checks = rigid_motion_checks(structure.nodes, assemble(structure, "stiffness"))
    assert [c.motion for c in checks] == ["X", "Y", "Z", "RX", "RY", "RZ"]
    assert all(c.passed and not c.worst for c in checks)
    assert not grounding_elements(structure)


def test_hidden_spring_to_ground_is_found():
    """A grounded spring of 1e-5 of the bars' stiffness at node 2, component 2: energy ½ k for a unit y."""
    k = 3e-3
    frame = bars([[0, 1], [1, 2]], SECTION, orientation=(0.1, 0.2, 1.0))
    structure = make_structure(XYZ, [frame, scalars("spring", [[7, -1]], "K", k)])
    checks = {c.motion: c for c in rigid_motion_checks(structure.nodes, assemble(structure, "stiffness"))}
    assert {m for m, c in checks.items() if not c.passed} == {"Y", "RZ"}
    assert checks["Y"].energy == pytest.approx(0.5 * k, rel=1e-6)
    assert str(checks["Y"].worst[0][0]) == "2Y+"
    found = grounding_elements(structure)
    assert {(g.card, g.motion) for g in found} == {("CELAS2", "Y"), ("CELAS2", "RZ")}
    assert found[0].energy == pytest.approx(0.5 * k * 2.0**2)


def test_the_energy_of_a_structure_on_a_spring_is_that_of_the_spring():
    """Nothing cancels: all of the energy is left."""
    structure = make_structure(np.array([[1.0, 2.0, 3.0]]), [scalars("spring", [[0, -1]], "K", [400.0])])
    check = rigid_motion_checks(structure.nodes, assemble(structure, "stiffness"))[0]
    assert (check.motion, check.energy, check.relative_energy) == ("X", 200.0, 1.0)


def test_bush_across_a_gap_grounds_rotation():
    """Arms that don't meet: rotation strains the bush although nothing is grounded."""
    structure = make_structure(XYZ, [bushes([[0, 1]], {"K1": 1.0, "K2": 1.0, "K3": 1.0})])
    assert {g.motion for g in grounding_elements(structure)} == {"RX", "RY", "RZ"}
