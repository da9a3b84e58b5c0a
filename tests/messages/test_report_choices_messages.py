"""What a user reads when choices of a report do not fit the study."""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path

import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError
from femtune.testing import example_deck, example_test

STUDY = """[study]
title = "Cantilever"
deck = "beam.bdf"
units = "m-kg-s"
choices = "choices.toml"

[test]
file = "beam.uff"
"""
PARAMETER = '[[parameter]]\nname = "root"\nfields = ["PBAR 1 I1"]\nlower = 0.5\nupper = 2.0\n'


def _folder(folder: Path, choices: str, study: str = STUDY) -> Path:
    shutil.copy(example_deck(folder), folder / "beam.bdf")
    shutil.copy(example_test(folder), folder / "beam.uff")
    inputs = ""
    for name in ("beam.bdf", "beam.uff"):
        digest = hashlib.sha256((folder / name).read_bytes()).hexdigest()
        inputs += f'[[input]]\npath = "{name}"\nsha256 = "{digest}"\n\n'
    (folder / "choices.toml").write_text(f"schema_version = 1\n\n{inputs}{choices}\n", encoding="utf-8")
    (folder / "study.toml").write_text(study, encoding="utf-8")
    return folder / "study.toml"


def _told(study: Path) -> str:
    with pytest.raises(FemtuneError) as caught:
        ft.correlate(study)
    return str(caught.value).replace(f"{study.parent}/", "")


def test_choices_of_another_deck(tmp_path: Path) -> None:
    study = _folder(tmp_path, "")
    (tmp_path / "beam.bdf").write_text((tmp_path / "beam.bdf").read_text() + "$ changed\n", encoding="utf-8")
    check_shown("study.choices", _told(study))


def test_choices_of_another_test(tmp_path: Path) -> None:
    study = _folder(tmp_path, "", STUDY.replace("beam.uff", "other.uff"))
    shutil.copy(tmp_path / "beam.uff", tmp_path / "other.uff")
    check_shown("study.choices, other input", _told(study))


@pytest.mark.parametrize(
    ("name", "table", "more"),
    [
        ("study.choices, configuration", '[[pair]]\nconfiguration = "BC"\ntest = "1"\nmodel = 1', ""),
        (
            "study.choices, parameter",
            '[[parameter]]\nname = "root"\nfield = "PBAR 2 I1"\nlower = 0.5\nupper = 2.0',
            PARAMETER,
        ),
        ("study.choices, poles", '[[mode]]\nmethod = "N4SID"', ""),
        ("sensor.off-unknown", '[[sensor_off]]\nsensor = "99Z+"', ""),
    ],
)
def test_choices_that_do_not_fit(tmp_path: Path, name: str, table: str, more: str) -> None:
    check_shown(name, _told(_folder(tmp_path, table, STUDY + more)))


def test_choices_of_several_configurations(tmp_path: Path) -> None:
    pairs = [f'[[pair]]\nconfiguration = "{name}"\ntest = "1"\nmodel = 1\n' for name in ("free", "fixed")]
    _folder(tmp_path, "\n".join(pairs))
    with pytest.raises(FemtuneError) as caught:
        ft.init(tmp_path / "beam.bdf", tmp_path / "beam.uff", tmp_path / "first", choices=tmp_path / "choices.toml")
    check_shown("study.choices, several", str(caught.value).replace(f"{tmp_path}/", ""))


def test_a_pair_that_is_prescribed_and_forbidden(tmp_path: Path) -> None:
    keys = 'pairs = [{ test = "3", model = 3 }]\nnever_pairs = [{ test = "3", model = 3 }]\n'
    check_shown("correlate.never-pair", _told(_folder(tmp_path, "", STUDY + keys)))


def test_a_mode_of_a_pair_has_another_number(tmp_path: Path) -> None:
    keys = 'pairs = [{ test = "3", model = 3, model_hz = 44.695 }]\n'
    check_shown("correlate.renumbered", _told(_folder(tmp_path, "", STUDY + keys)))


def test_too_few_sensors_are_left(tmp_path: Path) -> None:
    keys = 'sensors_off = ["2Y+", "2Z+", "3Y+", "3Z+", "4Y+", "4Z+", "5Y+"]\n'
    check_shown("sensor.off-unknown, none left", _told(_folder(tmp_path, "", STUDY + keys)))
