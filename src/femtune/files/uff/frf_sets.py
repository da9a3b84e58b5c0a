"""Measured functions as FrfSets: which of them are FRFs, of which kind and in which units, on which lines."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError, Notice, Where
from femtune.files.uff.function_units import StatedOfFunctions, in_hz, kinds_and_factors, says_motion
from femtune.files.uff.measured_functions import FREQUENCY, MeasuredFunction, dof_of
from femtune.modal import FrfSet
from femtune.units import UnitSystem

# function types of data set 58
_UNKNOWN = 0
_FRF = 4
_COHERENCE = 6
_FUNCTION_TYPES = {
    1: "time response", 2: "auto spectrum", 3: "cross spectrum", 5: "transmissibility", 6: "coherence",
    7: "auto correlation", 8: "cross correlation", 9: "power spectral density", 10: "energy spectral density",
    12: "spectrum",
}  # fmt: skip
"""Words for function types of data set 58 that are no FRFs."""
_MOTIONS = {8, 11, 12}
"""Specific data types of displacement, velocity and acceleration."""
_LARGEST_COHERENCE = 1.0 + 1e-3
"""Coherence above which a value is wrong; single precision and averaging leave values slightly above 1."""

Pairs = dict[tuple[Dof, Dof], NDArray[np.complex128]]
Coherences = dict[tuple[object, ...], NDArray]


def frf_sets(
    functions: Sequence[MeasuredFunction],
    units: UnitSystem,
    source: str,
    stated: StatedOfFunctions | None = None,
) -> tuple[tuple[FrfSet, ...], tuple[Notice, ...]]:
    """The FRFs, one FrfSet for each kind and set of frequency lines, in the file's units.

    Parameters
    ----------
    stated : what the user states about the functions, in place of the data types and unit labels of the file

    Raises
    ------
    FemtuneError : ``uff.duplicate-frf``; ``uff.kind-contradicts`` where data types and unit labels state two kinds
    """
    stated = stated or StatedOfFunctions()
    functions, of_axes = in_hz(functions)
    chosen: list[MeasuredFunction] = []
    unused: dict[str, list[MeasuredFunction]] = {}
    for function in functions:
        if _is_coherence(function):
            continue
        if why := _why_no_frf(function, stated):
            unused.setdefault(why, []).append(function)
        else:
            chosen.append(function)
    scales, of_units = kinds_and_factors(chosen, units, stated)
    groups: dict[tuple[object, ...], Pairs] = {}
    first: dict[tuple[object, ...], Where] = {}
    coherences = _coherences(functions)
    for function, scale in zip(chosen, scales):
        group = (scale.kind, len(function.x), function.x.tobytes())
        _add(group, groups.setdefault(group, {}), first, function, scale.factor)
    untyped = [one for one in chosen if one.header.function_type == _UNKNOWN]
    lines = [np.frombuffer(key[2]) for key in groups if isinstance(key[2], bytes)]
    made = [_frf_set(str(key[0]), x, pairs, source, coherences) for (key, pairs), x in zip(groups.items(), lines)]
    used = {_place(one) for one in chosen}
    alone = [one for one in functions if _is_coherence(one) and _place(one) not in used]
    undefined = [one for one, x in zip(made, lines) if len(one.freq_hz) < len(x)]
    about = (*_unused(unused), *_untyped(untyped), *_unused_coherence(alone), *_undefined(undefined, source))
    return tuple(made), (*of_axes, *of_units, *about)


def _is_coherence(function: MeasuredFunction) -> bool:
    """True for a coherence between two DOFs over frequency, with values from 0 to 1."""
    header, values = function.header, function.values
    places = dof_of(*header.response), dof_of(*header.reference)
    right = header.function_type == _COHERENCE and header.kinds[0] == FREQUENCY and None not in places
    return (
        right and not np.iscomplexobj(values) and bool((values >= 0.0).all() and (values <= _LARGEST_COHERENCE).all())
    )


def _coherences(functions: Sequence[MeasuredFunction]) -> Coherences:
    """By node and direction of response and reference, whatever their signs, and frequency lines."""
    return {_place(one): one.values for one in functions if _is_coherence(one)}


def _place(function: MeasuredFunction) -> tuple[object, ...]:
    (response, at), (reference, driven) = function.header.response, function.header.reference
    return response, abs(at), reference, abs(driven), function.x.tobytes()


def _why_no_frf(function: MeasuredFunction, stated: StatedOfFunctions) -> str:
    header = function.header
    _, numerator, denominator = header.kinds
    if header.function_type not in (_FRF, _UNKNOWN):
        name = _FUNCTION_TYPES.get(header.function_type)
        return f"of function type {header.function_type}{f' ({name})' if name else ''}, not an FRF"
    if header.kinds[0] != FREQUENCY or not np.iscomplexobj(function.values):
        return "not complex functions of frequency"
    if not says_motion(function, stated):
        both = {numerator, denominator} <= _MOTIONS
        word = "transmissibilities (motion over motion), " if both else ""
        return f"{word}not motion over force (data types {numerator} over {denominator})"
    if None in (dof_of(*header.response), dof_of(*header.reference)):
        return "without response or reference node"
    return ""


def _unused(unused: dict[str, list[MeasuredFunction]]) -> Iterable[Notice]:
    for why, functions in unused.items():
        yield Notice("uff.not-an-frf", where=functions[0].where, n_functions=len(functions), reason=why)


def _unused_coherence(functions: Sequence[MeasuredFunction]) -> Iterable[Notice]:
    if functions:
        yield Notice("uff.unused-coherence", where=functions[0].where, n_functions=len(functions))


def _untyped(functions: Sequence[MeasuredFunction]) -> Iterable[Notice]:
    if functions:
        yield Notice("uff.function-type", where=functions[0].where, level="info", n_functions=len(functions))


def _undefined(sets: Sequence[FrfSet], source: str) -> Iterable[Notice]:
    if sets:
        yield Notice("uff.undefined-at-zero", where=Where(source), level="info", n_sets=len(sets))


def _add(
    group: tuple[object, ...], pairs: Pairs, first: dict[tuple[object, ...], Where], function: MeasuredFunction,
    factor: float,
) -> None:  # fmt: skip
    response, reference = dof_of(*function.header.response), dof_of(*function.header.reference)
    assert response is not None
    assert reference is not None
    before = first.setdefault((*group, response, reference), function.where)
    if before is not function.where:
        raise FemtuneError(
            "uff.duplicate-frf",
            where=function.where,
            values={"first": before},
            reference=reference,
            response=response,
        )
    pairs[response, reference] = np.asarray(factor * function.values, dtype=complex)


def _frf_set(kind: str, lines: NDArray[np.float64], pairs: Pairs, source: str, coherences: Coherences) -> FrfSet:
    responses = list(dict.fromkeys(response for response, _ in pairs))
    references = list(dict.fromkeys(reference for _, reference in pairs))
    values = np.full((len(responses), len(references), len(lines)), complex(np.nan, np.nan))
    coherence = np.full(values.shape, np.nan)
    defined = np.ones(len(lines), dtype=bool)
    for (response, reference), functions in pairs.items():
        at = responses.index(response), references.index(reference)
        values[at] = functions
        defined &= np.isfinite(functions)
        place = (response.node, response.component, reference.node, reference.component, lines.tobytes())
        coherence[at] = np.minimum(coherences.get(place, coherence[at]), 1.0)
    some = coherence[:, :, defined] if np.isfinite(coherence).any() else None
    return FrfSet(lines[defined], values[:, :, defined], DofSet(responses), DofSet(references), kind, some, source)
