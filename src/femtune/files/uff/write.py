"""Modes out: a Universal File with units, nodes, lines and one data set 55 a mode.

The format gives shapes and frequencies six significant digits, coordinates and units seventeen. Not by pyuff,
which turns NaN into zero without a word.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where
from femtune.modal import ModeSet
from femtune.testdata import ModalTest, WireFrame


def write_uff_modes(path: str | Path, tests: ModalTest | Sequence[ModalTest], title_lines: Sequence[str] = ()) -> None:
    """Write the modes of one test, or of several configurations that share a geometry and units.

    Data sets 164 (units), 2420 (local axes, where a node has any), 2411 (nodes), 82 (lines), 2412 (elements),
    55 (a mode each; ID line 1 is the name of the test, by which ``read_uff(records=…)`` selects).

    Parameters
    ----------
    title_lines : up to four further ID lines

    Raises
    ------
    FemtuneError : ``uff.cannot-write`` for what the format cannot hold: no modes, scalar points, single NaN
        entries, measured rows that are zero throughout, labels that are no numbers, or geometries that differ
    """
    several = [tests] if isinstance(tests, ModalTest) else list(tests)
    _check(several, title_lines)
    lines = [*units_set(several[0]), *geometry_sets(several[0].geometry)]
    for test in several:
        lines += _modes(test, title_lines)
    try:
        Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
    except OSError as problem:
        raise FemtuneError(
            "uff.cannot-write", f"the file cannot be written: {problem.strerror}", where=Where(str(path))
        ) from problem


def refuse(what: str, hint: str = "") -> FemtuneError:
    """The error that the format cannot hold something."""
    return FemtuneError("uff.cannot-write", what, hint=hint)


def _check(tests: Sequence[ModalTest], title_lines: Sequence[str]) -> None:
    if not tests or any(test.modes is None or not len(test.modes) for test in tests):
        raise refuse("there is no test, or one without modes", "write tests that have modes")
    for text in (*title_lines, *(test.name for test in tests)):
        if len(text) > 80 or not text.isprintable():
            raise refuse(f"'{text[:90]!r}' is no ID line", "an ID line is printable and at most 80 long")
    if len(title_lines) > 4:
        raise refuse("a data set 55 has room for four title lines")
    for test in tests[1:]:
        if test.units != tests[0].units or not _same(test.geometry, tests[0].geometry):
            raise refuse(f"test '{test.name}' has other units or another geometry than '{tests[0].name}'")
    if len({test.name for test in tests}) < len(tests):
        raise refuse("two tests have the same name", "the name tells the configurations apart")
    for test in tests:
        _check_modes(test)


def _same(a: WireFrame, b: WireFrame) -> bool:
    arrays = ((a.nodes, b.nodes), (a.coordinates, b.coordinates), (a.axes, b.axes))
    return all(np.array_equal(np.asarray(x), np.asarray(y)) for x, y in arrays)


def _check_modes(test: ModalTest) -> None:
    modes = test.modes
    assert modes is not None
    if any(dof.component == 0 for dof in modes.dofs):
        raise refuse("the format has no scalar points", "leave DOFs of direction S out")
    numbers = set(modes.labels)
    if len(numbers) < len(modes) or not all(label.isdecimal() and int(label) > 0 for label in numbers):
        raise refuse(f"the labels of the modes must be different numbers: {', '.join(modes.labels)}")
    if modes.damping_ratio is not None and not (np.abs(modes.damping_ratio) < 1).all():
        raise refuse("a damping ratio is not between -1 and 1", "give damping as a fraction of critical")
    partly = np.isnan(modes.shapes).any(axis=1)
    zero = ~(modes.shapes != 0).any(axis=1)
    for rows, why in ((partly, "has missing entries (NaN)"), (zero, "is zero in every mode")):
        if rows.any():
            first = modes.dofs[int(np.flatnonzero(rows)[0])]
            raise refuse(f"{first} {why}: read back it would not be the same", "leave the DOF out")


def data_set(number: int, lines: Iterable[str]) -> Iterator[str]:
    """The lines of a data set between its marks."""
    yield from ("    -1", f"{number:6d}", *lines, "    -1")


def _doubles(values: Iterable[float]) -> str:
    return "".join(f"{value:25.16E}" for value in values).replace("E", "D")


def units_set(test: ModalTest) -> Iterator[str]:
    """Data set 164: the units of a test."""
    units = test.units
    factors = _doubles((1 / units.length, 1 / units.force, 1.0))
    return data_set(164, [f"{9:10d}{units.name[:20]:<20}{2:10d}", factors, _doubles([273.15])])


def geometry_sets(frame: WireFrame) -> Iterator[str]:
    """Data sets 2420, 2411, 82 and 2412: local axes, nodes, lines, elements; what is empty is left out."""
    assert frame.axes is not None
    turned = [i for i in range(len(frame)) if not np.array_equal(frame.axes[i], np.eye(3))]
    # System 1 is the global one wherever it is not defined, so ours begin at 2.
    numbers = {i: k + 2 for k, i in enumerate(turned)}
    if turned:
        yield from data_set(2420, _systems(frame.axes, numbers))
    if len(frame):
        yield from data_set(2411, _nodes(frame, numbers))
    for k, path in enumerate(frame.lines):
        yield from data_set(82, [f"{k + 1:10d}{len(path):10d}{1:10d}", f"line {k + 1}", *_rows(path)])
    if frame.elements:
        yield from data_set(2412, _elements(frame))


def _systems(axes: NDArray, numbers: dict[int, int]) -> Iterator[str]:
    yield from (f"{1:10d}", "test")
    for i, number in numbers.items():
        yield from (f"{number:10d}{0:10d}{1:10d}", f"CS{number}")
        yield from (_doubles(row) for row in (*axes[i], np.zeros(3)))


def _nodes(frame: WireFrame, numbers: dict[int, int]) -> Iterator[str]:
    for i, node in enumerate(frame.nodes):
        yield f"{node:10d}{0:10d}{numbers.get(i, 0):10d}{1:10d}"
        yield _doubles(frame.coordinates[i])


def _rows(path: Sequence[int]) -> list[str]:
    return ["".join(f"{node:10d}" for node in path[i : i + 8]) for i in range(0, len(path), 8)]


_SHAPES = {2: 21, 3: 41, 4: 44}
"""Beam, triangle, quadrilateral; what has another number of nodes is written as a solid's descriptor."""


def _elements(frame: WireFrame) -> Iterator[str]:
    for k, nodes in enumerate(frame.elements):
        kind = _SHAPES.get(len(nodes), 115)
        yield f"{k + 1:10d}{kind:10d}{1:10d}{1:10d}{1:10d}{len(nodes):10d}"
        if kind == 21:
            yield f"{0:10d}{1:10d}{1:10d}"
        yield from _rows(nodes)


def _modes(test: ModalTest, title_lines: Sequence[str]) -> Iterator[str]:
    modes = test.modes
    assert modes is not None
    nodes, table = _table(modes)
    titles = [test.name or "NONE", *(text or "NONE" for text in title_lines)]
    titles += ["NONE"] * (5 - len(titles))
    is_complex = np.iscomplexobj(table)
    for j in range(len(modes)):
        head = [1, 3 if is_complex else 2, 2 if table.shape[1] == 3 else 3, 8, 5 if is_complex else 2]
        yield from data_set(
            55,
            [
                *titles,
                "".join(f"{value:10d}" for value in (*head, table.shape[1])),
                f"{2:10d}{6 if is_complex else 4:10d}{1:10d}{int(modes.labels[j]):10d}",
                _singles(_parameters(modes, j, is_complex))[0],
                *_data(nodes, table[:, :, j]),
            ],
        )


def _table(modes: ModeSet) -> tuple[list[int], NDArray]:
    """Node numbers and (nodes, 3 or 6, modes) values, zero where a component was not measured."""
    nodes = list(dict.fromkeys(int(node) for node in modes.dofs.nodes))
    width = 6 if (modes.dofs.components > 3).any() else 3
    table = np.zeros((len(nodes), width, len(modes)), dtype=modes.shapes.dtype)
    for dof, row in zip(modes.dofs, modes.shapes):
        table[nodes.index(dof.node), dof.component - 1] = dof.sign * row
    return nodes, table


def _parameters(modes: ModeSet, j: int, is_complex: bool) -> list[float]:
    damping = 0.0 if modes.damping_ratio is None else float(modes.damping_ratio[j])
    if not is_complex:
        return [float(modes.freq_hz[j]), 1.0 if modes.normalisation == "mass" else 0.0, damping, 0.0]
    omega = float(modes.omega_rad_s[j])
    return [-damping * omega, omega * float(np.sqrt(1 - damping**2)), 0.0, 0.0, 0.0, 0.0]


def _singles(values: Sequence[float]) -> list[str]:
    return ["".join(f"{value:13.5E}" for value in values[i : i + 6]) for i in range(0, len(values), 6)]


def _data(nodes: Sequence[int], values: NDArray) -> Iterator[str]:
    for node, row in zip(nodes, values):
        parts = np.column_stack([row.real, row.imag]).ravel() if np.iscomplexobj(row) else row
        yield f"{node:10d}"
        yield from _singles([float(part) for part in parts])
