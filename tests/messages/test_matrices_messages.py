"""Matrices that lie: each is refused with file, line or byte, values and the smallest fix."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.files.matrices.calculix import read_dof_list
from femtune.files.matrices.listed_modes import read_listed_modes
from femtune.files.matrices.placement import read_points
from femtune.files.matrices.read import read_matrix


def message(read: Callable[[], object], folder: Path) -> str:
    with pytest.raises(FemtuneError) as error:
        read()
    return str(error.value).replace(f"{folder}/", "")


def of_text(folder: Path, name: str, text: str, **asked: str) -> str:
    (folder / name).write_bytes(text.encode("latin-1"))
    return message(lambda: read_matrix(folder / name, **asked), folder)


GOOD = "1 1 2.0\n1 2 -1.0\n2 2 2.0\n"


def test_not_a_number(tmp_path: Path) -> None:
    check_shown("matrices.not-finite", of_text(tmp_path, "k.mtx", "1 1 2.0\n1 2 nan\n2 2 2.0\n"))


def test_not_symmetric(tmp_path: Path) -> None:
    text = of_text(tmp_path, "k.mtx", "10,1,10,1,2.0\n10,1,10,2,-1.0\n10,2,10,1,-1.1\n10,2,10,2,2.0\n")
    check_shown("matrices.not-symmetric", text)


def test_an_entry_twice(tmp_path: Path) -> None:
    text = of_text(tmp_path, "k.mtx", GOOD + "1 2 -1.5\n")
    assert "[matrices.duplicate] an entry of the matrix is given twice\n  at k.mtx:4\n" in text
    assert "value = -1.5\n  value before = -1.0\n  first given at = k.mtx:2" in text


def test_a_line_that_is_no_entry(tmp_path: Path) -> None:
    text = of_text(tmp_path, "k.mtx", "1 1 2.0\n1 2\n2 2 2.0\n")
    assert "[matrices.text] a line must have 3 numbers: row, column and value\n  at k.mtx:2\n  line = '1 2'" in text
    assert "[matrices.text]" in of_text(tmp_path, "k.mtx", "1 1 2.0\n1 x 3.0\n")
    assert "number 2 must be a whole number\n  at k.mtx:2" in of_text(tmp_path, "k.mtx", "1 1 2.0\n1 1.5 3.0\n")


@pytest.mark.parametrize("cut", ["1 1 2.0\n1 2 -1.0\n2 2 2", "1 1 2.0\n1 2 -1.0\n2 2"])
def test_cut_in_the_middle_of_a_line(tmp_path: Path, cut: str) -> None:
    text = of_text(tmp_path, "k.mtx", cut)
    assert "[matrices.truncated] the file ends in the middle of a line" in text
    assert "hint: the file is truncated: write or copy it again" in text


def test_a_row_number_out_of_the_blue_does_not_fill_the_memory(tmp_path: Path) -> None:
    text = of_text(tmp_path, "k.mtx", "1 1 2.0\n900000000000 2 1.0\n")
    assert "[matrices.index] the matrix has 900000000000 rows but only 2 entries" in text
    assert "at k.mtx:2" in text
    text = of_text(
        tmp_path, "k.mtx", "%%MatrixMarket matrix coordinate real general\n2000000000 2000000000 1\n1 1 2.0\n"
    )
    assert "the matrix has 2000000000 rows but only 1 entries" in text


def test_empty_file(tmp_path: Path) -> None:
    assert "[matrices.empty] the file has no entry of a matrix" in of_text(tmp_path, "k.mtx", "** nothing\n")


def test_lagrange_node_of_abaqus(tmp_path: Path) -> None:
    text = of_text(tmp_path, "k.mtx", "1,1,1,1,2.0\n-5,1,-5,1,1.0\n")
    assert "[matrices.index] a node number is not positive" in text
    assert "at k.mtx:2\n  node = -5" in text
    assert "a degree of freedom is not between 1 and 6" in of_text(tmp_path, "k.mtx", "1,8,1,8,2.0\n")


def test_calculix_without_and_with_another_dof_list(tmp_path: Path) -> None:
    assert "[matrices.missing-dof-list]" in of_text(tmp_path, "k.sti", GOOD)
    (tmp_path / "k.dof").write_text("1.1\n")
    text = of_text(tmp_path, "k.sti", GOOD)
    assert (
        "[matrices.index] an entry is outside the matrix, which has 1 rows\n  at k.sti:2\n  row = 1\n  column = 2"
        in text
    )
    (tmp_path / "k.dof").write_text("1.1\n1.2\n1.3\n")
    text = of_text(tmp_path, "k.sti", GOOD)
    assert "[matrices.truncated] the file lacks the diagonal entry of 1 of the 3 DOFs" in text
    assert "first row without one = 3" in text


def test_dof_lists(tmp_path: Path) -> None:
    path = tmp_path / "a.dof"
    path.write_text("1.1\n1.7\n")
    check_shown("matrices.dof-list", message(lambda: read_dof_list(path), tmp_path))
    path.write_text("1.1\n1.2\n1 1\n")
    text = message(lambda: read_dof_list(path), tmp_path)
    assert "a degree of freedom is listed twice\n  at a.dof:3\n  DOF = 1:1\n  first line = 1" in text
    path.write_text("# none\n")
    assert "the list of DOFs is empty" in message(lambda: read_dof_list(path), tmp_path)


def op4_bytes(n: int = 3) -> bytes:
    """A dense binary OP4 file of an n × n diagonal matrix."""

    def record(content: bytes) -> bytes:
        return struct.pack("<i", len(content)) + content + struct.pack("<i", len(content))

    out = record(struct.pack("<4i8s", n, n, 6, 2, b"KGG     "))
    for i in range(n):
        out += record(struct.pack("<3id", i + 1, i + 1, 2, 2.0 + i))
    return out + record(struct.pack("<3id", n + 1, 1, 2, 1.0))


def test_op4_by_hand_is_right(tmp_path: Path) -> None:
    (tmp_path / "k.op4").write_bytes(op4_bytes())
    np.testing.assert_array_equal(read_matrix(tmp_path / "k.op4").upper.toarray(), np.diag([2.0, 3.0, 4.0]))


@pytest.mark.parametrize("length", range(1, len(op4_bytes()), 7))
def test_op4_cut_anywhere(tmp_path: Path, length: int) -> None:
    (tmp_path / "k.op4").write_bytes(op4_bytes()[:length])
    text = message(lambda: read_matrix(tmp_path / "k.op4"), tmp_path)
    assert text.startswith("[matrices.truncated] the file ends inside") or length < 4
    assert "byte" in text or length < 4


def test_op4_cut_says_where(tmp_path: Path) -> None:
    (tmp_path / "k.op4").write_bytes(op4_bytes()[:70])
    check_shown("matrices.truncated", message(lambda: read_matrix(tmp_path / "k.op4"), tmp_path))


def test_op4_that_is_damaged(tmp_path: Path) -> None:
    content = bytearray(op4_bytes())
    content[36:40] = struct.pack("<i", 99)
    (tmp_path / "k.op4").write_bytes(content)
    text = message(lambda: read_matrix(tmp_path / "k.op4"), tmp_path)
    assert "[matrices.op4] columns are not in order\n  at k.op4 (KGG, byte 32)\n  column = 99" in text
    (tmp_path / "k.op4").write_bytes(b"\x01\x02\x03\x04 no matrix")
    text = message(lambda: read_matrix(tmp_path / "k.op4"), tmp_path)
    assert "[matrices.op4] the file does not begin with the header of a matrix" in text
    assert "first bytes = 01 02 03 04" in text


def test_text_op4_that_is_cut(tmp_path: Path) -> None:
    head = "       2       2       6       2KGG     1P,3E24.16\n       1       1       4\n"
    whole = head + f"{2.0:24.16E}{0.5:24.16E}\n       2       2       2\n{3.0:24.16E}\n"
    (tmp_path / "k.op4").write_text(whole + f"       3       1       1\n{1.0:24.16E}\n")
    for cut in (head, head + "  2.0", whole):
        text = of_text(tmp_path, "k.op4", cut)
        assert text.startswith(("[matrices.truncated]", "[matrices.op4]"))
        assert "k.op4:" in text


OP4_TEXT = "       2       2       6       2KGG     {}\n{}"


def test_text_op4_whose_header_lies(tmp_path: Path) -> None:
    head = "50000000500000 00"  # no blanks between: cut out of the number fields
    assert "[matrices.op4] this line is not the header of a matrix" in of_text(tmp_path, "k.op4", head)
    head = "50000000500000000000000600000002KGG     1P,3E23.16\n       1       150000000\n"
    text = of_text(tmp_path, "k.op4", head)
    assert "[matrices.truncated] the file ends inside matrix KGG\n  at k.op4:3" in text
    for format in ("1P,0E0.0", "1P,3E0.0", "what?"):
        text = of_text(tmp_path, "k.op4", OP4_TEXT.format(format, "       1       1       2\n"))
        assert "[matrices.op4] this line is not the header of a matrix\n  at k.op4:1" in text


def test_text_op4_columns_that_lie(tmp_path: Path) -> None:
    text = of_text(tmp_path, "k.op4", OP4_TEXT.format("1P,3E23.16", "       1       1      -5\n"))
    assert (
        "[matrices.op4] the length of a string of KGG is not a whole number of values\n  at k.op4:2\n  column = 1"
        in text
    )
    assert "real numbers = -5" in text
    text = of_text(tmp_path, "k.op4", OP4_TEXT.format("1P,3E23.16", "       1       1       9\n"))
    assert "a column of KGG is longer than the 2 rows of the matrix\n  at k.op4:2" in text


def sparse_op4(kind: int, words: int, body: bytes, rows: int = 2) -> bytes:
    """A binary OP4 file of one column, with one sparse string of so many words."""

    def record(content: bytes) -> bytes:
        return struct.pack("<i", len(content)) + content + struct.pack("<i", len(content))

    head = struct.pack("<i", 65536 * (words + 1) + 1) if rows > 0 else struct.pack("<2i", words + 1, 1)
    column = struct.pack("<3i", 1, 0, (len(head) + len(body)) // 4) + head + body
    return record(struct.pack("<4i8s", 2, rows, 6, kind, b"KGG     ")) + record(column)


def test_binary_op4_strings_that_hold_no_whole_numbers(tmp_path: Path) -> None:
    (tmp_path / "k.op4").write_bytes(sparse_op4(2, 3, bytes(12)))
    text = message(lambda: read_matrix(tmp_path / "k.op4"), tmp_path)
    assert "[matrices.op4] the length of a string is not a whole number of values\n  at k.op4 (KGG, byte 32)" in text
    assert "bytes = 12\n  bytes a number = 8" in text
    (tmp_path / "k.op4").write_bytes(sparse_op4(4, 6, bytes(24)))
    text = message(lambda: read_matrix(tmp_path / "k.op4"), tmp_path)
    assert "[matrices.op4] the length of a string of KGG is not a whole number of values" in text
    # four bytes behind the string: half the head of another one
    (tmp_path / "k.op4").write_bytes(sparse_op4(2, 2, bytes(12), rows=-2))
    text = message(lambda: read_matrix(tmp_path / "k.op4"), tmp_path)
    assert "[matrices.op4] a column ends inside the header of a string" in text


def test_a_matrix_that_is_not_there(tmp_path: Path) -> None:
    (tmp_path / "k.op4").write_bytes(op4_bytes())
    text = message(lambda: read_matrix(tmp_path / "k.op4", "KAA"), tmp_path)
    check_shown("matrices.no-such-matrix", text)


def test_matrix_market_that_lies(tmp_path: Path) -> None:
    banner = "%%MatrixMarket matrix coordinate real symmetric\n"
    assert "[matrices.truncated]" in of_text(tmp_path, "k.mtx", f"{banner}2 2 3\n1 1 2.0\n2 1 1.0\n")
    text = of_text(tmp_path, "k.mtx", f"{banner}2 2 1\n5 1 2.0\n")
    assert "[matrices.index] an entry is outside the matrix, which has 2 rows\n  at k.mtx:3" in text
    text = of_text(tmp_path, "k.mtx", "%%MatrixMarket matrix coordinate complex hermitian\n1 1 1\n1 1 2.0 0.0\n")
    assert "the matrix is declared hermitian\n  at k.mtx:1" in text
    rectangular = "%%MatrixMarket matrix coordinate real general\n2 3 1\n1 1 2.0\n"
    assert "[matrices.not-square] k has 2 rows and 3 columns" in of_text(tmp_path, "k.mtx", rectangular)


@pytest.mark.parametrize("header", ["coordinate {} 1000000 1000000 1000000000000", "array {} 1000000 1000000"])
def test_matrix_market_header_does_not_fill_the_memory(tmp_path: Path, header: str) -> None:
    form, *size = header.split()
    banner = f"%%MatrixMarket matrix {form} real general\n{' '.join(size[1:])}\n"
    text = of_text(tmp_path, "k.mtx", banner + "1 1 2.0\n")
    assert "[matrices.truncated] the file has fewer entries than its size line states\n  at k.mtx:2" in text
    assert "entries = 1000000000000\n  bytes after the size line = 8" in text


def test_matrix_market_number_with_garbage(tmp_path: Path) -> None:
    banner = "%%MatrixMarket matrix array real symmetric\n%\n2 2\n"
    text = of_text(tmp_path, "k.mtx", f"{banner}1.\n02794668948390&-1\n1.\n")
    assert "[matrices.text] a line must have 1 numbers: value\n  at k.mtx:5\n  line = '02794668948390&-1'" in text
    for last in ("1.", "0.2.3", "", "1.\n1."):
        text = of_text(tmp_path, "k.mtx", f"{banner}1.\n0.\n{last}")
        assert text.startswith(("[matrices.truncated]", "[matrices.text]"))
    text = of_text(tmp_path, "k.mtx", f"{banner}1.\n0.\n1.\n1.\n")
    assert "[matrices.text] the file has more entries than its size line states\n  at k.mtx:3" in text
    text = of_text(tmp_path, "k.mtx", "%%MatrixMarket matrix array real\n1 1\n1.\n")
    assert "[matrices.text] the banner line of this Matrix Market file is not supported\n  at k.mtx:1" in text
    text = of_text(tmp_path, "k.mtx", "%%MatrixMarket matrix array real general\n-1 1\n1.\n")
    assert "[matrices.text] the size line must have the numbers of rows and columns\n  at k.mtx:2" in text


def test_matrix_market_damaged_anywhere_does_not_kill_the_reader(tmp_path: Path) -> None:
    """SciPy's reader ended the whole process on files such as these."""
    lines = [b"%%MatrixMarket matrix array real symmetric", b"4 4", *(b"%.17e" % (1 / (k + 3)) for k in range(10))]
    whole = b"\n".join(lines) + b"\n"
    rng = np.random.default_rng(3)
    for _ in range(300):
        start, end = sorted(rng.integers(0, len(whole), 2))
        (tmp_path / "k.mtx").write_bytes(whole[:start] + rng.bytes(int(rng.integers(0, 4))) + whole[end:])
        with contextlib.suppress(FemtuneError):
            A = read_matrix(tmp_path / "k.mtx", format="matrix-market").upper
            assert A.shape == (4, 4)


HEAD = "DMIG    K       0       {form}       2       0\n"
COLUMN = "DMIG    K       {}       1               {}       1       {}\n"


def test_dmig_that_lies(tmp_path: Path) -> None:
    def dmig(form: int, *columns: tuple[int, int, str]) -> str:
        return of_text(tmp_path, "k.pch", HEAD.format(form=form) + "".join(COLUMN.format(*c) for c in columns))

    assert "[matrices.not-symmetric]" in dmig(1, (1, 1, "2."), (1, 2, "1."), (2, 1, "3."), (2, 2, "2."))
    text = dmig(6, (1, 1, "2."), (1, 2, "1."), (2, 1, "1."), (2, 2, "2."))
    assert "[matrices.duplicate] the symmetric matrix K has an entry for a pair of degrees of freedom twice" in text
    assert "[matrices.not-square] DMIG K is declared rectangular (form 2)" in dmig(2, (1, 1, "2."))
    assert "[matrices.dmig] this header has form 7 and type 2" in dmig(7, (1, 1, "2."))
    assert "[matrices.dmig] K has a header but no columns" in dmig(6)
    text = of_text(tmp_path, "k.pch", HEAD.format(form=6) * 2 + COLUMN.format(1, 1, "1."))
    assert "K has a second header; the first is at k.pch:1" in text


def test_files_that_are_not_there_or_unknown(tmp_path: Path) -> None:
    assert "[matrices.unreadable]" in message(lambda: read_matrix(tmp_path / "no.op4"), tmp_path)
    text = of_text(tmp_path, "k.mtxx", GOOD)
    assert "[matrices.unknown-format] the extension '.mtxx' does not belong to a known format of matrices" in text
    assert "did you mean '.mtx'?" in text


def test_directories_and_devices(tmp_path: Path) -> None:
    (tmp_path / "k.op4").mkdir()
    text = message(lambda: read_matrix(tmp_path / "k.op4"), tmp_path)
    assert text.startswith("[matrices.unreadable] this is a directory\n  at k.op4")
    for format in ("matrix-market", "ansys", None):
        text = message(lambda format=format: read_matrix("/dev/zero", format=format), tmp_path)
        assert text.startswith("[matrices.unreadable] this is a device or pipe, not a file\n  at /dev/zero")
        text = message(lambda format=format: read_matrix(tmp_path / "no.mm", format=format), tmp_path)
        assert text.startswith("[matrices.unreadable] the file does not exist\n  at no.mm")


@pytest.mark.parametrize("name", ["k.mtx", "k.sti"])
def test_binary_where_text_should_be(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(struct.pack("<i2d", 26, 1.0, 2.0))
    text = message(lambda: read_matrix(tmp_path / name), tmp_path)
    assert text.startswith(
        f"[matrices.binary] the file is binary, but its format is a text format\n  at {name} (byte 1)"
    )
    assert "first bytes = 1a 00 00 00" in text


def test_numbers_that_overflow(tmp_path: Path) -> None:
    text = of_text(tmp_path, "k.mtx", "1 1 2.0\n1 2 1.7e308\n2 1 1.7e308\n2 2 2.0\n")
    assert "[matrices.huge] an entry of the matrix is larger than 1e+100\n  at k.mtx:2\n  row = row 1" in text
    assert "value = 1.7e+308\n  such entries = 2" in text


def test_node_zero_in_a_list_of_dofs(tmp_path: Path) -> None:
    (tmp_path / "a.dof").write_text("1.1\n0.1\n")
    text = message(lambda: read_dof_list(tmp_path / "a.dof"), tmp_path)
    assert "[matrices.dof-list] node numbers must be positive\n  at a.dof:2\n  line = '0.1'" in text


def test_points_and_listings(tmp_path: Path) -> None:
    (tmp_path / "a.inp").write_text("*NODE\n1, 0., 0., 0.\n2, 1., x\n")
    text = message(lambda: read_points(tmp_path / "a.inp"), tmp_path)
    assert "[matrices.points] this line of a *NODE block is not a node\n  at a.inp:3" in text
    (tmp_path / "a.inp").write_text("*NODE\n1, 0., 0., 0.\n1, 1., 0.\n")
    assert "node 1 is defined twice" in message(lambda: read_points(tmp_path / "a.inp"), tmp_path)
    (tmp_path / "a.f06").write_text("nothing\n")
    assert "[matrices.no-listing]" in message(lambda: read_listed_modes(tmp_path / "a.f06"), tmp_path)


@pytest.mark.parametrize("name", ["op2", "ansys"])
def test_a_library_that_gives_up_or_is_not_there(tmp_path: Path, name: str) -> None:
    (tmp_path / "k.bin").write_bytes(b"\x18\x00\x00\x00 neither of the two")
    text = message(lambda: read_matrix(tmp_path / "k.bin", format=name), tmp_path)
    assert text.startswith((f"[matrices.{name}]", "[install.missing]"))
    assert "hint:" in text
