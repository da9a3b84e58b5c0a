"""docs/guide/simulate-a-test.md: its code runs, and the file it writes is a test of the deck."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import femtune as ft
from femtune.cli import main

_PAGE = (Path(__file__).resolve().parents[1] / "docs" / "guide" / "simulate-a-test.md").read_text(encoding="utf-8")
_STUDY = """
[study]
title = "A simulated test"
deck = "model.bdf"
units = "m-kg-s"
[modes]
count = 8
[[configuration]]
name = "A"
test = "simulated.uff"
[[parameter]]
name = "E"
fields = ["MAT1 1 E"]
lower = 0.5
upper = 2.0
[residuals]
frequency_sd = 0.002
shape_sd = 0.01
"""


def _cantilever(youngs_modulus: str) -> str:
    """Eleven points along x, clamped at the first; bends in y and z, five modes asked for."""
    cards = ["SOL 103", "CEND", "METHOD = 1", "SPC = 1", "BEGIN BULK", "EIGRL,1,,,5"]
    # point 6 has a displacement frame of its own, Z along the basic y, so that its directions matter
    cards += ["CORD2R,9,,0.,0.,0.,0.,1.,0.", ",1.,0.,0."]
    cards += [f"GRID,{i},,{(i - 1) / 10:.1f},0.,0.,{9 if i == 6 else ''}" for i in range(1, 12)]
    cards += [f"CBAR,{i},1,{i},{i + 1},{'0.,-1.,0.' if i == 6 else '0.,0.,1.'}" for i in range(1, 11)]
    cards += ["PBAR,1,1,1.-4,1.-9,2.-9,1.-9", f"MAT1,1,{youngs_modulus},,.3,7800.", "SPC1,1,123456,1", "ENDDATA"]
    return "\n".join(cards) + "\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "true.bdf").write_text(_cantilever("2.31+11"))
    (tmp_path / "model.bdf").write_text(_cantilever("2.1+11"))
    (tmp_path / "study.toml").write_text(_STUDY)
    monkeypatch.chdir(tmp_path)
    code = re.findall(r"```python\n(.*?)```", _PAGE, re.S)
    assert len(code) == 2
    exec(compile(code[0], "simulate-a-test.md", "exec"), {})
    return tmp_path


@pytest.mark.slow
def test_the_true_value_is_found(folder: Path) -> None:
    update = ft.update(folder / "study.toml").results.update
    assert update is not None
    found = update.parameters[0]
    # frequencies of 5 modes with 0.2 % each determine E to about 2 · 0.2 % / √5
    assert found.sd is not None
    assert 0.0005 < found.sd < 0.004
    np.testing.assert_allclose(found.value, 1.1, atol=4 * found.sd)


@pytest.mark.slow
def test_the_commands_of_the_page_run(folder: Path) -> None:
    commands = re.findall(r"```\nfemtune (.*?)```", _PAGE, re.S)
    written = ("simulated.uff", "frfs.uff")
    for command, name in zip(commands, written, strict=True):
        (folder / name).unlink(missing_ok=True)
        with pytest.raises(SystemExit) as end:
            main(shlex.split(command.replace("\\\n", " ")))
        assert end.value.code == 0
        assert (folder / name).stat().st_size > 3000


@pytest.mark.slow
def test_the_true_value_is_found_with_the_test_of_the_command(folder: Path) -> None:
    command = re.findall(r"```\nfemtune (.*?)```", _PAGE, re.S)[0]
    with pytest.raises(SystemExit):
        main(shlex.split(command.replace("\\\n", " ")))
    update = ft.update(folder / "study.toml").results.update
    assert update is not None
    assert update.parameters[0].value == pytest.approx(1.1, rel=0.01)


@pytest.mark.slow
def test_from_the_plan_to_the_update(folder: Path) -> None:
    code = re.findall(r"```python\n(.*?)```", _PAGE, re.S)[1]
    names: dict[str, Any] = {}
    exec(compile(code, "simulate-a-test.md", "exec"), names)
    assert len(names["test"].modes.freq_hz) >= 4
    (found,) = names["result"].parameters
    # four frequencies of 0.2 % determine E to about 2 · 0.2 % / √4; those of the test are much better
    assert found["value"] == pytest.approx(1.1, rel=0.004)
