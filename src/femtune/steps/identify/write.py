"""Files of an identification: modes as Universal File and table, poles as table, state-space model, record."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import FemtuneError, Notice
from femtune.files.deviations import deviations_text
from femtune.files.uff import check_modes, write_uff_modes
from femtune.files.whole_file import write_whole
from femtune.identification.choice import Limits, stable
from femtune.journal.run_files import REPORT_FILE
from femtune.modal import ModeSet
from femtune.steps.run_folder import unwritable
from femtune.testdata import ModalTest
from femtune.units import unit_system

if TYPE_CHECKING:
    from femtune.modal import StateSpace
    from femtune.steps.identify.identified import Found
    from femtune.steps.identify.record import Identification

RECORD_FILE = "identified.json"
MODES_FILE = "modes.uff"
TABLE_FILE = "modes.csv"
POLES_FILE = "poles.csv"
SYSTEM_FILE = "system.npz"
DEVIATIONS_FILE = "deviations.json"
WRITTEN_FILES = (MODES_FILE, TABLE_FILE, POLES_FILE, SYSTEM_FILE, DEVIATIONS_FILE, REPORT_FILE)
"""All files of an identification beside its record, which tells that a folder is that of an identification."""


def test_of_modes(identified: Found, title: str, units: str) -> ModalTest:
    """The modes as a test that a study can read, without those of the excitation."""
    name = title if title.isprintable() and len(title) <= 80 else "identified"
    of_structure = [i for i in range(len(identified.modes)) if identified.of_structure(i)]
    return ModalTest(name, unit_system(units), identified.geometry, modes=identified.modes.select_modes(of_structure))


def no_modes_file(test: ModalTest, *, named: bool) -> Notice | None:
    """Why the modes are not written as a Universal File; None where they are.

    Columns that are not `named` are numbered: they are no scalar points of a model, so that no study can read them.
    """
    assert test.modes is not None
    if not named and not test.modes.dofs.components.any():
        return Notice("identify.no-modes-file/not-named", level="info")
    try:
        check_modes([_plain(test)])
    except FemtuneError as error:
        return Notice("identify.no-modes-file", reason=error.what)
    return None


def write_found(folder: Path, identified: Found, record: Identification, test: ModalTest | None) -> list[str]:
    """Write all files; returns their names. `test` has the modes for a study, None where they are not written.

    Raises
    ------
    FemtuneError : ``run.unwritable``
    """
    files: dict[str, bytes] = {RECORD_FILE: _json(record), TABLE_FILE: _modes_table(identified)}
    if identified.table is not None:
        files[POLES_FILE] = _poles_table(identified)
    if identified.system is not None:
        files[SYSTEM_FILE] = _packed(identified.system)
    try:
        # modes of an earlier identification would pass for those of this one
        for name in set(WRITTEN_FILES) - {*files, REPORT_FILE}:
            (folder / name).unlink(missing_ok=True)
        for name, content in files.items():
            write_whole(folder / name, content)
    except OSError as error:
        raise unwritable(folder, error) from error
    return [*files, *([] if test is None else _uff(folder, test))]


def _json(record: Identification) -> bytes:
    return json.dumps(record.model_dump(mode="json"), indent=1, ensure_ascii=False, allow_nan=False).encode()


def _uff(folder: Path, test: ModalTest) -> list[str]:
    assert test.modes is not None
    write_uff_modes(folder / MODES_FILE, _plain(test))
    text = deviations_text(test.modes)
    if text is None:
        return [MODES_FILE]
    write_whole(folder / DEVIATIONS_FILE, text.encode())
    return [MODES_FILE, DEVIATIONS_FILE]


def _plain(test: ModalTest) -> ModalTest:
    """Labels of the modes as the format counts them."""
    modes = test.modes
    assert modes is not None
    plain = ModeSet(
        modes.freq_hz, modes.shapes, modes.dofs, damping_ratio=modes.damping_ratio, normalisation=modes.normalisation
    )
    return replace(test, modes=plain)


def _modes_table(identified: Found) -> bytes:
    modes = identified.modes
    heads = ["label", "freq_hz", "freq_sd_hz", "damping_ratio", "damping_sd", *identified.by_method]
    rows = []
    for i, label in enumerate(modes.labels):
        values = [
            modes.freq_hz,
            modes.freq_sd_hz,
            modes.damping_ratio,
            modes.damping_sd,
            *identified.by_method.values(),
        ]
        rows.append([label, *("" if v is None or not np.isfinite(v[i]) else f"{v[i]:.8g}" for v in values)])
    return _csv(heads, rows)


def _poles_table(identified: Found) -> bytes:
    table = identified.table
    assert table is not None
    firm = stable(table, Limits())
    chosen = {int(i) for c in identified.candidates if c.chosen for i in c.members}
    rows = [
        [table.method[i], int(table.order[i]), f"{f:.8g}", f"{z:.6g}", int(firm[i]), int(i in chosen)]
        for i, (f, z) in enumerate(zip(table.freq_hz, table.damping_ratio, strict=True))
    ]
    return _csv(["method", "order", "freq_hz", "damping_ratio", "stable", "of_a_mode"], rows)


def _csv(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(heads)
    writer.writerows(rows)
    return text.getvalue().encode()


def _packed(system: StateSpace) -> bytes:
    buffer = io.BytesIO()
    responses, references = (np.array([str(dof) for dof in dofs]) for dofs in (system.responses, system.references))
    np.savez(
        buffer, A=system.A, B=system.B, C=system.C, D=system.D, kind=np.array(system.kind), responses=responses,
        references=references,
    )  # fmt: skip
    return buffer.getvalue()
