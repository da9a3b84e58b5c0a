"""Responses as records: frequency response functions, complex modes, static displacements."""

from __future__ import annotations

from typing import Literal

from femtune.modal.kinds import FrfKind
from femtune.model.kinds import FrfMethodWord
from femtune.steps.modes.record import ModeShapes
from femtune.study.record import Alert, ModelVersion, Record


class FrfPair(Record):
    """One function: largest values of model and test, and their correlation."""

    output: str
    """Response DOF, or combination of DOFs."""
    input: str
    """Reference DOF, or combination of DOFs."""
    driving_point: bool
    """True if response and reference are identical (driving point)."""
    peak_hz: float
    """Frequency of the model's largest magnitude, Hz."""
    peak: float
    """That magnitude, in units of the study."""
    test_peak_hz: float | None = None
    """Frequency of the measured function's largest magnitude within the model's lines; None if not measured."""
    test_peak: float | None = None
    """That magnitude."""
    frac: float | None = None
    """Frequency response assurance criterion over the lines that both have; None for fewer than two."""


class FdacResults(Record):
    """FDAC of the functions that share one input, or one output where a single response was measured."""

    axis: Literal["input", "output"]
    """What the functions share."""
    dof: str
    """This input or output."""
    functions: int
    """Number of measured functions that are compared."""
    mean: float | None
    """Mean FDAC at equal frequencies, 0 to 1; None if fewer than half of the measured lines are in the range of the
    model."""
    shift_percent: float | None
    """(model − test)/test of the frequencies at which the deflection shapes agree best, one ratio for all lines, in %;
    None if it was not found."""
    mean_shifted: float | None
    """Mean FDAC with this shift."""
    values_key: str
    """Key of the FDAC, shape (measured lines, model lines); NaN where it is not defined."""
    test_freq_key: str
    """Key of the measured lines, Hz."""
    model_freq_key: str
    """Key of the model lines, Hz."""


class FrfResults(Record):
    """Frequency response functions of one configuration, convention e^{iωt}."""

    kind: FrfKind
    """Motion over force: displacement, velocity or acceleration."""
    unit: str
    """Unit of translations over forces; empty where the units are not known."""
    method: FrfMethodWord
    """How they were computed."""
    modes: int | None
    """Number of modes that are superposed or damped; None if the method needs none."""
    residual_vectors: bool
    """True if residual vectors (static responses to the inputs, and further ones) are added to the modes."""
    truncation_error: float | None = None
    """Largest error by the truncated set of modes at some lines, relative to the value, or to 1 % of the largest value
    of the function where this is larger; 0 with the direct method, None if it is not known."""
    damping: str
    """The damping, in words."""
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
    identified_freq_key: str | None = None
    """Key of the measured lines around the identified modes of the test; None if it has no modes with damping."""
    identified_values_key: str | None = None
    """Key of the FRFs of these modes, shape (outputs, inputs, these lines); residues fitted to the measured values."""
    pairs: tuple[FrfPair, ...]
    """Every function, input by input."""
    fdac: tuple[FdacResults, ...] = ()
    """Frequency domain assurance criterion; empty if no input or output has two measured functions."""


class ComplexPole(Record):
    """A complex mode and the most similar real mode."""

    kind: Literal["rigid", "oscillating", "real"]
    """"real" is a motion without oscillation."""
    freq_hz: float
    """|λ|/2π, Hz."""
    damping_ratio: float | None
    """−Re λ/|λ|; None for rigid-body modes."""
    phase_collinearity: float
    """1 where all points move in phase or opposite phase (modal phase collinearity, weighted by the mass)."""
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
    """True for an unconstrained structure with inertia relief: the displacements exclude rigid-body motion."""
    displacements: tuple[Displacement, ...]
    """Motion of the outputs."""


class ResponseResults(Record):
    """Responses of one configuration at one model version."""

    configuration: str
    """Name of the configuration."""
    stage: ModelVersion
    """"before" or "after as written"."""
    frfs: FrfResults | None = None
    """Frequency responses; None if none are requested."""
    poles: tuple[ComplexPole, ...] = ()
    """Complex modes up to the highest line."""
    poles_reason: str = ""
    """The reason why there are no complex modes."""
    pole_shapes: ModeShapes | None = None
    """Shapes of the complex modes for drawing, modes as in `poles`, without a test; None without complex modes, and in
    older results."""
    loads: tuple[StaticResults, ...] = ()
    """Static load cases."""
    alerts: tuple[Alert, ...] = ()
    """Alerts."""
