"""[correlate]: pairing of modes, and expansion of test shapes."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from femtune.correlation.kinds import ExpansionMethod
from femtune.files.study_file.kinds import Fraction, NotNegative, TomlTable


class CorrelateTable(TomlTable):
    """[correlate]: criteria for mode pairing and for close modes, and the expansion of test shapes to the model."""

    frequency_gate: Annotated[float, Field(gt=0, le=1)] = 0.30
    """Frequency limit: modes are paired only if their relative frequency difference is below it; a fraction, at most 1.
    Example: `0.15`"""
    mac_gate: Annotated[float, Field(ge=0, le=1)] = 0.50
    """MAC limit: modes are paired only if their MAC is above it, 0 to 1. Example: `0.8`"""
    cluster_gap: NotNegative = 0.01
    """Modes whose relative frequency difference is smaller are compared as one subspace. Example: `0.02`"""
    expand: Literal["none", ExpansionMethod] = "none"
    """[Expansion](theory/correlation.md#expansion-of-test-shapes) of the test shapes to all grid points of the model:
    `"serep"`, `"dynamic"` or `"mdre"`. `femtune run` writes the shapes to `expanded.uff`. Example: `"dynamic"`"""
    expand_modes: Annotated[int, Field(ge=1, le=100_000)] | None = None
    """Number of the lowest model modes that SEREP uses. Default: the paired modes. Example: `12`"""
    expand_noise: Fraction = 0.01
    """Relative misfit at the sensors that the minimum dynamic residual expansion (`"mdre"`) allows, above 0 and below
    1. Example: `0.03`"""
