"""Test against model: sensors on nodes, modes in pairs, and how well they agree."""

from femtune.correlate.correlation import Correlation, correlate, paired_shapes
from femtune.correlate.generalised import GeneralisedSensor, rigid_motion_sensor
from femtune.correlate.noise import NoiseShare
from femtune.correlate.pairing import ClusterMatch, Pair, Pairing, Unpaired, pair_modes
from femtune.correlate.reasons import no_pairs
from femtune.correlate.reduced_mass import NotTested, ReducedMass, reduce_mass
from femtune.correlate.sensor_map import Match, SensorMap, Unmatched, map_sensors

__all__ = [
    "ClusterMatch",
    "Correlation",
    "GeneralisedSensor",
    "Match",
    "NoiseShare",
    "NotTested",
    "Pair",
    "Pairing",
    "ReducedMass",
    "SensorMap",
    "Unmatched",
    "Unpaired",
    "correlate",
    "map_sensors",
    "no_pairs",
    "pair_modes",
    "paired_shapes",
    "reduce_mass",
    "rigid_motion_sensor",
]
