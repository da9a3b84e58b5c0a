"""Fields of the deck that no parameter represents: tested at the end of the update, the first ones refitted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import FemtuneError
from femtune.files.nastran.field_refs import resolve
from femtune.judge.missing import ScoreTest, p_of_refit, score_test
from femtune.judge.parts import TESTS_OF_A_FIT
from femtune.judge.refit import Refit, refitted
from femtune.judge.regions import mesh_of
from femtune.judge.whitened import Whitened, prior_blocks, whitened_blocks, whitened_values
from femtune.judge.widened import WideningFactor, widened_end, widened_problem
from femtune.status import Status
from femtune.steps.init.proposed_parameters import FieldCandidate, ProposalKind, candidates
from femtune.steps.judge.record.missing import MissingField, MissingResults, RefittedField
from femtune.steps.judge.record.parts import RESERVED

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.files.built_model import BuiltModel
    from femtune.judge.regions import Mesh
    from femtune.residuals import Evaluation, ResidualBlock, UpdateProblem
    from femtune.steps.judge.finished_update import FinishedUpdate
    from femtune.study.study import Study
    from femtune.updating import UpdateResult

MOST_FACTORS = 120
"""Factors of the widened model: its coefficients carry second derivatives, whose number grows as the square of it."""
MOST_SHOWN = 8
"""Groups of fields in the record: beyond the first few, the order says little."""
MOST_REFITTED = 3
"""Groups that are refitted: the culprit is among the first three in 95 % of wrong models."""
MOST_DOFS = 250_000
"""Free DOFs of a model whose fields are tested: the test needs as much memory as an iteration with derivatives."""
MOST_DRAWN = 40_000
"""Elements of a mesh that is drawn: more are smaller than the dots of a printed page."""
REFITTED_FROM_DOFS = 10_000
"""Free DOFs from which one group is refitted only, since an iteration on a full model is expensive."""
_FEWEST_SOLUTIONS = 12
"""Points that refits may solve together, even if the update took fewer iterations: they need no derivatives."""
_DEPTH = 2
"""How often a set of elements is divided: into halves, or pieces, and their halves."""

_INERTIA = ProposalKind("mass: moment of inertia", 0.7, 1.4)
_ADDED_MASS = ProposalKind("property: non-structural mass", 0.5, 2.0)
_AREA = ProposalKind("property: area", 0.9, 1.1)
_FURTHER = {
    **{("CONM2", name): _INERTIA for name in ("I11", "I22", "I33")},
    **{(card, "NSM"): _ADDED_MASS for card in ("PSHELL", "PCOMP", "PCOMPG", "PBAR", "PBARL", "PBEAM", "PROD", "PTUBE")},
    **{(card, "A"): _AREA for card in ("PBAR", "PBEAM", "PBCOMP", "PBEND")},
}
"""Fields that a first study does not propose, with their usual ranges."""


@dataclass(frozen=True)
class TestedField:
    """A field for some of the elements that use it, as the sum of factors of the widened model.

    Parameters
    ----------
    place : what the elements are; "" for all
    factors : positions
    region : the keys of [[parameter]] that choose them
    """

    __test__ = False  # no test class

    candidate: FieldCandidate
    elements: frozenset[int]
    place: str
    factors: tuple[int, ...] = ()
    region: str = ""


def missing_fields(fit: FinishedUpdate) -> MissingResults:
    """The test of all fields, and the refit of the first ones if something is missing."""
    reason = _not_tested(fit.study, fit.result)
    if reason:
        return MissingResults(reason=reason)
    study, result = fit.study, fit.result
    fit.progress.step("fields that are no parameters", 0, None)
    fields, factors, left_out = tested_fields(study)
    try:
        problem = widened_problem(result, study.model, factors)
        end = widened_end(result, problem)
    except FemtuneError as error:
        return MissingResults(reason=f"the model could not be extended by fields as parameters: {error.what}")
    record = _record(result, end)
    if record is None:
        return MissingResults(reason="no residual has a known distribution, or only FRFs are compared")
    rows, columns, bounded = record
    of_fields = np.array([columns[:, list(f.factors)].sum(axis=1) for f in fields]).reshape(len(fields), len(rows.r)).T
    at_bound = _bounded_fields(result)
    usual = [(1.0 - f.candidate.kind.lower, f.candidate.kind.upper - 1.0) for f in fields]
    plausible = np.array([*((b.room, b.room) for b in at_bound), *usual]).reshape(-1, 2)
    test = score_test(rows, np.hstack([bounded, of_fields]), plausible)
    if test is None:
        return MissingResults(reason="too few degrees of freedom are left, or the parameters represent all fields")
    # the tests of one fit share its level
    test = replace(test, p=np.minimum(1.0, TESTS_OF_A_FIT * test.p))
    return _Found(fit, problem, end, [*at_bound, *fields], test, rows, columns, left_out).results()


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
# Which fields are tested, and for which elements.


def tested_fields(study: Study) -> tuple[list[TestedField], list[WideningFactor], int]:
    """The fields that can be parameters, those that are parameters among them, since the test itself tells what the
    parameters represent; the factors that they are sums of; and how many fields are left out.

    A field of a material is also tested for each property, a field of many elements for the parts of its mesh (see
    `femtune.judge.regions`), as deep as there are not too many parts.
    """
    built = study.built
    mesh, known = mesh_of(built.structure), list(_candidates(built))
    for depth in range(_DEPTH, -1, -1):
        sets = [list(_sets(built, mesh, c, depth)) for c in known]
        parts = [_atoms([s for s, _, _ in of_one]) for of_one in sets]
        if sum(map(len, parts)) <= MOST_FACTORS:
            break
    left_out = 0
    while sum(map(len, parts)) > MOST_FACTORS:
        left_out += 1
        known, sets, parts = known[:-1], sets[:-1], parts[:-1]
    fields, factors = list[TestedField](), list[WideningFactor]()
    for candidate, of_one, atoms in zip(known, sets, parts):
        first, kind = len(factors), candidate.kind
        names = (f"q{first + i}_" for i in range(len(atoms)))
        factors += [WideningFactor(n, candidate.ref, atom, kind.lower, kind.upper) for n, atom in zip(names, atoms)]
        for elements, place, region in of_one:
            own = tuple(first + i for i, atom in enumerate(atoms) if atom <= elements)
            fields.append(TestedField(candidate, elements, place, own, region))
    return fields, factors, left_out


def _candidates(built: BuiltModel) -> Iterator[FieldCandidate]:
    yield from candidates(built)
    table = built.structure.values
    for ref, value in zip(table.refs, table.values):
        kind = _FURTHER.get((ref.card, ref.name))
        if kind is None or ref.region or not value or ref not in built.fields:
            continue
        try:
            resolve(built, ref)
        except FemtuneError:
            # what no element uses, or what follows from other fields
            continue
        yield FieldCandidate(ref, kind, float(value))


Part = tuple[frozenset[int], str, str]
"""Elements, what they are, and the keys of a [[parameter]] that choose them."""


def _sets(built: BuiltModel, mesh: Mesh, candidate: FieldCandidate, depth: int) -> Iterator[Part]:
    """The whole field first, then its elements by property, and the parts of these."""
    structure = built.structure
    whole = frozenset(int(n) for n in structure.users(structure.values.index(candidate.ref) or 0))
    yield whole, "", ""
    if len(whole) < 2:
        return
    owners = built.property_of_elements
    by_property: dict[int, set[int]] = {}
    for element in whole:
        by_property.setdefault(owners.get(element, 0), set()).add(element)
    for number, members in sorted(by_property.items()):
        own = frozenset(members)
        if own != whole and number:
            yield own, f"elements of property {number}", f"region = {{ properties = [{number}] }}"
        for part in mesh.divided(own, depth):
            at = mesh.centres[[mesh.row[e] for e in part]].mean(axis=0)
            near = ", ".join(f"{v:.3g}" for v in at)
            count = f"{len(part)} elements" if len(part) > 1 else f"element {min(part)}"
            yield part, f"{count} around ({near})", f'elements = "{_listed(sorted(part))}"'


def _atoms(sets: Sequence[frozenset[int]]) -> list[frozenset[int]]:
    """The largest sets of elements of which all sets are unions."""
    signature: dict[int, list[int]] = {}
    for i, members in enumerate(sets):
        for element in members:
            signature.setdefault(element, []).append(i)
    atoms: dict[tuple[int, ...], set[int]] = {}
    for element, where in signature.items():
        atoms.setdefault(tuple(where), set()).add(element)
    return [frozenset(members) for _, members in sorted(atoms.items(), key=lambda item: min(item[1]))]


def _listed(numbers: Sequence[int]) -> str:
    """Numbers with THRU for runs.

    Examples
    --------
    >>> _listed([1, 2, 3, 7, 9, 10])
    '1 THRU 3, 7, 9 THRU 10'
    """
    breaks = np.flatnonzero(np.diff(numbers) != 1) + 1
    runs = np.split(np.asarray(numbers), breaks)
    return ", ".join(f"{r[0]} THRU {r[-1]}" if len(r) > 1 else f"{r[0]}" for r in runs)


@dataclass(frozen=True)
class BoundedParameter:
    """A parameter that ended at a bound: what the residuals ask for may lie beyond it.

    `room` is the change from the nominal value to the bound, relative to the nominal one: as far again is plausible.
    """

    name: str
    room: float


def _bounded_fields(result: UpdateResult) -> list[BoundedParameter]:
    names = [p.name for p in result.parameters.free]
    room = np.abs(result.x)
    return [
        BoundedParameter(n, float(room[i]) or 1.0)
        for i, n in enumerate(names) if n in result.at_bound and n in result.active
    ]  # fmt: skip


# ----------------------------------------------------------------------------------------------------
# The test.


def _record(result: UpdateResult, end: Evaluation) -> tuple[Whitened, Reals, Reals] | None:
    """Residuals and Jacobian by the parameters between their bounds, the columns of the factors, and those of the
    parameters at a bound."""
    k, parameters = len(result.x), end.states[0].case.configured.model.parameters
    names = np.array([p.name for p in parameters.free])
    own = np.arange(len(names)) < k
    moving, bound = np.isin(names, result.active) & own, np.isin(names, result.at_bound) & own
    blocks = (*end.weighted, *(_padded(b, len(names) - k) for b in prior_blocks(result)))
    if not blocks:
        return None
    rows = whitened_blocks(blocks, parameters, moving & ~bound, moving & bound)
    if "data" not in rows.roles:
        return None
    everything = whitened_blocks(blocks, parameters, ~own, moving & bound)
    spread = parameters.prior[1]
    return rows, everything.J / spread[~own], everything.bounded / spread[moving & bound]


def _padded(block: ResidualBlock, count: int) -> ResidualBlock:
    return replace(block, jacobian=np.hstack([block.jacobian, np.zeros((len(block.values), count))]))


@dataclass(frozen=True, eq=False)
class _Found:
    """The outcome of the test.

    Parameters
    ----------
    problem, end : the widened problem, and the end of the update there
    fields : in the order of the columns of the test
    rows : the residuals that were tested
    columns : (n, factors) their derivatives by the factors
    """

    fit: FinishedUpdate
    problem: UpdateProblem
    end: Evaluation
    fields: Sequence[TestedField | BoundedParameter]
    test: ScoreTest
    rows: Whitened
    columns: Reals
    left_out: int

    def results(self) -> MissingResults:
        """The record, with the first groups refitted if something is suspected to be missing."""
        test, groups = self.test, self._groups()
        refits = self._refitted([g[0] for g in groups]) if test.p.min() < RESERVED else {}
        # the lowest misfit decides between those that were refitted
        groups.sort(key=lambda g: refits[g[0]].chi_square if g[0] in refits else np.inf)
        corners, gain = self._drawing() if test.p.min() < RESERVED else (None, None)
        return MissingResults(
            tested=len(test.order),
            invisible=int(test.invisible.sum()),
            left_out=self.left_out,
            chi_square=float(2.0 * self.fit.result.objective),
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
        if isinstance(field, TestedField):
            kind = field.candidate.kind
            name, place, what, lower, upper = (
                str(field.candidate.ref), field.place, kind.what, kind.lower - 1.0, kind.upper - 1.0
            )  # fmt: skip
        else:
            name, place, what, lower, upper = f"{field.name} beyond its bound", "", "parameter", -field.room, field.room
        return MissingField(
            field=name, place=place, what=what,
            change_percent=100.0 * change if lower <= change <= upper else None,
            increase=change > 0.0, lower_percent=100.0 * lower, upper_percent=100.0 * upper,
            f=f, share=share, degrees_of_freedom=float(test.degrees[i]), p_value=float(test.p[i]),
            alike=tuple(self._name(j) for j in group[1:]), refit=refit,
            lines=_lines(field) if isinstance(field, TestedField) else "",
        )  # fmt: skip

    def _name(self, i: int) -> str:
        field = self.fields[i]
        if isinstance(field, BoundedParameter):
            return f"{field.name} beyond its bound"
        return f"{field.candidate.ref}, {field.place}" if field.place else str(field.candidate.ref)

    def _drawing(self) -> tuple[str | None, str | None]:
        """Keys of the corners of the elements that fields were tested of, and of the largest gain by a usual change of
        their fields; None for a mesh that is too large for a drawing."""
        largest: dict[int, float] = {}
        for field, within in zip(self.fields, self.test.within):
            for element in field.elements if isinstance(field, TestedField) else ():
                largest[element] = max(largest.get(element, 0.0), float(within))
        mesh = mesh_of(self.fit.study.built.structure)
        shown = [e for e in sorted(largest) if e in mesh.row]
        if not 0 < len(shown) <= MOST_DRAWN:
            return None, None
        self.fit.arrays[_CORNERS] = mesh.corners[[mesh.row[e] for e in shown]]
        self.fit.arrays[_GAIN] = np.array([largest[e] for e in shown])
        return _CORNERS, _GAIN

    def _refitted(self, first: Sequence[int]) -> dict[int, RefittedField]:
        """Refits of the first groups."""
        result, out = self.fit.result, dict[int, RefittedField]()
        large = any(s.case.on_full_model.configured.n_free >= REFITTED_FROM_DOFS for s in result.after.states)
        left = max(len(result.history) - 1, _FEWEST_SOLUTIONS)
        for i in first[: 1 if large else MOST_REFITTED]:
            field = self.fields[i]
            if isinstance(field, BoundedParameter):
                continue
            if left < 1:
                break
            self.fit.progress.step(f"update with {self._name(i)} as a further parameter", 0, None)
            found = self._refit(field, left)
            left -= found.solutions
            out[i] = self._refitted_field(field, found)
        return out

    def _refit(self, field: TestedField, most: int) -> Refit:
        result, wide = self.fit.result, self.end.states[0].case.configured.model.parameters
        moving = np.flatnonzero(np.isin([p.name for p in result.parameters.free], result.active))
        kind, direction = field.candidate.kind, np.zeros(len(wide.free))
        direction[len(result.x) + np.array(field.factors)] = 1.0
        side = None if result.side.renewed is not None else result.side
        within = (kind.lower - 1.0, kind.upper - 1.0)
        return refitted(self.problem, self.end, side, moving, direction, within, most)

    def _refitted_field(self, field: TestedField, found: Refit) -> RefittedField:
        column = self.columns[:, list(field.factors)].sum(axis=1)
        values = whitened_values((*found.evaluation.weighted, *prior_blocks(self.fit.result, found.x)))
        p = None
        if len(values) == len(self.rows.r):
            p = p_of_refit(self.rows, replace(self.rows, r=values, J=np.column_stack([self.rows.J, column])))
        sd = 1.0 / max(float(np.linalg.norm(self.rows.across(column))), np.finfo(float).tiny)
        return RefittedField(
            factor=1.0 + found.change, sd=None if found.at_bound else sd, at_bound=found.at_bound,
            converged=found.converged, iterations=found.iterations, chi_square=found.chi_square, p_value=p,
        )  # fmt: skip


_CORNERS, _GAIN = "judgement/missing_corners", "judgement/missing_gain"


def _lines(field: TestedField) -> str:
    """A [[parameter]] of the study."""
    c = field.candidate
    name = c.name if not field.place else f"{c.name}_part_{min(field.elements)}"
    lines = ["[[parameter]]", f'name = "{name}"', f'fields = ["{c.ref}"]', *([field.region] if field.region else [])]
    return "\n".join([*lines, f"lower = {c.kind.lower:g}", f"upper = {c.kind.upper:g}"])
