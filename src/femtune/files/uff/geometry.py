"""Data sets 15 and 2411 (nodes), 82 (trace lines) and 2412 (elements) as a wire frame."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.errors import Notice
from femtune.files.uff.fields import as_float, as_int, check_count, fixed, line_at, node_number
from femtune.files.uff.scan import DataSet
from femtune.files.uff.systems import GLOBAL, SPHERICAL, CoordinateSystem, read_systems
from femtune.files.uff.through_pyuff import through_pyuff
from femtune.testdata import NO_GEOMETRY, WireFrame

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
    _refuse_duplicates(nodes)
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
        check_count(data_set, "nodes of its lines", count, len(values[name]))
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
    check_count(data_set, "two lines a node", 2 * count, len(data_set.lines), len(data_set.lines) - 1)
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


def _refuse_duplicates(nodes: Iterable[_Node]) -> None:
    seen: dict[int, _Node] = {}
    for node in nodes:
        first = seen.setdefault(node.number, node)
        if first is not node:
            same = first.point == node.point and first.data_set is not node.data_set
            raise node.data_set.error(
                "uff.duplicate-node",
                f"node {node.number} is defined twice",
                values={"first": first.data_set.where(), "same coordinates": same},
                hint="the file holds two geometries: export one, or renumber the nodes",
            )


def _default_system(
    nodes: Iterable[_Node], systems: Mapping[int, tuple[CoordinateSystem, DataSet]]
) -> tuple[Notice, ...]:
    """System 1 is the global Cartesian one by default in the programs that the format comes from."""
    if 1 in systems or not any(1 in (node.definition, node.displacement) for node in nodes):
        return ()
    what = "nodes refer to coordinate system 1, which the file does not define: taken as the global one"
    return (Notice("uff.global-system", what, level="info"),)


def _placed(
    node: _Node, systems: Mapping[int, tuple[CoordinateSystem, DataSet]]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Coordinates are in the definition system in data set 15, in part coordinates in 2411 (where the first system
    only says in which one they were exported)."""
    point = np.array(node.point)
    position = _system(node, node.definition, systems).to_global(point) if node.data_set.number == 15 else point
    return position, _system(node, node.displacement, systems).axes_at(position)


def _system(node: _Node, number: int, systems: Mapping[int, tuple[CoordinateSystem, DataSet]]) -> CoordinateSystem:
    if number in systems:
        found = systems[number][0]
        if found.kind == SPHERICAL:
            raise _unusable(node, f"node {node.number} refers to system {number}, which is spherical")
        return found
    if number not in (0, 1):
        raise _unusable(node, f"node {node.number} refers to coordinate system {number}, which is not defined")
    return GLOBAL


def _unusable(node: _Node, what: str) -> Exception:
    hint = "export the nodes in global coordinates, or the file with its coordinate systems"
    return node.data_set.error("uff.coordinate-system", what, hint=hint)


def _paths(sets: Iterable[DataSet], number: int, read: object, known: set[int]) -> tuple[Paths, tuple[Notice, ...]]:
    kept: list[tuple[int, ...]] = []
    notices = []
    for data_set in (one for one in sets if one.number == number):
        found: list[tuple[int, ...]] = read(data_set)  # type: ignore[operator]
        whole = [path for path in found if known.issuperset(path)]
        kept += whole
        if len(whole) < len(found):
            what = f"{len(found) - len(whole)} lines or elements use nodes that are not defined: left out"
            notices.append(Notice("uff.unknown-node", what, data_set.where()))
    return tuple(kept), tuple(notices)


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
    found, i = [], 0
    while i < len(data_set.lines):
        head = [as_int(text, data_set, i) for text in fixed(data_set.lines[i], [10] * 6)]
        kind, count = head[1], head[5]
        i += 2 if kind in _BEAMS else 1
        nodes: list[int] = []
        while len(nodes) < count:
            nodes += [as_int(text, data_set, i) for text in line_at(data_set, i).split()]
            i += 1
        check_count(data_set, f"nodes of element {head[0]}", count, len(nodes), i - 1)
        found.append(tuple(nodes))
    return found
