"""Records as sound: WAV files of any number of channels; whole numbers become fractions of full scale."""

from __future__ import annotations

import struct
import warnings
from pathlib import Path

import numpy as np

from femtune.files.records.table import RecordTable, problem


def read_wav(path: Path) -> RecordTable:
    """Channels and sampling rate of a WAV file.

    Raises
    ------
    FemtuneError : ``record.file`` for a file that is cut short or no WAV file
    """
    from scipy.io import wavfile  # noqa: PLC0415  as in the reader of MATLAB files

    try:
        with warnings.catch_warnings():
            # scipy warns of a file that ends too early, and of chunks that nobody needs
            warnings.filterwarnings("error", message=".*prematurely.*")
            warnings.filterwarnings("ignore")
            warnings.filterwarnings("error", message=".*prematurely.*")
            rate, data = wavfile.read(path)
    except (ValueError, EOFError, OSError, struct.error, LookupError, wavfile.WavFileWarning) as bad:
        hint = "it may be cut short: export it again"
        raise problem(path, "record.file", f"this is no readable WAV file: {str(bad)[:120]}", hint) from bad
    values = np.atleast_2d(data.T).astype(float)
    if data.dtype.kind in "iu":
        middle = 128.0 if data.dtype == np.uint8 else 0.0
        values = (values - middle) / (128.0 if middle else -float(np.iinfo(data.dtype).min))
    return RecordTable(values, ("",) * len(values), float(rate), None, str(path))
