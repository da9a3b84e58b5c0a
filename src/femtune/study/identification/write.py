"""Files of an identification: modes as Universal File and table, poles as table, state-space model, record."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import FemtuneError
from femtune.files.deviations import deviations_text
from femtune.files.uff import write_uff_modes
from femtune.files.whole_file import write_whole
from femtune.identification.choice import Limits, stable
from femtune.modal import ModeSet
from femtune.results.folder import unwritable
from femtune.testdata import ModalTest
from femtune.units import unit_system

if TYPE_CHECKING:
    from femtune.modal import StateSpace
    from femtune.study.identification.found import Found
    from femtune.study.identification.records import Identification

RECORD_FILE, MODES_FILE, TABLE_FILE, POLES_FILE, SYSTEM_FILE, DEVIATIONS_FILE = (
    "identified.json", "modes.uff", "modes.csv", "poles.csv", "system.npz", "deviations.json",
)  # fmt: skip


def write_found(folder: Path, found: Found, record: Identification, *, named: bool = True) -> list[str]:
    """Write all files; returns their names.

    Columns that are not `named` are numbered: they are no scalar points of a model, so that no study can read them.

    Raises
    ------
    FemtuneError : ``run.unwritable``
    """
    files: dict[str, bytes] = {RECORD_FILE: _json(record), TABLE_FILE: _modes_table(found)}
    if found.table is not None:
        files[POLES_FILE] = _poles_table(found)
    if found.system is not None:
        files[SYSTEM_FILE] = _packed(found.system)
    try:
        for name, content in files.items():
            write_whole(folder / name, content)
    except OSError as error:
        raise unwritable(folder, error) from error
    numbered = not named and not found.modes.dofs.components.any()
    return [*files, *([] if numbered else _uff(folder, found, record))]


def _json(record: Identification) -> bytes:
    return json.dumps(record.model_dump(mode="json"), indent=1, ensure_ascii=False, allow_nan=False).encode()


def _uff(folder: Path, found: Found, record: Identification) -> list[str]:
    """Modes for a study, without the excitation's; none where the format cannot hold them."""
    name = record.title if record.title.isprintable() and len(record.title) <= 80 else "identified"
    of_structure = [i for i, mode in enumerate(record.modes) if not mode.of_input]
    modes = found.modes.select_modes(of_structure)
    test = ModalTest(name, unit_system(record.units), found.geometry, modes=_plain(modes))
    text = deviations_text(modes)
    try:
        write_uff_modes(folder / MODES_FILE, test)
    except FemtuneError as error:
        if error.code != "uff.cannot-write" or error.where is not None:
            raise
        return []
    if text is None:
        return [MODES_FILE]
    write_whole(folder / DEVIATIONS_FILE, text.encode())
    return [MODES_FILE, DEVIATIONS_FILE]


def _plain(modes: ModeSet) -> ModeSet:
    """Labels as the format counts them."""
    return ModeSet(
        modes.freq_hz, modes.shapes, modes.dofs, damping_ratio=modes.damping_ratio, normalisation=modes.normalisation
    )


def _modes_table(found: Found) -> bytes:
    modes = found.modes
    heads = ["label", "freq_hz", "freq_sd_hz", "damping_ratio", "damping_sd", *found.by_method]
    rows = []
    for i, label in enumerate(modes.labels):
        values = [modes.freq_hz, modes.freq_sd_hz, modes.damping_ratio, modes.damping_sd, *found.by_method.values()]
        rows.append([label, *("" if v is None or not np.isfinite(v[i]) else f"{v[i]:.8g}" for v in values)])
    return _csv(heads, rows)


def _poles_table(found: Found) -> bytes:
    table = found.table
    assert table is not None
    firm = stable(table, Limits())
    chosen = {int(i) for c in found.candidates if c.chosen for i in c.members}
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
