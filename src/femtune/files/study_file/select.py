"""[select]: additional measures for the selection of parameters."""

from __future__ import annotations

from typing import Literal

from femtune.files.study_file.kinds import Fraction, TomlTable


class SelectTable(TomlTable):
    """[select]: additional measures for the selection of parameters."""

    energies: Literal["none", "parameters", "properties", "elements"] = "none"
    """Strain and kinetic energy of the compared modes by group of elements: `"parameters"` (the elements of each
    parameter), `"properties"` (of each property card), `"elements"`. Example: `"properties"`"""
    localise: bool = False
    """Each test mode is expanded to all DOFs of the model, and the energy of the remaining residual is shown by the
    same groups. Example: `true`"""
    noise: Fraction = 0.01
    """Largest relative difference between the expanded and the measured shape; above 0, below 1. Example: `0.03`"""
    smoothness: bool = False
    """The residuals are computed along each parameter between its bounds, and parameters along which their sum of
    squares is not smooth are named. Example: `true`"""
    missing: bool = False
    """A first update is made, and fields of the deck that are no parameters, masses that it lacks and supports are
    tested where it ends: which of them would explain what the parameters cannot. Up to 10,000 free DOFs.
    Example: `true`"""
