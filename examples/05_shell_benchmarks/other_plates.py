"""Skew plates beside the Ritz method and circular plates beside their closed form."""

from __future__ import annotations

import numpy as np
from closed_forms import circular_plate
from page import numbers, section, table
from plates import CANCELLED, NU, Reals, frequency_numbers
from ritz import membrane, thin

from structures.shells import ShellMesh, dofs_of, rectangle, shell_mesh

THIN = 1e-3
KINDS = {"quad": "quads", "union": "triangles"}
MASSES = {True: "consistent", False: "lumped"}
MASSES_QUICK = {True: "consistent"}


def held(mesh: ShellMesh, edges: str) -> set[int]:
    """Motion in the plane; the deflection at S (turns are free, whatever the edge's direction), all at C."""
    out = dofs_of(np.arange(len(mesh.xyz)), "126")
    for name, letter in zip(("u0", "v0", "u1", "v1"), edges):
        out |= dofs_of(mesh.edge(name), {"S": "3", "C": "345", "F": ""}[letter])
    return out


def skew_reference(edges: str, angle: float) -> Reals:
    """Four numbers of the rhombus."""
    return membrane(4, angle) if edges == "SSSS" else thin(edges, 4, angle, terms=20)


def skew_rows(degrees: int, edges: str, n: int, masses: dict[bool, str]) -> list[list[str]]:
    """Errors on n × n and 2n × 2n cells; asserts the order of clamped plates' first modes."""
    angle = np.radians(degrees)
    exact, rows = skew_reference(edges, angle), []
    for kind, name in KINDS.items():
        for consistent, mass in masses.items():
            found = []
            for k in (n, 2 * n):
                mesh = shell_mesh(rectangle(1.0, 1.0, angle), k, k, kind)
                found.append(frequency_numbers(mesh, held(mesh, edges), THIN, 4, consistent)[:4] / exact - 1)
            if edges == "CCCC" and kind == "quad" and consistent:
                assert np.log2(np.abs(found[0] / found[1]))[:3].min() > 1.6, (degrees, found)
            assert np.abs(found[1]).max() < (0.07 if degrees == 60 else 0.03) * (16 / n) ** 2, (degrees, edges, found)
            cells = [numbers(100 * e) for e in found]
            rows.append([f"{degrees}°", edges, f"{name}, {mass}", " ".join(f"{x:.4g}" for x in exact), *cells])
    return rows


def disc(u: Reals, v: Reals) -> tuple[Reals, Reals, Reals]:
    """The unit square mapped smoothly onto a unit disc."""
    x, y = 2 * u - 1, 2 * v - 1
    return x * np.sqrt(1 - y**2 / 2), y * np.sqrt(1 - x**2 / 2), 0 * u


def disc_errors(edge: str, kind: str, consistent: bool, n: int, exact: Reals) -> Reals:
    """Relative errors of six elastic modes on n × n cells."""
    mesh, rigid = shell_mesh(disc, n, n, kind), 3 if edge == "F" else 0
    fixed = dofs_of(np.arange(len(mesh.xyz)), "126") | dofs_of(mesh.rim, {"C": "345", "S": "3", "F": ""}[edge])
    found = frequency_numbers(mesh, fixed, THIN, 6 + rigid, consistent)
    return found[rigid : rigid + 6] / exact - 1


def disc_rows(edge: str, n: int, masses: dict[bool, str]) -> list[list[str]]:
    """Errors of circular plates; asserts the order with consistent mass and quadrilaterals."""
    exact, rows = circular_plate(edge, NU, 7.0)[:6], []
    for kind, name in KINDS.items():
        for consistent, mass in masses.items():
            coarse, fine = (disc_errors(edge, kind, consistent, k, exact) for k in (n, 2 * n))
            orders = np.log2(np.abs(coarse / fine))
            if kind == "quad" and consistent:
                assert (np.abs(fine) < CANCELLED)[orders < 1.7].all(), (edge, orders)
            assert np.abs(fine).max() < 0.035 * (12 / n) ** 2, (edge, kind, consistent, fine)
            shown = f"{orders.min():.2f} to {orders.max():.2f}" if consistent else ""
            rows.append([edge, f"{name}, {mass}", " ".join(f"{x:.4g}" for x in exact), numbers(100 * fine), shown])
    return rows


def other_plates(quick: bool) -> str:
    """Both tables."""
    masses = MASSES_QUICK if quick else MASSES
    n = 8 if quick else 16
    cases = [(d, e) for d in (30, 45, 60) for e in ("CCCC", "SSSS", "CFFF")]
    rows = [row for d, e in (cases[3:5] if quick else cases) for row in skew_rows(d, e, n, masses)]
    head = ("skew", "edges", "elements", "reference", f"{n} × {n}", f"{2 * n} × {2 * n}")
    m = 8 if quick else 12
    discs = [row for edge in ("CF" if quick else "CSF") for row in disc_rows(edge, m, masses)]
    discs_head = ("edge", "elements", "exact", f"errors in per cent, {2 * m} × {2 * m}", "orders")
    skew = section("Skew plates", SKEW, table(head, rows))
    return skew + "\n" + section("Circular plates", DISC, table(discs_head, discs))


SKEW = """Rhombi, L/t = 1000, ω L² √(ρt/D), errors of four modes in per cent. Reference: the Ritz method (20 × 20
terms, to 0.1 %); simply supported: the eigenvalues of the membrane of the same shape, which are those of the plate for
every convex polygon, to 1e-5 (polynomials for the plate itself remain 3 % too high at 60°, because of the moments in
the obtuse corners). For the same reason simply supported meshes converge slowly, quadrilaterals from above.
Asserted order of the clamped plates with quadrilaterals: 2 in modes 1 to 3.
"""
DISC = """A square map of the unit disc, R/t = 1000, ω R² √(ρt/D) from the roots of Bessel functions, six modes, ν =
0.3.
"""
