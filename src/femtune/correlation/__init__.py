"""Test against model: sensors on nodes, modes in pairs, and how well they agree."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.correlation.correlation import Correlation, correlate, paired_shapes
    from femtune.correlation.expansion import (
        ExpandedShapes,
        dynamic_expansion,
        expand_shapes,
        minimum_residual,
        serep,
    )
    from femtune.correlation.generalised import GeneralisedSensor, rigid_motion_sensor
    from femtune.correlation.mode_damping import paired_damping
    from femtune.correlation.noise import NoiseShare
    from femtune.correlation.pairing import ClusterMatch, Pair, Pairing, Unpaired, no_pairs, pair_modes
    from femtune.correlation.placement import SensorPlacement, sensor_placement
    from femtune.correlation.reduced_mass import NotTested, ReducedMass, reduce_mass
    from femtune.correlation.sensor_map import Match, SensorMap, Unmatched, map_sensors
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "ClusterMatch",
    "Correlation",
    "ExpandedShapes",
    "GeneralisedSensor",
    "Match",
    "NoiseShare",
    "NotTested",
    "Pair",
    "Pairing",
    "ReducedMass",
    "SensorMap",
    "SensorPlacement",
    "Unmatched",
    "Unpaired",
    "correlate",
    "dynamic_expansion",
    "expand_shapes",
    "map_sensors",
    "minimum_residual",
    "no_pairs",
    "pair_modes",
    "paired_damping",
    "paired_shapes",
    "reduce_mass",
    "rigid_motion_sensor",
    "sensor_placement",
    "serep",
]
