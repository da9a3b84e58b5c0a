"""Data sets 55 and 2414 as modes. Parsed here: pyuff cannot hold complex rotations, loses its place where a record
takes two lines, and refuses D exponents."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import DIRECTIONS, Dof, DofSet
from femtune.errors import FemtuneError, Notice, Where
from femtune.files.uff.fields import as_float, as_int, check_count, fixed, line_at
from femtune.files.uff.scan import DataSet
from femtune.modal import ModeSet

# types of analysis of data sets 55 and 2414
_NORMAL = 2
_COMPLEX = (3, 7)
_SCALAR = 1
"""Data characteristic of scalar points."""
_VALUES_OF = {_SCALAR: 1, 2: 3, 3: 6}
"""Values a node by data characteristic: of scalar points, translations, or translations and rotations."""
_MOTION = (0, 1, 8, 11, 12)
"""Specific data types that are a shape: unknown, general, displacement, velocity, acceleration."""

_RATES = (11, 12)
"""Those that are velocities or accelerations."""
_ID_LINES_2414 = 3
"""Lines of a data set 2414 before its ID lines: label, name and place of the values."""
_AT_NODES = 1
"""Place of the values of data set 2414 that is read."""
_UNIT_MASS = 1e-6
"""Difference of a modal mass from 1 up to which a shape is mass-normalised: the format has six digits."""


@dataclass(frozen=True, eq=False)
class ModeRecord:
    """One data set 55 or 2414: mode number, frequency, damping (NaN where not stated), modal mass (0 where not stated),
    ID lines, node numbers (n,) and values (n, 1, 3 or 6) as they stand in the file."""

    number: int
    freq_hz: float
    damping_ratio: float
    modal_mass: float
    id_lines: tuple[str, ...]
    nodes: tuple[int, ...]
    values: NDArray
    where: Where
    conjugate: bool = False
    """Whether the file has the pole of negative frequency, and shape and pole are conjugates of what it has."""


def read_mode_records(
    sets: Iterable[DataSet], records: str | None
) -> tuple[tuple[ModeRecord, ...], tuple[Notice, ...]]:
    """The modes of a file whose ID lines contain the word `records` (all of them where it is None).

    Raises
    ------
    FemtuneError : ``uff.no-record``, ``uff.truncated``, ``uff.count``, ``uff.value``, ``uff.pole``,
        ``uff.duplicate-node``
    """
    all_of_them = [one for one in sets if one.number in (55, 2414)]
    chosen = [one for one in all_of_them if records is None or _has_word(one, records)]
    if records is not None and not chosen:
        raise _no_record(all_of_them, records)
    notices = {i: notice for i, one in enumerate(chosen) if (notice := _no_mode(one)) is not None}
    read = [_record(one) for i, one in enumerate(chosen) if i not in notices]
    overdamped = [one.where for one in read if not one.freq_hz and one.damping_ratio]
    if overdamped:
        notices[len(chosen)] = Notice("uff.pole/real", where=overdamped[0], n_real=len(overdamped))
    return tuple(one for one in read if one.where not in overdamped), tuple(notices.values())


def _id_lines(data_set: DataSet) -> tuple[str, ...]:
    first = 0 if data_set.number == 55 else _ID_LINES_2414
    return tuple(line_at(data_set, first + i).strip() for i in range(5))


def _has_word(data_set: DataSet, word: str) -> bool:
    return any(re.search(rf"(?<!\w){re.escape(word)}(?!\w)", line) for line in _id_lines(data_set))


def _no_record(sets: Sequence[DataSet], word: str) -> FemtuneError:
    seen = sorted({" | ".join(line for line in _id_lines(one) if line not in ("", "NONE")) for one in sets})
    return FemtuneError(
        "uff.no-record",
        where=sets[0].where() if sets else None,
        values={"ID lines of the file": "; ".join(seen[:6]) or "there are no modes"},
        word=word,
    )


def _parameters(data_set: DataSet) -> list[int]:
    line = 5 if data_set.number == 55 else _ID_LINES_2414 + 5
    return [as_int(text, data_set, line) for text in fixed(line_at(data_set, line), [10] * 6)]


def _no_mode(data_set: DataSet) -> Notice | None:
    """The notice about a data set 55 or 2414 that is not a mode."""
    number: dict[str, Any] = {"number": data_set.number}
    if data_set.number == 2414 and (place := as_int(line_at(data_set, 2), data_set, 2)) != _AT_NODES:
        return Notice("uff.not-a-mode/place", where=data_set.where(), **number, place=place)
    _, analysis, characteristic, specific, data_type, per_node = _parameters(data_set)
    if analysis not in (_NORMAL, *_COMPLEX):
        return Notice("uff.not-a-mode/analysis", where=data_set.where(), **number, analysis=analysis)
    if characteristic not in _VALUES_OF or specific not in _MOTION:
        facts = {**number, "characteristic": characteristic, "data_type": specific}
        return Notice("uff.not-a-mode/values", where=data_set.where(), **facts)
    if data_type not in ((2, 5) if data_set.number == 55 else (2, 4, 5, 6)):
        raise data_set.error("uff.value/mode-data-type", 5, data_type=data_type)
    check_count(data_set, "values per node", _VALUES_OF[characteristic], per_node, 5)
    return None


def _record(data_set: DataSet) -> ModeRecord:
    _, analysis, _, specific, data_type, per_node = _parameters(data_set)
    read_head = _head_55 if data_set.number == 55 else _head_2414
    mode_number, (freq_hz, damping, mass), conjugate, i = read_head(data_set, analysis == _NORMAL)
    nodes, values = _values(data_set, i, per_node, data_type in (5, 6))
    if specific in _RATES:
        mass = 0.0  # a modal mass of 1 scales displacements, not these values
    lines, where = _id_lines(data_set), data_set.where()
    shape = values.conj() if conjugate else values
    return ModeRecord(
        number=mode_number,
        freq_hz=freq_hz,
        damping_ratio=damping,
        modal_mass=mass,
        id_lines=lines,
        nodes=nodes,
        values=shape,
        where=where,
        conjugate=conjugate,
    )


Modal = tuple[float, float, float]
"""Frequency in Hz, damping ratio, modal mass."""


def _head_55(data_set: DataSet, normal: bool) -> tuple[int, Modal, bool, int]:
    """Mode number, frequency, damping and mass, whether they are those of the conjugate, and the line after them."""
    n_integers, n_reals = (as_int(text, data_set, 6) for text in fixed(line_at(data_set, 6), [10, 10]))
    if not (2 <= n_integers <= 6 and 1 <= n_reals <= 12):
        raise data_set.error("uff.value/mode-record", 6, n_integers=n_integers, n_reals=n_reals)
    mode_number = as_int(line_at(data_set, 6)[30:40], data_set, 6)
    reals, i = _floats(data_set, 7, n_reals)
    if normal:
        return mode_number, _normal(data_set, 7, reals), False, i
    modal, conjugate = _pole(data_set, 7, reals)
    return mode_number, modal, conjugate, i


def _head_2414(data_set: DataSet, normal: bool) -> tuple[int, Modal, bool, int]:
    """As `_head_55`: two lines of integers, the sixth of which is the mode number, and two lines of six reals.

    The reals are time, frequency, eigenvalue, modal mass, viscous and hysteretic damping ratio; real and imaginary part
    of the pole, and two constants.
    """
    first = _ID_LINES_2414 + 6
    integers = fixed(line_at(data_set, first), [10] * 8)
    mode_number = as_int(integers[5], data_set, first, blank=0)
    reals, _ = _floats(data_set, first + 2, 6)
    more, i = _floats(data_set, first + 3, 6)
    _, freq_hz, eigenvalue, mass, viscous, hysteretic = reals
    if not freq_hz and eigenvalue > 0.0:
        freq_hz = math.sqrt(eigenvalue) / (2.0 * math.pi)
    if not normal and any(more[:2]):
        modal, conjugate = _pole(data_set, first + 3, more)
        return mode_number, modal, conjugate, i
    return mode_number, _normal(data_set, first + 2, [freq_hz, mass, viscous, hysteretic]), False, i


def _floats(data_set: DataSet, i: int, count: int) -> tuple[list[float], int]:
    """`count` numbers in columns of 13, six a line, from line `i` on; and the line after them."""
    numbers: list[float] = []
    while len(numbers) < count:
        line = line_at(data_set, i)
        columns = -(-len(line) // 13)
        numbers += [as_float(text, data_set, i) for text in fixed(line, [13] * columns)]
        wanted = min(count, 6 * -(-len(numbers) // 6)) if numbers else count
        check_count(data_set, "values in a record", wanted, len(numbers), i)
        i += 1
    return numbers, i


def _normal(data_set: DataSet, i: int, reals: Sequence[float]) -> Modal:
    """Frequency, damping ratio (viscous, or half the hysteretic loss factor), modal mass."""
    freq_hz, mass, viscous, hysteretic = (*reals, 0.0, 0.0, 0.0)[:4]
    if freq_hz < 0 or mass < 0:
        raise data_set.error("uff.value/mode-sign", i)
    damping = viscous if viscous else hysteretic / 2
    return freq_hz, damping if damping else math.nan, mass


def _pole(data_set: DataSet, i: int, reals: Sequence[float]) -> tuple[Modal, bool]:
    """Frequency and damping of a pole, and whether it is the one of negative frequency; 0 Hz for a real pole."""
    real, imaginary = (*reals, 0.0)[:2]
    size = math.hypot(real, imaginary)
    if not (0.0 < size < math.inf):
        raise data_set.error("uff.pole", i, values={"pole": f"{real:g}{imaginary:+g}i"})
    if imaginary == 0.0:
        return (0.0, -real / size, 0.0), False
    return (size / (2 * math.pi), -real / size, 0.0), imaginary < 0.0


def _values(data_set: DataSet, i: int, per_node: int, is_complex: bool) -> tuple[tuple[int, ...], NDArray]:
    nodes, rows = [], []
    while i < len(data_set.lines):
        nodes.append(as_int(data_set.lines[i], data_set, i))
        row, i = _floats(data_set, i + 1, per_node * (2 if is_complex else 1))
        rows.append(row)
    repeated = {node for node in nodes if node <= 0 or nodes.count(node) > 1} if _has_repeats(nodes) else set()
    if repeated:
        raise data_set.error("uff.duplicate-node/in-mode", repeated=sorted(repeated)[:5])
    table = np.array(rows, dtype=float).reshape(len(nodes), -1)
    return tuple(nodes), table[:, 0::2] + 1j * table[:, 1::2] if is_complex else table


def _has_repeats(nodes: Sequence[int]) -> bool:
    return len(set(nodes)) < len(nodes) or any(node <= 0 for node in nodes)


def mode_set(records: Sequence[ModeRecord], source: str) -> tuple[ModeSet | None, tuple[Notice, ...]]:
    """The modes as one ModeSet; components that are zero in every mode count as not measured.

    Shapes keep the scale of the file; they are called mass-normalised where every modal mass is stated as 1.

    Raises
    ------
    FemtuneError : ``uff.repeated-mode``, ``uff.modes-differ`` where the modes have not the same nodes,
        ``uff.no-dofs`` where all values are zero
    """
    if not records:
        return None, ()
    records, told = _numbered(*_one_of_each_pair(records))
    records, lacking = _at_common_nodes(records)
    order = {node: i for i, node in enumerate(records[0].nodes)}
    table = np.stack([r.values[np.argsort([order[n] for n in r.nodes])] for r in records], axis=2)
    measured = np.argwhere((table != 0).any(axis=2))
    if not measured.size:
        raise FemtuneError("uff.no-dofs", where=records[0].where)
    first = 0 if table.shape[1] == _VALUES_OF[_SCALAR] else 1
    dofs = DofSet(Dof(records[0].nodes[i], DIRECTIONS[first + k]) for i, k in measured)
    damping = np.array([r.damping_ratio for r in records])
    modes = ModeSet(
        np.array([r.freq_hz for r in records]),
        table[measured[:, 0], measured[:, 1]],
        dofs,
        tuple(str(r.number) for r in records),
        None if np.isnan(damping).any() else damping,
        "mass" if all(abs(r.modal_mass - 1) < _UNIT_MASS for r in records) else "unknown",
        source=source,
    )
    return modes, (*told, *lacking, *_dropped(table, records[0]), *_damping_notice(damping, records[0]))


_SAME_POLE = 1e-4
"""Relative difference up to which two poles are a conjugate pair: the format has six digits."""


def _one_of_each_pair(records: Sequence[ModeRecord]) -> tuple[list[ModeRecord], list[Notice]]:
    """Without poles of negative frequency whose conjugates are in the file too; the others stand for these."""
    upper = [one for one in records if not one.conjugate]

    def has_partner(one: ModeRecord) -> bool:
        return any(
            abs(other.freq_hz / one.freq_hz - 1.0) < _SAME_POLE
            and abs(other.damping_ratio - one.damping_ratio) < _SAME_POLE
            for other in upper
        )

    kept = [one for one in records if not (one.conjugate and has_partner(one))]
    dropped, turned = len(records) - len(kept), sum(one.conjugate for one in kept)
    if not dropped and not turned:
        return kept, []
    first = next(one for one in records if one.conjugate)
    return kept, [Notice("uff.pole/conjugate", where=first.where, level="info", n_dropped=dropped, n_turned=turned)]


def _numbered(records: list[ModeRecord], told: list[Notice]) -> tuple[list[ModeRecord], list[Notice]]:
    """Modes with numbers of their own: by their order in the file, where all of them have one number.

    Raises
    ------
    FemtuneError : ``uff.repeated-mode`` for other repeated numbers, as in a file with several configurations
    """
    seen: dict[int, ModeRecord] = {}
    again = [one for one in records if seen.setdefault(one.number, one) is not one]
    if not again:
        return records, told
    if len(seen) > 1 or not _one_series(records):
        raise _repeated(again[0], seen[again[0].number])
    notice = Notice("uff.mode-numbers", where=records[0].where, level="info", number=records[0].number)
    return [replace(one, number=i) for i, one in enumerate(records, 1)], [*told, notice]


def _one_series(records: Sequence[ModeRecord]) -> bool:
    """Whether modes of one number are those of one configuration: ID lines of one wording, and no frequency twice."""
    wordings = {tuple(re.sub(r"[-+\d.,eE\s]+", " ", line) for line in one.id_lines) for one in records}
    return len(wordings) == 1 and len({one.freq_hz for one in records}) == len(records)


_LEAST_COMMON = 0.5
"""Part of the nodes that all modes must have more than: with fewer, lines are lost, or these are several tests."""


def _at_common_nodes(records: Sequence[ModeRecord]) -> tuple[list[ModeRecord], list[Notice]]:
    """The modes at the nodes that all of them have; a few others are left out.

    Raises
    ------
    FemtuneError : ``uff.modes-differ``
    """
    first = records[0]
    common = set(first.nodes).intersection(*(one.nodes for one in records))
    every = set(first.nodes).union(*(one.nodes for one in records))
    for one in records:
        differ = sorted(set(first.nodes) ^ set(one.nodes))
        if one.values.shape[1:] != first.values.shape[1:] or (differ and len(common) <= _LEAST_COMMON * len(every)):
            raise FemtuneError(
                "uff.modes-differ",
                where=one.where,
                values={"nodes in one of them only": differ[:8], "first": first.where},
                record_number=one.number,
                first_number=first.number,
            )
    lacking = sorted(every - common)
    if not lacking:
        return list(records), []
    modes = [one.number for one in records if not every <= set(one.nodes)]
    notice = Notice(
        "uff.modes-differ/nodes", where=first.where, nodes=", ".join(map(str, lacking[:8])), n_nodes=len(lacking),
        modes=", ".join(map(str, modes[:8])),
    )  # fmt: skip
    return [_at(one, common) for one in records], [notice]


def _at(record: ModeRecord, nodes: set[int]) -> ModeRecord:
    rows = [i for i, node in enumerate(record.nodes) if node in nodes]
    return replace(record, nodes=tuple(record.nodes[i] for i in rows), values=record.values[rows])


def _repeated(record: ModeRecord, first: ModeRecord) -> FemtuneError:
    return FemtuneError(
        "uff.repeated-mode",
        where=record.where,
        values={"first": first.where, "its ID lines": " | ".join(first.id_lines)},
        record_number=record.number,
    )


def _dropped(table: NDArray, first: ModeRecord) -> tuple[Notice, ...]:
    count = int((~(table != 0).any(axis=2)).sum())
    if not count:
        return ()
    return (Notice("uff.not-measured", where=first.where, level="info", count=count, n_components=table[:, :, 0].size),)


def _damping_notice(damping: NDArray[np.float64], first: ModeRecord) -> tuple[Notice, ...]:
    missing = int(np.isnan(damping).sum())
    if not 0 < missing < len(damping):
        return ()
    return (Notice("uff.damping", where=first.where, missing=missing, n_damping=len(damping)),)
