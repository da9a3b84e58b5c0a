"""The parametric model: exact terms, configurations, eigen-solution and derivatives."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.model.configuration import AddedMass, Configuration
    from femtune.model.configured import ConfiguredModel, ModelPoint, configure, grid_matrix
    from femtune.model.damping import (
        ModalDamping,
        constant_damping,
        damping_by_mode,
        damping_table,
    )
    from femtune.model.derivatives.chosen import eigenvalue_derivatives, subspace_derivative
    from femtune.model.derivatives.modes import SubspaceDerivative
    from femtune.model.derivatives.sensors import SensorDerivatives, sensor_derivatives
    from femtune.model.derivatives.streamed import derivatives_by_parameter
    from femtune.model.digests import digest
    from femtune.model.eigen.own_frequency import OwnFrequencyMode, modes_at_own_frequency
    from femtune.model.eigen.solution import EigenSolution, solve_modes
    from femtune.model.fingerprint import derivatives_digest, matrices_digest
    from femtune.model.over_frequency import FrequencyTable, frequency_table
    from femtune.model.parametric import Assignment, ParametricModel, parametric_model
    from femtune.model.solvers.factorise import available_solvers
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "AddedMass",
    "Assignment",
    "Configuration",
    "ConfiguredModel",
    "EigenSolution",
    "FrequencyTable",
    "ModalDamping",
    "ModelPoint",
    "OwnFrequencyMode",
    "ParametricModel",
    "SensorDerivatives",
    "SubspaceDerivative",
    "available_solvers",
    "configure",
    "constant_damping",
    "damping_by_mode",
    "damping_table",
    "derivatives_by_parameter",
    "derivatives_digest",
    "digest",
    "eigenvalue_derivatives",
    "frequency_table",
    "grid_matrix",
    "matrices_digest",
    "modes_at_own_frequency",
    "parametric_model",
    "sensor_derivatives",
    "solve_modes",
    "subspace_derivative",
]
