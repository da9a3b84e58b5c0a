"""A trained basis of a reduced model on disk: plain arrays and no objects (npz), from which training goes on."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where
from femtune.files.whole_file import write_whole_by
from femtune.model import ConfiguredModel
from femtune.model.reduce import SavedBasis, Trained

Arrays = dict[str, NDArray]

_VERSION = 1
"""Of the form of the file."""
_TROUBLES = (OSError, ValueError, KeyError, EOFError, RuntimeError, MemoryError, OverflowError, zipfile.BadZipFile)


def save_basis(trained: Trained, path: Path | str) -> None:
    """Write basis, certified points and estimates; the file appears whole or not at all.

    Raises
    ------
    OSError : the disk is full or refuses
    """
    saved = SavedBasis.of(trained)
    arrays = {"shift": np.asarray(saved.shift), **_arrays(saved)}
    digest = np.frombuffer(trained.model.configured.terms_digest.encode("ascii"), np.uint8)
    arrays |= {"version": np.asarray(_VERSION), "digest": digest}
    write_whole_by(Path(path), lambda stream: _pack(stream, arrays))


def _arrays(saved: SavedBasis) -> Arrays:
    """Its arrays of real numbers, by name."""
    return {
        "basis": np.asarray(saved.basis),
        "x": np.asarray(saved.x),
        "eigenvalues": np.asarray(saved.eigenvalues),
        "known": np.asarray(saved.known),
        "points": np.asarray(saved.points),
        "estimates": np.asarray(saved.estimates),
    }


def _pack(stream: IO[bytes], arrays: Arrays) -> None:
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asarray(array, order="C"), allow_pickle=False)


def load_basis(path: Path | str, configured: ConfiguredModel) -> SavedBasis:
    """What `save_basis` wrote, for `Trainer.resume`.

    Raises
    ------
    FemtuneError : ``reduce.damaged`` where the file is not one of these, ``reduce.other-model`` where it belongs to
        other terms
    """
    path = Path(path)
    try:
        arrays = _read(path)
        saved = SavedBasis(
            shift=float(arrays["shift"]),
            basis=arrays["basis"],
            x=arrays["x"],
            eigenvalues=arrays["eigenvalues"],
            known=arrays["known"],
            points=arrays["points"],
            estimates=arrays["estimates"],
        )
        _check(arrays, saved)
    except _TROUBLES as error:
        raise FemtuneError("reduce.damaged", where=Where(str(path)), reason=error) from error
    mine = configured.terms_digest.encode("ascii")
    if arrays["digest"].tobytes() != mine or saved.basis.shape[0] != configured.n_free:
        raise FemtuneError("reduce.other-model", where=Where(str(path)))
    return saved


def _read(path: Path) -> Arrays:
    with zipfile.ZipFile(path) as archive:
        # stored parts can hold no more than the file's own size
        if any(m.compress_type != zipfile.ZIP_STORED for m in archive.infolist()):
            raise ValueError("a part of it is compressed")
    with np.load(path, allow_pickle=False) as members:
        return {name: members[name] for name in members.files}


def _check(arrays: Arrays, saved: SavedBasis) -> None:
    if int(arrays["version"]) != _VERSION:
        raise ValueError("it is of another version")
    for name, array in _arrays(saved).items():
        if array.dtype != np.float64:
            raise ValueError(f"{name} holds no numbers")
    saved.check()
