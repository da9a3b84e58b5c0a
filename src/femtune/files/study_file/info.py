"""[checks]: checks of the model before the update."""

from __future__ import annotations

from femtune.files.study_file.kinds import Fraction, TomlTable


class ChecksTable(TomlTable):
    """[checks]: checks of the model before the update."""

    refinement: bool | None = None
    """Estimate the errors of the frequencies [due to the mesh](guide/info.md#errors-due-to-the-mesh): `true` up to
    300,000 DOFs of the refined model, `false` never. Default: up to 30,000. Example: `true`"""
    mesh_error: Fraction = 0.02
    """Largest frequency error due to the mesh, and difference between lumped and consistent mass; above 0, below 1.
    Example: `0.005`"""
    mass_error: Fraction = 0.02
    """Largest relative difference between the mass of the model and `weighed_mass`, and between its moments of inertia
    and `weighed_inertia`, and largest distance of its centre of gravity from `weighed_centre` over the radius of
    gyration; above 0, below 1. Example: `0.01`"""
