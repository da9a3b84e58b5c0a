"""A simulated laboratory: shaker and ambient tests of structures whose modes are known."""

from femtune.testing.laboratory.bench import (
    OVERSAMPLING,
    Clock,
    simulated_test,
    stepped_sine,
    with_sensor_masses,
)
from femtune.testing.laboratory.braced_building import BracedBuilding, braced_building
from femtune.testing.laboratory.chain import MeasuringChain, record
from femtune.testing.laboratory.excitation import burst_random, chirp, multisine, narrow_line, white_noise
from femtune.testing.laboratory.plant import Plant, accelerance, accelerations
from femtune.testing.laboratory.plants import on_shaking_ground, plant_of_matrices, plant_of_model

__all__ = [
    "OVERSAMPLING",
    "BracedBuilding",
    "Clock",
    "MeasuringChain",
    "Plant",
    "accelerance",
    "accelerations",
    "braced_building",
    "burst_random",
    "chirp",
    "multisine",
    "narrow_line",
    "on_shaking_ground",
    "plant_of_matrices",
    "plant_of_model",
    "record",
    "simulated_test",
    "stepped_sine",
    "white_noise",
    "with_sensor_masses",
]
