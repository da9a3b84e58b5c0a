"""The parametric model: exact terms, configurations, eigen-solution and derivatives."""

from femtune.model.configuration import AddedMass, Configuration
from femtune.model.configured import ConfiguredModel, ModelPoint, configure, grid_matrix
from femtune.model.damping import (
    ModalDamping,
    constant_damping,
    damping_by_mode,
    damping_table,
    viscous_equivalent,
    viscous_equivalent_derivatives,
)
from femtune.model.derivatives import SubspaceDerivative, subspace_derivative
from femtune.model.digest import digest
from femtune.model.eigen import EigenSolution, solve_modes
from femtune.model.factorise import available_solvers
from femtune.model.fingerprint import derivatives_digest, matrices_digest
from femtune.model.parametric import Assignment, ParametricModel, parametric_model

__all__ = [
    "AddedMass",
    "Assignment",
    "Configuration",
    "ConfiguredModel",
    "EigenSolution",
    "ModalDamping",
    "ModelPoint",
    "ParametricModel",
    "SubspaceDerivative",
    "available_solvers",
    "configure",
    "constant_damping",
    "damping_by_mode",
    "damping_table",
    "derivatives_digest",
    "digest",
    "grid_matrix",
    "matrices_digest",
    "parametric_model",
    "solve_modes",
    "subspace_derivative",
    "viscous_equivalent",
    "viscous_equivalent_derivatives",
]
