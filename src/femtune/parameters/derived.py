"""Quantities that follow from parameters: what a number of the model means for the structure."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import NDArray

from femtune.parameters import jet
from femtune.parameters.expression import Expression
from femtune.parameters.jet import Jet
from femtune.parameters.parameter_set import ParameterSet


@dataclass(frozen=True)
class DerivedQuantity:
    """A quantity by an expression of parameters: a slab's thickness of its stiffness, a joint's rotation of its spring.

    Its standard deviation is that of the linear form, σ² = gᵀ C g, with the gradient g that `at` gives and the
    covariance C of the normalised parameters.
    """

    name: str
    expression: Expression
    unit: str = ""

    def at(self, parameters: ParameterSet, x: NDArray) -> Jet:
        """Value with gradient and Hessian in the normalised free parameters (error ``tie.value``)."""
        found = self.expression(parameters.jets(x))
        return found if isinstance(found, Jet) else jet.constant(found, len(parameters.free))
