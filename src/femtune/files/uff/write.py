"""Modes out: a Universal File with units, nodes, lines and one data set 55 a mode.

The format gives shapes and frequencies six significant digits, coordinates and units seventeen. Not by pyuff,
which turns NaN into zero without a word.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import Dof
from femtune.errors import FemtuneError, Where
from femtune.files.uff.geometry import OBLIQUE
from femtune.files.whole_file import write_whole
from femtune.modal import FrfSet, ModeSet
from femtune.testdata import ModalTest, WireFrame
from femtune.units import UnitSystem, force_unit


def write_uff_modes(path: str | Path, tests: ModalTest | Sequence[ModalTest], title_lines: Sequence[str] = ()) -> None:
    """Write the modes of one test, or of several configurations that share a geometry and units.

    Data sets 164 (units), 2420 (local axes, where a node has any), 2411 (nodes), 82 (lines), 2412 (elements),
    55 (a mode each; ID line 1 is the name of the test, by which ``read_uff(records=…)`` selects).

    Parameters
    ----------
    title_lines : up to four further ID lines

    Raises
    ------
    FemtuneError : ``uff.cannot-write`` for what the format cannot hold: no modes, scalar points beside others,
        single NaN entries, measured rows that are zero throughout, labels that are no numbers, or geometries that
        differ
    """
    several = [tests] if isinstance(tests, ModalTest) else list(tests)
    check_modes(several, title_lines)
    measured = [dof for test in several for dof in _modes_of(test).dofs]
    lines = [*units_set(several[0].units), *geometry_sets(several[0].geometry, measured)]
    for test in several:
        lines += _modes(test, title_lines)
    _write(Path(path), lines)


def _write(path: Path, lines: Sequence[str]) -> None:
    """Write the file; a file of another kind is not replaced."""
    try:
        if path.is_file() and not _is_universal(path):
            raise FemtuneError("uff.cannot-write/other-file", where=Where(str(path)))
        write_whole(path, ("\n".join(lines) + "\n").encode())
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or problem
        raise FemtuneError("uff.cannot-write", where=Where(str(path)), reason=reason) from problem


def _is_universal(path: Path) -> bool:
    """Whether a file may be replaced by a Universal File: it is one, or empty."""
    with path.open("rb") as file:
        start = file.read(400).split()
    return not start or start[0] == b"-1"


def check_modes(tests: Sequence[ModalTest], title_lines: Sequence[str] = ()) -> None:
    """Refuse what the format cannot hold (error ``uff.cannot-write``)."""
    if not tests or any(test.modes is None or not len(test.modes) for test in tests):
        raise FemtuneError("uff.cannot-write/no-modes")
    for text in (*title_lines, *(test.name for test in tests)):
        if len(text) > 80 or not text.isprintable():
            raise FemtuneError("uff.cannot-write/id-line", text=text[:90])
    if len(title_lines) > 4:
        raise FemtuneError("uff.cannot-write/title-lines-of-modes")
    for test in tests[1:]:
        if test.units != tests[0].units or not _same(test.geometry, tests[0].geometry):
            raise FemtuneError("uff.cannot-write/tests-differ", test_name=test.name, first_test_name=tests[0].name)
    if len({test.name for test in tests}) < len(tests):
        raise FemtuneError("uff.cannot-write/same-test-name")
    for test in tests:
        _check_modes(test)


def _same(a: WireFrame, b: WireFrame) -> bool:
    arrays = ((a.nodes, b.nodes), (a.coordinates, b.coordinates), (a.axes, b.axes))
    return all(np.array_equal(np.asarray(x), np.asarray(y)) for x, y in arrays)


def _modes_of(test: ModalTest) -> ModeSet:
    assert test.modes is not None
    return test.modes


def _check_modes(test: ModalTest) -> None:
    modes = _modes_of(test)
    if len({dof.component == 0 for dof in modes.dofs}) > 1:
        raise FemtuneError("uff.cannot-write/scalar-point")
    numbers = set(modes.labels)
    if len(numbers) < len(modes) or not all(label.isdecimal() and int(label) > 0 for label in numbers):
        raise FemtuneError("uff.cannot-write/mode-labels", labels=", ".join(modes.labels))
    if modes.damping_ratio is not None and not (np.abs(modes.damping_ratio) < 1).all():
        raise FemtuneError("uff.cannot-write/damping-ratio")
    partly = np.isnan(modes.shapes).any(axis=1)
    zero = ~(modes.shapes != 0).any(axis=1)
    for rows, why in ((partly, "has missing entries (NaN)"), (zero, "is zero in every mode")):
        if rows.any():
            first = modes.dofs[int(np.flatnonzero(rows)[0])]
            raise FemtuneError("uff.cannot-write/lost-entry", dof=first, problem=why)


def data_set(number: int, lines: Iterable[str]) -> Iterator[str]:
    """The lines of a data set between its marks."""
    yield from ("    -1", f"{number:6d}", *lines, "    -1")


def _doubles(values: Iterable[float]) -> str:
    return "".join(f"{value:25.16E}" for value in values).replace("E", "D")


def write_uff_geometry(path: str | Path, frame: WireFrame, units: UnitSystem) -> None:
    """Write the geometry of a test alone: data sets 164 (units), 2420 (local axes), 2411 (nodes), 82 (lines), 2412.

    Raises
    ------
    FemtuneError : ``uff.cannot-write``
    """
    _write(Path(path), [*units_set(units), *geometry_sets(frame)])


def units_set(units: UnitSystem) -> Iterator[str]:
    """Data set 164: the units of a test."""
    factors = _doubles((1 / units.length, 1 / units.force, 1.0))
    return data_set(164, [f"{9:10d}{units.name[:20]:<20}{2:10d}", factors, _doubles([273.15])])


def geometry_sets(frame: WireFrame, measured: Iterable[Dof] = ()) -> Iterator[str]:
    """Data sets 2420, 2411, 82 and 2412: local axes, nodes, lines, elements; what is empty is left out.

    The format knows right-handed triads. Where the directions of the `measured` DOFs of a node are perpendicular, the
    others are replaced so that they form one. Other axes are written with the name `OBLIQUE`, by which `read_uff` knows
    that they are the directions of sensors.
    """
    assert frame.axes is not None
    used: dict[int, set[int]] = {}
    for dof in measured:
        if dof.component:
            used.setdefault(dof.node, set()).add((dof.component - 1) % 3)
    axes = [_triad(triad, sorted(used.get(int(node), ()))) for node, triad in zip(frame.nodes, np.asarray(frame.axes))]
    # System 1 is the global one wherever it is not defined, so ours begin at 2.
    turned = [i for i, triad in enumerate(axes) if not np.array_equal(triad, np.eye(3))]
    numbers = {i: k + 2 for k, i in enumerate(turned)}
    if turned:
        yield from data_set(2420, _systems(axes, numbers))
    if len(frame):
        yield from data_set(2411, _nodes(frame, numbers))
    for k, path in enumerate(frame.lines):
        yield from data_set(82, [f"{k + 1:10d}{len(path):10d}{1:10d}", f"line {k + 1}", *_rows(path)])
    if frame.elements:
        yield from data_set(2412, _elements(frame))


_ORTHOGONALITY = 1e-6
"""Largest product of two axes, and error of a squared length, of a triad; `read_uff` accepts 1e-4."""


def _triad(axes: NDArray, used: Sequence[int]) -> NDArray:
    """The axes of a node (3, 3); where they are no triad, one with the rows that are used, if there is one."""
    if _is_triad(axes) or not used or len(used) == 3:
        return axes
    first = used[0]
    second = used[1] if len(used) == 2 else (first + 1) % 3
    out = axes.copy()
    if len(used) == 1:
        # of the global axes the one that is most nearly perpendicular
        other = np.eye(3)[int(np.argmin(np.abs(axes[first])))]
        out[second] = other - (other @ axes[first]) * axes[first]
        out[second] /= np.linalg.norm(out[second])
    third = 3 - first - second
    out[third] = np.cross(out[(third + 1) % 3], out[(third + 2) % 3])
    return out if _is_triad(out) else axes


def _is_triad(axes: NDArray) -> bool:
    return bool(np.abs(axes @ axes.T - np.eye(3)).max() < _ORTHOGONALITY and np.linalg.det(axes) > 0.0)


def _systems(axes: Sequence[NDArray], numbers: dict[int, int]) -> Iterator[str]:
    yield from (f"{1:10d}", "test")
    for i, number in numbers.items():
        yield from (f"{number:10d}{0:10d}{1:10d}", f"CS{number}" if _is_triad(axes[i]) else OBLIQUE)
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
    modes = _modes_of(test)
    nodes, table = _table(modes)
    titles = [test.name or "NONE", *(text or "NONE" for text in title_lines)]
    titles += ["NONE"] * (5 - len(titles))
    is_complex = np.iscomplexobj(table)
    for j in range(len(modes)):
        head = [1, 3 if is_complex else 2, _CHARACTERISTIC[table.shape[1]], 8, 5 if is_complex else 2]
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


_CHARACTERISTIC = {1: 1, 3: 2, 6: 3}
"""Scalar, translations, translations and rotations, by the number of values of a node."""


def _table(modes: ModeSet) -> tuple[list[int], NDArray]:
    """Node numbers and (nodes, 1, 3 or 6, modes) values, zero where a component was not measured."""
    nodes = list(dict.fromkeys(int(node) for node in modes.dofs.nodes))
    components = modes.dofs.components
    width = 1 if not components.any() else 6 if (components > 3).any() else 3
    table = np.zeros((len(nodes), width, len(modes)), dtype=modes.shapes.dtype)
    for dof, row in zip(modes.dofs, modes.shapes):
        table[nodes.index(dof.node), max(dof.component - 1, 0)] = dof.sign * row
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


# ----------------------------------------------------------------------------------------------------
# FRFs out: a Universal File with units, nodes, lines and one data set 58 a function, in ASCII.
#
# Values get thirteen significant digits, frequencies ten. Not by pyuff, which turns NaN into zero without a word.


_NUMERATORS = {"receptance": 8, "mobility": 11, "accelerance": 12}
_WORDS = {"receptance": "Displacement", "mobility": "Velocity", "accelerance": "Acceleration"}
_PER_TIME = {"receptance": "", "mobility": "/s", "accelerance": "/s2"}
# specific data types of data set 58
_FORCE_TYPE = 13
_FREQUENCY_TYPE = 18
_NODE_LIMIT = 10**10
"""Node numbers have ten columns."""
_EVEN_SPACING = 1e-9
"""Steps between lines that differ by less, relative to the highest line, count as one."""


def write_uff_frfs(path: str | Path, test: ModalTest, title_lines: Sequence[str] = ()) -> Path:
    """Write the FRFs of a test, or those of a model in the form of one.

    Data sets 164 (units), 2420, 2411, 82 and 2412 (geometry), 58 (a function each; ID line 1 is the name of the
    test). A pair that is NaN throughout is left out.

    Parameters
    ----------
    title_lines : up to four further ID lines

    Raises
    ------
    FemtuneError : ``uff.cannot-write`` for what the format cannot hold: no FRFs, single NaN values, lines that ten
        digits do not tell apart, long names
    """
    _check_frfs(test, title_lines)
    assert test.frfs is not None
    measured = (*test.frfs.responses, *test.frfs.references)
    lines = [*units_set(test.units), *geometry_sets(test.geometry, measured)]
    titles = [test.name or "NONE", *(text or "NONE" for text in title_lines)]
    titles += ["NONE"] * (5 - len(titles))
    for i, j in _pairs(test.frfs):
        lines += data_set(58, _function(test.frfs, i, j, test.units, titles))
    _write(Path(path), lines)
    return Path(path)


def _pairs(frfs: FrfSet) -> list[tuple[int, int]]:
    unknown = np.asarray(np.isnan(frfs.values).all(axis=2))
    return [(i, j) for j in range(len(frfs.references)) for i in range(len(frfs.responses)) if not unknown[i, j]]


def _check_frfs(test: ModalTest, title_lines: Sequence[str]) -> None:
    frfs = test.frfs
    if frfs is None or not _pairs(frfs):
        raise FemtuneError("uff.cannot-write/no-frfs")
    for text in (*title_lines, test.name):
        if len(text) > 80 or not text.isprintable():
            raise FemtuneError("uff.cannot-write/id-line", text=text[:90])
    if len(title_lines) > 4:
        raise FemtuneError("uff.cannot-write/title-lines-of-frfs")
    for i, j in _pairs(frfs):
        if np.isnan(frfs.values[i, j]).any():
            raise FemtuneError(
                "uff.cannot-write/missing-values", reference=frfs.references[j], response=frfs.responses[i]
            )
    if max(int(d.node) for d in (*frfs.responses, *frfs.references)) >= _NODE_LIMIT:
        raise FemtuneError("uff.cannot-write/node-number")
    texts = [_abscissa(f) for f in frfs.freq_hz]
    if len({float(text) for text in texts}) < len(texts):
        raise FemtuneError("uff.cannot-write/close-lines")


def _function(frfs: FrfSet, i: int, j: int, units: UnitSystem, titles: Sequence[str]) -> Iterator[str]:
    response, reference = frfs.responses[i], frfs.references[j]
    even = _step(frfs.freq_hz)
    yield from titles
    yield f"{4:5d}{0:10d}{0:5d}{0:10d} {'NONE':<10}{_place(response)} {'NONE':<10}{_place(reference)}"
    start, step = (frfs.freq_hz[0], even) if even is not None else (0.0, 0.0)
    yield f"{6:10d}{len(frfs.freq_hz):10d}{even is not None:10d}{_column(start)}{_column(step)}{0.0:13.5E}"
    yield _axis(_FREQUENCY_TYPE, (0, 0), "Frequency", "Hz")
    yield _axis(_NUMERATORS[frfs.kind], *_motion(frfs.kind, response, units))
    yield _axis(_FORCE_TYPE, *_load(reference, units))
    yield _axis(0, (0, 0), "NONE", "NONE")
    yield from _values(frfs.freq_hz, frfs.values[i, j], even is not None)


def _place(dof: Dof) -> str:
    return f"{dof.node:10d}{dof.sign * dof.component:4d}"


def _step(freq_hz: NDArray) -> float | None:
    """The step where start and step, as the file can hold them, give all lines; None else."""
    if len(freq_hz) < 2:
        return None
    start, step = float(_abscissa(freq_hz[0])), float(_abscissa((freq_hz[-1] - freq_hz[0]) / (len(freq_hz) - 1)))
    made = start + step * np.arange(len(freq_hz))
    return step if step > 0.0 and np.abs(made - freq_hz).max() <= _EVEN_SPACING * freq_hz[-1] else None


def _axis(kind: int, exponents: tuple[int, int], word: str, unit: str) -> str:
    length, force = exponents
    return f"{kind:10d}{length:5d}{force:5d}{0:5d} {word:<20} {unit:<20}"


def _motion(kind: str, dof: Dof, units: UnitSystem) -> tuple[tuple[int, int], str, str]:
    turns = dof.component > 3
    unit = "rad" if turns else units.name.split("-", maxsplit=1)[0]
    return (0 if turns else 1, 0), _WORDS[kind], unit + _PER_TIME[kind]


def _load(dof: Dof, units: UnitSystem) -> tuple[tuple[int, int], str, str]:
    force = force_unit(units)
    if dof.component > 3:
        length = units.name.split("-", maxsplit=1)[0]
        return (1, 1), "Excitation Force", f"{force}.{length}"
    return (0, 1), "Excitation Force", force


def _abscissa(x: float) -> str:
    """As many digits as twelve columns hold; a point is always there, as Fortran's formats want it."""
    for digits in range(10, 4, -1):
        text = f"{float(x):.{digits}g}"
        if "e" in text:
            mantissa, exponent = text.split("e")
            text = f"{mantissa}{'' if '.' in mantissa else '.'}E{exponent}"
        elif "." not in text:
            text += "."
        if len(text) <= 12:
            return text
    return f"{float(x):.5E}"


def _column(x: float) -> str:
    return f"{_abscissa(x):>13}"


def _values(freq_hz: NDArray, values: NDArray, even: bool) -> Iterator[str]:
    pairs = [f"{v.real:20.12E}{v.imag:20.12E}" for v in values]
    if even:
        yield from ("".join(pairs[k : k + 2]) for k in range(0, len(pairs), 2))
    else:
        yield from (f"{_column(f)}{pair}" for f, pair in zip(freq_hz, pairs))
