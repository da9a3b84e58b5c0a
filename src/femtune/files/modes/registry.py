"""Formats of the modes that solvers write, by the name that a study uses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Literal

from femtune.files.modes.abaqus import read_abaqus_dat
from femtune.files.modes.ansys_rst import read_rst
from femtune.files.modes.calculix import read_dat, read_frd
from femtune.files.modes.nastran_op2 import read_op2_modes
from femtune.files.modes.nastran_text import read_f06, read_punch
from femtune.files.modes.plain_table import read_plain_table
from femtune.files.modes.solved import SolvedModes

ModesFormat = Literal[
    "abaqus-dat", "ansys-rst", "calculix-dat", "calculix-frd", "nastran-f06", "nastran-op2", "nastran-punch", "table"
]

READERS: Mapping[ModesFormat, Callable[[Path], SolvedModes]] = {
    "abaqus-dat": read_abaqus_dat,
    "ansys-rst": read_rst,
    "calculix-dat": read_dat,
    "calculix-frd": read_frd,
    "nastran-f06": read_f06,
    "nastran-op2": read_op2_modes,
    "nastran-punch": read_punch,
    "table": read_plain_table,
}

ERROR_TEXTS: Mapping[ModesFormat, tuple[str, ...]] = {
    "abaqus-dat": ("***ERROR",),
    "ansys-rst": ("*** ERROR ***",),
    "calculix-dat": ("*ERROR",),
    "calculix-frd": ("*ERROR",),
    "nastran-f06": ("FATAL MESSAGE", "*ERROR"),
    "nastran-op2": ("FATAL MESSAGE", "*ERROR"),
    "nastran-punch": ("FATAL MESSAGE", "*ERROR"),
    "table": (),
}
"""What solvers print where a run has failed, whatever exit code they end with."""


def read_modes(path: Path, format: ModesFormat) -> SolvedModes:
    """Modes of a solver's output file.

    Raises
    ------
    FemtuneError : ``external.output`` in its variants, ``install.missing``
    """
    return READERS[format](path)
