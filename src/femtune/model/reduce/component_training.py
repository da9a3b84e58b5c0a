"""Training of a basis of components on a box of the parameters: components are rebuilt at points chosen greedily.

At the point with the largest error estimate, fixed-interface modes and static shapes of the components whose matrices
differ there are added. Where they are not enough, the full model is solved, and the parts that its modes have in each
component are added; so are those of the first solution. These parts replace component modes that were not kept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.model.configured import ConfiguredModel
from femtune.model.eigen.solution import EigenSolution, solve_modes
from femtune.model.reduce.components import (
    ComponentBasis,
    Components,
    Division,
    Motions,
    component_basis,
    rebuilt,
    with_parts_of,
)
from femtune.model.reduce.estimate import ABOVE, ErrorEstimator, certified_error
from femtune.model.reduce.modes_in_basis import reduced_modes
from femtune.model.reduce.reduced_model import enlarge, reduce_model
from femtune.model.reduce.training import (
    TRIED,
    Certified,
    Solve,
    Trained,
    TrainingRules,
    TrainingStatus,
    base_and_moving,
    estimate,
    estimated,
    limit_of,
    points_of,
)


@dataclass(frozen=True, eq=False)
class ComponentTrainer:
    """Trains a model of components; its parameters are those of `Trainer`, with the same meaning.

    Parameters
    ----------
    division : the components of this configuration, from `divide`
    """

    configured: ConfiguredModel
    rules: TrainingRules
    components: Components
    division: Division
    rows: NDArray | None = None
    solve: Solve = field(default=lambda point, count, start: solve_modes(point, count, start=start))
    report: Callable[[Trained], None] = field(default=lambda trained: None)
    looking: Callable[[Trained, int], None] = field(default=lambda trained, estimated: None)
    base: Reals | None = None
    moving: NDArray[np.bool_] | None = None

    def start(self) -> Trained:
        """The components at `base`, with the parts of the full model's modes there.

        The error of the first point is that of the components without these parts.

        Raises
        ------
        FemtuneError : ``reduce.components-order``, ``reduce.component-loose``, ``eigen.*``
        """
        x, moving = base_and_moving(self.configured, self.base, self.moving)
        point = self.configured.at(x)
        solution = self.solve(point, self.rules.count, None)
        values = solution.eigenvalues[: solution.wanted]
        basis, parts = component_basis(point, self.division, self.components, float(solution.freq_hz[-1]))
        self._check_order(basis, parts)
        model = reduce_model(self.configured, basis, self.rows, solution.shift)
        error = float(certified_error(model, x, values).max(initial=0.0))
        motions = Motions(solution.shapes, solution.eigenvalues - solution.shift)
        basis, parts = with_parts_of(basis, parts, motions, self.rules.negligible)
        model = enlarge(model, basis, self.rows)
        first = Certified(x, values, np.nan, error, basis.shape[1])
        points = points_of(self.configured, self.rules, x, moving)
        metric = point.symmetric_stiffness.plus(-solution.shift, point.symmetric_mass)
        estimator = ErrorEstimator(metric, self.rules.count, known=solution.factor)
        trained = Trained(
            model=model,
            basis=basis,
            certified=(first,),
            points=points,
            estimates=np.full(len(points), np.inf),
            status=TrainingStatus.UNFINISHED,
            estimator=estimator,
            metric=metric,
            components=parts,
        )
        self.report(trained)
        return trained

    def _check_order(self, basis: Reals, parts: ComponentBasis) -> None:
        if basis.shape[1] > self.rules.order:
            sizes = {f"modes of {p.part.name}": f"{p.modes} up to {p.max_hz:.5g} Hz" for p in parts.parts}
            raise FemtuneError(
                "reduce.components-order",
                values={"interface DOFs": len(parts.interface), **sizes},
                configuration=self.configured.configuration.name,
                order=basis.shape[1],
                allowed=self.rules.order,
            )

    def train(self, trained: Trained) -> Trained:
        """Rebuild components at the worst candidate until the estimate is small at all of them, or a limit is reached.

        The full model is solved at a candidate where the rebuilt components do not reach the tolerance.
        """
        while True:
            limit = limit_of(trained, self.rules)
            enough = TRIED if limit is None else len(trained.points)
            trained, worst = estimated(trained, self.rules.tolerance, enough, self.looking)
            if trained.worst_estimate <= self.rules.tolerance:
                return replace(trained, status=TrainingStatus.CONVERGED)
            if limit is not None:
                return replace(trained, status=limit)
            x = trained.points[worst]
            trained = self._rebuilt(trained, x)
            left = estimate(trained, x)
            if left > self.rules.tolerance:
                solution = self.solve(self.configured.at(x), self.rules.count, None)
                trained, left = self.enriched(trained, x, solution), 0.0
            trained = replace(
                trained, estimates=np.where(np.arange(len(trained.points)) == worst, left, trained.estimates)
            )

    def _rebuilt(self, trained: Trained, x: Reals) -> Trained:
        """The components at another point."""
        assert trained.components is not None
        count, model = self.rules.count, trained.model
        modes = reduced_modes(model.at(x), count)
        some = slice(0, int((1.0 + ABOVE) * count))
        motions = Motions(trained.basis @ modes.shapes[:, some], modes.eigenvalues[some] - model.shift)
        basis, parts = rebuilt(trained.basis, trained.components, self.configured.at(x), motions, self.rules.negligible)
        return self._on(trained, basis, parts)

    def enriched(self, trained: Trained, x: Reals, solution: EigenSolution) -> Trained:
        """The basis with the parts that modes of the full model at `x` have in each component."""
        assert trained.components is not None
        values, before = solution.eigenvalues[: solution.wanted], estimate(trained, x)
        error = float(certified_error(trained.model, x, values).max(initial=0.0))
        motions = Motions(solution.shapes, solution.eigenvalues - trained.model.shift)
        basis, parts = with_parts_of(trained.basis, trained.components, motions, self.rules.negligible)
        point = Certified(np.asarray(x, float), values, before, error, basis.shape[1])
        trained = replace(self._on(trained, basis, parts), certified=(*trained.certified, point))
        self.report(trained)
        return trained

    def _on(self, trained: Trained, basis: Reals, parts: ComponentBasis) -> Trained:
        return replace(trained, model=enlarge(trained.model, basis, self.rows), basis=basis, components=parts)
