"""From the page to a file, from the file to the commands: the same modes, pairs, sensors and parameters."""

from __future__ import annotations

import re
import time
import tomllib
from pathlib import Path

import pytest
from click.testing import CliRunner

import femtune as ft
from femtune.cli import main
from femtune.testing import example_deck, example_test

from .devtools import CHROMIUM, opened

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine"),
]

STUDY = """
[study]
title = "Cantilever"
deck = "cantilever.bdf"
units = "m-kg-s"

[test]
file = "cantilever.uff"

[[parameter]]
name = "root"
fields = ["PBAR 1 I1", "PBAR 1 I2"]
lower = 0.5
upper = 2.0

[residuals]
frequency_sd = 0.01
"""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """A study beside its deck and its test."""
    example_deck(tmp_path)
    example_test(tmp_path)
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    return tmp_path / "study.toml"


def _chosen(report: Path, profile: Path) -> str:
    """The file after choices by mouse and keyboard."""
    ready = "!document.querySelector('#live') || !!document.querySelector('.livemodel[data-solved], #live .alert')"
    with opened(report, profile) as page:
        # what comes late moves what is below it
        for _ in range(100):
            if page.value(ready):
                break
            time.sleep(0.1)
        cells = page.value("document.querySelectorAll('.chooser table.mac tbody tr')[0].cells.length - 1")
        page.click(".chooser table.mac button", 0)
        # test mode 3 with model mode 3, twice by the keyboard: never a pair
        page.value(f"document.querySelectorAll('.chooser table.mac button')[{cells} + 2].focus()")
        page.press("ArrowDown")
        page.press("Enter")
        page.press("Enter")
        page.click(".chooser .omitted input[type=checkbox]", 3)
        page.write("a doubtful mode")
        page.click(".chooser .boxes input", 3)
        # half of the bar has the second property: a click on the picture, there or in the list of parts
        page.value("document.querySelector('.chooser .parts select').focus()")
        page.press("ArrowDown")
        parts = page.value("document.querySelector('.chooser .parts select').options.length")
        for _ in range(parts):
            fields = page.value("[...document.querySelectorAll('.chooser .of-part span')].map((s) => s.textContent)")
            if any(text.startswith("PBAR 2 I1 ") for text in fields):
                break
            page.press("ArrowDown")
        (tip,) = (i for i, text in enumerate(fields) if text.startswith("PBAR 2 I1 "))
        page.value(f"document.querySelectorAll('.chooser .of-part input')[{tip}].focus()")
        page.press(" ")
        text = page.value("document.querySelector('.chooser textarea').value")
    assert isinstance(text, str)
    return text


def test_from_the_page_to_the_same_modes_pairs_and_parameters(study: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    done = ft.run(study, output=folder)
    assert done.report is not None
    choices = tmp_path / "choices.toml"
    choices.write_text(_chosen(done.report, tmp_path / "profile"), encoding="utf-8")
    said = tomllib.loads(choices.read_text(encoding="utf-8"))
    digests = {one["path"]: one["sha256"] for one in said["input"]}
    assert digests == {f.path: f.sha256 for f in done.results.provenance.input_files}
    assert [(p["test"], p["model"]) for p in said["pair"]] == [("1", 1)]
    assert [(p["test"], p["model"]) for p in said["never_pair"]] == [("3", 3)]
    (before,) = (c for c in done.results.correlations if c.stage == "before")
    hz = [said["pair"][0]["model_hz"], said["never_pair"][0]["model_hz"]]
    assert hz == pytest.approx([before.mac_model_freq_hz[0], before.mac_model_freq_hz[2]], rel=1e-11)
    assert [(m["mode"], m["reason"]) for m in said["leave_out"]] == [("4", "a doubtful mode")]
    (off,) = (one["sensor"] for one in said["sensor_off"])

    compared = CliRunner().invoke(main, ["correlate", str(study), "--choices", str(choices), "--json"])
    assert compared.exit_code in (0, 4), compared.output
    (found,) = ft.correlate(study, choices=choices)
    assert [(p.test_label, p.model_number, p.fixed_by_hand) for p in found.pairs] == [("1", 1, True), ("2", 2, False)]
    assert [m.test_label for m in found.left_out] == ["4"]
    assert [m.test_label for m in found.unpaired_test] == ["3"]
    assert off not in {c.dof for c in found.comac}

    again = ft.run(study, choices=choices, output=tmp_path / "again")
    assert {p.name: (p.fields, p.lower, p.upper) for p in again.results.parameters} == {
        "root": (("PBAR 1 I1", "PBAR 1 I2"), 0.5, 2.0),
        "I1_PBAR_2": (("PBAR 2 I1",), 0.7, 1.4),
    }
    # the page of that run begins with these choices and saves the same file
    assert again.report is not None
    with opened(again.report, tmp_path / "profile") as page:
        text = page.value("document.querySelector('.chooser textarea').value")
    assert text == choices.read_text(encoding="utf-8")

    first = ft.init(tmp_path / "cantilever.bdf", tmp_path / "cantilever.uff", tmp_path / "first", choices=choices)
    (of_first,) = ft.correlate(first.path)
    assert [(p.test_label, p.model_number) for p in of_first.pairs] == [("1", 1), ("2", 2)]
    assert [(p.name, p.fields) for p in ft.Study(first.path).file.parameter] == [
        ("root", ("PBAR 1 I1", "PBAR 1 I2")), ("I1_PBAR_2", ("PBAR 2 I1",)),
    ]  # fmt: skip


def test_a_report_without_a_page_of_choices_has_none(tmp_path: Path) -> None:
    """A page of modes compares nothing."""
    deck = example_deck(tmp_path)
    made = ft.modes(deck, report=tmp_path / "modes.html")
    assert made.report is not None
    text = made.report.read_text(encoding="utf-8")
    assert re.search(r'"choices":null', text)
