"""The live models of all configurations, for ranges of the parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.model.live import LiveModel, SecondBasis, Separated, live_model, second_basis, separated_terms
from femtune.model.live.basis import is_whole
from femtune.model.live.matrices import EXACT_BYTES, solved
from femtune.model.reduce import ReducedModel, reduced_modes
from femtune.steps.live.certificate import frequency_error
from femtune.steps.live.drawing import mass_points, translations
from femtune.steps.live.first import First, FirstModels, TooManyModesError, Work, forces_of, modes_up_to_lines
from femtune.steps.live.frfs import ComparedFunctions, compared_functions
from femtune.steps.live.of_case import LiveOfCase
from femtune.steps.live.points import Points
from femtune.steps.live.record import LiveConfiguration
from femtune.steps.live.reduced_mass import wants_reduced_mass

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.residuals import CaseState
    from femtune.steps.live.region import AllowedRegion, Box
    from femtune.steps.update.run import FoundParameters
    from femtune.study.progress import Progress
    from femtune.study.study import Study
    from femtune.updating import UpdateResult

MOST_ORDER = 165
"""Order up to which a page solves the model within 50 ms."""
MOST_BYTES = 3_500_000
"""Bytes of all matrices of a page, of which base64 makes a third more."""
_REGION_SNAPSHOTS = 24
"""Points of the region at which modes are taken for the second basis."""
_BOUNDS_SNAPSHOTS = 48
"""The same in the bounds, where modes change more."""
_ABOVE = 6
"""Modes above the wanted ones that are taken there: at other points they become some of these."""
_REGION_TARGET = 3e-5
"""Relative frequency error in the region at which the order is large enough: a third of what a page should keep."""
_BOUNDS_TARGET = 3e-4
"""The same in the bounds."""
_ORDERS = 1.25
"""Ratio of two orders that are tried one after the other."""


@dataclass(eq=False)
class Making:
    """Makes the live models of all configurations for ranges of the parameters."""

    study: Study
    found: FoundParameters
    region: AllowedRegion | None
    progress: Progress
    box: Box
    known: dict[str, First] = field(default_factory=dict)
    functions: dict[str, tuple[tuple[ComparedFunctions, ...], str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.work = Work(self.progress)
        self.first = FirstModels(self.found, self.work)

    @property
    def result(self) -> UpdateResult:
        return self.found.result

    @property
    def points(self) -> Points:
        """Those of the ranges as they are now."""
        return Points(self.region, self.box)

    @property
    def solutions(self) -> int:
        """Solutions of the full model so far."""
        return self.work.solutions

    def every(self, states: Sequence[CaseState]) -> tuple[list[LiveConfiguration] | str, dict[str, NDArray]]:
        """The records with their arrays, or why they cannot be made for these ranges."""
        out: list[LiveConfiguration] = []
        arrays: dict[str, NDArray] = {}
        for i, state in enumerate(states):
            self.progress.step(f"live model: {state.case.name}", i, len(states))
            one = self._configuration(i, state, arrays)
            if isinstance(one, str):
                return one, {}
            out.append(one)
        return out, arrays

    def _configuration(self, number: int, state: CaseState, arrays: dict[str, NDArray]) -> LiveConfiguration | str:
        configured, x = state.case.on_full_model.configured, np.asarray(self.result.x, float)
        count, name = state.solution.wanted, state.case.name
        try:
            groups = separated_terms(configured, x, ("stiffness", "mass"), self.box)
            if isinstance(groups, str):
                return groups
            if name not in self.known:
                case = next(c for c in (self.found.study or self.study).cases if c.name == name)
                self.functions[name] = compared_functions(self.study, case, state, x)
                carried = sp.csc_array(translations(mass_points(case, whole=False), case).T)
                try:
                    self.known[name] = self.first.of(
                        state, configured, count, self.functions[name][0], self.points, carried
                    )
                except TooManyModesError as error:
                    self.functions[name] = (), str(error)
                    self.known[name] = self.first.of(state, configured, count, (), self.points, carried)
            return self._made(state, self.known[name], groups, x, count, f"live/{number + 1}", arrays)
        except FemtuneError as error:
            return f"the model cannot be solved at all values of the parameters: {error.what}"
        except np.linalg.LinAlgError:
            return f"K − σM is not positive definite at some values of the parameters ({name})"

    def _made(
        self, state: CaseState, first: First, groups: Sequence[Separated], x: Reals, count: int, prefix: str,
        arrays: dict[str, NDArray],
    ) -> LiveConfiguration | str:  # fmt: skip
        whole = is_whole(first.model)
        near = [*self.points.in_region(0 if whole else _REGION_SNAPSHOTS, 1)]
        far = [*self.points.in_ranges(0 if whole else _BOUNDS_SNAPSHOTS, 1)]
        case = next(c for c in (self.found.study or self.study).cases if c.name == state.case.name)
        points, parts = mass_points(case, whole and first.basis is None), []
        if points and not whole:
            parts.append(sp.csc_array(translations(points, case).T))
        if (driven := forces_of(self.functions[case.name][0])) is not None:
            parts.append(driven)
        with_mass = wants_reduced_mass(self.study, state, first)
        if with_mass and not whole:
            parts.append(sp.csc_array(sp.csr_array(state.case.on_full_model.sensors).T))
        forces = first.seen(sp.csc_array(sp.hstack(parts, format="csc")) if parts else None)
        most = min(MOST_ORDER, first.model.order)
        up_to_lines = modes_up_to_lines(first.model, x, self.functions[case.name][0])
        basis = second_basis(first.model, x, far, count + _ABOVE, most, forces, near, up_to_lines)
        vectors, model = self._smallest(first, basis, groups, x, count)
        if not model.terms:
            return f"no parameter changes stiffness or mass ({state.case.name})"
        made = LiveOfCase(case, state, first, vectors, model, points, self.points, with_mass)
        problem = self.study.problem().residuals
        return made.record(self.result, problem, self.functions[case.name], self.work, prefix, arrays)

    def _smallest(
        self, first: First, basis: SecondBasis, groups: Sequence[Separated], x: Reals, count: int
    ) -> tuple[Reals, LiveModel]:
        """The live model of the lowest order whose errors at some points are small enough, else that of the smallest
        errors."""
        most = basis.vectors.shape[1]
        tried = [(_REGION_TARGET, self.points.in_region(6, 4)), (_BOUNDS_TARGET, self.points.in_ranges(8, 4))]
        whole, states = is_whole(first.model), max(1, len(self.result.after.states))
        some = [] if whole else [(target, p) for target, points in tried for p in points]
        wanted = [(t, p, full) for t, p in some if (full := _solved_first(first.model, p, count)) is not None]
        order, best = float(most if whole else min(basis.count + 8, most)), None
        while True:
            vectors = basis.leading(round(order))
            model = live_model(first.model, vectors, groups, x, count, EXACT_BYTES // states, box=self.box)
            if best is not None and sum(t.triangle.nbytes for t in model.terms) > MOST_BYTES // states:
                return best[1:]
            worst = max((_error(model, p, full) / t for t, p, full in wanted), default=0.0)
            # a larger model that no longer fits in single precision may be the less accurate one
            if best is None or worst < best[0]:
                best = worst, vectors, model
            if worst <= 1.0 or round(order) >= most:
                return best[1:]
            order = min(order * _ORDERS, float(most))


def _error(model: LiveModel, x: Reals, full: Reals) -> float:
    """Relative error of a frequency beside the eigenvalues of the first model; infinite without modes."""
    modes = solved(model, x)
    return np.inf if modes is None else frequency_error(modes.eigenvalues, full)


def _solved_first(model: ReducedModel, x: Reals, count: int) -> Reals | None:
    try:
        return reduced_modes(model.at(x), count).eigenvalues[:count]
    except FemtuneError:
        return None
