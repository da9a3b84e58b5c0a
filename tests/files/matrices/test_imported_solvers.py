"""Whole studies of matrices that CalculiX and Ansys wrote: their own listed modes accept them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from femtune.errors import FemtuneError
from femtune.files.matrices.listed_modes import read_listed_modes

STUDY = """[study]
title = "Imported"
units = "m-kg-s"

[model]
{model}

[modes]
count = {count}

[[matrix]]
name = "K"
kind = "stiffness"
file = "{stiffness}"

[[matrix]]
name = "M"
kind = "mass"
file = "{mass}"
{more}
"""


@pytest.mark.slow
def test_calculix(calculix_job: Path) -> None:
    text = STUDY.format(
        model='grid = "beam.inp"\nlisting = "modes.dat"', count=10, stiffness="beam.sti", mass="beam.mas", more=""
    )
    (calculix_job / "study.toml").write_text(text)
    (found,) = ft.modes(calculix_job / "study.toml")
    np.testing.assert_allclose(found.freq_hz, read_listed_modes(calculix_job / "modes.dat"), rtol=2e-6)
    (facts,) = ft.info(calculix_job / "study.toml").record.configurations
    # the beam without the nodes of its clamped end
    assert facts.centre_of_gravity is not None
    assert facts.centre_of_gravity[0] > 1.0
    assert facts.centre_of_gravity[1:] == pytest.approx((0.1, 0.06))


def test_calculix_with_a_file_that_was_cut(calculix_job: Path, tmp_path: Path) -> None:
    for name in ("beam.inp", "beam.dof", "beam.mas", "modes.dat"):
        (tmp_path / name).write_bytes((calculix_job / name).read_bytes())
    lines = (calculix_job / "beam.sti").read_text().splitlines(keepends=True)
    (tmp_path / "beam.sti").write_text("".join(lines[: len(lines) // 2]))
    text = STUDY.format(model='listing = "modes.dat"', count=10, stiffness="beam.sti", mass="beam.mas", more="")
    (tmp_path / "study.toml").write_text(text)
    with pytest.raises(FemtuneError) as error:
        ft.modes(tmp_path / "study.toml")
    assert error.value.code == "matrices.truncated"


@pytest.mark.slow
def test_ansys(shared_data: Path, tmp_path: Path) -> None:
    pytest.importorskip("ansys.mapdl.reader", reason="ansys-mapdl-reader is not installed")
    full = shared_data / "ansys_full" / "file.full"
    listed = "listed_hz = [1283.200, 1283.200, 5781.975, 6919.399, 6919.399, 10172.615]\nlisted_tolerance = 5e-7"
    text = STUDY.format(model=listed, count=6, stiffness=full, mass=full, more='record = "M"')
    (tmp_path / "study.toml").write_text(text)
    (found,) = ft.modes(tmp_path / "study.toml")
    np.testing.assert_allclose(
        found.freq_hz, [1283.200, 1283.200, 5781.975, 6919.399, 6919.399, 10172.615], rtol=5e-7
    )  # fmt: skip
