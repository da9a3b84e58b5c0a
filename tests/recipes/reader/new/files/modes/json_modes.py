"""Modes in a JSON file: an object with the list ``freq_hz``."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from femtune.errors import FemtuneError, Where
from femtune.files.modes.solved import SolvedModes, lines_of, no_modes


def read_json_modes(path: Path) -> SolvedModes:
    """Frequencies of a file.

    Raises
    ------
    FemtuneError : ``external.output`` in its variants
    """
    try:
        found = json.loads("\n".join(lines_of(path)))
        freq_hz = np.array(found["freq_hz"], dtype=float)
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise FemtuneError("external.output/unreadable", where=Where(str(path)), reason=str(error)[:200]) from error
    if freq_hz.ndim != 1 or not freq_hz.size or not np.isfinite(freq_hz).all():
        raise no_modes(path, "freq_hz")
    return SolvedModes.of_frequencies(freq_hz)
