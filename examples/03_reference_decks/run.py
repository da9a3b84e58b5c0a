"""Compare decks with modes listed by commercial Nastran: python run.py [--quick] [--evidence DIR].

The decks are not part of this project. They are read from ../shared/data beside the checkout, or from
$FEMTUNE_SHARED_DATA; without them the example reports this and ends. Asserts 1 % for every listed mode.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # where structures/ lies

from femtune.fem import Structure
from femtune.files.nastran import build_structure, read_deck
from femtune.model import Configuration, configure, parametric_model, solve_modes
from femtune.parameters import ParameterSet
from structures.beams import SOLAR_ARRAY, solar_array
from structures.frames import dense_modes
from structures.goland_wing import LISTED_HZ, goland_wing

TOLERANCE_PERCENT = 1.0


@dataclass(frozen=True)
class Reference:
    """A deck, what it is made of, and the elastic modes that commercial Nastran lists (Hz)."""

    deck: str
    elements: str
    listed: tuple[float, ...]
    remark: str = ""


DECKS = (
    Reference(
        "beam_modes.dat", "CBAR, CBEAM, CONM2",
        (456.660, 456.660, 2674.588, 2674.588, 3554.923, 4507.487, 6626.104, 6626.104, 11111.59, 11111.59),
    ),
    Reference(
        "pt145.bdf", "CBAR, CMASS2, coupled mass",
        (39.961, 236.41, 250.44, 701.40, 703.42, 1153.1, 1375.4, 1574.4, 1956.9, 2277.2),
    ),
    Reference("satk.dat", "CBAR, CONM2", (89.5607, 89.5607, 1044.76)),
    Reference(
        "cbush.dat", "CBAR, CBUSH, CONM2", (63.8038, 63.8038, 750.561),
        "five more listed values are above the 2000 Hz requested in the deck: they are residual vectors, not modes",
    ),
    Reference("actuator_tf_modeling.bdf", "CELAS2, CONM2, MPC", (0.0795775, 0.275664)),
    Reference(
        "001_ten_bar_truss/modes.dat", "CROD, CMASS1, coupled mass",
        (8.9495, 26.957, 27.250, 49.931, 56.885, 62.997, 65.084, 77.128),
    ),
    Reference(
        "002_svanberg_beam/modes.dat", "CBEAM", (46.464, 146.93, 279.02, 752.99, 815.35, 882.35, 1405.5, 1507.3)
    ),
    Reference(
        "003_svanberg_bar/modes.dat", "CBAR", (46.464, 146.93, 279.02, 752.99, 815.35, 882.35, 1405.5, 2059.2)
    ),
    Reference(
        "004_72_bar_truss/modes.dat", "CROD, CONM2",
        (25.456, 25.456, 38.941, 68.555, 73.705, 73.705, 111.02, 127.62, 136.66, 136.66),
    ),
    Reference(
        "cantilever_bar_reduction/no_super/noReduction.dat", "CBAR", (349.73, 2167.3, 6007.8, 11650.0, 19045.0),
        "the full model",
    ),
    Reference(
        "plate_py.dat", "CQUAD4", (6333.01, 7495.47, 16238.5, 17161.5),
        "the difference is due to the element formulation: see the page on element matrices",
    ),
    Reference(
        "solid_shell_bar/mode_solid_shell_bar.bdf", "CHEXA, CPENTA, CTETRA, CQUAD4, CTRIA3, PCOMP, CBEAM, CBAR, CROD",
        (71.26832, 75.95746, 125.7872),
        "one element of each kind: with the commercial stiffness of shells and CPENTA all digits agree, see the "
        "page on element matrices",
    ),
)  # fmt: skip


TETRAHEDRA = np.array([87278.5, 91000.0, 102379.0, 266861.0, 283122.0, 343509.0, 489764.0])


def elastic_modes(path: Path, count: int) -> np.ndarray:
    """The lowest elastic natural frequencies of a deck as it stands."""
    found = _lowest(build_structure(read_deck(path)).structure, count + 6)
    return found[found > 1e-3 * found[-1]][:count]


def _lowest(structure: Structure, count: int) -> np.ndarray:
    model = parametric_model(structure, ParameterSet(()), ())
    return solve_modes(configure(model, Configuration()).at(np.zeros(0)), count).freq_hz


ELSEWHERE = """
Not in the table:

- `random_test_bar_plus_tri.bdf` (one CQUAD4, one CTRIA3, four CBAR): see the page on element matrices.
- `trunc_cyl_shell.nas`: a mesh of 2679 CTETRA whose PSOLID has no material, which is an error at that card.
- `bah_plane.bdf`: its three INCLUDE files are missing, which is an error that names them.
- The decks with reductions and superelements (Guyan, dynamic, Craig-Bampton): femtune solves the full model."""


def row(folder: Path, reference: Reference) -> str:
    """One line of the table; asserts the tolerance."""
    listed = np.array(reference.listed)
    found = elastic_modes(folder / reference.deck, len(listed))
    errors = 100.0 * (found / listed - 1.0)
    assert np.abs(errors).max() <= TOLERANCE_PERCENT, (reference.deck, errors)
    worst = int(np.argmax(np.abs(errors)))
    name = reference.deck.removesuffix("/modes.dat").removesuffix("/no_super/noReduction.dat")
    name = name.removeprefix("solid_shell_bar/")
    return (
        f"| {name} | {reference.elements} | {listed[0]:.6g} | {found[0]:.6g} | {errors[worst]:+.4f} "
        f"(mode {worst + 1} of {len(listed)}) | {reference.remark} |"
    )


def superelement() -> str:
    """All modes of a superelement of bars with coupled mass; asserts seven digits."""
    structure, held = solar_array()
    listed = np.array(SOLAR_ARRAY)
    error, textbook = (
        np.abs(dense_modes(s, held)[: len(listed)] / listed - 1.0)
        for s in (structure, replace(structure, lumped_along=0.0))
    )
    assert error.max() < 5e-7, error
    return (
        f"- `with_se.dat` (field_decks; CBAR, coupled mass), superelements 300 and 400 on their fixed interface: all "
        f"{len(listed)} modes,\n  {listed[0]:.6g} to {listed[-1]:.6g} Hz, differ by at most {error.max():.1e}. The "
        f"textbook's axial mass (1/3, 1/6) would be up to {100.0 * textbook.max():.0f} % off."
    )


def wing() -> str:
    """The Goland wing, whose deck is not among the others; asserts seven digits."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "wing.bdf"
        path.write_text(goland_wing())
        (first,) = elastic_modes(path, 1)
    error = first / LISTED_HZ - 1.0
    assert abs(error) < 3e-7, error
    return (
        "- `goland_final_test.bdf` of pyNastran (CQUAD4 without bending, CROD, CONM2), rebuilt by our own program: "
        f"{LISTED_HZ} Hz listed,\n  {first:.7g} computed ({error:+.1e}). Commercial Nastran lists no stiffness for the "
        "rotations: where all shells are membranes,\n  K6ROT has no effect; with it the frequency would be 3.4e-5 "
        "higher."
    )


def tetrahedra(folder: Path) -> str:
    """Two CTETRA with mid-side nodes: between ours with lumped and with consistent mass; asserts that they are."""
    structure = build_structure(read_deck(folder / "tet10.bdf")).structure
    lumped, consistent = (
        100.0 * (_lowest(replace(structure, consistent_mass=flag), len(TETRAHEDRA))[: len(TETRAHEDRA)] / TETRAHEDRA - 1)
        for flag in (False, True)
    )
    assert (lumped < 0.0).all(), lumped
    assert (consistent > 0.0).all(), consistent
    return (
        f"- `tet10.bdf` (two CTETRA with mid-side nodes, {TETRAHEDRA[0]:.6g} to {TETRAHEDRA[-1]:.6g} Hz): "
        f"differences of {lumped.min():+.1f} to {lumped.max():+.1f} % with\n  lumped mass, as requested in the deck, "
        f"and {consistent.min():+.1f} to {consistent.max():+.1f} % with consistent mass. Two elements cannot "
        "represent\n"
        "  a wave: their modes depend on the formulation of the mass. Listed static displacements are closer: see the "
        "theory of solids."
    )


def main() -> None:
    """Solve every deck and write the table where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the same as the full form, which takes seconds")
    parser.add_argument("--evidence", type=Path, help="folder for the table of the documentation")
    arguments = parser.parse_args()
    beside = Path(__file__).resolve().parents[3] / "shared" / "data"
    folder = Path(os.environ.get("FEMTUNE_SHARED_DATA", beside)) / "nastran_decks"
    if not folder.is_dir():
        print(f"skipped: the reference decks are not here ({folder})")
        return
    text = "\n".join(
        [
            "# Reference decks: listed and computed frequencies\n",
            "Lowest elastic mode, and largest difference over all modes listed by commercial Nastran.\n",
            "| deck | elements | listed Hz | computed Hz | largest difference % | remarks |",
            "|---|---|---|---|---|---|",
            *(row(folder, reference) for reference in DECKS),
            ELSEWHERE,
            superelement(),
            wing(),
            tetrahedra(folder),
        ]
    )
    print(text)
    if arguments.evidence:
        (arguments.evidence / "03_reference_decks.md").write_text(text + "\n")


if __name__ == "__main__":
    main()
