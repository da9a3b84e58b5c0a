"""The three-node shell: constant strains, tied shear with residual bending flexibility, drilling."""

from __future__ import annotations

import numpy as np

from femtune.fem.elements.shell_placement import ShellPlane
from femtune.fem.elements.shell_strains import IN_PLANE, Reals, ShellFormulation, ShellStrains, placed
from femtune.fem.elements.tri_bending import bending_rows, shear_rows
from femtune.fem.elements.tri_membrane import drilling_rows, mean_square_side, membrane_rows, tri_area, tri_shares

# h²/15D of shear flexibility stands for the bending that linear rotations cannot show; MacNeal's beam has h²/12D.
# Chosen by measurement: docs/theory/shell-triangles.md
RESIDUAL = 12.0 / 15.0


def tri_strains(plane: ShellPlane) -> ShellStrains:
    """Strain rows of flat triangles."""
    corners, normals = plane.corners, plane.normals
    return ShellStrains(
        placed(membrane_rows(corners), IN_PLANE),
        np.zeros((len(corners), 0, 3, 6)),
        np.zeros((len(corners), 0, 2)),
        drilling_rows(corners, normals),
        bending_rows(corners, normals),
        shear_rows(corners, normals),
        np.sqrt(tri_area(corners))[:, None],
    )


def tri_residual(xyz: Reals) -> Reals:
    """(e,) 12h²/15 of triangles with corners `xyz` (e, 3, 3); h² is the mean of the squared sides, in classes.

    The classes are the largest h² divided by powers of √2, so that triangles of one size share one coefficient; their
    limits are where no h² of a regular refinement falls.
    """
    squares = mean_square_side(xyz)
    largest = squares.max(initial=0.0)
    steps = np.floor(2.0 * np.log2(largest / squares) + 0.37)
    return np.asarray(RESIDUAL * largest * 2.0 ** (-0.5 * steps))


TRI = ShellFormulation(0, tri_strains, tri_shares, tri_residual)
