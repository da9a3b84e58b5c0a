"""The four-node shell: hybrid membrane, tied shear, drilling."""

from __future__ import annotations

from femtune.fem.elements.quad_bending import bending_rows, shear_rows
from femtune.fem.elements.quad_membrane import drilling_rows, membrane_rows, uniaxial_rows
from femtune.fem.elements.quad_shape import quad_shape, quad_shares
from femtune.fem.elements.shell_placement import ShellPlane
from femtune.fem.elements.shell_strains import ShellFormulation, ShellStrains


def quad_strains(plane: ShellPlane) -> ShellStrains:
    """Strain rows of quadrilaterals."""
    shape = quad_shape(plane)
    uniaxial, along = uniaxial_rows(shape)
    return ShellStrains(
        membrane_rows(shape), uniaxial, along, drilling_rows(shape), bending_rows(shape), shear_rows(shape)
    )


QUAD = ShellFormulation(2, quad_strains, quad_shares)
