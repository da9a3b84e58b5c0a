"""Planning of a test: sensors, exciters, frequency lines, and what sensors and suspension change."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.planning.independence import (
        Candidates,
        ChosenSensors,
        Placed,
        eliminate,
        expand,
        information_of,
        log_det,
        set_independence,
    )
    from femtune.planning.outcome import SensorOutcome, outcome_of, rank_of
    from femtune.planning.redundancy import unlike
    from femtune.planning.wire_frame import farthest_points, mesh_distances, trace_lines
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "Candidates",
    "ChosenSensors",
    "Placed",
    "SensorOutcome",
    "eliminate",
    "expand",
    "farthest_points",
    "information_of",
    "log_det",
    "mesh_distances",
    "outcome_of",
    "rank_of",
    "set_independence",
    "trace_lines",
    "unlike",
]
