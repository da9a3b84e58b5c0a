"""Files of tests changed at random: each is read or refused with a message. Another parser judges what is read."""

from __future__ import annotations

import csv
import io
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import mmread, mmwrite, savemat, wavfile
from scipy.sparse import coo_array
from tests.files.matrices.matrices_by_hand import full, symmetric_example
from tests.files.nastran.mutant_trial import time_limit
from tests.files.nastran.mutations import mutant
from tests.files.records import test_laboratory_files as laboratory
from tests.files.study_file.whole_study import STUDY
from tests.files.uff import test_variants as variants

from femtune.dofs import Dof
from femtune.errors import FemtuneError
from femtune.files.identification_file import read_identify_file
from femtune.files.matrices.listed_modes import read_listed_modes
from femtune.files.matrices.read import read_matrix
from femtune.files.modes.nastran_text import read_punch
from femtune.files.points_table import read_points
from femtune.files.records import FunctionColumn, FunctionLayout, read_frfs, read_record
from femtune.files.study_file.reading import read_study_file
from femtune.files.uff import read_uff
from femtune.steps.run_folder import read_results
from femtune.testing import example_test
from femtune.units import SI

SECONDS, MUTANTS, OF_FOLDERS = 10.0, 300, 60
POINTS = b"node,x,y,z,X_x,X_y,X_z\n1,0,0.5,1e-3,1,0,0\n2,1.5,-2,0,0.6,0.8,0\n7,3,0,0,0,0,-2\n"
TABLE = b"f,re,im\n" + b"".join(b"%g,%.6e,%.6e\n" % (f, np.sin(f), np.cos(f)) for f in np.arange(1.0, 20.0))
IDENTIFY = (
    b'[identify]\nfrfs = "a.mat"\nband_hz = [1, 20.5]\ngeometry = "p.csv"\nlines = [[1, 2]]\n'
    b'[functions]\nkind = "mobility"\n'
    b'axes = ["frequency", "response"]\nresponses = ["1X+", "2X-"]\nreferences = ["1X+"]\nstep_hz = 0.25\n'
)
LAYOUT = FunctionLayout(
    "accelerance", functions=(FunctionColumn(Dof(1, "X"), Dof(1, "X"), 2, 3),), frequency=1, format="text"
)
AXES = FunctionLayout("accelerance", (Dof(1, "X"), Dof(2, "X")), (Dof(1, "X"),), variable="H", frequency="f")


def _bytes_of(write: Callable[[io.BytesIO], object]) -> bytes:
    stream = io.BytesIO()
    write(stream)
    return stream.getvalue()


def _sound() -> bytes:
    values = 1000.0 * np.random.default_rng(4).normal(size=(60, 2))
    return _bytes_of(lambda stream: wavfile.write(stream, 100, values.astype(np.int16)))


def _arrays() -> dict[str, np.ndarray]:
    lines = np.arange(1.0, 9.0)
    return {"H": np.stack([lines + 1j, 2j * lines], axis=1), "f": lines}


def _same_points(path: Path, found: object) -> None:
    """The csv module and float say the same."""
    rows = [row for row in csv.reader(io.StringIO(path.read_text("utf-8-sig"))) if any(c.strip() for c in row)]
    heads = [h.strip() for h in rows[0]]
    if len(heads) < 2:
        return
    values = [[float(row[heads.index(axis)]) for axis in "xyz"] for row in rows[1:]]
    assert found.coordinates.tolist() == values  # type: ignore[attr-defined]


def _same_table(path: Path, found: object) -> None:
    """Rows of three numbers, read one by one."""
    rows = [line.split(",") for line in path.read_text("latin-1").splitlines()]
    numbers = [[float(c) for c in row] for row in rows if len(row) == 3 and all(map(_is_number, row))]
    if len(numbers) == len(found.freq_hz):  # type: ignore[attr-defined]
        expected = np.array(numbers)
        assert found.values[0, 0] == pytest.approx(expected[:, 1] + 1j * expected[:, 2])  # type: ignore[attr-defined]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def _nothing(path: Path, found: object) -> None:
    """There is no second parser."""


def _market() -> bytes:
    return _bytes_of(lambda s: mmwrite(s, coo_array(symmetric_example(6)), symmetry="symmetric"))


def _same_market(path: Path, found: object) -> None:
    """SciPy's reader says the same, where it reads the file at all."""
    try:
        expected = mmread(path)
    except (ValueError, OverflowError, TypeError, IndexError):
        return
    dense = expected.toarray() if hasattr(expected, "toarray") else np.asarray(expected)
    if np.isfinite(dense).all() and not np.iscomplexobj(dense):
        np.testing.assert_allclose(full(found), dense, rtol=1e-15)  # type: ignore[arg-type]


DMIG = b"""DMIG    KAAX    0       6       2       0
DMIG*   KAAX                           1               1
*                      1               1 1.000000000D+03
*                      2               3-2.500000000D+02
DMIG*   KAAX                           2               3
*                      2               3 5.000000000D+02
"""
LISTED = b"""                                               R E A L   E I G E N V A L U E S
   MODE    EXTRACTION      EIGENVALUE            RADIANS             CYCLES            GENERALIZED         GENERALIZED
    NO.       ORDER                                                                       MASS              STIFFNESS
        1         1        4.000000E+02        2.000000E+01        3.183099E+00        1.000000E+00        4.000000E+02
        2         2        9.000000E+04        3.000000E+02        4.774648E+01        1.000000E+00        9.000000E+04
"""
PUNCH = b"""$TITLE   =
$EIGENVECTOR
$REAL OUTPUT
$SUBCASE ID =           1
$EIGENVALUE =  4.0000000E+02  MODE =     1
         1       G      0.000000E+00      1.000000E+00      0.000000E+00
-CONT-                  0.000000E+00      0.000000E+00      0.000000E+00
         2       G      0.500000E+00      1.000000E+00      0.000000E+00
-CONT-                  0.000000E+00      0.000000E+00      0.000000E+00
"""


def _study(path: Path) -> object:
    """The study, with the files that it names."""
    for name in ("building.bdf", "building.uff"):
        (path.parent / name).touch()
    return read_study_file(path)


STAMPED = "\n".join([
    "stamp,1Z+ [g],force", *(f"{s},{a:.6g},{b:.6g}" for s, a, b in
    zip(laboratory.STAMPS["iso"], laboratory.ONE, laboratory.TWO)),
]).encode()  # fmt: skip
LABELLED = (variants.UNITS + variants.frf(labels=("rad/s", "g/N", "kgf"))).replace("    -1\n", "-1\n").encode()
MODES_2414 = "".join(variants.mode(i, 4.0 * i, data_set="2414") for i in (1, 2, 3)).encode()


def _universal(path: Path) -> object:
    return read_uff(path, units=SI, file_units=SI)


KINDS: dict[str, tuple[str, Callable[[], bytes], Callable[[Path], object], Callable[[Path, object], None]]] = {
    "points": ("a.csv", lambda: POINTS, read_points, _same_points),
    "functions of a table": ("a.csv", lambda: TABLE, lambda p: read_frfs(p, LAYOUT), _same_table),
    "numpy archive": (
        "a.npz", lambda: _bytes_of(lambda s: np.savez(s, **_arrays())), lambda p: read_frfs(p, AXES), _nothing,
    ),
    "numpy array": (
        "a.npy", lambda: _bytes_of(lambda s: np.save(s, np.ones((3, 40)))), lambda p: read_record(p, (), 10.0),
        _nothing,
    ),
    "matlab": ("a.mat", lambda: _bytes_of(lambda s: savemat(s, _arrays())), lambda p: read_frfs(p, AXES), _nothing),
    "packed matlab": (
        "a.mat", lambda: _bytes_of(lambda s: savemat(s, _arrays(), do_compression=True)),
        lambda p: read_frfs(p, AXES), _nothing,
    ),
    "headings and dates": ("a.csv", lambda: STAMPED, read_record, _nothing),
    "labview text": ("a.lvm", lambda: laboratory.lvm().encode(), read_record, _nothing),
    "labview segments": (
        "a.lvm", (laboratory.GENERAL + laboratory.SEGMENTS).encode, read_record, _nothing,
    ),
    "mdf": ("a.mf4", laboratory.blocks_of_mdf, read_record, _nothing),
    "packed mdf": ("a.mf4", lambda: laboratory.blocks_of_mdf(data="HL"), read_record, _nothing),
    "sound": ("a.wav", _sound, read_record, _nothing),
    "functions with unit labels": ("a.uff", lambda: LABELLED, _universal, _nothing),
    "modes of data set 2414": ("a.uff", lambda: MODES_2414, _universal, _nothing),
    "binary functions": ("a.uff", lambda: variants.UNITS.encode() + variants.binary("<", 2), _universal, _nothing),
    "record": ("a.csv", lambda: TABLE, lambda p: read_record(p, (), 10.0), _nothing),
    "MatrixMarket": ("a.mtx", _market, lambda p: read_matrix(p, format="matrix-market"), _same_market),
    "DMIG": ("a.pch", lambda: DMIG, lambda p: read_matrix(p, format="dmig"), _nothing),
    "modes of a punch file": ("a.pch", lambda: PUNCH, read_punch, _nothing),
    "listed modes": ("a.f06", lambda: LISTED, read_listed_modes, _nothing),
    "study": ("a.toml", STUDY.encode, _study, _nothing),
    "identification file": ("a.toml", lambda: IDENTIFY, read_identify_file, _nothing),
}  # fmt: skip


def outcomes(name: str, content: bytes, read: Callable[[Path], object], folder: Path, count: int) -> dict[int, object]:
    """What the mutants that were accepted became; whatever is no FemtuneError is raised."""
    found = {}
    for number in range(count):
        path = folder / f"{number}_{name}"
        path.write_bytes(mutant({name: content}, number)[name])
        with warnings.catch_warnings(), time_limit(SECONDS):
            warnings.simplefilter("ignore")
            try:
                found[number] = read(path)
            except FemtuneError:
                continue
    return found


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.slow
def test_mutants_are_read_or_refused(kind: str, tmp_path: Path) -> None:
    name, content, read, judge = KINDS[kind]
    found = outcomes(name, content(), read, tmp_path, MUTANTS)
    assert found
    for number, value in found.items():
        judge(tmp_path / f"{number}_{name}", value)


@pytest.mark.slow
def test_mutants_of_a_universal_file(tmp_path: Path) -> None:
    content = example_test(tmp_path).read_bytes()
    assert outcomes("a.uff", content, lambda p: read_uff(p, units=SI, file_units=SI), tmp_path, 100)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["matrix.op2", "reduced_bset_notall6.op4", "reduced_bset_notall6.pch"])
def test_mutants_of_matrices_of_another_program(name: str, shared_data: Path, tmp_path: Path) -> None:
    content = (shared_data / "nastran_matrices" / name).read_bytes()
    outcomes(name, content, read_matrix, tmp_path, MUTANTS)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["results.json", "arrays.npz"])
def test_mutants_of_a_run_folder(name: str, tmp_path: Path) -> None:
    written = Path(__file__).parent.parent / "study" / "written_before"
    files = {path.name: path.read_bytes() for path in written.iterdir()}
    for number in range(OF_FOLDERS):
        for own, content in files.items():
            changed = mutant({own: content}, number)[own] if own == name else content
            (tmp_path / own).write_bytes(changed)
        with warnings.catch_warnings(), time_limit(SECONDS):
            warnings.simplefilter("ignore")
            try:
                read_results(tmp_path)
            except FemtuneError:
                continue
