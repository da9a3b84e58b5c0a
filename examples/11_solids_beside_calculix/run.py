"""Compare solids with CalculiX on the same meshes: python run.py [--quick] [--evidence DIR].

CalculiX (`ccx`) is searched for on the path, or taken from $FEMTUNE_CALCULIX; without it the example reports this and
ends. Elements with mid-side nodes are compared with those of CalculiX on each mesh; all four shapes, with and without
mid-side nodes, are compared with its hexahedra on the finest mesh. Asserts 0.5 % for the first ten modes of each
structure on its finest mesh. The quick form ends at the middle mesh and asserts 4 %.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # where structures/ lies

import calculix
import numpy as np
from bodies import SOLIDS, Solid
from numpy.typing import NDArray

from structures.shells import Isotropic, dofs_of, natural_frequencies
from structures.solids import SolidMesh, solid_mesh, solid_model

MODES = 10
FINEST_PERCENT, COARSE_PERCENT = 0.5, 4.0
MATERIAL = Isotropic(calculix.YOUNG, calculix.POISSON, calculix.DENSITY)


def ours(mesh: SolidMesh, clamped: str) -> NDArray:
    """Natural frequencies of femtune, Hz."""
    held = dofs_of(mesh.face(clamped), "123")
    return natural_frequencies(solid_model(mesh, MATERIAL, held=held, consistent_mass=True), MODES)[:MODES]


def theirs(program: str, mesh: SolidMesh, clamped: str) -> NDArray:
    """Natural frequencies of CalculiX, Hz."""
    with tempfile.TemporaryDirectory() as folder:
        return calculix.solve(program, mesh, clamped, MODES, Path(folder))


def differences(found: NDArray, wanted: NDArray) -> tuple[NDArray, str]:
    """Differences in percent, and the largest and the mean in words."""
    errors = 100.0 * (found / wanted - 1.0)
    worst = int(np.argmax(np.abs(errors)))
    return errors, f"{errors[worst]:+.3f} (mode {worst + 1}) | {np.abs(errors).mean():.3f}"


def beside(program: str, solid: Solid, quick: bool) -> list[str]:
    """Same element, same mesh; asserts the tolerance on the last mesh of each kind."""
    out = []
    for kind in calculix.TYPES:
        for counts in solid.second[:-1] if quick else solid.second:
            mesh = solid_mesh(solid.place, counts, kind)
            found, wanted = ours(mesh, solid.clamped), theirs(program, mesh, solid.clamped)
            errors, words = differences(found, wanted)
            out.append(f"| {solid.name} | {kind} | {len(mesh.cells)} | {found[0]:.3f} | {wanted[0]:.3f} | {words} |")
        assert np.abs(errors).max() <= (COARSE_PERCENT if quick else FINEST_PERCENT), (solid.name, kind, errors)
    return out


def towards(program: str, solid: Solid, quick: bool) -> list[str]:
    """All kinds towards the hexahedra of CalculiX on the finest mesh; asserts that finer is nearer."""
    finest = solid.second[-2 if quick else -1]
    wanted = theirs(program, solid_mesh(solid.place, finest, "hexa20"), solid.clamped)
    out = []
    for kind in ("hexa8", "penta6", "hexa20", "penta15", "tetra10", "pyram13"):
        meshes = solid.first if kind in ("hexa8", "penta6") else solid.second
        means = []
        for counts in meshes[:-1] if quick else meshes:
            mesh = solid_mesh(solid.place, counts, kind)
            errors, words = differences(ours(mesh, solid.clamped), wanted)
            means.append(np.abs(errors).mean())
            out.append(f"| {solid.name} | {kind} | {len(mesh.cells)} | {3 * len(mesh.xyz)} | {words} |")
        assert means[-1] < means[0], (solid.name, kind, means)
    return out


def text(program: str, quick: bool) -> str:
    """Both tables."""
    return "\n".join(
        [
            "# Solids: comparison with CalculiX\n",
            "First ten modes of three clamped steel structures (a block 200 × 120 × 80 mm, a tapered quarter ring "
            "with radii 50 and 80 mm, 120 degrees of a cylinder with a radius of 150 mm and a wall thickness of 10 "
            "mm): solids of femtune and of CalculiX, both with consistent mass.\n",
            "## Element by element\n",
            "The same element on the same mesh: C3D20, C3D15 and C3D10 of CalculiX. Its hexahedra use full "
            "integration for all strains; those of femtune use the linear part of the volumetric strain and are "
            "softer on coarse meshes. Its pentahedra have 9 integration points, those of femtune 18.\n",
            "| structure | element | elements | first mode, Hz | CalculiX, Hz | largest difference % | mean % |",
            "|---|---|---|---|---|---|---|",
            *(line for solid in SOLIDS for line in beside(program, solid, quick)),
            "\n## All elements compared with one reference\n",
            "Elements of femtune compared with C3D20 of CalculiX on the finest of the meshes above.\n",
            "| structure | element | elements | degrees of freedom | largest difference % | mean % |",
            "|---|---|---|---|---|---|",
            *(line for solid in SOLIDS for line in towards(program, solid, quick)),
        ]
    )


def main() -> None:
    """Every structure on its meshes, and the tables where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="without the finest meshes")
    parser.add_argument("--evidence", type=Path, help="folder for the tables of the documentation")
    arguments = parser.parse_args()
    program = os.environ.get("FEMTUNE_CALCULIX") or shutil.which("ccx")
    if program is None:
        print("skipped: CalculiX (ccx) is not here")
        return
    tables = text(program, arguments.quick)
    print(tables)
    if arguments.evidence:
        (arguments.evidence / "11_solids_beside_calculix.md").write_text(tables + "\n")


if __name__ == "__main__":
    main()
