"""Measured functions as FrfSets: which of them are FRFs, of which kind, on which lines."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError, Notice
from femtune.files.uff.function_records import MeasuredFunction, dof_of
from femtune.modal import FrfSet
from femtune.units import UnitSystem

_KINDS = {8: "receptance", 11: "mobility", 12: "accelerance"}
_FREQUENCY, _FORCE, _FRF, _UNKNOWN = 18, 13, 4, 0
_LENGTHS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "in": 0.0254, "ft": 0.3048}
_FORCES = {"n": 1.0, "mn": 1e-3, "kn": 1e3, "lbf": 4.4482216152605, "lb": 4.4482216152605}
_TOLERANCE = 1e-3

Pairs = dict[tuple[Dof, Dof], MeasuredFunction]


def frf_sets(
    functions: Sequence[MeasuredFunction], units: UnitSystem, source: str
) -> tuple[tuple[FrfSet, ...], tuple[Notice, ...]]:
    """The FRFs, one FrfSet for each kind and set of frequency lines, in the file's units.

    Raises
    ------
    FemtuneError : ``uff.duplicate-frf``; ``uff.units-contradict`` where a unit label contradicts `units`
    """
    groups: dict[tuple[object, ...], Pairs] = {}
    unused: dict[str, list[MeasuredFunction]] = {}
    untyped = []
    for function in functions:
        if why := _why_no_frf(function):
            unused.setdefault(why, []).append(function)
            continue
        _check_labels(function, units)
        untyped += [function] if function.header.function_type == _UNKNOWN else []
        _add(groups.setdefault(_group(function), {}), function)
    sets = tuple(_frf_set(str(key[0]), pairs, source) for key, pairs in groups.items())
    return sets, (*_unused(unused), *_untyped(untyped))


def _why_no_frf(function: MeasuredFunction) -> str:
    header = function.header
    abscissa, numerator, denominator = header.kinds
    if header.function_type not in (_FRF, _UNKNOWN):
        return f"of function type {header.function_type}, not an FRF"
    if abscissa != _FREQUENCY or not np.iscomplexobj(function.values):
        return "not complex functions of frequency"
    if numerator not in _KINDS or denominator != _FORCE:
        return f"not motion over force (data types {numerator} over {denominator})"
    if None in (dof_of(*header.response), dof_of(*header.reference)):
        return "without response or reference node"
    return ""


def _unused(unused: dict[str, list[MeasuredFunction]]) -> Iterable[Notice]:
    for why, functions in unused.items():
        what = f"{len(functions)} functions are {why}: kept as functions, not used as FRFs"
        yield Notice("uff.not-an-frf", what, functions[0].where)


def _untyped(functions: Sequence[MeasuredFunction]) -> Iterable[Notice]:
    if functions:
        what = f"{len(functions)} functions of motion over force are of the unknown type 0: taken as FRFs"
        yield Notice("uff.function-type", what, functions[0].where, "info")


def _group(function: MeasuredFunction) -> tuple[object, ...]:
    kind = _KINDS[function.header.kinds[1]]
    return kind, len(function.x), function.x.tobytes()


def _add(pairs: Pairs, function: MeasuredFunction) -> None:
    response, reference = dof_of(*function.header.response), dof_of(*function.header.reference)
    assert response is not None
    assert reference is not None
    first = pairs.setdefault((response, reference), function)
    if first is not function:
        raise FemtuneError(
            "uff.duplicate-frf",
            f"the FRF from {reference} to {response} stands twice",
            where=function.where,
            values={"first": first.where},
            hint="the file may hold several tests: export one",
        )


def _frf_set(kind: str, pairs: Pairs, source: str) -> FrfSet:
    responses = list(dict.fromkeys(response for response, _ in pairs))
    references = list(dict.fromkeys(reference for _, reference in pairs))
    lines = next(iter(pairs.values())).x
    values = np.full((len(responses), len(references), len(lines)), complex(np.nan, np.nan))
    for (response, reference), function in pairs.items():
        values[responses.index(response), references.index(reference)] = function.values
    return FrfSet(lines, values, DofSet(responses), DofSet(references), kind, source=source)


def _check_labels(function: MeasuredFunction, units: UnitSystem) -> None:
    """Unit labels such as m/s2 and N are words, but where they are understood they must not contradict."""
    _, motion, force = function.header.unit_labels
    length = _LENGTHS.get(motion.lower().split("/")[0].strip())
    if abs(function.header.response[1]) > 3:
        length = None
    _check_label(function, motion, length, units.length, "m")
    moment = abs(function.header.reference[1]) > 3
    _check_label(function, force, None if moment else _FORCES.get(force.lower().strip()), units.force, "N")
    if motion.lower().strip() == "g":
        _check_label(function, motion, 9.80665, units.length, "m")


def _check_label(function: MeasuredFunction, label: str, stated: float | None, used: float, unit: str) -> None:
    if stated is not None and abs(stated / used - 1) > _TOLERANCE:
        raise FemtuneError(
            "uff.units-contradict",
            f"the unit label '{label}' of a function contradicts the units of the file",
            where=function.where,
            values={"label means": f"{stated:g} {unit}", "units of the file": f"{used:g} {unit}"},
            hint="state the units that the numbers really are in (file_units), or correct the labels",
        )
