"""A chain of masses whose model is a table of runs: the study of it with its files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from tests.model.chain_runs import modes, sample

import femtune as ft
from femtune.dofs import DofSet
from femtune.files.runs_table import RunsTable, write_runs_table
from femtune.modal import ModeSet
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI

TRUTH = np.array([9e3, 2.4e4])
DOFS = DofSet.parse([f"{i}X+" for i in (1, 2, 3, 4)])
STUDY = """[study]
title = "Chain"
units = "m-kg-s"

[model]
grid = "nodes.bdf"

[runs]
file = "runs.csv"
degree = 1
crossed = false

[test]
file = "chain.uff"

[[parameter]]
name = "k1"
absolute = true
nominal = 1.2e4
lower = 5e3
upper = 1.6e4

[[parameter]]
name = "k2"
absolute = true
lower = 1e4
upper = 3.2e4

[residuals]
frequency_sd = 0.002
shape_sd = 0.02
"""


def table(count: int = 10, shapes: bool = True) -> RunsTable:
    points = sample(count)
    found = [modes(p) for p in points]
    phi = np.array([shape for _, shape in found]) if shapes else None
    columns = {"k1": points[:, 0], "k2": points[:, 1]}
    hz = np.array([hz for hz, _ in found])
    return RunsTable(columns, hz, phi, DOFS) if shapes else RunsTable(columns, hz)


def prepared(folder: Path) -> Path:
    """A study with its files."""
    lines = "".join(f"GRID,{i},,{float(i)},0.,0.\n" for i in (1, 2, 3, 4))
    (folder / "nodes.bdf").write_text(f"BEGIN BULK\n{lines}ENDDATA\n")
    write_runs_table(folder / "runs.csv", table())
    hz, phi = modes(TRUTH)
    frame = WireFrame(np.arange(1, 5), np.array([[float(i), 0.0, 0.0] for i in range(1, 5)]))
    test = ModalTest("chain", SI, frame, modes=ModeSet(hz, phi, DOFS))
    ft.write_test(test, folder / "chain.uff")
    (folder / "study.toml").write_text(STUDY)
    return folder / "study.toml"
