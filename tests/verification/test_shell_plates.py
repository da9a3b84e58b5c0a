"""Natural frequencies of quadrilateral plates against closed forms and published tables, with rates."""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from tests.loaded import load_module

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

from .plate_supports import bending_only, clamped, simply_supported

_FILE = Path(__file__).resolve().parents[2] / "examples" / "09_element_matrices" / "commercial.py"
commercial = load_module(_FILE)

E, NU, RHO, SHEAR = 2.0e11, 0.3, 8000.0, 5.0 / 6.0


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


def of_lattice(n: int, t: float, consistent: bool, count: int) -> np.ndarray:
    """(count,) frequencies in Hz of the simply supported plate of n × n squares of commercial Nastran, in closed form.

    A mode of the equal squares is a product of sines at the grid points: K and M of a wave on an infinite lattice, with
    phases iπ/n and jπ/n, are sums of the entries of the matrix of one element. Rotations are condensed.
    """
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    side = 1.0 / n
    moduli = commercial.Plate(E, NU, E / (2 + 2 * NU), t, SHEAR)
    K = commercial.bending_stiffness(moduli, side * corners).reshape(4, 3, 4, 3)
    line = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0 if consistent else np.eye(2) / 2.0
    # on corners in the order of x, then y; that of the element goes round
    M = RHO * t * side**2 * np.kron(line, line)[np.ix_([0, 2, 3, 1], [0, 2, 3, 1])]
    found = []
    most = min(n, 2 * count)
    for wave in np.pi / n * np.array([(i, j) for i in range(1, most) for j in range(1, most)]):
        phase = np.exp(1j * corners @ wave)
        symbol = np.einsum("a,aibj,b->ij", phase.conj(), K, phase)
        stiffness = symbol[0, 0] - symbol[0, 1:] @ np.linalg.solve(symbol[1:, 1:], symbol[1:, 0])
        found.append(np.sqrt(stiffness.real / (phase.conj() @ M @ phase).real) / (2 * np.pi))
    return np.sort(found)[:count]


@pytest.mark.slow
@pytest.mark.parametrize("consistent", [False, True])
@pytest.mark.parametrize("t", [0.1, 0.01, 1e-4])
def test_simply_supported_plate_thick_and_thin(t: float, consistent: bool):
    """On every mesh that of the commercial matrix, to rounding; that matrix converges with order 2, lumped or not."""
    for n in (4, 8, 16):
        found = plate(simply_supported, n, t, 6, consistent)
        np.testing.assert_allclose(found, of_lattice(n, t, consistent, 6), rtol=1e-7)
    errors = np.array([of_lattice(n, t, consistent, 6) / mindlin(t, 6) - 1.0 for n in (100, 200)])
    np.testing.assert_allclose(np.log2(np.abs(errors[0] / errors[1])), 2.0, atol=0.1)


@pytest.mark.slow
def test_distorted_meshes_do_not_lock():
    """Random inner points: as good at L/t = 10,000 as at 100, and near the regular mesh."""
    thin = plate(simply_supported, 16, 1e-4, 6, distort=0.25) / mindlin(1e-4, 6) - 1.0
    thick = plate(simply_supported, 16, 1e-2, 6, distort=0.25) / mindlin(1e-2, 6) - 1.0
    assert np.abs(thin).max() < 0.02
    assert np.abs(thin - thick).max() < 4e-3


def extrapolated(support, t: float, count: int, consistent: bool, side: float = 1.0) -> np.ndarray:
    """Limit of 16 and 32 elements a side for convergence of order 2.

    On single meshes only this can be asked: element matrix and mass are those of commercial Nastran, whose lumped mass
    is 1 to 3 % low with 16 elements, and whose coupled mass is as much too high.
    """
    coarse, fine = (plate(support, n, t, count, consistent, side=side) for n in (16, 32))
    return np.asarray((4.0 * fine - coarse) / 3.0)


@pytest.mark.slow
@pytest.mark.parametrize("consistent", [False, True])
def test_clamped_plate(consistent: bool):
    """Leissa, Vibration of Plates (1969): 35.985 73.394 73.394 108.22 131.58 132.20."""
    exact = omega(1e-3, np.array([35.985, 73.394, 73.394, 108.22, 131.58, 132.20]))
    np.testing.assert_allclose(extrapolated(clamped, 1e-3, 6, consistent), exact, rtol=0.003)


@pytest.mark.slow
@pytest.mark.parametrize("consistent", [False, True])
def test_cantilever_plate(consistent: bool):
    """Square plate clamped on one side, ν = 0.3: 3.4711 8.5067 21.285 27.199 30.956 (Ritz)."""
    exact = omega(1e-3, np.array([3.4711, 8.5067, 21.285, 27.199, 30.956]))
    np.testing.assert_allclose(extrapolated(cantilever, 1e-3, 5, consistent), exact, rtol=1e-3)


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
    # shear flexibility and rotary inertia, which the beam's closed form leaves out, take 0.3 %
    assert abs(errors[-1]) < 0.005
    assert abs(errors[0]) < 0.012


def published(shared_data: Path, start: str) -> np.ndarray:
    table = json.loads((shared_data / "reference_values" / "nafems.json").read_text(encoding="utf-8"))
    return np.array(next(v["target_Hz"] for k, v in table.items() if k.startswith(start)))


@pytest.mark.slow
@pytest.mark.parametrize("consistent", [False, True])
def test_nafems_fv12_free_thin_plate(shared_data: Path, consistent: bool):
    found = extrapolated(bending_only, 0.05, 11, consistent, side=10.0)
    assert found[2] < 1e-3
    np.testing.assert_allclose(found[3:], published(shared_data, "FV12"), rtol=0.0025)


@pytest.mark.slow
def test_nafems_test_13_simply_supported_plate(shared_data: Path):
    """The published values are those of a finite element model: modes 5 and 6 are 2.1 % above the closed form."""
    found = extrapolated(simply_supported, 0.05, 8, False, side=10.0)
    np.testing.assert_allclose(found, mindlin(0.005, 8) / 10.0, rtol=2e-3)
    np.testing.assert_allclose(found, published(shared_data, "Test 13"), rtol=0.022)


def tapered(nu: int, nv: int) -> np.ndarray:
    mesh = shell_mesh(lambda u, v: (10 * u, (2 * v - 1) * (2.5 - 2.0 * u), 0 * u), nu, nv)
    held = dofs_of(np.arange(len(mesh.xyz)), "345") | dofs_of(mesh.edge("u0"), "12")
    part = ShellPart(mesh.cells, Section(Isotropic(E, NU, RHO), 0.05))
    return natural_frequencies(shell_structure(mesh.xyz, [part], held=held), 6)


@pytest.mark.slow
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
