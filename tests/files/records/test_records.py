"""Time records from files of six formats, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.io import savemat, wavfile

from femtune.dofs import Dof
from femtune.errors import FemtuneError
from femtune.files.records import ChannelColumn, read_record

T = np.arange(50) / 100.0
SIGNALS = np.vstack([np.sin(2 * np.pi * 3 * T), np.cos(2 * np.pi * 5 * T), 0.1 * T])


def written(tmp_path, text, name="record.csv"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def rows(separator, *, time=False, comma=False):
    table = np.vstack([T, SIGNALS]).T if time else SIGNALS.T
    lines = [separator.join(f"{v:.9g}" for v in row) for row in table]
    return "\n".join(lines).replace(".", ",") if comma else "\n".join(lines)


@pytest.mark.parametrize(
    ("separator", "comma"), [(",", False), (";", False), (";", True), ("\t", False), (" ", False), ("\t", True)]
)
def test_text_of_every_separator(tmp_path, separator, comma):
    found = read_record(written(tmp_path, rows(separator, comma=comma)), sampling_hz=100.0)
    assert found.values == pytest.approx(SIGNALS, abs=1e-8)
    assert found.sampling_hz == 100.0
    assert [str(c) for c in found.channels] == ["1S+", "2S+", "3S+"]


def test_a_column_of_times_gives_the_rate_and_names_find_columns(tmp_path):
    header = "logger 7, made in March\nTime (s),acc top,acc base,temp\n"
    columns = [
        ChannelColumn("acc base", Dof(7, "X"), "acceleration", "input", "m/s2", 9.81),
        ChannelColumn(1, Dof(8, "Z", -1)),
    ]
    found = read_record(written(tmp_path, header + rows(",", time=True)), columns)
    assert found.sampling_hz == pytest.approx(100.0)
    assert found.values == pytest.approx(SIGNALS[[1, 0]] * [[9.81], [1.0]], abs=1e-7)
    assert found.channels[0].role == "input"
    assert found.channels[0].name == "acc base"
    assert str(found.channels[1].dof) == "8Z-"


def test_a_line_of_units_below_the_names_is_no_line_of_names(tmp_path):
    header = "Messung;12\nZeit;acc top;acc base;temp\n s;m/s2;m/s2;V\n"
    found = read_record(written(tmp_path, header + rows(";", time=True, comma=True)))
    assert found.sampling_hz == pytest.approx(100.0)
    assert [c.name for c in found.channels] == ["acc top", "acc base", "temp"]


def test_missing_samples_are_lost_samples(tmp_path):
    found = read_record(written(tmp_path, "1,2\n,4\n5,nan\n6,7\n"), sampling_hz=10.0)
    assert np.isnan(found.values).tolist() == [[False, True, False, False], [False, False, True, False]]


@pytest.mark.parametrize(
    ("text", "says", "line"),
    [
        ("1,2\n3,x4\n5,6\n", "'x4' is not a number", 2),
        ("a,b\n1,2\n3,4\n5", "the last line is incomplete", 4),
        ("1,2\n3,4,5\n6,7\n", "another number of columns", 2),
        ("nothing here\nat all\n", "no line of this file is a row of numbers", None),
        ("1,2\n3,4_5\n", "'4_5' is not a number", 2),
    ],
)
def test_broken_text_is_named_with_its_line(tmp_path, text, says, line):
    with pytest.raises(FemtuneError, match=says) as caught:
        read_record(written(tmp_path, text), sampling_hz=10.0)
    assert caught.value.where.line == line


def test_numpy_files(tmp_path):
    np.save(tmp_path / "a.npy", SIGNALS.T)
    assert read_record(tmp_path / "a.npy", sampling_hz=5.0).values == pytest.approx(SIGNALS)
    np.savez(tmp_path / "b.npz", acc=SIGNALS, fs=np.array(100.0))
    found = read_record(tmp_path / "b.npz")
    assert found.values == pytest.approx(SIGNALS)
    assert found.sampling_hz == 100.0


def test_objects_in_numpy_files_are_refused(tmp_path):
    np.save(tmp_path / "evil.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(FemtuneError, match="this NumPy file cannot be read"):
        read_record(tmp_path / "evil.npy", sampling_hz=5.0)


def test_a_numpy_file_cut_short_is_refused(tmp_path):
    np.save(tmp_path / "a.npy", SIGNALS.T)
    whole = (tmp_path / "a.npy").read_bytes()
    (tmp_path / "a.npy").write_bytes(whole[:-100])
    with pytest.raises(FemtuneError, match="this NumPy file cannot be read"):
        read_record(tmp_path / "a.npy", sampling_hz=5.0)


def test_matlab_files(tmp_path):
    savemat(tmp_path / "a.mat", {"acc": SIGNALS.T, "Fs": 100.0, "remark": "hello"})
    found = read_record(tmp_path / "a.mat")
    assert found.values == pytest.approx(SIGNALS)
    assert found.sampling_hz == 100.0
    savemat(tmp_path / "b.mat", {"acc": SIGNALS.T, "force": SIGNALS})
    with pytest.raises(FemtuneError, match="2 arrays"):
        read_record(tmp_path / "b.mat", sampling_hz=1.0)
    assert read_record(tmp_path / "b.mat", sampling_hz=1.0, variable="force").samples == 50
    with pytest.raises(FemtuneError, match="no variable 'forse'"):
        read_record(tmp_path / "b.mat", sampling_hz=1.0, variable="forse")


def test_hdf5_files(tmp_path):
    h5py = pytest.importorskip("h5py", reason="h5py is not installed: pip install femtune[hdf5]")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["run/acc"] = SIGNALS.T
        file["run/fs"] = 100.0
    found = read_record(tmp_path / "a.h5")
    assert found.values == pytest.approx(SIGNALS)
    assert found.sampling_hz == 100.0
    (tmp_path / "a.h5").write_bytes((tmp_path / "a.h5").read_bytes()[:300])
    with pytest.raises(FemtuneError, match="this HDF5 file cannot be read"):
        read_record(tmp_path / "a.h5")


@pytest.mark.parametrize("kind", [np.int16, np.int32, np.float32, np.uint8])
def test_sound_files(tmp_path, kind):
    scale = {np.int16: 2**15 - 1, np.int32: 2**31 - 1, np.float32: 1.0, np.uint8: 127.0}[kind]
    data = (SIGNALS.T * scale + (128 if kind is np.uint8 else 0)).astype(kind)
    wavfile.write(tmp_path / "a.wav", 100, data)
    found = read_record(tmp_path / "a.wav")
    assert found.values == pytest.approx(SIGNALS, abs=0.02 if kind is np.uint8 else 1e-4)
    assert found.sampling_hz == 100.0


def test_a_sound_file_cut_short_is_refused(tmp_path):
    wavfile.write(tmp_path / "a.wav", 100, (SIGNALS.T * 30000).astype(np.int16))
    whole = (tmp_path / "a.wav").read_bytes()
    # the last samples are lost; there is no chunk of data
    for content in (whole[:-60], b"RIFF" + (28).to_bytes(4, "little") + whole[8:36]):
        (tmp_path / "a.wav").write_bytes(content)
        with pytest.raises(FemtuneError, match="this WAV file cannot be read"):
            read_record(tmp_path / "a.wav")


def test_a_rate_that_contradicts_the_file_is_refused(tmp_path):
    wavfile.write(tmp_path / "a.wav", 100, SIGNALS.T.astype(np.float32))
    with pytest.raises(FemtuneError, match="contradicts that of the file"):
        read_record(tmp_path / "a.wav", sampling_hz=200.0)
    with pytest.raises(FemtuneError, match="contradicts"):
        read_record(written(tmp_path, "time,a,b,c\n" + rows(",", time=True)), sampling_hz=200.0)


def test_what_is_not_said_is_asked_for(tmp_path):
    path = written(tmp_path, rows(","))
    with pytest.raises(FemtuneError, match="sampling rate"):
        read_record(path)
    with pytest.raises(FemtuneError, match="column 4 does not exist"):
        read_record(path, [ChannelColumn(4, Dof(1, "X"))], 100.0)
    with pytest.raises(FemtuneError, match="the file has no column 'a'"):
        read_record(path, [ChannelColumn("a", Dof(1, "X"))], 100.0)
    with pytest.raises(FemtuneError, match="does not exist"):
        read_record(tmp_path / "none.csv")
    with pytest.raises(FemtuneError, match="extension"):
        read_record(written(tmp_path, "1", "a.rec"))


@pytest.mark.parametrize("name", ["Sample_UFF58_ascii.uff", "Sample_UFF58b_bin.uff"])
def test_universal_files_of_another_program(shared_data, name):
    found = read_record(shared_data / "uff" / name)
    assert found.values.shape == (1, 79292)
    assert found.sampling_hz == pytest.approx(65536.0, rel=1e-5)
    assert found.values.std() > 0.0


@pytest.mark.slow
def test_ascii_and_binary_are_the_same_record(shared_data):
    ascii_, binary = (read_record(shared_data / "uff" / f"Sample_UFF58{n}.uff") for n in ("_ascii", "b_bin"))
    assert ascii_.values == pytest.approx(binary.values, rel=1e-5, abs=1e-7)


@pytest.mark.slow
def test_a_universal_file_without_time_records_says_so(shared_data):
    with pytest.raises(FemtuneError, match="no time records"):
        read_record(shared_data / "garteur" / "frf_1995.unv")
