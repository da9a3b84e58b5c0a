"""Datasets of HDF5 whose values lie in other files are refused, and so are chunks that fill the memory."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.files.records.arrays import LARGEST_BYTES, open_hdf5

h5py = pytest.importorskip("h5py")


def _external(folder: Path) -> None:
    np.arange(6.0).tofile(folder / "secret.bin")
    with h5py.File(folder / "r.h5", "w") as file:
        file.create_dataset("acc", shape=(6,), dtype="<f8", external=[(str(folder / "secret.bin"), 0, 48)])


def _virtual(folder: Path) -> None:
    with h5py.File(folder / "secret.bin", "w") as file:
        file["x"] = np.arange(6.0)
    layout = h5py.VirtualLayout((6,), "f8")
    layout[:] = h5py.VirtualSource(str(folder / "secret.bin"), "x", (6,))
    with h5py.File(folder / "r.h5", "w") as file:
        file.create_virtual_dataset("acc", layout)


def _virtual_of_external(folder: Path) -> None:
    _external(folder)
    layout = h5py.VirtualLayout((6,), "f8")
    layout[:] = h5py.VirtualSource(".", "inner", (6,))
    with h5py.File(folder / "r.h5", "a") as file:
        file.move("acc", "inner")
        file.create_virtual_dataset("acc", layout)


@pytest.mark.parametrize("make", [_external, _virtual, _virtual_of_external])
def test_values_elsewhere_are_refused(tmp_path: Path, make: object) -> None:
    make(tmp_path)  # type: ignore[operator]
    with open_hdf5(tmp_path / "r.h5") as arrays, pytest.raises(FemtuneError) as caught:
        np.asarray(arrays["acc"])
    assert "secret.bin" in str(caught.value)
    check_shown("record.other-file", str(caught.value).replace(str(tmp_path), "FOLDER"))


def test_a_virtual_dataset_of_the_file_itself_is_read(tmp_path: Path) -> None:
    layout = h5py.VirtualLayout((6,), "f8")
    layout[:] = h5py.VirtualSource(".", "x", (6,))
    with h5py.File(tmp_path / "r.h5", "w") as file:
        file["x"] = np.arange(6.0)
        file.create_virtual_dataset("acc", layout)
    with open_hdf5(tmp_path / "r.h5") as arrays:
        np.testing.assert_array_equal(np.asarray(arrays["acc"]), np.arange(6.0))


def test_a_link_to_another_file_is_not_followed(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["x"] = np.arange(6.0)
    with h5py.File(tmp_path / "r.h5", "w") as file:
        file["acc"] = h5py.ExternalLink(str(tmp_path / "secret.h5"), "/x")
        file["own"] = np.arange(3.0)
    with open_hdf5(tmp_path / "r.h5") as arrays:
        assert list(arrays) == ["own"]


def test_a_chunk_far_larger_than_its_file_is_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "r.h5", "w") as file:
        chunk = (LARGEST_BYTES // 8 + 1,)
        file.create_dataset("acc", shape=(4,), maxshape=(None,), chunks=chunk, dtype="<f8", compression="gzip")
    with open_hdf5(tmp_path / "r.h5") as arrays, pytest.raises(FemtuneError, match=r"record\.too-large"):
        np.asarray(arrays["acc"])
