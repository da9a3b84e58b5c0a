"""Universal Files and files of single functions in an identification file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.files.uff import test_variants as variants

from femtune.errors import FemtuneError
from femtune.files.described_test import read_described
from femtune.files.identification_file import read_identify_file
from femtune.steps.identify.request import asked_of


def described(tmp_path: Path, text: str):  # type: ignore[no-untyped-def]
    (tmp_path / "id.toml").write_text(text)
    return read_described(read_identify_file(tmp_path / "id.toml"))


def test_kind_and_factor_of_a_universal_file(tmp_path: Path) -> None:
    nothing = variants.frf(variants.ACCELERANCE / 9.80665, kinds=(18, 0, 0), labels=("Hz", "NONE", "NONE"))
    (tmp_path / "a.ufb").write_text(variants.UNITS + nothing)
    stated = '[identify]\nfrfs = "a.ufb"\n[functions]\n'
    found = described(tmp_path, stated + 'kind = "accelerance"\nfactor = 9.80665\n')
    np.testing.assert_allclose(found.frfs.values[0, 0], variants.ACCELERANCE, rtol=1e-4)
    assert found.frfs.kind == "accelerance"
    for more in ('kind = "accelerance"\nresponses = ["1Z+"]\n', 'kind = "mobility"\nstart_hz = 1.0\n'):
        with pytest.raises(FemtuneError) as caught:
            described(tmp_path, stated + more)
        assert caught.value.code == "frf.layout"
    (tmp_path / "a.ufb").write_text(variants.UNITS + variants.frf(labels=("Hz", "g", "N")))
    labelled = described(tmp_path, '[identify]\nfrfs = "a.ufb"\n')
    assert "uff.unit-label" in {notice.code for notice in labelled.notices}


def single(tmp_path: Path, name: str, values: np.ndarray) -> None:
    rows = zip(variants.HZ, values.real, values.imag)
    (tmp_path / name).write_text("hz,re,im\n" + "".join(f"{f:g},{a:.9g},{b:.9g}\n" for f, a, b in rows))


FUNCTIONS = '[functions]\nkind = "accelerance"\nfrequency = "hz"\n'


def function(node: int, file: str = "") -> str:
    named = f'file = "{file}"\n' if file else ""
    return f'[[function]]\n{named}column = "re"\nimaginary = "im"\nresponse = "{node}Z+"\nreference = "3Z+"\n'


@pytest.mark.parametrize(
    "text",
    [
        '[identify]\nfrfs = ["a.csv", "b.txt"]\n' + FUNCTIONS + function(3) + function(5),
        "[identify]\n" + FUNCTIONS + function(3, "a.csv") + function(5, "b.txt"),
        '[identify]\nfrfs = ["b.txt", "a.csv"]\n' + FUNCTIONS + function(3, "a.csv") + function(5, "b.txt"),
        '[identify]\nfrfs = "a.csv"\n' + FUNCTIONS + function(3) + function(5, "b.txt"),
    ],
)
def test_a_file_for_each_function(tmp_path: Path, text: str) -> None:
    single(tmp_path, "a.csv", variants.ACCELERANCE)
    single(tmp_path, "b.txt", 0.5 * variants.ACCELERANCE)
    frfs = described(tmp_path, text).frfs
    assert frfs.responses.labels() == ["3Z+", "5Z+"]
    np.testing.assert_allclose(frfs.values[:, 0], [variants.ACCELERANCE, 0.5 * variants.ACCELERANCE], rtol=1e-7)


def test_what_a_file_for_each_function_needs(tmp_path: Path) -> None:
    single(tmp_path, "a.csv", variants.ACCELERANCE)
    mixed = "[identify]\n" + FUNCTIONS + function(3, "a.csv") + function(5)
    without_kind = "[identify]\n" + FUNCTIONS.replace('kind = "accelerance"\n', "") + function(3, "a.csv")
    for text in (mixed, without_kind):
        with pytest.raises(FemtuneError):
            described(tmp_path, text)


def test_a_universal_file_is_asked_by_its_content(tmp_path: Path) -> None:
    (tmp_path / "a.dat").write_text(variants.FILE)
    assert asked_of(tmp_path / "a.dat", {}).identify.frfs == "a.dat"


@pytest.mark.parametrize("rate", ["1e308", "1e10", "0", "-5.0", "nan", "inf"])
def test_rates_that_no_test_has(tmp_path: Path, rate: str) -> None:
    (tmp_path / "id.toml").write_text(f'[identify]\nrecord = "a.csv"\nsampling_hz = {rate}\n')
    with pytest.raises(FemtuneError, match="sampling_hz"):
        read_identify_file(tmp_path / "id.toml")
