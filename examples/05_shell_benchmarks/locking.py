"""Locking: slenderness from ten to ten thousand, distorted meshes, and one element bent in its plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from page import numbers, section, table
from plates import NU, RHO, E, held
from ritz import KAPPA

from structures.shells import (
    Isotropic,
    Section,
    ShellPart,
    dofs_of,
    natural_frequencies,
    rectangle,
    shell_mesh,
    shell_structure,
    static_displacements,
)

Reals = NDArray[np.float64]
KINDS = {"quad": "quads", "union": "triangles"}


def exact(t: float) -> Reals:
    """Four frequencies in Hz of a simply supported unit plate with shear flexibility and without rotary inertia."""
    i = np.arange(1, 6)
    k2 = np.sort(np.pi**2 * np.add.outer(i**2, i**2).ravel())[:4]
    D, shear = E * t**3 / (12 * (1 - NU**2)), KAPPA * E / (2 + 2 * NU) * t
    return np.sqrt(D * k2**2 / (RHO * t * (1 + D * k2 / shear))) / (2 * np.pi)


def errors(kind: str, n: int, slenderness: float, distort: float) -> Reals:
    """Relative errors of four modes on n × n cells, consistent mass."""
    mesh, t = shell_mesh(rectangle(1.0, 1.0), n, n, kind, distort=distort), 1.0 / slenderness
    parts = [ShellPart(mesh.cells, Section(Isotropic(E, NU, RHO), t))]
    structure = shell_structure(mesh.xyz, parts, held=held(mesh, "SSSS"), consistent_mass=True)
    return natural_frequencies(structure, 4)[:4] / exact(t) - 1


def slender_rows(n: int) -> list[list[str]]:
    """Errors by slenderness; asserts that the elements do not lock."""
    rows = []
    for kind, label in KINDS.items():
        for distort in (0.0, 0.3):
            found = {s: errors(kind, n, s, distort) for s in (10.0, 100.0, 1000.0, 10000.0)}
            worst = [float(np.abs(e).max()) for e in found.values()]
            # an element that locks has an error that grows in proportion to L/t, and does not fall with order 2
            assert max(worst[2:]) < 1.3 * worst[1] + 0.001, (label, distort, worst)
            assert max(worst) < (0.02 if kind == "quad" else 0.035) * (16 / n) ** 2, (label, distort, worst)
            if not distort and n >= 16:
                coarse = float(np.abs(errors(kind, n // 2, 10000.0, 0.0)).max())
                assert np.log2(coarse / worst[-1]) > 1.7, (label, coarse, worst)
            name = f"{label}, inner points moved by up to 30 % of a cell" if distort else f"{label}, regular"
            rows.append([name, *(numbers(100 * e) for e in found.values())])
    return rows


def one_element(aspect: float, kind: str, drilling: float) -> float:
    """Tip deflection under a moment in the plane of one cell `aspect` long, 1 deep, over that of the beam."""
    mesh = shell_mesh(rectangle(aspect, 1.0), 1, 1, kind)
    parts = [ShellPart(mesh.cells, Section(Isotropic(1.0, 0.0), 0.1))]
    fixed = dofs_of(range(4), "345") | dofs_of(mesh.rows[0], "1") | dofs_of(mesh.rows[0, 0], "2")
    structure = shell_structure(mesh.xyz, parts, held=fixed, drilling=drilling)
    force = np.zeros(24)
    low, high = (int(node) for node in mesh.rows[1])
    force[6 * low], force[6 * high] = 1.0, -1.0
    deflection = static_displacements(structure, force)[[6 * low + 1, 6 * high + 1]].mean()
    return float(deflection / (aspect**2 / (2 * 0.1 / 12)))


def bending_rows() -> list[list[str]]:
    """Ratios by aspect and K6ROT; asserts that a rectangle bends exactly."""
    rows = []
    for kind, label in (("quad", "one CQUAD4"), ("right", "two CTRIA3")):
        for drilling in (1.0, 100.0, 1e4):
            ratios = [one_element(aspect, kind, drilling) for aspect in (0.1, 1.0, 10.0, 100.0)]
            assert kind != "quad" or np.abs(np.array(ratios) - 1.0).max() < 1e-6, ratios
            rows.append([label, f"{drilling:g}", *(f"{ratio:.4g}" for ratio in ratios)])
    return rows


def locking(quick: bool) -> str:
    """Both tables."""
    n = 6 if quick else 16
    slender = table(("elements", *(f"L/t = {s}" for s in ("10", "100", "1000", "10,000"))), slender_rows(n))
    bent = table(("element", "K6ROT", *(f"{a} : 1" for a in ("0.1", "1", "10", "100"))), bending_rows())
    return section("Locking", TEXT.format(n=n), slender, BENT, bent)


TEXT = """Simply supported square plate, {n} × {n} cells, consistent mass, errors in per cent of four modes against the
closed-form solution with shear flexibility. Asserted: less than 2 % (triangles 3.5 %), an increase of less than 30 %
from L/t = 100 on, and on regular meshes order 2 at L/t = 10,000 too. (A thick plate of squares has smaller errors than
a thin one: those of shear and mass cancel in part. The closed form of the commercial square's matrix shows the same.)
"""
BENT = """One cell in in-plane bending by a pair of forces: ratio of the deflection to that of a beam, by length :
depth. Asserted for the rectangle: 1 within 1e-6, for any K6ROT.
"""
