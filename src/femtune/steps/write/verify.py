"""The written deck beside the update: it is called updated.bdf only if it is the same model."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import FemtuneError
from femtune.files.nastran.lines import rounded
from femtune.journal.run_files import DECK_FILE, UNVERIFIED_FILE
from femtune.parameters.jet import constant

if TYPE_CHECKING:
    from femtune.arrays import Integers, Reals
    from femtune.fem import FieldRef, Structure
    from femtune.steps.write.record import WriteBackResults

LARGEST_FREQUENCY_DIFFERENCE = 1e-3
"""Relative difference of a natural frequency between update and written deck above which they are different models.

A value of four digits, the fewest that a positive value has in a field of eight characters, is rounded by 0.05 % at
most, which changes a frequency by 0.025 %. Frequencies of repeated modal tests scatter by more than 0.1 %.
"""
LARGEST_VALUE_DIFFERENCE = 2.0 * LARGEST_FREQUENCY_DIFFERENCE
"""Relative difference of a value above which they are different models: a frequency changes by at most half of it.
Rounding may be larger."""
_FIELD = 8
"""Characters of a small field."""
_RIGID = 1e-3
"""Frequency relative to the highest one below which a mode is a rigid-body mode, whose frequency is rounding."""


def value_differences(structure: Structure, values: Mapping[FieldRef, float], written: Structure) -> Iterator[str]:
    """Values of elements that are not those of the update in the deck as it is read again, a sentence for each field.

    `values` are those of the update in the fields of `structure`.
    """
    table = structure.values
    given = {entry: v for ref, v in values.items() if (entry := table.index(ref)) is not None}
    expected = table.evaluate({entry: constant(v, 0) for entry, v in given.items()}, 0).value
    allowed = LARGEST_VALUE_DIFFERENCE * np.abs(expected)
    for entry, value in given.items():
        allowed[entry] = max(allowed[entry], abs(rounded(value, _FIELD) - value))
    there = _by_role(written, written.values.values)
    wrong: dict[int, list[float]] = {}
    for (card, role), (ids, positions) in _by_role(structure, np.arange(len(expected))).items():
        if (card, role) not in there:
            continue
        known, read_back = there[card, role]
        at = np.minimum(np.searchsorted(known, ids), len(known) - 1)
        differ = (known[at] != ids) | (np.abs(read_back[at] - expected[positions]) > allowed[positions])
        for i in np.flatnonzero(differ):
            wrong.setdefault(int(positions[i]), []).append(float(read_back[at[i]]))
    for position, found_values in wrong.items():
        ref, count = table.refs[position], len(found_values)
        elements = "1 element" if count == 1 else f"{count} elements"
        yield f"{ref} is {found_values[0]:.6g} instead of {expected[position]:.6g} for {elements}"


def _by_role(
    structure: Structure, of_entry: Integers | Reals
) -> dict[tuple[str, str], tuple[Integers, Integers | Reals]]:
    """For each card and role, the numbers of the elements, ascending, and what belongs to their entries."""
    parts: dict[tuple[str, str], list[tuple[Integers, Integers]]] = {}
    for batch in structure.batches:
        for role, positions in batch.roles.items():
            parts.setdefault((batch.card, role), []).append((batch.ids, positions))
    out = {}
    for key, entries in parts.items():
        ids, positions = (np.concatenate(arrays) for arrays in zip(*entries))
        order = np.argsort(ids, kind="stable")
        out[key] = ids[order], of_entry[positions[order]]
    return out


def frequency_differences(configuration: str, after: Sequence[float], written: Sequence[float]) -> Iterator[str]:
    """The mode whose frequency differs most, if it is more than `LARGEST_FREQUENCY_DIFFERENCE`."""
    n = min(len(after), len(written))
    update, deck = np.array(after[:n]), np.array(written[:n])
    elastic = update > _RIGID * update.max(initial=0.0)
    change = np.where(elastic, np.abs(deck / np.where(elastic, update, 1.0) - 1.0), 0.0)
    if n and change.max() > LARGEST_FREQUENCY_DIFFERENCE:
        k = int(change.argmax())
        yield f"mode {k + 1} ({configuration}) has {deck[k]:.5g} Hz instead of {update[k]:.5g} Hz"


def named_if_same(record: WriteBackResults, differences: Iterable[str], folder: Path) -> WriteBackResults:
    """Give the written deck its name, unless it differs from the update."""
    record = record.model_copy(update={"differences": (*record.differences, *differences)})
    if not record.differences:
        renamed = {name: str(PurePath(name).with_name(DECK_FILE)) for name in _unverified(record)}
        for name, new in renamed.items():
            (folder / name).replace(folder / new)
        record = record.model_copy(update={"files": tuple(renamed.get(name, name) for name in record.files)})
    return record


def _unverified(record: WriteBackResults) -> list[str]:
    return [name for name in record.files if PurePath(name).name == UNVERIFIED_FILE]


def check_same(record: WriteBackResults, folder: Path) -> None:
    """Refuse a written deck that differs from the update (error ``write.differs``)."""
    if record.differences:
        deck = ", ".join(str(folder / name) for name in _unverified(record))
        raise FemtuneError("write.differs", values={"deck as written": deck}, difference="; ".join(record.differences))
