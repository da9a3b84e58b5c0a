"""Records as arrays: NumPy's .npy and .npz, MATLAB's .mat, HDF5; nothing in them is executed."""

from __future__ import annotations

import math
import struct
import warnings
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any
from zipfile import ZipFile, is_zipfile

import numpy as np
from numpy.typing import NDArray

from femtune._optional import require
from femtune.errors import FemtuneError, did_you_mean
from femtune.files.records.table import (
    COMPLEX_KINDS,
    NUMBER_KINDS,
    REAL_KINDS,
    RecordTable,
    as_columns,
    check_columns,
    in_seconds,
    is_time,
    problem,
    time_unit,
)

NamedArrays = Mapping[str, Any]
"""Arrays of a file by name: of numpy, or made into them when they are used."""
_RATE_NAMES = ("fs", "sampling_hz", "sampling_rate", "sample_rate", "samplerate", "srate")

_STEP_NAMES = ("dt", "delta_t", "time_step", "timestep")


LARGEST_BYTES = 1 << 28
"""Bytes that arrays may take whatever the size of their file: 256 MiB."""
LARGEST_EXPANSION = 20.0
"""Size of larger arrays relative to their file: measured numbers cannot be compressed to a twentieth."""
_MOST_NAMES = 10_000
"""Arrays of a file, and elements of a structure, that are listed."""
_DEEPEST = 20
"""Levels of nested structures that are listed."""


@contextmanager
def open_npy(path: Path) -> Iterator[NamedArrays]:
    """The array of an .npy, called "", or those of an .npz; Python objects in them are refused.

    Raises
    ------
    FemtuneError : ``record.file``, ``record.too-large``
    """
    yield _npy_arrays(path)


@contextmanager
def open_mat(path: Path) -> Iterator[NamedArrays]:
    """The variables of a MATLAB file of any version; fields of structures as ``a.b``.

    Raises
    ------
    FemtuneError : ``record.file``, ``record.too-large``
    """
    if _is_hdf5(path):
        with open_hdf5(path) as arrays:
            yield arrays
    else:
        yield _mat_arrays(path)


def _is_hdf5(path: Path) -> bool:
    """The signature stands at the start, or behind the 512 bytes that MATLAB puts before it."""
    with path.open("rb") as stream:
        head = stream.read(520)
    return b"\x89HDF\r\n\x1a\n" in (head[:8], head[512:520])


def _npy_arrays(path: Path) -> dict[str, np.ndarray]:
    try:
        _check_zip(path)
        # a stream of our own: numpy leaves the file of a broken archive open
        with np.errstate(all="ignore"), path.open("rb") as stream:
            loaded: Any = np.load(stream, allow_pickle=False)
            return {name: loaded[name] for name in loaded.files} if hasattr(loaded, "files") else {"": loaded}
    except FemtuneError:
        raise
    # numpy raises whatever its own code stumbles over in a damaged file
    except Exception as bad:
        raise problem(path, "record.file", first_line=_first_line(bad)) from bad


def _mat_arrays(path: Path) -> dict[str, Any]:
    """Arrays of a MATLAB file before version 7.3; fields of structures as ``a.b``, elements as ``a(2).b``, ``c{3}``."""
    from scipy.io import loadmat  # noqa: PLC0415  half a second that no other step wants

    try:
        _check_mat(path)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            arrays = loadmat(path)
    except FemtuneError:
        raise
    # scipy likewise
    except Exception as bad:
        raise problem(path, "record.file/matlab", first_line=_first_line(bad)) from bad
    arrays_by_name: dict[str, Any] = {}
    for name, array in arrays.items():
        if not name.startswith("__"):
            _flatten(arrays_by_name, name, array, 0)
    return arrays_by_name


def _flatten(listed: dict[str, Any], name: str, array: Any, depth: int) -> None:
    fields = getattr(getattr(array, "dtype", None), "names", None)
    is_cell = getattr(getattr(array, "dtype", None), "kind", "") == "O" and not fields
    if len(listed) >= _MOST_NAMES or depth > _DEEPEST:
        return
    if not fields and not is_cell:
        listed[name] = array
        return
    elements = np.asarray(array).ravel(order="F")
    for i, element in enumerate(elements[:_MOST_NAMES], 1):
        at = name if len(elements) == 1 and fields else f"{name}({i})" if fields else f"{name}{{{i}}}"
        for field in fields or ("",):
            _flatten(listed, f"{at}.{field}" if fields else at, element[field] if fields else element, depth + 1)


@contextmanager
def open_hdf5(path: Path) -> Iterator[NamedArrays]:
    """Datasets of numbers by name, groups with slashes or dots; each is read when it is used.

    Raises
    ------
    FemtuneError : ``record.file``, ``record.too-large``
    """
    h5py = require("h5py", extra="hdf5")
    datasets: dict[str, _Dataset] = {}

    def keep(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and len(datasets) < _MOST_NAMES:
            complex_pair = item.dtype.names is not None and set(item.dtype.names) == {"real", "imag"}
            if item.dtype.kind in (*REAL_KINDS, *COMPLEX_KINDS) or complex_pair:
                datasets[name] = _Dataset(item, path)

    try:
        with h5py.File(path, "r") as file:
            file.visititems(keep)
            yield {**datasets, **{name.replace("/", "."): item for name, item in datasets.items()}}
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as bad:
        raise problem(path, "record.file/hdf5", first_line=_first_line(bad)) from bad


class _Dataset:
    """A dataset of HDF5, read when it is made an array; MATLAB stores its axes in reverse order."""

    def __init__(self, dataset: Any, path: Path) -> None:
        self._dataset, self._path = dataset, path
        self._turned = "MATLAB_class" in dataset.attrs
        self.shape = tuple(dataset.shape[::-1] if self._turned else dataset.shape)
        self.ndim, self.size = len(self.shape), int(dataset.size)
        self.dtype = np.dtype(complex) if dataset.dtype.names else dataset.dtype

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        _check_own_values(self._dataset, self._path)
        check_size(self._path, int(self._dataset.nbytes))
        raw = self._dataset[()]
        values = raw["real"] + 1j * raw["imag"] if raw.dtype.names else raw
        turned = np.asarray(values.T if self._turned else values)
        return turned if dtype is None else turned.astype(dtype)


def _check_own_values(dataset: Any, path: Path) -> None:
    """Refuse a dataset whose values lie in other files of this machine, and chunks that fill the memory.

    Raises
    ------
    FemtuneError : ``record.other-file``, ``record.too-large``
    """
    others = list(_elsewhere(dataset, 0))
    if others:
        raise problem(
            path, "record.other-file", name=dataset.name, others=", ".join(dict.fromkeys(others[:_MOST_TOLD]))
        )
    # a chunk is read as a whole, and may be larger than the dataset
    check_size(path, math.prod(dataset.chunks or ()) * dataset.dtype.itemsize)


def _elsewhere(dataset: Any, depth: int) -> Iterator[str]:
    """Other files that have values of a dataset, itself or by datasets of its own file that it is composed of."""
    yield from (_text_of(name) for name, *_ in dataset.external or ())
    for source in dataset.virtual_sources() if dataset.is_virtual else ():
        inner = dataset.file.get(source.dset_name, getlink=True) if source.file_name == "." else None
        if inner is None or type(inner).__name__ != "HardLink" or depth > _DEEPEST:
            yield _text_of(source.file_name)
        else:
            yield from _elsewhere(dataset.file[source.dset_name], depth + 1)


_MOST_TOLD = 5
"""Names of other files that a message lists."""


def _text_of(name: Any) -> str:
    return name.decode("utf-8", "replace") if isinstance(name, bytes) else str(name)


# ----------------------------------------------------------------------------------------------------
# Sizes that a file declares, checked before anything is read: a few kilobytes can inflate to gigabytes.


def check_size(path: Path, declared: int) -> None:
    """Refuse arrays that are far larger than their file (error ``record.too-large``)."""
    stored = max(path.stat().st_size, 1)
    if declared > max(LARGEST_BYTES, LARGEST_EXPANSION * stored):
        values = {"file": f"{stored / 1e6:.3g} MB", "declared": f"{declared / 1e6:.3g} MB"}
        raise problem(path, "record.too-large", values=values)


def _check_zip(path: Path) -> None:
    """The sizes of an .npz as its directory states them, and that no array states a larger one."""
    if not is_zipfile(path):
        return
    with ZipFile(path) as archive:
        check_size(path, sum(info.file_size for info in archive.infolist()))


def _check_mat(path: Path) -> None:
    """Inflate the compressed parts piece by piece and count, only if they could exceed the limit."""
    if path.stat().st_size * _LARGEST_DEFLATE_RATIO <= LARGEST_BYTES:
        return
    with path.open("rb") as stream:
        order = "<" if stream.read(128)[126:128] == b"IM" else ">"
        total = 0
        while len(tag := stream.read(8)) == 8:
            kind, size = struct.unpack(order + "II", tag)
            if kind == _COMPRESSED:
                total = _counted(path, stream, size, total)
            else:
                stream.seek(size, 1)


_COMPRESSED = 15
"""Data type miCOMPRESSED of an element of a MATLAB file."""
_LARGEST_DEFLATE_RATIO = 1032
"""Bytes that deflate makes of one byte at most."""
_PIECE_BYTES = 1 << 20
"""Bytes that are inflated together."""


def _counted(path: Path, stream: IO[bytes], size: int, total: int) -> int:
    inflate = zlib.decompressobj()
    while size > 0 and (piece := stream.read(min(size, _PIECE_BYTES))):
        size -= len(piece)
        while piece:
            total += len(inflate.decompress(piece, _PIECE_BYTES))
            check_size(path, total)
            piece = inflate.unconsumed_tail
    return total


def _first_line(bad: BaseException) -> str:
    return str(bad).splitlines()[0][:120] if str(bad) else type(bad).__name__


def table_of(path: Path, arrays: NamedArrays, variable: str | None) -> RecordTable:
    """The array of a name as a table of columns; without a name the only one that can be meant, or a column each."""
    if variable is None and (columns := _channels_by_name(arrays)):
        rows = [np.asarray(arrays[name], dtype=float).ravel() for name in columns]
        check_columns(len(rows), path)
        named_times = [(name, row) for name, row in zip(columns, rows) if is_time(_last(name))]
        times = next((_in_seconds(name, row) for name, row in named_times), None)
        kept = [(name, row) for name, row in zip(columns, rows) if not is_time(_last(name))]
        return RecordTable(
            np.array([row for _, row in kept]), tuple(n for n, _ in kept), _rate(arrays), times, str(path)
        )
    values = as_columns(np.asarray(arrays[_wanted(path, arrays, variable)]), path)
    return RecordTable(values, ("",) * len(values), _rate(arrays), _times(arrays, values.shape[1]), str(path))


def _in_seconds(name: str, times: NDArray) -> NDArray:
    return in_seconds(times, time_unit(_last(name)) or 1.0)


def _last(name: str) -> str:
    """The part of a name behind the structures or groups that hold it."""
    return name.replace("/", ".").rsplit(".", 1)[-1]


def _distinct(arrays: NamedArrays) -> dict[str, Any]:
    """The arrays without the second names that groups with dots have."""
    return {name: a for name, a in arrays.items() if "." not in name or name.replace(".", "/") not in arrays}


def _vectors(arrays: NamedArrays) -> dict[str, int]:
    """Names and lengths of the arrays of real numbers with one dimension, MATLAB's rows and columns among them."""
    sizes = {}
    for name, a in _distinct(arrays).items():
        shape = getattr(a, "shape", ())
        if len(shape) in (1, 2) and a.size > 1 and a.dtype.kind in NUMBER_KINDS and a.size == max(shape):
            sizes[name] = int(a.size)
    return sizes


def _times(arrays: NamedArrays, samples: int) -> NDArray | None:
    """A vector of times beside the record, as long as this."""
    for name, size in _vectors(arrays).items():
        if is_time(_last(name)) and size == samples:
            return _in_seconds(name, np.asarray(arrays[name], dtype=float).ravel())
    return None


def _channels_by_name(arrays: NamedArrays) -> list[str]:
    """Names of arrays of one length that are a channel each, () if there is a table, or lengths differ."""
    vectors = _vectors(arrays)
    tables = [
        name for name, a in _distinct(arrays).items()
        if name not in vectors and getattr(a, "ndim", 0) == 2 and a.size > 1 and a.dtype.kind in NUMBER_KINDS
    ]  # fmt: skip
    channels = [name for name in vectors if not is_time(_last(name))]
    if tables or len(vectors) < 2 or not channels or len(set(vectors.values())) > 1:
        return []
    return list(vectors)


def named(path: Path, arrays: Mapping[str, Any], variable: str) -> Any:
    """The array of a name (error ``record.variable``)."""
    if variable in arrays:
        return arrays[variable]
    shown = ", ".join(sorted(arrays)[:20]) or "none"
    hint = did_you_mean(variable, arrays)
    raise problem(path, "record.variable", values={"variables": shown}, hint=hint, variable=variable)


def _wanted(path: Path, arrays: Mapping[str, Any], variable: str | None) -> str:
    if variable is not None:
        named(path, arrays, variable)
        return variable
    samples = {max(a.shape) for a in arrays.values() if getattr(a, "ndim", 0) == 2 and min(a.shape) > 1}
    vectors = _vectors(arrays)
    arrays = {
        name: a for name, a in _distinct(arrays).items()
        if not (is_time(_last(name)) and vectors.get(name) in samples)
    }  # fmt: skip
    tables = [
        name for name, a in arrays.items() if getattr(a, "ndim", 0) == 2 and a.size > 1 and a.dtype.kind in NUMBER_KINDS
    ]
    candidates = [name for name in tables if min(arrays[name].shape) > 0] or list(arrays)
    if len(candidates) != 1:
        shown = ", ".join(f"{name} {getattr(arrays[name], 'shape', '')}" for name in sorted(candidates)) or "none"
        raise problem(path, "record.variable/several", values={"variables": shown}, n_found=len(candidates))
    return candidates[0]


def _rate(arrays: Mapping[str, Any]) -> float | None:
    """A single positive number whose name says that it is a sampling rate."""
    for name, array in arrays.items():
        last = _last(name.lower())
        if last in (*_RATE_NAMES, *_STEP_NAMES) and getattr(array, "size", 0) == 1 and array.dtype.kind in NUMBER_KINDS:
            value = float(np.asarray(array).reshape(()))
            rate = 1.0 / value if last in _STEP_NAMES and value else value
            return rate if np.isfinite(rate) and rate > 0.0 else None
    return None
