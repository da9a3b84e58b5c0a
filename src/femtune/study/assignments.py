"""Parameters of a study on a deck that was built: their start values, bounds, and the fields that they set."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from femtune.errors import ErrorCollector, FemtuneError, Where
from femtune.fem import MODAL
from femtune.fem.factors import FACTORS
from femtune.fem.values import FieldRef
from femtune.files.damping_catalogue import look_up
from femtune.files.nastran.build import BuiltModel
from femtune.files.nastran.field_refs import BARS, WITHOUT_CARD, parse_field_ref, resolve
from femtune.files.study_file import ParameterEntry, StudyFile
from femtune.files.study_file.kinds import field_reference
from femtune.model import Assignment
from femtune.parameters import Parameter, ParameterSet, parse_expression
from femtune.study.located import located
from femtune.study.regions import region_of


@dataclass(frozen=True)
class Target:
    """A parameter of the study, the fields that it moves, and the elements that it is limited to (None: no limit)."""

    entry: ParameterEntry
    where: Where
    refs: tuple[FieldRef, ...]
    elements: frozenset[int] | None


def targets(file: StudyFile, built: BuiltModel) -> tuple[Target, ...]:
    """What each parameter moves; several problems are shown together.

    Raises
    ------
    FemtuneError : ``parameter.region``, ``parameter.touches-nothing``, ``parameter.derived-field``,
        ``study.unknown-field``, ``catalogue.*``
    """
    errors, found = ErrorCollector(), []
    for i, given in enumerate(file.parameter):
        with errors.catch():
            entry = _with_known(file, i, given)
            where, chosen = file.where("parameter", i), region_of(file, i, built)
            refs = [ref for text in entry.fields for ref in _fields(text, built, chosen, where)]
            found.append(Target(entry, where, tuple(dict.fromkeys(refs)), chosen))
    errors.raise_if_any()
    return tuple(found)


def _with_known(file: StudyFile, i: int, entry: ParameterEntry) -> ParameterEntry:
    """The parameter with mean and standard deviation of its prior from the catalogue that it names."""
    if entry.prior is None:
        return entry
    with located(file.where("parameter", i, "prior")):
        known = look_up(file.path_of(entry.prior), entry.prior_name or entry.name)
    return entry.model_copy(update={"mean": known.value, "sd": known.sd})


def _fields(text: str, built: BuiltModel, chosen: frozenset[int] | None, where: Where) -> list[FieldRef]:
    """The field of one card, or of all cards of a name that elements of the region use."""
    ref = field_reference(text)
    if ref.id or ref.card in ("PARAM", MODAL, *WITHOUT_CARD):
        ref = ref if ref.card in WITHOUT_CARD else parse_field_ref(text, where)
        resolve(built, ref, where)
        return [ref]
    parse_field_ref(f"{ref.card} 1 {ref.name}", where)
    found = [r for r in _of_cards(ref, built) if _is_used(built, r, chosen)]
    for r in found if ref.card in BARS else ():
        resolve(built, r, where)
    if not found:
        raise FemtuneError(
            "parameter.touches-nothing",
            f"no {ref.card} card with a field {ref.name} of its own is used" + ("" if chosen is None else " there"),
            where=where,
            hint="check the field and the elements of the region",
        )
    return found


def _of_cards(ref: FieldRef, built: BuiltModel) -> list[FieldRef]:
    table = built.structure.values
    return [r for i, r in enumerate(table.refs) if (r.card, r.name) == (ref.card, ref.name) and not table.is_derived(i)]


def _is_used(built: BuiltModel, ref: FieldRef, chosen: frozenset[int] | None) -> bool:
    users = built.structure.users(built.structure.values.index(ref) or 0)
    return bool(users.size) if chosen is None else not chosen.isdisjoint(map(int, users))


def parameter_set(found: Sequence[Target], built: BuiltModel) -> ParameterSet:
    """Parameters as the study describes them; several problems are shown together.

    Raises
    ------
    FemtuneError : ``parameter.*`` and ``tie.*``
    """
    errors, parameters = ErrorCollector(), []
    for target in found:
        with errors.catch():
            parameters.append(_parameter(target, built))
    errors.raise_if_any()
    return ParameterSet(tuple(parameters))


def assignments(found: Sequence[Target]) -> Iterable[Assignment]:
    """Which parameter sets which field, and for which elements."""
    for target in found:
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
    return Parameter(entry.name, nominal, lower, upper, entry.unit, entry.mean, entry.sd, None, where)


def _check_positive(target: Target) -> None:
    """Refuse factors and eigenvalues of zero or below, with which a part of the structure would fall off."""
    for ref in target.refs:
        stiff = ref.card in FACTORS or (ref.card == "GENERIC" and ref.name.split()[-1].startswith("K"))
        if stiff and target.entry.lower is not None and target.entry.lower <= 0.0:
            raise FemtuneError(
                "parameter.not-positive",
                f"parameter {target.entry.name}: {ref} may fall to zero or below",
                where=target.where,
                values={"lower": target.entry.lower},
                hint="give a lower bound above zero; elements that are not there are switched off by elements_off",
            )


def _deck_value(target: Target, built: BuiltModel) -> float:
    table = built.structure.values
    values = np.array([table.values[table.index(ref) or 0] for ref in target.refs])
    if not len(values):
        raise FemtuneError(
            "parameter.no-start",
            f"parameter {target.entry.name}: it has no field whose value could be its start value",
            where=target.where,
            hint="give nominal, or leave absolute = true out so that it starts at 1",
        )
    if np.ptp(values) > 1e-12 * np.abs(values).max():
        raise FemtuneError(
            "parameter.absolute-differs",
            f"parameter {target.entry.name}: its fields hold different values, so there is no start value",
            where=target.where,
            values={str(ref): float(v) for ref, v in zip(target.refs, values)},
            hint="give nominal, or use factors (absolute = false)",
        )
    return float(values[0])
