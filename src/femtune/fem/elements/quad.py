"""The four-node shell: hybrid membrane, tied shear, drilling."""

from __future__ import annotations

import numpy as np

from femtune.fem.elements.quad_bending import bending_rows, shear_rows
from femtune.fem.elements.quad_membrane import drilling_rows, membrane_rows, uniaxial_rows
from femtune.fem.elements.quad_shape import GAUSS, quad_shape, quad_shares
from femtune.fem.elements.shell_placement import ShellPlane
from femtune.fem.elements.shell_strains import ShellFormulation, ShellStrains


def quad_strains(plane: ShellPlane) -> ShellStrains:
    """Strain rows of quadrilaterals."""
    shape = quad_shape(plane)
    uniaxial, along = uniaxial_rows(shape)
    roots = np.sqrt(np.stack([shape.jacobian(point) for point in GAUSS], axis=1))
    return ShellStrains(
        membrane_rows(shape), uniaxial, along, drilling_rows(shape), bending_rows(shape), shear_rows(shape), roots
    )


QUAD = ShellFormulation(2, quad_strains, quad_shares)
