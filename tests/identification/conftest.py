"""Structures whose modes are known, and their functions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.modal import FrfSet, pole_of


@dataclass(frozen=True)
class Known:
    """Real modes of unit modal mass: `freq_hz` (m,), `damping_ratio` (m,), `shapes` (n, m), `inputs` rows of them."""

    freq_hz: NDArray
    damping_ratio: NDArray
    shapes: NDArray
    inputs: tuple[int, ...] = (0,)

    def frfs(
        self, lines: NDArray, noise: float = 0.0, seed: int = 0, kind: str = "accelerance", decay: float = 0.0
    ) -> FrfSet:
        """Sum of the modes, with noise of √E|error|² = `noise` times the rms of all functions; at s = `decay` + iω."""
        poles, refs = pole_of(self.freq_hz, self.damping_ratio), self.shapes[list(self.inputs)]
        residues = np.einsum("ir,jr,r->ijr", self.shapes, refs, 1.0 / (2j * poles.imag))
        s = decay + 2j * np.pi * lines[:, None]
        values = residues @ (1.0 / (s - poles)).T + residues.conj() @ (1.0 / (s - poles.conj())).T
        values = values * s[:, 0] ** ["receptance", "mobility", "accelerance"].index(kind)
        rng = np.random.default_rng(seed)
        error = rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape)
        values = values + noise * np.sqrt(np.mean(np.abs(values) ** 2) / 2.0) * error
        return FrfSet(lines, values, self.dofs, self.dofs.select(self.inputs), kind)

    @property
    def dofs(self) -> DofSet:
        """1Z+, 2Z+, …"""
        return DofSet.parse(f"{i + 1}Z+" for i in range(len(self.shapes)))


@pytest.fixture(scope="session")
def three_modes() -> Known:
    """Two of them close, one reference that all move."""
    shapes = 0.5 * np.array([[1.0, 0.8, 0.5], [0.6, -1.0, 0.7], [0.4, 0.3, -1.0]])
    return Known(np.array([10.0, 11.0, 20.0]), np.array([0.01, 0.015, 0.02]), shapes)


@pytest.fixture(scope="session")
def eight_modes() -> Known:
    """Twelve responses, two references; modes 3 and 4 lie 0.4 % apart, damping from 0.1 to 3 %."""
    shapes = np.random.default_rng(7).standard_normal((12, 8)) / 3.0
    freq = np.array([8.0, 13.0, 25.0, 25.1, 37.0, 44.0, 52.0, 58.0])
    damping = np.array([0.01, 0.005, 0.001, 0.001, 0.02, 0.03, 0.004, 0.01])
    return Known(freq, damping, shapes, (0, 5))
