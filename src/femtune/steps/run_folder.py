"""The run folder: ``results.json`` and ``arrays.npz``, written completely or not at all, and checked when read."""

from __future__ import annotations

import errno
import io
import json
import os
import re
import tempfile
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from femtune.errors import FemtuneError, Where
from femtune.files.whole_file import write_whole
from femtune.journal.run_files import ARRAYS_FILE, RESULTS_FILE
from femtune.steps.migration import is_known, migrate
from femtune.steps.results import SCHEMA_VERSION, Results

MOST_ARRAY_BYTES = 4 << 30
"""Bytes of all arrays, unpacked, that are read: a damaged or hostile file must not fill the memory."""
_VERSION_NUMBER = re.compile("[1-9][0-9]{0,8}")
"""Text of a version of the schema."""


def write_results(folder: Path | str, results: Results, arrays: Mapping[str, NDArray[Any]]) -> Path:
    """Write `results` and `arrays` into `folder` (made if absent); returns the path of ``results.json``.

    Each file is written under a temporary name and then renamed. The arrays come first, so that
    ``results.json`` never refers to missing arrays.

    Raises
    ------
    FemtuneError : ``run.unwritable``; ``run.arrays`` where a key has no array, or an array holds Python objects
    """
    folder = Path(folder)
    _check_arrays(folder, results, arrays)
    text = json.dumps(results.model_dump(mode="json"), indent=1, ensure_ascii=False, allow_nan=False)
    packed = _pack(arrays)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(folder / ARRAYS_FILE, packed)
        write_whole(folder / RESULTS_FILE, text.encode())
    except OSError as error:
        raise unwritable(folder, error) from error
    return folder / RESULTS_FILE


def read_results(folder: Path | str) -> tuple[Results, dict[str, NDArray[Any]]]:
    """Read what `write_results` wrote: the results and their arrays by key.

    Results of an earlier schema version are migrated; the files stay as they are.

    Raises
    ------
    FemtuneError : ``run.missing``, ``run.damaged``, ``run.version`` or ``run.arrays``
    """
    folder = Path(folder)
    results = _read_json(folder / RESULTS_FILE)
    arrays = _read_arrays(folder / ARRAYS_FILE)
    _check_arrays(folder, results, arrays)
    return results, arrays


def check_writable(folder: Path | str) -> None:
    """Create `folder` and check that files can be written, before the analysis starts.

    Raises
    ------
    FemtuneError : ``run.unwritable``
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except (OSError, ValueError) as error:
        # ValueError: a name that no folder can have
        raise unwritable(folder, error) from error


def unwritable(folder: Path, error: OSError | ValueError) -> FemtuneError:
    """The error that a run folder refuses a file."""
    return FemtuneError("run.unwritable/folder", where=Where(str(folder)), reason=_reason(folder, error))


def _reason(folder: Path, error: OSError | ValueError) -> str:
    taken = next((p for p in (folder, *folder.parents) if os.path.isfile(p)), None)
    return str(getattr(error, "strerror", None) or error) if taken is None else f"{taken.name} is a file, not a folder"


def _pack(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """An .npz archive in memory; `_check_arrays` has refused arrays of objects."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for key in sorted(arrays):
            # a fixed date keeps the archive of equal arrays equal, byte by byte
            with archive.open(zipfile.ZipInfo(f"{key}.npy", (1980, 1, 1, 0, 0, 0)), "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, np.asanyarray(arrays[key]), allow_pickle=False)
    return buffer.getvalue()


def _read_json(path: Path) -> Results:
    try:
        data = json.loads(_read_bytes(path))
    except (ValueError, RecursionError) as error:
        raise _damaged(path, str(error)) from error
    _check_version(path, data)
    migrate(data)
    try:
        return Results.model_validate_json(json.dumps(data))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"]))
        raise _damaged(path, f"{first['msg']} ({error.error_count()} problems)", place) from error


def _read_bytes(path: Path) -> bytes:
    try:
        # a pipe would be waited for without end
        if path.exists() and not path.is_file():
            raise OSError(errno.EINVAL, "it is not an ordinary file")
        return path.read_bytes()
    except OSError as error:
        raise FemtuneError(
            "run.missing", where=Where(str(path)), file=path.name, reason=error.strerror or error
        ) from error


def _check_version(path: Path, data: Any) -> None:
    version = data.get("schema_version") if isinstance(data, dict) else None
    if not isinstance(version, str):
        raise _damaged(path, "the key schema_version is missing or is no text")
    if is_known(version):
        return
    newer = _VERSION_NUMBER.fullmatch(version) is not None and int(version) > int(SCHEMA_VERSION)
    raise FemtuneError(
        "run.version" if newer else "run.version/unknown",
        where=Where(str(path), record="schema_version"),
        version=version,
        supported=SCHEMA_VERSION,
    )


def _read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    content = _read_bytes(path)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > MOST_ARRAY_BYTES:
                raise _damaged(path, f"its arrays are larger than {MOST_ARRAY_BYTES >> 30} GiB")
            return {name.removesuffix(".npy"): _unpack(archive, name) for name in archive.namelist()}
    # what zipfile, zlib and numpy raise on damaged archives
    except (zipfile.BadZipFile, zlib.error, ValueError, OSError, EOFError, RuntimeError, MemoryError) as error:
        raise _damaged(path, str(error)) from error


def _unpack(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    with archive.open(name) as entry:
        return np.lib.format.read_array(entry, allow_pickle=False)


def _damaged(path: Path, why: str, record: str = "") -> FemtuneError:
    return FemtuneError("run.damaged", where=Where(str(path), record=record), file=path.name, reason=why)


def _check_arrays(folder: Path, results: Results, arrays: Mapping[str, NDArray[Any]]) -> None:
    missing = [key for key in results.array_keys() if key not in arrays]
    objects = [key for key, array in arrays.items() if np.asanyarray(array).dtype.hasobject]
    if missing or objects:
        raise FemtuneError(
            "run.arrays",
            where=Where(str(folder / ARRAYS_FILE)),
            values={"missing": ", ".join(missing) or "none", "objects": ", ".join(objects) or "none"},
        )
