"""Data sets 15 and 2411 (nodes), 82 (trace lines) and 2412 (elements) as a wire frame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.errors import Notice
from femtune.files.uff.fields import as_float, as_int, check_count, fixed, line_at, node_number, through_pyuff
from femtune.files.uff.scan import DataSet
from femtune.testdata import NO_GEOMETRY, WireFrame

# ----------------------------------------------------------------------------------------------------
# Data sets 18 and 2420: the coordinate systems that nodes refer to.


# kinds of coordinate systems in data sets 18 and 2420
CARTESIAN = 0
CYLINDRICAL = 1
SPHERICAL = 2
OBLIQUE = "OBLIQUE SENSOR DIRECTIONS"
"""Name of a system of data set 2420 whose rows are the directions of sensors that are not perpendicular."""


@dataclass(frozen=True, eq=False)
class UffCoordinateSystem:
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


_ORTHOGONALITY = 1e-4
"""Largest product of two axes, and error of a squared length; single precision leaves 1e-6."""
GLOBAL = UffCoordinateSystem(0, CARTESIAN, np.eye(3), np.zeros(3))


def read_systems(sets: Iterable[DataSet]) -> dict[int, tuple[UffCoordinateSystem, DataSet]]:
    """The coordinate systems of a file by number, with the data set that each comes from.

    Raises
    ------
    FemtuneError : ``uff.truncated``, ``uff.value``, ``uff.unreadable``, ``uff.coordinate-system`` (no axes,
        unknown reference, unknown kind, or defined twice in different ways)
    """
    systems: dict[int, tuple[UffCoordinateSystem, DataSet]] = {}
    for data_set in sets:
        if data_set.number not in (18, 2420):
            continue
        of_data_set = _from_18(data_set, systems) if data_set.number == 18 else _from_2420(data_set)
        for one in of_data_set:
            _refuse_other(systems.get(one.number), one, data_set)
            systems[one.number] = (one, data_set)
    return systems


def _refuse_other(
    known: tuple[UffCoordinateSystem, DataSet] | None, new: UffCoordinateSystem, data_set: DataSet
) -> None:
    if known is None:
        return
    old = known[0]
    same = old.kind == new.kind and np.allclose(old.rows, new.rows) and np.allclose(old.origin, new.origin)
    if not same:
        raise data_set.error("uff.coordinate-system", number=new.number)


def _from_2420(data_set: DataSet) -> list[UffCoordinateSystem]:
    records = max(len(data_set.lines) - 2, 0)
    check_count(data_set, "lines (six per coordinate system)", 6 * -(-records // 6), records)
    values = through_pyuff(data_set)
    matrices = values["CS_matrices"]
    for name in ("CS_sys_labels", "CS_types"):
        check_count(data_set, "matrices of coordinate systems", records // 6, len(values[name]))
    check_count(data_set, "matrices of coordinate systems", records // 6, len(matrices))
    labels = [node_number(number, data_set) for number in values["CS_sys_labels"]]
    rows = zip(labels, values["CS_types"], values["CS_names"], matrices)
    return [
        _read_system(data_set, label, kind, np.asarray(matrix[:3]), np.asarray(matrix[3]), name == OBLIQUE)
        for label, kind, name, matrix in rows
    ]


def _from_18(data_set: DataSet, known: Mapping[int, tuple[UffCoordinateSystem, DataSet]]) -> list[UffCoordinateSystem]:
    count = len(data_set.lines) // 4
    check_count(data_set, "lines (four per coordinate system)", 4 * -(-len(data_set.lines) // 4), len(data_set.lines))
    for i in range(0, len(data_set.lines), 4):
        for text in fixed(data_set.lines[i], [10] * 5):
            as_int(text, data_set, i)
    values = through_pyuff(data_set)
    for name in ("cs_num", "cs_type", "ref_cs_num", "method", "ref_o", "x_point", "xz_point"):
        check_count(data_set, "parameters of coordinate systems", count, len(values[name]))
    systems: dict[int, UffCoordinateSystem] = {number: one for number, (one, _) in known.items()}
    made = []
    for k in range(count):
        made.append(_by_points(data_set, values, k, systems))
        systems[made[-1].number] = made[-1]
    return made


def _by_points(
    data_set: DataSet, values: Mapping[str, NDArray], k: int, systems: Mapping[int, UffCoordinateSystem]
) -> UffCoordinateSystem:
    number = node_number(values["cs_num"][k], data_set)
    reference = node_number(values["ref_cs_num"][k], data_set)
    base = systems.get(reference, GLOBAL if reference == 0 else None)
    if base is None or values["method"][k] != 1 or base.kind != CARTESIAN:
        how = f"(reference {reference}, method {values['method'][k]:g})"
        raise data_set.error("uff.coordinate-system/unsupported", number=number, definition=how)
    origin, on_x, on_xz = (base.to_global(values[name][k]) for name in ("ref_o", "x_point", "xz_point"))
    x = _unit(on_x - origin)
    y = _unit(np.cross(on_xz - origin, x))
    rows = np.array([x, y, np.cross(x, y)])
    return _read_system(data_set, number, node_number(values["cs_type"][k], data_set), rows, origin)


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    length = np.linalg.norm(vector)
    return vector / length if 0 < length < np.inf else np.full(3, np.nan)


def _read_system(
    data_set: DataSet, number: int, kind: int, rows: NDArray[np.float64], origin: NDArray[np.float64],
    oblique: bool = False,
) -> UffCoordinateSystem:  # fmt: skip
    if kind not in (CARTESIAN, CYLINDRICAL, SPHERICAL):
        raise data_set.error("uff.coordinate-system/unknown-kind", number=number, kind=kind)
    oblique = oblique and kind == CARTESIAN
    # a left-handed or skew triad that is not declared as such would spoil every shape silently
    products = rows @ rows.T - np.eye(3)
    unlike = np.diag(products) if oblique else products
    if not (np.abs(unlike).max() < _ORTHOGONALITY and (oblique or np.linalg.det(rows) > 0)):
        raise data_set.error("uff.coordinate-system/axes", number=number)
    if not np.isfinite(origin).all():
        raise data_set.error("uff.coordinate-system/origin", number=number)
    if oblique:
        return UffCoordinateSystem(number, kind, rows, origin)
    left, _, right = np.linalg.svd(rows)
    return UffCoordinateSystem(number, kind, left @ right, origin)


Paths = tuple[tuple[int, ...], ...]
_BEAMS = (11, 21, 22, 23, 24)
"""Elements with a record of their own for orientation."""


@dataclass(frozen=True)
class _Node:
    number: int
    definition: int
    displacement: int
    point: tuple[float, float, float]
    data_set: DataSet


def read_geometry(sets: Sequence[DataSet]) -> tuple[WireFrame, tuple[Notice, ...]]:
    """The wire frame of a file in the file's own units, and what was found remarkable.

    Raises
    ------
    FemtuneError : ``uff.truncated``, ``uff.count``, ``uff.value``, ``uff.unreadable``, ``uff.duplicate-node``,
        ``uff.coordinate-system``
    """
    systems = read_systems(sets)
    nodes = [node for one in sets if one.number in (15, 2411) for node in _nodes(one)]
    if not nodes:
        return NO_GEOMETRY, ()
    nodes = _distinct(nodes)
    notices = _default_system(nodes, systems)
    placed = [_placed(node, systems) for node in nodes]
    known = {node.number for node in nodes}
    lines, lost_lines = _paths(sets, 82, _trace_lines, known)
    elements, lost_elements = _paths(sets, 2412, _elements, known)
    frame = WireFrame(
        np.array([node.number for node in nodes], dtype=np.int64),
        np.array([point for point, _ in placed]),
        np.array([axes for _, axes in placed]),
        lines,
        elements,
    )
    return frame, (*notices, *lost_lines, *lost_elements)


def _nodes(data_set: DataSet) -> list[_Node]:
    count = _check_15(data_set) if data_set.number == 15 else _check_2411(data_set)
    if count == 0:
        return []
    values = through_pyuff(data_set)
    names = ("node_nums", "def_cs", "disp_cs", "x", "y", "z")
    for name in names:
        check_count(data_set, "nodes of trace lines", count, len(values[name]))
    rows = zip(*(values[name] for name in names))
    return [
        _Node(
            node_number(number, data_set),
            node_number(definition, data_set),
            node_number(displacement, data_set),
            (x, y, z),
            data_set,
        )
        for number, definition, displacement, x, y, z in rows
    ]


def _check_15(data_set: DataSet) -> int:
    """Each line is one node with seven fields, which pyuff does not check: it takes the numbers as they flow."""
    for i, line in enumerate(data_set.lines):
        _whole_line(data_set, i, line, 4, 3)
    return len(data_set.lines)


def _check_2411(data_set: DataSet) -> int:
    count = -(-len(data_set.lines) // 2)
    check_count(data_set, "lines (two per node)", 2 * count, len(data_set.lines), len(data_set.lines) - 1)
    for i in range(0, len(data_set.lines), 2):
        _whole_line(data_set, i, data_set.lines[i], 4, 0)
        _whole_line(data_set, i + 1, data_set.lines[i + 1], 0, 3)
    return count


def _whole_line(data_set: DataSet, i: int, line: str, integers: int, floats: int) -> None:
    fields = line.split()
    check_count(data_set, "fields of a node", integers + floats, len(fields), i)
    for text in fields[:integers]:
        as_int(text, data_set, i)
    for text in fields[integers:]:
        as_float(text, data_set, i)


_SAME_COORDINATES = 1e-5
"""Coordinates of repeated nodes agree to the digits of single precision, relative to the largest one."""


def _distinct(nodes: Sequence[_Node]) -> list[_Node]:
    """Every node once: programs repeat the whole geometry with each group of functions.

    Raises
    ------
    FemtuneError : ``uff.duplicate-node`` for a number twice in one data set, or with another place or other directions
    """
    seen: dict[int, _Node] = {}
    size = max((abs(x) for node in nodes for x in node.point), default=0.0)
    for node in nodes:
        first = seen.setdefault(node.number, node)
        if first is node:
            continue
        same = max(abs(a - b) for a, b in zip(first.point, node.point)) <= _SAME_COORDINATES * size
        systems = (first.definition, first.displacement) == (node.definition, node.displacement)
        if not (same and systems) or first.data_set is node.data_set:
            raise node.data_set.error(
                "uff.duplicate-node",
                values={"first": first.data_set.where(), "same coordinates": same},
                node_number=node.number,
            )
    return list(seen.values())


def _default_system(
    nodes: Iterable[_Node], systems: Mapping[int, tuple[UffCoordinateSystem, DataSet]]
) -> tuple[Notice, ...]:
    """System 1 is the global Cartesian one by default in the programs that the format comes from."""
    if 1 in systems or not any(1 in (node.definition, node.displacement) for node in nodes):
        return ()
    return (Notice("uff.global-system", level="info"),)


def _placed(
    node: _Node, systems: Mapping[int, tuple[UffCoordinateSystem, DataSet]]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Coordinates are in the definition system in data set 15, in part coordinates in 2411 (where the first system
    only says in which one they were exported)."""
    point = np.array(node.point)
    position = _system(node, node.definition, systems).to_global(point) if node.data_set.number == 15 else point
    return position, _system(node, node.displacement, systems).axes_at(position)


def _system(
    node: _Node, number: int, systems: Mapping[int, tuple[UffCoordinateSystem, DataSet]]
) -> UffCoordinateSystem:
    if number in systems:
        system = systems[number][0]
        if system.kind == SPHERICAL:
            raise node.data_set.error("uff.coordinate-system/spherical", node_number=node.number, number=number)
        return system
    if number not in (0, 1):
        raise node.data_set.error("uff.coordinate-system/undefined", node_number=node.number, number=number)
    return GLOBAL


def _paths(sets: Iterable[DataSet], number: int, read: object, known: set[int]) -> tuple[Paths, tuple[Notice, ...]]:
    kept: list[tuple[int, ...]] = []
    notices = []
    for data_set in (one for one in sets if one.number == number):
        paths: list[tuple[int, ...]] = read(data_set)  # type: ignore[operator]
        whole = [path for path in paths if known.issuperset(path)]
        kept += whole
        if len(whole) < len(paths):
            notices.append(Notice("uff.unknown-node", where=data_set.where(), n_found=len(paths) - len(whole)))
    return tuple(dict.fromkeys(kept)), tuple(notices)


def _trace_lines(data_set: DataSet) -> list[tuple[int, ...]]:
    """Polylines of two or more nodes; a zero lifts the pen. What follows the declared count must be padding."""
    declared = as_int(fixed(line_at(data_set, 0), [10, 10])[1], data_set, 0)
    line_at(data_set, 1)
    for i, line in enumerate(data_set.lines[2:], start=2):
        for text in line.split():
            as_int(text, data_set, i)
    values = [node_number(value, data_set) for value in through_pyuff(data_set)["nodes"]]
    if len(values) < declared or any(values[declared:]):
        check_count(data_set, "nodes of a trace line", declared, len(values), 0)
    strokes: list[list[int]] = [[]]
    for node in values[:declared]:
        if node:
            strokes[-1].append(node)
        else:
            strokes.append([])
    return [tuple(stroke) for stroke in strokes if len(stroke) > 1]


def _elements(data_set: DataSet) -> list[tuple[int, ...]]:
    """Node lists of elements, parsed here (pyuff goes wrong on elements of more than eight nodes)."""
    elements, i = [], 0
    while i < len(data_set.lines):
        head = [as_int(text, data_set, i) for text in fixed(data_set.lines[i], [10] * 6)]
        kind, count = head[1], head[5]
        i += 2 if kind in _BEAMS else 1
        nodes: list[int] = []
        while len(nodes) < count:
            nodes += [as_int(text, data_set, i) for text in line_at(data_set, i).split()]
            i += 1
        check_count(data_set, f"nodes of element {head[0]}", count, len(nodes), i - 1)
        elements.append(tuple(nodes))
    return elements
