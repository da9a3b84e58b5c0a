"""Matrices of one element, of femtune and of another solver."""

from __future__ import annotations

from pathlib import Path

from tests.loaded import load_module

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "09_element_matrices"


op2, changed_decks, commercial, ours = (
    load_module(EXAMPLE / f"{name}.py") for name in ("op2", "changed_decks", "commercial", "ours")
)
