"""Supports that may give way, as candidates of the test of what is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from femtune.judge.point_masses import neighbourhoods
from femtune.judge.supports import Support, SupportRows, support_rows, supported_dofs
from femtune.model import EigenSolution
from femtune.model.derivatives.chosen import LARGE
from femtune.residuals.frequency import FrequencyResidual
from femtune.residuals.mac import MacResidual
from femtune.residuals.mass import CentreResidual, InertiaResidual, MassResidual
from femtune.residuals.pair import ByMode, OfModes
from femtune.residuals.shape import ShapeResidual

if TYPE_CHECKING:
    from femtune.arrays import Integers, Reals
    from femtune.residuals import ComparedCase
    from femtune.residuals.case import Residual
    from femtune.study.study import Study
    from femtune.updating import UpdateResult

LARGEST_DROP = 0.4
"""Part of an eigenvalue by which a compliance lowers the mode that feels it most, at most: a frequency that is 20 % too
high is noticed before an update."""
MOST_PLACES = 8
"""Neighbourhoods of supported grid points in one direction that are tested by themselves."""
_MOST_NAMED = 4
"""Grid points that are listed."""
_SERVED = frozenset(
    r.key for r in (FrequencyResidual, ShapeResidual, MacResidual, MassResidual, CentreResidual, InertiaResidual)
)
"""Kinds of residual that follow from modes or masses: the others take derivatives of matrices, and a compliance has
none."""


@dataclass(frozen=True)
class TestedSupport:
    """Supported DOFs in one direction with the same compliance; its change is relative to the largest plausible one.

    Parameters
    ----------
    component : 1 to 6
    points : numbers of the grid points
    centre : of them
    factors : positions in the widened model, a neighbourhood each
    scale : the largest plausible compliance of each DOF, in units of the deck: length/force or rad/(force·length)
    number : of the first element that the deck does not have
    """

    __test__ = False  # no test class

    support: Support
    component: int
    points: tuple[int, ...]
    centre: tuple[float, float, float]
    factors: tuple[int, ...]
    scale: float
    number: int

    field: ClassVar[str] = "support"
    what: ClassVar[str] = "support that is rigid in the deck"
    usual: ClassVar[tuple[float, float]] = (0.0, 1.0)
    elements: ClassVar[frozenset[int]] = frozenset()

    @property
    def place(self) -> str:
        """Direction and grid points."""
        some = ", ".join(map(str, self.points))
        if len(self.points) == 1:
            return f"at grid point {some} in DOF {self.component}"
        if len(self.points) <= _MOST_NAMED:
            return f"at grid points {some} in DOF {self.component}"
        near = ", ".join(f"{v:.3g}" for v in self.centre)
        return f"at {len(self.points)} grid points near ({near}) in DOF {self.component}"

    @property
    def lines(self) -> str:
        """Cards for the deck, and a [[parameter]] of the study."""
        numbers = range(self.number, self.number + len(self.points))
        stiffness = 4.0 / self.scale
        cards = [f"# CELAS2,{n},{stiffness:.4E},{p},{self.component}" for n, p in zip(numbers, self.points)]
        fields = ", ".join(f'"CELAS2 {n} K"' for n in numbers)
        return "\n".join([
            f"# cards for the deck, in which no SPC holds DOF {self.component} of these grid points:", *cards,
            "[[parameter]]", f'name = "support_{self.points[0]}_{self.component}"', f"fields = [{fields}]",
            "lower = 0.1", "upper = 10.0",
        ])  # fmt: skip


def tested_supports(
    study: Study, result: UpdateResult, first: int
) -> tuple[list[TestedSupport], list[Support], list[SupportRows]]:
    """Supports by direction, all of a direction together and by neighbourhoods; what the widened model has of them.

    None where other residuals than those of modes and masses are compared, and above 10,000 free DOFs.

    Parameters
    ----------
    first : position of the first one in the widened model
    """
    none = list[TestedSupport](), list[Support](), list[SupportRows]()
    states = result.after.states
    cases = [s.case.on_full_model for s in states]
    solutions = [s.solved for s in states if isinstance(s.solved, EigenSolution)]
    structure = study.model.structure
    plain = structure.preload is None and not study.model.tables and structure.nodes.has_coordinates
    if not plain or not all(map(_served, cases)) or max(c.configured.n_free for c in cases) >= LARGE:
        return none
    dofs = supported_dofs(structure, [c.configured.configuration for c in cases])
    if not len(dofs) or len(solutions) < len(states):
        return none
    rows = [support_rows(c.configured, dofs, result.x) for c in cases]
    felt = _felt(rows, solutions, dofs)
    dofs, felt = dofs[felt.any(axis=1)], felt[felt.any(axis=1)]
    number = 1 + max(structure.element_kinds, default=0)
    tested, atoms = list[TestedSupport](), list[Support]()

    def add(mine: Integers, factors: tuple[int, ...]) -> None:
        points = structure.nodes.ids[dofs[mine] // 6]
        x, y, z = map(float, structure.nodes.xyz[dofs[mine] // 6].mean(axis=0))
        scale = LARGEST_DROP / float(felt[mine].sum(axis=0).max())
        support = Support(f"s{factors[0]}_", tuple(map(int, dofs[mine])))
        component = 1 + int(dofs[mine[0]] % 6)
        place = tuple(int(p) for p in points)
        tested.append(TestedSupport(support, component, place, (x, y, z), factors, scale, number))

    for component in range(6):
        of_component = np.flatnonzero(dofs % 6 == component)
        groups = neighbourhoods(structure.nodes.xyz[dofs[of_component] // 6], MOST_PLACES)
        at = first + len(atoms)
        atoms += [Support(f"s{at + i}_", tuple(map(int, dofs[of_component[g]]))) for i, g in enumerate(groups)]
        if len(groups) > 1:
            add(of_component, tuple(range(at, at + len(groups))))
        for i, group in enumerate(groups):
            add(of_component[group], (at + i,))
    return (tested, atoms, rows) if tested else none


def _served(case: ComparedCase) -> bool:
    return all(part.key in _SERVED for r in case.residuals for part in _parts(r))


def _parts(r: Residual) -> Sequence[Residual]:
    if isinstance(r, ByMode):
        return r.parts
    return [r.residual] if isinstance(r, OfModes) else [r]


def _felt(rows: Sequence[SupportRows], solutions: Sequence[EigenSolution], dofs: Integers) -> Reals:
    """(s, m) part of each eigenvalue that a unit compliance of each DOF takes away, of the elastic modes."""
    out = []
    for own, solution in zip(rows, solutions):
        values = solution.eigenvalues[: solution.wanted]
        elastic = values > _RIGID * values.max(initial=0.0)
        part = np.zeros((len(dofs), int(elastic.sum())))
        forces = own.forces(solution)[:, : solution.wanted][:, elastic]
        part[np.searchsorted(dofs, own.dofs)] = forces**2 / values[elastic]
        out.append(part)
    felt = np.hstack(out)
    return np.where(felt > _RIGID * felt.max(initial=0.0), felt, 0.0)


_RIGID = 1e-12
"""Eigenvalue or effect relative to the largest that is rounding."""
