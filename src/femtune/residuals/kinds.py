"""Kinds of residual that a study can request, and the forms that some of them have.

A further kind is its class in a module of this package, an entry of `RESIDUALS`, and its table in
`femtune.files.study_file.residual`.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

from femtune.kinds import Kind, Kinds

ResidualKind = Literal[
    "frequency", "complex-eigenvalue", "damping", "shape", "strain", "mac", "flexibility", "dynamic",
    "static-displacement", "static-force", "mass", "centre-of-gravity", "inertia", "frf", "antiresonance",
]  # fmt: skip
RESIDUALS = Kinds(
    ResidualKind,
    Kind("frequency", "frequency", function="femtune.residuals.frequency:FrequencyResidual"),
    Kind("complex-eigenvalue", "complex eigenvalue", function="femtune.residuals.poles:ComplexEigenvalueResidual"),
    Kind("damping", "damping ratio", function="femtune.residuals.poles:DampingResidual"),
    Kind("shape", "shape", function="femtune.residuals.shape:ShapeResidual"),
    Kind("strain", "strain", function="femtune.residuals.shape:StrainResidual"),
    Kind("mac", "MAC", function="femtune.residuals.mac:MacResidual"),
    Kind("flexibility", "flexibility", function="femtune.residuals.flexibility:FlexibilityResidual"),
    Kind("dynamic", "dynamic", function="femtune.residuals.dynamic:DynamicResidual"),
    Kind("static-displacement", "static displacement", function="femtune.residuals.static:DisplacementResidual"),
    Kind("static-force", "static force", function="femtune.residuals.static:ForceResidual"),
    Kind("mass", "mass", function="femtune.residuals.mass:MassResidual"),
    Kind("centre-of-gravity", "centre of gravity", function="femtune.residuals.mass:CentreResidual"),
    Kind("inertia", "inertia", function="femtune.residuals.mass:InertiaResidual"),
    Kind("frf", "frf", function="femtune.residuals.frf.asked:AskedFrfs"),
    Kind("antiresonance", "antiresonance", function="femtune.residuals.frf.asked:AskedAntiresonances"),
)
"""The class of each kind is built from a study by its `of_study`; `Residual.block` gives blocks the label."""

FrequencyForm = Literal["frequency", "eigenvalue"]
RELATIVE_TO_FREQUENCY: Mapping[FrequencyForm, float] = MappingProxyType({"frequency": 1.0, "eigenvalue": 2.0})
"""Relative error of what is compared over that of the frequency: λ = ω²."""

ShapeScaling = Literal["unit-norm", "largest-entry", "scale-factor", "mass"]
"""Scale in which model and test shape are compared, see `femtune.residuals.shape.scaled_difference`."""

MacForm = Literal["root", "ratio", "difference"]
"""(1 − √MAC)/√MAC, (1 − MAC)/MAC, or 1 − MAC."""

FrfForm = Literal["linear", "log-magnitude", "log-complex"]
FRF_FORMS = Kinds(
    FrfForm,
    Kind("linear", "differences of the values", function="femtune.residuals.frf.residual:LINEAR"),
    Kind("log-magnitude", "logarithms of the ratio of the magnitudes",
         function="femtune.residuals.frf.residual:LOG_MAGNITUDE"),
    Kind("log-complex", "logarithms of the complex ratio", function="femtune.residuals.frf.residual:LOG_COMPLEX"),
)  # fmt: skip
"""How model and measured FRFs are compared."""

FrfMethodWord = Literal["real modes", "complex modes", "direct"]
FRF_METHODS: Mapping[FrfMethodWord, Literal["direct", "real-modes", "complex-modes"]] = MappingProxyType(
    {"real modes": "real-modes", "complex modes": "complex-modes", "direct": "direct"}
)
"""Methods of `femtune.model.response.frf` by their words in a study."""

Scatter = Literal["stated", "estimated"]
"""Whether standard deviations are known, or relative weights whose common factor is estimated from the residuals."""
