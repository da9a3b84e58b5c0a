"""The cantilever as a mesh of sixteen bars, and its FRFs up to high frequencies."""

from __future__ import annotations

import numpy as np
from tests.deck_models import model_of

from femtune.files.uff import write_uff_frfs
from femtune.model.response import frf, make_ports
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI

from .cantilever import Bench

N, HIGHEST = 16, 600.0
BARS = "\n".join(
    f"CBAR    {i:<8d}{1 if i <= N // 2 else 2:<8d}{i:<8d}{i + 1:<8d}0.0     1.0     0.0" for i in range(1, N + 1)
)
GRIDS = "\n".join(f"GRID    {i + 1:<8d}        {i / N:<8.5f}0.0     0.0" for i in range(N + 1))
BEAM = f"""SOL 103
CEND
SPC = 1
BEGIN BULK
{GRIDS}
MAT1    1       2.1+11          0.3     7850.                   .02
PBAR    1       1       1.0-3   2.0-7   5.0-7   4.0-7           $ root
PBAR    2       1       1.0-3   2.0-7   5.0-7   4.0-7           $ tip
{BARS}
CONM2   99      {N + 1:<8d}        2.0
SPC1    1       123456  1
ENDDATA
"""
TRUE = (("1.0-3   2.0-7   5.0-7   4.0-7           $ root", "1.0-3   2.3-7   5.0-7   4.0-7           $ root"),
        ("1.0-3   2.0-7   5.0-7   4.0-7           $ tip", "1.0-3   1.8-7   5.0-7   4.0-7           $ tip"))  # fmt: skip
TRUTH = [1.15, 0.9]
OUTPUTS = ("7Y+", "12Y+", f"{N + 1}Y+")


def measure(bench: Bench, lines: np.ndarray) -> None:
    """FRFs of the true deck, by the inverse of its dynamic stiffness at each line."""
    bench.write("beam.bdf", BEAM)
    write_functions(bench, BEAM, lines, "frfs.uff", OUTPUTS)


def write_functions(bench: Bench, text: str, lines: np.ndarray, name: str, outputs: tuple[str, ...]) -> None:
    """Those of a deck with the true values."""
    deck = bench.truth(TRUE, text)
    model = model_of(deck)
    exact = frf(model.at(np.zeros(0)), make_ports(model, ["7Y+"], outputs), lines, "accelerance", "direct")
    nodes = np.arange(1, N + 2)
    frame = WireFrame(nodes, np.column_stack([(nodes - 1.0) / N, np.zeros((N + 1, 2))]))
    write_uff_frfs(bench.folder / name, ModalTest("frfs", SI, frame, frfs=exact))
