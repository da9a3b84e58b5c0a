"""Natural frequencies of quadrilateral plates against closed forms and published tables, with rates."""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from structures.shells import (
    Isotropic,
    Section,
    ShellMesh,
    ShellPart,
    dofs_of,
    natural_frequencies,
    rectangle,
    shell_mesh,
    shell_structure,
)

E, NU, RHO, SHEAR = 2.0e11, 0.3, 8000.0, 5.0 / 6.0


def bending_only(mesh: ShellMesh) -> set[int]:
    return dofs_of(np.arange(len(mesh.xyz)), "126")


def simply_supported(mesh: ShellMesh) -> set[int]:
    """Edges that cannot move out of the plane nor turn about the edge's normal."""
    along_x = np.concatenate([mesh.edge("v0"), mesh.edge("v1")])
    along_y = np.concatenate([mesh.edge("u0"), mesh.edge("u1")])
    return bending_only(mesh) | dofs_of(along_x, "35") | dofs_of(along_y, "34")


def clamped(mesh: ShellMesh) -> set[int]:
    return bending_only(mesh) | dofs_of(mesh.rim, "345")


def cantilever(mesh: ShellMesh) -> set[int]:
    return bending_only(mesh) | dofs_of(mesh.edge("u0"), "345")


@lru_cache
def plate(support, n: int, t: float, count: int, consistent: bool = False, distort: float = 0.0, side: float = 1.0):
    mesh = shell_mesh(rectangle(side, side), n, n, distort=distort)
    part = ShellPart(mesh.cells, Section(Isotropic(E, NU, RHO), t))
    structure = shell_structure(mesh.xyz, [part], held=support(mesh), consistent_mass=consistent)
    return natural_frequencies(structure, count)


def omega(t: float, number: float) -> float:
    """Frequency in Hz of a thin unit plate whose ω L² √(ρt/D) is `number`."""
    return number * np.sqrt(E * t**2 / (12 * (1 - NU**2) * RHO)) / (2 * np.pi)


def mindlin(t: float, count: int) -> np.ndarray:
    """Simply supported square plate with shear flexibility and without rotary inertia."""
    i = np.arange(1, 12)
    k2 = np.sort(np.pi**2 * np.add.outer(i**2, i**2).ravel())[:count]
    D = E * t**3 / (12 * (1 - NU**2))
    return np.sqrt(D * k2**2 / (RHO * t) / (1 + D * k2 / (SHEAR * E / (2 + 2 * NU) * t))) / (2 * np.pi)


@pytest.mark.quick(2)
@pytest.mark.parametrize("consistent", [False, True])
@pytest.mark.parametrize("t", [0.1, 0.01, 1e-4])
def test_simply_supported_plate_thick_and_thin(t: float, consistent: bool):
    exact = mindlin(t, 6)
    errors = np.array([plate(simply_supported, n, t, 6, consistent) / exact - 1.0 for n in (8, 16)])
    assert np.abs(errors[1]).max() < (0.027 if consistent else 0.023)
    # errors of the second order of mass, bending and residual flexibility have different signs and cancel in part
    rates = np.log2(np.abs(errors[0] / errors[1]))
    assert rates[[0, 1, 3]].min() > 1.5


def test_distorted_meshes_do_not_lock():
    """Random inner points: as good at L/t = 10,000 as at 100, and near the regular mesh."""
    thin = plate(simply_supported, 16, 1e-4, 6, distort=0.25) / mindlin(1e-4, 6) - 1.0
    thick = plate(simply_supported, 16, 1e-2, 6, distort=0.25) / mindlin(1e-2, 6) - 1.0
    assert np.abs(thin).max() < 0.02
    assert np.abs(thin - thick).max() < 4e-3


def test_clamped_plate():
    """Leissa, Vibration of Plates (1969): 35.985 73.394 73.394 108.22 131.58 132.20."""
    exact = omega(1e-3, np.array([35.985, 73.394, 73.394, 108.22, 131.58, 132.20]))
    errors = np.array([plate(clamped, n, 1e-3, 6, True) / exact - 1.0 for n in (8, 16)])
    assert np.abs(errors[1]).max() < 0.03
    assert (np.log2(np.abs(errors[0] / errors[1])) > 2.0).all()
    assert np.abs(plate(clamped, 16, 1e-3, 6) / exact - 1.0).max() < 0.025


def test_cantilever_plate():
    """Square plate clamped on one side, ν = .3: 3.4711 8.5067 21.285 27.199 30.956 (Ritz)."""
    exact = omega(1e-3, np.array([3.4711, 8.5067, 21.285, 27.199, 30.956]))
    found = [plate(cantilever, n, 1e-3, 5) / exact - 1.0 for n in (8, 16)]
    assert np.abs(found[1]).max() < 0.014
    assert np.abs(np.log2(np.abs(found[0] / found[1])) - 2.0).max() < 0.3


def strip(n: int, t: float) -> float:
    """First bending frequency of a cantilever strip without Poisson's ratio, in its plane and with n elements."""
    mesh = shell_mesh(rectangle(1.0, 0.05), n, 1)
    held = dofs_of(mesh.edge("u0"), "126") | dofs_of(np.arange(len(mesh.xyz)), "345")
    part = ShellPart(mesh.cells, Section(Isotropic(E, 0.0, RHO), t))
    return float(natural_frequencies(shell_structure(mesh.xyz, [part], held=held), 1)[0])


def test_one_row_of_elements_bends_in_its_plane_like_a_beam():
    h = 0.05
    exact = 1.8751041**2 * np.sqrt(E * h**2 / 12 / RHO) / (2 * np.pi)
    errors = [strip(n, 0.01) / exact - 1.0 for n in (10, 20, 40)]
    # shear flexibility and rotary inertia, which the beam's closed form leaves out, take .3 %
    assert abs(errors[-1]) < 0.005
    assert abs(errors[0]) < 0.012


def published(shared_data: Path, start: str) -> np.ndarray:
    table = json.loads((shared_data / "reference_values" / "nafems.json").read_text(encoding="utf-8"))
    return np.array(next(v["target_Hz"] for k, v in table.items() if k.startswith(start)))


def test_nafems_fv12_free_thin_plate(shared_data: Path):
    target = published(shared_data, "FV12")
    found = plate(bending_only, 16, 0.05, 11, side=10.0)
    assert found[2] < 1e-3
    np.testing.assert_allclose(found[3:], target, rtol=0.03)
    coarse = plate(bending_only, 8, 0.05, 11, side=10.0)[3:]
    np.testing.assert_allclose((4 * found[3:] - coarse) / 3, target, rtol=0.007)


def test_nafems_test_13_simply_supported_plate(shared_data: Path):
    target = published(shared_data, "Test 13")
    np.testing.assert_allclose(plate(simply_supported, 16, 0.05, 8, side=10.0), target, rtol=0.03)


def tapered(nu: int, nv: int) -> np.ndarray:
    mesh = shell_mesh(lambda u, v: (10 * u, (2 * v - 1) * (2.5 - 2.0 * u), 0 * u), nu, nv)
    held = dofs_of(np.arange(len(mesh.xyz)), "345") | dofs_of(mesh.edge("u0"), "12")
    part = ShellPart(mesh.cells, Section(Isotropic(E, NU, RHO), 0.05))
    return natural_frequencies(shell_structure(mesh.xyz, [part], held=held), 6)


def test_nafems_fv32_tapered_membrane(shared_data: Path):
    target = published(shared_data, "FV32")
    np.testing.assert_allclose(tapered(16, 8), target, rtol=0.015)
    np.testing.assert_allclose(tapered(32, 16), target, rtol=0.004)


def test_a_thick_free_plate_that_commercial_nastran_lists():
    """2 × 1 × 1/8 in, 20 × 10 elements, lumped mass; modes 7 to 10."""
    mesh = shell_mesh(rectangle(2.0, 1.0), 20, 10)
    part = ShellPart(mesh.cells, Section(Isotropic(2.9e7, 0.32, 7.331499e-4), 0.125))
    found = natural_frequencies(shell_structure(mesh.xyz, [part]), 10)
    assert (found[:6] < 1e-2 * found[6]).all()
    np.testing.assert_allclose(found[6:], [6333.01, 7495.47, 16238.5, 17161.5], rtol=5e-6)
