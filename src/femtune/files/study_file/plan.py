"""[plan]: target modes, candidates, and how many sensors are to be placed by which method."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal, get_args

from pydantic import Field

from femtune.errors import FemtuneError
from femtune.files.study_file.kinds import (
    DofLabel,
    Elements,
    NotNegative,
    Numbers,
    Spread,
    Text,
    TomlTable,
    read_by,
)
from femtune.files.study_file.parameter import RegionTable
from femtune.files.study_file.response import Hertz, HertzAboveZero
from femtune.files.study_file.source import StudyLines, falls, number, table
from femtune.planning.kinds import Average, Criterion, PlacementMethod, Weighting
from femtune.residuals.kinds import FrfForm

Axis = Literal["X", "Y", "Z"]


def _directions(value: object) -> None:
    listed = isinstance(value, tuple) and value and all(value.count(d) == 1 and d in get_args(Axis) for d in value)
    if value != "normal" and not listed:
        raise FemtuneError("study.type/directions")


Directions = Annotated[Literal["normal"] | tuple[Axis, ...], read_by(_directions)]
SensorCount = Annotated[int, Field(ge=0, le=10_000)]
Threshold = Annotated[float, Field(ge=0, lt=1)]


class SuspensionEntry(TomlTable):
    """[[plan.suspension]]: springs from grid points to a fixed frame."""

    nodes: Numbers
    stiffness: tuple[NotNegative, NotNegative, NotNegative]


class PlanTable(TomlTable):
    """[plan]: pretest planning."""

    configuration: Text | None = None
    modes: Numbers | None = None
    band_hz: tuple[Hertz, HertzAboveZero] | None = None
    rigid_body: bool = False
    triaxial: SensorCount = 0
    uniaxial: SensorCount = 0
    visualisation: SensorCount = 0
    placed: tuple[Text, ...] = ()
    nodes: Numbers | None = None
    elements: Elements | None = None
    region: RegionTable | None = None
    dof_set: Text | None = None
    exclude: Numbers | None = None
    directions: Directions = "normal"
    method: PlacementMethod = "expansion"
    exchange: bool = True
    weighting: Weighting = "none"
    triaxial_threshold: Threshold = 0.05
    uniaxial_threshold: Threshold = 0.01
    aim: Literal["modes", "parameters"] = "modes"
    criterion: Criterion = "D"
    points: Annotated[int, Field(ge=1, le=1000)] = 1
    average: Average = "mean"
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    data: Literal["modes", "frfs"] = "modes"
    frequency_sd: Spread = 0.005
    shape_sd: Spread = 0.02
    frf_sd: Spread | None = None
    frf_floor: Annotated[float, Field(ge=0, lt=1)] = 0.0
    frf_form: FrfForm = "log-complex"
    frf_lines: Annotated[int, Field(ge=1, le=100_000)] | None = None
    exciters: Annotated[int, Field(ge=0, le=100)] = 0
    exciters_placed: tuple[DofLabel, ...] = ()
    exciter_nodes: Numbers | None = None
    exciter_level: Annotated[float, Field(ge=0, le=1)] = 0.1
    damping_ratio: Annotated[float, Field(gt=0, lt=1)] = 0.01
    lines_per_half_band: Annotated[int, Field(ge=1, le=100)] = 3
    triaxial_mass: NotNegative = 0.0
    uniaxial_mass: NotNegative = 0.0
    suspension: tuple[SuspensionEntry, ...] = ()


# ----------------------------------------------------------------------------------------------------
# Rules between the keys of [plan].


def plan_rules(data: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """Modes by number or by band, and a band that is one."""
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
