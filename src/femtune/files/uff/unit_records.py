"""Data set 164: the units of a file, checked against those that the user states."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from femtune.errors import FemtuneError, Notice, Where
from femtune.files.uff.fields import as_float, as_int, fixed, line_at, through_pyuff
from femtune.files.uff.scan import DataSet
from femtune.units import UnitSystem

_UNIT_TOLERANCE = 1e-3
"""Relative difference up to which two units are the same: files round factors to four digits and more."""
_LBF = 4.4482216152605
"""Pound-force in N."""
_FT = 0.3048
"""Foot in m."""
_KGF = 9.80665
"""Kilogram-force in N."""
_CODES = {
    1: (1.0, 1.0),
    2: (_FT, _LBF),
    3: (1.0, _KGF),
    4: (_FT, 0.45359237 * _FT),
    5: (1e-3, 1e-3),
    6: (1e-2, 1e-2),
    7: (_FT / 12, _LBF),
    8: (1e-3, _KGF),
}
"""Metres and newtons in one unit of length and force, by the unit code of record 1 (9 is user-defined)."""


def file_unit_system(
    sets: Iterable[DataSet], file_units: UnitSystem | None, path: str | Path
) -> tuple[UnitSystem, tuple[Notice, ...]]:
    """The system that the numbers of a file are in: from data set 164, or else those that the user states.

    Raises
    ------
    FemtuneError : ``uff.no-units`` if neither states it, ``uff.units-contradict`` when they disagree or the
        file holds two systems
    """
    records = [one for one in sets if one.number == 164]
    systems = [(one, _system(one)) for one in records]
    if not systems:
        if file_units is None:
            raise _no_units(path)
        return file_units, ()
    data_set, system = systems[0]
    for other_set, other in systems[1:]:
        _check_same(other_set, other, system, "another data set 164 of this file")
    if file_units is not None:
        _check_same(data_set, system, file_units, f"the stated units of the file, {file_units.name}")
    return system, tuple(_code_notices(data_set, system))


def _no_units(path: str | Path) -> FemtuneError:
    return FemtuneError("uff.no-units", where=Where(str(path)))


def _system(data_set: DataSet) -> UnitSystem:
    for i, text in enumerate((line_at(data_set, 1) + " " + line_at(data_set, 2)).split()):
        as_float(text, data_set, 1 + i // 3)
    values = through_pyuff(data_set)
    length, force = values["length"], values["force"]
    if not all(math.isfinite(factor) and 1e-12 < factor < 1e12 for factor in (length, force)):
        factors = {"length": length, "force": force}
        raise data_set.error("uff.value/unit-factor", 1, values=factors)
    # "divide by the factor to get SI": one unit of length is 1/length metres.
    name = f"{values['units_description']} of data set 164".strip()
    return UnitSystem(name, 1.0 / length, length / force)


def _differ(a: float, b: float) -> bool:
    return abs(a / b - 1.0) > _UNIT_TOLERANCE


def _check_same(data_set: DataSet, found: UnitSystem, other: UnitSystem, other_statement: str) -> None:
    if _differ(found.length, other.length) or _differ(found.force, other.force):
        raise data_set.error(
            "uff.units-contradict",
            values={
                "length in data set 164": f"{found.length:.6g} m",
                "length otherwise": f"{other.length:.6g} m",
                "force in data set 164": f"{found.force:.6g} N",
                "force otherwise": f"{other.force:.6g} N",
            },
            other_statement=other_statement,
        )


def _code_notices(data_set: DataSet, system: UnitSystem) -> Iterator[Notice]:
    code = as_int(fixed(line_at(data_set, 0), [10])[0], data_set, 0)
    length, force = _CODES.get(code, (system.length, system.force))
    if _differ(system.length, length) or _differ(system.force, force):
        of_code: dict[str, Any] = {"length_of_code": length, "force_of_code": force}
        stated: dict[str, Any] = {"length": system.length, "force": system.force}
        yield Notice("uff.units-code", where=data_set.where(0), unit_code=code, **of_code, **stated)
