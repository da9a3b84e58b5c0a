"""Functions from arrays and tables: what the axes mean is stated, and every statement that does not fit is told."""

from __future__ import annotations

import io
import zipfile
import zlib

import numpy as np
import pytest
from scipy.io import savemat

from femtune.dofs import Dof
from femtune.errors import FemtuneError
from femtune.files.records import FunctionColumn, FunctionLayout, read_frfs, read_record

LINES = np.arange(1.0, 8.0)
RNG = np.random.default_rng(5)
H = RNG.standard_normal((3, 2, 7)) + 1j * RNG.standard_normal((3, 2, 7))
GAMMA = RNG.uniform(0.2, 1.0, H.shape)
RESPONSES = tuple(Dof(i, "Z") for i in (1, 2, 3))
REFERENCES = (Dof(1, "Z"), Dof(3, "Z", -1))


def layout(**more):
    return FunctionLayout("accelerance", RESPONSES, REFERENCES, **more)


def check(found, coherence=False):
    assert found.values == pytest.approx(H)
    assert found.freq_hz == pytest.approx(LINES)
    assert (tuple(found.responses), tuple(found.references)) == (RESPONSES, REFERENCES)
    assert (found.coherence is not None) == coherence
    if coherence:
        assert found.coherence == pytest.approx(GAMMA)


ORDERS = [(0, 1, 2), (2, 0, 1), (1, 2, 0), (2, 1, 0)]
NAMES = ("response", "reference", "frequency")


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("stated", [True, False])
def test_axes_in_any_order_stated_or_by_their_lengths(tmp_path, order, stated):
    path = tmp_path / "frf.npz"
    np.savez(path, H=H.transpose(order), f=LINES, g=GAMMA.transpose(order))
    axes = tuple(NAMES[i] for i in order) if stated else ()
    check(read_frfs(path, layout(axes=axes, variable="H", frequency="f", coherence="g")), coherence=True)


def test_lengths_that_fit_twice_are_no_statement(tmp_path):
    np.savez(tmp_path / "frf.npz", H=H[:2, :, :], f=LINES)
    asked = FunctionLayout("mobility", RESPONSES[:2], REFERENCES, frequency="f")
    with pytest.raises(FemtuneError, match="several orders fit"):
        read_frfs(tmp_path / "frf.npz", asked)


def test_matlab_structure_with_dotted_names(tmp_path):
    data = {"test": {"H": H.transpose(2, 0, 1), "x": {"f": LINES}, "note": "kept"}, "other": np.eye(3)}
    savemat(tmp_path / "frf.mat", data, do_compression=True)
    asked = layout(axes=("frequency", "response", "reference"), variable="test.H", frequency="test.x.f")
    check(read_frfs(tmp_path / "frf.mat", asked))
    with pytest.raises(FemtuneError, match=r"has no variable 'test\.G'"):
        read_frfs(tmp_path / "frf.mat", layout(variable="test.G", frequency="test.x.f"))


def test_elements_of_a_structure_array_and_of_a_cell(tmp_path):
    parts = np.array([(H.real,), (H.imag,)], dtype=[("part", object)])
    cell = np.empty((1, 2), dtype=object)
    cell[0, 0], cell[0, 1] = GAMMA, LINES
    savemat(tmp_path / "frf.mat", {"s": parts, "c": cell})
    asked = layout(axes=NAMES, variable="s(1).part", imaginary="s(2).part", coherence="c{1}", frequency="c{2}")
    check(read_frfs(tmp_path / "frf.mat", asked), coherence=True)


def test_one_reference_drops_its_axis_in_matlab(tmp_path):
    savemat(tmp_path / "frf.mat", {"H": H[:, :1].transpose(2, 0, 1), "f": LINES})
    asked = FunctionLayout("accelerance", RESPONSES, REFERENCES[:1], frequency="f")
    assert read_frfs(tmp_path / "frf.mat", asked).values == pytest.approx(H[:, :1])


def test_real_and_imaginary_part_as_an_axis(tmp_path):
    np.save(tmp_path / "frf.npy", np.stack([H.real, H.imag], axis=1))
    asked = layout(axes=("response", "part", "reference", "frequency"), start_hz=1.0, step_hz=1.0)
    check(read_frfs(tmp_path / "frf.npy", asked))


def pairs(first=1):
    where = [(i, j) for i in range(3) for j in range(2)]
    return [(RESPONSES[i], REFERENCES[j], H[i, j], n) for n, (i, j) in enumerate(where, first)]


def test_functions_along_one_axis_are_named_one_by_one(tmp_path):
    np.save(tmp_path / "frf.npy", np.array([h for _, _, h, _ in pairs()]).T)
    named = tuple(FunctionColumn(r, d, n) for r, d, _, n in pairs())
    asked = FunctionLayout("accelerance", functions=named, axes=("frequency", "function"), start_hz=1.0, step_hz=1.0)
    check(read_frfs(tmp_path / "frf.npy", asked))
    # a pair that was not measured is not zero
    few = FunctionLayout("accelerance", functions=named[:5], axes=asked.axes, start_hz=1.0, step_hz=1.0)
    assert np.isnan(read_frfs(tmp_path / "frf.npy", few).values[2, 1]).all()


def test_columns_of_a_table(tmp_path):
    columns = [part for _, _, h, _ in pairs() for part in (h.real, h.imag)]
    heads = "f;" + ";".join(f"{r} {d} {part}" for r, d, _, _ in pairs() for part in ("re", "im"))
    np.savetxt(tmp_path / "frf.csv", np.array([LINES, *columns]).T, delimiter=";", header=heads, comments="")
    named = tuple(FunctionColumn(r, d, 2 * n, f"{r} {d} im") for r, d, _, n in pairs())
    check(read_frfs(tmp_path / "frf.csv", FunctionLayout("accelerance", functions=named, frequency="f")))


def test_a_column_without_its_imaginary_part_is_not_taken_as_real(tmp_path):
    columns = [part for _, _, h, _ in pairs() for part in (h.real, h.imag)]
    np.savetxt(tmp_path / "frf.csv", np.array([LINES, *columns]).T, delimiter=",")
    named = [FunctionColumn(r, d, 2 * n, 2 * n + 1) for r, d, _, n in pairs()]
    named[1] = FunctionColumn(named[1].response, named[1].reference, named[1].column)
    with pytest.raises(FemtuneError, match="real, but FRFs are complex") as caught:
        read_frfs(tmp_path / "frf.csv", FunctionLayout("accelerance", functions=tuple(named), frequency=1))
    assert f"column = {named[1].column}" in str(caught.value)


def test_hdf5_with_groups_and_matlab_order(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "frf.h5", "w") as file:
        file["data/H"], file["data/f"] = H, LINES
    check(read_frfs(tmp_path / "frf.h5", layout(variable="data/H", frequency="data.f")))
    # MATLAB 7.3: axes in reverse order, complex numbers as pairs
    kind = np.dtype([("real", float), ("imag", float)])
    turned = np.empty(H.T.shape, kind)
    turned["real"], turned["imag"] = H.T.real, H.T.imag
    with h5py.File(tmp_path / "frf.mat", "w", userblock_size=512) as file:
        file["H"], file["f"] = turned, LINES[:, None]
        file["H"].attrs["MATLAB_class"] = np.bytes_("double")
        file["f"].attrs["MATLAB_class"] = np.bytes_("double")
    check(read_frfs(tmp_path / "frf.mat", layout(axes=NAMES, variable="H", frequency="f")))


@pytest.mark.parametrize(
    ("arrays", "more", "says"),
    [
        ({"H": H.real, "f": LINES}, {"axes": NAMES}, "real, but FRFs are complex"),
        ({"H": H, "f": LINES[:5]}, {"axes": NAMES}, "'frequency' has the length 7, but 5"),
        ({"H": H[:2], "f": LINES}, {"axes": NAMES}, "'response' has the length 2"),
        ({"H": H, "f": LINES[::-1]}, {"axes": NAMES}, "do not increase"),
        ({"H": H, "f": LINES}, {"axes": (*NAMES, "part")}, "must have the length 2"),
        ({"H": H, "G": H, "f": LINES}, {"axes": NAMES, "variable": None}, "2 arrays that could be"),
        ({"H": H, "f": LINES, "g": 2 * GAMMA}, {"axes": NAMES, "coherence": "g"}, "outside 0 to 1"),
        ({"H": H, "f": LINES}, {"axes": ("response", "frequency")}, "does not have the stated axes"),
        ({"H": np.full(H.shape, np.inf + 0j), "f": LINES}, {"axes": NAMES}, "not finite"),
        ({"H": np.where(LINES == 3.0, np.nan, H), "f": LINES}, {"axes": NAMES}, "not finite"),
    ],
)
def test_what_does_not_fit_is_told(tmp_path, arrays, more, says):
    np.savez(tmp_path / "frf.npz", **arrays)
    with pytest.raises(FemtuneError, match=says):
        read_frfs(tmp_path / "frf.npz", layout(**{"variable": "H", "frequency": "f", **more}))


def test_python_objects_are_not_unpickled(tmp_path):
    np.save(tmp_path / "frf.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(FemtuneError, match="Object arrays cannot be loaded"):
        read_frfs(tmp_path / "frf.npy", layout())


# ----------------------------------------------------------------------------------------------------
# Files that inflate to gigabytes, and tables that are too wide.


@pytest.mark.slow
def test_an_archive_that_inflates_to_gigabytes_is_not_read(tmp_path):
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (1, 1 << 26)})
    archive = zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1)
    with archive, archive.open("a.npy", "w") as stream:
        stream.write(head.getvalue())
        for _ in range(512):
            stream.write(bytes(1 << 20))
    with pytest.raises(FemtuneError, match="too large for their file"):
        read_record(tmp_path / "bomb.npz", sampling_hz=1.0)


@pytest.mark.slow
def test_a_matlab_file_that_inflates_to_gigabytes_is_not_read(tmp_path):
    shrink = zlib.compressobj(1)
    content = b"".join(shrink.compress(bytes(1 << 20)) for _ in range(300)) + shrink.flush()
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    (tmp_path / "bomb.mat").write_bytes(head + np.array([15, len(content)], "<u4").tobytes() + content)
    with pytest.raises(FemtuneError, match="too large for their file"):
        read_record(tmp_path / "bomb.mat", sampling_hz=1.0)


def test_a_dataset_that_inflates_to_gigabytes_is_not_read(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "bomb.h5", "w") as file:
        file.create_dataset("a", shape=(1, 1 << 28), dtype="f8", compression="gzip")
    with pytest.raises(FemtuneError, match="too large for their file"):
        read_record(tmp_path / "bomb.h5", sampling_hz=1.0)


@pytest.mark.slow
def test_a_table_of_300000_columns_is_a_transposed_one(tmp_path):
    (tmp_path / "wide.csv").write_text((",".join(["1"] * 300_000) + "\n") * 2)
    with pytest.raises(FemtuneError, match="300000 columns") as caught:
        read_record(tmp_path / "wide.csv", sampling_hz=1.0)
    assert "transpose" in caught.value.hint


def test_lines_given_by_their_step_tell_the_axes_as_well(tmp_path):
    np.save(tmp_path / "frf.npy", H.transpose(2, 0, 1))
    check(read_frfs(tmp_path / "frf.npy", layout(start_hz=1.0, step_hz=1.0)))
    np.save(tmp_path / "frf.npy", H[:, 0])
    with pytest.raises(FemtuneError, match="cannot be divided"):
        read_frfs(tmp_path / "frf.npy", layout(step_hz=1.0))


def test_a_column_has_one_meaning(tmp_path):
    (tmp_path / "frf.csv").write_text("f,a,b,c\n1,2,3,4\n2,3,4,5\n")
    first = FunctionColumn(Dof(1, "Z"), Dof(1, "Z"), "a", "b")
    for column, imaginary in (("a", "c"), ("c", 2), ("f", "c")):
        functions = (first, FunctionColumn(Dof(2, "Z"), Dof(1, "Z"), column, imaginary))
        with pytest.raises(FemtuneError, match=r"column \w is given twice"):
            read_frfs(tmp_path / "frf.csv", FunctionLayout("accelerance", functions=functions, frequency="f"))
