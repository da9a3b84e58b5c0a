"""Regularisations from the keys of [update], by their words; see `femtune.updating.kinds.REGULARISATIONS`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from femtune.parameters import ParameterSet
from femtune.updating.kinds import REGULARISATIONS, RegularisationMethod, WeightTarget
from femtune.updating.prior import Prior, correlated_prior
from femtune.updating.regularisation import (
    Distance,
    EachStep,
    Identical,
    Link,
    MinimumChange,
    NoRegularisation,
    Regularisation,
    Truncated,
    Weight,
)


class AskedCorrelation(Protocol):
    """A prior correlation of two parameters."""

    @property
    def one(self) -> str: ...

    @property
    def other(self) -> str: ...

    @property
    def value(self) -> float: ...


class AskedUpdate(Protocol):
    """The keys of [update] that a regularisation reads."""

    @property
    def regularisation(self) -> RegularisationMethod: ...

    @property
    def weight(self) -> Weight: ...

    @property
    def weight_on(self) -> WeightTarget: ...

    @property
    def identical(self) -> tuple[tuple[str, ...], ...]: ...

    @property
    def correlations(self) -> Sequence[AskedCorrelation]: ...


def regularisation_of(asked: AskedUpdate, parameters: ParameterSet) -> Regularisation:
    """The side constraint that [update] asks for (errors ``prior.*``)."""
    regularisation: Regularisation = REGULARISATIONS[asked.regularisation].load()(asked, parameters)
    return regularisation


def none(asked: AskedUpdate, parameters: ParameterSet) -> NoRegularisation:
    """No side constraint."""
    return NoRegularisation()


def minimum_change(asked: AskedUpdate, parameters: ParameterSet) -> Regularisation:
    """Weighted squares of the changes from the nominal values."""
    return _acting(MinimumChange(asked.weight), asked)


def distance(asked: AskedUpdate, parameters: ParameterSet) -> Regularisation:
    """Weighted squares of the changes from the initial values, in prior standard deviations."""
    return _acting(Distance(asked.weight), asked)


def link(asked: AskedUpdate, parameters: ParameterSet) -> Regularisation:
    """Weighted squares of the changes, with weights from the first Jacobian."""
    return _acting(Link(asked.weight), asked)


def prior(asked: AskedUpdate, parameters: ParameterSet) -> Prior:
    """The prior distribution of the parameters, with correlations where some are stated."""
    pairs = [(c.one, c.other, c.value) for c in asked.correlations]
    return correlated_prior(parameters, pairs) if pairs else Prior()


def identical(asked: AskedUpdate, parameters: ParameterSet) -> Identical:
    """Groups of parameters with equal values."""
    return Identical(asked.identical, asked.weight)


def truncated(asked: AskedUpdate, parameters: ParameterSet) -> Truncated:
    """A truncated singular value decomposition; the weight is its relative threshold."""
    return Truncated(float(asked.weight))


def _acting(constraint: MinimumChange | Distance | Link, asked: AskedUpdate) -> Regularisation:
    return EachStep(constraint) if asked.weight_on == "each-step" else constraint
