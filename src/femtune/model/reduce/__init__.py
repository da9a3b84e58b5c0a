"""Reduced-order models: the term list on a trained basis, and named reductions on master DOFs."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.model.reduce.at_sensors import SensorModel, sensor_model
    from femtune.model.reduce.component_training import ComponentTrainer
    from femtune.model.reduce.components import (
        Alone,
        ComponentBasis,
        ComponentModel,
        Components,
        Division,
        alone,
        component_model,
        divide,
    )
    from femtune.model.reduce.condensation import (
        Component,
        Coupled,
        Reduction,
        couple,
        craig_bampton,
        deck_masters,
        dynamic,
        guyan,
        irs,
        serep,
    )
    from femtune.model.reduce.estimate import ErrorEstimate, ErrorEstimator, certified_error
    from femtune.model.reduce.function_estimate import FunctionsWanted
    from femtune.model.reduce.functions_in_basis import BasisPorts, FunctionsInBasis, reduced_functions
    from femtune.model.reduce.modes_in_basis import ReducedModes, reduced_derivative, reduced_modes
    from femtune.model.reduce.reduced_model import ReducedModel, ReducedPoint, reduce_model
    from femtune.model.reduce.training import (
        Certified,
        SavedBasis,
        Trained,
        Trainer,
        TrainingRules,
        TrainingStatus,
        modes_nearby,
    )
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "Alone",
    "BasisPorts",
    "Certified",
    "Component",
    "ComponentBasis",
    "ComponentModel",
    "ComponentTrainer",
    "Components",
    "Coupled",
    "Division",
    "ErrorEstimate",
    "ErrorEstimator",
    "FunctionsInBasis",
    "FunctionsWanted",
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
    "alone",
    "certified_error",
    "component_model",
    "couple",
    "craig_bampton",
    "deck_masters",
    "divide",
    "dynamic",
    "guyan",
    "irs",
    "modes_nearby",
    "reduce_model",
    "reduced_derivative",
    "reduced_functions",
    "reduced_modes",
    "sensor_model",
    "serep",
]
