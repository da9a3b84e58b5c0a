"""Functions of a small plate with coherences beside them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from femtune.dofs import DofSet
from femtune.files.uff import UffFile, read_uff, write_uff_frfs
from femtune.modal import FrfSet
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI

LINES = np.arange(1.0, 21.0)
LABELS = DofSet.parse(["1X+", "2X-"])


def coherence_set(node: int, direction: int, data: np.ndarray) -> str:
    """Data set 58 of function type 6, real, as other programs write it."""
    axis = "{:10d}    0    0    0 NONE                 {:<20}\n"
    numbers = "".join(f"{x:13.5E}" + ("\n" if i % 6 == 5 else "") for i, x in enumerate(data))
    return (
        "    -1\n    58\n" + "NONE\n" * 5
        + f"{6:5d}{0:10d}{0:5d}{0:10d} NONE      {node:10d}{direction:4d} NONE      {1:10d}{1:4d}\n"
        + f"{2:10d}{len(data):10d}{1:10d}{1.0:13.5E}{1.0:13.5E}{0.0:13.5E}\n"
        + axis.format(18, "Hz") + axis.format(0, "NONE") * 3 + numbers.rstrip() + "\n    -1\n"
    )  # fmt: skip


def content_of(folder: Path, coherences: dict[tuple[int, int], np.ndarray]) -> UffFile:
    """Two FRFs, and coherences by node and signed direction of the response; the reference is 1X+."""
    rng = np.random.default_rng(1)
    values = rng.standard_normal((2, 1, 20)) + 1j * rng.standard_normal((2, 1, 20))
    frame = WireFrame(np.array([1, 2]), np.arange(6.0).reshape(2, 3))
    frfs = FrfSet(LINES, values, LABELS, DofSet.parse(["1X+"]), "accelerance")
    path = write_uff_frfs(folder / "a.uff", ModalTest("plate", SI, frame, frfs=frfs))
    for (node, direction), data in coherences.items():
        text = coherence_set(node, direction, data)
        path.write_text(path.read_text() + text)
    return read_uff(path, units=SI)
