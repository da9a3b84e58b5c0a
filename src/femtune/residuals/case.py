"""A configuration with its test, its state at a parameter vector, and what a residual of that state is.

They stand together because each is said in terms of the others: a case has residuals, a residual is asked at a state,
and a state is one of a case.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.modal import ModeSet
from femtune.model import ConfiguredModel, EigenSolution, ModelPoint
from femtune.residuals.aligned import AlignedModes, align
from femtune.residuals.block import ResidualBlock
from femtune.residuals.seen import seen_only
from femtune.residuals.solver import ModelSolver, direct

Reals = NDArray[np.float64]

Group = tuple[tuple[int, ...], tuple[int, ...]]
"""Positions of test modes and of the model modes that span their subspace."""


@dataclass(frozen=True)
class PairingRules:
    """How test and model modes find each other; see `femtune.correlate.pair_modes`."""

    frequency_gate: float = 0.30
    mac_gate: float = 0.50
    relative_gap: float = 0.01


@runtime_checkable
class Residual(Protocol):
    """One comparison in one configuration: data, weights and labels inside, no algorithm.

    What it keeps belongs to the test, never to one model: it is asked on reduced models and on the written deck too.

    Parameters
    ----------
    on_modes : True where it is made of modes or of a modal basis, so that a reduced model serves it
    """

    @property
    def on_modes(self) -> bool:
        """See above."""
        ...

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """Residuals at a state of the model.

        Parameters
        ----------
        state : the model at one parameter vector; it solves for modes when they are asked for
        derivatives : whether Jacobians are wanted; without them those of the blocks have no columns
        """
        ...


@dataclass(frozen=True)
class ModalCase:
    """A configuration and what was measured in it.

    Parameters
    ----------
    configured : the model in this configuration
    test : real test modes at the sensors; a set of no modes where none were measured
    sensors : (s, n_free) rows that sample the free DOFs at the sensors
    left_out : reason by position of a test mode
    fixed : (test, model) positions paired by hand
    count, max_hz : which model modes are solved for; one of them
    solver : who computes solutions of the full model
    residuals : what is compared here besides the paired modes of `ResidualRules`
    full : the case on the full model, where this one is on a reduced model
    """

    configured: ConfiguredModel
    test: ModeSet
    sensors: sp.csr_array
    left_out: Mapping[int, str] = field(default_factory=dict)
    fixed: tuple[tuple[int, int], ...] = ()
    count: int | None = None
    max_hz: float | None = None
    rules: PairingRules = PairingRules()
    solver: ModelSolver = field(default=direct, repr=False)
    residuals: tuple[Residual, ...] = ()
    full: ModalCase | None = field(default=None, repr=False)

    @property
    def name(self) -> str:
        """Name of the configuration."""
        return self.configured.configuration.name

    @property
    def on_full_model(self) -> ModalCase:
        """The case on the full model; this one where it is not reduced."""
        return self if self.full is None else self.full

    @property
    def on_modes(self) -> bool:
        """True where something is compared that modes, or a modal basis, serve."""
        return bool(len(self.test)) or any(r.on_modes for r in self.residuals)


def case_without_modes(configured: ConfiguredModel, residuals: tuple[Residual, ...], **more: object) -> ModalCase:
    """A configuration in which no modes were measured, with what is compared there; `more` are further fields."""
    none = ModeSet(np.zeros(0), np.zeros((0, 0)), DofSet(()), source="no modes were measured")
    rows = sp.csr_array((0, configured.n_free))
    return ModalCase(configured, none, rows, residuals=residuals, **more)  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class PairedMode:
    """One test mode and the model's aligned motion.

    Parameters
    ----------
    position : of the test mode in the case's test
    eigenvalue, eigenvalue_gradient : λ in rad²/s² of the model, and ∂λ/∂x (k,)
    shape, shape_gradient : (s,) and (s, k) model shape at the sensors, of unit modal mass
    """

    case: ModalCase
    position: int
    eigenvalue: float
    eigenvalue_gradient: Reals
    shape: Reals
    shape_gradient: Reals

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
    known : the modes there, where they have been solved; without them they are solved when they are asked for
    """

    case: ModalCase
    point: ModelPoint
    groups: tuple[Group, ...] = ()
    known: EigenSolution | None = field(default=None, repr=False)

    @cached_property
    def solution(self) -> EigenSolution:
        """The modes, solved once; errors as of `solve_modes`."""
        return self.known or self.case.solver.modes(self.point, self.case.count, self.case.max_hz)

    @property
    def solved(self) -> EigenSolution | None:
        """The modes where they have been solved, None where nothing asked for them."""
        return self.__dict__.get("solution", self.known)

    @property
    def full(self) -> ModelPoint:
        """The full model at this point, whatever model the modes come from."""
        return self.case.on_full_model.configured.at(self.point.x)

    @cached_property
    def _kept(self) -> dict[tuple[Group, bool], AlignedModes]:
        return {}

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
        found = derivative(self.solution, models, self.case.sensors)
        return align(found, self.case.test.shapes[:, list(tests)])

    def pairs(self, derivatives: bool) -> Iterator[PairedMode]:
        """Every paired test mode with the model's motion that stands against it."""
        for group in self.groups:
            aligned = self.aligned(group, derivatives)
            for a, i in enumerate(group[0]):
                value, slope = float(aligned.eigenvalues[a]), aligned.eigenvalue_gradients[a]
                yield PairedMode(self.case, i, value, slope, aligned.shapes[:, a], aligned.shape_gradients[:, a])
