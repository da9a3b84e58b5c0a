"""A crooked arm of three bars against an open Nastran-compatible solver: offsets, I12, shear, pins, RBE2, MPC, inertia.

The numbers are those of MYSTRAN 18 (EIGR with MGIV, whose eigenvalues come out lower by exactly 1 (rad/s)²; that is put
right here). The grid point 5 carries the mass; an offset CONM2 is not used, because that solver gives other frequencies
for it than for the same mass on a rigid arm.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from femtune.fem.structure import Structure, join_constraints
from femtune.files.nastran import read_deck
from femtune.files.nastran.build import build_structure
from structures.frames import dense_modes

DECK = """SOL 103
CEND
SPC = 1
MPC = 4
BEGIN BULK
GRID,1,,0.,0.,0.,,123456
GRID,2,,1.,0.1,0.2
GRID,3,,1.8,0.7,0.1
GRID,4,,2.5,1.2,0.9
GRID,5,,2.6,1.9,0.3
MAT1,1,2.1+11,,.3,7850.
PBAR,1,1,2.-3,3.-6,1.-6,2.-6,{nsm}
,,,,,,,,
,{shear}
PBAR,2,1,2.-3,3.-6,1.-6,2.-6
,,,,,,,,
,,,{skew}
CBAR,1,1,1,2,0.,0.,1.
{first}CBAR,2,1,2,3,0.1,0.2,1.
{second}CBAR,3,2,3,4,0.,0.3,1.
RBE2,9,4,123456,5
CONM2,11,5,,25.
,.3,.02,.4,.01,.03,.5
CONM2,12,3,,5.
,.03,,.04,,,.05
MPC,4,3,2,1.,2,2,-.5
SPC1,1,123456,1
ENDDATA
"""
PLAIN = {"nsm": "0.4", "shear": "", "skew": "", "first": "", "second": ""}
OFFSETS = ",,,0.02,0.05,-.03,.01,-.04,.06\n"
CASES = {
    "plain": (
        PLAIN,
        [4.53584, 8.40826, 17.30961, 30.52042, 40.93628, 58.49666, 93.83113, 271.78837, 435.68703, 598.38430],
    ),
    "shear": (
        PLAIN | {"shear": ".85,.6"},
        [4.53463, 8.40076, 17.29910, 30.44404, 40.72288, 58.21384, 92.81399, 271.74130, 435.62272, 596.04049],
    ),
    "shear and I12": (
        PLAIN | {"shear": ".85,.6", "skew": "8.-7"},
        [4.57877, 7.92937, 17.22096, 32.24858, 41.84451, 57.80049, 96.45887, 231.85800, 435.99282, 565.15831],
    ),
    "offsets, shear and I12": (
        PLAIN | {"shear": ".85,.6", "skew": "8.-7", "second": OFFSETS},
        [4.57873, 7.97114, 17.45243, 32.75882, 43.71179, 59.62185, 107.93835, 232.78509, 365.62023, 418.61372],
    ),
    "offsets and I12": (
        PLAIN | {"nsm": "0.", "skew": "8.-7", "second": OFFSETS},
        [4.58142, 7.97889, 17.48696, 32.91487, 44.12017, 60.36067, 110.22542, 232.96419, 369.73691, 421.68633],
    ),
    "a released bending DOF and shear": (
        PLAIN | {"shear": ".85,.6", "second": ",5\n"},
        [4.47684, 8.32071, 16.53533, 21.90810, 35.98235, 51.31892, 91.54267, 271.72671, 435.04202, 574.75412],
    ),
    "offsets, releases at both ends and shear": (
        PLAIN | {"shear": ".85,.6", "second": ",5,6,0.02,0.05,-.03,.01,-.04,.06\n"},
        [7.40297, 13.86131, 17.22165, 22.73096, 42.75321, 90.61007, 265.05382, 285.23257, 420.85533, 640.66440],
    ),
}


def solve(structure: Structure) -> np.ndarray:
    held = {*structure.permanent.tolist(), *structure.support_sets[1].tolist()}
    rows = join_constraints([structure.rigid, structure.multipoint_sets[4]])
    return dense_modes(structure, held, rows)


@pytest.mark.parametrize("name", CASES)
def test_same_frequencies(name: str, tmp_path: Path):
    fields, listed = CASES[name]
    path = tmp_path / "arm.bdf"
    path.write_text(DECK.format(**fields))
    found = solve(build_structure(read_deck(path)).structure)
    # the arm with releases at both ends has one motion without stiffness
    found = found[found > 1e-3 * found[2]]
    np.testing.assert_allclose(found[: len(listed)], listed, rtol=2e-6)
