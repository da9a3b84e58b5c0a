"""Cut, edited and corrupted files: an error that says where, never fewer values in silence."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import pyuff
from small_case import sample_modes, sample_shapes, sample_test

from femtune.errors import FemtuneError
from femtune.files.uff import read_uff, write_uff_modes
from femtune.files.uff.read import UffContent
from femtune.units import SI


def frf_file(path: Path, binary: int, *, values: np.ndarray, even: bool = True, double: bool = True) -> None:
    """Three FRFs: in ASCII by pyuff, in binary with pyuff's header and bytes that are packed here."""
    lines = 1.0 + 0.5 * np.arange(values.shape[1])
    x = lines if even else lines + 0.1 * np.sin(lines)
    data = b""
    for k, row in enumerate(values):
        write_ascii(path, x, row, k + 1, even=even, double=double)
        data += as_binary(path.read_bytes(), x, row, even, double) if binary else path.read_bytes()
    path.write_bytes(data)


def write_ascii(path: Path, x: np.ndarray, row: np.ndarray, node: int, *, even: bool, double: bool) -> None:
    one = pyuff.prepare_58(
        binary=0,
        func_type=4,
        ord_data_type=6 if double else 5,
        rsp_node=node,
        rsp_dir=3,
        ref_node=1,
        ref_dir=-3,
        data=row,
        x=x,
        id1="BC",
        rsp_ent_name="NONE",
        ref_ent_name="NONE",
        abscissa_spacing=int(even),
        abscissa_spec_data_type=18,
        ordinate_spec_data_type=12,
        orddenom_spec_data_type=13,
    )
    pyuff.UFF(str(path)).write_sets(one, mode="overwrite", force_double=double)


def as_binary(ascii_set: bytes, x: np.ndarray, row: np.ndarray, even: bool, double: bool) -> bytes:
    columns = [row.real, row.imag] if even else [x, row.real, row.imag]
    payload = np.column_stack(columns).astype("<f8" if double else "<f4").tobytes()
    head = f"    58b{1:6d}{2:6d}{11:12d}{len(payload):12d}{0:6d}{0:6d}{0:12d}{0:12d}\n".encode()
    header = b"".join(ascii_set.splitlines(keepends=True)[2:13])
    return b"    -1\n" + head + header + payload + b"    -1\n"


@pytest.fixture(params=["modes", "complex modes", "ascii FRFs", "binary FRFs"])
def good(request: pytest.FixtureRequest, tmp_path: Path) -> bytes:
    path = tmp_path / "good.uff"
    if request.param == "modes":
        write_uff_modes(path, sample_test())
    elif request.param == "complex modes":
        write_uff_modes(path, sample_test(sample_modes(sample_shapes() * (1 + 0.3j))))
    else:
        rows = np.arange(1, 40).reshape(3, 13) * (1.0 + 0.125j)
        frf_file(path, int(request.param == "binary FRFs"), values=rows)
    return path.read_bytes()


def read(path: Path, data: bytes) -> UffContent | FemtuneError:
    path.write_bytes(data)
    try:
        return read_uff(path, units=SI, file_units=SI)
    except FemtuneError as error:
        return error


def numbers(content: UffContent) -> list[np.ndarray]:
    test = content.test
    parts = [test.geometry.coordinates, test.geometry.nodes, *(f.values for f in content.functions)]
    return parts if test.modes is None else [*parts, test.modes.shapes, test.modes.freq_hz]


def same(a: UffContent, b: UffContent) -> bool:
    x, y = numbers(a), numbers(b)
    return len(x) == len(y) and all(np.array_equal(p, q) for p, q in zip(x, y))


def whole_ends(data: bytes) -> set[int]:
    """Cuts after which only whole data sets are left: behind a closing delimiter, its line end or part of it.

    A function declares its points, and is whole at the last of them without its delimiter.
    """
    ends, position, closing, head = set(), 0, False, b""
    for line in data.splitlines(keepends=True):
        position += len(line)
        if line.rstrip(b"\r\n").endswith(b"    -1"):
            if closing:
                ends |= {position - 1, position} | {position + k for k in range(5)}
                ends |= set(range(position - len(b"    -1\n") - 1, position - 2)) if head[:2] == b"58" else set()
            closing = not closing
            head = data[position : position + 10].lstrip()
    return ends


def cuts(data: bytes) -> Iterator[int]:
    yield from range(0, len(data), 7)
    yield from range(len(data) - 20, len(data))


@pytest.mark.quick(0)
def test_cut_anywhere(good: bytes, tmp_path: Path) -> None:
    full = read(tmp_path / "a.uff", good)
    assert isinstance(full, UffContent)
    allowed = whole_ends(good)
    refused = 0
    for cut in cuts(good):
        found = read(tmp_path / "a.uff", good[:cut])
        if isinstance(found, UffContent) and not same(found, full):
            # A file that ends between two data sets is a whole, shorter file.
            assert cut in allowed, (cut, good[cut - 30 : cut])
        refused += isinstance(found, FemtuneError)
    assert refused > 0.9 * len(list(cuts(good)))


def test_cut_inside_a_record_says_where(tmp_path: Path) -> None:
    path = tmp_path / "a.uff"
    write_uff_modes(path, sample_test())
    data = path.read_bytes()
    error = read(path, data[:-40])
    assert isinstance(error, FemtuneError)
    assert error.code == "uff.truncated"
    assert error.where is not None
    assert error.where.file == str(path)
    assert error.where.line == data[:-40].count(b"\n") + 1
    assert error.where.record == "data set 55"


@pytest.mark.quick(0)
def test_a_lost_line_is_noticed(good: bytes, tmp_path: Path) -> None:
    """Each single line taken out of an ASCII file: an error, or the numbers as they were (ID lines, names)."""
    if b"58b" in good:
        pytest.skip("a binary file has no lines")
    full = read(tmp_path / "a.uff", good)
    assert isinstance(full, UffContent)
    lines = good.splitlines(keepends=True)
    for i in range(len(lines)):
        found = read(tmp_path / "a.uff", b"".join(lines[:i] + lines[i + 1 :]))
        assert isinstance(found, FemtuneError) or same(found, full), lines[i]


@pytest.mark.slow
def test_random_bytes(good: bytes, tmp_path: Path) -> None:
    """Whatever is damaged, only FemtuneError comes out."""
    rng = np.random.default_rng(1)
    outcomes = set()
    for _ in range(250):
        data = bytearray(good)
        for place in rng.integers(0, len(data), rng.integers(1, 4)):
            data[place] = rng.choice([rng.integers(0, 256), *b" -19eD.\n"])
        found = read(tmp_path / "a.uff", bytes(data))
        outcomes.add(found.code if isinstance(found, FemtuneError) else "read")
    assert "read" in outcomes
    assert len(outcomes) > 3


def test_crlf_blanks_and_d_exponents_change_nothing(good: bytes, tmp_path: Path) -> None:
    if b"58b" in good:
        pytest.skip("a binary file has no lines")
    full = read(tmp_path / "a.uff", good)
    assert isinstance(full, UffContent)
    padded = b"\n".join(line.ljust(90) for line in good.splitlines()) + b"\n"
    lower = good.replace(b"E+", b"e+").replace(b"e+", b"D+").replace(b"e-", b"d-").replace(b"E-", b"D-")
    for other in (good.replace(b"\n", b"\r\n"), good.replace(b"\n", b"\r"), padded, lower, good + b"   \n\x1a"):
        found = read(tmp_path / "a.uff", other)
        assert isinstance(found, UffContent), str(found)
        assert same(found, full)


@pytest.mark.quick(8)
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("double", [True, False])
@pytest.mark.parametrize("points", [2, 5, 12, 13])
def test_every_form_of_58(tmp_path: Path, binary: int, even: bool, double: bool, points: int) -> None:
    rows = np.arange(1.0, 3 * points + 1).reshape(3, points) * (1.0 - 0.5j)
    path = tmp_path / "a.uff"
    frf_file(path, binary, values=rows, even=even, double=double)
    found = read(path, path.read_bytes())
    assert isinstance(found, UffContent), str(found)
    frfs = found.test.frfs
    assert frfs is not None
    assert frfs.kind == "accelerance"
    assert frfs.references.labels() == ["1Z-"]
    np.testing.assert_allclose(frfs.values[:, 0, :], rows, rtol=1e-6)
    x = 1.0 + 0.5 * np.arange(points)
    wanted = x if even else x + 0.1 * np.sin(x)
    np.testing.assert_allclose(frfs.freq_hz, wanted, rtol=1e-5)


def test_wrong_length_of_a_binary_block(tmp_path: Path) -> None:
    """Half the bytes are declared, as pyuff does for complex functions: the points decide, with a notice."""
    path = tmp_path / "a.uff"
    rows = np.arange(1, 40).reshape(3, 13) * (1.0 + 0.125j)
    frf_file(path, 1, values=rows)
    data = path.read_bytes()
    found = read(path, data.replace(f"{208:12d}".encode(), f"{104:12d}".encode()))
    assert isinstance(found, UffContent)
    assert "uff.binary-length" in [n.code for n in found.notices]
    assert found.test.frfs is not None
    np.testing.assert_array_equal(found.test.frfs.values[:, 0, :], rows)
    wrong = data.replace(f"{208:12d}".encode(), f"{104:12d}".encode()).replace(b"        13 ", b"        12 ")
    error = read(path, wrong)
    assert isinstance(error, FemtuneError)
    assert error.code == "uff.binary-length"


def test_binary_single_abscissa_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.uff"
    frf_file(path, 1, values=np.ones((1, 12)) * (1 + 1j), even=False)
    data = path.read_bytes()
    shorter = data.replace(f"{288:12d}".encode(), f"{240:12d}".encode())
    error = read(path, shorter[: -48 - 7] + b"    -1\n")
    assert isinstance(error, FemtuneError)
    assert error.code == "uff.truncated"
    assert error.values["expected"] == 288
