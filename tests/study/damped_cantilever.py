"""The cantilever with a loss factor and two dashpots: its FRFs, and studies of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from tests.deck_models import model_of

from femtune.modal import FrfSet
from femtune.model import solve_modes
from femtune.model.response import frf, make_ports

from .cantilever import CANTILEVER, EI, TRUE, Bench

MATERIAL = "MAT1    1       2.1+11          0.3     7850."
DAMPED = CANTILEVER.replace(MATERIAL, f"{MATERIAL}                   .01").replace(
    "CONM2   9", "CDAMP2  20      40.     3       2\nCDAMP2  21      40.     3       3\nCONM2   9"
)
TRULY = (*TRUE, (".01\n", ".03\n"), ("CDAMP2  20      40.", "CDAMP2  20      90."))
PARAMETERS = f"""{EI}
[[parameter]]
name = "loss"
fields = ["MAT1 1 GE"]
lower = 0.001
upper = 0.2
absolute = true

[[parameter]]
name = "joint"
fields = ["CDAMP2 20 B"]
lower = 0.1
upper = 10.0
"""
TRUTH = [1.3, 0.85, 0.03, 2.25]
LINES = np.arange(4.0, 240.0, 0.5)
LABELS = ("3Y+", "5Y+", "5Z+")


def functions(
    deck: Path,
    noise: float = 0.0,
    inputs: tuple[str, ...] = ("5Y+", "5Z+"),
    outputs: tuple[str, ...] = LABELS,
    **options: object,
) -> FrfSet:
    """FRFs of a deck, past everything that a study does; noise as a part of the largest magnitude of each."""
    model = model_of(deck)
    ports, modes = make_ports(model, inputs, outputs), solve_modes(model.at(np.zeros(0)), 20)
    exact = frf(modes, ports, LINES, "accelerance", **options)  # type: ignore[arg-type]
    chance = np.random.default_rng(1)
    size = noise * np.abs(exact.values).max(axis=2, keepdims=True)
    scatter = chance.standard_normal(exact.values.shape) + 1j * chance.standard_normal(exact.values.shape)
    return replace(exact, values=exact.values + size * scatter)


def study_of(bench: Bench, residual: str, parameters: str = PARAMETERS, test: str | None = "frfs.uff") -> Path:
    bench.write("beam.bdf", DAMPED)
    return bench.study(f"{parameters}\n[[residual]]\n{residual}\n", test=test)
