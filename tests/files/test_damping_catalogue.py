"""The catalogue of damping: what is written is read back, and what is no catalogue is refused in sentences."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from femtune.errors import FemtuneError, FemtuneErrors
from femtune.files.damping_catalogue import DampingEntry, look_up, read_catalogue, write_catalogue

ENTRY = DampingEntry("eta", "material", ("MAT1 1 GE",), 0.0045, 3e-5, "", "frame.bdf: BC", "2026-11-22", "Frame")
GOOD = """[[damping]]
name = "eta"
of = "material"
fields = ["MAT1 1 GE"]
value = 0.0045
sd = 3e-5
unit = ""
source = "frame.bdf"
date = "2026-11-22"
study = "Frame"
"""


def test_what_is_written_is_read_back(tmp_path: Path):
    entries = [
        ENTRY,
        replace(ENTRY, name="b", of="joint", fields=("PBUSH 9 B5", "PBUSH 9 B6"), value=3.0, unit="N*m*s"),
    ]
    path = write_catalogue(tmp_path / "damping.toml", entries)
    assert list(read_catalogue(path).values()) == entries
    assert look_up(path, "b").value == 3.0


@given(st.text(max_size=60), st.floats(1e-300, 1e300))
def test_any_text_and_number_survive(tmp_path_factory: pytest.TempPathFactory, text: str, value: float):
    try:
        text.encode()
    except UnicodeEncodeError:
        return
    entry = replace(ENTRY, study=text, source=text, value=value, sd=value)
    path = write_catalogue(tmp_path_factory.getbasetemp() / "any.toml", [entry])
    assert read_catalogue(path) == {"eta": entry}


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("sd = 3e-5", "sd = 0.0", "sd is not positive"),
        ("sd = 3e-5", "sd = -1", "sd is not positive"),
        ("sd = 3e-5", "sd = nan", "'sd' is not a finite number"),
        ("value = 0.0045", "value = inf", "'value' is not a finite number"),
        ("value = 0.0045", "value = true", "'value' is not a finite number"),
        ("value = 0.0045", "value = " + "9" * 400, "'value' is not a finite number"),
        ("value = 0.0045", 'value = "0.0045"', "'value' is not a finite number"),
        ("value = 0.0045\n", "", "the key 'value' is missing"),
        ('of = "material"', 'of = "steel"', "'steel' is not allowed for the key of"),
        ('name = "eta"', 'name = "a b"', "is not a valid name"),
        ('name = "eta"', "name = 3", "'name' is not a text"),
        ('date = "2026-11-22"', 'date = "yesterday"', "is not a date"),
        ('date = "2026-11-22"', "date = 2026-11-22", "'date' is not a text"),
        ('fields = ["MAT1 1 GE"]', "fields = []", "fields is not a list of texts"),
        ('fields = ["MAT1 1 GE"]', 'fields = "MAT1 1 GE"', "fields is not a list of texts"),
        ('unit = ""', 'unti = ""', "did you mean 'unit'?"),
        ('study = "Frame"', f'study = "{"x" * 501}"', "not a text of at most 500 characters"),
    ],
)
def test_entries_that_have_no_meaning_are_refused(tmp_path: Path, old: str, new: str, says: str):
    assert old in GOOD
    (tmp_path / "c.toml").write_text(GOOD.replace(old, new))
    with pytest.raises(FemtuneError) as caught:
        read_catalogue(tmp_path / "c.toml")
    assert caught.value.code == "catalogue.entry"
    assert says in str(caught.value)
    assert "entry 1" in str(caught.value)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"[[damping]\n", "not a damping catalogue"),
        (b"[[parameter]]\nname = 'a'\n", "it has 'parameter'"),
        (b"damping = 3\n", "damping is no list of tables"),
        (b"\xff\xfe\x00", "not UTF-8"),
        (b"a = " + b"[" * 5000 + b"]" * 5000, "not a damping catalogue"),
        (b"#" * 1_000_001, "MB are too large"),
    ],
)
def test_files_that_are_no_catalogue_are_refused(tmp_path: Path, content: bytes, says: str):
    (tmp_path / "c.toml").write_bytes(content)
    with pytest.raises(FemtuneError) as caught:
        read_catalogue(tmp_path / "c.toml")
    assert caught.value.code == "catalogue.file"
    assert says in str(caught.value)


def test_a_folder_and_a_missing_file_are_no_catalogue(tmp_path: Path):
    for path in (tmp_path, tmp_path / "none.toml"):
        with pytest.raises(FemtuneError) as caught:
            read_catalogue(path)
        assert caught.value.code == "catalogue.file"


def test_problems_of_several_entries_are_shown_together(tmp_path: Path):
    (tmp_path / "c.toml").write_text(GOOD.replace("sd = 3e-5", "sd = 0") + GOOD.replace('of = "material"', 'of = ""'))
    with pytest.raises(FemtuneErrors) as caught:
        read_catalogue(tmp_path / "c.toml")
    assert "entry 1" in str(caught.value)
    assert "entry 2" in str(caught.value)


def test_one_name_twice(tmp_path: Path):
    (tmp_path / "c.toml").write_text(GOOD + GOOD)
    with pytest.raises(FemtuneError) as caught:
        read_catalogue(tmp_path / "c.toml")
    assert "another entry has the same name 'eta'" in str(caught.value)


def test_a_name_that_is_not_there(tmp_path: Path):
    (tmp_path / "c.toml").write_text(GOOD)
    with pytest.raises(FemtuneError) as caught:
        look_up(tmp_path / "c.toml", "etta")
    assert caught.value.code == "catalogue.unknown"
    assert "did you mean 'eta'?" in str(caught.value)
