"""Compare shells with quadratic elements of CalculiX on the same meshes: python run.py [--quick] [--evidence DIR].

CalculiX (`ccx`) is searched for on the path, or taken from $FEMTUNE_CALCULIX; without it the example reports this and
ends. Asserts 0.75 % for the first ten modes of each structure on its finest mesh. The quick form uses a coarser finest
mesh for the box beam and the bracket, and asserts 2 % there.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # where structures/ lies

import calculix
import numpy as np
from meshes import Mesh, box_beam, bracket, stiffened_panel
from nastran import deck_text
from numpy.typing import NDArray

import femtune as ft

MODES = 10
FINEST_PERCENT, COARSE_PERCENT = 0.75, 2.0
"""Of the stiffened panel up to 0.52 % remain when its two finest meshes are extrapolated with order 2: a difference of
the two programs' models (CalculiX joins shells that meet at an angle rigidly), which no mesh removes."""


@dataclass(frozen=True)
class Structure:
    """A structure, the fineness of its meshes, and how many of them the quick form solves."""

    name: str
    make: Callable[[int], tuple[Mesh, list[int]]]
    fineness: tuple[int, ...]
    quick: int


STRUCTURES = (
    Structure("stiffened panel", stiffened_panel, (1, 2, 4), 2),
    Structure("box beam", box_beam, (2, 3, 4, 6), 2),
    Structure("bracket", bracket, (2, 3, 4, 6), 2),
)


def both(program: str, mesh: Mesh, clamped: list[int], folder: Path) -> tuple[NDArray, NDArray]:
    """Natural frequencies of the two programs, Hz."""
    deck = folder / "structure.bdf"
    deck.write_text(deck_text(mesh, clamped, MODES))
    (ours,) = ft.modes(deck)
    return np.array(ours.freq_hz[:MODES]), calculix.solve(program, mesh, clamped, MODES, folder, "structure")


def rows(program: str, structure: Structure, quick: bool) -> list[str]:
    """Largest differences by mesh; asserts the tolerance on the last."""
    out = []
    meshes = structure.fineness[: structure.quick] if quick else structure.fineness
    for n in meshes:
        mesh, clamped = structure.make(n)
        with tempfile.TemporaryDirectory() as folder:
            ours, theirs = both(program, mesh, clamped, Path(folder))
        errors = 100.0 * (ours / theirs - 1.0)
        worst = int(np.argmax(np.abs(errors)))
        size = f"{len(mesh.quads)} | {ours[0]:.3f} | {theirs[0]:.3f}"
        out.append(
            f"| {structure.name} | {size} | {errors[worst]:+.3f} (mode {worst + 1}) | {np.abs(errors).mean():.3f} |"
        )
    allowed = FINEST_PERCENT if meshes == structure.fineness else COARSE_PERCENT
    assert np.abs(errors).max() <= allowed, (structure.name, errors)
    return out


def main() -> None:
    """Every structure on its meshes, and the table where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="without the finest meshes")
    parser.add_argument("--evidence", type=Path, help="folder for the table of the documentation")
    arguments = parser.parse_args()
    program = os.environ.get("FEMTUNE_CALCULIX") or shutil.which("ccx")
    if program is None:
        print("skipped: CalculiX (ccx) is not here")
        return
    text = "\n".join(
        [
            "# Shells: comparison with CalculiX\n",
            "First ten modes of three structures: four-node shells of femtune and eight-node shells of CalculiX "
            "2.20 (which it expands to solids) on the same structured meshes of quadrilaterals.\n",
            "| structure | elements | first mode, Hz | CalculiX, Hz | largest difference % | mean % |",
            "|---|---|---|---|---|---|",
            *(line for structure in STRUCTURES for line in rows(program, structure, arguments.quick)),
        ]
    )
    print(text)
    if arguments.evidence:
        (arguments.evidence / "06_shells_beside_calculix.md").write_text(text + "\n")


if __name__ == "__main__":
    main()
