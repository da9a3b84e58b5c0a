"""Shells beside CalculiX with quadratic elements on the same meshes: python run.py [--quick] [--evidence DIR].

CalculiX (`ccx`) is looked for on the path, or taken from $FEMTUNE_CALCULIX; without it the example says so and ends.
Asserts .5 % on the first ten modes of each structure on its finest mesh.
"""

from __future__ import annotations

import argparse
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

import calculix
import numpy as np
from meshes import Mesh, box_beam, bracket, stiffened_panel
from nastran import deck_text
from numpy.typing import NDArray

from femtune import steps

MODES, TOLERANCE_PERCENT = 10, 0.5
STRUCTURES: tuple[tuple[str, Callable[[int], tuple[Mesh, list[int]]]], ...] = (
    ("stiffened panel", stiffened_panel),
    ("box beam", box_beam),
    ("bracket", bracket),
)


def both(program: str, mesh: Mesh, clamped: list[int], folder: Path) -> tuple[NDArray, NDArray]:
    """Natural frequencies of the two programs, Hz."""
    deck = folder / "structure.bdf"
    deck.write_text(deck_text(mesh, clamped, MODES))
    (ours,) = steps.modes(deck)
    return np.array(ours.freq_hz[:MODES]), calculix.solve(program, mesh, clamped, MODES, folder, "structure")


def rows(program: str, name: str, make: Callable[[int], tuple[Mesh, list[int]]], fineness: list[int]) -> list[str]:
    """Largest differences by mesh, and the modes of the finest; asserts the tolerance there."""
    out = []
    for n in fineness:
        mesh, clamped = make(n)
        with tempfile.TemporaryDirectory() as folder:
            ours, theirs = both(program, mesh, clamped, Path(folder))
        errors = 100.0 * (ours / theirs - 1.0)
        worst = int(np.argmax(np.abs(errors)))
        size = f"{len(mesh.quads)} | {ours[0]:.3f} | {theirs[0]:.3f}"
        out.append(f"| {name} | {size} | {errors[worst]:+.3f} (mode {worst + 1}) | {np.abs(errors).mean():.3f} |")
    assert np.abs(errors).max() <= TOLERANCE_PERCENT, (name, errors)
    return out


def main() -> None:
    """Every structure on its meshes, and the table where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the finest meshes are left out")
    parser.add_argument("--evidence", type=Path, help="folder for the table that the documentation shows")
    arguments = parser.parse_args()
    program = os.environ.get("FEMTUNE_CALCULIX") or shutil.which("ccx")
    if program is None:
        print("skipped: CalculiX (ccx) is not here")
        return
    fineness = [1, 2, 3] if arguments.quick else [1, 2, 3, 4, 6]
    text = "\n".join(
        [
            "# Shells beside another program\n",
            "First ten modes of three structures: four-node shells of femtune and eight-node shells of CalculiX 2.20 "
            "(which it expands into solids) on the same structured quadrilaterals.\n",
            "| structure | elements | first mode, Hz | CalculiX, Hz | largest difference % | mean % |",
            "|---|---|---|---|---|---|",
            *(line for name, make in STRUCTURES for line in rows(program, name, make, fineness)),
        ]
    )
    print(text)
    if arguments.evidence:
        (arguments.evidence / "06_shells_beside_calculix.md").write_text(text + "\n")


if __name__ == "__main__":
    main()
