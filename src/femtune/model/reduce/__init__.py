"""Reduced-order models: the term list on a trained basis, and named reductions on master DOFs."""

from femtune.model.reduce.condensation import dynamic, guyan, irs, serep
from femtune.model.reduce.craig_bampton import Component, Coupled, couple, craig_bampton
from femtune.model.reduce.estimate import ErrorEstimate, Estimator, certified_error
from femtune.model.reduce.masters import Reduction, deck_masters
from femtune.model.reduce.reduced_model import ReducedModel, ReducedPoint, reduce_model
from femtune.model.reduce.reduced_modes import ReducedModes, reduced_derivative, reduced_modes
from femtune.model.reduce.saved import SavedBasis
from femtune.model.reduce.sensor_model import SensorModel, sensor_model
from femtune.model.reduce.trained import Certified, Trained, TrainingRules, TrainingStatus
from femtune.model.reduce.training import Trainer

__all__ = [
    "Certified",
    "Component",
    "Coupled",
    "ErrorEstimate",
    "Estimator",
    "ReducedModel",
    "ReducedModes",
    "ReducedPoint",
    "Reduction",
    "SavedBasis",
    "SensorModel",
    "Trained",
    "Trainer",
    "TrainingRules",
    "TrainingStatus",
    "certified_error",
    "couple",
    "craig_bampton",
    "deck_masters",
    "dynamic",
    "guyan",
    "irs",
    "reduce_model",
    "reduced_derivative",
    "reduced_modes",
    "sensor_model",
    "serep",
]
