"""Files of the journal are read without trust: damage is told, nothing is executed, nothing is unpacked."""

from __future__ import annotations

import io
import json
import os
import pickle
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from femtune.journal.entry import DamagedEntryError, Entry, read_entry, write_entry

MOST = 1 << 24
ENTRY = Entry(
    {"shapes": np.arange(12.0).reshape(3, 4).T, "empty": np.zeros((0, 2, 2)), "one": np.array(1.0)},
    {"kind": "modes", "shift": -0.1, "notices": []},
)


def why(path: Path, most: int = MOST) -> str:
    with pytest.raises(DamagedEntryError) as caught:
        read_entry(path, most)
    return str(caught.value)


def archive(path: Path, *members: tuple[str, bytes], compression: int = zipfile.ZIP_STORED) -> Path:
    with zipfile.ZipFile(path, "w", compression) as made:
        for name, content in (("facts.json", b"{}"), *members):
            made.writestr(name, content)
    return path


def npy(array: Any, **options: Any) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.asarray(array), **options)
    return stream.getvalue()


def header(shape: str, descr: str = "'<f8'", order: str = "False") -> bytes:
    text = f"{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


def test_what_was_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    write_entry(path, ENTRY)
    found = read_entry(path, MOST)
    assert found is not None
    assert found.facts == ENTRY.facts
    assert set(found.arrays) == set(ENTRY.arrays)
    for name, array in ENTRY.arrays.items():
        np.testing.assert_array_equal(found.arrays[name], array)
        assert found.arrays[name].shape == array.shape
        assert found.arrays[name].flags.c_contiguous
    assert path.stat().st_size <= ENTRY.n_bytes
    assert set(np.load(path)) == {*ENTRY.arrays, "facts.json"}
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]


def test_no_file_is_no_damage(tmp_path: Path) -> None:
    assert read_entry(tmp_path / "a.npz", MOST) is None


class Trap:
    def __reduce__(self) -> Any:
        return os.mkdir, ("unpickled",)


def test_pickles_stay_packed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    objects = npy(np.array([Trap()], dtype=object), allow_pickle=True)
    assert "no plain numbers" in why(archive(tmp_path / "a.npz", ("shapes.npy", objects)))
    bare = pickle.dumps(Trap())
    assert why(archive(tmp_path / "b.npz", ("shapes.npy", bare)))
    (tmp_path / "c.npz").write_bytes(bare)
    assert why(tmp_path / "c.npz")
    assert not (tmp_path / "unpickled").exists()


def test_a_bomb_is_not_unpacked(tmp_path: Path) -> None:
    path = archive(tmp_path / "a.npz", ("shapes.npy", npy(np.zeros(10**6))), compression=zipfile.ZIP_DEFLATED)
    assert path.stat().st_size < 10**5
    assert "compressed" in why(path)


def test_claims_are_not_believed(tmp_path: Path) -> None:
    path = archive(tmp_path / "a.npz", ("shapes.npy", npy(np.zeros(5))))
    content = path.read_bytes()
    size = len(npy(np.zeros(5))).to_bytes(4, "little")
    path.write_bytes(content.replace(size, (1 << 30).to_bytes(4, "little")))
    assert "larger than the file" in why(path)
    for shape in ("(1000000000000,)", "(-1, -5)", "(4,)", "(True, 5)", "(10**9,)", "5"):
        assert why(archive(tmp_path / "b.npz", ("shapes.npy", header(shape) + bytes(40))))


@pytest.mark.parametrize(
    "content",
    [npy([1.0, np.nan]), npy([np.inf]), npy(["text"]), npy(np.zeros(2, "f8,i4")), npy(np.array(["2020"], "M8[D]")),
     npy([1.0], version=(2, 0)), npy([1.0])[:-1], npy([1.0]) + b"x", header("(1,)", order="True") + bytes(8),
     header("(1,)", "[('a', 'O')]") + bytes(8), header("(1,)", "'<f8', __import__('os')") + bytes(8), b""],
)  # fmt: skip
def test_odd_arrays(tmp_path: Path, content: bytes) -> None:
    assert why(archive(tmp_path / "a.npz", ("shapes.npy", content)))


@pytest.mark.parametrize("facts", [b"[]", b"{", b"\xff", b"[" * 100_000, b'{"a":' * 50_000, b" " * (2 << 20)])
def test_odd_facts(tmp_path: Path, facts: bytes) -> None:
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as made:
        made.writestr("facts.json", facts)
    assert why(tmp_path / "a.npz")


def test_odd_archives(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as made:
        made.writestr("shapes.npy", npy([1.0]))
    assert "facts.json" in why(tmp_path / "a.npz")
    many = [(f"{i}.npy", npy([1.0])) for i in range(100)]
    assert "too many" in why(archive(tmp_path / "b.npz", *many))
    with pytest.warns(UserWarning, match="Duplicate"):
        path = archive(tmp_path / "c.npz", ("x.npy", npy([1.0])), ("x.npy", npy([2.0])))
    assert "one name" in why(path)
    odd = archive(tmp_path / "d.npz", ("../../x.npy", npy([1.0])), ("/etc/y.npy", npy([2.0])))
    found = read_entry(odd, MOST)
    assert found is not None
    assert set(found.arrays) == {"../../x", "/etc/y"}
    assert {p.name for p in tmp_path.iterdir()} == {"a.npz", "b.npz", "c.npz", "d.npz"}


def test_places_that_are_no_files(tmp_path: Path) -> None:
    write_entry(tmp_path / "a.npz", ENTRY)
    (tmp_path / "link.npz").symlink_to(tmp_path / "a.npz")
    assert why(tmp_path / "link.npz")
    (tmp_path / "folder.npz").mkdir()
    assert why(tmp_path / "folder.npz")
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe.npz")
        assert why(tmp_path / "pipe.npz") == "it is no ordinary file"
    assert "larger" in why(tmp_path / "a.npz", 100)


@pytest.mark.slow
@settings(database=None)
@given(st.data())
def test_any_change_is_noticed_or_harmless(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    """Cut anywhere or with any byte changed: an error of this module, or what was written."""
    path = tmp_path_factory.mktemp("entry") / "a.npz"
    write_entry(path, ENTRY)
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(content[: data.draw(st.integers(0, len(content)) | st.just(len(content)))])
    try:
        found = read_entry(path, MOST)
    except DamagedEntryError:
        return
    assert found is not None
    assert json.dumps(found.facts) == json.dumps(ENTRY.facts)
    for name in set(ENTRY.arrays) & set(found.arrays):
        np.testing.assert_array_equal(np.ravel(found.arrays[name]), np.ravel(ENTRY.arrays[name]))
