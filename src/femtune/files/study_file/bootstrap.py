"""[bootstrap]: spread of the parameters from measured FRFs."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from femtune.files.study_file.kinds import Seed, TomlTable
from femtune.identification.kinds import Drawing
from femtune.uncertainty.kinds import Jacobian


class BootstrapTable(TomlTable):
    """[bootstrap]: spread of the parameters from the FRFs of one test, by drawing frequency lines again."""

    method: Drawing = "lines"
    """What is drawn: frequency `"lines"` with all their FRFs, single values (`"entries"`), or `"noise"` of the stated
    standard deviations, which is also possible for modes and other data. Example: `"noise"`"""
    runs: Annotated[int, Field(ge=10, le=1_000_000)] = 1000
    """Number of runs; increasing it keeps the runs that were made. Example: `200`"""
    seed: Seed = 0
    """Seed of the random numbers. Example: `7`"""
    jacobian: Jacobian = "shared"
    """Derivatives of the steps: those at the result of the update (`"shared"`), which need no further derivatives, or
    those of each point (`"own"`). Example: `"own"`"""
    tolerance: Annotated[float, Field(gt=0, le=1)] = 0.01
    """A run ends if a step is smaller than this, in standard deviations of the parameters. Example: `0.001`"""
    checked: Annotated[int, Field(ge=0, le=1000)] = 5
    """Number of runs that are repeated with `"own"` derivatives, to state the largest difference. Example: `20`"""
