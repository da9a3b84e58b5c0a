"""Data set 55 as modes. Parsed here: pyuff cannot hold complex rotations, loses its place where a record takes
two lines, and refuses D exponents."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import DIRECTIONS, Dof, DofSet
from femtune.errors import FemtuneError, Notice, Where
from femtune.files.uff.fields import as_float, as_int, check_count, fixed, line_at
from femtune.files.uff.scan import DataSet
from femtune.modal import ModeSet

# types of analysis of data set 55
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
_UNIT_MASS = 1e-6
"""Difference of a modal mass from 1 up to which a shape is mass-normalised: the format has six digits."""


@dataclass(frozen=True, eq=False)
class ModeRecord:
    """One data set 55: mode number, frequency, damping (NaN where not stated), modal mass (0 where not stated),
    ID lines, node numbers (n,) and values (n, 1, 3 or 6) as they stand in the file."""

    number: int
    freq_hz: float
    damping_ratio: float
    modal_mass: float
    id_lines: tuple[str, ...]
    nodes: tuple[int, ...]
    values: NDArray
    where: Where


def read_mode_records(
    sets: Iterable[DataSet], records: str | None
) -> tuple[tuple[ModeRecord, ...], tuple[Notice, ...]]:
    """The modes of a file whose ID lines contain the word `records` (all of them where it is None).

    Raises
    ------
    FemtuneError : ``uff.no-record``, ``uff.truncated``, ``uff.count``, ``uff.value``, ``uff.pole``,
        ``uff.duplicate-node``
    """
    all_of_them = [one for one in sets if one.number == 55]
    chosen = [one for one in all_of_them if records is None or _has_word(one, records)]
    if records is not None and not chosen:
        raise _no_record(all_of_them, records)
    notices = {i: notice for i, one in enumerate(chosen) if (notice := _no_mode(one)) is not None}
    return tuple(_record(one) for i, one in enumerate(chosen) if i not in notices), tuple(notices.values())


def _id_lines(data_set: DataSet) -> tuple[str, ...]:
    return tuple(line_at(data_set, i).strip() for i in range(5))


def _has_word(data_set: DataSet, word: str) -> bool:
    return any(re.search(rf"(?<!\w){re.escape(word)}(?!\w)", line) for line in _id_lines(data_set))


def _no_record(sets: Sequence[DataSet], word: str) -> FemtuneError:
    seen = sorted({" | ".join(line for line in _id_lines(one) if line not in ("", "NONE")) for one in sets})
    return FemtuneError(
        "uff.no-record",
        where=sets[0].where() if sets else None,
        values={"ID lines of the file": "; ".join(seen[:6]) or "there is no data set 55"},
        word=word,
    )


def _parameters(data_set: DataSet) -> list[int]:
    return [as_int(text, data_set, 5) for text in fixed(line_at(data_set, 5), [10] * 6)]


def _no_mode(data_set: DataSet) -> Notice | None:
    """The notice about a data set 55 that is not a mode."""
    _, analysis, characteristic, specific, data_type, per_node = _parameters(data_set)
    if analysis not in (_NORMAL, *_COMPLEX):
        return Notice("uff.not-a-mode/analysis", where=data_set.where(), analysis=analysis)
    if characteristic not in _VALUES_OF or specific not in _MOTION:
        facts: dict[str, Any] = {"characteristic": characteristic, "data_type": specific}
        return Notice("uff.not-a-mode/values", where=data_set.where(), **facts)
    if data_type not in (2, 5):
        raise data_set.error("uff.value/mode-data-type", 5, data_type=data_type)
    check_count(data_set, "values per node", _VALUES_OF[characteristic], per_node, 5)
    return None


def _record(data_set: DataSet) -> ModeRecord:
    _, analysis, _, specific, data_type, per_node = _parameters(data_set)
    n_integers, n_reals = (as_int(text, data_set, 6) for text in fixed(line_at(data_set, 6), [10, 10]))
    if not (2 <= n_integers <= 6 and 1 <= n_reals <= 12):
        raise data_set.error("uff.value/mode-record", 6, n_integers=n_integers, n_reals=n_reals)
    mode_number = as_int(line_at(data_set, 6)[30:40], data_set, 6)
    reals, i = _floats(data_set, 7, n_reals)
    freq_hz, damping, mass = _normal(data_set, reals) if analysis == _NORMAL else _pole(data_set, reals)
    nodes, values = _values(data_set, i, per_node, data_type == 5)
    if specific in _RATES:
        mass = 0.0  # a modal mass of 1 scales displacements, not these values
    lines, where = _id_lines(data_set), data_set.where()
    return ModeRecord(mode_number, freq_hz, damping, mass, lines, nodes, values, where)


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


def _normal(data_set: DataSet, reals: Sequence[float]) -> tuple[float, float, float]:
    """Frequency, damping ratio (viscous, or half the hysteretic loss factor), modal mass."""
    freq_hz, mass, viscous, hysteretic = (*reals, 0.0, 0.0, 0.0)[:4]
    if freq_hz < 0 or mass < 0:
        raise data_set.error("uff.value/mode-sign", 7)
    damping = viscous if viscous else hysteretic / 2
    return freq_hz, damping if damping else math.nan, mass


def _pole(data_set: DataSet, reals: Sequence[float]) -> tuple[float, float, float]:
    real, imaginary = (*reals, 0.0)[:2]
    size = math.hypot(real, imaginary)
    if imaginary <= 0 or not math.isfinite(size):
        raise data_set.error("uff.pole", 7, values={"pole": f"{real:g}{imaginary:+g}i"})
    return size / (2 * math.pi), -real / size, 0.0


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
    _check_alike(records)
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
    return modes, (*_dropped(table, records[0]), *_damping_notice(damping, records[0]))


def _check_alike(records: Sequence[ModeRecord]) -> None:
    first = records[0]
    seen: dict[int, ModeRecord] = {}
    for record in records:
        if seen.setdefault(record.number, record) is not record:
            raise _repeated(record, seen[record.number])
        missing = sorted(set(first.nodes) ^ set(record.nodes))
        if missing or first.values.shape != record.values.shape:
            raise FemtuneError(
                "uff.modes-differ",
                where=record.where,
                values={"nodes in one of them only": missing[:8], "first": first.where},
                record_number=record.number,
                first_number=first.number,
            )


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
