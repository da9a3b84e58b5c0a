"""Read the modes that a solver has computed."""

from __future__ import annotations

from pathlib import Path

from femtune.files.formats import MODES_FORMATS, ModesFormatKey
from femtune.files.modes.solved import SolvedModes


def read_modes(path: Path, format: ModesFormatKey) -> SolvedModes:
    """Modes of a solver's output file.

    Raises
    ------
    FemtuneError : ``external.output`` in its variants, ``install.missing``
    """
    return MODES_FORMATS[format].read(path)
