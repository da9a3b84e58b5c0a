"""Parameters: nominal values, bounds, priors and ties, with exact derivatives."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.parameters.expression import Expression, parse_expression
    from femtune.parameters.jet import Jet
    from femtune.parameters.parameter_set import DerivedQuantity, Parameter, ParameterSet, tied
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = ["DerivedQuantity", "Expression", "Jet", "Parameter", "ParameterSet", "parse_expression", "tied"]
