"""Readers of the modes that solvers write: what they read, and files that are cut, damaged or of another kind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.files.formats import MODES_FORMATS
from femtune.files.matrices.ansys import read_ansys
from femtune.files.modes.read import read_modes

_DAT = """
     E I G E N V A L U E   O U T P U T

 MODE NO    EIGENVALUE                       FREQUENCY   
                                     REAL PART            IMAGINARY PART
                           (RAD/TIME)      (CYCLES/TIME     (RAD/TIME)

      1   0.3947842E+02   0.6283185E+01   0.1000000E+01   0.0000000E+00
      2   0.1579137E+03   0.1256637E+02   0.2000000E+01   0.0000000E+00

     P A R T I C I P A T I O N   F A C T O R S
"""  # noqa: W291


def _frd(modes: int = 2) -> str:
    lines = ["    1C"]
    for j in range(modes):
        lines += [
            f"  100CL  10{j + 1}{j + 1:12.8f}           2                     2    1MODAL      1",
            " -4  DISP        4    1",
            " -5  D1          1    2    1    0",
            f" -1         7{0.5 * (j + 1):12.5E}{-1.0:12.5E}{0.0:12.5E}",
            f" -1        12{-0.5:12.5E}{-123.0:12.5E}{float(j):12.5E}",
            " -3",
        ]
    return "\n".join([*lines, " 9999", ""])


def _f06() -> str:
    head = "1    SUBJECT                                                              PAGE {}\n\n"
    values = "                              R E A L   E I G E N V A L U E S\n   MODE    EXTRACTION      EIGENVALUE\n"
    rows = [(1, 3.947842e1, 1.0, 4.0), (2, 1.579137e2, 2.0, 1.0)]
    values += "".join(
        f"        {j}         {j}        {v:.6E}        {v**0.5:.6E}        {hz:.6E}        {m:.6E}    {v * m:.6E}\n"
        for j, v, hz, m in rows
    )
    mass = "                          MASS AXIS SYSTEM (S)     MASS              X-C.G.        Y-C.G.        Z-C.G.\n"
    mass += "                                  X            2.500000E+00   0.000000E+00  1.000000E+00  0.000000E+00\n"
    out = head.format(1) + mass + head.format(2) + values
    for j, v, hz, _ in rows:
        out += head.format(j + 2) + f"0\n      EIGENVALUE =  {v:.6E}\n"
        title = f"          CYCLES =  {hz:.6E}         R E A L   E I G E N V E C T O R   N O .          {j}\n \n"
        title += "      POINT ID.   TYPE          T1             T2             T3             R1             R2\n"
        points = [
            f"        {n:6d}      G      {n:.6E}  -1.000000E+00   0.0            0.0   0.0   {j}.0\n" for n in (5, 6)
        ]
        # the table goes on upon another page
        out += title + points[0] + head.format(9) + title + points[1]
    return out + head.format(10) + "1                                        * * * END OF JOB * * *\n"


def _punch() -> str:
    lines = []
    for j, value in ((1, 39.47842), (2, 157.9137)):
        lines += ["$TITLE   = X", "$EIGENVECTOR", "$REAL OUTPUT", f"$EIGENVALUE = {value:14.7E}  MODE = {j:5d}"]
        for n in (5, 6):
            lines.append(f"{n:10d}       G{n:18.6E}{-1.0:18.6E}{0.0:18.6E}{n:8d}")
            lines.append(f"-CONT-            {0.0:18.6E}{0.0:18.6E}{float(j):18.6E}{n:8d}")
    return "\n".join(lines) + "\n"


_ABAQUS = """
   Abaqus 2024                                  Date 01-Jan-2024   Time 10:00:00

                              E I G E N V A L U E    O U T P U T

 MODE NO      EIGENVALUE              FREQUENCY         GENERALIZED MASS   COMPOSITE MODAL DAMPING
                             (RAD/TIME)   (CYCLES/TIME)

       1       39.478         6.2832         1.0000         151.92         0.0000
       2      1.57914E+02     12.566         2.0000         30.206         0.0000

                   P A R T I C I P A T I O N   F A C T O R S

 MODE NO          X-COMPONENT     Y-COMPONENT     Z-COMPONENT     X-ROTATION      Y-ROTATION      Z-ROTATION

       1          1.0             2.0             3.0             4.0             5.0             6.0

     THE ANALYSIS HAS BEEN COMPLETED
"""

_TABLE = "# frequencies\n1.0, 2.0\nmass 2.5\n5X 0.5 1\n5Y- 1 1\n7RZ+ 1 2\nparticipation RY 3 -4\nend\n"
_WHOLE: dict[str, str] = {
    "abaqus-dat": _ABAQUS, "calculix-dat": _DAT, "calculix-frd": _frd(), "nastran-f06": _f06(),
    "nastran-punch": _punch(), "table": _TABLE,
}  # fmt: skip


@pytest.mark.parametrize("format", _WHOLE)
def test_frequencies(format: str, tmp_path: Path) -> None:
    (tmp_path / "modes").write_text(_WHOLE[format])
    np.testing.assert_allclose(read_modes(tmp_path / "modes", format).freq_hz, [1.0, 2.0], rtol=1e-6)


def test_shapes_of_calculix(tmp_path: Path) -> None:
    (tmp_path / "a.frd").write_text(_frd())
    found = read_modes(tmp_path / "a.frd", "calculix-frd")
    np.testing.assert_array_equal(found.nodes, [7, 12])
    np.testing.assert_array_equal(found.shapes[:, :3, 0], [[0.5, -1.0, 0.0], [-0.5, -123.0, 0.0]])
    np.testing.assert_array_equal(found.shapes[:, :3, 1], [[1.0, -1.0, 0.0], [-0.5, -123.0, 1.0]])
    assert np.isnan(found.shapes[:, 3:]).all()


@pytest.mark.parametrize(("format", "scale"), [("nastran-f06", [0.5, 1.0]), ("nastran-punch", [1.0, 1.0])])
def test_shapes_of_nastran_are_of_unit_modal_mass(format: str, scale: list[float], tmp_path: Path) -> None:
    (tmp_path / "a").write_text(_WHOLE[format])
    found = read_modes(tmp_path / "a", format)
    np.testing.assert_array_equal(found.nodes, [5, 6])
    for j in (0, 1):
        expected = scale[j] * np.array([[5.0, -1.0, 0.0, 0.0, 0.0, j + 1.0], [6.0, -1.0, 0.0, 0.0, 0.0, j + 1.0]])
        np.testing.assert_allclose(found.shapes[:, :, j], expected)
    assert found.mass == (2.5 if format == "nastran-f06" else None)


def test_shapes_of_a_table(tmp_path: Path) -> None:
    (tmp_path / "a").write_text(_TABLE)
    found = read_modes(tmp_path / "a", "table")
    np.testing.assert_array_equal(found.nodes, [5, 7])
    np.testing.assert_array_equal(found.shapes[0, :2], [[0.5, 1.0], [-1.0, -1.0]])
    np.testing.assert_array_equal(found.shapes[1, 5], [1.0, 2.0])
    assert found.mass == 2.5
    assert found.participation is not None
    np.testing.assert_array_equal(found.participation[4], [3.0, -4.0])
    assert np.isnan(found.participation[[0, 1, 2, 3, 5]]).all()


def _with_forces(moving: float, forces: tuple[float, float, float]) -> str:
    """One mode of 1/2π Hz: node 1 moves, nodes 2 and 3 at different places are held by the same forces."""
    hz = 1.0 / (2.0 * np.pi)
    lines = ["    1C", "    2C                             3                                     1"]
    lines += [f" -1{n:10d}{x:12.5E}{y:12.5E}{0.0:12.5E}" for n, x, y in ((1, 9.0, 9.0), (2, 1.0, 0.0), (3, 0.0, 2.0))]
    for name, first, others in (("DISP", (moving,) * 3, (0.0,) * 3), ("FORC", (7.0,) * 3, forces)):
        lines += [" -3", f"  100CL  101{hz:12.9f}           3                     2    1MODAL      1"]
        lines += [f" -4  {name}        4    1", " -5  D1          1    2    1    0"]
        rows = ((1, first), (2, others), (3, others))
        lines += [f" -1{n:10d}" + "".join(f"{v:12.5E}" for v in row) for n, row in rows]
    return "\n".join([*lines, " -3", " 9999", ""])


def test_participation_factors_of_calculix_are_the_forces_at_the_supports(tmp_path: Path) -> None:
    (tmp_path / "a.frd").write_text(_with_forces(0.5, (3.0, 5.0, -4.0)))
    found = read_modes(tmp_path / "a.frd", "calculix-frd").participation
    assert found is not None
    # ω = 1; moments are those of (1, 0, 0) × F and (0, 2, 0) × F
    moments = [2.0 * -4.0, 4.0, 5.0 - 2.0 * 3.0]
    np.testing.assert_allclose(found[:, 0], [-6.0, -10.0, 8.0, *np.negative(moments)], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("forces", [(0.0, 5.0, -4.0), (3.0, 0.0, 0.0)])
def test_missing_forces_are_not_taken_for_zero(forces: tuple[float, float, float], tmp_path: Path) -> None:
    """CalculiX lists none at clamped nodes of beams and shells."""
    (tmp_path / "a.frd").write_text(_with_forces(0.5, forces))
    assert read_modes(tmp_path / "a.frd", "calculix-frd").participation is None
    (tmp_path / "a.frd").write_text(_frd())
    assert read_modes(tmp_path / "a.frd", "calculix-frd").participation is None


@pytest.mark.parametrize("format", [f for f in _WHOLE if f != "nastran-punch"])
def test_a_file_that_is_cut_anywhere_is_refused(format: str, tmp_path: Path) -> None:
    """Cut at the end of a line, as a solver that was killed leaves it, and inside one."""
    text, path = _WHOLE[format].rstrip(), tmp_path / "modes"
    at = [i for i, c in enumerate(text) if c == "\n"]
    for cut in sorted(c for c in {*at, *(i + 5 for i in at)} if c < len(text)):
        path.write_text(text[:cut])
        with pytest.raises(FemtuneError) as caught:
            read_modes(path, format)
        assert caught.value.code == "external.output", cut


def test_a_punch_file_that_is_cut_in_its_last_mode(tmp_path: Path) -> None:
    """It has no end: a mode with fewer points than the others, or a point without rotations, is refused."""
    text = _punch().rstrip()
    begin = text.rindex("$EIGENVALUE") + 45
    for cut in range(begin, len(text) - 8):
        (tmp_path / "a.pch").write_text(text[:cut])
        with pytest.raises(FemtuneError) as caught:
            read_modes(tmp_path / "a.pch", "nastran-punch")
        assert caught.value.code == "external.output", cut


def test_a_negative_eigenvalue_is_no_frequency(tmp_path: Path) -> None:
    row = "      1  -0.3947842E+02   0.0000000E+00   0.0000000E+00   0.6283185E+01\n"
    lines = _DAT.splitlines(keepends=True)
    (tmp_path / "a.dat").write_text("".join(row if line.startswith("      1 ") else line for line in lines))
    assert np.isnan(read_modes(tmp_path / "a.dat", "calculix-dat").freq_hz).tolist() == [True, False]


@pytest.mark.parametrize(
    ("format", "text", "name"),
    [
        ("abaqus-dat", _ABAQUS.replace("E I G E N", "E I G E M"), "no modes in abaqus"),
        ("abaqus-dat", _ABAQUS.replace("HAS BEEN COMPLETED", ""), "cut abaqus"),
        ("calculix-dat", "nothing", "no modes"),
        ("calculix-frd", "    1C\n 9999\n", "no modes in frd"),
        ("calculix-frd", _frd().replace(" -1        12", " -1        13", 1), "shapes differ"),
        ("calculix-frd", _frd().replace("-1.23000E+02", "xxxxxxxxxxxx", 1), "no number"),
        ("nastran-f06", "* * * END OF JOB * * *", "no modes in f06"),
        ("table", "1.0 2.0\n5X 1\nend", "row"),
        ("table", "1.0 2.0\nfive 1 2\nend", "no dof"),
        ("table", "1.0 2.0\n", "cut"),
    ],
)
def test_what_is_wrong_is_said(format: str, text: str, name: str, tmp_path: Path) -> None:
    (tmp_path / "modes").write_text(text)
    with pytest.raises(FemtuneError) as caught:
        read_modes(tmp_path / "modes", format)
    check_shown(f"external.output, {name}", str(caught.value).replace(str(tmp_path), "FOLDER"))


@pytest.mark.parametrize("format", MODES_FORMATS.keys)
@pytest.mark.slow
def test_absent_files_and_bytes_of_another_kind(format: str, tmp_path: Path) -> None:
    extras = {"nastran-op2": ("pyyeti", "op2"), "ansys-rst": ("ansys.mapdl.reader", "ansys")}
    if format in extras:
        pytest.importorskip(extras[format][0], reason=f"the extra {extras[format][1]} is not installed")
    with pytest.raises(FemtuneError) as caught:
        read_modes(tmp_path / "modes", format)
    assert caught.value.code == "external.output"
    (tmp_path / "modes").write_bytes(np.random.default_rng(1).bytes(5000))
    with pytest.raises(FemtuneError) as caught:
        read_modes(tmp_path / "modes", format)
    assert caught.value.code == "external.output"


def test_a_listing_of_commercial_nastran(shared_data: Path) -> None:
    """Ten listed modes; shapes with their largest entry 1 become those of unit modal mass."""
    found = read_modes(shared_data / "nastran_decks" / "beam_modes.f06", "nastran-f06")
    np.testing.assert_allclose(found.freq_hz[[0, 2, 4, 5]], [456.660, 2674.588, 3554.923, 4507.487], rtol=1e-6)
    assert found.mass == 2.610514e-02
    assert found.shapes.shape[2] == len(found.freq_hz) == 10
    assert found.shapes[1, 2, 0] == pytest.approx(1.857573e-02 / np.sqrt(8.801022e-03), rel=1e-12)


def test_an_op2_of_commercial_nastran(shared_data: Path) -> None:
    pytest.importorskip("pyyeti", reason="the extra op2 is not installed")
    found = read_modes(shared_data / "nastran_decks" / "satk.op2", "nastran-op2")
    np.testing.assert_allclose(found.freq_hz[:3], [89.5607, 89.5607, 1044.76], rtol=1e-5)
    assert found.has_shapes


def test_the_rows_of_an_abaqus_listing(tmp_path: Path) -> None:
    """Rows of the cargo crane in Getting Started with Abaqus, numbered anew: ω of each row is 2πf."""
    rows = [("1773.4", "42.112", "6.7023"), ("7016.8", "83.766", "13.332"), ("2.26885E+05", "476.32", "75.809")]
    listed = "".join(f"{i:8d} {'   '.join(row)}   151.92   0.0000    \n" for i, row in enumerate(rows, start=1))
    head, rest = _ABAQUS.split("       1       39.478")
    (tmp_path / "a.dat").write_text(head + listed + rest[rest.index("\n\n") :])
    omega = [float(row[1]) for row in rows]
    np.testing.assert_allclose(2 * np.pi * read_modes(tmp_path / "a.dat", "abaqus-dat").freq_hz, omega, rtol=1e-4)


@pytest.mark.parametrize(("eigenvalue", "known"), [("-39.478", False), ("-1.0000E-09", True)])
def test_negative_eigenvalues_of_abaqus(eigenvalue: str, known: bool, tmp_path: Path) -> None:
    """A rigid-body mode is rounding, an elastic one with a negative eigenvalue has no frequency."""
    (tmp_path / "a.dat").write_text(_ABAQUS.replace(" 39.478 ", f" {eigenvalue} "))
    assert np.isfinite(read_modes(tmp_path / "a.dat", "abaqus-dat").freq_hz).tolist() == [known, True]


def test_the_last_step_of_abaqus_counts(tmp_path: Path) -> None:
    first, rest = _ABAQUS.split("                   P A R T", 1)
    second = first.replace("1.0000         151.92", "3.0000         151.92").replace("2.0000 ", "4.0000 ")
    (tmp_path / "a.dat").write_text(f"{first}\n{second}                   P A R T{rest}")
    assert read_modes(tmp_path / "a.dat", "abaqus-dat").freq_hz.tolist() == [3.0, 4.0]


@pytest.mark.slow
def test_a_result_file_of_ansys_solves_the_equations_of_its_matrices(tmp_path: Path) -> None:
    """The beam of the reading library: free in the .rst file, held at one end in the .full file.

    Kφ = ω²Mφ holds in all rows of nodes that share no element with a held one: 30 of 321 nodes do.
    """
    examples = pytest.importorskip("ansys.mapdl.reader.examples", reason="the extra ansys is not installed")
    found = read_modes(Path(examples.rstfile), "ansys-rst")
    K, M = (read_ansys(Path(examples.fullfile), name) for name in "KM")
    assert K.rows is not None
    assert M.rows is not None
    np.testing.assert_array_equal(K.rows, M.rows)
    phi = found.shapes[np.searchsorted(found.nodes, K.rows[:, 0]), K.rows[:, 1] - 1]
    stiffness, mass = (m.upper + sp.triu(m.upper, 1).T for m in (K, M))
    residual = np.abs(stiffness @ phi - (mass @ phi) * (2 * np.pi * found.freq_hz) ** 2)
    wrong = np.unique(K.rows[(residual > 1e-6 * (abs(stiffness) @ np.abs(phi))).any(axis=1), 0])
    assert len(K.held) == 63
    assert len(found.nodes) == 321
    assert len(wrong) == 30
    whole = Path(examples.rstfile).read_bytes()
    (tmp_path / "cut.rst").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FemtuneError) as caught:
        read_modes(tmp_path / "cut.rst", "ansys-rst")
    assert caught.value.code == "external.output"
