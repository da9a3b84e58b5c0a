"""Planning of a test: sensors, exciters, frequency lines, and what sensors and suspension change."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.planning.calibration import (
        CalibrationObjective,
        CalibrationPoint,
        ClusterShapes,
        SumObjective,
        combined,
        data_sd,
        expected_sd,
        joined_information,
        score,
    )
    from femtune.planning.exciters import driving_point_levels, mode_indicator, place_exciters
    from femtune.planning.independence import (
        Candidates,
        ChosenSensors,
        Objective,
        Placed,
        best_of,
        eliminate,
        expand,
        information_of,
        log_det,
        set_independence,
    )
    from femtune.planning.lines import RecordLength, calibration_lines, record_length
    from femtune.planning.lines_for_poles import PoleLines, PoleTest, by_half_bandwidths, pole_lines
    from femtune.planning.loading import Suspended, rayleigh_with_masses, suspended
    from femtune.planning.outcome import SensorOutcome, outcome_of, rank_of
    from femtune.planning.redundancy import unlike
    from femtune.planning.wire_frame import farthest_points, mesh_distances, trace_lines
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "CalibrationObjective",
    "CalibrationPoint",
    "Candidates",
    "ChosenSensors",
    "ClusterShapes",
    "Objective",
    "Placed",
    "PoleLines",
    "PoleTest",
    "RecordLength",
    "SensorOutcome",
    "SumObjective",
    "Suspended",
    "best_of",
    "by_half_bandwidths",
    "calibration_lines",
    "combined",
    "data_sd",
    "driving_point_levels",
    "eliminate",
    "expand",
    "expected_sd",
    "farthest_points",
    "information_of",
    "joined_information",
    "log_det",
    "mesh_distances",
    "mode_indicator",
    "outcome_of",
    "place_exciters",
    "pole_lines",
    "rank_of",
    "rayleigh_with_masses",
    "record_length",
    "score",
    "set_independence",
    "suspended",
    "trace_lines",
    "unlike",
]
