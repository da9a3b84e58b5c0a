"""Kind and units of measured functions: what data types and unit labels of data set 58 say, and which of them count.

By the definition of the format, values are in the units of data set 164, and labels are words. Programs write values in
the units of their labels as well (g, µm, kgf), so a label that is understood counts: values are converted from it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from femtune.errors import FemtuneError, Notice
from femtune.files.uff.measured_functions import FREQUENCY, MeasuredFunction
from femtune.modal.frf_set import KINDS, inward_power
from femtune.unit_labels import Dimension, frequency_factor, meanings, says_nothing
from femtune.units import UnitSystem

_KINDS = {8: "receptance", 11: "mobility", 12: "accelerance"}
"""Kinds by the specific data type of the numerator."""
_FORCE = 13
"""Specific data type of a force."""
_ANY = (0, 1)
"""Specific data types that say nothing: unknown, general."""
_UNIT_TOLERANCE = 1e-3
"""Relative difference up to which two units are the same: files round factors to four digits and more."""
_ROTATIONS_FROM = 4
"""First direction of a rotation or moment."""
_CLEAR = 0.95
"""Share of the power that flows in at a driving point, at least, if the kind of the functions is right."""
_UNCLEAR = 0.85
"""The same, at most, if it is wrong."""


@dataclass(frozen=True)
class StatedOfFunctions:
    """What the user states about the functions of a file: kind, and factor in place of unit labels; None if nothing."""

    kind: str | None = None
    factor: float | None = None


@dataclass(frozen=True)
class Scale:
    """Kind of a function, and the factor that turns its values into the units of the file."""

    kind: str
    factor: float


def in_hz(functions: Sequence[MeasuredFunction]) -> tuple[list[MeasuredFunction], tuple[Notice, ...]]:
    """The functions with their frequencies in Hz, and notices about the units of frequency axes."""
    out = []
    converted: dict[str, list[MeasuredFunction]] = {}
    unknown: dict[str, list[MeasuredFunction]] = {}
    for stored in functions:
        function, label = stored, _label_of_axis(stored)
        factor = frequency_factor(label)
        if stored.header.kinds[0] in _ANY and factor is not None:
            kinds = (FREQUENCY, *stored.header.kinds[1:])
            function = replace(stored, header=replace(stored.header, kinds=kinds))
        if function.header.kinds[0] != FREQUENCY:
            out.append(function)
        elif factor is None:
            unknown.setdefault(label, []).extend([] if says_nothing(label) else [function])
            out.append(function)
        else:
            converted.setdefault(label, []).extend([function] if factor != 1.0 else [])
            out.append(replace(function, x=factor * function.x) if factor != 1.0 else function)
    notices = [
        *(_notice("uff.unit-label/frequency", label, of) for label, of in converted.items() if of),
        *(_notice("uff.unit-label/unknown", label, of) for label, of in unknown.items() if of),
    ]
    return out, tuple(notices)


def _label_of_axis(function: MeasuredFunction) -> str:
    """The unit label of the abscissa, or what stands in brackets in its name."""
    label, name = function.header.unit_labels[0], function.header.axis_labels[0]
    if says_nothing(label) and "[" in name:
        return name.partition("[")[2].partition("]")[0]
    if says_nothing(label) and "(" in name:
        return name.partition("(")[2].partition(")")[0]
    return label


def _notice(code: str, label: str, functions: Sequence[MeasuredFunction], **facts: Any) -> Notice:
    return Notice(code, where=functions[0].where, label=label, n_functions=len(functions), **facts)


def says_motion(function: MeasuredFunction, stated: StatedOfFunctions) -> bool:
    """Whether a function is motion over force by its data types, by its labels or by what the user states."""
    _, numerator, denominator = function.header.kinds
    if denominator not in (_FORCE, *_ANY):
        return False
    if denominator == _FORCE and numerator in _KINDS:
        return True
    if numerator not in (*_KINDS, *_ANY):
        return False
    return stated.kind is not None or _of_labels(function).kind is not None


@dataclass(frozen=True)
class _Labels:
    """What the labels of a function say: kind, and size of one unit of motion and load, or of their ratio, in SI units.

    `text` is the label of the motion, `unknown` a label that is not understood.
    """

    kind: str | None = None
    motion: float | None = None
    load: float | None = None
    ratio: float | None = None
    unknown: str = ""
    text: str = ""


def _of_labels(function: MeasuredFunction) -> _Labels:
    _, above, below = function.header.unit_labels
    motion: Dimension = (0, 0, 0) if abs(function.header.response[1]) >= _ROTATIONS_FROM else (1, 0, 0)
    load: Dimension = (1, 1, 0) if abs(function.header.reference[1]) >= _ROTATIONS_FROM else (0, 1, 0)
    lower = next((one for one in meanings(below) if one.dimension == load), None)
    force = None if lower is None else lower.factor
    unknown = below if force is None and not says_nothing(below) else ""
    for upper in meanings(above):
        for power, kind in enumerate(KINDS):
            of_motion = (motion[0], motion[1], motion[2] - power)
            if upper.dimension == of_motion:
                return _Labels(kind, upper.factor, force, None, unknown, above)
            # of a whole ratio the label of the denominator is a repetition
            if upper.dimension == (of_motion[0] - load[0], of_motion[1] - load[1], of_motion[2] - load[2]):
                return _Labels(kind, None, None, upper.factor, "", above)
    return _Labels(None, None, force, None, unknown if says_nothing(above) else above, above)


def kinds_and_factors(
    functions: Sequence[MeasuredFunction], units: UnitSystem, stated: StatedOfFunctions
) -> tuple[list[Scale], tuple[Notice, ...]]:
    """Kind and factor of each function, and what labels changed or could not say.

    Raises
    ------
    FemtuneError : ``uff.kind-contradicts``
    """
    labels = [_of_labels(one) for one in functions]
    types = [_KINDS.get(one.header.kinds[1]) for one in functions]
    torn = [i for i, (own, kind) in enumerate(zip(labels, types)) if own.kind and kind and own.kind != kind]
    decided = {} if stated.kind or not torn else _decided(functions, labels, types, torn)
    scales: list[Scale] = []
    converted: dict[tuple[str, str, str], list[int]] = {}
    unknown: dict[str, list[MeasuredFunction]] = {}
    for i, (function, own) in enumerate(zip(functions, labels)):
        kind = stated.kind or decided.get(i) or types[i] or own.kind
        assert kind is not None
        if stated.factor is not None:
            scales.append(Scale(kind, stated.factor))
            continue
        factor = _factor(function, own if own.kind in (kind, None) else _Labels(load=own.load), units)
        scales.append(Scale(kind, factor))
        if own.unknown:
            unknown.setdefault(own.unknown, []).append(function)
        if factor != 1.0:
            below = function.header.unit_labels[2] if own.ratio is None and own.load is not None else ""
            shown = " over ".join(text for text in (own.text, below) if not says_nothing(text))
            converted.setdefault((shown, kind, f"{factor:.6g}"), []).append(i)
    notices = [
        *(
            _notice("uff.unit-label", label, [functions[i] for i in of], kind=kind, factor=factor, units=units.name)
            for (label, kind, factor), of in converted.items()
        ),
        *(_notice("uff.unit-label/unknown", label, of) for label, of in unknown.items()),
        *_decided_notice(functions, labels, types, decided),
    ]
    return scales, tuple(notices)


def _factor(function: MeasuredFunction, labels: _Labels, units: UnitSystem) -> float:
    """Units of the file in one unit of the labels; 1 where they are the same to the digits of data set 164."""
    motion = 1.0 if abs(function.header.response[1]) >= _ROTATIONS_FROM else units.length
    load = units.force * (units.length if abs(function.header.reference[1]) >= _ROTATIONS_FROM else 1.0)
    if labels.ratio is not None:
        factor = labels.ratio * load / motion
    else:
        factor = (motion if labels.motion is None else labels.motion) / motion
        factor /= (load if labels.load is None else labels.load) / load
    return 1.0 if abs(factor - 1.0) <= _UNIT_TOLERANCE else factor


def _decided(
    functions: Sequence[MeasuredFunction], labels: Sequence[_Labels], types: Sequence[str | None], torn: Sequence[int]
) -> dict[int, str]:
    """The kinds of functions whose data types and labels state two: power flows into the structure at driving points.

    Raises
    ------
    FemtuneError : ``uff.kind-contradicts`` where there are no driving points, or they do not tell
    """
    out: dict[int, str] = {}
    for pair in dict.fromkeys((types[i], labels[i].kind) for i in torn):
        of_pair = [i for i in torn if (types[i], labels[i].kind) == pair]
        shares = {str(kind): _inward(functions, of_pair, str(kind)) for kind in pair}
        best = max(shares, key=lambda kind: shares[kind])
        if not (shares[best] >= _CLEAR and min(shares.values()) <= _UNCLEAR):
            first = functions[of_pair[0]]
            raise FemtuneError(
                "uff.kind-contradicts",
                where=first.where,
                values={"functions": len(of_pair)},
                data_type=first.header.kinds[1],
                of_type=pair[0],
                label=labels[of_pair[0]].text,
                of_label=pair[1],
            )
        out |= dict.fromkeys(of_pair, best)
    return out


def _inward(functions: Sequence[MeasuredFunction], positions: Iterable[int], kind: str) -> float:
    """Least share of the power that flows in at a driving point, 0 without one."""
    shares = []
    for function in (functions[i] for i in positions):
        (response, at), (reference, driven) = function.header.response, function.header.reference
        if response != reference or abs(at) != abs(driven):
            continue
        used = np.isfinite(function.values) & (function.x > 0.0)
        i_omega = 2j * np.pi * function.x[used]
        mobility = np.sign(at * driven) * function.values[used] * i_omega ** (1 - KINDS.index(kind))
        shares.append(inward_power(mobility))
    return min(shares, default=0.0)


def _decided_notice(
    functions: Sequence[MeasuredFunction], labels: Sequence[_Labels], types: Sequence[str | None],
    decided: dict[int, str],
) -> Iterable[Notice]:  # fmt: skip
    for key in dict.fromkeys((types[i], labels[i].kind, kind) for i, kind in decided.items()):
        of = [i for i, kind in decided.items() if (types[i], labels[i].kind, kind) == key]
        first = functions[of[0]]
        facts = {"data_type": first.header.kinds[1], "of_type": key[0], "of_label": key[1], "kind": key[2]}
        yield _notice("uff.kind-contradicts/decided", labels[of[0]].text, [functions[i] for i in of], **facts)
