"""Parameters of a study on a deck that was built: their initial values, bounds, and the fields that they set."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.errors import ErrorCollector, FemtuneError
from femtune.fem import ALL_MODES, MODAL, with_mode_ratios
from femtune.fem.fields import FACTORS
from femtune.files.damping_catalogue import look_up
from femtune.files.nastran.field_refs import BARS, WITHOUT_CARD, follows, parse_field_ref, resolve
from femtune.files.nastran.field_units import field_nature
from femtune.files.study_file import RegionTable, element_list
from femtune.files.study_file.kinds import field_reference
from femtune.model import Assignment
from femtune.model.imported.model import field_of_variable
from femtune.parameters import Parameter, ParameterSet, parse_expression
from femtune.study.error_places import errors_at
from femtune.study.model_source import model_source

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.errors import Where
    from femtune.fem.fields import FieldRef
    from femtune.files.built_model import BuiltModel
    from femtune.files.nastran.lists import IntegerList
    from femtune.files.study_file import (
        ComponentEntry,
        DistributionEntry,
        NearTable,
        PlanTable,
        StudyFile,
    )
    from femtune.files.study_file.parameter import Parameter as ParameterEntry


@dataclass(frozen=True)
class Target:
    """A parameter of the study, the fields that it changes, and the elements that it is limited to (None: no limit)."""

    entry: ParameterEntry
    where: Where
    refs: tuple[FieldRef, ...]
    elements: frozenset[int] | None


def targets(file: StudyFile, built: BuiltModel) -> tuple[Target, ...]:
    """The fields that each parameter changes; several problems are shown together.

    Raises
    ------
    FemtuneError : ``parameter.region``, ``parameter.touches-nothing``, ``parameter.derived-field``,
        ``study.unknown-field``, ``catalogue.*``
    """
    errors, parameter_targets = ErrorCollector(), []
    moves_fields = model_source(file).moves_fields
    for i, given in enumerate(file.parameter):
        with errors.catch():
            entry = _with_known(file, i, given)
            where = file.where("parameter", i)
            if not moves_fields:
                # factors and tied parameters are values for the runs, too
                value = entry.model_copy(update={"absolute": True})
                parameter_targets.append(Target(value, where, tuple(_of_runs(entry.name, built)), None))
                continue
            chosen = region_of(file, i, built)
            refs = [ref for text in entry.fields for ref in fields_of(text, built, chosen, where)]
            parameter_targets.append(Target(entry, where, tuple(dict.fromkeys(refs)), chosen))
    errors.raise_if_any()
    return tuple(parameter_targets)


def _of_runs(name: str, built: BuiltModel) -> list[FieldRef]:
    """The variable of a model of runs that has the name of the parameter; none if only ties use the parameter."""
    ref = field_of_variable(name)
    return [] if built.structure.values.index(ref) is None else [ref]


def _with_known(file: StudyFile, i: int, entry: ParameterEntry) -> ParameterEntry:
    """The parameter with mean and standard deviation of its prior from the catalogue that it names."""
    if entry.prior is None:
        return entry
    with errors_at(file.where("parameter", i, "prior")):
        known = look_up(file.path_of(entry.prior), entry.prior_name or entry.name)
    return entry.model_copy(update={"mean": known.value, "sd": known.sd})


def fields_of(text: str, built: BuiltModel, chosen: frozenset[int] | None, where: Where) -> list[FieldRef]:
    """The field of one card, or of all cards of a name that elements of the region use."""
    ref = field_reference(text)
    if ref.id or ref.card in ("PARAM", MODAL, *WITHOUT_CARD):
        ref = ref if ref.card in WITHOUT_CARD else parse_field_ref(text, where)
        resolve(built, ref, where)
        return [ref]
    parse_field_ref(f"{ref.card} 1 {ref.name}", where)
    fields = [r for r in _of_cards(ref, built) if _is_used(built, r, chosen)]
    for r in fields if ref.card in BARS else ():
        resolve(built, r, where)
    if not fields:
        raise FemtuneError(
            "parameter.touches-nothing/no-card",
            where=where,
            card=ref.card,
            field=ref.name,
            place="" if chosen is None else " in the region",
        )
    return fields


def _of_cards(ref: FieldRef, built: BuiltModel) -> list[FieldRef]:
    table = built.structure.values
    return [r for i, r in enumerate(table.refs) if (r.card, r.name) == (ref.card, ref.name) and not follows(built, i)]


def _is_used(built: BuiltModel, ref: FieldRef, chosen: frozenset[int] | None) -> bool:
    users = built.structure.users(built.structure.values.index(ref) or 0)
    return bool(users.size) if chosen is None else not chosen.isdisjoint(map(int, users))


def parameter_set(parameter_targets: Sequence[Target], built: BuiltModel) -> ParameterSet:
    """Parameters as the study describes them; several problems are shown together.

    Raises
    ------
    FemtuneError : ``parameter.*`` and ``tie.*``
    """
    errors, parameters = ErrorCollector(), []
    for target in parameter_targets:
        with errors.catch():
            parameters.append(_parameter(target, built))
    errors.raise_if_any()
    return ParameterSet(tuple(parameters))


def assignments(parameter_targets: Sequence[Target]) -> Iterable[Assignment]:
    """Which parameter sets which field, and for which elements."""
    for target in parameter_targets:
        for ref in target.refs:
            yield Assignment(target.entry.name, ref, not target.entry.absolute, target.elements)


def _parameter(target: Target, built: BuiltModel) -> Parameter:
    entry, where = target.entry, target.where
    if entry.tie is not None:
        return Parameter(entry.name, unit=entry.unit, tie=parse_expression(entry.tie, where), where=where)
    nominal = entry.nominal
    if nominal is None:
        nominal = _deck_value(target, built) if entry.absolute else 1.0
    _check_positive(target)
    lower = nominal if entry.lower is None else entry.lower
    upper = nominal if entry.upper is None else entry.upper
    if not entry.absolute:
        _check_factors(target, built, nominal, (lower, upper))
    positive = bool(target.refs) and all(field_nature(ref).positive for ref in target.refs)
    return Parameter(
        name=entry.name,
        nominal=nominal,
        lower=lower,
        upper=upper,
        unit=entry.unit,
        prior_mean=entry.mean,
        prior_sd=entry.sd,
        tie=None,
        where=where,
        positive=positive,
    )


LARGEST_FACTOR = 1e4
"""Upper bound over the initial value above which it may be a value of the field instead of a factor."""
VALUE_OVER_BOUND = (0.2, 1.0)
"""Range of the value in the deck over such a bound in which the bound is taken for a value of the field: bounds are
usually at most a few times the value."""


def _check_factors(target: Target, built: BuiltModel, nominal: float, bounds: tuple[float, float]) -> None:
    """Bounds of the field itself where factors are meant (error ``parameter.bounds``)."""
    table = built.structure.values
    values = np.abs([table.values[at] for ref in target.refs if (at := table.index(ref)) is not None])
    low, high = bounds
    if not values.size or not values.all() or not np.isfinite([low, high, nominal]).all():
        return
    value = float(values[0])
    outside = low <= high and not low <= nominal <= high and low <= value <= high
    large = high > LARGEST_FACTOR * abs(nominal) and VALUE_OVER_BOUND[0] <= value / high <= VALUE_OVER_BOUND[1]
    if outside or large:
        raise FemtuneError(
            "parameter.bounds/absolute-meant",
            where=target.where,
            values={"lower": low, "upper": high, "in the deck": value},
            parameter=target.entry.name,
            lower_factor=low / value if outside else low,
            upper_factor=high / value,
        )


def _check_positive(target: Target) -> None:
    """Refuse factors and eigenvalues that are not positive, with which the structure would fall apart."""
    for ref in target.refs:
        stiff = ref.card in FACTORS or (ref.card == "GENERIC" and ref.name.split()[-1].startswith("K"))
        if stiff and target.entry.lower is not None and target.entry.lower <= 0.0:
            raise FemtuneError(
                "parameter.not-positive",
                where=target.where,
                values={"lower": target.entry.lower},
                parameter=target.entry.name,
                field=ref,
            )


def _deck_value(target: Target, built: BuiltModel) -> float:
    table = built.structure.values
    values = np.array([table.values[table.index(ref) or 0] for ref in target.refs])
    if not len(values):
        raise FemtuneError("parameter.no-start", where=target.where, parameter=target.entry.name)
    if np.ptp(values) > 1e-12 * np.abs(values).max():
        raise FemtuneError(
            "parameter.absolute-differs",
            where=target.where,
            values={str(ref): float(v) for ref, v in zip(target.refs, values)},
            parameter=target.entry.name,
        )
    return float(values[0])


# ----------------------------------------------------------------------------------------------------
# The elements of a region of a parameter or component: by number, property, material, set, box, or nearness.


Numbers = frozenset[int]


@dataclass(frozen=True)
class _Asked:
    """A region as one parameter or component asks for it: `subject` is "parameter E"."""

    subject: str
    built: BuiltModel
    where: Where

    def error(self, code: str, **facts: Any) -> FemtuneError:
        """An error at the region."""
        return FemtuneError(code, where=self.where, subject=self.subject, **facts)


def region_of(file: StudyFile, i: int, built: BuiltModel) -> Numbers | None:
    """Elements that parameter i of a study is limited to; None if it is not limited.

    Raises
    ------
    FemtuneError : ``parameter.region`` for numbers that the deck does not have, and if no element is left
    """
    entry = file.parameter[i]
    return elements_of(file, ("parameter", i), entry, built, f"parameter {entry.name}")


def elements_of(
    file: StudyFile,
    place: tuple[str | int, ...],
    entry: ParameterEntry | ComponentEntry | PlanTable | DistributionEntry,
    built: BuiltModel,
    subject: str,
) -> Numbers | None:
    """Elements that satisfy `elements` and `region` of an entry of the study; None if it has neither.

    `subject` is what errors call the entry: "parameter E".
    """
    chosen = None
    if entry.elements is not None:
        chosen = _named(_Asked(subject, built, file.where(*place, "elements")), element_list(entry.elements))
    if entry.region is None:
        return chosen
    asked = _Asked(subject, built, file.where(*place, "region"))
    if entry.region == RegionTable():
        raise asked.error("parameter.region/no-condition")
    for condition in _conditions(asked, entry.region):
        chosen = condition if chosen is None else chosen & condition
    if not chosen:
        raise asked.error("parameter.region/no-element")
    return chosen


def _named(asked: _Asked, wanted: IntegerList) -> Numbers:
    known = asked.built.structure.element_kinds
    _known(asked, wanted, set(known), "number")
    return frozenset(wanted.among(known))


def _conditions(asked: _Asked, table: RegionTable) -> Iterable[Numbers]:
    if table.elements is not None:
        yield _named(asked, element_list(table.elements))
    if table.properties is not None:
        yield _with_property(asked, element_list(table.properties))
    if table.materials is not None:
        yield _with_material(asked, element_list(table.materials))
    if table.set is not None:
        yield _in_set(asked, table.set)
    if table.box is not None:
        yield _in_box(asked, np.array(table.box))
    if table.near is not None:
        yield _near(asked, table.near)


def _with_property(asked: _Asked, wanted: IntegerList) -> Numbers:
    owners = asked.built.property_of_elements
    _known(asked, wanted, set(owners.values()), "property")
    return frozenset(n for n, pid in owners.items() if pid in wanted)


def _with_material(asked: _Asked, wanted: IntegerList) -> Numbers:
    structure = asked.built.structure
    refs = {i: ref for i, ref in enumerate(structure.values.refs) if ref.card.startswith("MAT")}
    _known(asked, wanted, {ref.id for ref in refs.values()}, "material")
    users = [structure.users(i) for i, ref in refs.items() if ref.id in wanted]
    return frozenset(int(n) for at in users for n in at)


def _known(asked: _Asked, wanted: IntegerList, known: set[int], what: str) -> None:
    """Refuse a number that no element refers to, unless it is within a range."""
    unknown = sorted(set(wanted.singles) - known)
    if unknown:
        shown = ", ".join(map(str, sorted(known)[:10])) or "none"
        raise asked.error("parameter.region/unknown-number", attribute=what, unknown=unknown[0], shown=shown)


def _in_set(asked: _Asked, number: int) -> Numbers:
    sets = asked.built.sets
    if number not in sets:
        known = ", ".join(map(str, sorted(sets)[:10])) or "none"
        raise asked.error("parameter.region/unknown-set", number=number, known=known)
    return frozenset(sets[number].among(asked.built.structure.element_kinds))


def _in_box(asked: _Asked, corners: Reals) -> Numbers:
    numbers, centres = element_centres(asked.built)
    low, high = corners.min(axis=0), corners.max(axis=0)
    inside = ((centres >= low) & (centres <= high)).all(axis=1)
    return frozenset(map(int, numbers[inside]))


def _near(asked: _Asked, near: NearTable) -> Numbers:
    numbers, centres = element_centres(asked.built)
    # not squared, which overflows far away
    x, y, z = (centres - _place(asked, near)).T
    away = np.hypot(np.hypot(x, y), z)
    return frozenset(map(int, numbers[away <= near.distance]))


def _place(asked: _Asked, near: NearTable) -> Reals:
    given = [key for key in ("point", "node", "element") if getattr(near, key) is not None]
    if len(given) != 1:
        raise asked.error("parameter.region/near")
    nodes = asked.built.structure.nodes
    if near.point is not None:
        return np.array(near.point)
    if near.node is not None:
        if not nodes.has_grid(near.node):
            raise asked.error("parameter.region/unknown-grid-point", node=near.node)
        return nodes.xyz[nodes.position(near.node)]
    return _middle(asked, int(near.element or 0))


def _middle(asked: _Asked, element: int) -> Reals:
    """Mean of the grid points of an element or rigid element."""
    structure = asked.built.structure
    numbers, centres = element_centres(asked.built)
    if element in numbers:
        return np.asarray(centres[np.flatnonzero(numbers == element)[0]])
    rigid = structure.rigid.keep(structure.rigid.owner == element)
    at = np.unique(rigid.dof[rigid.dof < 6 * len(structure.nodes.ids)] // 6)
    if not at.size:
        raise asked.error("parameter.region/unknown-element", element=element)
    return np.asarray(structure.nodes.xyz[at].mean(axis=0))


def element_centres(built: BuiltModel) -> tuple[NDArray[np.int64], Reals]:
    """Numbers of the elements, (n,), and the means of their grid points, (n, 3); none for those on scalar points."""
    structure, numbers, centres = built.structure, [], []
    for batch in structure.batches:
        known = (batch.nodes >= 0) & (batch.nodes < len(structure.nodes.ids))
        some = known.any(axis=1)
        places = np.where(known[:, :, None], structure.nodes.xyz[np.where(known, batch.nodes, 0)], 0.0)
        numbers.append(batch.ids[some])
        centres.append((places.sum(axis=1) / np.maximum(known.sum(axis=1), 1)[:, None])[some])
    return np.concatenate([np.zeros(0, np.int64), *numbers]), np.concatenate([np.zeros((0, 3)), *centres])


# ----------------------------------------------------------------------------------------------------
# Damping ratios of modes as parameters: values of the model that no card of the deck states.


def with_parameters_of_modes(file: StudyFile, built: BuiltModel) -> BuiltModel:
    """The model with the damping ratios that parameters name (``MODAL 3 ZETA``, ``MODAL ZETA`` for all others).

    They start at the ratios of [response], if it has any.
    """
    numbers = [ref.id for ref in _named_ratio(file) if ref.card == MODAL]
    return _with(built, {number: _start(file, number) for number in sorted(set(numbers))})


def with_updated_ratios(built: BuiltModel, values: Mapping[FieldRef, float]) -> BuiltModel:
    """The model of an updated deck with the updated damping ratios of modes, which a deck cannot state."""
    return _with(built, {ref.id: value for ref, value in values.items() if ref.card == MODAL})


def _with(built: BuiltModel, ratios: Mapping[int, float]) -> BuiltModel:
    return replace(built, structure=with_mode_ratios(built.structure, ratios)) if ratios else built


def _named_ratio(file: StudyFile) -> list[FieldRef]:
    return [field_reference(text) for entry in file.parameter for text in entry.fields]


def _start(file: StudyFile, number: int) -> float:
    table = file.response
    if table is None:
        return 0.0
    if number != ALL_MODES and table.ratios is not None and number <= len(table.ratios):
        return table.ratios[number - 1]
    return table.ratio or 0.0
