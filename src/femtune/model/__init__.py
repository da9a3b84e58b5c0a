"""The parametric model: exact terms, configurations, eigen-solution and derivatives."""

from femtune.model.configuration import AddedMass, Configuration
from femtune.model.configured import ConfiguredModel, ModelPoint, configure, grid_matrix
from femtune.model.derivatives import SubspaceDerivative, subspace_derivative
from femtune.model.eigen import EigenSolution, solve_modes
from femtune.model.factorise import available_solvers
from femtune.model.parametric import Assignment, ParametricModel, parametric_model

__all__ = [
    "AddedMass",
    "Assignment",
    "Configuration",
    "ConfiguredModel",
    "EigenSolution",
    "ModelPoint",
    "ParametricModel",
    "SubspaceDerivative",
    "available_solvers",
    "configure",
    "grid_matrix",
    "parametric_model",
    "solve_modes",
    "subspace_derivative",
]
