"""Compare element matrices and small decks with commercial Nastran: python run.py [--quick] [--evidence DIR].

The decks and the matrices are not part of this project. They are read from ../shared/data beside the checkout, or from
$FEMTUNE_SHARED_DATA; without them the example reports this and ends. Asserts that bars, beams, rods and all masses
agree to the written digits, and that the matrices explain every difference of the one-element deck.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from changed_decks import MODES_DECK, PLATE_DECK, SHEET_DECK, SOLID_DECK, refined, split_plate
from commercial import Plate, bending_stiffness, drilling_stiffness
from numpy.typing import NDArray
from op2 import ElementMatrix, element_matrices
from ours import (
    BENDING,
    MEMBRANE,
    difference,
    dofs_of,
    frequencies,
    on_shells,
    our_matrices,
    part,
    shell_axes,
)
from wing import wing_deck

from femtune.fem.assemble import assemble
from femtune.fem.structure import Structure
from femtune.files.nastran import build_structure, read_deck
from femtune.model import Configuration, configure, parametric_model, solve_modes
from femtune.model.drilling import drilling_modes
from femtune.parameters import ParameterSet

Reals = NDArray[np.float64]

LISTED = np.array([46.014, 47.388, 147.61, 309.85, 441.41, 1334.9, 1793.5])
RIGID = 3
SHELLS = ("CQUAD4", "CTRIA3")
STEEL = Plate(2.9e7, 0.32, 1.1e7, 0.25)
SHEET = Plate(2e6, 0.33, 2e6 / 2.66, 0.1)
KINDS_LISTED = np.array([71.26832, 75.95746, 125.7872])
PLATE_LISTED = np.array([6333.01, 7495.47, 16238.5, 17161.5])

THICKNESS = {**dict.fromkeys(range(6, 12), 0.25), 16: 1.0, 17: 1.5, 18: 1.0, 19: 1.0, 20: 1.5, 21: 1.5}
"""Of all shells by element number; those above 15 are composite, of one material."""

SAME = "to rounding"
ROTARY = (
    "mass: this version gives a CBEAM a rotary inertia of ρ I L/2 at each end; the versions that list the modes of "
    "002_svanberg_beam and beam_modes do not (with it they would be up to 22 % lower), and femtune follows these"
)
REMARKS = {
    ("CBEAM", "mass"): ROTARY,
    ("CPENTA", "stiffness"): (
        "stiffness: constant strains have the same energy; the commercial element interpolates the transverse shear "
        "from the sides of the triangle, which depends on the first corner and does not pass the patch test"
    ),
    ("CTRIA3", "stiffness"): "stiffness: transverse shear: see below",
}


def main() -> None:
    """Compare and write the tables where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="coarser meshes of the one-element deck")
    parser.add_argument("--evidence", type=Path, help="folder for the tables of the documentation")
    arguments = parser.parse_args()
    beside = Path(__file__).resolve().parents[3] / "shared" / "data"
    source = Path(os.environ.get("FEMTUNE_SHARED_DATA", beside)) / "nastran_decks"
    if not source.is_dir():
        print(f"skipped: the reference decks are not here ({source})")
        return
    with tempfile.TemporaryDirectory() as folder:
        meshes = (1, 2, 4) if arguments.quick else (1, 2, 4, 8, 16)
        lines = [
            *matrices(source / "solid_shell_bar"),
            *every_kind(source / "solid_shell_bar"),
            *sheet(source, Path(folder), meshes),
            *plate(source, Path(folder)),
            *ribs(Path(folder)),
        ]
    text = "\n".join(["# Element matrices: comparison with commercial Nastran\n", *lines, ""])
    print(text)
    if arguments.evidence:
        (arguments.evidence / "09_element_matrices.md").write_text(text)


def matrices(source: Path) -> Iterator[str]:
    """Every element of the deck of all elements, and what the shells' matrices are made of."""
    file = source / SOLID_DECK.replace(".bdf", ".op2")
    structure = build_structure(read_deck(source / SOLID_DECK)).structure
    yield (
        f"`{SOLID_DECK}` with its KELM and MELM: the norm of the difference relative to the norm of the commercial "
        "matrix.\n"
    )
    yield "| elements | stiffness | mass | remark |"
    yield "|---|---|---|---|"
    yield from compared(structure, *(element_matrices(file, kind) for kind in "KM"))
    yield ""
    yield from shells(structure, element_matrices(file, "K"))


def compared(
    structure: Structure, stiffness: dict[int, ElementMatrix], mass: dict[int, ElementMatrix]
) -> Iterator[str]:
    """A line for each card; asserts agreement to digits of all that has no reason to differ."""
    ours = {kind: our_matrices(structure, kind) for kind in ("stiffness", "mass")}
    for card in dict.fromkeys(m.card for m in ours["stiffness"].values()):
        numbers = [n for n, m in ours["stiffness"].items() if m.card == card]
        shown, remarks = [], []
        for kind, theirs in (("stiffness", stiffness), ("mass", mass)):
            worst = max(difference(theirs[n], ours[kind][n]) for n in numbers)
            if (card, kind) in REMARKS:
                remarks.append(REMARKS[card, kind])
            else:
                assert worst < 1e-14, (card, kind, worst)
            shown.append(f"{worst:.2e}")
        yield f"| {card} {', '.join(map(str, numbers))} | {' | '.join(shown)} | {'; '.join(remarks) or SAME} |"


def shells(structure: Structure, theirs: dict[int, ElementMatrix]) -> Iterator[str]:
    """Eigenvalues of a CQUAD4 and a CTRIA3 that are not zero, and how far the formulas of `commercial` are theirs."""
    ours = our_matrices(structure, "stiffness")
    yield EIGENVALUES
    yield "| | commercial | ours |"
    yield "|---|---|---|"
    for number in (6, 8):
        name = f"{ours[number].card} {number}"
        for label, components in (("membrane and drilling", MEMBRANE), ("bending and transverse shear", BENDING)):
            a, b = (
                np.linalg.eigvalsh(part(m, shell_axes(corner_points(structure, theirs[number]))[1], components))[3:]
                for m in (theirs[number].matrix, ours[number].on(dofs_of(theirs[number])))
            )
            yield f"| {name}, {label} | {numbers(a)} | {numbers(b)} |"
    yield REASONS.format(rebuilt=rebuilt(structure, theirs))


def corner_points(structure: Structure, matrix: ElementMatrix) -> Reals:
    """Places of an element's grid points."""
    return np.asarray(structure.nodes.xyz[[row // 6 for row in matrix.rows]])


def rebuilt(structure: Structure, theirs: dict[int, ElementMatrix]) -> str:
    """How far bending, transverse shear and drilling by formula are from the commercial matrices, all shells."""
    worst = 0.0
    for number, thickness in THICKNESS.items():
        corners, axes = shell_axes(corner_points(structure, theirs[number]))
        plate = replace(STEEL, thickness=thickness)
        bending, in_plane = (part(theirs[number].matrix, axes, c) for c in (BENDING, MEMBRANE))
        turning = drilling_stiffness(100.0, plate, corners)[2::3]
        errors = [bending_stiffness(plate, corners) - bending, turning - in_plane[2::3]]
        worst = max(worst, *(np.linalg.norm(e) / np.linalg.norm(k) for e, k in zip(errors, (bending, turning))))
    assert worst < 1e-12, worst
    return f"{worst:.0e}"


EIGENVALUES = """\
Eigenvalues of the stiffness of a square (CQUAD4 6) and of half a square (CTRIA3 8), sides 1, thickness 0.25, less the
three rigid ones of each part, which are zero to rounding in both programs:
"""

REASONS = """
Differences, determined by decomposing the commercial matrices (`commercial.py` has the formulas; they reproduce the
bending and the drilling of all twelve shells of the file, including PCOMP of one material, thickness 0.25, 1 and 1.5,
within {rebuilt}):

- **Membrane**: none. Both squares have the in-plane bending of the hybrid element; constant strains are the same.
- **In-plane shear modulus**: none. The card has E, NU and a G that is 0.14 % too large for them. The matrices show
  E/2(1+ν) for in-plane shear and twisting, and G for transverse shear only; femtune does the same.
- **Constant curvature**: none.
- **Drilling**: none. Both have a spring 1e-6 K6ROT G t at each corner, for the rotation relative to the displacements
  there. All sides at right angles are 1 here; for the stiffness not to depend on the unit of length the spring must be
  proportional to an area, which is 1 for the square and its half alike: that of the parallelogram of the two sides.
- **Transverse shear of the square**: none. Both have MacNeal's residual bending flexibility, h²/12D in addition to
  1/κGt, and h²/480D for the shear that alternates from side to side.
- **Bending that varies across the square**: none. Both have uniaxial stress, E t³/36.
- **Transverse shear of the half**: both have residual bending flexibility for the three side shears; the commercial
  element has 1/3 of 1/D on the legs and 5/6 on the long side, femtune a mean over the sides.

The last difference decreases with the square of the element size.
"""


def numbers(values: Reals) -> str:
    """Eigenvalues with five digits."""
    return " ".join(f"{v:.5g}" for v in values)


def every_kind(source: Path) -> Iterator[str]:
    """The same elements with supports: listed modes, ours, and ours with commercial stiffness matrices."""
    structure = build_structure(read_deck(source / MODES_DECK)).structure
    theirs = element_matrices(source / SOLID_DECK.replace(".bdf", ".op2"), "K")
    yield f"## An element of each kind\n\n`{MODES_DECK}`, the same elements clamped at one end: modes in Hz.\n"
    yield "| | mode 1 | mode 2 | mode 3 |\n|---|---|---|---|"
    yield line("listed", KINDS_LISTED)
    stiffness = {"ours": assemble(structure, "stiffness").toarray()}
    for label, cards in (("shells", SHELLS), ("CPENTA", ("CPENTA",)), ("shells and CPENTA", (*SHELLS, "CPENTA"))):
        stiffness[f"with the commercial {label}"] = with_commercial(structure, theirs, cards)
    for label, matrix in stiffness.items():
        errors = frequencies(structure, matrix, 0, len(KINDS_LISTED)) / KINDS_LISTED - 1.0
        yield line(f"{label}, % from listed", 100.0 * errors)
    assert np.abs(errors).max() < 1e-6, errors
    yield KINDS_CONCLUSION


def with_commercial(structure: Structure, theirs: dict[int, ElementMatrix], cards: tuple[str, ...]) -> Reals:
    """Our stiffness, the matrices of some cards' elements exchanged."""
    out: Reals = assemble(structure, "stiffness").toarray()
    for number, matrix in our_matrices(structure, "stiffness").items():
        if matrix.card in cards:
            at = dofs_of(theirs[number])
            out[np.ix_(at, at)] += theirs[number].matrix - matrix.on(at)
    return out


KINDS_CONCLUSION = """
With the commercial stiffness of shells and CPENTA instead of ours all listed digits are reproduced: laminates,
masses, solids, bars and constraints are the same. (Without rotary inertia of the CBEAM: with that of its written
mass matrix mode 3 would be 0.001 % lower than listed.) Our triangles and CPENTA are softer than the commercial ones.
"""


def sheet(source: Path, folder: Path, meshes: tuple[int, ...]) -> Iterator[str]:
    """The deck of one square, one triangle and four bars: listed, ours, ours with commercial matrices, refined."""
    structure = build_structure(read_deck(source / SHEET_DECK)).structure
    yield f"## One square, one triangle, four bars\n\n`{SHEET_DECK}`: elastic modes in Hz; three rigid ones are zero.\n"
    yield "| | " + " | ".join(f"mode {k + 1}" for k in range(len(LISTED))) + " |"
    yield "|---" * (1 + len(LISTED)) + "|"
    yield line("listed", LISTED)
    found = {}
    for label, stiffness in exchanges(structure):
        found[label] = frequencies(structure, stiffness, RIGID, len(LISTED))
        yield line(f"{label}, % from listed", 100.0 * (found[label] / LISTED - 1.0))
    assert np.abs(found["both"] / LISTED - 1.0).max() < 2e-5, found
    for n in meshes:
        yield line(
            f"refined: {n} element{'s' if n > 1 else ''} a unit of length",
            elastic(refined(source, folder, n), RIGID, 7),
        )
    yield CONCLUSION


def plate(source: Path, folder: Path) -> Iterator[str]:
    """A free plate of squares: listed modes, ours, and the same plate with more."""
    structure = build_structure(read_deck(source / PLATE_DECK)).structure
    (batch,) = structure.batches
    yield f"## A plate of squares\n\n`{PLATE_DECK}`: {len(batch)} squares, free; elastic modes in Hz.\n"
    yield "| | " + " | ".join(f"mode {k + 1}" for k in range(len(PLATE_LISTED))) + " |"
    yield "|---" * (1 + len(PLATE_LISTED)) + "|"
    yield line("listed", PLATE_LISTED)
    stiffness = assemble(structure, "stiffness").toarray()
    own = frequencies(structure, stiffness, 6, len(PLATE_LISTED)) / PLATE_LISTED - 1.0
    assert np.abs(own).max() < 5e-6, own
    yield line("ours, % from listed", 100.0 * own)
    for n in (2, 4):
        finer = elastic(split_plate(source, folder, structure.nodes.xyz, batch.nodes, n), 6, len(PLATE_LISTED))
        yield line(f"ours, every square split into {n} × {n}, % from listed", 100.0 * (finer / PLATE_LISTED - 1.0))
    yield PLATE_CONCLUSION


def ribs(folder: Path) -> Iterator[str]:
    """A spar whose ribs are held by drilling: modes by K6ROT, and the share of their strain energy."""
    yield RIBS
    yield "| K6ROT | " + " | ".join(f"mode {k + 1}" for k in range(RIB_MODES)) + " |"
    yield "|---" * (1 + RIB_MODES) + "|"
    found = {}
    for k6rot in (10.0, 100.0, 1000.0):
        path = folder / f"wing_{k6rot:g}.bdf"
        path.write_text(wing_deck(k6rot))
        structure = build_structure(read_deck(path)).structure
        model = parametric_model(structure, ParameterSet(()), ())
        solution = solve_modes(configure(model, Configuration(support_set=1)).at(np.zeros(0)), RIB_MODES)
        shares = {mode.number: mode.share for mode in drilling_modes(solution)}
        found[k6rot] = solution.freq_hz
        cells = (
            f"{f:.2f}" + (f" ({100.0 * shares[k]:.0f} %)" if k in shares else "")
            for k, f in enumerate(solution.freq_hz, 1)
        )
        yield f"| {k6rot:g} | {' | '.join(cells)} |"
    extra = (found[10.0] < 35.0).sum() - (found[100.0] < 35.0).sum()
    assert extra == 1, found
    assert found[100.0][4] > 1.1 * found[10.0][4], found
    yield RIBS_CONCLUSION


def exchanges(structure: Structure) -> Iterator[tuple[str, Reals]]:
    """Our stiffness, and ours with parts of commercial element matrices in their place."""
    ours = assemble(structure, "stiffness").toarray()

    def bending(corners: Reals, own: Reals) -> Reals:
        return bending_stiffness(SHEET, corners) - own

    square, half = (on_shells(structure, card, BENDING, bending) for card in SHELLS)
    yield "ours", ours
    yield "with the commercial square's bending and shear", ours + square
    yield "with the commercial triangle's bending and shear", ours + half
    yield "both", ours + square + half


def elastic(path: Path, rigid: int, count: int) -> Reals:
    """The lowest elastic natural frequencies of a deck as it stands."""
    model = parametric_model(build_structure(read_deck(path)).structure, ParameterSet(()), ())
    found = solve_modes(configure(model, Configuration()).at(np.zeros(0)), rigid + count).freq_hz
    return np.asarray(found[rigid:])


def line(label: str, values: Reals) -> str:
    """A row of the table."""
    return f"| {label} | " + " | ".join(f"{v:.6g}" if abs(v) > 20.0 else f"{v:+.4f}" for v in values) + " |"


CONCLUSION = """
With bending and transverse shear of the two commercial elements instead of ours, all listed digits are
reproduced: masses, membranes, drilling, bars and everything else are the same. Modes 1 and 4 are in-plane modes, for
which a row of bars is connected to the rotation of the sheet by drilling stiffness only; the others are bending modes,
and depend on how one element represents a varying curvature. Using one element with its mass lumped at its corners
causes a much larger error: the results for refined meshes differ by up to 60 % from the single elements of either
program.
"""

RIB_MODES = 12
RIBS = """
## Ribs held by drilling

A deck of our own (`wing.py`): the upright web of a spar, bars to both sides of it with masses at their ends, and a mass
on a rigid tip. The rotation of bars and tip about the normal of the web is held by its drilling stiffness alone. Modes
in Hz; in brackets the share of drilling in the strain energy, if it is above 2 %, as `femtune modes` reports it.
"""

RIBS_CONCLUSION = """
The modes in which the ribs rotate (5 and 7) follow K6ROT, the others do not: a tenth of the drilling stiffness lowers
them by 14 and 9 %, and one mode more is among the others (10), which with K6ROT 100 lies above them. The integral over
the element instead of springs at the corners is 4 to 36 times softer, and would have such an effect; mass and offsets
of the bars are the same here."""

PLATE_CONCLUSION = """
All listed digits are reproduced. With finer meshes the frequencies increase and converge: lumped mass makes those of
this mesh too low, in both programs."""


if __name__ == "__main__":
    main()
