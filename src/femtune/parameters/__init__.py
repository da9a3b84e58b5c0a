"""Parameters: nominal values, bounds, priors and ties, with exact derivatives."""

from femtune.parameters.derived import DerivedQuantity
from femtune.parameters.expression import Expression, parse_expression
from femtune.parameters.jet import Jet
from femtune.parameters.parameter_set import Parameter, ParameterSet, tied

__all__ = ["DerivedQuantity", "Expression", "Jet", "Parameter", "ParameterSet", "parse_expression", "tied"]
