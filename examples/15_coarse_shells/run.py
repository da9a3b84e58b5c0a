"""Natural frequencies of shells on coarse meshes: python run.py [--quick] [--evidence DIR].

Plates, corner-supported panels, curved panels, a box beam and distorted meshes of CQUAD4 with 2, 4, 8 and 16 elements a
side, beside 64 elements, with lumped and with coupled mass. Asserts that the first mode of four elements a half wave is
within the stated bounds. The quick form uses fewer meshes and 24 elements as the reference.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # where structures/ lies

import numpy as np
from numpy.typing import NDArray

from femtune.fem.structure import Structure
from structures.shells import (
    Anisotropic,
    Isotropic,
    Material,
    Section,
    ShellMesh,
    ShellPart,
    cylinder,
    dofs_of,
    natural_frequencies,
    rectangle,
    shell_mesh,
    shell_structure,
)

Reals = NDArray[np.float64]
Make = Callable[[int, bool], Structure]

MODES = 4
FULL, QUICK = (2, 4, 8, 16), (2, 4, 8)
REFERENCE, QUICK_REFERENCE = 64, 24
STEEL = Isotropic(2.1e11, 0.3, 7850.0)


def main() -> None:
    """All tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="coarser meshes")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    arguments = parser.parse_args()
    text = "\n".join([INTRODUCTION, *rows(arguments.quick), CONCLUSION, ""])
    print(text)
    if arguments.evidence:
        (arguments.evidence / "15_coarse_shells.md").write_text(text)


@dataclass(frozen=True)
class Case:
    """A structure with n elements a side; `lumped` and `coupled` bound the first mode's error in % at n = 4.

    `rigid` is the number of its rigid-body modes, `most` the finest mesh that is used as the reference.
    """

    name: str
    make: Make
    lumped: float
    coupled: float
    rigid: int = 0
    most: int = REFERENCE

    def frequencies(self, n: int, consistent: bool) -> Reals:
        """The first elastic modes in Hz, NaN where the mesh has fewer."""
        found, out = (
            natural_frequencies(self.make(n, consistent), self.rigid + MODES)[self.rigid :],
            np.full(MODES, np.nan),
        )
        out[: min(len(found), MODES)] = found[:MODES]
        return out


def rows(quick: bool) -> Iterator[str]:
    """A line for each case and kind of mass."""
    meshes, finest = (QUICK, QUICK_REFERENCE) if quick else (FULL, REFERENCE)
    yield f"| case | {finest} elements, Hz | mass | " + " | ".join(f"{n}" for n in meshes) + " |"
    yield "|---" * (3 + len(meshes)) + "|"
    for case in CASES:
        reference = 0.5 * sum(case.frequencies(min(finest, case.most), consistent) for consistent in (False, True))
        head = f"| {case.name} | {' '.join(f'{f:.4g}' for f in reference)} "
        for name, consistent, bound in (("lumped", False, case.lumped), ("coupled", True, case.coupled)):
            errors = {n: 100.0 * (case.frequencies(n, consistent) / reference - 1.0) for n in meshes}
            cells = (" ".join("–" if np.isnan(e) else f"{e:+.1f}" for e in errors[n]).replace("-", "−") for n in meshes)
            yield f"{head}| {name} | {' | '.join(cells)} |"
            assert abs(errors[4][0]) < bound, (case.name, name, errors[4])
            head = "| | "


# ----------------------------------------------------------------------------------------------------
# The structures.


def plate(material: Material, t: float, fixed: Callable[[ShellMesh], set[int]], distort: float = 0.0) -> Make:
    """A square plate of side 1 that bends only."""

    def make(n: int, consistent: bool) -> Structure:
        mesh = shell_mesh(rectangle(1.0, 1.0), n, n, distort=distort, seed=n)
        held = dofs_of(np.arange(len(mesh.xyz)), "126") | fixed(mesh)
        part = ShellPart(mesh.cells, Section(material, t), direction=(1.0, 0.0, 0.0))
        return shell_structure(mesh.xyz, [part], held=held, consistent_mass=consistent)

    return make


def simply_supported(mesh: ShellMesh) -> set[int]:
    """Deflection, and the turn about the edge's normal."""
    x, y = (np.concatenate([mesh.edge(f"{letter}0"), mesh.edge(f"{letter}1")]) for letter in "uv")
    return dofs_of(x, "34") | dofs_of(y, "35")


def clamped(mesh: ShellMesh) -> set[int]:
    """All edges."""
    return dofs_of(mesh.rim, "345")


def at_corners(mesh: ShellMesh) -> set[int]:
    """Deflection of the four corners."""
    return dofs_of(mesh.rows[[0, 0, -1, -1], [0, -1, 0, -1]], "3")


def nowhere(mesh: ShellMesh) -> set[int]:
    """Nothing."""
    return set()


def orthotropic(E1: float, E2: float, nu: float, G: float, angles: tuple[float, ...] = (0.0,)) -> Anisotropic:
    """Equal parts of an orthotropic material at angles in degrees."""
    flexible = np.array([[1 / E1, -nu / E1, 0.0], [-nu / E1, 1 / E2, 0.0], [0.0, 0.0, 1 / G]])
    law = np.zeros((3, 3))
    for angle in np.radians(angles):
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]])
        law += turn.T @ np.linalg.inv(flexible) @ turn / len(angles)
    entries = {f"{i + 1}{j + 1}": float(law[i, j]) for i in range(3) for j in range(i, 3)}
    return Anisotropic(entries, {"11": G, "22": G}, 1600.0)


def curved_panel(distort: float = 0.0) -> Make:
    """A cylindrical panel of 60 degrees, radius 1, length 1, thickness 0.01, clamped."""

    def make(n: int, consistent: bool) -> Structure:
        mesh = shell_mesh(cylinder(1.0, 1.0, 0.0, np.pi / 3), n, n, distort=distort, seed=n)
        held = dofs_of(mesh.rim, "123456")
        return shell_structure(
            mesh.xyz, [ShellPart(mesh.cells, Section(STEEL, 0.01))], held=held, consistent_mass=consistent
        )

    return make


def box_beam(n: int, consistent: bool) -> Structure:
    """A cantilevered square tube, side 0.1, length 0.4, thickness 0.002: n elements a side, 4 n along."""

    def around(u: Reals, v: Reals) -> tuple[Reals, Reals, Reals]:
        s = 4.0 * u
        x, y = np.clip(s, 0, 1) - np.clip(s - 2, 0, 1), np.clip(s - 1, 0, 1) - np.clip(s - 3, 0, 1)
        return 0.1 * x, 0.1 * y, 0.4 * v

    mesh = shell_mesh(around, 4 * n, 4 * n, closed=True)
    held = dofs_of(mesh.edge("v0"), "123456")
    return shell_structure(
        mesh.xyz, [ShellPart(mesh.cells, Section(STEEL, 0.002))], held=held, consistent_mass=consistent
    )


PLY = (1.4e11, 1e10, 0.3, 5e9)
COUPLED = orthotropic(7e10, 7e10, 0.98, 2.7e10)
LAMINATE = orthotropic(*PLY, (45.0, -45.0))
CASES = (
    Case("plate, simply supported, L/t = 100", plate(STEEL, 0.01, simply_supported), 6.5, 5.5),
    Case("plate, simply supported, L/t = 10", plate(STEEL, 0.1, simply_supported), 9.0, 3.0),
    Case("plate, simply supported, L/t = 10,000", plate(STEEL, 1e-4, simply_supported), 6.5, 5.5),
    Case("the same, distorted mesh", plate(STEEL, 1e-4, simply_supported, 0.2), 6.5, 7.0),
    Case("plate, clamped, L/t = 100", plate(STEEL, 0.01, clamped), 3.0, 11.0),
    Case("plate, free, L/t = 100", plate(STEEL, 0.01, nowhere), 10.0, 3.0, rigid=3),
    Case("panel on its corners, isotropic", plate(STEEL, 0.01, at_corners), 5.5, 7.5),
    Case("panel on its corners, ±45 laminate", plate(LAMINATE, 0.01, at_corners), 6.5, 9.0),
    Case("panel on its corners, NU12 = 0.98", plate(COUPLED, 0.01, at_corners), 13.5, 16.0),
    Case("the same, distorted mesh", plate(COUPLED, 0.01, at_corners, 0.2), 13.5, 16.0),
    Case("curved panel, clamped", curved_panel(), 18.0, 52.0),
    Case("the same, distorted mesh", curved_panel(0.2), 18.0, 54.0),
    Case("box beam, clamped at one end", box_beam, 1.5, 4.0, most=24),
)

INTRODUCTION = """# Shells on coarse meshes

CQUAD4 with 2, 4, 8 and 16 elements a side: errors in per cent of the first four elastic modes (– where a mesh has
fewer) beside 64 elements (the box beam: 24), of which the mean of lumped and coupled mass is taken. Plates and panels
are squares of side 1 that bend only; the first mode has one half wave along each side, that of the free plate a node
line in the middle of each.
The laminate is a tape with E1 = 140, E2 = 10, G12 = 5 GPa. The curved panel has 60 degrees of a cylinder, and its first
modes several half waves. The box beam has n elements across each wall and 4 n along. On distorted meshes inner grid
points are moved at random by up to 20 % of a cell.
"""
CONCLUSION = """
With lumped mass, the default of Nastran, frequencies of bending converge mostly from below, with coupled mass from
above: on meshes with four elements a half wave the difference of the two masses is about 10 %, and larger than the
error of the stiffness. The stiffness of a square is that of commercial Nastran
([element matrices](09_element_matrices.md)), so that its errors are the same.
"""

if __name__ == "__main__":
    main()
