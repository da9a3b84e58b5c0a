"""Repeated tests of a study: which column, or which mode of which file, repeats which test mode."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.correlation import pair_modes
from femtune.errors import FemtuneError, Where, did_you_mean, raise_together
from femtune.files.repeats_table import read_repeats_table
from femtune.files.uff import read_uff
from femtune.modal import ModeSet
from femtune.study.error_places import errors_at
from femtune.testdata.checks import real_modes
from femtune.units import unit_system

if TYPE_CHECKING:
    from collections.abc import Sequence

    from femtune.dofs import DofSet
    from femtune.files.repeats_table import RepeatsTable
    from femtune.files.study_file import ConfigurationEntry, QuantifyTable
    from femtune.study.cases import StudyCase
    from femtune.study.study import Study

_HIGHEST_HZ = 1e12
"""Frequency above which a number in a table of repeats is refused; its square stays far from overflow."""
_TABLE_SUFFIXES = (".csv", ".txt", ".tsv", ".dat")
"""Suffixes of files that are tables of frequencies; all others are read as Universal Files."""


@dataclass(frozen=True, eq=False)
class Repeats:
    """Repeated frequencies of a configuration: (n, t) in Hz for the test's modes, NaN where they were not measured."""

    case: StudyCase
    hz: NDArray[np.float64]
    shapes: NDArray[np.float64] | None = None
    """(n, t, sensors of the test) shapes of the repeats, NaN where not measured; None for a table of frequencies."""

    @property
    def measured(self) -> tuple[int, ...]:
        """Positions of the test modes that at least one repeat has."""
        return tuple(int(i) for i in np.flatnonzero(np.isfinite(self.hz).any(axis=0)))

    def of_modes(self, labels: tuple[str, ...]) -> NDArray[np.float64]:
        """(n, m) repeats of the modes with these labels, in this order."""
        known = self.case.compared.test.labels if self.case.compared is not None else ()
        return self.hz[:, [known.index(label) for label in labels]]


def read_repeats(study: Study, table: QuantifyTable) -> Repeats:
    """The repeats that [quantify] names.

    Raises
    ------
    FemtuneError : ``quantify.configuration``, ``quantify.columns``, ``quantify.file``, ``uff.*``
    """
    case = _case(study, table)
    paths = [study.file.path_of(name) for name in table.repeats]
    with errors_at(study.file.where("quantify", "repeats")):
        if len(paths) == 1 and paths[0].suffix.lower() in _TABLE_SUFFIXES and not table.shapes:
            return Repeats(case, _of_table(study, case, table, read_repeats_table(paths[0]), paths[0]))
        if table.shapes and paths[0].suffix.lower() in _TABLE_SUFFIXES:
            raise FemtuneError("quantify.shapes", where=study.file.where("quantify", "shapes"))
        repeats = [_of_uff(study, case, path) for path in paths]
        return Repeats(case, np.array([hz for hz, _ in repeats]), np.array([shapes for _, shapes in repeats]))


def _case(study: Study, table: QuantifyTable) -> StudyCase:
    """The configuration that is named, or the only one with modes."""
    with_modes = [c for c in study.cases if c.modal is not None]
    wanted = [c for c in with_modes if table.configuration in (None, c.name)]
    if len(wanted) == 1:
        return wanted[0]
    names = [c.name for c in with_modes]
    asked = table.configuration
    code = "quantify.configuration" if asked is None else "quantify.configuration/without-modes"
    hint = did_you_mean(asked, names) if asked else f'configuration = "{names[0]}"' if names else ""
    raise FemtuneError(
        code, where=study.file.where("quantify", "configuration"),
        values={"configurations with modes": ", ".join(names) or "none"},
        hint=hint if names else None, configuration=asked,
    )  # fmt: skip


def _of_table(
    study: Study, case: StudyCase, table: QuantifyTable, repeats: RepeatsTable, path: Path
) -> NDArray[np.float64]:  # fmt: skip
    assert case.compared is not None
    labels = case.compared.test.labels
    heads = table.columns or tuple(h.removeprefix("mode ").strip() for h in repeats.heads)
    _check_columns(study, heads, repeats, labels, given=bool(table.columns))
    hz = np.full((len(repeats.values), len(labels)), np.nan)
    used = [column for column, head in enumerate(heads) if head]
    hz[:, [labels.index(heads[column]) for column in used]] = repeats.values[:, used]
    _check_frequencies(repeats, used, heads, path)
    return hz


def _check_frequencies(repeats: RepeatsTable, used: list[int], heads: Sequence[str], path: Path) -> None:
    """Refuse impossible frequencies: zero, negative or huge ones; missing values (NaN) are allowed."""
    hz = repeats.values[:, used]
    raise_together(
        FemtuneError(
            "quantify.file",
            where=Where(str(path), repeats.lines[row]),
            repeat=row + 1,
            mode=heads[used[column]],
            frequency_hz=hz[row, column],
        )
        for row, column in np.argwhere((hz <= 0.0) | (hz > _HIGHEST_HZ)).tolist()
    )


def _check_columns(
    study: Study, heads: tuple[str, ...], repeats: RepeatsTable, labels: tuple[str, ...], *, given: bool
) -> None:
    """Refuse columns without a test mode, or two of one mode: nothing is guessed from their order."""
    named = [h for h in heads if h]
    unknown = [h for h in named if h not in labels]
    if len(heads) == len(repeats.heads) and named and not unknown and len(set(named)) == len(named):
        return
    why = (
        f"'{unknown[0]}' is not a mode of the test"
        if unknown
        else "there is not one label for each column, or a mode is named twice"
    )
    raise FemtuneError(
        "quantify.columns",
        where=study.file.where("quantify", "columns" if given else "repeats"),
        values={"columns of the file": ", ".join(repeats.heads), "modes of the test": ", ".join(labels)},
        reason=why,
    )


def _of_uff(study: Study, case: StudyCase, path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(t,) frequencies and (t, sensors) shapes of one repeat: its modes are paired with the test's by their shapes."""
    assert case.compared is not None
    test, rules = case.compared.test, case.compared.rules
    hz, shapes = np.full(len(test), np.nan), np.full((len(test), len(test.dofs)), np.nan)
    modes = _modes(study, case.entry, path)
    common = test.dofs.common(modes.dofs)
    if not len(common):
        raise FemtuneError(
            "quantify.file/no-common-sensor",
            values={"sensors of the test": len(test.dofs), "of the file": len(modes.dofs)},
            file=path.name,
        )
    a, b = (ModeSet(m.freq_hz, _at(m, common), common) for m in (test, modes))
    pairing = pair_modes(a, b, frequency_gate=rules.frequency_gate, mac_gate=rules.mac_gate, relative_gap=-1.0)
    rows, signs = common.align(test.dofs)
    for pair in pairing.pairs:
        hz[pair.test] = modes.freq_hz[pair.model]
        shapes[pair.test, rows] = signs * np.real(b.shapes[:, pair.model])
    return hz, shapes


def _at(modes: ModeSet, dofs: DofSet) -> NDArray:
    rows, signs = dofs.align(modes.dofs)
    return np.asarray(signs[:, None] * modes.shapes[rows])


def _modes(study: Study, entry: ConfigurationEntry, path: Path) -> ModeSet:
    file_units = unit_system(entry.test_units) if entry.test_units else None
    modes = read_uff(path, units=study.file.study.unit_system, file_units=file_units, records=entry.records).test.modes
    if modes is None:
        raise FemtuneError("quantify.file/no-modes", file=path.name)
    return real_modes(modes).modes
