"""The model that a live one is made of: that of the update, or one that is trained for the page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from femtune.model.reduce import ReducedModel, reduce_model, reduced_modes
from femtune.model.reduce.estimate import extend
from femtune.model.reduce.function_estimate import missed_responses
from femtune.model.response import TIMES_HIGHEST_LINE
from femtune.model.solvers.factorise import factorise
from femtune.steps.live.frfs import MOST_OUTPUTS, ComparedFunctions

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.model import ConfiguredModel, EigenSolution
    from femtune.model.linear.symmetric import SymmetricMatrix
    from femtune.residuals import CaseState
    from femtune.steps.live.points import Points
    from femtune.steps.update.run import FoundParameters
    from femtune.study.progress import Progress

SMALL = 250
"""Degrees of freedom up to which a live model is made of the full matrices, which takes a fraction of a second."""
TRAINING = 6
"""Points in the region and in the bounds each at which the full model is solved for the first basis."""
_MOST_MODES = 120
"""Modes up to twice the highest line from which the functions are not drawn: the basis has room for no more."""


@dataclass(eq=False)
class Work:
    """Progress, and the number of solutions of the full model so far."""

    progress: Progress
    solutions: int = 0


@dataclass(frozen=True, eq=False)
class First:
    """The model that the live one is made of.

    Parameters
    ----------
    basis : (n_free, r); None where the model is the full one
    """

    model: ReducedModel
    basis: Reals | None

    def full(self, vectors: Reals) -> Reals:
        """Vectors in the DOFs of the full model."""
        return vectors if self.basis is None else np.asarray(self.basis @ vectors)

    def seen(self, forces: sp.csc_array | None) -> Reals | None:
        """Forces (n_free, f) in the coordinates of the model; None without any."""
        if forces is None:
            return None
        return np.asarray(forces.toarray() if self.basis is None else (forces.T @ self.basis).T)


class TooManyModesError(Exception):
    """The lines of the functions reach over more modes than a page has room for."""

    def __init__(self, count: int) -> None:
        super().__init__(f"there are {count} modes up to twice the highest line, and a page takes {_MOST_MODES}")


def trained(found: FoundParameters, state: CaseState) -> tuple[ReducedModel, Reals] | None:
    """The reduced model of the update and its basis; None without one."""
    search = found.search
    for k, i in enumerate([] if search is None else search.reduced):
        assert search is not None
        if search.problem.cases[i].name == state.case.name and len(search.trained[k].basis):
            return search.trained[k].model, search.trained[k].basis
    return None


@dataclass(frozen=True, eq=False)
class FirstModels:
    """Finds or makes the first model of each configuration."""

    found: FoundParameters
    work: Work

    def of(
        self, state: CaseState, configured: ConfiguredModel, count: int, functions: Sequence[ComparedFunctions],
        points: Points, carried: sp.csc_array,
    ) -> First:  # fmt: skip
        """That of a configuration with `count` modes and the functions that are compared.

        Parameters
        ----------
        carried : (n_free, f) unit forces at points that can carry a mass

        Raises
        ------
        TooManyModesError : for functions over too many modes
        """
        known = trained(self.found, state)
        if known is None and configured.n_free <= SMALL:
            return First(reduce_model(configured, np.eye(configured.n_free), shift=float(state.solution.shift)), None)
        forces, solution = forces_of(functions), None
        if forces is not None:
            solution = self._up_to_lines(state, configured, functions)
            count = max(count, solution.wanted)
        at = state.full if solution is None else solution.point
        shift = float(state.solution.shift) if known is None else known[0].shift
        metric = at.symmetric_stiffness.plus(-shift, at.symmetric_mass)
        columns = [_responses(metric, carried)]
        if known is None:
            return self._region_trained(state, configured, count, points, forces, solution, columns)
        model, basis = known
        if solution is not None and forces is not None and not all(f.label for f in functions):
            # a basis that was trained for modes alone
            columns += [solution.shapes, missed_responses(solution, forces)]
        basis = extend(basis, np.hstack(columns), metric)
        return First(reduce_model(configured, basis, shift=model.shift), basis)

    def _up_to_lines(
        self, state: CaseState, configured: ConfiguredModel, functions: Sequence[ComparedFunctions]
    ) -> EigenSolution:
        """Modes of the full model at the updated point up to twice the highest line."""
        point = configured.at(np.asarray(self.found.result.x))
        solution = state.case.on_full_model.solver.modes(point, None, _top_hz(functions))
        self.work.solutions += 1
        if solution.wanted > _MOST_MODES:
            raise TooManyModesError(solution.wanted)
        return solution

    def _region_trained(
        self, state: CaseState, configured: ConfiguredModel, count: int, points: Points,
        forces: sp.csc_array | None, at_update: EigenSolution | None, more: Sequence[Reals],
    ) -> First:  # fmt: skip
        """From modes of the full model at the updated point, in the region and in the bounds, and `more` vectors."""
        at = [*points.in_region(TRAINING, 2), *points.in_ranges(TRAINING, 2)]
        columns, solver, shift = (
            [state.solution.shapes, *more],
            state.case.on_full_model.solver,
            float(state.solution.shift),
        )
        if at_update is not None and forces is not None:
            columns += [at_update.shapes, missed_responses(at_update, forces)]
        for i, x in enumerate(at):
            told = f"live model of {state.case.name}: solutions of the full model"
            self.work.progress.step(told, i, len(at))
            solution = solver.modes(configured.at(x), count, None)
            columns.append(solution.shapes)
            if forces is not None:
                columns.append(missed_responses(solution, forces))
        self.work.solutions += len(at)
        metric = state.point.symmetric_stiffness.plus(-shift, state.point.symmetric_mass)
        columns = [c[:, (size := np.linalg.norm(c, axis=0)) > 0.0] / size[size > 0.0] for c in columns]
        basis = np.linalg.qr(np.hstack(columns))[0]
        gram = basis.T @ (metric @ basis)
        size, turned = np.linalg.eigh(0.5 * (gram + gram.T))
        basis = basis @ (turned / np.sqrt(size))
        return First(reduce_model(configured, basis, shift=shift), basis)


def modes_up_to_lines(model: ReducedModel, x: Reals, functions: Sequence[ComparedFunctions]) -> int:
    """Modes of a first model that the functions are superposed of; 0 without functions."""
    if not functions:
        return 0
    top = 2.0 * np.pi * _top_hz(functions)
    return int((reduced_modes(model.at(x), min(_MOST_MODES, model.order)).eigenvalues <= top**2).sum())


def _top_hz(functions: Sequence[ComparedFunctions]) -> float:
    """Twice the highest line."""
    return TIMES_HIGHEST_LINE * max(float(f.freq_hz[-1]) for f in functions)


def _responses(metric: SymmetricMatrix, forces: sp.csc_array) -> Reals:
    """(n_free, f) static responses to unit forces."""
    if not forces.shape[1]:
        return np.zeros(forces.shape)
    return np.asarray(factorise(metric).solve(forces.toarray(order="F")))


def forces_of(functions: Sequence[ComparedFunctions]) -> sp.csc_array | None:
    """(n_free, f) unit forces at the inputs and at some outputs, each once; None without functions."""
    parts = [m for f in functions for m in (f.ports.inputs, f.ports.outputs.T[:, :MOST_OUTPUTS])]
    if not parts:
        return None
    together = sp.csc_array(sp.hstack(parts, format="csc")).toarray()
    return sp.csc_array(np.unique(np.where(_leading(together) < 0.0, -together, together), axis=1))


def _leading(columns: Reals) -> Reals:
    """The first entry of each column that is not zero."""
    return np.asarray(columns[np.argmax(columns != 0.0, axis=0), np.arange(columns.shape[1])])
