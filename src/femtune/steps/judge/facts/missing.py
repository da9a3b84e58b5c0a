"""Fields of the deck that no parameter represents: tested at the end of the update, the first ones refitted."""

from __future__ import annotations

from collections import Counter
from collections.abc import MutableMapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import FemtuneError
from femtune.judge.missing import ScoreTest, mode_that_asks, p_of_refit, score_test
from femtune.judge.refit import Refit, misfit, refitted
from femtune.judge.regions import mesh_of
from femtune.judge.supports import support_freed
from femtune.judge.whitened import Whitened, prior_blocks, whitened_blocks, whitened_values
from femtune.judge.widened import widened_end, widened_problem
from femtune.status import Status
from femtune.steps.judge.facts.tested_fields import (
    BoundedParameter,
    TestedField,
    TestedMass,
    bounded_parameters,
    name_of,
    tested_fields,
    tested_masses,
)
from femtune.steps.judge.facts.tested_supports import TestedSupport, tested_supports
from femtune.steps.judge.record.missing import MissingField, MissingResults, RefittedField
from femtune.steps.judge.record.parts import RESERVED, SHARE_OF_MISSING
from femtune.study.update_method import method_of
from femtune.units import force_unit, unit_system
from femtune.updating import update

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from femtune.arrays import Reals
    from femtune.fem import FieldRef
    from femtune.model import ParametricModel
    from femtune.residuals import Evaluation, ResidualBlock, UpdateProblem
    from femtune.steps.judge.facts.tested_fields import Tested

    Widening = TestedField | TestedMass | TestedSupport
    from femtune.steps.judge.finished_update import FinishedUpdate
    from femtune.study.progress import Progress
    from femtune.study.study import Study
    from femtune.updating import UpdateResult
    from femtune.updating.regularisation import SideConstraint

MOST_SHOWN = 8
"""Groups of fields in the record: beyond the first few, the order says little."""
MOST_REFITTED = 5
"""Groups that are refitted: a large error is extrapolated badly, and something near it may stand before it."""
MOST_DOFS = 250_000
"""Free DOFs of a model whose fields are tested: the test needs as much memory as an iteration with derivatives."""
MOST_DRAWN = 40_000
"""Elements of a mesh that is drawn: more are smaller than the dots of a printed page."""
REFITTED_FROM_DOFS = 10_000
"""Free DOFs from which one group is refitted only, since an iteration on a full model is expensive."""
_FIRST_ITERATIONS = 15
"""Iterations of the update before which the fields are to be known: most updates of small models take five."""
_FEWEST_SOLUTIONS = 20
"""Points that refits may solve together, even if the update took fewer iterations: they need no derivatives."""


def missing_fields(fit: FinishedUpdate) -> MissingResults:
    """The test of all fields, and the refit of the first ones if something is missing."""
    tested = _tested(fit.study, fit.result, fit.arrays, fit.progress)
    return tested if isinstance(tested, MissingResults) else tested.results(fit.study.file.update.look_further)


def fields_before_update(study: Study, at: Evaluation, progress: Progress) -> MissingResults:
    """The test of all fields where a first update from an evaluation ends, with refits of the first ones.

    No better minimum is looked for, which the whole update does. An update of a large model takes long and is left to
    it too.
    """
    if study.source.needs_runs or not study.source.has_elements:
        return MissingResults(reason="the model has no elements whose properties could be tested")
    sizes = [state.case.on_full_model.configured.n_free for state in at.states]
    if max(sizes, default=0) >= REFITTED_FROM_DOFS:
        return MissingResults(reason=f"the model has more than {REFITTED_FROM_DOFS} free DOFs; an update tests them")
    progress.step("update of the parameters", 0, None)
    method = method_of(study.file.update, study.parameters)
    most = min(method.max_iterations, _FIRST_ITERATIONS)
    result = update(study.problem(), replace(method, max_iterations=most, smallest_change=0.0), start=at)
    tested = _tested(study, result, None, progress)
    return tested if isinstance(tested, MissingResults) else tested.results(refit=True)


def _tested(
    study: Study, result: UpdateResult, arrays: MutableMapping[str, NDArray] | None, progress: Progress
) -> MissingResults | _Found:
    """The outcome of the test, or a record with the reason why there is none."""
    reason = _not_tested(study, result)
    if reason:
        return MissingResults(reason=reason)
    progress.step("fields that are no parameters", 0, None)
    fields, factors, left_out = tested_fields(study)
    try:
        masses = tested_masses(study, result, len(factors))
        supports, giving_way, couplings = tested_supports(study, result, len(factors) + len(masses))
        problem = widened_problem(
            result, study.model, factors, [m.mass for m in masses], giving_way, couplings
        )  # fmt: skip
        end = widened_end(result, problem)
    except FemtuneError as error:
        return MissingResults(reason=f"the model could not be extended by fields as parameters: {error.what}")
    record = _record(result, end)
    if record is None:
        return MissingResults(reason="no residual that can be tested has a known distribution")
    rows, columns, bounded = record
    of_factors: list[Widening] = [*fields, *masses, *supports]
    tested: list[Tested] = [*bounded_parameters(result), *of_factors]
    own = _own_fields(study.model, result)
    C = np.column_stack([bounded, *((0.0 if _is_own(f, own) else 1.0) * _column(columns, f) for f in of_factors)])
    test = score_test(rows, C, np.array([(-f.usual[0], f.usual[1]) for f in tested]).reshape(-1, 2))
    if test is None:
        return MissingResults(reason="too few degrees of freedom are left, or the parameters represent all fields")
    # the tests of one fit share its level
    test = replace(test, p=np.minimum(1.0, test.p / SHARE_OF_MISSING))
    return _Found(study, result, arrays, progress, problem, end, tested, test, rows, columns, left_out)


def _not_tested(study: Study, result: UpdateResult) -> str:
    if not study.source.has_elements:
        return "the model has no elements whose properties could be tested"
    if study.specimens is not None:
        return "the fields of several specimens are not tested"
    if not result.status.ok:
        return "the update did not end at an optimum"
    if result.status is Status.EXACT:
        return "all residuals are zero"
    sizes = [state.case.on_full_model.configured.n_free for state in result.after.states]
    if max(sizes, default=0) > MOST_DOFS:
        return f"the model has more than {MOST_DOFS} free DOFs"
    if not result.after.has_derivatives or not result.active:
        return "nothing was updated"
    if result.parameters is not study.model.parameters and result.parameters != study.model.parameters:
        return "the update has other parameters than the model"
    return ""


# ----------------------------------------------------------------------------------------------------
# The test.


def _record(result: UpdateResult, end: Evaluation) -> tuple[Whitened, Reals, Reals] | None:
    """Residuals and Jacobian by the parameters between their bounds, the columns of the factors, and those of the
    parameters at a bound."""
    k, parameters = len(result.x), end.states[0].case.configured.model.parameters
    names = np.array([p.name for p in parameters.free])
    is_field = np.arange(len(names)) < k
    moving, bound = np.isin(names, result.active) & is_field, np.isin(names, result.at_bound) & is_field
    blocks = (*end.weighted, *(_padded(b, len(names) - k) for b in prior_blocks(result)))
    if not blocks:
        return None
    rows = whitened_blocks(blocks, parameters, moving & ~bound, moving & bound)
    if "data" not in rows.roles:
        return None
    everything = whitened_blocks(blocks, parameters, ~is_field, moving & bound)
    spread = parameters.prior[1]
    return rows, everything.J / spread[~is_field], everything.bounded / spread[moving & bound]


def _own_fields(model: ParametricModel, result: UpdateResult) -> list[tuple[FieldRef, frozenset[int] | None]]:
    """Fields and elements that a parameter of the update sets and nothing else does.

    A prior or a bound may keep such a parameter from its value. That is a finding of its own, and no missing parameter.
    """
    several = Counter(a.parameter for a in model.assignments)
    return [
        (a.ref, a.elements) for a in model.assignments if a.parameter in result.active and several[a.parameter] == 1
    ]


def _is_own(field: Widening, own: Sequence[tuple[FieldRef, frozenset[int] | None]]) -> bool:
    if not isinstance(field, TestedField):
        return False
    ref = field.candidate.ref
    return (ref, field.elements) in own or (not field.place and (ref, None) in own)


def _column(columns: Reals, field: Widening) -> Reals:
    """(n,) derivatives of the residuals by the change of a field, relative to its unit."""
    return np.asarray(field.scale * columns[:, list(field.factors)].sum(axis=1))


def _padded(block: ResidualBlock, count: int) -> ResidualBlock:
    return replace(block, jacobian=np.hstack([block.jacobian, np.zeros((len(block.values), count))]))


@dataclass(frozen=True, eq=False)
class _Found:
    """The outcome of the test.

    Parameters
    ----------
    problem, end : the widened problem, and the end of the update there
    arrays : receives the drawing of the mesh; None without one
    fields : in the order of the columns of the test
    rows : the residuals that were tested
    columns : (n, factors) their derivatives by the factors
    """

    study: Study
    result: UpdateResult
    arrays: MutableMapping[str, NDArray] | None
    progress: Progress
    problem: UpdateProblem
    end: Evaluation
    fields: Sequence[Tested]
    test: ScoreTest
    rows: Whitened
    columns: Reals
    left_out: int

    def results(self, refit: bool) -> MissingResults:
        """The record, with the first groups refitted if that is wanted and something is suspected to be missing."""
        test, groups = self.test, self._groups()
        refits = self._refitted([g[0] for g in groups]) if refit and test.p.min() < RESERVED else {}
        # the lowest misfit decides between those that were refitted
        groups.sort(key=lambda g: refits[g[0]].chi_square if g[0] in refits else np.inf)
        corners, gain = self._drawing() if test.p.min() < RESERVED else (None, None)
        return MissingResults(
            tested=len(test.order),
            invisible=int(test.invisible.sum()),
            left_out=self.left_out,
            chi_square=float(np.sum(misfit(self.end, self._side) ** 2)),
            p_value=float(test.p.min()),
            fields=tuple(self._field(g, refits.get(g[0])) for g in groups[:MOST_SHOWN]),
            corners_key=corners,
            gain_key=gain,
        )

    def _groups(self) -> list[list[int]]:
        """Positions of the fields of each group, its first member first."""
        groups: dict[int, list[int]] = {}
        for i in self.test.order:
            groups.setdefault(int(self.test.group[i]), []).append(int(i))
        return list(groups.values())

    def _field(self, group: Sequence[int], refit: RefittedField | None) -> MissingField:
        test, i = self.test, group[0]
        field = self.fields[i]
        change, f = float(test.change[i]), float(test.f[i])
        share = float(np.clip(test.within[i] / max(test.gain[i], 1e-12), 0.0, 1.0))
        lower, upper = field.usual
        return MissingField(
            field=field.field, place=field.place, what=field.what,
            change_percent=100.0 * change if lower <= change <= upper else None,
            increase=change > 0.0, lower_percent=100.0 * lower, upper_percent=100.0 * upper,
            f=f, share=share, degrees_of_freedom=float(test.degrees[i]), p_value=float(test.p[i]),
            alike=tuple(name_of(self.fields[j]) for j in group[1:]), refit=refit, lines=field.lines,
            largest_mass=field.largest if isinstance(field, TestedMass) else None,
            mass_unit=self._mass_unit if isinstance(field, TestedMass) else "",
            points=field.points,
            stiffness=1.0 / field.scale if isinstance(field, TestedSupport) else None,
            stiffness_unit=self._stiffness_unit(field.component) if isinstance(field, TestedSupport) else "",
        )  # fmt: skip

    @property
    def _mass_unit(self) -> str:
        words = self.study.file.study.units.split("-")
        return words[1] if len(words) == 3 else ""

    def _stiffness_unit(self, component: int) -> str:
        units = unit_system(self.study.file.study.units)
        length, force = units.name.split("-", maxsplit=1)[0], force_unit(units)
        return f"{force}/{length}" if component <= 3 else f"{force} {length}/rad"

    def _drawing(self) -> tuple[str | None, str | None]:
        """Keys of the corners of the elements that fields were tested of, and of the largest gain by a usual change of
        their fields; None for a mesh that is too large for a drawing."""
        largest: dict[int, float] = {}
        for field, within in zip(self.fields, self.test.within):
            for element in field.elements:
                largest[element] = max(largest.get(element, 0.0), float(within))
        mesh = mesh_of(self.study.built.structure)
        shown = [e for e in sorted(largest) if e in mesh.row]
        if self.arrays is None or not 0 < len(shown) <= MOST_DRAWN:
            return None, None
        self.arrays[_CORNERS] = mesh.corners[[mesh.row[e] for e in shown]]
        self.arrays[_GAIN] = np.array([largest[e] for e in shown])
        return _CORNERS, _GAIN

    def _refitted(self, first: Sequence[int]) -> dict[int, RefittedField]:
        """Refits of the first groups."""
        result, out = self.result, dict[int, RefittedField]()
        large = any(s.case.on_full_model.configured.n_free >= REFITTED_FROM_DOFS for s in result.after.states)
        left = max(len(result.history) - 1, _FEWEST_SOLUTIONS)
        for i in first[: 1 if large else MOST_REFITTED]:
            field = self.fields[i]
            if isinstance(field, BoundedParameter):
                continue
            if left < 1:
                break
            self.progress.step(f"update with {name_of(field)} as a further parameter", 0, None)
            refit = self._refit(field, left)
            left -= refit.solutions
            out[i] = self._refitted_field(field, refit)
        return out

    @property
    def _side(self) -> SideConstraint | None:
        """The side constraint of the update; one that acts on the change of each iteration does not act at its end."""
        side = self.result.side
        return side if side.renewed is None else None

    def _refit(self, field: Widening, most: int) -> Refit:
        result, wide = self.result, self.end.states[0].case.configured.model.parameters
        moving = np.flatnonzero(np.isin([p.name for p in result.parameters.free], result.active))
        if isinstance(field, TestedSupport):
            problem, end = support_freed(result, self.study.model, field.support, field.scale)
            last = np.eye(len(end.x))[-1]
            return refitted(problem, end, self._side, moving, last, field.usual, most - 1)
        direction = np.zeros(len(wide.free))
        direction[len(result.x) + np.array(field.factors)] = 1.0
        return refitted(self.problem, self.end, self._side, moving, direction, field.usual, most)

    def _refitted_field(self, field: Widening, found: Refit) -> RefittedField:
        column = _column(self.columns, field)
        values = whitened_values((*found.evaluation.weighted, *prior_blocks(self.result, found.x)))
        p = most = None
        if len(values) == len(self.rows.r):
            most = mode_that_asks(self.rows, column, values)
            p = p_of_refit(self.rows, replace(self.rows, r=values, J=np.column_stack([self.rows.J, column])))
        sd = 1.0 / max(float(np.linalg.norm(self.rows.across(column))), np.finfo(float).tiny)
        base = 1.0 if isinstance(field, TestedField) else 0.0
        return RefittedField(
            factor=base + found.change, sd=None if found.at_bound else sd, at_bound=found.at_bound,
            converged=found.converged, iterations=found.iterations, chi_square=found.chi_square, p_value=p,
            mode=f"{most.mode} ({most.configuration})" if most else "", mode_before=most.before if most else None,
            mode_after=most.after if most else None, p_without_mode=most.p_without if most else None,
        )  # fmt: skip


_CORNERS = "judgement/missing_corners"
_GAIN = "judgement/missing_gain"
