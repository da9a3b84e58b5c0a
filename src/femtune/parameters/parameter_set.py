"""Parameter and ParameterSet: free parameters with bounds and priors, and constrained ones tied to them."""

from __future__ import annotations

import keyword
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.errors import ErrorCollector, FemtuneError, Where, did_you_mean
from femtune.parameters import jet
from femtune.parameters.expression import Expression, parse_expression
from femtune.parameters.jet import Jet


@dataclass(frozen=True)
class Parameter:
    """One parameter P.

    Parameters
    ----------
    name : an identifier, for use in ties
    nominal : initial value P0, in `unit`
    lower, upper : bounds, in `unit`
    unit : text for tables; "" for a factor
    prior_mean, prior_sd : prior; by default the mean is the nominal value, and the standard deviation is
        (upper − lower)/√12
    tie : expression of other parameters; a tied (constrained) parameter is not free
    where : place in the study file
    positive : True for a quantity that cannot be negative, such as a modulus or a mass

    Raises
    ------
    FemtuneError : ``parameter.name``, ``parameter.bounds`` or ``parameter.prior``
    """

    name: str
    nominal: float = 1.0
    lower: float = 0.5
    upper: float = 2.0
    unit: str = ""
    prior_mean: float | None = None
    prior_sd: float | None = None
    tie: Expression | None = None
    where: Where | None = None
    positive: bool = False

    def __post_init__(self) -> None:
        if not self.name.isidentifier() or keyword.iskeyword(self.name):
            raise self._error("parameter.name")
        if self.tie is None:
            self._check_bounds()
        self._check_prior()

    def _check_bounds(self) -> None:
        if not np.isfinite([self.nominal, self.lower, self.upper]).all():
            raise self._error("parameter.bounds")
        if self.lower > self.upper:
            raise self._error("parameter.bounds/crossed")
        if self.lower == self.upper:
            raise self._error("parameter.bounds/equal")
        if not self.lower <= self.nominal <= self.upper:
            raise self._error("parameter.bounds/nominal-outside")

    def _check_prior(self) -> None:
        if self.prior_mean is not None and not np.isfinite(self.prior_mean):
            raise self._error("parameter.prior")
        if self.prior_sd is not None and not (np.isfinite(self.prior_sd) and self.prior_sd > 0):
            raise self._error("parameter.prior/standard-deviation")

    def _error(self, code: str) -> FemtuneError:
        values: dict[str, object] = {"nominal": self.nominal, "lower": self.lower, "upper": self.upper}
        if code.startswith("parameter.prior"):
            values = {"prior_mean": self.prior_mean, "prior_sd": self.prior_sd}
        return FemtuneError(code, where=self.where, values=values, parameter=self.name)

    @property
    def free(self) -> bool:
        """True if it has no tie."""
        return self.tie is None

    @property
    def mean(self) -> float:
        """Mean of the prior."""
        return self.nominal if self.prior_mean is None else self.prior_mean

    @property
    def sd(self) -> float:
        """Standard deviation of the prior: that of a uniform distribution between the bounds if none is given."""
        return (self.upper - self.lower) / np.sqrt(12.0) if self.prior_sd is None else self.prior_sd

    @property
    def scale(self) -> float:
        """P = P0 + scale·x inside solvers: |P0|, or the width of the bounds if |P0| is below a thousandth of that."""
        width = self.upper - self.lower
        return abs(self.nominal) if abs(self.nominal) >= 1e-3 * width else width


@dataclass(frozen=True)
class ParameterSet:
    """All parameters of a study, free and tied.

    Solvers move the normalised free vector x, P = P0 + |P0|·x (P = P0 (1 + x) for positive P0), zero at nominal.
    Without `curved` there are no second derivatives, whose number grows as the square of that of the parameters.

    Raises
    ------
    FemtuneError : ``parameter.duplicate``, ``tie.unknown``, ``tie.circle``, or ``tie.value`` if a tie has no finite
        value at the nominal point
    """

    parameters: tuple[Parameter, ...] = field(default=())
    curved: bool = True

    def __post_init__(self) -> None:
        errors = ErrorCollector()
        with errors.catch():
            self._check_names()
        with errors.catch():
            self._check_ties()
        errors.raise_if_any()
        self.jets(np.zeros(len(self.free)))

    def _check_names(self) -> None:
        for i, p in enumerate(self.parameters):
            if p.name in self.names[:i]:
                raise FemtuneError("parameter.duplicate", where=p.where, name=p.name)

    def _check_ties(self) -> None:
        for p in self.parameters:
            for name in p.tie.names if p.tie else ():
                if name not in self.names:
                    raise FemtuneError(
                        "tie.unknown",
                        where=p.where,
                        hint=did_you_mean(name, (other for other in self.names if other != p.name)),
                        parameter=p.name,
                        name=name,
                    )
        _ = self._order

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters."""
        return tuple(p.name for p in self.parameters)

    @cached_property
    def free(self) -> tuple[Parameter, ...]:
        """The free parameters, in their order."""
        return tuple(p for p in self.parameters if p.free)

    @cached_property
    def _order(self) -> tuple[Parameter, ...]:
        """Tied parameters in an order in which each comes after those that it uses."""
        done, waiting = {p.name for p in self.free}, [p for p in self.parameters if not p.free]
        ordered: list[Parameter] = []
        while waiting:
            ready = [p for p in waiting if p.tie and set(p.tie.names) <= done]
            if not ready:
                names = ", ".join(p.name for p in waiting)
                raise FemtuneError("tie.circle", where=waiting[0].where, parameters=names)
            ordered += ready
            done |= {p.name for p in ready}
            waiting = [p for p in waiting if p.name not in done]
        return tuple(ordered)

    def __len__(self) -> int:
        return len(self.parameters)

    @cached_property
    def nominal(self) -> NDArray[np.float64]:
        """Nominal values of the free parameters."""
        return np.array([p.nominal for p in self.free], dtype=float)

    @cached_property
    def scale(self) -> NDArray[np.float64]:
        """Scales of the free parameters."""
        return np.array([p.scale for p in self.free], dtype=float)

    def normalise(self, values: Iterable[float]) -> NDArray[np.float64]:
        """Free values P -> x."""
        return (np.asarray(list(values), dtype=float) - self.nominal) / self.scale

    def denormalise(self, x: NDArray) -> NDArray:
        """x -> free values P."""
        return self.nominal + self.scale * x

    @cached_property
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Normalised lower and upper bounds."""
        return self.normalise(p.lower for p in self.free), self.normalise(p.upper for p in self.free)

    @cached_property
    def limits(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The bounds for intervals; the lower one of a quantity that cannot be negative is at least zero."""
        lower, upper = self.bounds
        zero = self.normalise(0.0 for _ in self.free)
        positive = np.array([p.positive for p in self.free], dtype=bool)
        return np.where(positive & (upper > zero), np.maximum(lower, zero), lower), upper

    @cached_property
    def prior(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Normalised prior means and standard deviations."""
        return self.normalise(p.mean for p in self.free), np.array([p.sd for p in self.free]) / self.scale

    def jets(self, x: NDArray) -> dict[str, Jet]:
        """Values of all parameters with exact gradient and Hessian in x (error ``tie.value``)."""
        free = jet.variables(x, self.curved) * self.scale + self.nominal
        values = {p.name: free[i] for i, p in enumerate(self.free)}
        for p in self._order:
            assert p.tie is not None
            tied = p.tie(values)
            values[p.name] = tied if isinstance(tied, Jet) else jet.constant(tied, len(self.free), free.n_curved)
        return values

    def values(self, x: NDArray) -> dict[str, float]:
        """Values of all parameters, free and tied, in the order of the set."""
        of_sample = self.at_samples(np.asarray(x, dtype=float)[None])
        return {name: float(of_sample[name][0]) for name in self.names}

    def at_samples(self, x: NDArray) -> dict[str, NDArray[np.float64]]:
        """Values (n,) of all parameters at n normalised free vectors (n, k) (error ``tie.value``)."""
        free = self.denormalise(np.asarray(x, dtype=float))
        values = {p.name: free[:, i] for i, p in enumerate(self.free)}
        for p in self._order:
            assert p.tie is not None
            values[p.name] = np.broadcast_to(p.tie(values), len(free))
        return values

    def index(self, name: str) -> int:
        """Position of a free parameter in x."""
        return [p.name for p in self.free].index(name)


def tied(name: str, expression: str, **facts: Any) -> Parameter:
    """A constrained parameter from the text of its tie."""
    where = facts.get("where")
    return Parameter(name, tie=parse_expression(expression, where), **facts)


# ----------------------------------------------------------------------------------------------------
# Quantities that are functions of parameters, with a meaning for the structure.


@dataclass(frozen=True)
class DerivedQuantity:
    """A function of parameters, such as a slab's thickness from its stiffness, or a joint's fixity from its spring.

    Its standard deviation is that of the linearised function, σ² = gᵀ C g, with the gradient g from `at` and the
    covariance C of the normalised parameters.
    """

    name: str
    expression: Expression
    unit: str = ""

    def at(self, parameters: ParameterSet, x: NDArray) -> Jet:
        """Value with gradient and Hessian in the normalised free parameters (error ``tie.value``)."""
        value = self.expression(parameters.jets(x))
        return value if isinstance(value, Jet) else jet.constant(value, len(parameters.free))

    def at_samples(self, parameters: ParameterSet, x: NDArray) -> NDArray[np.float64]:
        """Values (n,) at n normalised free vectors (n, k) (error ``tie.value``)."""
        return np.broadcast_to(self.expression(parameters.at_samples(x)), len(x))
