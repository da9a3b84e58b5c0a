"""[plan]: target modes, candidates, and how many sensors are to be placed by which method."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal, get_args

from pydantic import Field, WithJsonSchema

from femtune.errors import FemtuneError
from femtune.files.study_file.kinds import (
    DofLabel,
    Elements,
    Fraction,
    Hertz,
    HertzAboveZero,
    NotNegative,
    Numbers,
    Seed,
    Spread,
    Text,
    TomlTable,
    read_by,
)
from femtune.files.study_file.parameter import RegionTable
from femtune.files.study_file.source import StudyLines, falls, number, table
from femtune.planning.kinds import Average, Criterion, PlacementMethod, Weighting
from femtune.residuals.kinds import FrfForm

Axis = Literal["X", "Y", "Z"]


def _directions(value: object) -> None:
    listed = isinstance(value, tuple) and value and all(value.count(d) == 1 and d in get_args(Axis) for d in value)
    if value != "normal" and not listed:
        raise FemtuneError("study.type/directions")


Directions = Annotated[
    Literal["normal"] | tuple[Axis, ...],
    read_by(_directions),
    WithJsonSchema({"anyOf": [{"const": "normal"}, {"type": "array", "items": {"enum": list(get_args(Axis))}}]}),
]
SensorCount = Annotated[int, Field(ge=0, le=10_000)]
Threshold = Annotated[float, Field(ge=0, lt=1)]


class SuspensionEntry(TomlTable):
    """[[plan.suspension]]: springs from grid points to a fixed frame."""

    nodes: Numbers
    """Grid points, each with one spring. Example: `[101, 205]`"""
    stiffness: tuple[NotNegative, NotNegative, NotNegative]
    """Stiffness of each spring along X, Y and Z of the basic system. Example: `[20.0, 20.0, 2000.0]`"""


class PlanTable(TomlTable):
    """[plan]: pretest planning."""

    configuration: Text | None = None
    """Name of the configuration that is tested. Default: the first one. Example: `"free"`"""
    modes: Numbers | None = None
    """Numbers of the target modes, as listed by `femtune modes`: text with THRU, BY and EXCEPT, or a list. Example: `"7
    THRU 20"`"""
    band_hz: tuple[Hertz, HertzAboveZero] | None = None
    """Target modes of a frequency band, Hz, instead of `modes`. Default, without both: all modes that are solved for.
    Example: `[5.0, 400.0]`"""
    rigid_body: bool = False
    """Rigid-body modes are target modes as well. Example: `true`"""
    triaxial: SensorCount = 0
    """Number of triaxial sensors to place. Example: `10`"""
    uniaxial: SensorCount = 0
    """Number of uniaxial sensors to place beside them. Default, if neither is given and no sensor is `placed`: twice
    the number of target modes. Example: `15`"""
    visualisation: SensorCount = 0
    """Number of additional uniaxial sensors, each at the candidate farthest from all sensors. Example: `6`"""
    placed: tuple[Text, ...] = ()
    """Sensors that are given: a grid point (triaxial), or a DOF in its displacement axes (uniaxial). Example: `["101",
    "205Z+"]`"""
    nodes: Numbers | None = None
    """Grid points that are candidates. Default: all points of shells, line elements, and of the surface of solids.
    Example: `"101 THRU 400"`"""
    elements: Elements | None = None
    """Only points of these elements are candidates. Example: `"1 THRU 900"`"""
    region: RegionTable | None = None
    """Only points of the elements of a region, with the keys of [`region`](#region) of a parameter. Example: `{
    properties = [1, 2] }`"""
    dof_set: Text | None = None
    """Only points of a set of the deck, as listed by `femtune info`. Example: `"ASET"`"""
    exclude: Numbers | None = None
    """Grid points that are not candidates. Example: `[17, 18]`"""
    directions: Directions = "normal"
    """Directions of uniaxial sensors: `"normal"`, the normal of the surface and, at points without a surface, X, Y and
    Z; or a list of basic axes. Example: `["X", "Z"]`"""
    method: PlacementMethod = "expansion"
    """`"expansion"`: sensors are added one by one; `"elimination"`: candidates are removed one by one. Example:
    `"elimination"`"""
    exchange: bool = True
    """After an expansion, sensors are exchanged for better candidates; `false`: the plain method. Example: `false`"""
    weighting: Weighting = "none"
    """`"kinetic-energy"`: shapes are weighted by the square root of the mass at the grid points. Example:
    `"kinetic-energy"`"""
    triaxial_threshold: Threshold = 0.05
    """Least part of the output of a triaxial candidate that no single placed sensor reproduces; 0 rejects no candidate.
    Example: `0.02`"""
    uniaxial_threshold: Threshold = 0.01
    """Least part of the output of a uniaxial candidate that no single placed sensor reproduces; 0 rejects no candidate.
    Example: `0.05`"""
    aim: Literal["modes", "parameters"] = "modes"
    """`"modes"`: sensors that make the target modes independent; `"parameters"`: sensors that determine the free
    parameters best. Example: `"parameters"`"""
    criterion: Criterion = "D"
    """For the parameters: `"D"` (determinant of the information) or `"A"` (sum of the variances relative to the prior).
    Example: `"A"`"""
    points: Annotated[int, Field(ge=1, le=1000)] = 1
    """Number of points of the parameters at which sensors for them are judged: the initial values, and points of a
    Latin hypercube within the bounds. Example: `5`"""
    average: Average = "mean"
    """`"mean"` or `"worst"` of the points. Example: `"worst"`"""
    seed: Seed = 0
    """Seed of the Latin hypercube. Example: `3`"""
    data: Literal["modes", "frfs"] = "modes"
    """What the calibration compares, for the expected standard deviations and `aim = "parameters"`: `"modes"`,
    frequencies and shapes, or `"frfs"`, accelerances between exciters and sensors. Example: `"frfs"`"""
    frequency_sd: Spread = 0.005
    """Expected relative standard deviation of a measured frequency. Example: `0.002`"""
    shape_sd: Spread = 0.02
    """Expected standard deviation of a measured shape entry, relative to the largest entry of the mode at all
    candidates. Example: `0.05`"""
    frf_sd: Spread | None = None
    """Expected standard deviation of real and imaginary part of a measured FRF, relative to its magnitude. Default:
    0.05, beside a stated `frf_floor` 0. Example: `0.02`"""
    frf_floor: Annotated[float, Field(ge=0, lt=1)] = 0.0
    """Expected noise floor: standard deviation of real and imaginary part, relative to the largest magnitude of each
    function. Example: `0.001`"""
    frf_form: FrfForm = "log-complex"
    """Form of the residual, as of a [`frf`](#frf) residual: `"linear"`, `"log-magnitude"` or `"log-complex"`. Example:
    `"linear"`"""
    frf_lines: Annotated[int, Field(ge=1, le=100_000)] | None = None
    """Number of the calibration lines that are chosen for the parameters. Default: all are compared. Example: `40`"""
    identification_lines: Annotated[int, Field(ge=4, le=2000)] | None = None
    """Number of frequency lines for an identification with stepped sines: those are chosen from which the poles of the
    target modes follow with the least variance, at `damping_ratio`. It needs exciters. Default: none are chosen.
    Example: `80`"""
    exciters: Annotated[int, Field(ge=0, le=100)] = 0
    """Number of exciters to place. Example: `2`"""
    exciters_placed: tuple[DofLabel, ...] = ()
    """Exciters that are given: DOFs in the displacement axes of the grid points. Example: `["101Z+"]`"""
    exciter_nodes: Numbers | None = None
    """Grid points that are candidates for exciters. Default: those of uniaxial sensors. Example: `"101 THRU 140"`"""
    exciter_level: Annotated[float, Field(ge=0, le=1)] = 0.1
    """Driving-point residue relative to that at the best candidate, below which a target mode counts as not excited.
    Example: `0.2`"""
    damping_ratio: Fraction = 0.01
    """Damping ratio of all modes, for frequency lines, mode indicator and FRFs. Example: `0.002`"""
    lines_per_half_band: Annotated[int, Field(ge=1, le=100)] = 3
    """Number of frequency lines per half bandwidth 2ξf. Example: `5`"""
    triaxial_mass: NotNegative = 0.0
    """Mass of a triaxial sensor. Example: `0.001`"""
    uniaxial_mass: NotNegative = 0.0
    """Mass of a uniaxial sensor. Example: `0.0005`"""
    suspension: tuple[SuspensionEntry, ...] = ()
    """Springs of a suspension, from grid points to a fixed frame. Example: `[{ nodes = [1, 9], stiffness = [20.0, 20.0,
    2000.0] }]`"""


# ----------------------------------------------------------------------------------------------------
# Rules between the keys of [plan].


def plan_rules(data: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """Modes are given by number or by band; a band must rise."""
    plan = table(data, "plan")
    if "modes" in plan and "band_hz" in plan:
        shown = {key: plan[key] for key in ("modes", "band_hz")}
        yield source.error(("plan", "band_hz"), "plan.target-modes", shown)
    if plan.get("aim") == "parameters" and plan.get("method") == "elimination":
        yield source.error(("plan", "method"), "plan.parameters", {"aim": "parameters", "method": "elimination"})
    silent = number(plan, "frf_sd") == 0.0 and not plan.get("frf_floor")
    for key in ("frequency_sd", "shape_sd", *["frf_sd"] * silent):
        if number(plan, key) == 0.0:
            yield source.error(("plan", key), "plan.parameters/standard-deviation", {key: 0.0}, key=key)
    if falls(plan.get("band_hz")):
        yield source.error(("plan", "band_hz"), "plan.target-modes/band", {"band_hz": plan["band_hz"]})
