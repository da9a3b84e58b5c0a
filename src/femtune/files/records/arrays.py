"""Records as arrays: NumPy's .npy and .npz, MATLAB's .mat, HDF5; nothing in them is executed."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from femtune._optional import require
from femtune.errors import did_you_mean
from femtune.files.records.table import RecordTable, as_columns, problem

_RATES = ("fs", "sampling_hz", "sampling_rate", "sample_rate", "samplerate", "srate")


def read_npy(path: Path, variable: str | None = None) -> RecordTable:
    """One array, or that called `variable` of an .npz; Python objects in it are refused."""
    try:
        # a stream of our own: numpy leaves the file of a broken archive open
        with np.errstate(all="ignore"), path.open("rb") as stream:
            loaded: Any = np.load(stream, allow_pickle=False)
            arrays = {name: loaded[name] for name in loaded.files} if hasattr(loaded, "files") else {"": loaded}
    except (ValueError, EOFError, OSError, KeyError, BadZipFile, zlib.error) as bad:
        raise problem(path, "record.file", first_line=_first_line(bad)) from bad
    return _table(path, arrays, variable)


def read_mat(path: Path, variable: str | None = None) -> RecordTable:
    """A variable of a MATLAB file, of version 7.3 too."""
    from scipy.io import loadmat, matlab  # noqa: PLC0415  half a second that no other step wants

    try:
        arrays = loadmat(path)
    except NotImplementedError:
        return read_hdf5(path, variable)
    except (
        ValueError,
        TypeError,
        OSError,
        EOFError,
        LookupError,
        struct.error,
        zlib.error,
        matlab.MatReadError,
    ) as bad:
        raise problem(path, "record.file/matlab", first_line=_first_line(bad)) from bad
    return _table(path, {k: v for k, v in arrays.items() if not k.startswith("__")}, variable)


def read_hdf5(path: Path, variable: str | None = None) -> RecordTable:
    """A dataset of an HDF5 file; groups are written with slashes."""
    h5py = require("h5py", extra="hdf5")
    arrays: dict[str, np.ndarray] = {}

    def keep(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "iufb":
            arrays[name] = item

    try:
        with h5py.File(path, "r") as file:
            file.visititems(keep)
            return _table(path, arrays, variable)
    except OSError as bad:
        raise problem(path, "record.file/hdf5", first_line=_first_line(bad)) from bad


def _first_line(bad: BaseException) -> str:
    return str(bad).splitlines()[0][:120] if str(bad) else type(bad).__name__


def _table(path: Path, arrays: Mapping[str, Any], variable: str | None) -> RecordTable:
    values = as_columns(np.asarray(arrays[_wanted(path, arrays, variable)]), path)
    return RecordTable(values, ("",) * len(values), _rate(arrays), None, str(path))


def _wanted(path: Path, arrays: Mapping[str, Any], variable: str | None) -> str:
    if variable is not None:
        if variable in arrays:
            return variable
        shown = ", ".join(sorted(arrays)) or "none"
        hint = did_you_mean(variable, arrays)
        raise problem(path, "record.variable", values={"variables": shown}, hint=hint, variable=variable)
    tables = [name for name, a in arrays.items() if getattr(a, "ndim", 0) == 2 and a.size > 1 and a.dtype.kind in "iuf"]
    found = [name for name in tables if min(arrays[name].shape) > 0] or list(arrays)
    if len(found) != 1:
        shown = ", ".join(f"{name} {getattr(arrays[name], 'shape', '')}" for name in sorted(found)) or "none"
        raise problem(path, "record.variable/several", values={"variables": shown}, n_found=len(found))
    return found[0]


def _rate(arrays: Mapping[str, Any]) -> float | None:
    """A single positive number whose name says that it is a sampling rate."""
    for name, array in arrays.items():
        value = np.asarray(array)
        if name.lower().rsplit("/", 1)[-1] in _RATES and value.size == 1 and value.dtype.kind in "iuf":
            rate = float(value.reshape(()))
            return rate if np.isfinite(rate) and rate > 0.0 else None
    return None
