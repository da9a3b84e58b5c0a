"""Matrices that other programs wrote come back number by number, with their rows."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.linalg
import scipy.sparse as sp

from femtune.errors import FemtuneError
from femtune.files.matrices import text_blocks
from femtune.files.matrices.calculix import read_dof_list
from femtune.files.matrices.listed_modes import read_listed_modes
from femtune.files.matrices.read import format_of, read_matrix

from .matrices_by_hand import full, symmetric_example


def frequencies(K: np.ndarray, M: np.ndarray, count: int) -> np.ndarray:
    values = scipy.linalg.eigh(K, M, eigvals_only=True, subset_by_index=[0, count - 1])
    return np.sqrt(np.abs(values)) / (2 * np.pi)


def test_calculix_matrices_have_the_modes_that_calculix_lists(calculix_job: Path) -> None:
    K, M = read_matrix(calculix_job / "beam.sti"), read_matrix(calculix_job / "beam.mas")
    listed = read_listed_modes(calculix_job / "modes.dat")
    assert len(listed) == 10
    np.testing.assert_allclose(frequencies(full(K), full(M), 10), listed, rtol=2e-6)
    rows = read_dof_list(calculix_job / "beam.dof")
    np.testing.assert_array_equal(K.rows, rows)
    # mass of the free nodes of 2 m x 0.2 m x 0.12 m of steel, in each direction
    x = np.where(rows[:, 1] == 1, 1.0, 0.0)
    assert 0.9 * 374.4 < x @ full(M) @ x < 374.4


@pytest.mark.slow
def test_ansys_full_file(shared_data: Path) -> None:
    pytest.importorskip("ansys.mapdl.reader", reason="ansys-mapdl-reader is not installed")
    path = shared_data / "ansys_full" / "file.full"
    K, M = read_matrix(path), read_matrix(path, "M")
    free = np.setdiff1d(np.arange(K.size), K.held)
    assert (K.size, len(K.held)) == (963, 63)
    found = frequencies(full(K)[np.ix_(free, free)], full(M)[np.ix_(free, free)], 6)
    np.testing.assert_allclose(found, [1283.200, 1283.200, 5781.975, 6919.399, 6919.399, 10172.615], rtol=5e-7)


@pytest.mark.slow
def test_a_file_that_ends_the_library_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A word of the header that makes the library leave its arrays; no module of the current folder is executed."""
    examples = pytest.importorskip("ansys.mapdl.reader.examples", reason="ansys-mapdl-reader is not installed")
    content = bytearray(Path(examples.fullfile).read_bytes())
    content[424:428] = (2**31 - 1).to_bytes(4, "little")
    (tmp_path / "a.full").write_bytes(content)
    (tmp_path / "numpy.py").write_text("open('executed', 'w')")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FemtuneError) as caught:
        read_matrix(Path("a.full"))
    assert caught.value.code == "matrices.ansys"
    assert not Path("executed").exists()


def test_op4_of_nastran(shared_data: Path) -> None:
    """A Craig-Bampton component: boundary DOFs first, ten unit-mass modal DOFs behind them, uncoupled in stiffness."""
    path = shared_data / "nastran_matrices" / "reduced_bset_notall6.op4"
    K, M = full(read_matrix(path, "KAA")), full(read_matrix(path, "maa"))
    assert K.shape == M.shape == (29, 29)
    np.testing.assert_allclose(np.diag(M)[19:], 1.0, rtol=1e-9)
    assert np.abs(K[19:, :19]).max() < 1e-6 * np.abs(K).max()
    assert (np.diff(np.diag(K)[19:]) > 0.0).all()


def _pyyeti(name: str) -> Any:
    """A module of the library, which sets how numpy prints where it is imported: other tests must not see that."""
    with np.printoptions():
        return pytest.importorskip(f"pyyeti.nastran.{name}", reason="pyYeti is not installed")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["dense", "bigmat", "nonbigmat"])
@pytest.mark.parametrize("written", [(True, "<"), (True, ">"), (False, "<")], ids=["little", "big", "text"])
@pytest.mark.parametrize("unit", [1.0, 1.0 + 0.1j], ids=["real", "complex"])
def test_op4_that_another_library_wrote(tmp_path: Path, kind: str, written: tuple[bool, str], unit: complex) -> None:
    op4 = _pyyeti("op4")
    A = symmetric_example() * unit
    data = {"first": np.ones((3, 5)), "kgg": A}
    op4.OP4().write(str(tmp_path / "a.op4"), data, binary=written[0], endian=written[1], sparse=kind)
    np.testing.assert_allclose(full(read_matrix(tmp_path / "a.op4", "KGG")), A, rtol=1e-14)


def test_op2_matrix_beside_another_library(shared_data: Path) -> None:
    op2 = _pyyeti("op2")
    path = shared_data / "nastran_decks" / "solid_shell_bar" / "static_solid_shell_bar_kelm.op2"
    K = full(read_matrix(path, "KGG"))
    np.testing.assert_allclose(K, op2.rdmats(str(path))["KGG"], atol=1e-9 * np.abs(K).max())
    # six rigid-body motions of a structure without supports, beside DOFs without stiffness
    used = np.flatnonzero(np.diag(K))
    assert (np.abs(np.linalg.eigvalsh(K[np.ix_(used, used)])) < 1e-8 * np.abs(K).max()).sum() >= 6


@pytest.mark.slow
def test_reading_op2_leaves_how_numpy_prints(tmp_path: Path) -> None:
    """The library sets numpy's print options where it is imported first, and messages would have fewer digits."""
    _pyyeti("op2")
    (tmp_path / "a.op2").write_bytes(b"")
    command = [sys.executable, "-c", _PRINTED, str(tmp_path / "a.op2")]
    found = subprocess.run(command, capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["matrices.op2", "0.3333333333333333"]


_PRINTED = """
import sys
import numpy as np
from femtune.errors import FemtuneError
from femtune.files.matrices.read import read_matrix

try:
    read_matrix(sys.argv[1])
except FemtuneError as error:
    print(error.code)
print(np.float64(1) / 3)
"""


def test_dmig_punch(shared_data: Path) -> None:
    A = read_matrix(shared_data / "nastran_matrices" / "matrix_factory.pch", "IDENT")
    np.testing.assert_array_equal(full(A), np.eye(21))
    assert A.rows is not None
    assert A.rows[:2].tolist() == [[1, 1], [1, 2]]
    assert A.rows[-1].tolist() == [12, 0]


DMIG = """DMIG    STIFF   0       6       {kind}       0
DMIG    STIFF   2       1               2       1       5.      .5
        3       0       -2.     .25
DMIG*   STIFF                          3               0
*                      3               0 2.500000000D+00 1.250000000D-01
"""


@pytest.mark.parametrize(("kind", "imaginary"), [(1, 0.0), (2, 0.0), (3, 1.0), (4, 1.0)])
def test_dmig_cards(tmp_path: Path, kind: int, imaginary: float) -> None:
    (tmp_path / "a.pch").write_text(DMIG.format(kind=kind))
    A = read_matrix(tmp_path / "a.pch")
    assert A.rows is not None
    assert A.rows.tolist() == [[2, 1], [3, 0]]
    expected = np.array([[5.0, -2.0], [-2.0, 2.5]]) + 1j * imaginary * np.array([[0.5, 0.25], [0.25, 0.125]])
    np.testing.assert_allclose(full(A), expected, rtol=1e-15)


def test_dmig_by_magnitude_and_phase(tmp_path: Path) -> None:
    header = "DMIG    S       0       6       4       0       1\n"
    (tmp_path / "a.pch").write_text(f"{header}DMIG    S       2       1               2       1       2.      90.\n")
    np.testing.assert_allclose(full(read_matrix(tmp_path / "a.pch")), [[2.0j]], atol=1e-15)


def test_abaqus_matrix_input_and_coordinates(tmp_path: Path) -> None:
    A = symmetric_example(6)
    rows = [(n, d) for n in (10, 20) for d in (1, 2, 3)]
    lower = [(i, j) for i in range(6) for j in range(i + 1) if A[i, j]]
    named = [f"{rows[i][0]},{rows[i][1]}, {rows[j][0]},{rows[j][1]}, {A[i, j]:.17e}" for i, j in lower]
    (tmp_path / "job_STIF1.mtx").write_text("** made by a test\n" + "\n".join(named) + "\n")
    found = read_matrix(tmp_path / "job_STIF1.mtx")
    np.testing.assert_array_equal(full(found), A)
    assert found.rows is not None
    assert found.rows.tolist() == [list(r) for r in rows]
    every = [f"{i + 1} {j + 1} {A[i, j]:.17E}".replace("E", "D") for i in range(6) for j in range(6) if A[i, j]]
    (tmp_path / "coordinate.mtx").write_text("\n".join(every) + "\n")
    np.testing.assert_array_equal(full(read_matrix(tmp_path / "coordinate.mtx")), A)


@pytest.mark.parametrize("symmetry", ["symmetric", "general"])
@pytest.mark.parametrize("dense", [False, True])
def test_matrix_market(tmp_path: Path, symmetry: str, dense: bool) -> None:
    A = symmetric_example()
    scipy.io.mmwrite(tmp_path / "a.mtx", A if dense else sp.coo_array(A), symmetry=symmetry, precision=17)
    assert format_of(tmp_path / "a.mtx") == "matrix-market"
    np.testing.assert_allclose(full(read_matrix(tmp_path / "a.mtx")), A, rtol=1e-15)


def test_nastran_listing(shared_data: Path) -> None:
    folder = shared_data / "nastran_decks" / "cantilever_bar_reduction" / "no_super"
    listed = read_listed_modes(folder / "noreduction.f06")
    np.testing.assert_allclose(listed[:5], [349.7288, 2167.324, 6007.803, 11650.23, 19045.0], rtol=1e-4)


def test_dof_lists_of_all_spellings(tmp_path: Path) -> None:
    (tmp_path / "a.dof").write_text("# node component\n1.1\n 2 3\n3, 6\n4RX\n5:0\n")
    assert read_dof_list(tmp_path / "a.dof").tolist() == [[1, 1], [2, 3], [3, 6], [4, 4], [5, 0]]


@pytest.mark.slow
def test_a_large_text_file_is_read_in_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks of whole lines, here of a few thousand."""
    monkeypatch.setattr(text_blocks, "BLOCK", 100_000)
    n = 60_000
    at = np.arange(1, n + 1)
    table = np.stack([at, at, 1.0 + at / n], axis=1)
    lines = "\n".join(f"{int(i)} {int(i)} {v:.14e}" for i, _, v in table)
    step = "\n".join(f"{i} {i + 1} -2.50000000000000e-01" for i in range(1, n))
    (tmp_path / "big.mtx").write_text(f"{lines}\n{step}\n")
    found = read_matrix(tmp_path / "big.mtx")
    assert found.upper.nnz == 2 * n - 1
    np.testing.assert_allclose(found.upper.diagonal(), table[:, 2], rtol=1e-14)
