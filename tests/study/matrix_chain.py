"""A chain of springs and masses as matrices of another program, and the study of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.io
import scipy.linalg
import scipy.sparse as sp

from femtune.dofs import DofSet
from femtune.files.uff import write_uff_modes
from femtune.modal import ModeSet
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI

# a row of five masses on springs along X, the first to ground
LOWER, UPPER = np.array([1e4, 2e4, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 3e4, 2e4, 1e4])
MASS = np.diag([2.0, 1.0, 1.0, 1.5, 0.5])


def chain(springs: np.ndarray) -> np.ndarray:
    K = np.diag(springs + np.append(springs[1:], 0.0))
    return K - np.diag(springs[1:], 1) - np.diag(springs[1:], -1)


def hertz(K: np.ndarray) -> np.ndarray:
    return np.sqrt(scipy.linalg.eigvalsh(K, MASS)) / (2 * np.pi)


STUDY = """[study]
title = "Chain"
units = "m-kg-s"

[model]
dofs = "rows.dof"
listed_hz = {listed}
{model}

[modes]
count = 5

[[matrix]]
name = "LOWER"
kind = "stiffness"
file = "lower.mtx"

[[matrix]]
name = "UPPER"
kind = "stiffness"
file = "upper.mtx"

[[matrix]]
name = "MASS"
kind = "mass"
file = "mass.mtx"

[[parameter]]
name = "lower_k"
fields = ["MATRIX LOWER"]
lower = 0.5
upper = 2.0

[[parameter]]
name = "upper_k"
fields = ["MATRIX UPPER"]
lower = 0.5
upper = 2.0
"""
TESTED = """
[test]
file = "chain.uff"

[sensors]
by_id = true
"""


def written(folder: Path, text: str = TESTED, model: str = "", listed: list[float] | None = None) -> Path:
    """A folder with the study and all that it names."""
    for name, matrix in (("lower", chain(LOWER)), ("upper", chain(UPPER)), ("mass", MASS)):
        scipy.io.mmwrite(folder / f"{name}.mtx", sp.coo_array(matrix), precision=17)
    (folder / "rows.dof").write_text("".join(f"{10 * i} 1\n" for i in range(1, 6)))
    if "test" in text:
        values, shapes = scipy.linalg.eigh(chain(1.2 * LOWER + 0.9 * UPPER), MASS)
        dofs = DofSet.parse([f"{10 * i}X+" for i in range(1, 6)])
        places = np.stack([np.arange(5.0), np.zeros(5), np.zeros(5)], axis=1)
        frame = WireFrame(np.arange(10, 60, 10), places, np.tile(np.eye(3), (5, 1, 1)))
        modes = ModeSet(np.sqrt(values) / (2 * np.pi), shapes, dofs, source="test")
        write_uff_modes(folder / "chain.uff", ModalTest("chain", SI, frame, modes=modes))
    listing = hertz(chain(LOWER + UPPER)).tolist() if listed is None else listed
    (folder / "study.toml").write_text(STUDY.format(listed=listing, model=model) + text)
    return folder / "study.toml"
