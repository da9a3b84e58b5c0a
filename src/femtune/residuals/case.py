"""A configuration with its test, its state at a parameter vector, and what a residual of that state is.

They stand together because each is said in terms of the others: a case has residuals, a residual is asked at a state,
and a state is one of a case.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from femtune.arrays import Reals
from femtune.dofs import DofSet
from femtune.modal import ModeSet
from femtune.model import (
    ConfiguredModel,
    EigenSolution,
    ModelPoint,
    SubspaceDerivative,
)
from femtune.model.full_model import ModelSolver, direct
from femtune.residuals.aligned import AlignedModes, align
from femtune.residuals.asked import Asked
from femtune.residuals.weights import ResidualBlock, Weights

# ----------------------------------------------------------------------------------------------------
# Modes at the sensors without derivatives, for points of which only the residuals are wanted.


def seen_only(solution: EigenSolution, members: Sequence[int], rows: sp.csr_array) -> SubspaceDerivative:
    """Eigenvalues and shapes at the rows, without derivatives; see `subspace_derivative`."""
    members = list(members)
    shapes = np.asarray(rows @ solution.shapes[:, members])
    none = np.zeros((0, len(members), len(members)))
    return SubspaceDerivative(solution.eigenvalues[members], none, none, np.zeros((*shapes.shape, 0)), shapes, 0.0)


Group = tuple[tuple[int, ...], tuple[int, ...]]
"""Positions of test modes and of the model modes that span their subspace."""


@dataclass(frozen=True)
class PairingRules:
    """How test and model modes find each other; see `femtune.correlation.pair_modes`."""

    frequency_gate: float = 0.30
    mac_gate: float = 0.50
    relative_gap: float = 0.01


class Residual(ABC):
    """A kind of residual; an instance is one comparison in one configuration, with its data and weights, no algorithm.

    What it keeps belongs to the test, never to one model: it is asked on reduced models and on the written deck too.
    The properties of a kind are defined in its class.

    Parameters
    ----------
    key : what a study calls the kind: "static-displacement"
    label : what reports call it: "static displacement"
    of_modes : True where it compares modes of the test
    on_modes : True where it is made of modes or of a modal basis, so that a reduced model serves it
    not_normal : why its values have no normal distribution; "" where they have one, to first order
    """

    key: ClassVar[str] = ""
    label: ClassVar[str] = ""
    of_modes: ClassVar[bool] = False
    on_modes: ClassVar[bool] = False
    not_normal: ClassVar[str] = ""

    @property
    def of_ratio(self) -> bool:
        """True where a common factor on stiffness, mass and damping of the model changes no value."""
        return False

    @classmethod
    def of_study(cls, asked: Asked) -> Residual:
        """The residual that a [[residual]] table requests; errors point to the table or to one of its keys."""
        raise TypeError(f"{cls.__name__} has no table in a study")

    def of_kinds(self, keys: Collection[str]) -> Residual | None:
        """The part of it that is of the kinds with these keys; None if nothing is."""
        return self if self.key in keys else None

    def in_band(self, low_hz: float, high_hz: float) -> Residual:
        """The part of it in a band; itself if it has no lines. Modes beyond the band are left out by the case."""
        return self

    def block(
        self,
        configuration: str,
        mode: str,
        values: Reals,
        jacobian: Reals,
        sd: float,
        *,
        lost: int = 0,
        covariance: Reals | None = None,
        common: Reals | None = None,
    ) -> ResidualBlock:
        """A block of this kind; see `ResidualBlock`."""
        return ResidualBlock(
            kind=self.label,
            configuration=configuration,
            mode=mode,
            values=values,
            jacobian=jacobian,
            sd=sd,
            of_mode=self.of_modes,
            lost=lost,
            covariance=covariance,
            not_normal=self.not_normal,
            common=common,
        )

    def weighted(
        self, configuration: str, mode: str, errors: Reals, jacobian: Reals, weights: Weights, size: float = 1.0
    ) -> ResidualBlock:
        """A block of errors in their unit; its `sd` is relative to `size`, the size of what is compared."""
        values, slopes = weights.whiten(errors, jacobian)
        return self.block(configuration, mode, values, slopes, weights.scale / (size or 1.0))

    @abstractmethod
    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """Residuals at a state of the model.

        Parameters
        ----------
        state : the model at one parameter vector; it solves for modes when they are requested
        derivatives : whether Jacobians are wanted; without them those of the blocks have no columns
        """


@dataclass(frozen=True)
class ComparedCase:
    """A configuration and what was measured in it.

    Parameters
    ----------
    configured : the model in this configuration
    test : real test modes at the sensors; a set of no modes where none were measured
    sensors : (s, n_free) rows that sample the free DOFs at the sensors
    left_out : reason by position of a test mode
    fixed : (test, model) positions paired by hand
    never : (test, model) positions that are not paired
    count, max_hz : which model modes are solved for; one of them
    solver : who computes solutions of the full model
    residuals : what is compared here
    full : the case on the full model, where this one is on a reduced model
    """

    configured: ConfiguredModel
    test: ModeSet
    sensors: sp.csr_array
    left_out: Mapping[int, str] = field(default_factory=dict)
    fixed: tuple[tuple[int, int], ...] = ()
    never: tuple[tuple[int, int], ...] = ()
    count: int | None = None
    max_hz: float | None = None
    rules: PairingRules = PairingRules()
    solver: ModelSolver = field(default=direct, repr=False)
    residuals: tuple[Residual, ...] = ()
    full: ComparedCase | None = field(default=None, repr=False)

    @property
    def name(self) -> str:
        """Name of the configuration."""
        return self.configured.configuration.name

    @property
    def on_full_model(self) -> ComparedCase:
        """The case on the full model; this one where it is not reduced."""
        return self if self.full is None else self.full

    @property
    def on_modes(self) -> bool:
        """True where something is compared that modes, or a modal basis, serve."""
        return bool(len(self.test)) or any(r.on_modes for r in self.residuals)


def case_without_modes(configured: ConfiguredModel, residuals: tuple[Residual, ...], **more: object) -> ComparedCase:
    """A configuration in which no modes were measured, with what is compared there; `more` are further fields."""
    none = ModeSet(np.zeros(0), np.zeros((0, 0)), DofSet(()), source="no modes were measured")
    rows = sp.csr_array((0, configured.n_free))
    return ComparedCase(configured, none, rows, residuals=residuals, **more)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class PairedMode:
    """One test mode and the model's aligned motion.

    Parameters
    ----------
    position : of the test mode in the case's test
    eigenvalue, eigenvalue_gradient : λ in rad²/s² of the model, and ∂λ/∂x (k,)
    shape, shape_gradient : (s,) and (s, k) model shape at the sensors, of unit modal mass
    turned : by how many rotations inside its subspace the shape was fitted to the test's; those of a cluster of t test
        modes and c model modes together are as many as there are angles between them, ct − t(t + 1)/2
    state, members : where the pair was formed, and the positions of the model modes that span its motion
    """

    case: ComparedCase
    position: int
    eigenvalue: float
    eigenvalue_gradient: Reals
    shape: Reals
    shape_gradient: Reals
    turned: int = 0
    state: CaseState | None = field(default=None, repr=False)
    members: tuple[int, ...] = ()

    @property
    def label(self) -> str:
        """Label of the test mode."""
        return self.case.test.labels[self.position]

    @property
    def test_hz(self) -> float:
        """Test frequency."""
        return float(self.case.test.freq_hz[self.position])

    @property
    def test_shape(self) -> Reals:
        """(s,) test shape; NaN entries were not measured."""
        return np.asarray(self.case.test.shapes[:, self.position])


@dataclass(frozen=True, eq=False)
class CaseState:
    """A case at one point.

    Parameters
    ----------
    point : the model there, of the case's `configured` (a reduced model's where the case is reduced)
    groups : frozen groups of paired modes; none where no test mode is paired
    known : the modes there, where they have been solved; without them they are solved when they are requested
    """

    case: ComparedCase
    point: ModelPoint
    groups: tuple[Group, ...] = ()
    known: EigenSolution | None = field(default=None, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """State for another process, which solves again for the modes that it needs."""
        return {"case": self.case, "point": self.point, "groups": self.groups, "known": None}

    @cached_property
    def solution(self) -> EigenSolution:
        """The modes, solved once; errors as of `solve_modes`."""
        return self.known or self.case.solver.modes(self.point, self.case.count, self.case.max_hz)

    @property
    def solved(self) -> EigenSolution | None:
        """The modes where they have been solved, None if nothing has requested them."""
        return self.__dict__.get("solution", self.known)

    @cached_property
    def further(self) -> dict[tuple[int | None, float | None], EigenSolution]:
        """Modes of the full model other than those of the case, by number and upper frequency: kept by who asks."""
        return {}

    @property
    def full(self) -> ModelPoint:
        """The full model at this point, even if the modes come from a reduced one."""
        return self.case.on_full_model.configured.at(self.point.x)

    @cached_property
    def shared(self) -> dict[object, Any]:
        """Quantities of this state that residuals have computed for each other."""
        return {}

    @cached_property
    def _kept(self) -> dict[tuple[Group, bool], AlignedModes]:
        return {}

    def with_groups(self, groups: tuple[Group, ...]) -> CaseState:
        """The same point with another pairing; what groups of both share is not computed again."""
        other = CaseState(self.case, self.point, groups, self.solution)
        other._kept.update(self._kept)
        return other

    def aligned(self, group: Group, derivatives: bool) -> AlignedModes:
        """A group's model vectors aligned with its test shapes, computed once."""
        if (group, True) in self._kept:
            return self._kept[group, True]
        if (group, derivatives) not in self._kept:
            self._kept[group, derivatives] = self._align(group, derivatives)
        return self._kept[group, derivatives]

    def _align(self, group: Group, derivatives: bool) -> AlignedModes:
        tests, models = group
        derivative = self.case.solver.derivative if derivatives else seen_only
        gradients = derivative(self.solution, models, self.case.sensors)
        return align(gradients, self.case.test.shapes[:, list(tests)])

    def pairs(self, derivatives: bool) -> Iterator[PairedMode]:
        """Every paired test mode with the model's motion paired with it."""
        for group in self.groups:
            aligned = self.aligned(group, derivatives)
            for a, i in enumerate(group[0]):
                value, slope = float(aligned.eigenvalues[a]), aligned.eigenvalue_gradients[a]
                shape, gradient = aligned.shapes[:, a], aligned.shape_gradients[:, a]
                turned = len(group[1]) - 1 - a
                yield PairedMode(
                    case=self.case,
                    position=i,
                    eigenvalue=value,
                    eigenvalue_gradient=slope,
                    shape=shape,
                    shape_gradient=gradient,
                    turned=turned,
                    state=self,
                    members=tuple(group[1]),
                )
