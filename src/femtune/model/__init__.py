"""The parametric model: exact terms, configurations, eigen-solution and derivatives."""

from femtune.model.configuration import AddedMass, Configuration
from femtune.model.configured import ConfiguredModel, ModelPoint
from femtune.model.configuring import configure, grid_matrix
from femtune.model.damping import (
    ModalDamping,
    constant_damping,
    damping_by_mode,
    damping_table,
    viscous_equivalent,
    viscous_equivalent_derivatives,
)
from femtune.model.derivatives import SubspaceDerivative
from femtune.model.digest import digest
from femtune.model.dual_derivatives import SensorDerivatives, sensor_derivatives
from femtune.model.eigen import EigenSolution, solve_modes
from femtune.model.factorise import available_solvers
from femtune.model.fingerprint import derivatives_digest, matrices_digest
from femtune.model.mode_derivatives import eigenvalue_derivatives, subspace_derivative
from femtune.model.parametric import Assignment, ParametricModel, parametric_model
from femtune.model.streamed_derivatives import derivatives_by_parameter

__all__ = [
    "AddedMass",
    "Assignment",
    "Configuration",
    "ConfiguredModel",
    "EigenSolution",
    "ModalDamping",
    "ModelPoint",
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
    "grid_matrix",
    "matrices_digest",
    "parametric_model",
    "sensor_derivatives",
    "solve_modes",
    "subspace_derivative",
    "viscous_equivalent",
    "viscous_equivalent_derivatives",
]
