"""Data sets 18 and 2420: the coordinate systems that nodes refer to."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.files.uff.fields import as_int, check_count, fixed, node_number
from femtune.files.uff.scan import DataSet
from femtune.files.uff.through_pyuff import through_pyuff

CARTESIAN, CYLINDRICAL, SPHERICAL = 0, 1, 2


@dataclass(frozen=True, eq=False)
class CoordinateSystem:
    """`rows` (3, 3): row k is axis k in global components; `origin` (3,); `kind` as in the format."""

    number: int
    kind: int
    rows: NDArray[np.float64]
    origin: NDArray[np.float64]

    def to_global(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """(3,) global coordinates of a point given in this system; angles in degrees."""
        if self.kind == CARTESIAN:
            return self.origin + point @ self.rows
        radius, angle, height = point
        turn = np.radians(angle)
        return self.origin + np.array([radius * np.cos(turn), radius * np.sin(turn), height]) @ self.rows

    def axes_at(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """(3, 3) directions at a global position, one a row: radial, tangential, axial where cylindrical."""
        if self.kind == CARTESIAN:
            return self.rows
        x, y, _ = self.rows @ (position - self.origin)
        turn = np.arctan2(y, x)
        local = [[np.cos(turn), np.sin(turn), 0.0], [-np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]]
        return np.array(local) @ self.rows


GLOBAL = CoordinateSystem(0, CARTESIAN, np.eye(3), np.zeros(3))


def read_systems(sets: Iterable[DataSet]) -> dict[int, tuple[CoordinateSystem, DataSet]]:
    """The coordinate systems of a file by number, with the data set that each comes from.

    Raises
    ------
    FemtuneError : ``uff.truncated``, ``uff.value``, ``uff.unreadable``, ``uff.coordinate-system`` (no axes,
        unknown reference, unknown kind, or defined twice in different ways)
    """
    systems: dict[int, tuple[CoordinateSystem, DataSet]] = {}
    for data_set in sets:
        if data_set.number not in (18, 2420):
            continue
        found = _from_18(data_set, systems) if data_set.number == 18 else _from_2420(data_set)
        for one in found:
            _refuse_other(systems.get(one.number), one, data_set)
            systems[one.number] = (one, data_set)
    return systems


def _refuse_other(known: tuple[CoordinateSystem, DataSet] | None, new: CoordinateSystem, data_set: DataSet) -> None:
    if known is None:
        return
    old = known[0]
    same = old.kind == new.kind and np.allclose(old.rows, new.rows) and np.allclose(old.origin, new.origin)
    if not same:
        raise _bad(data_set, f"coordinate system {new.number} is defined twice in different ways")


def _bad(data_set: DataSet, what: str) -> Exception:
    hint = "correct its definition in the program that wrote the file"
    return data_set.error("uff.coordinate-system", what, hint=hint)


def _from_2420(data_set: DataSet) -> list[CoordinateSystem]:
    records = max(len(data_set.lines) - 2, 0)
    check_count(data_set, "six lines a coordinate system", 6 * -(-records // 6), records)
    values = through_pyuff(data_set)
    matrices = values["CS_matrices"]
    for name in ("CS_sys_labels", "CS_types"):
        check_count(data_set, "matrices of its systems", records // 6, len(values[name]))
    check_count(data_set, "matrices of its systems", records // 6, len(matrices))
    labels = [node_number(number, data_set) for number in values["CS_sys_labels"]]
    return [
        _system(data_set, label, kind, np.asarray(matrix[:3]), np.asarray(matrix[3]))
        for label, kind, matrix in zip(labels, values["CS_types"], matrices)
    ]


def _from_18(data_set: DataSet, known: Mapping[int, tuple[CoordinateSystem, DataSet]]) -> list[CoordinateSystem]:
    count = len(data_set.lines) // 4
    check_count(data_set, "four lines a coordinate system", 4 * -(-len(data_set.lines) // 4), len(data_set.lines))
    for i in range(0, len(data_set.lines), 4):
        for text in fixed(data_set.lines[i], [10] * 5):
            as_int(text, data_set, i)
    values = through_pyuff(data_set)
    for name in ("cs_num", "cs_type", "ref_cs_num", "method", "ref_o", "x_point", "xz_point"):
        check_count(data_set, "parameters of its systems", count, len(values[name]))
    found: dict[int, CoordinateSystem] = {number: one for number, (one, _) in known.items()}
    made = []
    for k in range(count):
        made.append(_by_points(data_set, values, k, found))
        found[made[-1].number] = made[-1]
    return made


def _by_points(
    data_set: DataSet, values: Mapping[str, NDArray], k: int, found: Mapping[int, CoordinateSystem]
) -> CoordinateSystem:
    number = node_number(values["cs_num"][k], data_set)
    reference = node_number(values["ref_cs_num"][k], data_set)
    base = found.get(reference, GLOBAL if reference == 0 else None)
    if base is None or values["method"][k] != 1 or base.kind != CARTESIAN:
        how = f"(reference {reference}, method {values['method'][k]:g})"
        raise _bad(data_set, f"coordinate system {number} is defined in a way that is not understood {how}")
    origin, on_x, on_xz = (base.to_global(values[name][k]) for name in ("ref_o", "x_point", "xz_point"))
    x = _unit(on_x - origin)
    y = _unit(np.cross(on_xz - origin, x))
    rows = np.array([x, y, np.cross(x, y)])
    return _system(data_set, number, node_number(values["cs_type"][k], data_set), rows, origin)


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    length = np.linalg.norm(vector)
    return vector / length if 0 < length < np.inf else np.full(3, np.nan)


def _system(
    data_set: DataSet, number: int, kind: int, rows: NDArray[np.float64], origin: NDArray[np.float64]
) -> CoordinateSystem:
    if kind not in (CARTESIAN, CYLINDRICAL, SPHERICAL):
        raise _bad(data_set, f"coordinate system {number} is of the unknown kind {kind}")
    # Single-precision exporters leave 1e-6; a left-handed or skew triad would spoil every shape silently.
    if not (np.abs(rows @ rows.T - np.eye(3)).max() < 1e-4 and np.linalg.det(rows) > 0):
        raise _bad(data_set, f"the axes of coordinate system {number} are not a right-handed triad")
    if not np.isfinite(origin).all():
        raise _bad(data_set, f"the origin of coordinate system {number} is not finite")
    left, _, right = np.linalg.svd(rows)
    return CoordinateSystem(number, kind, left @ right, origin)
