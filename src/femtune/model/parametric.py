"""ParametricModel: a structure, its parameters, and the exact terms that follow."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.errors import ErrorCollector, FemtuneError
from femtune.fem import FieldRef, Structure
from femtune.fem.distribution import varied_entries
from femtune.fem.fields import MatrixKind
from femtune.fem.generic import check_untouched
from femtune.fem.offsets import check_spans, settled
from femtune.fem.values import TableJet
from femtune.model.imported.model import with_assembled
from femtune.model.over_frequency import FrequencyTable
from femtune.model.terms import CompiledTerms, KeptTerms, TermFunction, compile_terms
from femtune.parameters import ParameterSet
from femtune.parameters.jet import Jet, constant

SAMPLES = 6
"""Points of the parameters at which coefficients are compared; two analytic functions that agree at all are equal."""
SAMPLE_RANGE = 0.1
"""Largest distance of these points from the nominal one, in normalised parameters."""
VARIED_SAMPLES = 400
"""Points if values vary over elements: polynomials of many amplitudes are determined by more points."""
VARIED_SAMPLE_RANGE = 0.4
"""Largest distance of these points, which must be farther apart to determine the powers."""


@dataclass(frozen=True)
class Assignment:
    """A parameter sets a field: value = nominal·P where relative, else P.

    `elements` limits it to a region: these elements get their own copy of the field.
    """

    parameter: str
    ref: FieldRef
    relative: bool = True
    elements: frozenset[int] | None = None


@dataclass(frozen=True)
class ParametricModel:
    """K(p) = Σ a_i(p) K_i and M(p) = Σ b_i(p) M_i on all grid DOFs, with exact derivatives.

    `placed` holds, for each parameter, the positions of the value table that it sets and whether relatively; `used`
    says for each kind of matrix which entries of the table (n,) it needs. `names` has the names in `parameters` of
    those in `placed` and `assignments` that are called differently there. `tables` multiply entries by functions of
    frequency. `given` is the structure of which the model was made, before fields were split; `kept` has the terms.
    `shared` is the model whose matrices this one has, with its own parameters in their place; see `of_specimen`.
    """

    structure: Structure
    parameters: ParameterSet
    assignments: tuple[Assignment, ...]
    placed: tuple[tuple[str, int, bool], ...]
    kept: KeptTerms = field(repr=False)
    used: Mapping[MatrixKind, NDArray[np.bool_]] = field(default_factory=dict, repr=False)
    tables: tuple[FrequencyTable, ...] = ()
    given: Structure | None = field(default=None, repr=False)
    names: Mapping[str, str] = field(default_factory=dict)
    shared: ParametricModel | None = field(default=None, repr=False)

    @property
    def terms(self) -> tuple[TermFunction, ...]:
        """The terms; those that were released are compiled again."""
        return self.kept.every

    def release_terms(self) -> None:
        """Release the memory of the element matrices; existing configurations do not need them."""
        self.kept.release()

    def __reduce__(self) -> tuple[Any, ...]:
        """Another process makes the model again: the matrices are larger than the structure."""
        if self.shared is not None:
            return of_specimen, (self.shared, self.parameters, dict(self.names))
        return parametric_model, (self.given, self.parameters, self.assignments, self.tables)

    @cached_property
    def foreign(self) -> frozenset[str]:
        """Parameters that belong to other specimens and have no effect on this model."""
        if self.shared is None:
            return frozenset()
        of_specimen = {self.name_of(p.name) for p in self.shared.parameters.parameters}
        return frozenset(p.name for p in self.parameters.parameters if p.name not in of_specimen)

    def name_of(self, placed: str) -> str:
        """Name in `parameters` of a parameter of `placed` or of an assignment."""
        return self.names.get(placed, placed)

    def table(self, x: NDArray, factors: Sequence[float] = ()) -> TableJet:
        """The value table with derivatives by the normalised free parameters x.

        `factors` are the values of the tables over frequency; 1 where none are given.
        """
        return self._once("table", x, factors, lambda: (self.parameters.jets(x), len(self.parameters.free)))

    def values(self, x: NDArray, factors: Sequence[float] = ()) -> NDArray[np.float64]:
        """(n,) the value table without derivatives, which take most of the time if there are many parameters."""
        return np.asarray(self.table_of_values(x, factors).value)

    def table_of_values(self, x: NDArray, factors: Sequence[float] = ()) -> TableJet:
        """The same as jets of no variables."""
        return self._once(
            "values", x, factors, lambda: ({n: constant(v, 0) for n, v in self.parameters.values(x).items()}, 0)
        )

    @cached_property
    def _last(self) -> dict[str, tuple[tuple[bytes, tuple[float, ...]], TableJet]]:
        return {}

    def _once(
        self, what: str, x: NDArray, factors: Sequence[float], jets: Callable[[], tuple[Mapping[str, Jet], int]]
    ) -> TableJet:
        """The table, kept until another point is asked for: all configurations ask for the same one in turn."""
        key = np.asarray(x).tobytes(), tuple(factors)
        known = self._last.get(what)
        if known is None or known[0] != key:
            known = self._last[what] = key, self._table(*jets(), factors)
        return known[1]

    def _table(self, jets: Mapping[str, Jet], k: int, factors: Sequence[float]) -> TableJet:
        """The value table from the parameters with their derivatives by k variables."""
        nominal = self.structure.values.values
        assigned = [
            (at, jets[self.name_of(name)][None] * nominal[at] if relative else jets[self.name_of(name)])
            for name, relative, at in self._fields
        ]
        if factors:
            scale = np.ones(len(nominal))
            for at, factor in zip(self.tabled, factors):
                scale[at] *= factor
            assigned = [(at, (j if j.value.shape else j[None]) * scale[at]) for at, j in assigned]
            rest = self._only_tabled
            curved = min((j.n_curved for _, j in assigned), default=k)
            assigned.append((rest, constant(nominal[rest] * scale[rest], k, curved)))
        return self.structure.values.assign(assigned, k)

    def factors(self, freq_hz: float) -> tuple[float, ...]:
        """Values of the tables at a frequency."""
        return tuple(table.at(freq_hz)[0] for table in self.tables)

    def table_by_frequency(self, x: NDArray, freq_hz: float) -> TableJet:
        """The value table at a frequency with its derivative by the frequency, 1/Hz."""
        values = self.table(x, self.factors(freq_hz)).value
        # logarithmic derivatives of factors add up where several tables multiply an entry
        rates = np.zeros(len(values))
        for table, at in zip(self.tables, self.tabled):
            value, slope = table.at(freq_hz)
            rates[at] += slope / value
        changed = np.union1d([i for _, i, _ in self.placed], self._only_tabled).astype(np.int64)
        moved = Jet(values[changed], (values * rates)[changed, None], np.zeros((len(changed), 1, 1)))
        return self.structure.values.assign([(changed, moved)], 1)

    @cached_property
    def tabled(self) -> list[NDArray[np.int64]]:
        """Positions in the value table that each table over frequency multiplies."""
        refs = self.structure.values.refs
        return [np.array([i for i, ref in enumerate(refs) if t.multiplies(ref)], np.int64) for t in self.tables]

    @cached_property
    def _only_tabled(self) -> NDArray[np.int64]:
        """Those that no parameter sets."""
        every = np.unique(np.concatenate([np.zeros(0, np.int64), *self.tabled]))
        return np.setdiff1d(every, [i for _, i, _ in self.placed]).astype(np.int64)

    @cached_property
    def by_frequency(self) -> frozenset[MatrixKind]:
        """Kinds of matrices that depend on frequency."""
        reached = self.structure.values.dependents([int(i) for at in self.tabled for i in at])
        kinds = {kind for kind, flags in self.used.items() if flags[list(reached)].any()}
        # a loss factor of the whole structure multiplies its stiffness
        whole = not self.structure.damping.of_whole_model.isdisjoint(reached)
        follows = self.structure.damping.loss_factor is not None and "stiffness" in kinds
        return frozenset(kinds | ({"hysteretic"} if whole or follows else set()))

    @cached_property
    def _fields(self) -> list[tuple[str, bool, NDArray[np.int64]]]:
        """Positions that each parameter sets, absolute and relative apart."""
        groups: dict[tuple[str, bool], list[int]] = {}
        for name, i, relative in self.placed:
            groups.setdefault((name, relative), []).append(i)
        return [(name, relative, np.array(at)) for (name, relative), at in groups.items()]

    def field_values(self, x: NDArray) -> dict[FieldRef, float]:
        """Value of every field that a parameter sets."""
        values = self.table(np.asarray(x, dtype=float)).value
        return {self.structure.values.refs[i]: float(values[i]) for _, i, _ in self.placed}


def parametric_model(
    structure: Structure,
    parameters: ParameterSet,
    assignments: Iterable[Assignment],
    tables: Iterable[FrequencyTable] = (),
) -> ParametricModel:
    """Place the parameters in the value table and compile the terms.

    With `tables` over frequency, stiffness and damping are those of one frequency; see `ModelPoint.at_frequency`.

    Raises
    ------
    FemtuneError : ``parameter.unknown-field``, ``parameter.touches-nothing``, ``parameter.field-twice``,
        ``parameter.zero-nominal``, ``parameter.whole-model``, ``parameter.without-effect``; several are shown together;
        ``parameter.offset-axis``, ``parameter.offset-range``, ``generic.moved-elsewhere``, ``table.fields``
    """
    assignments, tables, given = tuple(assignments), tuple(tables), structure
    errors = ErrorCollector()
    with errors.catch():
        _check_regions(structure, parameters, assignments)
    # a value that a parameter sets does not follow from other values
    structure = replace(structure, values=structure.values.with_own(_own(structure, assignments, tables)))
    placed: dict[int, tuple[str, int, bool]] = {}
    for group in _by_field(assignments):
        together = _split_at_once(structure, group, placed)
        if together is not None:
            structure, positions = together
            placed |= {i: (a.parameter, i, a.relative) for a, i in zip(group, positions)}
            continue
        for assignment in group:
            with errors.catch():
                structure, position = _place(structure, parameters, assignment, placed)
                placed[position] = (assignment.parameter, position, assignment.relative)
    with errors.catch():
        _check_all_used(parameters, assignments)
    errors.raise_if_any()
    bare = ParametricModel(
        structure, parameters, assignments, tuple(placed.values()), KeptTerms((), tuple), tables=tables
    )
    _check_tables(bare)
    tabled = [int(i) for at in bare.tabled for i in at]
    touched, samples = structure.values.dependents([*placed, *tabled]), _samples(bare)
    check_untouched(structure, touched)
    structure = settled(structure, samples)
    check_spans(structure, _at_bounds(bare))

    def compiled_terms() -> CompiledTerms:
        return with_assembled(compile_terms(structure, touched, samples), structure, touched)

    compiled = compiled_terms()
    kept = KeptTerms(compiled.terms, lambda: compiled_terms().terms)
    _check_effect(structure, parameters, dict(zip(placed, assignments)), compiled)
    model = replace(bare, structure=structure, kept=kept, used=compiled.used, given=given)
    _check_tables_act(model)
    return model


def of_specimen(model: ParametricModel, parameters: ParameterSet, names: Mapping[str, str]) -> ParametricModel:
    """The same matrices with the parameters of one of several specimens.

    Parameters
    ----------
    parameters : those of all specimens; derivatives by what belongs to other specimens are zero
    names : what a parameter of `model` is called there, if its name is different
    """
    return replace(model, parameters=parameters, names=dict(names), shared=model)


def _own(structure: Structure, assignments: Sequence[Assignment], tables: Sequence[FrequencyTable]) -> list[FieldRef]:
    """Fields that parameters or tables set."""
    tabled = (ref for ref in structure.values.refs if any(t.multiplies(ref) for t in tables))
    return [*(a.ref for a in assignments), *tabled]


def _check_tables(model: ParametricModel) -> None:
    """Refuse fields that the model does not have, or that two tables multiply."""
    errors, refs = ErrorCollector(), model.structure.values.refs
    taken: set[FieldRef] = set()
    for table in model.tables:
        for name in table.fields:
            with errors.catch():
                if not any(replace(table, fields=(name,)).multiplies(ref) for ref in refs):
                    raise FemtuneError("table.fields", where=table.where, field=name)
                if name in taken:
                    raise FemtuneError("table.fields/twice", where=table.where, field=name)
                taken.add(name)
    errors.raise_if_any()


def _check_tables_act(model: ParametricModel) -> None:
    """Refuse tables that act on the mass, or on nothing."""
    for table, at in zip(model.tables, model.tabled):
        kinds = replace(model, tables=(table,)).by_frequency
        set_in_unit = [i for _, i, relative in model.placed if not relative]
        if not model.structure.values.values[np.setdiff1d(at, set_in_unit)].all():
            kinds = frozenset()
        if "mass" in kinds or not kinds:
            code = "table.fields/mass" if kinds else "table.fields/without-effect"
            raise FemtuneError(code, where=table.where, field=model.structure.values.refs[int(at[0])])


def _samples(model: ParametricModel) -> NDArray[np.float64]:
    """(SAMPLES, n) value tables at the nominal point and at random ones around it, the same ones every time.

    The bounds do not matter, so that the same matrices are split alike whatever they are. A point where a tie has no
    value is moved towards the nominal one, where all have.
    """
    random, n = np.random.default_rng(2026), len(model.parameters.free)
    count, width = (
        (VARIED_SAMPLES, VARIED_SAMPLE_RANGE) if varied_entries(model.structure.values) else (SAMPLES, SAMPLE_RANGE)
    )
    around = random.uniform(-width, width, (count - 1, n))
    tabled = random.uniform(1.0 - SAMPLE_RANGE, 1.0 + SAMPLE_RANGE, (count - 1, len(model.tables)))
    nominal = _sample(model, np.zeros(n))
    return np.array([nominal, *(_sample(model, x, tuple(f)) for x, f in zip(around, tabled))])


def _at_bounds(model: ParametricModel) -> Iterator[NDArray[np.float64]]:
    """Value tables (n,) with each parameter at a bound of its own, and with all of them at one."""
    n, bounds = len(model.parameters.free), model.parameters.bounds
    for bound in bounds if n else ():
        for x in (*np.diag(bound), bound):
            yield _sample(model, x)


def _sample(model: ParametricModel, x: NDArray[np.float64], factors: Sequence[float] = ()) -> NDArray[np.float64]:
    for _ in range(10):
        try:
            return model.values(x, factors)
        except FemtuneError:
            x = 0.5 * x
    return model.values(np.zeros_like(x), factors)


def _by_field(assignments: Sequence[Assignment]) -> Iterator[list[Assignment]]:
    """Each by itself, but disjoint regions of one field that follow each other together."""
    group, taken = list[Assignment](), frozenset[int]()
    for a in assignments:
        joins = group and a.ref == group[-1].ref and taken and a.elements and taken.isdisjoint(a.elements)
        if group and not joins:
            yield group
            group, taken = [], frozenset()
        group.append(a)
        taken |= a.elements or frozenset()
    if group:
        yield group


def _split_at_once(
    structure: Structure, group: Sequence[Assignment], placed: Container[int]
) -> tuple[Structure, list[int]] | None:
    """As `_place` one after the other for the regions of a field, of which the structure is split once.

    None where `_place` has to do it: for a single assignment, and for all that it refuses.
    """
    position = structure.values.index(group[0].ref)
    if len(group) < 2 or position is None or position in placed or position in structure.damping.of_whole_model:
        return None
    users = frozenset(structure.users(position).tolist())
    sets = [users & a.elements for a in group if a.elements]
    if not all(sets) or structure.values.values[position] == 0.0:
        return None
    # the last region keeps the entry itself if nothing else uses it
    last = frozenset.union(*sets) == users
    split = len(sets) - last
    structure, at = structure.split_sets(position, sets[:split], [a.parameter for a in group[:split]])
    return structure, [*at, *([position] if last else [])]


def _place(
    structure: Structure, parameters: ParameterSet, assignment: Assignment, placed: Container[int]
) -> tuple[Structure, int]:
    position = structure.values.index(assignment.ref)
    if position is None:
        raise _error("parameter.unknown-field", assignment, parameters)
    users = structure.users(position)
    chosen = users if assignment.elements is None else np.array([e for e in users if e in assignment.elements])
    if not chosen.size:
        raise _error("parameter.touches-nothing", assignment, parameters)
    if assignment.relative and structure.values.values[position] == 0.0:
        raise _error("parameter.zero-nominal", assignment, parameters)
    if chosen.size < users.size and position in structure.damping.of_whole_model:
        raise _error("parameter.whole-model", assignment, parameters)
    if chosen.size < users.size:
        structure = structure.split(position, chosen, assignment.parameter)
        position = len(structure.values.refs) - len(structure.values.dependents([position]))
    if position in placed:
        raise _error("parameter.field-twice", assignment, parameters)
    return structure, position


def _check_regions(structure: Structure, parameters: ParameterSet, assignments: tuple[Assignment, ...]) -> None:
    """Refuse regions of one field that overlap: an element has one value."""
    taken: dict[FieldRef, set[int]] = {}
    for assignment in assignments:
        position = structure.values.index(assignment.ref)
        if position is not None and assignment.elements is not None:
            mine = set(structure.users(position).tolist()) & assignment.elements
            if mine & taken.setdefault(assignment.ref, set()):
                raise _error("parameter.field-twice", assignment, parameters)
            taken[assignment.ref] |= mine


def _check_effect(
    structure: Structure, parameters: ParameterSet, placed: Mapping[int, Assignment], compiled: CompiledTerms
) -> None:
    """Refuse fields without effect where they are all that a parameter sets, or where their zero is the cause."""
    without = [i for i in placed if not _has_effect(structure, i, compiled)]
    acting = {a.parameter for i, a in placed.items() if i not in without}
    errors = ErrorCollector()
    for i in without:
        if structure.values.values[i] == 0.0 or placed[i].parameter not in acting:
            with errors.catch():
                raise _error("parameter.without-effect", placed[i], parameters)
    errors.raise_if_any()


def _has_effect(structure: Structure, index: int, compiled: CompiledTerms) -> bool:
    reached = structure.values.dependents([index])
    return not structure.damping.of_whole_model.isdisjoint(reached) or any(
        flags[list(reached)].any() for flags in compiled.used.values()
    )


def _error(code: str, assignment: Assignment, parameters: ParameterSet) -> FemtuneError:
    where = next((p.where for p in parameters.parameters if p.name == assignment.parameter), None)
    return FemtuneError(code, where=where, parameter=assignment.parameter, field=assignment.ref)


def _check_all_used(parameters: ParameterSet, assignments: tuple[Assignment, ...]) -> None:
    used = {a.parameter for a in assignments}
    used |= {name for p in parameters.parameters if p.tie for name in p.tie.names}
    for p in parameters.parameters:
        if p.name not in used:
            raise FemtuneError("parameter.touches-nothing/no-field", where=p.where, parameter=p.name)
