"""A planned test as records: target modes, sensors, and measures of their quality."""

from __future__ import annotations

from typing import Literal

from femtune.study.record import Alert, Record, Vector3

SensorKind = Literal["triaxial", "uniaxial", "visualisation"]


class TargetMode(Record):
    """A target mode of the plan."""

    number: int
    """Number of the mode of the model, from 1."""
    freq_hz: float
    """Frequency in Hz."""
    rigid_body: bool
    """True for a rigid-body motion."""
    auto_mac: float
    """Largest AutoMAC with another target mode at the sensors; 0 for a single mode."""
    alike_number: int | None
    """Number of that mode; None for a single mode."""
    auto_mac_candidates: float
    """Largest AutoMAC with another target mode at all candidates."""


class PlannedExciter(Record):
    """An exciter of the plan."""

    name: str
    """Name: "E1", "E2" …"""
    node: int
    """Number of the grid point."""
    dof: str
    """Degree of freedom of the test, along the axes of the exciter."""
    position: Vector3
    """Coordinates in the basic system, in the study's unit of length."""
    axes: tuple[Vector3, Vector3, Vector3]
    """Unit vectors of the local axes in the basic system, as for a sensor."""
    direction: Vector3
    """Direction of the force in the basic system."""
    given: bool
    """True for an exciter that the study places."""
    sensor: str | None
    """Name of the sensor at its grid point that measures its direction; None if there is none."""


class ModeExcitation(Record):
    """How a target mode is excited."""

    number: int
    """Number of the mode of the model, from 1."""
    exciter: str
    """Exciter that excites it most."""
    level: float
    """Driving-point residue of this exciter relative to that at the best candidate, from 0 to 1."""
    indicator: float
    """Multivariate mode indicator function of all exciters and sensors at the frequency of the mode: near 0 if the
    forces excite it as a normal mode."""


class PlannedLines(Record):
    """Frequency lines of the test."""

    low_hz: float
    """First frequency, Hz."""
    high_hz: float
    """Last frequency, Hz."""
    damping_ratio: float
    """Damping ratio for which the lines are chosen."""
    per_half_band: int
    """Least number of lines to a half bandwidth 2ξf."""
    calibration_lines: int
    """Number of logarithmically spaced lines for a calibration."""
    calibration_key: str
    """Key of these lines, Hz, shape (lines,)."""
    spacing_hz: float
    """Spacing of even lines for an identification, Hz."""
    duration_s: float
    """Length of a record with this resolution, s, without windows and averages."""
    decay_s: float
    """Time in which the lowest target mode decays to a thousandth, s."""
    identification_lines: int
    """Number of even lines between the two frequencies."""


class LinesForPoles(Record):
    """Frequency lines of one kind of spacing for an identification."""

    spacing: str
    """How they are spaced, in words."""
    rms_percent: float | None
    """Root mean square over the target modes of the standard deviation of a pole over its half bandwidth 2ζω, in %;
    None where some pole is not determined."""
    largest_percent: float | None
    """The largest one, in %."""
    lines_key: str
    """Key of the lines, Hz, shape (lines,)."""


class PlannedPoleLines(Record):
    """Lines of the same number for an identification, by their spacing; the last ones are those of least variance."""

    lines: int
    """Number of lines."""
    relative_sd: float
    """Assumed standard deviation of real and imaginary part, relative to the magnitude."""
    floor: float
    """The same, relative to the largest magnitude of each function."""
    spacings: tuple[LinesForPoles, ...]
    """All spacings."""


class LoadedMode(Record):
    """Effect of the masses of the sensors on a target mode."""

    number: int
    """Number of the mode of the model, from 1."""
    shift_percent: float
    """Change of its frequency by the masses, in %, from a solution of the loaded model."""
    rayleigh_percent: float
    """The same by the Rayleigh quotient of the mode of the model."""


class SuspensionResults(Record):
    """Effect of a soft suspension."""

    rigid_hz: tuple[float, ...]
    """Frequencies of the suspension, Hz: motions that are rigid-body modes without springs."""
    first_elastic_hz: float
    """Frequency of the first elastic mode on the suspension, Hz."""
    shift_percent: tuple[float, ...]
    """Change of the frequency of each elastic target mode by the springs, in %; 0 for a rigid-body mode."""


class ExpectedParameter(Record):
    """Standard deviation of a free parameter that an update with the planned test would have."""

    name: str
    """Name of the parameter."""
    unit: str
    """Its unit; "" for a factor."""
    nominal: float
    """Initial value."""
    prior_sd: float
    """Standard deviation of the prior."""
    expected_sd: float
    """Expected standard deviation with the prior, at the initial values."""
    worst_sd: float
    """The largest at the points within the bounds; that at the initial values if there are no others."""
    data_sd: float | None
    """Expected standard deviation from the data alone; None if they do not determine the parameter."""
    frequencies_sd: float | None
    """Expected standard deviation with the prior and the frequencies alone; None for a calibration with FRFs."""
    candidates_sd: float | None
    """Expected standard deviation if all candidates were measured; None if it was not computed."""


class PlannedFunctions(Record):
    """What is assumed of the FRFs of a calibration."""

    form: str
    """Form of the residual: "linear", "log-magnitude" or "log-complex"."""
    relative_sd: float
    """Standard deviation of real and imaginary part, relative to the magnitude."""
    floor: float
    """Standard deviation of the noise floor, relative to the largest magnitude of each function."""
    lines: int
    """Number of frequency lines that are compared."""
    lines_key: str | None
    """Key of the lines that were chosen, Hz, shape (lines,); None if all calibration lines are compared."""
    order: int | None
    """Order of the reduced model that the FRFs were computed with; None for the full model."""


class PlannedSensor(Record):
    """A sensor of the plan."""

    name: str
    """Name: "T1" for triaxial, "U1" for uniaxial, "V1" for visualisation sensors, in the order of their placement."""
    kind: SensorKind
    """"triaxial", "uniaxial" or "visualisation"."""
    node: int
    """Number of the grid point."""
    dofs: tuple[str, ...]
    """Degrees of freedom of the test, along the axes of the sensor."""
    position: Vector3
    """Coordinates in the basic system, in the study's unit of length."""
    axes: tuple[Vector3, Vector3, Vector3]
    """Unit vectors X, Y and Z of the sensor in the basic system; Z is the normal of the surface, where there is one."""
    direction: Vector3 | None
    """Measured direction of a uniaxial sensor in the basic system; None for a triaxial one."""
    given: bool
    """True for a sensor that the study places."""
    independence: float
    """Effective independence of the sensor in the final set: 1 − det(1 − ΦQ⁻¹Φᵀ), the part of the determinant of the
    information that is lost without it."""


class PlannedSet(Record):
    """What a set of sensors is worth for the target modes."""

    channels: int
    """Number of measured directions."""
    condition: float | None
    """Condition number σ_max/σ_min of the mass-normalised target modes; None where they are dependent."""
    log_det: float | None
    """Logarithm of the determinant of ΦᵀΦ; None where the target modes are dependent."""
    auto_mac: float
    """Largest AutoMAC of two target modes."""
    auto_mac_rms: float
    """Root mean square of the AutoMAC entries off the diagonal."""


class PlanResults(Record):
    """A planned test of one configuration."""

    configuration: str
    """Name of the configuration."""
    modes: tuple[TargetMode, ...]
    """Target modes."""
    rigid_left_out: int
    """Number of rigid-body modes that were asked for, and left out."""
    candidate_points: int
    """Number of grid points that are candidates."""
    candidate_directions: int
    """Number of uniaxial candidates."""
    still: int
    """Number of grid points that do not move in any target mode, left out."""
    method: str
    """"expansion" or "elimination"."""
    weighting: str
    """"none" or "kinetic-energy"."""
    triaxial_threshold: float
    """Least part of the output of a triaxial candidate that no placed sensor reproduces."""
    uniaxial_threshold: float
    """The same for a uniaxial candidate."""
    rejected: int
    """Number of candidates that were left out because they repeat the output of a placed sensor."""
    exchanges: int
    """Number of sensors that were exchanged for better ones after the placement."""
    sensors: tuple[PlannedSensor, ...]
    """Sensors, the visualisation sensors last."""
    chosen: PlannedSet
    """All sensors together."""
    all_candidates: PlannedSet
    """All candidate points with three directions, or their uniaxial directions if no triaxial sensor is placed."""
    lines: tuple[tuple[int, int], ...]
    """Trace lines between the grid points of sensors."""
    aim: str = "modes"
    """"modes", or "parameters" for sensors that determine the parameters best."""
    criterion: str | None = None
    """"D" or "A" for sensors for the parameters; None for others."""
    points: int = 1
    """Number of points of the parameters at which the sensors for the parameters are judged."""
    frequency_sd: float | None = None
    """Relative standard deviation of a frequency that is assumed; None if the study has no free parameters, or for a
    calibration with FRFs."""
    shape_sd: float | None = None
    """Standard deviation of a shape entry that is assumed, relative to the largest entry of the mode at all candidates;
    None as for `frequency_sd`."""
    functions: PlannedFunctions | None = None
    """What is assumed of the FRFs; None for a calibration with modes, or without free parameters."""
    log_det_parameters: float | None = None
    """log det(1 + F) with the information F of the sensors on the parameters, per prior standard deviation, at the
    initial values; None if the study has no free parameters."""
    parameters: tuple[ExpectedParameter, ...] = ()
    """Expected standard deviations of the free parameters."""
    exciters: tuple[PlannedExciter, ...] = ()
    """Exciters."""
    excitation: tuple[ModeExcitation, ...] = ()
    """How the target modes are excited; empty without exciters."""
    frequency_lines: PlannedLines | None = None
    """Frequency lines; None if all target modes are rigid-body motions."""
    pole_lines: PlannedPoleLines | None = None
    """Lines of a given number for an identification; None if the study has no `identification_lines`."""
    sensor_mass: float = 0.0
    """Mass of all sensors, in the study's unit of mass."""
    loading: tuple[LoadedMode, ...] = ()
    """Effect of the masses of the sensors; empty without masses."""
    suspension: SuspensionResults | None = None
    """Effect of the suspension; None without one."""
    auto_mac_key: str
    """Key of the AutoMAC of the target modes at the sensors, shape (modes, modes)."""
    alerts: tuple[Alert, ...] = ()
    """What should be known about the plan."""
