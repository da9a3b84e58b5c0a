"""FRF residuals on reduced models: the same lines, forms and weights, the functions from a dense model of low order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import cast

import numpy as np
import scipy.sparse as sp

from femtune.arrays import Complexes, Reals
from femtune.errors import FemtuneError
from femtune.modal.frf_set import KINDS
from femtune.model import EigenSolution
from femtune.model.reduce import ReducedModes
from femtune.model.reduce.function_estimate import FunctionsWanted
from femtune.model.reduce.functions_in_basis import BasisPorts, reduced_functions
from femtune.model.reduce.modes_in_basis import wanted_number
from femtune.model.response import TIMES_HIGHEST_LINE
from femtune.residuals.case import CaseState, ComparedCase, Residual
from femtune.residuals.frf.model_way import full_modes, settled
from femtune.residuals.frf.residual import FrfResidual
from femtune.residuals.weights import ResidualBlock


def served(state: CaseState) -> tuple[FrfResidual, ...]:
    """FRF residuals that a reduced model serves, at a state of the full model where they are settled.

    Not those that the study truncates, by a number of modes that does not reach twice the highest line or without
    residual vectors: a reduced model has no such truncation. Nor those of a model that depends on frequency.
    """
    if state.case.configured.model.tables:
        return ()
    settled_residuals = map(settled, state.case.residuals)
    return tuple(r for r in settled_residuals if isinstance(r, FrfResidual) and not _truncates(state, r))


def _truncates(state: CaseState, residual: FrfResidual) -> bool:
    way = residual.way
    if way.method == "direct" or (way.residual_vectors and not way.limit):
        return False
    reach = float(modes_for(state, residual).freq_hz[-1])
    return not way.residual_vectors or reach < TIMES_HIGHEST_LINE * residual.highest_hz


def modes_for(state: CaseState, residual: FrfResidual, start: EigenSolution | None = None) -> EigenSolution:
    """Modes of the full model that a residual needs: those that its way takes, or up to twice the highest line.

    `start` are modes nearby that shorten the way where they are solved for.
    """
    return full_modes(state, residual.way.modes or (None, TIMES_HIGHEST_LINE * residual.highest_hz), start)


def wanted_of(state: CaseState, residual: FrfResidual) -> FunctionsWanted:
    """Functions and lines for which a reduced model is trained."""
    lines, _ = residual.model_lines
    ports = residual.places.ports(state.full.configured, residual.measured)
    needs = residual.way.needs_modes(state.full)
    damped = modes_for(state, residual).wanted if needs else 0
    return FunctionsWanted(ports, lines, damped, residual.way.damping, residual.way.decay)


def port_rows(residuals: Sequence[FrfResidual], wanted: Sequence[FunctionsWanted]) -> list[sp.csr_array]:
    """Rows over the free DOFs that see outputs, inputs and modes that are left out, of each."""
    return [
        sp.csr_array(rows)
        for r, w in zip(residuals, wanted)
        for rows in (w.ports.outputs, w.ports.inputs.T, *(() if r.left_out is None else (r.left_out.momentum,)))
    ]


@dataclass(frozen=True, eq=False)
class ReducedFrfs(Residual):
    """An FRF residual on a reduced model.

    Parameters
    ----------
    own : the residual on the full model
    outputs, inputs : (a, r) and (b, r) rows that see its ports in the coordinates of the basis
    momentum : (m, r) rows that see the modes that are left out
    """

    own: FrfResidual
    outputs: Reals
    inputs: Reals
    momentum: Reals = field(default_factory=lambda: np.zeros((0, 0)))
    key = FrfResidual.key
    label = FrfResidual.label
    on_modes = True

    def blocks(self, state: CaseState, derivatives: bool = True) -> list[ResidualBlock]:
        """Residual blocks at a state of the reduced model; errors as of the residual."""
        return self.own.compared(*self.functions(state, derivatives))

    def functions(self, state: CaseState, derivatives: bool) -> tuple[Complexes, Complexes]:
        """As `FrfResidual.functions`."""
        modes = cast(ReducedModes, state.solution)
        lines, back = self.own.model_lines
        way = self.own.way
        s = np.asarray(way.decay + 2j * np.pi * lines, dtype=np.complex128)
        damped = self._damped(modes)
        ports, left_out = BasisPorts(self.inputs.T, self.outputs), self._left_out(modes, damped)
        functions = reduced_functions(modes, ports, s, damped, way.damping, derivatives, left_out)
        factor = s ** KINDS.index(self.own.measured.kind)
        if not np.isfinite(functions.values).all():
            raise FemtuneError(
                "residual.frf-not-finite", configuration=self.own.configuration, function="all functions"
            )
        values = np.moveaxis(functions.values * factor[:, None, None], 0, -1)
        gradient = np.moveaxis(functions.gradient * factor[:, None, None, None], 0, 2)
        return self.own.at_lines(values[:, :, back], gradient[:, :, back])

    def damped(self, state: CaseState) -> tuple[int, Reals]:
        """Number of modes that modal damping damps, and their frequencies in Hz, at a state of the reduced model."""
        modes = cast(ReducedModes, state.solution)
        count = self._damped(modes)
        return count, np.sqrt(np.maximum(modes.eigenvalues[:count], 0.0)) / (2.0 * np.pi)

    def _damped(self, modes: ReducedModes) -> int:
        return wanted_number(modes.eigenvalues, *(self.own.way.modes or (0, None)))

    def _left_out(self, modes: ReducedModes, count: int) -> tuple[int, ...]:
        left_out = self.own.left_out
        return () if left_out is None else left_out.found(self.momentum @ modes.shapes[:, :count])[0]


def on_reduced(case: ComparedCase, residuals: Sequence[FrfResidual], rows: Reals) -> tuple[Residual, ...]:
    """The residuals of a case, those that a reduced model serves with their `rows` from `port_rows` on its basis."""
    counts = [
        (len(r.measured.responses), len(r.measured.references), 0 if r.left_out is None else len(r.left_out.numbers))
        for r in residuals
    ]
    ends = np.cumsum([n for some in counts for n in some])
    parts = iter(np.split(rows, ends[:-1]) if len(ends) else [])
    of = {id(r): ReducedFrfs(r, next(parts), next(parts), next(parts)) for r in residuals}
    return tuple(of.get(id(settled(r)), r) for r in case.residuals)
