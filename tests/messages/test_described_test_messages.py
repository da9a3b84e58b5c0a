"""What a user reads when files of FRFs or of points do not fit their description."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.files.uff.coherences import content_of
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError, FemtuneErrors
from femtune.files.described_test import described_test, read_described
from femtune.files.identification_file import read_identify_file
from femtune.files.points_table import read_points
from femtune.files.records import read_record
from femtune.units import SI

H = np.ones((7, 3), complex)
STATED = '[functions]\nkind = "accelerance"\nresponses = ["1Z+", "2Z+"]\nreferences = ["1Z+"]\nstep_hz = 0.5\n'


def described(folder: Path, text: str, frfs: str = '"frf.npy"') -> Path:
    np.save(folder / "frf.npy", H)
    (folder / "test.toml").write_text(f"[identify]\nfrfs = {frfs}\n{text}")
    return folder / "test.toml"


def message(folder: Path, path: Path) -> str:
    with pytest.raises((FemtuneError, FemtuneErrors)) as caught:
        read_described(read_identify_file(path))
    return str(caught.value).replace(f"{folder}/", "")


def test_functions_without_a_description(tmp_path: Path) -> None:
    check_shown("frf.layout", message(tmp_path, described(tmp_path, "")))


def test_an_axis_of_another_length(tmp_path: Path) -> None:
    text = STATED + 'axes = ["frequency", "response"]\n'
    check_shown("frf.layout, length of an axis", message(tmp_path, described(tmp_path, text)))


def test_axes_that_are_not_clear(tmp_path: Path) -> None:
    check_shown("frf.layout, axes", message(tmp_path, described(tmp_path, STATED)))


def test_a_description_that_contradicts_itself(tmp_path: Path) -> None:
    (tmp_path / "test.toml").write_text('[identify]\nrecord = "a.csv"\n' + STATED)
    check_shown("identify.layout", message(tmp_path, tmp_path / "test.toml"))
    text = STATED + 'axes = ["response", "response"]\n'
    check_shown("identify.layout, axes", message(tmp_path, described(tmp_path, text)))


def test_several_files_of_arrays(tmp_path: Path) -> None:
    text = STATED.replace('"2Z+"', '"2Z+", "3Z+"') + 'axes = ["frequency", "response"]\n'
    path = described(tmp_path, text, '["frf.npy", "frf.npy"]')
    check_shown("identify.several-arrays", message(tmp_path, path))


def test_a_record_is_no_test_of_a_study(tmp_path: Path) -> None:
    (tmp_path / "test.toml").write_text('[identify]\nrecord = "a.csv"\n')
    with pytest.raises(FemtuneError) as caught:
        described_test(tmp_path / "test.toml", "BC", SI)
    check_shown("test.described", str(caught.value).replace(f"{tmp_path}/", ""))


def test_a_point_without_numbers(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text("node,x,y,z\n1,0,0,0\n2,a,0,0\n")
    with pytest.raises(FemtuneError) as caught:
        read_points(tmp_path / "points.csv")
    check_shown("test.points", str(caught.value).replace(f"{tmp_path}/", ""))


def test_a_table_that_is_too_wide(tmp_path: Path) -> None:
    (tmp_path / "wide.csv").write_text((",".join(["1"] * 12_000) + "\n") * 2)
    with pytest.raises(FemtuneError) as caught:
        read_record(tmp_path / "wide.csv", sampling_hz=1.0)
    check_shown("record.too-wide", str(caught.value).replace(f"{tmp_path}/", ""))


@pytest.mark.slow
def test_an_archive_that_expands(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "a.npz", a=np.zeros((1, 1 << 26), dtype=np.int8), b=np.zeros(1 << 28, dtype=np.int8))
    with pytest.raises(FemtuneError) as caught:
        read_record(tmp_path / "a.npz", sampling_hz=1.0)
    # the size of a compressed file depends on the library
    lines = str(caught.value).replace(f"{tmp_path}/", "").splitlines()
    check_shown("record.too-large", "\n".join(line for line in lines if "file =" not in line))


def test_coherence_without_its_function(tmp_path: Path) -> None:
    notices = content_of(tmp_path, {(3, 1): np.full(20, 0.8)}).notices
    notice = next(n for n in notices if n.code == "uff.unused-coherence")
    check_shown("uff.unused-coherence", str(notice).replace(f"{tmp_path}/", ""))


def test_a_column_that_is_given_twice(tmp_path: Path) -> None:
    (tmp_path / "h.csv").write_text("f,re,im\n1,2,3\n2,3,4\n")
    entry = '[[function]]\ncolumn = 2\nimaginary = 3\nresponse = "{}Z+"\nreference = "1Z+"\n'
    text = '[functions]\nkind = "accelerance"\nfrequency = 1\n' + entry.format(1) + entry.format(2)
    check_shown("frf.layout, column twice", message(tmp_path, described(tmp_path, text, '"h.csv"')))


def test_functions_with_the_same_values(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    h = rng.standard_normal((9, 3)) + 1j * rng.standard_normal((9, 3))
    path = described(tmp_path, STATED.replace('"2Z+"]', '"2Z+", "3Z+"]'))
    for rows, codes in ((h, []), (h[:, [0, 1, 1]], ["frf.same-values"])):
        np.save(tmp_path / "frf.npy", rows)
        notices = read_described(read_identify_file(path)).notices
        assert [n.code for n in notices] == codes
    check_shown("frf.same-values", str(notices[0]))
