"""Records of responses: frequency response functions, complex modes, static displacements."""

from __future__ import annotations

from typing import Literal

from femtune.study.results_base import Alert, Record, Stage


class FrfPair(Record):
    """One function: what the model and the test have at their highest line, and how they compare."""

    output: str
    """DOF, or combination of DOFs, whose motion it is."""
    input: str
    """DOF, or combination of DOFs, that is driven."""
    driving_point: bool
    """True where both are the same motion."""
    peak_hz: float
    """Frequency of the model's largest magnitude, Hz."""
    peak: float
    """That magnitude, in units of the study."""
    test_peak_hz: float | None = None
    """Frequency of the measured function's largest magnitude within the model's lines; None where not measured."""
    test_peak: float | None = None
    """That magnitude."""
    frac: float | None = None
    """Frequency response assurance criterion over the lines that both have; None where these are fewer than two."""


class FrfResults(Record):
    """Frequency response functions of one configuration, convention e^{iωt}."""

    kind: Literal["receptance", "mobility", "accelerance"]
    """Motion over force: displacement, velocity or acceleration."""
    unit: str
    """Unit of translations over forces; empty where the units are not known."""
    method: Literal["real modes", "complex modes", "direct"]
    """How they were computed."""
    modes: int | None
    """Number of modes that are superposed or damped; None where the method needs none."""
    residual_vectors: bool
    """True where the static response to the inputs completes the modes."""
    damping: str
    """What damps, in words."""
    outputs: tuple[str, ...]
    """DOFs of the first axis of the values."""
    inputs: tuple[str, ...]
    """DOFs of the second axis."""
    freq_key: str
    """Key of the frequency lines, shape (lines,), Hz."""
    values_key: str
    """Key of the values, complex, shape (outputs, inputs, lines)."""
    test_freq_key: str | None = None
    """Key of the measured lines; None without measured functions."""
    test_values_key: str | None = None
    """Key of the measured values, in this kind, shape (outputs, inputs, measured lines); NaN where not measured."""
    pairs: tuple[FrfPair, ...]
    """Every function, input by input."""


class ComplexPole(Record):
    """A complex mode beside the real mode that it resembles most."""

    kind: Literal["rigid", "oscillating", "real"]
    """"real" is a motion without oscillation."""
    freq_hz: float
    """|λ|/2π, Hz."""
    damping_ratio: float | None
    """−Re λ/|λ|; None for rigid-body modes."""
    phase_collinearity: float
    """1 where all points move in phase or opposite phase (modal phase collinearity, weighed by the mass)."""
    real_mode: int
    """Number of the real mode, from 1."""
    real_freq_hz: float
    """Its natural frequency, Hz."""


class Displacement(Record):
    """Motion of one output under a load."""

    output: str
    """DOF, or combination of DOFs."""
    value: float
    """Displacement in units of length, rotation in rad."""


class StaticResults(Record):
    """Static displacements under one load case."""

    load: str
    """Name of the load."""
    forces: tuple[str, ...]
    """Forces in words: "12Z+ 100"."""
    inertia_relief: bool
    """True where the structure is free and the motion is the elastic one, relative to its rigid motion."""
    displacements: tuple[Displacement, ...]
    """Motion of the outputs."""


class ResponseResults(Record):
    """Responses of one configuration at one stage."""

    configuration: str
    """Name of the configuration."""
    stage: Stage
    """"before" or "after as written"."""
    frfs: FrfResults | None = None
    """Frequency responses; None where the study asks for none."""
    poles: tuple[ComplexPole, ...] = ()
    """Complex modes up to the highest line."""
    poles_reason: str = ""
    """Why there are no complex modes, in words."""
    loads: tuple[StaticResults, ...] = ()
    """Static load cases."""
    alerts: tuple[Alert, ...] = ()
    """What the reader should know."""
