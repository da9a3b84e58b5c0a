"""The pentahedron of six nodes as a bar along its axis: bending and torsion of its triangle."""

from __future__ import annotations

import numpy as np
import pytest
from tests.fem.solid_parts import dense, one

from structures.shells import Isotropic

E, NU, LENGTH = 200.0, 0.3, 0.7


def column(triangle) -> np.ndarray:
    """A right prism on a triangle (3, 2) about its centre."""
    flat = np.array(triangle, float) - np.mean(triangle, axis=0)
    return np.array([[*p, z] for z in (-LENGTH / 2, LENGTH / 2) for p in flat])


def energy(xyz, field) -> float:
    u = np.stack([np.broadcast_to(c, len(xyz)) for c in field], axis=1).ravel()
    return float(u @ dense(one("penta6", xyz, Isotropic(E, NU))) @ u)


def second_moments(triangle) -> np.ndarray:
    """(2, 2) integrals of xx, xy, yy over a triangle about its centre: area/12 times sums over the corners."""
    p = np.array(triangle, float) - np.mean(triangle, axis=0)
    area = 0.5 * abs(np.linalg.det(p[1:] - p[0]))
    return area / 12 * p.T @ p


@pytest.mark.parametrize("angle", [0.0, 1.0, 2.5])
def test_a_column_bends_as_a_bar(angle: float):
    """Strain along the axis κ (x cos a + y sin a), no stress across: E κᵀI κ per length."""
    triangle = [(0, 0), (1.3, 0.1), (0.4, 0.9)]
    xyz, k = column(triangle), np.array([np.cos(angle), np.sin(angle)])
    x, y, z = xyz.T
    found = energy(xyz, (-k[0] * z**2 / 2, -k[1] * z**2 / 2, z * (k[0] * x + k[1] * y)))
    assert found == pytest.approx(E * LENGTH * k @ second_moments(triangle) @ k, rel=1e-10)


def test_an_equilateral_column_twists_as_st_venant_says():
    """J = √3 a⁴/80; the corners do not warp."""
    a = 1.1
    xyz = column([(0, 0), (a, 0), (a / 2, a * np.sqrt(3) / 2)])
    x, y, z = xyz.T
    G = E / (2 + 2 * NU)
    assert energy(xyz, (-y * z, x * z, 0 * z)) == pytest.approx(G * np.sqrt(3) * a**4 / 80 * LENGTH, rel=1e-10)


def test_a_right_angled_column_twists_nearly_so():
    """J = 0.02609 a⁴ for legs a (Roark); the corners' warping is left to the element's own balance."""
    a = 1.0
    xyz = column([(0, 0), (a, 0), (0, a)])
    x, y, z = xyz.T
    G = E / (2 + 2 * NU)
    assert energy(xyz, (-y * z, x * z, 0 * z)) == pytest.approx(G * 0.02609 * LENGTH, rel=0.06)
