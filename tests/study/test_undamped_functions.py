"""FRFs compared with those of a model without damping: the damping of [response] does not reach residuals."""

from __future__ import annotations

from pathlib import Path

import pytest

import femtune as ft
from femtune.testing import example_deck

from ..messages.shown import check_shown

STUDY = """
[study]
title = "beam"
deck = "{deck}"
units = "m-kg-s"
[test]
file = "{test}"
[response]
inputs = ["5Z+"]
outputs = ["3Z+", "5Z+"]
from_hz = 20.0
to_hz = 60.0
step_hz = 1.0
ratio = 0.02
[[parameter]]
name = "root"
fields = ["PBAR 1 I1"]
lower = 0.5
upper = 2.0
[[residual]]
kind = "frf"
sd = 0.02
floor = 0.001
{more}
"""


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("undamped") / "frfs.uff"
    ft.respond(
        example_deck(path.parent), inputs=["5Z+"], outputs=["3Z+", "5Z+"], from_hz=20, to_hz=60, step_hz=0.5,
        ratio=0.02, units="m-kg-s", uff=path,
    )  # fmt: skip
    return path


def _study(measured: Path, folder: Path, more: str) -> Path:
    path = folder / "study.toml"
    path.write_text(STUDY.format(deck=example_deck(folder).resolve(), test=measured, more=more))
    return path


@pytest.mark.slow
def test_check_and_update_tell_that_nothing_damps_the_functions(measured: Path, tmp_path: Path) -> None:
    study = _study(measured, tmp_path, "")
    (told,) = [r for r in ft.check(study).remarks if r.code == "residual.frf-undamped"]
    check_shown("residual.frf-undamped", told)
    found = ft.update(study)
    assert "residual.frf-undamped" in [alert.code for alert in found.alerts]


@pytest.mark.parametrize("more", ["ratio = 0.02", "ratios = { 1 = 0.02, 2 = 0.02 }"])
def test_damping_of_the_residual_is_enough(measured: Path, tmp_path: Path, more: str) -> None:
    study = _study(measured, tmp_path, more)
    assert "residual.frf-undamped" not in [r.code for r in ft.check(study).remarks]
