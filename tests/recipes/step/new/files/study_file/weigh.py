"""[weigh]: mass properties of each configuration."""

from __future__ import annotations

from femtune.files.study_file.kinds import Positive, TomlTable, Vector


class WeighTable(TomlTable):
    """[weigh]: mass properties of each configuration."""

    about: Vector = (0.0, 0.0, 0.0)
    """Point of reference of the moments of inertia, in the basic frame and the unit of length of the study. Example:
    `[0.0, 0.0, 1.5]`"""
    budget: Positive | None = None
    """Largest permitted mass, in the unit of mass of the study. Default: none. Example: `120.0`"""
