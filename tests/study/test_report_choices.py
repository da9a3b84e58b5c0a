"""Choices of a reader of the report: taken by run, correlate and init, refused where their inputs have changed."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from tests.reporting.packed import unpacked as numbers_of

import femtune as ft
from femtune.document.page_view import Packed
from femtune.errors import FemtuneError, FemtuneErrors
from femtune.testing import example_deck, example_test

STUDY = """
[study]
title = "Cantilever"
deck = "beam.bdf"
units = "m-kg-s"

[test]
file = "beam.uff"
{test}

[[parameter]]
name = "root"
fields = ["PBAR 1 I1"]
lower = 0.5
upper = 2.0

[residuals]
frequency_sd = 0.01
"""


@pytest.fixture
def beam(tmp_path: Path) -> Path:
    """A folder with deck, test and study; returns the study."""
    shutil.copy(example_deck(tmp_path), tmp_path / "beam.bdf")
    shutil.copy(example_test(tmp_path), tmp_path / "beam.uff")
    return _study(tmp_path)


def _study(folder: Path, test: str = "") -> Path:
    path = folder / "study.toml"
    path.write_text(STUDY.format(test=test), encoding="utf-8")
    return path


def _inputs(folder: Path, names: tuple[str, ...] = ("beam.bdf", "beam.uff")) -> str:
    digests = {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in names}
    return "\n".join(f'[[input]]\npath = "{name}"\nsha256 = "{digest}"' for name, digest in digests.items())


def _choices(folder: Path, *tables: str, inputs: str | None = None) -> Path:
    path = folder / "choices.toml"
    text = [_inputs(folder) if inputs is None else inputs, *tables]
    path.write_text("schema_version = 1\n" + "\n".join(text) + "\n", encoding="utf-8")
    return path


NEVER = '[[never_pair]]\ntest = "3"\nmodel = 3'
PAIR = '[[pair]]\ntest = "2"\nmodel = 2'
OMIT = '[[leave_out]]\nmode = "4"\nreason = "doubtful"'
OFF = '[[sensor_off]]\nsensor = "3Z+"'
FREE = '[[parameter]]\nname = "tip"\nfield = "PBAR  2 I1"\nlower = 0.5\nupper = 2.0'


def test_correlate_takes_choices(beam: Path) -> None:
    (plain,) = ft.correlate(beam)
    (chosen,) = ft.correlate(beam, choices=_choices(beam.parent, NEVER, PAIR, OMIT, OFF))
    assert [p.test_label for p in plain.pairs] == ["1", "2", "3", "4"]
    assert [(p.test_label, p.model_number, p.fixed_by_hand) for p in chosen.pairs] == [("1", 1, False), ("2", 2, True)]
    assert [(m.test_label, m.reason) for m in chosen.left_out] == [("4", "doubtful")]
    (alone,) = chosen.unpaired_test
    assert alone.test_label == "3"
    assert alone.reason.endswith("; the study forbids its pair with model mode 3")
    assert len(plain.comac) - len(chosen.comac) == 1
    assert "3Z+" not in {c.dof for c in chosen.comac}


def test_run_takes_choices_and_keeps_their_digest(beam: Path, tmp_path: Path) -> None:
    choices = _choices(tmp_path, OMIT, OFF, FREE)
    done = ft.run(beam, choices=choices, output=tmp_path / "run")
    assert set(done.values) == {"root", "tip"}
    files = {Path(f.path).name: f.sha256 for f in done.results.provenance.input_files}
    assert files["choices.toml"] == hashlib.sha256(choices.read_bytes()).hexdigest()
    (sensors,) = done.results.sensors
    assert [(s.test_dof, "sensors_off" in s.reason) for s in sensors.unmatched] == [("3Z+", True)]


def test_a_key_of_the_study_does_the_same(beam: Path) -> None:
    _choices(beam.parent, NEVER)
    beam.write_text(beam.read_text().replace("[study]\n", '[study]\nchoices = "choices.toml"\n'), encoding="utf-8")
    assert [p.test_label for p in ft.correlate(beam).records[0].pairs] == ["1", "2", "4"]


def test_parts_of_the_picture_name_the_fields_of_their_elements(beam: Path, tmp_path: Path) -> None:
    done = ft.run(beam, output=tmp_path / "run")
    text = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    view = json.loads(re.search(r'id="view">(.*?)</script>', text, re.S)[1])  # type: ignore[index]
    (scene,) = view["scenes"]
    points, lines, part = (numbers_of(Packed(**scene[k])) for k in ("points", "lines", "line_parts"))
    middles = points[lines.astype(int)].mean(axis=1)[:, 0]
    # elements 1 and 2 have property 1, 3 and 4 property 2
    for x, k in zip(middles, part.astype(int)):
        own, other = ("1", "2") if x < middles.mean() else ("2", "1")
        assert f"PBAR {own} I1" in scene["part_fields"][k]
        assert f"PBAR {other} I1" not in scene["part_fields"][k]
        assert "MAT1 1 E" in scene["part_fields"][k]
    assert {f["field"] for f in view["choices"]["fields"]} >= set().union(*scene["part_fields"])
    spans = {f.field: f.elements for f in done.results.model.fields}
    assert (spans["PBAR 1 I1"], spans["PBAR 2 I1"], spans["MAT1 1 E"]) == (((1, 2),), ((3, 4),), ((1, 4),))


def test_a_choice_replaces_the_entry_of_the_study(beam: Path) -> None:
    _study(beam.parent, 'pairs = [{ test = "3", model = 3 }]\nleave_out = [{ mode = "2", reason = "of the study" }]')
    (found,) = ft.correlate(beam, choices=_choices(beam.parent, NEVER, PAIR))
    assert [(p.test_label, p.fixed_by_hand) for p in found.pairs] == [("1", False), ("2", True), ("4", False)]
    assert found.left_out == ()


def test_a_field_that_is_a_parameter_stays_one(beam: Path) -> None:
    again = '[[parameter]]\nname = "other"\nfield = "PBAR 1 I1"\nlower = 0.9\nupper = 1.1'
    study = ft.Study(beam, choices=_choices(beam.parent, again, FREE))
    assert [(p.name, p.lower) for p in study.file.parameter] == [("root", 0.5), ("tip", 0.5)]


def _refused(beam: Path, choices: Path) -> FemtuneError:
    with pytest.raises((FemtuneError, FemtuneErrors)) as caught:
        ft.correlate(beam, choices=choices)
    error = caught.value
    return error.errors[0] if isinstance(error, FemtuneErrors) else error


def test_a_changed_deck_refuses_the_choices(beam: Path) -> None:
    choices, deck = _choices(beam.parent, NEVER), beam.parent / "beam.bdf"
    before = hashlib.sha256(deck.read_bytes()).hexdigest()
    deck.write_text(deck.read_text() + "$ changed\n", encoding="utf-8")
    error = _refused(beam, choices)
    after = hashlib.sha256(deck.read_bytes()).hexdigest()
    assert error.code == "study.choices"
    assert error.values == {"beam.bdf": f"SHA-256 {before[:12]}… then, {after[:12]}… now"}


def test_another_test_refuses_the_choices(beam: Path) -> None:
    choices = _choices(beam.parent, NEVER)
    shutil.copy(beam.parent / "beam.uff", beam.parent / "other.uff")
    beam.write_text(beam.read_text().replace("beam.uff", "other.uff"), encoding="utf-8")
    error = _refused(beam, choices)
    assert (error.code, error.what) == ("study.choices", "the choices were not made of 'other.uff'")


@pytest.mark.parametrize(
    ("table", "code", "said"),
    [
        ('[[pair]]\nconfiguration = "BC"\ntest = "1"\nmodel = 1', "study.choices", "a configuration 'BC'"),
        ('[[parameter]]\nname = "root"\nfield = "PBAR 2 I1"\nlower = 0.5\nupper = 2.0', "study.choices", "as 'root'"),
        ('[[mode]]\nmethod = "N4SID"', "study.choices", "poles of an identification"),
        ('[[pair]]\ntest = "9"\nmodel = 1', "study.unknown-mode", "'9'"),
        ('[[sensor_off]]\nsensor = "99Z+"', "sensor.off-unknown", "'99Z+'"),
        ('[[pear]]\ntest = "9"', "study.unknown-key", "pear"),
    ],
)
def test_what_does_not_fit_is_refused(beam: Path, table: str, code: str, said: str) -> None:
    error = _refused(beam, _choices(beam.parent, table))
    assert error.code == code
    assert said in error.what


def test_prescribed_and_forbidden_pairs_contradict(beam: Path) -> None:
    entry = '[{ test = "3", model = 3 }]'
    _study(beam.parent, f"pairs = {entry}\nnever_pairs = {entry}")
    with pytest.raises(FemtuneError) as caught:
        ft.correlate(beam)
    assert caught.value.code == "correlate.never-pair"


def _with_hz(beam: Path, table: str = "pair") -> str:
    """A pair of test mode 2 with the frequency of its model mode."""
    hz = ft.correlate(beam)[0].mac_model_freq_hz[1]
    return f'[[{table}]]\ntest = "2"\nmodel = 2\nmodel_hz = {hz!r}'


def test_a_pair_with_the_frequency_of_its_mode_is_taken(beam: Path) -> None:
    (chosen,) = ft.correlate(beam, choices=_choices(beam.parent, _with_hz(beam)))
    assert [p.test_label for p in chosen.pairs if p.fixed_by_hand] == ["2"]


@pytest.mark.parametrize("table", ["pair", "never_pair"])
def test_another_mode_of_the_same_number_refuses_the_choices(beam: Path, table: str) -> None:
    """Files are the same, but the study has another configuration of the model: with a mass, numbers may change."""
    choices = _choices(beam.parent, _with_hz(beam, table))
    before = ft.correlate(beam)[0].mac_model_freq_hz[1]
    entry = '[[configuration]]\nname = "baseline"\ntest = "beam.uff"\nmasses = [{ node = 5, mass = 1.0 }]'
    beam.write_text(STUDY.format(test="").replace('[test]\nfile = "beam.uff"', entry), encoding="utf-8")
    error = _refused(beam, choices)
    assert error.code == "correlate.renumbered"
    assert error.values["model mode 2 when the pair was chosen"] == f"{before:.7g} Hz"
    assert error.values["model mode 2 now"] != error.values["model mode 2 when the pair was chosen"]


def test_a_run_refuses_a_mode_that_has_another_number(beam: Path, tmp_path: Path) -> None:
    # the first mode bends about the axis of the parameter, the second does not
    hz = ft.correlate(beam)[0].mac_model_freq_hz[0]
    choices = _choices(beam.parent, f'[[pair]]\ntest = "1"\nmodel = 1\nmodel_hz = {hz!r}')
    text = beam.read_text(encoding="utf-8")
    beam.write_text(text.replace("lower = 0.5", "lower = 0.5\nnominal = 0.8"), encoding="utf-8")
    with pytest.raises(FemtuneError) as caught:
        ft.run(beam, choices=choices, output=tmp_path / "run")
    assert caught.value.code == "correlate.renumbered"


def test_rounding_of_a_frequency_is_no_other_mode(beam: Path) -> None:
    hz = ft.correlate(beam)[0].mac_model_freq_hz[1]
    for factor, taken in ((1.0 + 5e-6, True), (1.0 - 5e-5, False)):
        pair = f'[[pair]]\ntest = "2"\nmodel = 2\nmodel_hz = {hz * factor!r}'
        choices = _choices(beam.parent, pair)
        if taken:
            assert ft.correlate(beam, choices=choices)[0].pairs[1].fixed_by_hand
        else:
            assert _refused(beam, choices).code == "correlate.renumbered"


def test_two_sensors_must_stay(beam: Path) -> None:
    labels = [c.dof for c in ft.correlate(beam)[0].comac]
    _study(beam.parent, f"sensors_off = {labels[1:]}".replace("'", '"'))
    with pytest.raises(FemtuneError) as caught:
        ft.correlate(beam)
    assert caught.value.code == "sensor.off-unknown"
    assert "fewer than two sensors" in caught.value.what


def test_init_writes_the_choices_into_the_study(beam: Path, tmp_path: Path) -> None:
    choices = _choices(tmp_path, NEVER, PAIR, OMIT, OFF, FREE)
    made = ft.init(beam.parent / "beam.bdf", beam.parent / "beam.uff", tmp_path / "first", choices=choices)
    entry = ft.Study(made.path).file.configurations[0]
    assert [(p.test, p.model) for p in entry.pairs] == [("2", 2)]
    assert [(p.test, p.model) for p in entry.never_pairs] == [("3", 3)]
    assert [(m.mode, m.reason) for m in entry.leave_out] == [("4", "doubtful")]
    assert entry.sensors_off == ("3Z+",)
    assert [(p.name, p.lower, p.upper) for p in ft.Study(made.path).file.parameter] == [("tip", 0.5, 2.0)]
    # what is told is what is written, and not what would have been proposed
    told = [line.strip() for line in made.overview.split("\n") if line.strip().startswith("parameter ")]
    assert told == ["parameter tip: PBAR 2 I1, 0.5 to 2, chosen on the page of a report"]
    assert made.overview.split("\n")[0].endswith(", 1 parameter")
    assert [p.test_label for p in ft.correlate(made.path)[0].pairs] == ["1", "2"]


def test_init_refuses_choices_of_another_deck(beam: Path, tmp_path: Path) -> None:
    choices = _choices(tmp_path, NEVER)
    other = tmp_path / "other.bdf"
    other.write_text((tmp_path / "beam.bdf").read_text() + "$ other\n", encoding="utf-8")
    with pytest.raises(FemtuneError) as caught:
        ft.init(other, tmp_path / "beam.uff", tmp_path / "first", choices=choices)
    assert (caught.value.code, caught.value.what) == ("study.choices", "the choices were not made of 'other.bdf'")
    assert not (tmp_path / "first" / "study.toml").exists()


def test_the_pairs_that_init_offers_go_into_what_it_writes(beam: Path, tmp_path: Path) -> None:
    """A test of frequencies that misses a mode: the line that is switched off in [test] works where it stands."""
    hz = np.sort(ft.modes(beam.parent / "beam.bdf", count=8).records[0].freq_hz)
    table = tmp_path / "hz.csv"
    table.write_text("freq_hz\n" + "\n".join(f"{1.01 * f:.4f}" for f in np.delete(hz, 2)[:6]) + "\n", encoding="utf-8")
    made = ft.init(beam.parent / "beam.bdf", table, tmp_path / "first", units="m-kg-s")
    text = made.path.read_text(encoding="utf-8")
    (line,) = (one for one in text.splitlines() if one.startswith("# pairs = "))
    made.path.write_text(text.replace(line, line.removeprefix("# ")), encoding="utf-8")
    (found,) = ft.correlate(made.path)
    fixed = [p for p in found.pairs if p.fixed_by_hand]
    assert [(p.test_label, p.model_number) for p in fixed] == [("3", 4)]
    assert max(abs(p.freq_error_percent) for p in found.pairs) < 2.0


@pytest.mark.parametrize("place", ["top", "end"])
def test_pairs_below_another_heading_are_told_their_place(beam: Path, place: str) -> None:
    line, text = 'pairs = [{ test = "3", model = 3 }]\n', beam.read_text(encoding="utf-8")
    beam.write_text(line + text if place == "top" else text + line, encoding="utf-8")
    with pytest.raises(FemtuneError) as caught:
        ft.correlate(beam)
    assert caught.value.code == "study.unknown-key"
    assert str(caught.value.hint).startswith("move the line below [test]")
